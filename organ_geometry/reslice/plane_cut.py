"""Planes cut out of a volume by linear interpolation."""

import numpy as np
from numpy.typing import NDArray

from kernel_cache import njit
from organ_geometry.images.grey_image import GreyImage


def plane_cut(
    levels: GreyImage,
    outside_level: float,
    centre: NDArray[np.float64],
    steps: NDArray[np.float64],
    shape: tuple[int, int],
) -> GreyImage:
    """Return an image of a plane through a (K, H, W) volume."""
    # Centre (3,) and steps (2, 3), from column to column and row to row, are in voxels: column,
    # row, image.
    image = np.empty(shape, dtype=levels.dtype)
    _fill_plane(image, levels, outside_level, centre, steps)
    return image


@njit(cache=True, nogil=True)
def _fill_plane(
    image: GreyImage,
    levels: GreyImage,
    outside_level: float,
    centre: NDArray[np.float64],
    steps: NDArray[np.float64],
) -> None:
    """Fill an image with a volume's levels, interpolated linearly along each axis."""
    rows, columns = image.shape
    depth, height, width = levels.shape
    for row in range(rows):
        for column in range(columns):
            right = column - 0.5 * (columns - 1)
            down = row - 0.5 * (rows - 1)
            x = centre[0] + right * steps[0, 0] + down * steps[1, 0]
            y = centre[1] + right * steps[0, 1] + down * steps[1, 1]
            z = centre[2] + right * steps[0, 2] + down * steps[1, 2]
            i, j, k = int(np.floor(x)), int(np.floor(y)), int(np.floor(z))
            # Fractions within the voxel; its eight corners weigh by what is opposite of them.
            x -= i
            y -= j
            z -= k
            value = 0.0
            for corner in range(8):
                di, dj, dk = corner & 1, (corner >> 1) & 1, corner >> 2
                weight = (x if di else 1.0 - x) * (y if dj else 1.0 - y) * (z if dk else 1.0 - z)
                a, b, c = i + di, j + dj, k + dk
                if 0 <= a < width and 0 <= b < height and 0 <= c < depth:
                    value += weight * levels[c, b, a]
                else:
                    value += weight * outside_level
            image[row, column] = np.uint16(value + 0.5)
