"""The style and the script of the trainer's page, and functions that use them."""

import base64
import json
import secrets
from collections.abc import Iterable, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import viser
from numpy.typing import NDArray

from app.trainer.viser_bridge.private_api import page_number, queue_script

# s that a browser may take to answer: one that draws in software is busy at first.
ANSWER_SECONDS = 4.0
# s that a page may take for its first answer; its reader waits in a thread of its own.
OPENING_SECONDS = 15.0
_CLOSER, _BEGIN, _PAIRS = "bd-closer", "bd-begin", "bd-pairs"  # as in page.css
_LETTER_KEYS = "letter-keys"


@cache
def file_text(path: Path) -> str:
    """Return a text file, read once."""
    return path.read_text(encoding="utf-8")


def prepare_page(client: viser.ClientHandle) -> None:
    """Give a page its style, and the script that the other functions here need; call it first."""
    script, style = (file_text(Path(__file__).with_name(name)) for name in ("page.js", "page.css"))
    queue_script(client.gui, _called(f"({script})", (style, _CLOSER, _BEGIN, _LETTER_KEYS)))


def cover_page(client: viser.ClientHandle, lines: Sequence[str], *, waits: bool) -> None:
    """Cover a page that has just opened with a title and more lines; a bar moves while it waits."""
    _call(client, "cover", waits, *lines)


def uncover_page(client: viser.ClientHandle) -> None:
    """Show a covered page as soon as its panel is there."""
    _call(client, "uncover")


def announce(client: viser.ClientHandle, words: str) -> None:
    """Have a screen reader say something, after what it is saying now."""
    _call(client, "say", words)


def bring_in(client: viser.ClientHandle, name: str) -> None:
    """Scroll the panel to one of its lines, by its `data-testid`."""
    _call(client, "bringIn", name)


def take_arrows(client: viser.ClientHandle, taken: bool) -> None:
    """Let the arrow keys be keys of commands, and turn the view only with Ctrl; or not any more."""
    _call(client, "takeArrows", taken)


def offer_home(
    client: viser.ClientHandle, command: viser.CommandHandle, label: str, hint: str
) -> None:
    """Add a button over the picture that runs a command."""
    _call(client, "offerHome", page_number(command), label, hint)


def open_tab(client: viser.ClientHandle, label: str) -> None:
    """Open the panel's tab with this label, as soon as it exists."""
    _call(client, "openTab", label)


def set_arrow_step(
    client: viser.ClientHandle, slider: viser.GuiSliderHandle[float], percent: float
) -> None:
    """Let an arrow key move a slider by `percent`, in its unit, and with Shift by a tenth."""
    _call(client, "setArrowStep", page_number(slider), percent, slider.precision)


def keep_in_sight(
    client: viser.ClientHandle,
    *,
    place: NDArray[np.float64],
    target: NDArray[np.float64],
    low: NDArray[np.float64],
    high: NDArray[np.float64],
    nearest: float,
    lowest: float,
) -> None:
    """Place a client's camera, and limit where the user can move it; (3,) mm, and mm."""
    # viser sets the camera's place and its target one after the other, and each would be clamped to
    # the limits with the other's old value. The target stays in the box from `low` to `high`.
    points = [each.tolist() for each in (place, target, low, high)]
    _call(client, "keepInSight", *points, nearest, lowest)


def kept_by_tab(client: viser.ClientHandle) -> str | None:
    """Return the text stored by `tab_keeps`, if any; TimeoutError from a page that is mute."""
    return _answer(client, "showKept")


def asked_by_address(client: viser.ClientHandle, key: str) -> str | None:
    """Return what a page's address says of a key, as in `/?key=value`; else as `kept_by_tab`."""
    return _answer(client, "showAsked", key)


def tab_keeps(client: viser.ClientHandle, value: str) -> None:
    """Have a browser's tab store a text until it is closed, through every reload."""
    _call(client, "keep", value)


