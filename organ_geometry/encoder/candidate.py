"""Attempts at an organ's numbers: an axis, steps, and what is stored in them."""

import copy
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from organ_geometry.contours.contour import ContourLoft, SectionContour, centroid_and_radius
from organ_geometry.curves.half_curves import closed_outlines, polygon_distances
from organ_geometry.encoder.axis_encoder import CodedAxis, coded_axis
from organ_geometry.encoder.axis_sampling import OrganCut
from organ_geometry.encoder.coordinate_descent import OrganNumbers, SliceDescent
from organ_geometry.encoder.jacobian import EdgePoints
from organ_geometry.encoder.penalties import EACH_SLICE, NEAR, Aiming
from organ_geometry.encoder.section_encoder import CodedSections
from organ_geometry.encoder.wall_thickness import thinnest_walls
from organ_geometry.organ_file import code_bytes
from organ_geometry.organ_file.organ_code import (
    COARSEST_TILTS,
    LARGEST_KEY_DEPTH,
    OrganCode,
    scale_number,
    scale_of,
    signal_steps,
    tolerance_number,
    tolerance_of,
)

AXIS_PRICE = 0.2
"""Squared error, summed over the sections, that a bit of the axis is worth, in squared steps."""
OVERALL_SHARE = 0.4
"""What all sections' errors cost, to begin with, as a share of an organ's bits, where all together
are to be kept to an RMS distance: bits go with the logarithm of that."""

_FINEST_SHARE, _COARSEST_SHARE, _LARGEST_SHARE = 1e-3, 0.2, 50.0
# What no numbers keep, so that errors can be said in tolerances.
_LEAST_SHARE = 1e-9
# A reader's stations are at equal chords of the axis: it finds distances so much larger at most.
_CHORDS = 1e-4
_PATIENCE = 2
# Where slices are off by so much more than was foreseen, the axis was bent too far.
_ASTRAY = 1.2
_STRAYS, _STRAY_CORNERS = 0.4, 32
# Tilts are off by half a step: by so many of these a tolerance at the edge.
_TILT_SHARE = 0.8
# An axis is carried on at its ends until their planes enclose the end sections so nearly.
_ENCLOSED, _CARRIES = 0.2, 4


@dataclass(frozen=True, eq=False)
class KeptCode:
    """Numbers of an organ, and how well they keep its sections.

    Attributes
    ----------
    code
        The numbers.
    cut
        The contours cut across their axis.
    rms
        (S,) RMS distance of each section's edge points, mm.
    overall
        That of all edge points, mm.
    worst
        The largest of `rms` in tolerances, or of `overall` in what that may be, if larger.
    """

    code: OrganCode
    cut: OrganCut
    rms: NDArray[np.float64]
    overall: float
    worst: float

    @cached_property
    def data(self) -> bytes:
        """Content of the file."""
        return code_bytes(self.code)

    @property
    def numbers(self) -> OrganNumbers:
        """Those of the numbers that are chosen together."""
        walls = [self.code.outer] if self.code.lumen is None else [self.code.outer, self.code.lumen]
        return OrganNumbers(CodedSections(self.code.keys, np.stack(walls)), self.code.bends)


