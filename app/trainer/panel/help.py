"""Help: three lines for the first minute, and the rest on request."""

from typing import Literal

import viser

from app.trainer.panel.controls import on_click, on_input
from app.trainer.panel.dialog import Dialog
from app.trainer.viser_bridge import letter_keys_on, set_letter_keys

__all__ = ["HELP", "HOTKEYS", "SEEN", "show_first_minute", "show_help"]

HOTKEYS: tuple[tuple[Literal["R", "T", "P", "H", "V"], str, str], ...] = (
    ("R", "Reset", "a new, whole duct, and the view home"),
    ("T", "Ramp to tear", "an even pull until the duct tears"),
    ("P", "Pause or go on", "time stands still"),
    ("H", "Heat map", "stress on the surface, on or off"),
    ("V", "View home", "the camera back to where it shows the whole duct"),
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
    + "\n- **Arrows** on *Force F*: 1 % of the force at break, with **Shift** 0.1 %; elsewhere "
    "they turn the view\n- **Esc** closes a page like this one\n- **Ctrl+K** all commands\n"
)


def show_first_minute(client: viser.ClientHandle) -> None:
    """Show the three lines for the first minute over the page, until they are dismissed."""
    gui = client.gui
    dialog = Dialog(
        gui,
        "Blunt-dissection trainer",
        closed=lambda: client.local_storage.set_item(SEEN, "1"),
    )
    with dialog:
        gui.add_html(_FIRST_MINUTE)
        start = gui.add_button("Start", icon=viser.Icon.HAND_MOVE)
    on_click(start, dialog.close)


SEEN = "first-minute"
"""Key under which the browser remembers that it has shown the first minute."""


def show_help(client: viser.ClientHandle) -> None:
    """Show the whole help over the page, until it is closed."""
    gui = client.gui
    with Dialog(gui, "Help"):
        gui.add_html(_FIRST_MINUTE)
        gui.add_markdown(HELP)
        letters = gui.add_checkbox(
            "Letter keys",
            initial_value=letter_keys_on(client),
            hint="Whether single letters are keys; off where they get in the way of a voice, a "
            "screen reader or a trembling hand",
        )
    on_input(letters, lambda value: set_letter_keys(client, value is True))
