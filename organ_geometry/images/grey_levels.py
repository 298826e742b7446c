"""From the values that a file holds to the 8 or 16 bit levels of a grey image."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from organ_geometry.images.grey_image import GreyImage, ImageStackError, Slices

MOST_LEVELS = 65535

Window = tuple[float, float]


@dataclass(frozen=True, slots=True)
class GreyLevels:
    """Which value each grey level stands for: value = low + step * level."""

    # Values at the lowest and the highest level; values beyond are clipped to these.
    low: float
    high: float
    # Difference of value between neighbouring levels; 1 keeps whole numbers as they are.
    step: float

    def image(self, values: NDArray[Any]) -> GreyImage:
        """Return values of any shape as 8 bit levels, or 16 bit where 256 are too few."""
        dtype = np.uint8 if (self.high - self.low) / self.step <= 255 else np.uint16
        if self.step == 1.0 and values.dtype.kind in "iu":
            low, high = int(self.low), int(self.high)
            # numpy clips at the limits of the values' own type, and may not be given others.
            limits = np.iinfo(values.dtype)
            kept = values.clip(max(low, limits.min), min(high, limits.max))
            return (kept.astype(np.int64) - low).astype(dtype)
        kept = np.nan_to_num(values, nan=self.low, posinf=self.high, neginf=self.low)
        kept = kept.astype(np.float64).clip(self.low, self.high)
        return np.rint((kept - self.low) / self.step).astype(dtype)


def grey_levels(low: float, high: float, *, whole: bool) -> GreyLevels:
    """Return the levels for values from low to high, without loss where they are whole numbers."""
    if whole and high - low <= MOST_LEVELS and float(low).is_integer() and float(high).is_integer():
        return GreyLevels(low, high, 1.0)
    return GreyLevels(low, high, (high - low) / MOST_LEVELS if high > low else 1.0)


def check_window(window: Window) -> None:
    """Raise an ImageStackError unless a window is two values, the lower first."""
    low, high = window
    if not (math.isfinite(low) and math.isfinite(high) and low < high):
        raise ImageStackError(
            f"a window must be the lowest and the highest value kept, as -150,500, "
            f"not {low:g},{high:g}"
        )


@dataclass(frozen=True, slots=True)
class WindowedSlices:
    """Images with their levels put into a window."""

    slices: Slices
    levels: GreyLevels

    def image(self, index: int) -> GreyImage:
        """Return the image of that number, from 0."""
        return self.levels.image(self.slices.image(index))


@dataclass(frozen=True, slots=True)
class LabelSlices:
    """Masks of one label: 255 where an image has it, else 0."""

    slices: Slices
    label: int

    def image(self, index: int) -> GreyImage:
        """Return the mask of that number, from 0."""
        return label_mask(self.slices.image(index), self.label)


def label_mask(values: NDArray[Any], label: int) -> NDArray[np.uint8]:
    """Return a mask, 255 where values are the label, of their shape."""
    return (values == label).astype(np.uint8) * np.uint8(255)
