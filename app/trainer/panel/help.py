"""Help: the first minute in three lines, and the rest for who asks for it."""

from typing import Literal

import viser

from app.trainer.panel.controls import on_click

__all__ = ["HELP", "HOTKEYS", "SEEN", "show_first_minute", "show_help"]

HOTKEYS: tuple[tuple[Literal["R", "T", "P", "H"], str, str], ...] = (
    ("R", "Reset", "a new, whole duct"),
    ("T", "Ramp to tear", "an even pull until the duct tears"),
    ("P", "Pause or go on", "time stands still"),
    ("H", "Heat map", "stress on the surface, on or off"),
)
"""Key, command and what it does."""

_FIRST_MINUTE = (
    "<ol data-testid='first-minute' style='margin:0;padding:0 12px 4px 30px;font-size:16px;"
    "line-height:1.6'><li><b>Drag the duct</b> upwards with the mouse or a finger; it pulls back."
    "</li><li>Watch <b>Distance to break</b>: at 0 % the duct tears.</li>"
    "<li><b>Reset</b> gives a new one. Then try the <b>exercises</b> under <b>Learn</b>.</li></ol>"
)
HELP = (
    """\
**Goal.** Free the duct without tearing it.

**By hand** the mouse leads the hook, and the beam answers with its force, shown at the arrow.
**By the slider** the force is set, and the duct gives as far as it must. Drag beside the duct
to look around, scroll to come nearer.

**What is computed.** The duct is one beam between two clamps. It tears where normal stress +
bending stress > threshold T. How the torn ends gape and swing is drawn, not computed.

**Words** with dots under them, and measures with a question mark, explain themselves: rest the
mouse on them, or click.

**Keys**

"""
    + "\n".join(f"- **{key}** {name}: {what}" for key, name, what in HOTKEYS)
    + "\n- **Ctrl+K** all commands\n"
)


def show_first_minute(client: viser.ClientHandle) -> None:
    """Show the first minute's three lines over the page, until they are dismissed.

    Parameters
    ----------
    client
        The client.
    """
    gui = client.gui
    modal = gui.add_modal("Blunt-dissection trainer")
    with modal:
        gui.add_html(_FIRST_MINUTE)
        start = gui.add_button("Start", icon=viser.Icon.HAND_MOVE)

    def close() -> None:
        modal.close()
        client.local_storage.set_item(SEEN, "1")

    on_click(start, close)


SEEN = "first-minute"
"""Under which the browser remembers that it has shown the first minute."""


def show_help(client: viser.ClientHandle) -> None:
    """Show all of the help over the page, until it is closed.

    Parameters
    ----------
    client
        The client.
    """
    gui = client.gui
    modal = gui.add_modal("Help")
    with modal:
        gui.add_html(_FIRST_MINUTE)
        gui.add_markdown(HELP)
        close = gui.add_button("Close", icon=viser.Icon.X, color="gray")
    on_click(close, modal.close)
