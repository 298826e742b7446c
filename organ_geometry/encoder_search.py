"""The search for the fewest bytes: which axis, which steps, and which numbers in them."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from organ_geometry.axis_encoder import ALONG_STEPS, CodedAxis, coded_axis, most_levels
from organ_geometry.contour import ContourLoft, SectionContour, centroid_and_radius
from organ_geometry.edge_changes import EdgePoints
from organ_geometry.key_sections import key_sections
from organ_geometry.organ_code import (
    LARGEST_KEY_DEPTH,
    OrganCode,
    scale_number,
    scale_of,
    signal_steps,
    tolerance_number,
    tolerance_of,
)
from organ_geometry.organ_cut import OrganCut, best_turn
from organ_geometry.organ_file import code_bytes
from organ_geometry.section_encoder import CodedSections
from organ_geometry.section_signals import WIDTH, signals_to_rows
from organ_geometry.slice_descent import Aim, fewer_bits

Effort: TypeAlias = Literal["quick", "full"]

AXIS_PRICE = 0.2
"""Squared error, summed over the sections, that a bit of the axis is worth, in squared steps."""
START_PRICE = 0.1
"""The same for the sections that the search for fewer bits begins with."""

OVERALL_PRICE = 0.5
"""The same where all sections together are to be kept to an RMS distance."""

_FINEST_SHARE, _COARSEST_SHARE, _LARGEST_SHARE = 1e-3, 0.2, 50.0
# Steps in tolerances: of the axis, of half-curves, of these where none of them will do.
_AXIS_STEPS = {"quick": (1.0, 2.0), "full": (0.75, 1.0, 1.5, 2.0, 3.0)}
_STEPS = {"quick": (0.75, 0.5, 1.0), "full": (0.75, 0.4, 0.5, 0.625, 0.875, 1.0, 1.25)}
_FINER_STEPS = (0.35, 0.25, 0.15)
_FINEST_STEP = 1.0 / 16.0
_LEVELS = {"quick": (0, -1), "full": (0, -1, -2, 1)}
_ROUNDS = {"quick": 6, "full": 10}
_FEW_ROUNDS, _PATIENCE = 3, 2
_MARGIN, _LEAST_MARGIN = 0.96, 0.6
_EVERYWHERE, _BEYOND, _MOST_BEYOND = 0.3, 300.0, 5000.0
# An axis is carried on at its ends until their planes enclose the end sections so nearly.
_ENCLOSED, _CARRIES = 0.2, 4
_NEAREST_ROUNDS, _FINER_CANDIDATES = 4, 2


class NotKept(Exception):  # noqa: N818
    """No attempt kept the tolerance.

    Attributes
    ----------
    section
        The section that was off furthest in the nearest attempt.
    nearest_mm, overall_mm
        Its RMS distance there, and that of all sections, mm.
    """

    def __init__(self, section: int, nearest_mm: float, overall_mm: float) -> None:
        super().__init__(section, nearest_mm, overall_mm)
        self.section = section
        self.nearest_mm = nearest_mm
        self.overall_mm = overall_mm


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


class EncoderSearch:
    """Searches for an organ's numbers.

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
        self._contours = contours
        self._units = units
        self._turn: int | None = None
        self._left_handed = left_handed
        self._depth = min(
            max(1, math.ceil(math.log2(max(2, len(contours) - 1)) - 0.4)), LARGEST_KEY_DEPTH
        )
        normals = np.array([contour.normal for contour in contours])
        measures = [centroid_and_radius(contour.outer) for contour in contours]
        self._centroids = np.array([centroid for centroid, _ in measures])
        self._radius = float(np.mean([radius for _, radius in measures]))
        self._lofts = [ContourLoft.through([contour.outer for contour in contours], normals)]
        counts = [len(contour.outer) for contour in contours]
        if hollow:
            lumens = [contour.lumen for contour in contours if contour.lumen is not None]
            self._lofts.append(ContourLoft.through(lumens, normals))
            counts = [a + len(b) for a, b in zip(counts, lumens, strict=True)]
        self._shares = np.array(counts) / sum(counts)
        within = max(tolerance, _FINEST_SHARE * self._radius)
        self._number = tolerance_number(min(within, _LARGEST_SHARE * self._radius))
        stored = tolerance_of(self._number)
        # What the file says is what is promised.
        self._allowed = max(min(tolerance, stored), np.finfo(np.float64).tiny)
        self._overall = self._allowed if overall is None else min(overall, self._allowed)
        # Steps go with the tolerance, but none is so long that it would leave nothing of a section.
        narrowest = min(float(np.ptp(contour.outer @ contour.x_dir)) for contour in contours)
        longest = _COARSEST_SHARE * min(self._radius, 0.5 * narrowest)
        self._unit = min(stored, max(1.25 * self._overall, _FINEST_SHARE * self._radius), longest)
        self._usual = self._unit / stored
        self._tolerance = stored

    def in_fewest_bytes(self, effort: Effort = "quick") -> KeptCode:
        """Return the numbers of fewest bytes that keep the tolerance.

        Parameters
        ----------
        effort
            How much is tried.

        Returns
        -------
        KeptCode
            The numbers.

        Raises
        ------
        NotKept
            If none keep it.
        """
        kept = self._searched(effort)
        if not kept:
            # What changes between two sections may need keys at less than their distance.
            kept = [self.nearest(), *self._searched(effort)]
        return min(kept, key=lambda one: len(one.data))

    def _searched(self, effort: Effort) -> list[KeptCode]:
        """Return numbers that keep the tolerance, of several axes and in steps of several sizes."""
        kept: list[KeptCode] = []
        first, *others = _STEPS[effort]
        tried: list[tuple[float, CodedAxis, OrganCut, int]] = []
        for scale, axis, cut in self._axes(effort):
            found = self._descended(scale, axis, cut, first, _FEW_ROUNDS if others else 8)
            kept += [one for one in found if one.worst <= 1.0]
            last = found[-1]
            tried.append((len(last.data) * max(1.0, last.worst), axis, cut, scale))
        tried.sort(key=lambda one: one[0])
        rounds = _ROUNDS[effort]
        for number, (_, axis, cut, scale) in enumerate(tried):
            if effort == "quick" and number > 1:
                break
            for step in _STEPS[effort] if effort == "full" or number == 0 else _STEPS[effort][:2]:
                kept += self._kept(scale, axis, cut, step, rounds)
        if not kept:
            for _, axis, cut, scale in tried[:2]:
                for step in _FINER_STEPS:
                    kept += self._kept(scale, axis, cut, step, rounds)
                    if kept:
                        break
        return kept

    def nearest(self) -> KeptCode:
        """Return the numbers in finest steps that come nearest to the sections.

        Returns
        -------
        KeptCode
            The numbers.

        Raises
        ------
        NotKept
            If they do not keep the tolerance.
        ValueError
            If the sections make no organ.
        """
        best: KeptCode | None = None
        for _ in range(1 + _FINER_CANDIDATES):
            for scale, axis, cut in self._axes("full", steps=(1.0,)):
                keys = np.arange(cut.candidates + 1, dtype=np.intp)
                found = self._descended(
                    scale, axis, cut, _FINEST_STEP, _NEAREST_ROUNDS, keys=keys, near=True
                )
                for one in found:
                    if best is None or one.worst < best.worst:
                        best = one
                if best is not None and best.worst <= 1.0:
                    return best
            if self._depth >= LARGEST_KEY_DEPTH:
                break
            self._depth += 1
        if best is None:
            raise ValueError("the sections make no organ: their widths vanish")
        worst = int(best.rms.argmax())
        raise NotKept(self._contours[worst].index, float(best.rms[worst]), best.overall)

    def by_the_thesis(self) -> KeptCode:
        """Return the numbers of the key sections that the thesis's rule keeps.

        Returns
        -------
        KeptCode
            The numbers.

        Raises
        ------
        NotKept
            If no numbers keep the tolerance.
        """
        exact = self.nearest()
        cut = exact.cut
        finer = cut.samples // cut.candidates
        rows = [signals_to_rows(fit[::finer]) for fit in cut.encoder.fits]
        lumen = rows[1] if len(rows) > 1 else None
        threshold = self._tolerance
        scale = scale_number(0.25 * self._usual)
        step = self._tolerance * scale_of(scale)
        weights = np.full(cut.samples + 1, len(self._contours) / (cut.samples + 1))
        for _ in range(24):
            keys = key_sections(rows[0], lumen, threshold)
            sections = cut.encoder.coded(step, START_PRICE * step * step, weights, keys)
            attempt = self._attempt(exact.code.axis_scale, exact.code, cut, scale, sections)
            if attempt is not None and attempt.worst <= 1.0:
                return attempt
            threshold *= 0.8
        return exact

    def _axes(
        self, effort: Effort, steps: Sequence[float] | None = None
    ) -> Iterator[tuple[int, CodedAxis, OrganCut]]:
        """Yield axes of several steps and numbers of keys, and the contours cut across them."""
        most = most_levels(len(self._centroids))
        unit = self._tolerance * scale_of(scale_number(self._usual))
        costs = [
            coded_axis(self._centroids, levels, unit, AXIS_PRICE * unit**2).cost
            for levels in range(1, most + 1)
        ]
        middle = 1 + int(np.argmin(costs))
        if self._turn is None:
            _, cut = self._cut(middle, unit)
            self._turn = best_turn(cut.outlines.outer)
        for more in _LEVELS[effort]:
            if not 1 <= middle + more <= most:
                continue
            for share in _AXIS_STEPS[effort] if steps is None else steps:
                scale = scale_number(share * self._usual)
                yield scale, *self._cut(middle + more, self._tolerance * scale_of(scale))

    def _cut(self, levels: int, step: float) -> tuple[CodedAxis, OrganCut]:
        """Return an axis whose ends' planes enclose the end sections, and the contours cut."""
        reach = [0.0, 0.0]
        found: list[tuple[float, CodedAxis, OrganCut]] = []
        for _ in range(_CARRIES):
            axis = coded_axis(
                self._centroids, levels, step, AXIS_PRICE * step * step, (reach[0], reach[1])
            )
            cut = OrganCut(
                self._contours, self._lofts, self._centroids, axis.keys, self._depth,
                4.0 * self._radius, self._turn or 0, left_handed=self._left_handed,
            )  # fmt: skip
            located, section = cut.edges[0]
            beyond = [located.beyond[section == end] for end in (0, len(self._contours) - 1)]
            rms = [float(np.sqrt(np.mean(away * away))) for away in beyond]
            found.append((max(rms), axis, cut))
            if max(rms) <= _ENCLOSED * self._unit:
                break
            for end in (0, 1):
                if rms[end] > 0.5 * _ENCLOSED * self._unit:
                    reach[end] += 1.05 * float(beyond[end].max())
        _, axis, cut = min(found, key=lambda one: one[0])
        return axis, cut

    def _kept(
        self, scale: int, axis: CodedAxis, cut: OrganCut, step: float, rounds: int
    ) -> list[KeptCode]:
        found = self._descended(scale, axis, cut, step, rounds)
        return [one for one in found if one.worst <= 1.0]

    def _descended(
        self,
        axis_scale: int,
        axis: CodedAxis,
        cut: OrganCut,
        share: float,
        rounds: int,
        *,
        keys: NDArray[np.intp] | None = None,
        near: bool = False,
    ) -> list[KeptCode]:
        """Return attempts in steps of a share of the tolerance, each of lower cost."""
        scale = scale_number(share * self._usual)
        step = self._tolerance * scale_of(scale)
        weights = np.full(cut.samples + 1, len(self._contours) / (cut.samples + 1))
        sections = cut.encoder.coded(step, 0.0 if near else START_PRICE * step**2, weights, keys)
        points = EdgePoints.of(cut)
        everywhere, beyond, margin = _EVERYWHERE, _BEYOND, _MARGIN
        if near:
            everywhere, beyond, margin = 30.0, 3000.0, 0.9
        elif self._overall < self._allowed:
            everywhere = (self._allowed / step) ** 2 / OVERALL_PRICE
        limits = np.full(len(self._contours), self._allowed)
        found: list[KeptCode] = []
        still = 0
        for _ in range(rounds + 1):
            attempt = self._attempt(axis_scale, axis, cut, scale, sections)
            if attempt is None:
                break
            found.append(attempt)
            if near and attempt.worst <= 1.0:
                break
            excess = float(attempt.rms.max()) / self._allowed
            if 1.0 < excess < 1.1:
                margin = max(margin - (excess**2 - 1.0), _LEAST_MARGIN)
            if excess > 1.0:
                beyond = min(2.0 * beyond, _MOST_BEYOND)
            if self._overall < self._allowed:
                everywhere *= min(max(attempt.overall / self._overall, 0.85), 1.2) ** 4
                everywhere = max(everywhere, _EVERYWHERE)
            stored = (
                [sections.outer] if sections.lumen is None else [sections.outer, sections.lumen]
            )
            chosen, numbers = fewer_bits(
                points, sections.keys, np.stack(stored), signal_steps(step), limits, attempt.rms,
                Aim(everywhere, beyond, margin),
            )  # fmt: skip
            same = len(chosen) == len(sections.keys) and np.array_equal(numbers, np.stack(stored))
            sections = CodedSections(chosen, numbers[0], numbers[1] if len(numbers) > 1 else None)
            still = still + 1 if same else 0
            if (same and attempt.worst <= 1.0) or still == _PATIENCE:
                break
        return found

    def _attempt(
        self,
        axis_scale: int,
        axis: CodedAxis | OrganCode,
        cut: OrganCut,
        scale: int,
        sections: CodedSections,
    ) -> KeptCode | None:
        """Return how well numbers keep the sections, or None if they make no organ."""
        code = OrganCode(
            units=self._units,
            left_handed=self._left_handed,
            tolerance=self._number,
            axis_scale=axis_scale,
            along_steps=ALONG_STEPS,
            start_axis=cut.start_axis,
            roll=cut.roll,
            turn=cut.turn,
            tilts=cut.tilts,
            ends=axis.ends,
            bends=axis.bends,
            section_scale=scale,
            candidates=cut.candidates,
            keys=sections.keys,
            outer=sections.outer,
            lumen=sections.lumen,
        )
        walls = code.signals()
        # Steps as long as a section is wide may leave none of it.
        if any((signals[:, WIDTH] <= 0.0).any() for signals in walls):
            return None
        rms = cut.section_rms(code.keys, walls)
        overall = math.sqrt(float(self._shares @ (rms * rms)))
        worst = max(float(rms.max()) / self._allowed, overall / self._overall)
        return KeptCode(code, cut, rms, overall, worst)
