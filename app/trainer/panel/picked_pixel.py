"""A picture of an image in which a pixel can be pointed at, and the field that takes the pixel."""

import base64
import html
import re

import cv2
import numpy as np
import viser
from numpy.typing import NDArray
from viser import _messages  # pyright: ignore[reportPrivateUsage]

__all__ = ["let_pixels_be_picked", "picked_pixel", "picture_html"]

# viser's images do not say where they were clicked. The field is the first text field after one.
_SCRIPT = """
if (!window.bluntdissectPickedPixel) {
  window.bluntdissectPickedPixel = true;
  document.addEventListener("click", event => {
    const image = event.target;
    if (!(image instanceof HTMLImageElement) || !image.dataset.columns) return;
    const box = image.getBoundingClientRect();
    const pixel = (place, start, length, count) =>
      Math.min(Math.max(Math.floor((place - start) / length * count), 0), count - 1);
    const x = pixel(event.clientX, box.left, box.width, Number(image.dataset.columns));
    const y = pixel(event.clientY, box.top, box.height, Number(image.dataset.rows));
    const field = [...document.querySelectorAll("input.mantine-TextInput-input")].find(
      each => image.compareDocumentPosition(each) & Node.DOCUMENT_POSITION_FOLLOWING);
    if (!field) return;
    const value = Object.getOwnPropertyDescriptor(HTMLInputElement.prototype, "value");
    value.set.call(field, `${x},${y},${image.dataset.image}`);
    field.dispatchEvent(new Event("input", {bubbles: true}));
  });
}
"""


def let_pixels_be_picked(gui: viser.GuiApi) -> None:
    """Let a click in a picture write its pixel into the first text field after the picture.

    Parameters
    ----------
    gui
        The client's own GUI.
    """
    gui._websock_interface.queue_message(  # pyright: ignore[reportPrivateUsage]
        _messages.RunJavascriptMessage(source=_SCRIPT)
    )


def picture_html(
    picture: NDArray[np.uint8], said: str, shape: tuple[int, int], index: int | None
) -> str:
    """Return a picture, as HTML.

    Parameters
    ----------
    picture
        (h, w, 3) RGB.
    said
        What is seen in it, for who cannot see it.
    shape
        (2,) rows and columns of the image that it shows.
    index
        Number of that image, or None if no pixel of it can be pointed at.

    Returns
    -------
    str
        HTML.
    """
    done, content = cv2.imencode(".png", picture[:, :, ::-1])
    assert done  # noqa: S101 (a picture of our own)
    data = base64.b64encode(content.tobytes()).decode()
    picked = ""
    if index is not None:
        picked = f" data-image='{index}' data-columns='{shape[1]}' data-rows='{shape[0]}'"
    cursor = "crosshair" if index is not None else "default"
    return (
        f"<div style='padding:2px 12px'><img data-testid='build-image'{picked} "
        f"alt='{html.escape(said, quote=True)}' src='data:image/png;base64,{data}' "
        f"style='display:block;width:100%;border-radius:4px;cursor:{cursor}'></div>"
    )


def picked_pixel(text: str) -> tuple[int, int, int] | None:
    """Return "120,95,30" as (120, 95, 30).

    Parameters
    ----------
    text
        What a browser sent.

    Returns
    -------
    tuple[int, int, int] | None
        Column, row and image, from 0; None if it is no three whole numbers.
    """
    numbers = re.fullmatch(r"\s*(\d{1,6})\s*,\s*(\d{1,6})\s*,\s*(\d{1,6})\s*", text, re.ASCII)
    return None if numbers is None else (int(numbers[1]), int(numbers[2]), int(numbers[3]))
