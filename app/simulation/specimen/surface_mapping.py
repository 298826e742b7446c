"""How a duct's surface follows its beam on a bed, and where on the surface the strands hold it.

The beam's axis is a straight bar's, or a curve through the organ's own: either is longer than the
organ's axis by a trifle at most, and stations are taken over in proportion. Where the bar's axis is
not the organ's, strands are drawn from the organ's surface, each with its own length and direction.
"""

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from app.simulation.specimen.dissection import Dissection
from kernel_cache import njit
from physics import RuptureCheck
from physics.bed import BeamOnBed, SpaceBeam, Strands, WorstStress

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

ELEMENTS = 40
"""Of a span: a place is freed when the strands within one of so many to either side have parted."""


class SurfaceMapping:
    """A duct's surface over a bed.

    Parameters
    ----------
    dissection
        The duct between its clamps.
    rest, strands
        The beam in space at rest that stands for it, and the strands that hold it.
    tube
        Its name where there are several.
    """

    def __init__(
        self, dissection: Dissection, rest: SpaceBeam, strands: Strands, tube: str | None = None
    ) -> None:
        self._dissection, self._rest, self.strands = dissection, rest, strands
        self.tube = tube
        self.scale = rest.span / dissection.beam.span  # of stations on the beam over the duct's
        first, last = dissection.clamps
        self._ratio = (last - first) / rest.span  # of the organ's axis over the beam's
        self._first = dissection.origin
        self._driven = (dissection.driving.stations - first) / self._ratio

    def move(
        self, beam: BeamOnBed, out: Floats, piece: int | None = None, torn_element: int = -1
    ) -> Floats:
        """Write the (D, 3, 4) transforms of the driving points, of a torn beam's piece 0 or 1."""
        x, q, rest_x, rest_q = beam.shape_of(self.tube)
        _follow(
            self._driven,
            self._dissection.driving.positions,
            self._first,
            self._dissection.frame,
            beam.stations_of(self.tube),
            x,
            q,
            rest_x,
            rest_q,
            torn_element + 1 if piece == 1 else 0,
            torn_element if piece == 0 else x.shape[0] - 1,
            out,
        )
        return out

    def check(self, beam: BeamOnBed, threshold: float) -> RuptureCheck:
        """Return the highest stress in the wall, held against the threshold, MPa."""
        return self.check_of(beam.worst_stress(self.tube), threshold)

    def check_of(self, worst: WorstStress, threshold: float) -> RuptureCheck:
        """Return a stress in the wall, held against the threshold, MPa."""
        return RuptureCheck(
            station=worst.station / self.scale,
            tension_side=1 if np.cos(worst.side) >= 0.0 else -1,
            normal_stress=worst.normal,
            bending_stress=worst.bending,
            threshold=threshold,
        )

    def freed_at(self, damage: Floats, stations: Floats) -> Floats:
        """Return the share of strands that have parted about each station, mm, 0 to 1."""
        reach = self._rest.span / ELEMENTS
        order, placed = self._along
        low, high = (self.scale * stations + side * reach for side in (-1.0, 1.0))
        out = np.empty(stations.size)
        _parted_between(
            damage, order, np.searchsorted(placed, low), np.searchsorted(placed, high), out
        )
        return out

    @cached_property
    def _along(self) -> tuple[Ints, Floats]:
        """(S,) numbers of the strands along the duct, and where they hold it, mm."""
        order = np.argsort(self.strands.stations, kind="stable")
        return order, self.strands.stations[order]

    def strand_angles(self) -> Floats:
        """Return (S,) where round the beam strands hold it, rad from straight down, to the side."""
        places, axes = self._rest.frames_at(self.strands.stations)
        out = self.strands.ends - places
        across, up = (np.einsum("si,si->s", out, axes[:, row]) for row in (1, 2))
        return np.arctan2(across, -up)

    def strands_at_rest(self) -> tuple[Floats, Floats, Floats]:
        """Return the strands as they are drawn at rest, in the organ's coordinates."""
        # (S,) stations along the organ's axis, (S, 3) ends on its surface and (S, 3) feet, mm.
        strands, organ = self.strands, self._dissection.organ
        frame = self._dissection.frame
        stations = self._dissection.clamps[0] + self._ratio * strands.stations
        places, axes = self._rest.frames_at(strands.stations)
        out = strands.ends - places
        # A strand that holds the axis itself is drawn from straight below it.
        out = np.where((out**2).sum(axis=1, keepdims=True) > 1e-12, out, -axes[:, 2])
        out = np.einsum("sj,ij->si", out, frame)
        sections = organ.frames_at(stations)
        x, y = (np.einsum("si,si->s", out, sections[:, :, axis]) for axis in range(2))
        ends = organ.surface(stations, np.arctan2(y, x))
        return stations, ends, ends + np.einsum("sj,ij->si", strands.feet - strands.ends, frame)


@njit(cache=True)
def _parted_between(damage: Floats, order: Ints, first: Ints, after: Ints, out: Floats) -> None:
    """Write the share that has parted of the strands from each `first` on to before `after`.

    `order` has the numbers of the strands in the order in which these count.
    """
    parted = np.zeros(order.size + 1)
    for s in range(order.size):
        parted[s + 1] = parted[s] + (damage[order[s]] >= 1.0)
    for k in range(out.size):
        out[k] = (parted[after[k]] - parted[first[k]]) / max(after[k] - first[k], 1)


