"""The minimal path through a tube of voxels, from one end to the other along its deepest voxels.

Shortest ways over the 26 neighbours of a voxel [Dijkstra 1959] give, in this order: each voxel's
depth below the surface, the two ends (the voxel furthest from the deepest, and the one furthest
from that), and the path of least cost between them, where a step costs less the deeper it is: the
minimal path by which vessels are followed, as in [Deschamps 2001].

[Dijkstra 1959] E. W. Dijkstra, A note on two problems in connexion with graphs, Numerische
Mathematik 1, 269-271. [Deschamps 2001] T. Deschamps, L. D. Cohen, Fast extraction of minimal paths
in 3D images and applications to virtual endoscopy, Medical Image Analysis 5, 281-299.
"""

import heapq
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kernel_cache import njit

# More voxels than these are put together into larger ones: the way is smoothed afterwards.
MOST_VOXELS = 400_000

# A step at depth d, the greatest depth being D, costs (d/D + this)^-2: at most 121 times the least.
_SHALLOW = 0.1


@dataclass(frozen=True, slots=True, eq=False)
class MinimalPath:
    """A path through a tube, from voxel to voxel."""

    # (N, 3) points from end to end, mm along columns, rows and images from the first voxel.
    points: NDArray[np.float64]
    depths: NDArray[np.float64]  # (N,) distance of each to the surface, mm


def arc_lengths(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the (N,) arc lengths along (N, 3) points."""
    lengths = np.zeros(len(points))
    np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1), out=lengths[1:])
    return lengths


def minimal_path(inside: NDArray[np.bool_], sizes: NDArray[np.float64]) -> MinimalPath:
    """Return the minimal path through a tube, from end to end."""
    factors = _factors(inside, sizes)
    coarse = _coarser(inside, factors)
    if int(coarse.sum()) < 2:
        raise ValueError("a way needs two or more voxels inside")
    steps = sizes[::-1] * factors
    # A margin, so that no voxel inside is at the border of the array.
    coarse = np.pad(coarse, 1)
    even = np.ones(coarse.shape)
    near = np.zeros(coarse.shape, dtype=np.bool_)
    for axis in range(3):
        for path in (-1, 1):
            near |= coarse & ~np.roll(coarse, path, axis=axis)
    depths, _ = _shortest_paths(coarse, even, steps, np.flatnonzero(near))
    depths += 0.5 * float(steps.min())
    deepest = int(np.where(coarse, depths, -1.0).argmax())
    first = _furthest(coarse, even, steps, deepest)
    last = _furthest(coarse, even, steps, first)
    fraction = np.where(coarse, depths, 0.0) / depths.flat[deepest]
    slowness = 1.0 / (fraction + _SHALLOW) ** 2
    _, parents = _shortest_paths(coarse, slowness, steps, np.array([first]))
    path = [last]
    while path[-1] != first:
        path.append(int(parents[path[-1]]))
    places = np.stack(np.unravel_index(path, coarse.shape), axis=1) - 1
    # The middle of a voxel made of several.
    points = (places + 0.5) * steps - 0.5 * sizes[::-1]
    return MinimalPath(points[::-1, ::-1].copy(), depths.ravel()[path][::-1].copy())


def _furthest(
    inside: NDArray[np.bool_],
    slowness: NDArray[np.float64],
    steps: NDArray[np.float64],
    start: int,
) -> int:
    distances, _ = _shortest_paths(inside, slowness, steps, np.array([start]))
    return int(np.where(np.isfinite(distances), distances, -1.0).argmax())


def _factors(inside: NDArray[np.bool_], sizes: NDArray[np.float64]) -> NDArray[np.intp]:
    """Return how many voxels to put together along each axis of the array."""
    steps = sizes[::-1]
    edge = float((np.count_nonzero(inside) * steps.prod() / MOST_VOXELS) ** (1.0 / 3.0))
    return np.maximum(1, np.round(edge / steps)).astype(np.intp)


def _coarser(inside: NDArray[np.bool_], factors: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Return voxels put together; one is inside if half of it is."""
    if (factors == 1).all():
        return inside
    padded = np.pad(
        inside,
        [(0, int(-length % factor)) for length, factor in zip(inside.shape, factors, strict=True)],
    )
    k, j, i = (int(factor) for factor in factors)
    blocks = padded.reshape(
        padded.shape[0] // k, k, padded.shape[1] // j, j, padded.shape[2] // i, i
    )
    return blocks.mean(axis=(1, 3, 5), dtype=np.float32) >= 0.5


@njit(cache=True)
def _shortest_paths(
    inside: NDArray[np.bool_],
    slowness: NDArray[np.float64],
    steps: NDArray[np.float64],
    starts: NDArray[np.int64],
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return each voxel's shortest time from any start, and the voxel before it (Dijkstra)."""
    # Voxels at the border of the array are outside, so that no jump leaves it.
    _, height, width = inside.shape
    inner = inside.ravel()
    slow = slowness.ravel()
    times = np.full(inner.size, np.inf)
    before = np.full(inner.size, -1, dtype=np.int64)
    jumps = np.empty(26, dtype=np.int64)
    lengths = np.empty(26)
    count = 0
    for k in range(-1, 2):
        for j in range(-1, 2):
            for i in range(-1, 2):
                if k == 0 and j == 0 and i == 0:
                    continue
                jumps[count] = (k * height + j) * width + i
                lengths[count] = np.sqrt(
                    (k * steps[0]) ** 2 + (j * steps[1]) ** 2 + (i * steps[2]) ** 2
                )
                count += 1
    # The first entry says the type to numba; as a second one of the same start it is passed over.
    heap = [(0.0, starts[0])]
    for start in starts:
        times[start] = 0.0
        heap.append((0.0, start))
    while len(heap) > 0:
        time, here = heapq.heappop(heap)
        if time > times[here]:  # reached sooner since this entry was made
            continue
        for path in range(26):
            there = here + jumps[path]
            if not inner[there]:
                continue
            # Time over a jump: its length at the mean slowness of both ends (trapezoid rule).
            later = time + 0.5 * (slow[here] + slow[there]) * lengths[path]
            if later < times[there]:
                times[there] = later
                before[there] = here
                heapq.heappush(heap, (later, there))
    return times.reshape(inside.shape), before
