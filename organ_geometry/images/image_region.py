"""A range of images, rows and columns of a stack."""

import dataclasses
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from organ_geometry.images.grey_image import GreyImage, ImageStackError, Slices
from organ_geometry.images.image_planes import ImagePlanes

Region: TypeAlias = tuple[int, int, int, int] | tuple[int, int, int, int, int, int]


@dataclass(frozen=True, slots=True)
class ImageRegion:
    """Columns x0 to x1, rows y0 to y1 and images first to last, the last ones included, from 0."""

    x0: int
    y0: int
    x1: int
    y1: int
    first: int
    last: int

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.y1 - self.y0 + 1, self.x1 - self.x0 + 1


@dataclass(frozen=True, slots=True)
class CroppedSlices:
    """The part of other images inside a region."""

    slices: Slices
    region: ImageRegion

    def image(self, index: int) -> GreyImage:
        """Return the part of the image of that number, from 0 at the region's first."""
        whole = self.slices.image(self.region.first + index)
        box = self.region
        # A copy, so that the whole image is not held for its part.
        return whole[box.y0 : box.y1 + 1, box.x0 : box.x1 + 1].copy()


def image_region(roi: Region, shape: tuple[int, int], count: int) -> ImageRegion:
    """Return a checked region, of all images where none are given."""
    # (x0, y0, x1, y1) columns and rows, or these and (first, last) images; from 0, last included.
    if len(roi) not in (4, 6):
        raise ImageStackError(
            f"a region must be x0,y0,x1,y1 or x0,y0,x1,y1,first,last, not {len(roi)} numbers"
        )
    x0, y0, x1, y1 = roi[:4]
    first, last = roi[4:] if len(roi) == 6 else (0, count - 1)
    rows, columns = shape
    for what, low, high, end in (
        ("columns", x0, x1, columns),
        ("rows", y0, y1, rows),
        ("images", first, last, count),
    ):
        if not 0 <= low <= high < end:
            raise ImageStackError(
                f"a region's {what} must be from 0 to {end - 1}, the smaller first, "
                f"not {low} to {high}"
            )
    return ImageRegion(x0, y0, x1, y1, first, last)


def cropped_planes(planes: ImagePlanes, shape: tuple[int, int], region: ImageRegion) -> ImagePlanes:
    """Return the planes of a region, each with its origin at the middle of its part."""
    kept = slice(region.first, region.last + 1)
    rows, columns = shape
    shift = 0.5 * np.array(
        [region.x0 + region.x1 - (columns - 1), region.y0 + region.y1 - (rows - 1)]
    )
    frames = planes.frames[kept]
    return dataclasses.replace(
        planes,
        origins=planes.origins[kept] + frames[:, :, :2] @ (shift * planes.pixel_size),
        frames=frames,
    )