class OrganAttempts:
    """Makes an organ's numbers in steps of any size, and measures how well they keep its sections.

    Parameters
    ----------
    contours
        Two or more sections in order.
    tolerance
        Largest RMS distance of a section's edge points to the organ, mm.
    overall
        Largest RMS distance of all of them, mm, or None.
    hollow
        Whether all sections have a lumen that counts.
    left_handed
        Whether right, down and along the stack are left-handed in the images.
    units
        What the lengths are called.

    Attributes
    ----------
    contours
        The sections.
    centroids
        (S, 3) their centroids, mm.
    tolerance
        The tolerance as the file says it, mm.
    limits
        (S,) RMS distance that each section may have, mm.
    usual
        What lengths go with, in tolerances: one, if no section is too small for it.
    depth
        With 2^depth pieces between them, candidates for key sections are about as far from one
        another as sections.
    """

    def __init__(
        self,
        contours: Sequence[SectionContour],
        tolerance: float,
        overall: float | None,
        *,
        hollow: bool,
        left_handed: bool,
        units: str,
    ) -> None:
        self.contours: Sequence[SectionContour] = contours
        self._units = units
        self._hollow = hollow
        self._left_handed = left_handed
        self.depth = _depth(len(contours))
        measures = [centroid_and_radius(contour.outer) for contour in contours]
        self.centroids = np.array([centroid for centroid, _ in measures])
        self._radius = float(np.mean([radius for _, radius in measures]))
        self._lofts: list[ContourLoft] = []
        counts = np.sum([[len(edge) for edge in edges] for edges in self._edges], axis=0)
        self._shares = counts / counts.sum()
        within = max(tolerance, _FINEST_SHARE * self._radius)
        self._number = tolerance_number(min(within, _LARGEST_SHARE * self._radius))
        stored = tolerance_of(self._number)
        # What the file says is what is promised.
        self._allowed = max(min(tolerance, stored), _LEAST_SHARE * self._radius)
        self.limits = np.full(len(contours), (1.0 - _CHORDS) * self._allowed)
        self._overall = self._allowed if overall is None else min(overall, self._allowed)
        # Steps go with the tolerance, but none is so long that it would leave nothing of a section.
        narrowest = min(float(np.ptp(contour.outer @ contour.x_dir)) for contour in contours)
        longest = _COARSEST_SHARE * min(self._radius, 0.5 * narrowest)
        self._unit = min(stored, max(1.25 * self._overall, _FINEST_SHARE * self._radius), longest)
        self.usual = self._unit / stored
        finest = _TILT_SHARE * self._radius / self._allowed
        self._tilt_scale = min(max(0, math.ceil(math.log2(finest / COARSEST_TILTS))), 3)
        self.tolerance = stored

    @property
    def _edges(self) -> list[list[NDArray[np.float64]]]:
        """The outer boundaries, and the lumens if they count."""
        edges = [[contour.outer for contour in self.contours]]
        if self._hollow:
            edges.append([one.lumen for one in self.contours if one.lumen is not None])
        return edges

    def _loft(self) -> list[ContourLoft]:
        """Return the lofts through the boundaries."""
        if not self._lofts:
            normals = np.array([contour.normal for contour in self.contours])
            self._lofts = [ContourLoft.through(edges, normals) for edges in self._edges]
        return self._lofts

    def of_some(self, chosen: NDArray[np.intp]) -> "OrganAttempts":
        """Return attempts at the organ of some of the sections, with the same steps and limits.

        Parameters
        ----------
        chosen
            (C,) numbers of the sections, growing.

        Returns
        -------
        OrganAttempts
            The attempts.
        """
        some = copy.copy(self)
        some.contours = [self.contours[int(number)] for number in chosen]
        some.centroids = self.centroids[chosen]
        some.limits = self.limits[chosen]
        some.depth = _depth(len(chosen))
        some._lofts = []
        some._shares = self._shares[chosen] / self._shares[chosen].sum()
        return some

    def of_all(self, one: KeptCode) -> KeptCode | None:
        """Return how well numbers found by some of the sections keep all of them."""
        code = one.code
        cut = OrganCut(
            self.contours, self._loft(), self.centroids, one.cut.axis, self.depth,
            4.0 * self._radius, left_handed=self._left_handed, like=one.cut,
        )  # fmt: skip
        return self.measured(cut, code.section_scale, one.numbers.sections)

    def cut(self, levels: int, scale: int, depth: int, turn: int = 0) -> OrganCut:
        """Return the contours cut by an axis whose ends' planes enclose the end sections."""
        reach = [0.0, 0.0]
        found: list[tuple[float, OrganCut]] = []
        for _ in range(_CARRIES):
            axis = coded_axis(
                self.centroids, levels, scale, self.tolerance, AXIS_PRICE, (reach[0], reach[1])
            )
            cut = self._cut_by(axis, depth, turn)
            located, section = cut.edges[0]
            beyond = [located.beyond[section == end] for end in (0, len(self.contours) - 1)]
            rms = [float(np.sqrt(np.mean(away * away))) for away in beyond]
            found.append((max(rms), cut))
            if max(rms) <= _ENCLOSED * self._unit:
                break
            for end in (0, 1):
                if rms[end] > 0.5 * _ENCLOSED * self._unit:
                    reach[end] += 1.05 * float(beyond[end].max())
        return min(found, key=lambda one: one[0])[1]

    def _cut_by(self, axis: CodedAxis, depth: int, turn: int) -> OrganCut:
        return OrganCut(
            self.contours, self._loft(), self.centroids, axis, depth, 4.0 * self._radius,
            turn, left_handed=self._left_handed, tilt_scale=self._tilt_scale,
        )  # fmt: skip

    def descended(
        self,
        cut: OrganCut,
        share: float,
        start: float,
        rounds: int,
        *,
        keys: NDArray[np.intp] | None = None,
        near: bool = False,
    ) -> list[KeptCode]:
        """Return attempts in steps of a size, each of lower cost than the one before.

        Parameters
        ----------
        cut
            The contours cut across an axis.
        share
            Step of half-curves, as a share of what lengths go with.
        start
            What a bit is worth in the first attempt, in squared steps.
        rounds
            Most attempts after the first.
        keys
            (K,) the key sections of the first attempt, if they are chosen already.
        near
            Whether to come as near to the sections as the steps allow.

        Returns
        -------
        list[KeptCode]
            The attempts; none if the steps leave nothing of a section.
        """
        scale = scale_number(share * self.usual)
        step = self.tolerance * scale_of(scale)
        weights = np.full(cut.samples + 1, len(self.contours) / (cut.samples + 1))
        first = self.measured(cut, scale, cut.encoder.coded(step, start * step**2, weights, keys))
        return [] if first is None else [first, *self.lowered(first, rounds, near=near)]

    def lowered(
        self, one: KeptCode, rounds: int, *, near: bool = False, move_keys: bool = False
    ) -> list[KeptCode]:
        """Return attempts that go on from one, each of lower cost than the one before."""
        scale, step = one.code.section_scale, one.code.section_step
        together = not near and self._overall < self._allowed
        aim = NEAR if near else EACH_SLICE
        if together:
            errors = len(self.contours) * (self._overall / self._allowed) ** 2
            aim = replace(aim, everywhere=OVERALL_SHARE * 8.0 * len(one.data) / errors)
        aiming = Aiming(aim, together=together)
        found: list[KeptCode] = []
        cut, points = one.cut, EdgePoints.of(one.cut)
        free_axis, still = not near, 0
        for _ in range(rounds):
            if (near and one.worst <= 1.0) or aiming.settled or still == _PATIENCE:
                break
            if one.cut is not cut:
                cut, points = one.cut, EdgePoints.of(one.cut)
            descent = SliceDescent(
                points, one.numbers, signal_steps(step), self.limits, one.rms, aiming.aim,
                free_axis=free_axis,
            )  # fmt: skip
            numbers = descent.lowered(move_keys=move_keys)
            bent = not np.array_equal(numbers.bends, one.code.bends)
            new_cut = cut
            if bent:
                new_cut = self._cut_by(cut.axis.bent(numbers.bends), cut.depth, cut.turn)
            attempt = self.measured(new_cut, scale, numbers.sections)
            excess = math.inf if attempt is None else float((attempt.rms / self.limits).max())
            if bent and excess > _ASTRAY * max(1.0, descent.foreseen):
                free_axis = False
                continue
            if attempt is None:
                break
            found.append(attempt)
            same = not bent and _same(attempt, one)
            still = still + 1 if same else 0
            if same and attempt.worst <= 1.0 and not together:
                break
            aiming.learn(excess, attempt.overall / self._overall)
            # What is beyond what all together may be has lost keys that it does not find again.
            if not together or attempt.worst <= 1.0 or one.worst > 1.0:
                one = attempt
        return found

    def measured(self, cut: OrganCut, scale: int, sections: CodedSections) -> KeptCode | None:
        """Return how well numbers keep the sections, or None if they make no organ."""
        axis = cut.axis
        code = OrganCode(
            units=self._units,
            left_handed=self._left_handed,
            tolerance=self._number,
            axis_scale=axis.scale,
            start_axis=cut.start_axis,
            roll=cut.roll,
            turn=cut.turn,
            tilt_scale=cut.tilt_scale,
            tilts=cut.tilts,
            ends=axis.ends,
            bends=axis.bends,
            section_scale=scale,
            candidates=cut.candidates,
            keys=sections.keys,
            outer=sections.stored[0],
            lumen=sections.stored[1] if len(sections.stored) > 1 else None,
        )
        rms = cut.section_rms(code.keys, code.signals())
        # Steps as long as a section is wide may leave none of it.
        if rms is None:
            return None
        overall = math.sqrt(float(self._shares @ (rms * rms)))
        worst = max(float((rms / self.limits).max()), overall / self._overall)
        return KeptCode(code, cut, rms, overall, worst)

    def thin(self, one: KeptCode) -> NDArray[np.intp]:
        """Return the sections next to which the lumen is not inside the outer boundary.

        Parameters
        ----------
        one
            The numbers.

        Returns
        -------
        NDArray[np.intp]
            (T,) the sections, growing.
        """
        if not self._hollow:
            return np.zeros(0, dtype=np.intp)
        at = np.linspace(0.0, 1.0, one.cut.pieces + 1)[thinnest_walls(one.code.organ()) <= 0.0]
        nearest = np.abs(one.cut.places - at[:, np.newaxis]).argmin(axis=1)
        return np.unique(nearest)

    def strays(self, one: KeptCode) -> bool:
        """Return whether an outline goes where no edge is, which no edge point's distance says."""
        organ, edges = one.code.organ(), one.cut.outlines
        stations = np.linspace(0.0, organ.length, len(edges.outer))
        corners = [closed_outlines(organ.rows_at(stations), _STRAY_CORNERS)]
        walls = [edges.outer]
        if edges.lumen is not None:
            corners.append(closed_outlines(organ.rows_at(stations, "lumen"), _STRAY_CORNERS))
            walls.append(edges.lumen)
        return any(
            float(polygon_distances(outline, edge).max()) > _STRAYS * self._radius
            for outlines, rings in zip(corners, walls, strict=True)
            for outline, edge in zip(outlines, rings, strict=True)
        )


def _same(one: KeptCode, other: KeptCode) -> bool:
    here, there = one.numbers.sections, other.numbers.sections
    return np.array_equal(here.keys, there.keys) and np.array_equal(here.stored, there.stored)


def _depth(sections: int) -> int:
    """Return how often the axis is halved for the candidates for key sections."""
    return min(max(1, math.ceil(math.log2(max(2, sections - 1)) - 0.4)), LARGEST_KEY_DEPTH)
