"""A stack of cross-section images and where each image stands in space."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from organ_geometry.images.grey_image import GreyImage, ImageStackError, Slices
from organ_geometry.images.image_planes import ImagePlanes
from organ_geometry.images.spacing_file import MM

__all__ = ["GreyImage", "ImageStack", "ImageStackError"]


@dataclass(frozen=True, slots=True, eq=False)
class ImageStack:
    """Cross-section images in order, read one at a time, and the plane of each.

    The centre of pixel (row r, column c) of section i, in an image of H rows and W columns, is
    ``origins[i] + (c-(W-1)/2) pixel_size[0] x_dir + (r-(H-1)/2) pixel_size[1] y_dir``.

    Attributes
    ----------
    source
        The folder or file.
    names
        (S,) name of each section, for messages and reports.
    slices
        Where the images come from.
    shape
        (2,) rows H and columns W of every image.
    pixel_size
        (2,) distance between pixel centres, mm: first along a row (from column to column, x),
        then along a column (from row to row, y).
    slice_spacing
        Distance between neighbouring planes, mm.
    origins
        (S, 3) centre of each image in space, mm.
    frames
        (S, 3, 3) unit directions as columns: x_dir (column to column), y_dir (row to row, down the
        image) and the plane's normal, pointing along the stack.
    units
        What the lengths are called where they come from: "mm", or "relative" and what follows it.
    bytes_in
        Size of the files that the images come from, bytes.
    level_offset, level_step
        A level L of an image stands for the value ``level_offset + level_step * L`` of its source,
        such as HU.
    notes
        What should be known about how the images were read, a sentence each.
    """

    source: Path
    names: tuple[str, ...]
    slices: Slices
    shape: tuple[int, int]
    pixel_size: NDArray[np.float64]
    slice_spacing: float
    origins: NDArray[np.float64]
    frames: NDArray[np.float64]
    units: str = MM
    bytes_in: int = 0
    level_offset: float = 0.0
    level_step: float = 1.0
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for field in ("pixel_size", "origins", "frames"):
            locked = np.array(getattr(self, field), dtype=np.float64)
            locked.setflags(write=False)
            object.__setattr__(self, field, locked)

    def __len__(self) -> int:
        return len(self.names)

    @property
    def mean_pixel(self) -> float:
        """Geometric mean of a pixel's sides, mm: the "pixel" of reports."""
        return math.sqrt(float(self.pixel_size.prod()))

    @property
    def planes(self) -> ImagePlanes:
        """Where the images stand."""
        return ImagePlanes(
            self.pixel_size, self.slice_spacing, self.origins, self.frames, self.units
        )

    def image(self, index: int) -> GreyImage:
        """Return one image, read from its file now or out of a volume; threads may call at once.

        Parameters
        ----------
        index
            Number of the section, from 0.

        Returns
        -------
        GreyImage
            (H, W) grey levels, 8 or 16 bit; colour is turned into grey.

        Raises
        ------
        ImageStackError
            If the file is not a readable image or its size is not that of the first image.
        """
        return self.slices.image(index)

    def images(self) -> Iterator[GreyImage]:
        """Yield the images in order; only one is held at a time.

        Yields
        ------
        GreyImage
            (H, W) grey levels of the next section.
        """
        for index in range(len(self)):
            yield self.image(index)
