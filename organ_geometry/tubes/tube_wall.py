# SciPy has no types.
# pyright: reportMissingTypeStubs=false, reportUnknownMemberType=false, reportUnknownVariableType=false, reportUnknownArgumentType=false
"""The wall of a tube as a distance r(s, phi) from its axis, found from voxels that are in or out.

A voxel says no more than on which side of the wall its centre lies. So the wall is the surface that
best parts the centres of the tube's voxels from those around it: r is a sum of hat functions along
the axis times a few harmonics around it, and its coefficients are those of greatest likelihood,
where a centre at a distance d inside the wall is in the label with a probability of

    1/2 + (1/2 - e) tanh(d / 2 t)

with t a part of a voxel and e the share of labels that are wrong. No voxel is smoothed, so slices
may be thick, and a thin tube does not shrink. Voxels of other tubes count little: where two tubes
are drawn into each other the wall is what its surroundings make likely, by a prior on bends and
slopes along the axis and on harmonics. The Fisher scoring is that of logistic regression
[McCullagh 1989].

[McCullagh 1989] P. McCullagh, J. A. Nelder, Generalized Linear Models, chapters 2 and 4.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix, diags, identity, kron
from scipy.sparse.linalg import spsolve
from scipy.spatial import KDTree

Floats = NDArray[np.float64]

_WRONG = 0.02
# Of the geometric mean of a voxel's sides: how sharp a label's edge is taken, from wide to narrow.
_SHARPNESS = (0.8, 0.5, 0.35, 0.25, 0.15, 0.15, 0.15)
# Standard deviations, of the radius: of a harmonic m >= 2 the first over m^2, of m = 1 (an axis
# off the middle) the second, of the bend and the slope of each from knot to knot the others.
_HARMONIC, _OFF, _BEND, _SLOPE = 0.2, 0.3, 0.05, 0.15
_KNOT_VOXELS = 6.0
_LEAST_FRACTION = 0.25  # of the radius that is begun with


@dataclass(frozen=True, slots=True, eq=False)
class TubeWall:
    """Distances of a wall from an axis."""

    knots: Floats  # (Q,) stations of the hat functions, mm
    coefficients: Floats  # (Q, 1 + 2 M): the mean radius, then cosine and sine of each harmonic, mm

    def radii(self, stations: Floats, angles: Floats) -> Floats:
        """Return (S, P) distances from the axis, mm, at stations, mm, and angles, rad."""
        columns = [np.interp(stations, self.knots, row) for row in self.coefficients.T]
        return np.stack(columns, axis=1) @ _harmonics(angles, self.coefficients.shape[1]).T


def fitted_wall(
    axis: Floats,
    frames: Floats,
    places: Floats,
    inside: NDArray[np.bool_],
    trust: Floats,
    radius: float,
    voxel: float,
    *,
    harmonics: int,
) -> TubeWall:
    """Return the wall that best parts voxels inside a tube from those around it.

    Parameters
    ----------
    axis, frames
        (N, 3) points at equal distances and (N, 3, 3) frames, the third column along the axis.
    places, inside, trust
        (V, 3) centres of voxels near the tube, mm, whether each is of it, and how far that is
        trusted, 0 to 1.
    radius
        About the tube's, mm.
    voxel
        Geometric mean of a voxel's sides, mm.
    harmonics
        How many waves around the axis are allowed.

    Returns
    -------
    TubeWall
        Along the whole axis.
    """
    stations, angles, away = tube_coordinates(axis, frames, places)
    length = float(np.linalg.norm(np.diff(axis, axis=0), axis=1).sum())
    gap = max(min(0.75 * radius, _KNOT_VOXELS * voxel), 1.5 * voxel)
    count = max(3, round(length / gap) + 1)
    knots = np.linspace(0.0, length, count)
    width = 1 + 2 * harmonics
    near = np.isfinite(away)
    stations, angles, away, trust = stations[near], angles[near], away[near], trust[near]
    label = inside[near].astype(np.float64)
    design = _design(stations, angles, knots, width)
    prior = _prior(count, width, radius)
    # Voxels near a surface lie on both sides of it: their mean distance is nearly the wall's.
    weight = trust / voxel**2
    first = (design.T @ design.multiply(weight[:, np.newaxis])).tocsc() + prior
    found: Floats = np.asarray(spsolve(first, design.T @ (weight * away)))
    for fraction in _SHARPNESS:
        sharp = fraction * voxel
        depth = np.clip((design @ found - away) / sharp, -30.0, 30.0)
        wave = np.tanh(0.5 * depth)
        chance = 0.5 + (0.5 - _WRONG) * wave  # that a centre there is in the label
        slope = 0.5 * (0.5 - _WRONG) * (1.0 - wave * wave) / sharp
        score = trust * slope * (label - chance) / (chance * (1.0 - chance))
        weight = trust * slope * slope / (chance * (1.0 - chance))
        information = (design.T @ design.multiply(weight[:, np.newaxis])).tocsc() + prior
        # The mean of the prior is the radius's bend and the harmonics' nothing.
        change: Floats = np.asarray(spsolve(information, design.T @ score - prior @ found))
        found = found + np.clip(change, -0.5 * radius, 0.5 * radius)
        mean = found.reshape(count, width)
        mean[:, 0] = np.maximum(mean[:, 0], _LEAST_FRACTION * radius)
    return TubeWall(knots, found.reshape(count, width))


def tube_coordinates(axis: Floats, frames: Floats, places: Floats) -> tuple[Floats, Floats, Floats]:
    """Return (V,) stations, mm, angles, rad, and distances from an axis, NaN beyond its ends."""
    # Points of the axis are at equal distances.
    step = float(np.linalg.norm(np.diff(axis, axis=0), axis=1).mean())
    _, nearest = KDTree(axis).query(places)
    nearest = np.asarray(nearest, dtype=np.intp)
    off = places - axis[nearest]
    local = np.einsum("vij,vi->vj", frames[nearest], off)
    away = np.hypot(local[:, 0], local[:, 1])
    # Where the axis bends, a point is nearest to one of its points and not in that one's plane.
    beyond = (np.abs(local[:, 2]) > 0.5 * step + 1e-9) & (
        (nearest == 0) | (nearest == len(axis) - 1)
    )
    away[beyond] = np.nan
    along = np.clip(local[:, 2], -0.5 * step, 0.5 * step)
    return nearest * step + along, np.arctan2(local[:, 1], local[:, 0]), away


def _harmonics(angles: Floats, width: int) -> Floats:
    """Return (P, W) values at angles of 1, cos, sin, cos 2, sin 2 ..."""
    columns = [np.ones_like(angles)]
    for number in range(1, (width - 1) // 2 + 1):
        columns += [np.cos(number * angles), np.sin(number * angles)]
    return np.stack(columns, axis=1)


def _design(stations: Floats, angles: Floats, knots: Floats, width: int) -> Any:
    """Return the (V, Q W) matrix that gives distances at voxels from the coefficients."""
    gap = knots[1] - knots[0]
    before = np.clip((stations / gap).astype(np.intp), 0, len(knots) - 2)
    fraction = np.clip(stations / gap - before, 0.0, 1.0)
    waves = _harmonics(angles, width)
    count = len(stations)
    rows = np.repeat(np.arange(count), 2 * width)
    columns = np.concatenate(
        [before[:, np.newaxis] * width + np.arange(width),
         (before[:, np.newaxis] + 1) * width + np.arange(width)], axis=1,
    )  # fmt: skip
    values = np.concatenate(
        [(1.0 - fraction)[:, np.newaxis] * waves, fraction[:, np.newaxis] * waves], axis=1
    )
    shape = (count, len(knots) * width)
    return csr_matrix((values.ravel(), (rows, columns.ravel())), shape=shape)


def _prior(count: int, width: int, radius: float) -> Any:
    """Return the inverse covariance of the coefficients, less the mean radius's own."""
    bends: Any = csr_matrix(np.diff(np.eye(count), 2, axis=0)) / (_BEND * radius)
    slopes: Any = csr_matrix(np.diff(np.eye(count), axis=0)) / (_SLOPE * radius)
    along = bends.T @ bends + slopes.T @ slopes
    number = (np.arange(width) + 1) // 2  # of each column's harmonic
    spread = np.where(number == 1, _OFF, _HARMONIC / np.maximum(number, 1) ** 2) * radius
    own = np.where(number == 0, 0.0, 1.0 / spread**2)
    return (kron(along, identity(width)) + kron(identity(count), diags(own))).tocsc()
