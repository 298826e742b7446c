"""How far points and whole sections are from an organ's walls."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kernel_cache import njit
from organ_geometry.contours.contour import SectionContour
from organ_geometry.curves.half_curves import closed_outlines
from organ_geometry.curves.outline_distance import outline_feet
from organ_geometry.organ import Organ, Wall

OUTLINE_CORNERS = 96
"""Corners of the polygon that stands for an outline: finer ones change distances by 1e-4 of it."""


@dataclass(frozen=True, slots=True, eq=False)
class LocatedPoints:
    """Points, each located in the section of an axis in whose plane it lies."""

    piece: NDArray[np.intp]  # (N,) piece of the axis
    fraction: NDArray[np.float64]  # (N,) share of the way along it
    place: NDArray[np.float64]  # (N, 2) where they are across the axis there, mm
    beyond: NDArray[np.float64]  # (N,) how far they are beyond an end's plane, mm

    @classmethod
    def along(
        cls,
        points: NDArray[np.float64],  # (N, 3) points, mm
        near: NDArray[np.float64],  # (N,) guesses of their pieces, with a fraction
        axis: NDArray[np.float64],  # (S, 3) points of the axis, mm
        frames: NDArray[np.float64],  # (S, 3, 3) frames there, columns x_dir, y_dir and normal
    ) -> "LocatedPoints":
        """Return points located in their sections' planes, each near a guess."""
        # An organ's arrays are read-only, for which numba would compile once more: copied.
        return cls(*_located(np.ascontiguousarray(points), near, np.array(axis), np.array(frames)))

    @classmethod
    def joined(cls, groups: "Sequence[LocatedPoints]") -> "LocatedPoints":
        """Return the points of all parts."""
        return cls(
            np.concatenate([group.piece for group in groups]),
            np.concatenate([group.fraction for group in groups]),
            np.concatenate([group.place for group in groups]),
            np.concatenate([group.beyond for group in groups]),
        )

    def distances(self, rows: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return how far the points are from a wall, mm, by its (S, 16) half-curves."""
        squared, _, _ = self.feet(closed_outlines(rows, OUTLINE_CORNERS))
        return np.sqrt(squared + self.beyond * self.beyond)

    def feet(
        self, outlines: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.intp], NDArray[np.float64]]:
        """Return where the points' feet are on a wall's outlines, see `outline_feet`."""
        return outline_feet(self.piece, self.fraction, self.place, outlines)

    def chosen(self, numbers: NDArray[np.intp]) -> "LocatedPoints":
        """Return some of the points."""
        return LocatedPoints(
            self.piece[numbers], self.fraction[numbers], self.place[numbers], self.beyond[numbers]
        )


def wall_distances(
    organ: Organ, points: NDArray[np.float64], near: NDArray[np.float64], wall: Wall = "outer"
) -> NDArray[np.float64]:
    """Return distances of points to a wall of an organ, each in its own section's plane."""
    step = organ.length / (len(organ.axis) - 1)
    near = np.asarray(near, dtype=np.float64) / step
    located = LocatedPoints.along(points, near, organ.axis, organ.frames)
    return located.distances(organ.rows_at(organ.stations, wall))


def section_distances(
    organ: Organ,
    contours: Sequence[SectionContour],
    places: NDArray[np.float64],
) -> list[NDArray[np.float64]]:
    """Return how far every section's edge points are from an organ."""
    groups: list[list[NDArray[np.float64]]] = [[] for _ in contours]
    for wall in ("outer", "lumen") if organ.hollow else ("outer",):
        edges = [getattr(contour, wall) for contour in contours]
        counts = [len(edge) for edge in edges]
        near = np.repeat(places * organ.length, counts)
        away = wall_distances(organ, np.concatenate(edges), near, wall)
        for group, distances in zip(groups, np.split(away, np.cumsum(counts)[:-1]), strict=True):
            group.append(distances)
    return [np.concatenate(group) for group in groups]


def root_mean_squares(distances: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Return the root mean square of each section's distances."""
    return np.array([math.sqrt(float(away @ away) / len(away)) for away in distances])


@njit(cache=True)
def _located(
    points: NDArray[np.float64],
    near: NDArray[np.float64],
    axis: NDArray[np.float64],
    frames: NDArray[np.float64],
) -> tuple[NDArray[np.intp], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    sections = len(axis)
    pieces = np.empty(len(points), np.intp)
    fractions, beyonds = np.empty(len(points)), np.empty(len(points))
    places = np.empty((len(points), 2))
    for i in range(len(points)):
        p0, p1, p2 = points[i, 0], points[i, 1], points[i, 2]
        # Walk from the guess to the pair of sections whose planes enclose the point.
        k = min(max(int(near[i]), 0), sections - 2)
        direction = 0
        low = high = 0.0
        for _ in range(sections):
            low = (
                (p0 - axis[k, 0]) * frames[k, 0, 2]
                + (p1 - axis[k, 1]) * frames[k, 1, 2]
                + (p2 - axis[k, 2]) * frames[k, 2, 2]
            )
            high = (
                (p0 - axis[k + 1, 0]) * frames[k + 1, 0, 2]
                + (p1 - axis[k + 1, 1]) * frames[k + 1, 1, 2]
                + (p2 - axis[k + 1, 2]) * frames[k + 1, 2, 2]
            )
            if high > 0.0 and direction >= 0 and k < sections - 2:
                k += 1
                direction = 1
            elif low < 0.0 and direction <= 0 and k > 0:
                k -= 1
                direction = -1
            else:
                break
        fraction = low / (low - high) if low != high else 0.0
        fraction = min(max(fraction, 0.0), 1.0)
        beyond = 0.0
        if k == 0 and low < 0.0:
            beyond = -low
        elif k == sections - 2 and high > 0.0:
            beyond = high
        x = y = 0.0
        for c in range(3):
            away = points[i, c] - axis[k, c] * (1.0 - fraction) - axis[k + 1, c] * fraction
            x += away * (frames[k, c, 0] * (1.0 - fraction) + frames[k + 1, c, 0] * fraction)
            y += away * (frames[k, c, 1] * (1.0 - fraction) + frames[k + 1, c, 1] * fraction)
        pieces[i], fractions[i], beyonds[i] = k, fraction, beyond
        places[i, 0], places[i, 1] = x, y
    return pieces, fractions, places, beyonds
