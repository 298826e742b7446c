"""The style and the script of the trainer's page, and what can be asked of it."""

import json
import secrets
from functools import cache
from pathlib import Path
from typing import Any

import viser

from app.trainer.viser_bridge.private_api import page_number, queue_script

__all__ = [
    "announce",
    "closer_html",
    "keep_in_sight",
    "kept_by_tab",
    "letter_keys_on",
    "offer_home",
    "open_tab",
    "prepare_page",
    "run_in_page",
    "set_arrow_step",
    "set_letter_keys",
    "tab_keeps",
    "watch_pace",
]

ANSWER_SECONDS = 4.0
"""How long a browser may take to say what it keeps: one that draws in software is busy at first."""
_CLOSER = "bd-closer"  # as in page.css
_LETTER_KEYS = "letter-keys"


@cache
def _file(name: str) -> str:
    return Path(__file__).with_name(name).read_text(encoding="utf-8")


def prepare_page(client: viser.ClientHandle) -> None:
    """Give a page its style, and the script that the other calls lean on; before them."""
    given = ", ".join(json.dumps(each) for each in (_file("page.css"), _CLOSER, _LETTER_KEYS))
    queue_script(client.gui, f"({_file('page.js')})({given})")


def announce(client: viser.ClientHandle, words: str) -> None:
    """Let a screen reader say something when it has said what it is saying."""
    _call(client, "say", words)


def offer_home(
    client: viser.ClientHandle, command: viser.CommandHandle, label: str, hint: str
) -> None:
    """Put a button over the picture that does what a command does."""
    _call(client, "offerHome", page_number(command), label, hint)


def open_tab(client: viser.ClientHandle, label: str) -> None:
    """Open the tab of the panel that has a label; as soon as it is there."""
    _call(client, "openTab", label)


def set_arrow_step(
    client: viser.ClientHandle, slider: viser.GuiSliderHandle[float], percent: float
) -> None:
    """Let an arrow key move a slider by `percent`, in its unit, and with Shift by a tenth of it."""
    _call(client, "setArrowStep", page_number(slider), percent, slider.precision)


def keep_in_sight(
    client: viser.ClientHandle,
    *,
    place: tuple[float, float, float],
    target: tuple[float, float, float],
    low: tuple[float, float, float],
    high: tuple[float, float, float],
    nearest: float,
    lowest: float,
) -> None:
    """Put a client's camera where it belongs, and bound where it can be taken from there."""
    _call(client, "keepInSight", place, target, low, high, nearest, lowest)


def kept_by_tab(client: viser.ClientHandle) -> str | None:
    """Return the text that `tab_keeps` gave to a browser's tab; None without one or an answer."""
    # viser reads the browser's storage only, which all of its tabs share: the script copies the
    # tab's own into it for a moment, under a name that no other page knows.
    name = f"tab-{secrets.token_hex(8)}"
    _call(client, "showKept", name)
    try:
        return client.local_storage.get_item(name, ANSWER_SECONDS) or None
    except (RuntimeError, TimeoutError):
        return None
    finally:
        client.local_storage.remove_item(name)


def tab_keeps(client: viser.ClientHandle, value: str) -> None:
    """Let a browser's tab keep a text until it is closed, through every reload."""
    _call(client, "keep", value)


def letter_keys_on(client: viser.ClientHandle) -> bool:
    """Return whether single letters are keys in this browser, as they are until it is said."""
    try:
        return client.local_storage.get_item(_LETTER_KEYS, ANSWER_SECONDS) != "off"
    except (RuntimeError, TimeoutError):
        return True


def set_letter_keys(client: viser.ClientHandle, on: bool) -> None:
    """Let single letters be keys in this browser, or not; it is kept there."""
    client.local_storage.set_item(_LETTER_KEYS, "on" if on else "off")


def closer_html() -> str:
    """Return the mark that makes the next button of a dialog the one that closes it."""
    return f"<div class='{_CLOSER}'></div>"


def watch_pace(
    client: viser.ClientHandle, *, least: float, command: viser.CommandHandle | None, remedy: str
) -> None:
    """Name a remedy to a page that draws in software; run a command below `least` pictures/s."""
    number = "" if command is None else page_number(command)
    _call(client, "watchPace", least, number, remedy)


def run_in_page(scene: viser.SceneApi, source: str) -> None:
    """Run a script in each page of a scene.

    It is given `viewer`, whose `scene()` is three.js's scene once there is one, and whose
    `node(name)` is the three.js object of a scene node, undefined where there is none.
    """
    queue_script(scene, f"(viewer => {{{source}\n}})({_VIEWER})")


_VIEWER = (
    "{scene: () => window.__viserMutable?.scene, "
    "node: name => window.__viserMutable.nodeRefFromName[name]}"
)


def _call(client: viser.ClientHandle, name: str, *arguments: Any) -> None:
    given = ", ".join(json.dumps(each) for each in arguments)
    queue_script(client.gui, f"window.bluntdissect?.{name}({given})")
