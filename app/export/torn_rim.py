"""Torn rims that draw back, as a few morph targets whose weighted sums give every key of a motion.

Joints move all that is rigid. The drawing back of a rim is laid over that as another displacement
of each vertex at each key. With the keys as rows, these displacements form a matrix of low rank:
its leading principal components, from the eigenvectors of rows rows^T, are the shapes, as many as
the tolerance needs; the eigenvectors are the weights. Blender clamps weights to [0, 1], so they are
scaled to that range, and one shape more, of weight 1, holds the sum of all components at their
least.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.export.motion import Motion
from organ_geometry.mesh import BoundSkin, TornPiece


@dataclass(frozen=True, slots=True, eq=False)
class RimShapes:
    """Morph targets of a torn piece's rim."""

    shapes: NDArray[np.float32]  # (M, V, 3) displacements of the piece's vertices at rest, mm
    weights: list[NDArray[np.float32]]  # per motion (K, M), 0 to 1, at its K keys with a torn rim


def rim_shapes(
    piece: TornPiece, bound: BoundSkin, motions: list[Motion], *, tolerance: float
) -> RimShapes:
    """Return as few shapes as show a torn rim in all motions within `tolerance`, mm."""
    near = np.flatnonzero(piece.retreat.any(axis=1))
    index, weight = bound.index[near], bound.weight[near, np.newaxis, np.newaxis]
    rows: list[NDArray[np.float64]] = []
    counts: list[int] = []
    for motion in motions:
        torn = ~motion.whole
        counts.append(int(torn.sum()))
        for transforms, front in zip(motion.transforms[torn], motion.fronts[torn], strict=True):
            # Viewers apply morph targets before the joints, the tear's displacements come after.
            turns = np.eye(3) + (1.0 - weight) * transforms[index, :, :3]
            turns += weight * transforms[index + 1, :, :3]
            opened = np.clip(front - piece.height[near], 0.0, 1.0)[:, np.newaxis]
            drawn_back = opened * piece.retreat[near]
            rows.append(_turned_back(turns, drawn_back))
    wanted = np.array(rows).reshape(len(rows), -1)
    coefficients, components = _principal(wanted, tolerance)
    shapes = np.zeros((len(components), len(piece.height), 3), np.float32)
    shapes[:, near] = components.reshape(len(components), near.size, 3)
    pieces = np.split(coefficients.astype(np.float32), np.cumsum(counts)[:-1])
    return RimShapes(shapes, pieces)


def _turned_back(
    turns: NDArray[np.float64], displacements: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return (N*3,) the displacements, (N, 3), that (N, 3, 3) matrices turn into those given."""
    inverse = np.linalg.inv(turns).astype(np.float64, copy=False)
    return np.einsum("nij,nj->ni", inverse, displacements).ravel()


def _principal(
    rows: NDArray[np.float64], tolerance: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return (T, M) weights, 0 to 1, and (M, N) shapes whose product meets the tolerance."""
    if not rows.size:
        return np.zeros((len(rows), 0)), np.zeros((0, rows.shape[1]))
    # The copy avoids BLAS's symmetric product, which is twenty times slower on flat matrices.
    turns: NDArray[np.float64] = np.linalg.eigh(rows @ rows.T.copy())[1][:, ::-1]
    along = turns.T @ rows
    left = rows.copy()
    count = 0
    while count < len(rows) and np.abs(left).max() > tolerance:
        left -= turns[:, count, np.newaxis] * along[count]
        count += 1
    # Components are taken, largest first, until no displacement is off by more than the tolerance.
    coefficients, components = turns[:, :count], along[:count]
    if not count:
        return coefficients, components
    # coefficient = least + weight * spread, so that weights are in [0, 1]; the least is one shape.
    least = coefficients.min(axis=0, keepdims=True)
    spread = np.ptp(coefficients, axis=0, keepdims=True)
    spread[spread == 0.0] = 1.0
    return (
        np.hstack([np.ones((len(rows), 1)), (coefficients - least) / spread]),
        np.vstack([least @ components, components * spread.T]),
    )
