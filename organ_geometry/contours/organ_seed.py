"""A point of the organ in one image of a stack, which says what is to be followed."""

import math
from dataclasses import dataclass
from typing import TypeAlias

from organ_geometry.images.grey_image import ImageStackError
from organ_geometry.images.image_stack import ImageStack

Seed: TypeAlias = tuple[float, float] | tuple[float, float, int]
"""Column x and row y of a pixel of the organ, from 0, and the number of its image, or the first."""


@dataclass(frozen=True, slots=True)
class SeedPoint:
    """A point of the organ in one image.

    Attributes
    ----------
    x, y
        Column and row, px.
    index
        Number of the image, from 0.
    """

    x: float
    y: float
    index: int

    @property
    def place(self) -> tuple[float, float]:
        """Column and row, px."""
        return self.x, self.y


def seed_point(seed: Seed, stack: ImageStack) -> SeedPoint:
    """Return a seed as a point of a stack."""
    x, y = float(seed[0]), float(seed[1])
    index = seed[2] if len(seed) == 3 else 0
    if not 0 <= index < len(stack):
        raise ImageStackError(
            f"the seed's image must be one of {len(stack)}, from 0 to {len(stack) - 1}, not {index}"
        )
    rows, columns = stack.shape
    if not (math.isfinite(x) and math.isfinite(y) and 0 <= x <= columns - 1 and 0 <= y <= rows - 1):
        where = "the first image" if index == 0 else f"image {index}"
        raise ImageStackError(
            f"seed must be a point x, y of {where}, from 0, 0 to {columns - 1}, {rows - 1}, "
            f"not {x:g}, {y:g}"
        )
    return SeedPoint(x, y, index)
