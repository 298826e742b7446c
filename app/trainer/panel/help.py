"""Help: three lines for the first minute, and the rest on request."""

from typing import Literal, NamedTuple

import viser

from app.simulation import Session
from app.trainer.panel.controls import on_click, on_input
from app.trainer.panel.dialog import dialog
from app.trainer.viser_bridge.page import begin_html, letter_keys_on, set_letter_keys

Hotkey = Literal[
    "R", "T", "P", "H", "V", "X", "N", "G", "O", "C", "Z", "J", "L", "B", "K", "U", "Y", "I",
    "arrowup", "arrowdown", "arrowleft", "arrowright",
]  # fmt: skip


class Key(NamedTuple):
    """A key, the command that it runs and what that does."""

    name: str  # as the help writes it
    hotkey: Hotkey
    title: str
    meaning: str
    modifier: Literal["shift"] | None = None


_ALL = (
    Key("H", "H", "Colours", "tissue, stress or, of a bed, what is freed"),
    Key("P", "P", "Pause or go on", "time stands still; not in an exercise"),
    Key("R", "R", "Reset", "a new, whole duct, and the view home"),
    Key("V", "V", "View home", "the camera back to where it shows the whole duct"),
)
_IN_PLANE = (
    Key("G", "G", "Take hold or let go", "the hook, in the middle or where it is"),
    Key("Up", "arrowup", "Lift", "the hook by half a millimetre, with the duct that it holds"),
    Key("Down", "arrowdown", "Lower", "the hook by half a millimetre"),
    Key("T", "T", "Ramp to tear", "an even pull until the duct tears"),
)
_IN_SPACE = (
    Key("Left", "arrowleft", "Move left", "the active hand's tip along the duct"),
    Key("Right", "arrowright", "Move right", "the active hand's tip along the duct"),
    Key("Up", "arrowup", "Move up", "the active hand's tip off the bed"),
    Key("Down", "arrowdown", "Move down", "the active hand's tip towards the bed"),
    Key("Shift+Up", "arrowup", "Move away", "the active hand's tip into the picture", "shift"),
    Key("Shift+Down", "arrowdown", "Move near", "the active hand's tip towards you", "shift"),
    Key("G", "G", "Take hold or let go", "the active hand, at the duct below its tip"),
    Key("O", "O", "Open the jaws", "of the active hand's dissector"),
    Key("C", "C", "Close the jaws", "of the active hand's dissector"),
    Key("X", "X", "Other hand", "the mouse and the keys lead the other hand"),
    Key("N", "N", "Next instrument", "for the active hand"),
)

_BED_LINES = (
    "<b>Press the duct and drag</b> it off its bed, with the mouse or a finger: strands "
    "stretch, and part. <b>Let go</b>, and take hold again close to where it is still held.",
    "Watch <b>Distance to break</b>: at 0 % the duct tears. <b>Slowly and straight up</b> "
    "spares it most.",
    "A <b>dissector</b> spreads strands from behind, a <b>grasper</b> holds while the other "
    "hand works. <b>Reset</b> makes all whole; <b>exercises</b> are under <b>Learn</b>.",
)
_FREE_LINES = (
    "<b>Drag the duct</b> upwards with the mouse or a finger; it pulls back.",
    "Watch <b>Distance to break</b>: at 0 % the duct tears.",
    "<b>Reset</b> gives a new one. Then try the <b>exercises</b> under <b>Learn</b>.",
)
_ANATOMY_LINES = (
    "<b>Press in the picture</b> and the tip comes under the pointer; <b>drag</b> it, or what it "
    "holds. The <b>wheel</b>, or two fingers, take it in along its shaft (roll away from you) and "
    "out.",
    "The <b>right button</b> or <b>G</b> uses it: a grasper takes hold of the gallbladder, to pull "
    "it gently; jaws part loose tissue. <b>X</b> leads the other hand, <b>N</b> changes what it "
    "has.",
    "Clear the triangle until <b>two tubes alone</b> run into the gallbladder. Tear nothing. "
    "<b>Learn</b>, then <b>Start</b>, leads you there step by step. <b>Reset</b> makes all whole.",
)
_BED_GOAL = """\
**Goal.** Free the duct from its bed without tearing it. A good hand frees most at the least stress:
close to the front where strands still hold, straight off the bed, without haste.
"""
_FREE_GOAL = "**Goal.** Find how far the duct can be pulled before it tears.\n"
_HANDS = """\
**The hands.** A **hook** takes the duct where you press and lets go with the mouse. A **grasper**
does so too, and stays where you leave it until you let go (G). A **dissector** parts
strands by opening its jaws behind the duct, a **swab** by sweeping. Press an instrument to lead it
and to make its hand the active one. A drag leads it along the duct and straight up off the bed;
with **Shift**, the right button or *Into the picture* it goes in depth, across the duct. Drag
beside the duct to look around, scroll to come nearer.
"""
_FORCE = """\
**By hand** the mouse leads the hook, and the beam answers with its force, shown at the arrow.
**By the slider** the force is set, and the duct gives as far as it must. Drag beside the duct
to look around, scroll to come nearer. *Theory* under **Compare** gives it two hands in space.
"""
_BED_FIGURES = """\
**The figures.** *Distance to break* is 100 % for a slack duct and 0 % where it tears. *Loosened*
is the length that the broken strands held. *Economy of work* is the part of your work
that broke strands; the rest has stretched the duct. Arrows show the force of each hand.
"""
_TEARS = """\
It tears where normal stress +
bending stress, nominal (force by the area at rest), > threshold T. How the torn ends gape and swing
is drawn, not computed.
"""
_BED_COMPUTED = f"""\
**What is computed.** The duct is a beam in space, each strand a spring that yields, parts and never
heals. {_TEARS.strip()} Strands part only as far
as the hands' work pays for it. Left out: fluid, cutting, heat and friction.
"""
_FREE_COMPUTED = f"""\
**What is computed.** The duct is one beam between two clamps. {_TEARS.strip()}
"""