@njit(cache=True, nogil=True)
def _follow(
    driven: Floats,
    positions: Floats,
    origin: Floats,
    frame: Floats,
    stations: Floats,
    x: Floats,
    q: Floats,
    rest_x: Floats,
    rest_q: Floats,
    first: int,
    last: int,
    out: Floats,
) -> None:
    """Write [R - I | t] of each driving point from the nodes `first` to `last`.

    Between two nodes the displacement is a cubic through both nodes' displacements, with the slopes
    that their rotations give a tangent; the rotation is the normalised mean of both quaternions.
    Beyond the first and last node a point follows that node rigidly.
    """
    u, r = np.zeros(3), np.zeros((3, 3))
    ends = np.zeros((2, 4))
    slope = np.zeros((2, 3))
    i = first
    for k in range(driven.shape[0]):
        s = driven[k]
        while i < last - 1 and stations[i + 1] < s:
            i += 1
        j = min(i + 1, last)
        h = stations[j] - stations[i]
        w = 0.0 if h == 0.0 else min(max((s - stations[i]) / h, 0.0), 1.0)
        for e in range(2):
            n = i if e == 0 else j
            a, b, c, d = q[n, 0], q[n, 1], q[n, 2], q[n, 3]
            # Turn since rest, q conj(q at rest), and how the tangent at rest has moved.
            ra, rb, rc, rd = rest_q[n, 0], -rest_q[n, 1], -rest_q[n, 2], -rest_q[n, 3]
            ends[e, 0] = a * ra - b * rb - c * rc - d * rd
            ends[e, 1] = a * rb + b * ra + c * rd - d * rc
            ends[e, 2] = a * rc - b * rd + c * ra + d * rb
            ends[e, 3] = a * rd + b * rc - c * rb + d * ra
            slope[e, 0] = h * 2.0 * ((rc * rc + rd * rd) - (c * c + d * d))
            slope[e, 1] = h * 2.0 * ((b * c + a * d) - (rb * rc + -ra * rd))
            slope[e, 2] = h * 2.0 * ((b * d - a * c) - (rb * rd + ra * rc))
        if (
            ends[0, 0] * ends[1, 0]
            + ends[0, 1] * ends[1, 1]
            + (ends[0, 2] * ends[1, 2] + ends[0, 3] * ends[1, 3])
            < 0.0
        ):
            for m in range(4):
                ends[1, m] = -ends[1, m]
        a = (1.0 - w) * ends[0, 0] + w * ends[1, 0]
        b = (1.0 - w) * ends[0, 1] + w * ends[1, 1]
        c = (1.0 - w) * ends[0, 2] + w * ends[1, 2]
        d = (1.0 - w) * ends[0, 3] + w * ends[1, 3]
        norm = np.sqrt(a * a + b * b + c * c + d * d)
        a, b, c, d = a / norm, b / norm, c / norm, d / norm
        # R - I, without the cancellation of 1 - 1.
        r[0, 0], r[0, 1], r[0, 2] = (
            -2.0 * (c * c + d * d),
            2.0 * (b * c - a * d),
            2.0 * (b * d + a * c),
        )
        r[1, 0], r[1, 1], r[1, 2] = (
            2.0 * (b * c + a * d),
            -2.0 * (b * b + d * d),
            2.0 * (c * d - a * b),
        )
        r[2, 0], r[2, 1], r[2, 2] = (
            2.0 * (b * d - a * c),
            2.0 * (c * d + a * b),
            -2.0 * (b * b + c * c),
        )
        h00, h01 = (1.0 + 2.0 * w) * (1.0 - w) ** 2, w * w * (3.0 - 2.0 * w)
        h10, h11 = w * (1.0 - w) ** 2, -w * w * (1.0 - w)
        for m in range(3):
            u[m] = (
                h00 * (x[i, m] - rest_x[i, m])
                + h01 * (x[j, m] - rest_x[j, m])
                + h10 * slope[0, m]
                + h11 * slope[1, m]
            )
        if s < stations[first] or s > stations[last]:  # beyond a torn end: rigidly with its node
            n = first if s < stations[first] else last
            for m in range(3):
                u[m] = x[n, m] - rest_x[n, m]
                for e in range(3):
                    for g in range(3):
                        arm = frame[g, e] * (positions[k, g] - origin[g])
                        u[m] += r[m, e] * arm
                    u[m] -= r[m, e] * rest_x[n, e]
        # Into the organ's coordinates: F (R - I) F^T, and t that moves the point itself by F u.
        for g in range(3):
            moved = 0.0
            for m in range(3):
                moved += frame[g, m] * u[m]
            for o in range(3):
                turn = 0.0
                for m in range(3):
                    for e in range(3):
                        turn += frame[g, m] * r[m, e] * frame[o, e]
                out[k, g, o] = turn
                moved -= turn * positions[k, o]
            out[k, g, 3] = moved
