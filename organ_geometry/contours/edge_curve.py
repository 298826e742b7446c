"""A closed edge, moved from whole pixels to where a blurred image has its edge.

Each point of the outline of a mask goes along the blurred image's gradient g, either by Newton's
method onto a level L, p += g (L - I(p)) / |g|^2, or to the vertex of the parabola through the
gradient's size a pixel before it, at it and a pixel beyond it. A blur of standard deviation s moves
an edge of radius of curvature R towards its centre by s^2 / (2 R), to second order; every point is
moved back by that (`_unshrunk`).
"""

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from kernel_cache import njit

Image = NDArray[np.float32]
Scale = tuple[float, float]

SQUARE: Scale = (1.0, 1.0)

# The blurred image is nearly linear across its edge: Newton converges in two or three steps.
_NEWTON_STEPS = 4
# A point that went further than this from the mask's outline has left the edge, and is dropped.
_LARGEST_MOVE_PX = 1.5


class NoEdgeFound(ValueError):  # noqa: N818
    """An image in which no edge of an organ can be followed."""


def blurred(grey: Image, sigma: float, scale: Scale = SQUARE) -> Image:
    """Return an image blurred by the same length in all directions."""
    # Sigma, and a pixel's scale (width, height), are in pixels of mean size.
    sigma_x, sigma_y = sigma / scale[0], sigma / scale[1]
    size = (2 * math.ceil(4.0 * sigma_x) + 1, 2 * math.ceil(4.0 * sigma_y) + 1)
    return np.asarray(cv2.GaussianBlur(grey, size, sigma_x, sigmaY=sigma_y), dtype=np.float32)


def level_curve(
    smoothed: Image,
    start: NDArray[np.int32],
    level: float,
    sigma: float,
    scale: Scale = SQUARE,
) -> NDArray[np.float64]:
    """Return the outline moved onto a level of a blurred image, corrected for the blur's shift."""
    slope_x, slope_y = _slopes(smoothed)
    points = start.astype(np.float64)
    _move_to_level(points, smoothed, slope_x, slope_y, level)
    return _corrected(points, start, sigma, scale)


def steepest_curve(
    smoothed: Image, start: NDArray[np.int32], sigma: float, scale: Scale = SQUARE
) -> NDArray[np.float64]:
    """Return the outline moved to where a blurred image is steepest across it."""
    # F. Devernay, INRIA report 2724, 1995, on Canny's edges.
    slope_x, slope_y = _slopes(smoothed)
    steepness = np.asarray(cv2.magnitude(slope_x, slope_y), dtype=np.float32)
    points = start.astype(np.float64)
    for _ in range(2):
        gx, gy = _sampled(points, slope_x, slope_y)
        along = np.stack([gx, gy], axis=1)
        along /= np.maximum(np.sqrt((along * along).sum(axis=1, keepdims=True)), 1e-12)
        (here,) = _sampled(points, steepness)
        (ahead,) = _sampled(points + along, steepness)
        (back,) = _sampled(points - along, steepness)
        bend = 2.0 * here - ahead - back
        shift = np.where(bend > 1e-6, 0.5 * (ahead - back) / np.maximum(bend, 1e-6), 0.0)
        points += np.clip(shift, -1.0, 1.0)[:, np.newaxis] * along
    return _corrected(points, start, sigma, scale)


def enclosed_area(points: NDArray[np.float64]) -> float:
    """Return the area within a closed curve of points (N, 2), px^2."""
    return abs(_signed_area(points))


def outward_normals(points: NDArray[np.float64], reach: int = 1) -> NDArray[np.float64]:
    """Return the outward normals of a closed curve, by chords over `reach` points each way."""
    along = np.roll(points, -reach, axis=0) - np.roll(points, reach, axis=0)
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-12)
    normals = np.stack([along[:, 1], -along[:, 0]], axis=1)
    return normals if _signed_area(points) > 0.0 else -normals


def _signed_area(points: NDArray[np.float64]) -> float:
    after = np.roll(points, -1, axis=0)
    return 0.5 * float((points[:, 0] * after[:, 1] - points[:, 1] * after[:, 0]).sum())


def curve_length(points: NDArray[np.float64]) -> float:
    """Return the length of a closed curve of points (N, 2), px."""
    return float(np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1).sum())


def _slopes(smoothed: Image) -> tuple[Image, Image]:
    slope_x = cv2.Sobel(smoothed, cv2.CV_32F, 1, 0, ksize=3, scale=1 / 8)
    slope_y = cv2.Sobel(smoothed, cv2.CV_32F, 0, 1, ksize=3, scale=1 / 8)
    return np.asarray(slope_x, dtype=np.float32), np.asarray(slope_y, dtype=np.float32)


