"""An edge carried from one image to the next where no grey level closes it.

Where an organ touches a neighbour of its own grey level, no threshold parts them. The image is then
looked at in a strip along the last section's edge: row i of the strip is point i of that edge,
column j an offset m_j along the edge's normal there. The new edge is the closed path j(i) around
the strip of least

    sum over i of  LIKENESS d(i, j) - STEP s(i, j) + MOVE m_j^2 + BEND |j(i) - j(i - 1)|

with s the step down from inside to outside, and d the mean difference of the levels across the path
from those that the last image has across its edge, both over the organ's contrast. It is found by
dynamic programming (Amini, Weymouth and Jain 1990, IEEE Trans. PAMI 12(9):855, active contours),
three times around: the second turn's path does not depend on where the first began.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from organ_geometry.contours.edge_curve import Image, enclosed_area, outward_normals

# How far the edge may move from one section to the next, and how much of it is compared, px.
REACH_PX = 3.0
PROFILE_PX = 4.0
STEP_PX = 0.5
# Weights of a step as high as the organ's contrast, of a resemblance off by as much, of a move of
# one pixel, squared, and of a change by one step of the strip from one point to the next.
STEP_WEIGHT = 4.0
LIKENESS_WEIGHT = 7.0
MOVE_WEIGHT = 0.02
BEND_WEIGHT = 0.2
# The path is smoothed to the waves that a section's outline has.
WAVES = 6
# Along more than this share of an edge there must be a step of at least this share of the contrast.
SMALLEST_STEP = 0.06
STEPPED_FRACTION = 0.85
# And the area may not change by more than this share at once.
LARGEST_AREA_CHANGE = 0.3


def carried_edge(
    now: Image, last: Image, edge: NDArray[np.float64], contrast: float
) -> NDArray[np.float64] | None:
    """Return an edge carried from the last image to the one now."""
    edge = _even(edge)
    normals = outward_normals(edge)
    profile = np.arange(-PROFILE_PX, PROFILE_PX + 0.5 * STEP_PX, STEP_PX)
    half = len(profile) // 2
    wide = REACH_PX + PROFILE_PX
    offsets = np.arange(-wide, wide + 0.5 * STEP_PX, STEP_PX)
    moves = offsets[half : len(offsets) - half]
    strip = _strip(now, edge, normals, offsets)
    before = _strip(last, edge, normals, profile)

    # Steps are read over two pixels, as the images are blurred.
    apart = round(1.0 / STEP_PX)
    places = np.arange(half, len(offsets) - half)
    steps = np.clip((strip[:, places - apart] - strip[:, places + apart]) / contrast, 0.0, 1.0)
    windows = np.lib.stride_tricks.sliding_window_view(strip, len(profile), axis=1)
    off = np.minimum(np.abs(windows - before[:, np.newaxis]) / contrast, 1.0).mean(axis=2)
    cost = LIKENESS_WEIGHT * off - STEP_WEIGHT * steps + MOVE_WEIGHT * moves**2
    path = _closed_path(cost, BEND_WEIGHT)

    stepped = steps[np.arange(len(path)), path] >= SMALLEST_STEP
    carried = _even(edge + moves[path][:, np.newaxis] * normals)
    change = enclosed_area(carried) / enclosed_area(edge) - 1.0
    if stepped.mean() < STEPPED_FRACTION or abs(change) > LARGEST_AREA_CHANGE:
        return None
    return carried


def _even(edge: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a closed edge of points about one pixel apart, of a few waves only."""
    closed = np.concatenate([edge, edge[:1]])
    lengths = np.zeros(len(closed), dtype=np.float64)
    np.cumsum(np.linalg.norm(np.diff(closed, axis=0), axis=1), out=lengths[1:])
    count = max(4 * WAVES, round(float(lengths[-1])))
    places = np.linspace(0.0, float(lengths[-1]), count, endpoint=False)
    x = np.interp(places, lengths, closed[:, 0])
    y = np.interp(places, lengths, closed[:, 1])
    waves = np.fft.fft(x + 1j * y)
    number = np.abs(np.fft.fftfreq(count) * count)
    waves *= np.where(number <= WAVES, 1.0, np.exp(-0.125 * (number - WAVES) ** 2))
    smooth = np.fft.ifft(waves)
    return np.stack([smooth.real, smooth.imag], axis=1)


def _strip(
    image: Image,
    edge: NDArray[np.float64],
    normals: NDArray[np.float64],
    offsets: NDArray[np.float64],
) -> NDArray[np.float32]:
    """Return the (N, M) levels at offsets along the normals of an edge."""
    points = edge[:, np.newaxis] + offsets[:, np.newaxis] * normals[:, np.newaxis]
    columns, rows = points[..., 0].astype(np.float32), points[..., 1].astype(np.float32)
    strip = cv2.remap(image, columns, rows, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(strip, dtype=np.float32)


def _closed_path(cost: NDArray[np.float64], bend: float) -> NDArray[np.intp]:
    """Return the (N,) places of the cheapest path around a strip, which ends where it begins."""
    # Of three turns the middle one is taken: it knows neither where the path began nor its end.
    count, width = cost.shape
    turns = 3
    choices = np.zeros((turns * count, width), dtype=np.intp)
    total = cost[0].copy()
    paths = np.full((3, width), np.inf)
    for row in range(1, turns * count):
        paths[0, 1:] = total[:-1] + bend
        paths[1] = total
        paths[2, :-1] = total[1:] + bend
        best = paths.argmin(axis=0)
        choices[row] = best
        total = paths[best, np.arange(width)] + cost[row % count]
    path = np.zeros(turns * count, dtype=np.intp)
    path[-1] = int(total.argmin())
    for row in range(turns * count - 1, 0, -1):
        path[row - 1] = path[row] + choices[row, path[row]] - 1
    return path[count : 2 * count]
