"""The quantised axis: a few keys near the sections' centroids, in few bits.

    k    (K, 3) keys of a natural cubic spline at even parameters, K = 2^L + 1
    t_s  parameter at which the spline passes centroid c_s
    N    spline weights: its point at t_s is N(t_s) k
    q    stored bends: k = straight chord + refinement(L) (q step) in the chord's frame
    P_s  I - t t^T, what is left of a vector across the spline's tangent t at t_s

Keys and t_s are fitted in turn, by least squares and by Newton's step to the nearest point, and the
ends are rounded. The bends are chosen by coordinate descent on sum |P_s (N k - c_s)|^2 / (2 worth)
plus their bits, coarse levels first: refinement is hierarchical, each level adds to the spline of
the coarser ones. Only the part across the axis counts, since along it places are free.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from organ_geometry.curves.axis_curve import (
    key_levels,
    natural_cubic,
    natural_cubic_slopes,
    refinement,
)
from organ_geometry.encoder.coordinate_descent import (
    ANYWHERE,
    Coordinates,
    Residuals,
    dense_bands,
    descend,
    penalty_row,
)
from organ_geometry.encoder.costs import first_axis_bits, total_bits
from organ_geometry.encoder.settings import Penalty
from organ_geometry.organ_file.organ_code import (
    LARGEST_AXIS_DEPTH,
    axis_keys,
    bend_steps,
    chord_frame,
    scale_of,
)


@dataclass(frozen=True, slots=True, eq=False)
class QuantisedAxis:
    """An axis in integers."""

    # As in `OrganCode`: (2, 3) and (K, 3), in steps.
    ends: NDArray[np.int64]
    bends: NDArray[np.int64]
    scale: int  # See `scale_of`
    keys: NDArray[np.float64]  # (K, 3) mm, decoded from ends and bends
    cost: float  # Squared error plus the worth of its bits, mm^2


def quantised_axis(
    centroids: NDArray[np.float64],
    depth: int,
    scale: int,
    tolerance: float,
    bit_worth: float,
    reach: tuple[float, float] = (0.0, 0.0),
) -> QuantisedAxis:
    """Return an axis of 2^depth + 1 keys near (S, 3) centroids, carried on by its reach, mm."""
    # Its step is the scale's in tolerances, mm; a bit is worth a squared error, in squared steps.
    count, step = 2**depth + 1, tolerance * scale_of(scale)
    bit_worth *= step * step
    keys, places = _fitted(centroids, count, reach)
    first = np.asarray(np.round(keys[0] / step), dtype=np.int64)
    chord = np.asarray(np.round(keys[-1] / step), dtype=np.int64) - first
    # Steps longer than the organ may leave no chord: it has one step then, along its longest side.
    if not chord.any():
        chord[int(np.abs(keys[-1] - keys[0]).argmax())] = 1
    ends = np.stack([first, chord])
    frame = chord_frame(np.asarray(chord * step, dtype=np.float64))
    unit = bend_steps(step)
    weights = natural_cubic(places, count)
    tangents = (natural_cubic_slopes(places, count) @ keys) @ frame.T
    tangents /= np.linalg.norm(tangents, axis=1, keepdims=True)
    # (S, 3, 3): what is left of a distance without its part along the axis.
    across = np.eye(3) - tangents[:, :, np.newaxis] * tangents[:, np.newaxis, :]
    straight = np.asarray(
        np.linspace(0.0, 1.0, count)[:, np.newaxis] * chord * step + first * step, dtype=np.float64
    )
    wanted = np.einsum("sij,sj->si", across, (centroids - weights @ straight) @ frame.T).ravel()
    # Bends in the order of their levels, so that those known at a level are the first so many.
    levels = key_levels(depth)
    inner = np.argsort(levels, kind="stable")[np.count_nonzero(levels == 0) :]
    columns = (weights @ refinement(depth))[:, inner]
    # One row for each section and direction, one column for each key and direction.
    design = columns[:, np.newaxis, :, np.newaxis] * (across * unit)[:, :, np.newaxis, :]
    design = design.reshape(3 * len(centroids), -1)
    integers = np.zeros(design.shape[1], dtype=np.int64)
    size = len(integers)
    coordinates = Coordinates(
        row=np.arange(size),
        change=np.zeros(size, dtype=np.intp),
        step=np.ones(size),
        bits=np.tile(first_axis_bits(), (size, 1)),
    )
    # Weight 1/2 of each squared component: a shift moves a point of a round boundary along its
    # normal by the cosine of the angle between, whose mean square is 1/2.
    fractions = np.full(len(wanted), 0.5)
    rest = -wanted
    errors = np.array([fractions @ (rest * rest)])
    points = Residuals(np.zeros(len(wanted), dtype=np.intp), fractions, rest, errors)
    penalty = penalty_row(Penalty(1.0 / bit_worth, 0.0, 0.0))
    bands, ones = dense_bands(design), np.ones((1, len(wanted)))
    for level in range(1, depth + 1):
        known = 3 * np.count_nonzero(levels[inner] <= level)
        ranges = np.array([[0, known]])
        descend(
            integers, coordinates, bands, ones, points, penalty, ranges, ANYWHERE, 20
        )  # fmt: skip
    bends = np.zeros((count, 3), dtype=np.int64)
    bends[inner] = integers.reshape(-1, 3)
    cost = float(errors[0]) + bit_worth * total_bits(coordinates.bits, integers)
    return QuantisedAxis(ends, bends, scale, axis_keys(ends, bends, step), cost)


def most_levels(sections: int) -> int:
    """Return the most levels of keys that sections can fix, three centroids a key."""
    return min(max(1, (sections // 3).bit_length() - 1), LARGEST_AXIS_DEPTH)


def _fitted(
    targets: NDArray[np.float64], count: int, reach: tuple[float, float]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the (K, 3) least-squares keys and the (S,) places of the targets along them."""
    steps = np.linalg.norm(np.diff(targets, axis=0), axis=1)
    places = np.concatenate([[0.0], np.cumsum(steps)])
    length = max(float(places[-1]), np.finfo(np.float64).tiny)
    # The keys span the centroids and the reach beyond both ends, as shares of the whole length.
    whole = length + reach[0] + reach[1]
    places = (places + reach[0]) / whole
    keys = _least_squares(targets, places, count)
    # Places glide along the axis to where the targets are nearest; five rounds of Newton's step, of
    # which 0.7 goes without overshoot, settle them to far less than a step.
    for _ in range(5):
        slopes = natural_cubic_slopes(places, count) @ keys
        away = targets - natural_cubic(places, count) @ keys
        squared = np.maximum((slopes * slopes).sum(axis=1), np.finfo(np.float64).tiny)
        places = places + 0.7 * (away * slopes).sum(axis=1) / squared
        # Places stay in the sections' order and apart, or the fit would have no single solution.
        places = np.maximum.accumulate(places) + 1e-9 * np.arange(len(places))
        places = (places - places[0]) / (places[-1] - places[0])
        places = (places * length + reach[0]) / whole
        keys = _least_squares(targets, places, count)
    return keys, places


def _least_squares(
    targets: NDArray[np.float64], places: NDArray[np.float64], count: int
) -> NDArray[np.float64]:
    # rcond: keys that few centroids tell apart stay small instead of running off.
    weights = natural_cubic(places, count)
    return np.asarray(np.linalg.lstsq(weights, targets, rcond=1e-6)[0], dtype=np.float64)
