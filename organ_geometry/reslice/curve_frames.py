"""Smooth curves through points, and frames along them that turn no more than they must."""

import numpy as np
from numpy.typing import NDArray

from organ_geometry.curves.axis_curve import least_turning
from organ_geometry.reslice.minimal_path import arc_lengths


def evenly_spaced(points: NDArray[np.float64], spacing: float) -> NDArray[np.float64]:
    """Return points at equal distances along a polyline, both of its ends among them."""
    lengths = arc_lengths(points)
    count = max(2, round(float(lengths[-1]) / spacing) + 1)
    wanted: NDArray[np.float64] = np.linspace(0.0, float(lengths[-1]), count)
    return np.stack([np.interp(wanted, lengths, points[:, axis]) for axis in range(3)], axis=1)


def smooth_points(points: NDArray[np.float64], reach: int) -> NDArray[np.float64]:
    """Return each point moved onto a cubic fitted to the points around it.

    Parameters
    ----------
    points
        (N, 3) points at about equal distances.
    reach
        How many points on either side take part; at the ends, as many on the one side.

    Returns
    -------
    NDArray[np.float64]
        (N, 3) points.

    Notes
    -----
    [Savitzky 1964] A. Savitzky, M. J. E. Golay, Smoothing and differentiation of data by simplified
    least squares procedures, Analytical Chemistry 36, 1627-1639. A cubic leaves bends where they
    are, which a mean would pull inward.
    """
    windows, places, x = _windows(points, reach)
    powers = np.vander(x, 4, increasing=True)
    return np.einsum("nw,nwd->nd", (powers @ np.linalg.pinv(powers))[places], windows)


def smooth_tangents(points: NDArray[np.float64], reach: int) -> NDArray[np.float64]:
    """Return unit tangents of cubics fitted to the points around each point."""
    # At an end, the tangent is that of the first point with `reach` points on both sides: a fit's
    # slope at the end of its points is poor.
    windows, _, x = _windows(points, reach)
    powers = np.vander(x, 4, increasing=True)
    tangents = np.einsum("w,nwd->nd", np.linalg.pinv(powers)[1], windows)
    return tangents / np.linalg.norm(tangents, axis=1, keepdims=True)


def _windows(
    points: NDArray[np.float64], reach: int
) -> tuple[NDArray[np.float64], NDArray[np.intp], NDArray[np.float64]]:
    """Return (N, W, 3) points around each point, its place among them, and (W,) places -1 to 1."""
    width = min(2 * max(reach, 2) + 1, len(points))
    starts = np.clip(np.arange(len(points)) - width // 2, 0, len(points) - width)
    windows = points[starts[:, np.newaxis] + np.arange(width)]
    return windows, np.arange(len(points)) - starts, np.linspace(-1.0, 1.0, width)


def rotation_minimising_frames(
    points: NDArray[np.float64], tangents: NDArray[np.float64], across: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return (N, 3, 3) right-handed frames along a curve that do not turn about it."""
    # Columns: nearest to `across` at first, across that, tangent.
    first = across - tangents[0] * (across @ tangents[0])
    if np.linalg.norm(first) < 1e-3 * np.linalg.norm(across):
        first = np.roll(across, 1) - tangents[0] * (np.roll(across, 1) @ tangents[0])
    axes = least_turning(points, tangents, first)
    return np.stack([axes, np.cross(tangents, axes), tangents], axis=2)
