"""A grey image, its source, and the error of images that cannot be read."""

from collections.abc import Iterable
from typing import Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

GreyImage: TypeAlias = NDArray[np.uint8 | np.uint16]


class ImageStackError(ValueError):
    """A stack of images that cannot be used, with one line saying what would be right."""


class Slices(Protocol):
    """Where the images of a stack come from; several threads may ask at once."""

    def image(self, index: int) -> GreyImage:
        """Return the (H, W) image of that number, from 0."""
        ...


def size_text(shape: tuple[int, ...]) -> str:
    """Return (H, W) as "W x H", as sizes of images are said."""
    return f"{shape[1]} x {shape[0]}"


def list_text(items: Iterable[object], most: int = 30) -> str:
    """Return items as "1, 2, 3", cut short where there are many."""
    texts = [str(item) for item in items]
    return ", ".join(texts[:most]) + (" ..." if len(texts) > most else "")