DEVICE_KEY = "- **F** Device's force off or on: while a haptic device leads a hand"


def keys_of(session: Session) -> tuple[Key, ...]:
    """Return the keys for what is in hand."""
    return (*(_IN_SPACE if session.specimen.theory is None else _IN_PLANE), *_ALL)


def _help(session: Session) -> str:
    in_plane, in_bed = session.specimen.theory is not None, session.specimen.bed is not None
    sections = [
        _BED_GOAL if in_bed else _FREE_GOAL,
        _FORCE if in_plane else _HANDS,
        *([_BED_FIGURES] if in_bed else []),
        _BED_COMPUTED if in_bed else _FREE_COMPUTED,
    ]
    arrows = (
        "- **Arrows** on *Force F*: 1 % of the force at break, with **Shift** 0.1 %; "
        "**Ctrl+Arrows** turn the view"
        if in_plane
        else "- **Ctrl+Arrows** turn the view; **Arrows** on a slider move it"
    )
    listed = "\n".join(f"- **{key.name}** {key.title}: {key.meaning}" for key in keys_of(session))
    about = "\n".join(sections)
    return (
        f"{about}\n**Words** with dots under them, and measures with a question mark, explain "
        "themselves: rest the\nmouse on them, or click.\n\n**Keys**\n\n"
        f"{listed}\n- **M** The next scene: in the order of the panel\n{DEVICE_KEY}\n{arrows}\n"
        "- **Esc** closes a page like this one\n- **Ctrl+K** all commands\n"
    )


def first_minute(session: Session) -> str:
    """Return the three lines for the first minute, as HTML."""
    specimen = session.specimen
    in_bed = _BED_LINES if specimen.bed is not None else _FREE_LINES
    lines = in_bed if specimen.anatomy is None else _ANATOMY_LINES
    items = "".join(f"<li>{line}</li>" for line in lines)
    return (
        "<ol data-testid='first-minute' style='margin:0;padding:0 12px 12px 30px;font-size:16px;"
        f"line-height:1.6'>{items}</ol>"
    )


def show_first_minute(client: viser.ClientHandle, session: Session) -> None:
    """Show the three lines for the first minute over the page, until they are dismissed."""
    gui = client.gui

    def remember() -> None:
        client.local_storage.set_item(SEEN, "1")

    with dialog(gui, "Blunt-dissection trainer", closed=remember) as close:
        gui.add_html(first_minute(session) + begin_html())
        on_click(gui.add_button("Begin", icon=viser.Icon.HAND_MOVE), close)


SEEN = "first-minute"
"""Key under which the browser remembers that it has shown the first minute."""


def show_help(client: viser.ClientHandle, session: Session) -> None:
    """Show the whole help over the page, until it is closed."""
    gui = client.gui
    with dialog(gui, "Help"):
        gui.add_html(first_minute(session))
        gui.add_markdown(_help(session))
        letters = gui.add_checkbox(
            "Letter keys",
            initial_value=letter_keys_on(client),
            hint="Whether single letters are keys; off where they get in the way of a voice, a "
            "screen reader or a trembling hand",
        )
    on_input(letters, lambda value: set_letter_keys(client, value is True))
