"""A stack of cross-section images and where each image stands in space."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from organ_geometry.images.grey_image import GreyImage, Slices
from organ_geometry.images.image_planes import ImagePlanes


@dataclass(frozen=True, slots=True, eq=False)
class ImageStack:
    """Cross-section images in order, read one at a time, and the plane of each.

    Attributes
    ----------
    source
        The folder or file.
    names
        (S,) name of each section, for messages and reports.
    shape
        (2,) rows H and columns W of every image.
    planes
        Where they stand in space, and the sizes of their pixels.
    bytes_in
        Size of the files that the images come from, bytes.
    level_offset, level_step
        A level L of an image stands for the value ``level_offset + level_step * L`` of its source,
        such as HU.
    notes
        What should be known about how the images were read, a sentence each.
    doubts
        What is probably wrong with the images, a sentence each.
    """

    source: Path
    names: tuple[str, ...]
    slices: Slices
    shape: tuple[int, int]
    planes: ImagePlanes
    bytes_in: int = 0
    level_offset: float = 0.0
    level_step: float = 1.0
    notes: tuple[str, ...] = ()
    doubts: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.names)

    @property
    def pixel_size(self) -> NDArray[np.float64]:
        """(2,) distance between pixel centres along a row (x) and along a column (y), mm."""
        return self.planes.pixel_size

    @property
    def mean_pixel(self) -> float:
        """Geometric mean of a pixel's sides, mm: the "pixel" of reports."""
        return math.sqrt(float(self.pixel_size.prod()))

    @property
    def slice_spacing(self) -> float:
        """Distance between neighbouring planes, mm."""
        return self.planes.slice_spacing

    @property
    def origins(self) -> NDArray[np.float64]:
        """(S, 3) centre of each image in space, mm."""
        return self.planes.origins

    @property
    def frames(self) -> NDArray[np.float64]:
        """(S, 3, 3) columns x_dir, y_dir and normal of each image."""
        return self.planes.frames

    @property
    def units(self) -> str:
        """What the lengths are called where they come from."""
        return self.planes.units

    def image(self, index: int) -> GreyImage:
        """Return (H, W) levels, read now; threads may call. ImageStackError if unreadable."""
        return self.slices.image(index)

    def images(self) -> Iterator[GreyImage]:
        """Yield the images in order; only one is held at a time."""
        for index in range(len(self)):
            yield self.image(index)