def _sampled(points: NDArray[np.float64], *images: Image) -> list[NDArray[np.float64]]:
    """Return the (N,) linearly interpolated values of each image at points x, y, px."""
    rows, columns = images[0].shape
    x = np.clip(points[:, 0], 0.0, columns - 1.001)
    y = np.clip(points[:, 1], 0.0, rows - 1.001)
    column, row = x.astype(np.intp), y.astype(np.intp)
    right, down = x - column, y - row
    left, up = 1.0 - right, 1.0 - down
    corner = row * columns + column
    values: list[NDArray[np.float64]] = []
    for image in images:
        flat = image.ravel()
        upper = flat[corner] * left + flat[corner + 1] * right
        lower = flat[corner + columns] * left + flat[corner + columns + 1] * right
        values.append(upper * up + lower * down)
    return values


def _corrected(
    points: NDArray[np.float64], start: NDArray[np.int32], sigma: float, scale: Scale
) -> NDArray[np.float64]:
    """Return the points that moved no more than an edge's pixel may be off, unshrunk."""
    away = points - start
    points = points[(away * away).sum(axis=1) <= _LARGEST_MOVE_PX**2]
    if len(points) < 3:
        raise NoEdgeFound("the organ's edge is too short to follow")
    return _unshrunk(points * scale, sigma) / scale


@njit(cache=True, nogil=True)
def _move_to_level(
    points: NDArray[np.float64], smoothed: Image, slope_x: Image, slope_y: Image, level: float
) -> None:
    """Move points x, y onto a level by Newton's method along the gradient, in place."""
    rows, columns = smoothed.shape
    for i in range(len(points)):
        for _ in range(_NEWTON_STEPS):
            x = min(max(points[i, 0], 0.0), columns - 1.001)
            y = min(max(points[i, 1], 0.0), rows - 1.001)
            c, r = int(x), int(y)
            right, down = x - c, y - r
            # Bilinear weights of the four pixels around, for the level and its gradient.
            a, b = (1.0 - right) * (1.0 - down), right * (1.0 - down)
            d, e = (1.0 - right) * down, right * down
            value = (
                a * smoothed[r, c]
                + b * smoothed[r, c + 1]
                + d * smoothed[r + 1, c]
                + e * smoothed[r + 1, c + 1]
            )
            gx = (
                a * slope_x[r, c]
                + b * slope_x[r, c + 1]
                + d * slope_x[r + 1, c]
                + e * slope_x[r + 1, c + 1]
            )
            gy = (
                a * slope_y[r, c]
                + b * slope_y[r, c + 1]
                + d * slope_y[r + 1, c]
                + e * slope_y[r + 1, c + 1]
            )
            step = (level - value) / max(gx * gx + gy * gy, 1e-12)
            # No step is longer than a pixel: where the image is flat Newton's would be.
            step /= max(math.hypot(step * gx, step * gy), 1.0)
            points[i, 0] += step * gx
            points[i, 1] += step * gy


@njit(cache=True, nogil=True)
def _unshrunk(points: NDArray[np.float64], sigma: float) -> NDArray[np.float64]:
    """Return a contour moved away from its centres of curvature by sigma^2 / (2 R)."""
    # Blur moves the half level and the steepest place of an edge of radius R by that much towards
    # the centre. Curvature is the turn between chords to points a few pixels off, which noise of
    # single points hardly moves.
    count = len(points)
    reach = min(round(2.0 * sigma) + 2, count // 4)
    if reach < 1:
        return points
    moved = np.empty_like(points)
    for i in range(count):
        last, after = (i - reach) % count, (i + reach) % count
        back_x, back_y = points[i, 0] - points[last, 0], points[i, 1] - points[last, 1]
        ahead_x, ahead_y = points[after, 0] - points[i, 0], points[after, 1] - points[i, 1]
        along_x, along_y = back_x + ahead_x, back_y + ahead_y
        turn = math.atan2(back_x * ahead_y - back_y * ahead_x, back_x * ahead_x + back_y * ahead_y)
        length = 0.5 * (math.hypot(back_x, back_y) + math.hypot(ahead_x, ahead_y))
        # The second-order formula holds for R well above sigma: R counts as 2 sigma at least.
        curvature = min(max(turn / max(length, 1e-6), -0.5 / sigma), 0.5 / sigma)
        step = 0.5 * sigma**2 * curvature / max(math.hypot(along_x, along_y), 1e-12)
        moved[i, 0] = points[i, 0] + step * along_y
        moved[i, 1] = points[i, 1] - step * along_x
    return moved
