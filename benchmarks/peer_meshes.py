"""Meshes of an organ as others make them: contours joined by triangles, and marching cubes."""

from importlib import import_module
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, gaussian_filter1d

from organ_geometry import ImageStack

Mesh: TypeAlias = tuple[NDArray[np.float64], NDArray[np.int64]]
"""(V, 3) vertices, mm, and (F, 3) faces."""

_MARGIN = 6


def contour_loft(
    contours: list[NDArray[np.float64]],
    corners: int,
    smoothing: float = 0.0,
    rounding: float = 0.0,
    size: float = 1.0,
) -> Mesh:
    """Return the open tube through closed contours."""
    rings = rings_of(contours, corners)
    if smoothing > 0.0:
        rings = _smoothed(rings, smoothing)
    if rounding > 0.0:
        sigma = rounding * corners / (2.0 * np.pi)
        once = gaussian_filter1d(rings, sigma, axis=1, mode="wrap")
        rings = 2.0 * once - gaussian_filter1d(once, sigma, axis=1, mode="wrap")
    middles = rings.mean(axis=1, keepdims=True)
    rings = middles + size * (rings - middles)
    return rings.reshape(-1, 3), tube_faces(len(rings), corners)


def rings_of(contours: list[NDArray[np.float64]], corners: int) -> NDArray[np.float64]:
    """Return closed contours as rings of evenly spaced corners, each turned to the last."""
    # S contours (N, 3), mm, become (S, C, 3) rings of C corners.
    rings = np.empty((len(contours), corners, 3))
    before = None
    for place, contour in enumerate(contours):
        middle = contour.mean(axis=0)
        if before is not None:
            aligned = np.linalg.norm(contour - middle - before, axis=1).argmin()
            contour = np.roll(contour, -int(aligned), axis=0)
        closed = np.concatenate([contour, contour[:1]])
        steps = np.linalg.norm(np.diff(closed, axis=0), axis=1)
        length = np.concatenate([[0.0], np.cumsum(steps)])
        wanted = np.arange(corners) * (length[-1] / corners)
        for column in range(3):
            rings[place, :, column] = np.interp(wanted, length, closed[:, column])
        before = contour[0] - middle
    return rings


def cubes_mesh(stack: ImageStack, blur: float, step: int) -> Mesh:
    """Return the half level of a stack of masks by scikit-image's marching cubes."""
    measure = import_module("skimage.measure")
    volume = np.stack([np.asarray(image) for image in stack.images()]).astype(np.float32)
    filled = volume.any(axis=0)
    rows, columns = (np.flatnonzero(seen.sum(axis=1)) for seen in (filled, filled.T))
    top, left = (max(0, int(where[0]) - _MARGIN) for where in (rows, columns))
    volume = volume[:, top : rows[-1] + _MARGIN, left : columns[-1] + _MARGIN]
    volume = gaussian_filter(volume, (0.5 * blur, blur, blur), mode="nearest")
    vertices, faces, _, _ = measure.marching_cubes(volume, 127.5, step_size=step)
    places = vertices[:, 0]
    middle = 0.5 * (np.array(stack.shape[::-1]) - 1.0)
    plane = (vertices[:, :0:-1] + (left, top) - middle) * stack.pixel_size
    before = np.clip(places.astype(int), 0, len(stack) - 2)
    fraction = (places - before)[:, np.newaxis]
    ends = [
        stack.origins[place] + np.einsum("nij,nj->ni", stack.frames[place][:, :, :2], plane)
        for place in (before, before + 1)
    ]
    return ends[0] * (1.0 - fraction) + ends[1] * fraction, np.asarray(faces, dtype=np.int64)


def _smoothed(rings: NDArray[np.float64], sigma: float) -> NDArray[np.float64]:
    """Return rings smoothed along the tube by 2 G - G G, which leaves parabolas as they are."""
    reach = min(int(8.0 * sigma) + 1, len(rings) - 1)
    ends = ((reach, reach), (0, 0), (0, 0))
    wide = np.pad(rings, ends, mode="reflect", reflect_type="odd")
    once = gaussian_filter1d(wide, sigma, axis=0)
    return (2.0 * once - gaussian_filter1d(once, sigma, axis=0))[reach:-reach]


def tube_faces(rings: int, corners: int) -> NDArray[np.int64]:
    """Return the triangles between neighbouring rings."""
    grid = np.arange(rings * corners).reshape(rings, corners)
    here, after = grid[:-1], np.roll(grid[:-1], -1, axis=1)
    above, beside = grid[1:], np.roll(grid[1:], -1, axis=1)
    pair = [np.stack([here, after, above], axis=-1), np.stack([after, beside, above], axis=-1)]
    return np.concatenate([mesh.reshape(-1, 3) for mesh in pair])