def letter_keys_on(client: viser.ClientHandle) -> bool:
    """Return whether single-letter keys are on in this browser; they are by default."""
    try:
        return client.local_storage.get_item(_LETTER_KEYS, ANSWER_SECONDS) != "off"
    except (RuntimeError, TimeoutError):
        return True


def set_letter_keys(client: viser.ClientHandle, on: bool) -> None:
    """Switch single-letter keys on or off in this browser, which stores the choice."""
    client.local_storage.set_item(_LETTER_KEYS, "on" if on else "off")


def closer_html() -> str:
    """Return the HTML mark that makes a dialog's next button its closing button."""
    return f"<div class='{_CLOSER}'></div>"


def begin_html() -> str:
    """Return the HTML mark that gives a dialog's next button the focus."""
    return f"<div class='{_BEGIN}'></div>"


def pairs_html() -> str:
    """Return the HTML mark after which buttons and checkboxes of a tab stand two in a row."""
    return f"<div class='{_PAIRS}'></div>"


def watch_pace(
    client: viser.ClientHandle, *, least: float, command: viser.CommandHandle | None, remedy: str
) -> None:
    """Suggest a remedy to a page that draws in software; run a command below `least` frames/s."""
    number = "" if command is None else page_number(command)
    _call(client, "watchPace", least, number, remedy)


def run_in_page(scene: viser.SceneApi, source: str) -> None:
    """Run a script in each page of a scene.

    Its `viewer` has three functions: `scene()`, three.js's scene once there is one; `node(name)`,
    the three.js object of a scene node, or undefined; and `redraw()`, which draws a still picture
    again.
    """
    queue_script(scene, f"(viewer => {{{source}\n}})({_VIEWER})")


def run_function(scene: viser.SceneApi, name: str, *arguments: Any) -> None:
    """Call a function that a module has defined in each page of a scene."""
    run_in_page(scene, _called(name, arguments))


def run_module(scene: viser.SceneApi, module: Path, name: str, *arguments: Any) -> None:
    """Define what is in a file in each page of a scene, and call a function of it."""
    run_in_page(scene, f"{file_text(module)}\n{_called(name, arguments)}")


def run_picture(scene: viser.SceneApi, files: Iterable[Path], name: str, *arguments: Any) -> None:
    """Define what is in files in each page of a scene, and call a function of theirs.

    Their `viewer` has what `picture_tools.js` adds to it, besides what `run_in_page` gives.
    """
    tools = Path(__file__).with_name("picture_tools.js")
    texts = [file_text(path) for path in (tools, *files)]
    run_in_page(scene, "\n".join([*texts, _called(name, arguments)]))


def float32_text(numbers: NDArray[np.generic]) -> str:
    """Return a large array for a page: base64 of little-endian float32."""
    return base64.b64encode(numbers.astype("<f4").tobytes()).decode()


_VIEWER = (
    "{scene: () => window.__viserMutable?.scene, "
    "node: name => window.__viserMutable.nodeRefFromName[name], "
    "redraw: () => window.__viserMutable?.requestRender?.()}"
)


def _call(client: viser.ClientHandle, name: str, *arguments: Any) -> None:
    queue_script(client.gui, _called(f"window.bluntdissect?.{name}", arguments))


def _called(name: str, arguments: Iterable[Any]) -> str:
    """Return a call of a function of the page."""
    return f"{name}({', '.join(map(json.dumps, arguments))})"


def _answer(client: viser.ClientHandle, name: str, *arguments: Any) -> str | None:
    """Return the text that a function of the page shows; TimeoutError from a page that is mute."""
    # viser reads only the browser's storage, which all tabs share. So the script copies the tab's
    # own value into it for a moment, under a name that no other page knows.
    place = f"tab-{secrets.token_hex(8)}"
    _call(client, name, place, *arguments)
    try:
        return client.local_storage.get_item(place, OPENING_SECONDS) or None
    except RuntimeError:
        return None
    finally:
        client.local_storage.remove_item(place)
