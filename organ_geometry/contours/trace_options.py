"""Options of tracing: which organ of the images, and how its edge is defined."""

import math
from dataclasses import dataclass
from typing import Literal, TypeAlias

from organ_geometry.images.grey_image import ImageStackError
from organ_geometry.images.image_stack import ImageStack

Polarity: TypeAlias = Literal["auto", "bright", "dark"]
FoundPolarity: TypeAlias = Literal["bright", "dark"]
EdgeMethod: TypeAlias = Literal["half-level", "canny"]
Seed: TypeAlias = tuple[float, float] | tuple[float, float, int]
"""Column x and row y of a pixel of the organ, from 0, and the number of its image, or the first."""


@dataclass(frozen=True, slots=True)
class TraceOptions:
    """Which organ to trace and how its edge is defined; defaults are decided by the images.

    Attributes
    ----------
    polarity
        Whether the organ is brighter or darker than its surroundings.
    threshold
        Grey level of the edge; None for half way between organ and surroundings.
    method
        "half-level", to a part of a pixel, or "canny", as in the thesis.
    seed
        A pixel of the organ where other things are in view; None for the largest thing.
    edge_shift_mm
        How far edges are moved away from the organ's tissue, mm; negative for into it.
    """

    polarity: Polarity = "auto"
    threshold: float | None = None
    method: EdgeMethod = "half-level"
    seed: Seed | None = None
    edge_shift_mm: float = 0.0

    def __post_init__(self) -> None:
        if self.polarity not in {"auto", "bright", "dark"}:
            raise ValueError(f"polarity must be auto, bright or dark, not {self.polarity!r}")
        if self.method not in {"half-level", "canny"}:
            raise ValueError(f"method must be half-level or canny, not {self.method!r}")
        if self.threshold is not None and not math.isfinite(self.threshold):
            raise ValueError(f"threshold must be a grey level, not {self.threshold}")
        if not math.isfinite(self.edge_shift_mm):
            raise ValueError(f"the edges' shift must be a length, not {self.edge_shift_mm} mm")


@dataclass(frozen=True, slots=True)
class SeedPoint:
    """A point of the organ in one image."""

    # x, y: Column and row, px.
    x: float
    y: float
    index: int  # Number of the image, from 0

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
