"""A picture in which a pixel can be picked, and the text field that receives it."""

import base64
import html
import re

import cv2
import numpy as np
from numpy.typing import NDArray


def picture_html(
    picture: NDArray[np.uint8], description: str, shape: tuple[int, int], index: int | None
) -> str:
    """Return a picture, as HTML; a click in it writes its pixel into the text field after it."""
    done, content = cv2.imencode(".png", picture[:, :, ::-1])
    assert done  # noqa: S101 (a picture of our own)
    data = base64.b64encode(content.tobytes()).decode()
    picked = ""
    if index is not None:
        picked = f" data-image='{index}' data-columns='{shape[1]}' data-rows='{shape[0]}'"
    cursor = "crosshair" if index is not None else "default"
    return (
        f"<div style='padding:2px 12px'><img data-testid='build-image'{picked} "
        f"alt='{html.escape(description, quote=True)}' src='data:image/png;base64,{data}' "
        f"style='display:block;width:100%;border-radius:4px;cursor:{cursor}'></div>"
    )


def picked_pixel(text: str) -> tuple[int, int, int] | None:
    """Return "120,95,30" as (120, 95, 30)."""
    numbers = re.fullmatch(r"\s*(\d{1,6})\s*,\s*(\d{1,6})\s*,\s*(\d{1,6})\s*", text, re.ASCII)
    return None if numbers is None else (int(numbers[1]), int(numbers[2]), int(numbers[3]))
