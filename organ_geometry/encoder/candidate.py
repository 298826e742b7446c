"""Candidates: an organ in integers, for one axis and one step, with its bytes and errors.

`CandidateEncoder` does for one choice of axis and steps what `search` does for many:

    sample    cut the contours across a quantised axis (`axis_sampling`)
    encode    key sections and their first integers (`section_encoder`)
    refine    rounds: linearise distances, descend, evaluate, learn the penalty (`refinement`)
    evaluate  RMS distance of all edge points to the surface that a reader has

Only `evaluate` decides whether a candidate keeps the tolerance: what is promised is what was
measured. Lengths:

    T      the tolerance as the file stores it, rounded down to its 64ths of an octave
    limit  RMS distance that a section may have: T less a reader's error, lower where walls cross
    unit   what all steps are multiples of: T, unless the overall limit or a thin section needs less
"""

import copy
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from organ_geometry.contours.contour import ContourLoft, SectionContour, centroid_and_radius
from organ_geometry.curves.half_curves import closed_outlines
from organ_geometry.curves.outline_distance import polygon_distances, polygon_sides
from organ_geometry.encoder.axis_encoder import QuantisedAxis, quantised_axis
from organ_geometry.encoder.axis_sampling import AxisSampling
from organ_geometry.encoder.costs import PenaltyController
from organ_geometry.encoder.refinement import Refinement
from organ_geometry.encoder.section_encoder import KeySections
from organ_geometry.encoder.settings import EncoderSettings
from organ_geometry.organ import Wall
from organ_geometry.organ_file import OrganCode, code_bytes
from organ_geometry.organ_file.organ_code import (
    COARSEST_TILTS,
    LARGEST_KEY_DEPTH,
    scale_number,
    scale_of,
    signal_steps,
    tolerance_number,
    tolerance_of,
)

_WALLS: tuple[Wall, Wall] = ("outer", "lumen")


@dataclass(frozen=True, eq=False)
class Encoding:
    """An organ in integers, and how well they keep its sections."""

    code: OrganCode
    sampling: AxisSampling
    rms: NDArray[np.float64]  # (S,) RMS distance of each section's edge points, mm
    overall: float  # RMS distance of all edge points, mm
    # The larger of the worst section's RMS over its limit and the overall RMS over its own; up to
    # 1, the encoding keeps what was promised.
    worst: float

    @cached_property
    def data(self) -> bytes:
        """Content of the file."""
        return code_bytes(self.code)

    @property
    def sections(self) -> KeySections:
        """The integers of the key sections."""
        walls = [self.code.outer] if self.code.lumen is None else [self.code.outer, self.code.lumen]
        return KeySections(self.code.keys, np.stack(walls))


class CandidateEncoder:
    """Encodes an organ in steps of any size, and evaluates how well that keeps its sections."""

    def __init__(
        self,
        contours: Sequence[SectionContour],  # S of them, in order
        tolerance: float,  # Largest RMS distance of a section's edge points to the organ, mm
        overall: float | None,  # Largest RMS distance of all of them, mm, or None
        settings: EncoderSettings,
        *,
        hollow: bool,  # Whether all sections have a lumen that counts
        left_handed: bool,  # Whether right, down and along the stack are left-handed in the images
        units: str,
    ) -> None:
        self.contours: Sequence[SectionContour] = contours
        self.settings = settings
        self._units = units
        self._hollow = hollow
        self._left_handed = left_handed
        # With 2^depth pieces between them, candidates for key sections are about as far from one
        # another as sections.
        self.depth = _depth(len(contours))
        measures = [centroid_and_radius(contour.outer) for contour in contours]
        # (S, 3) their centroids, mm.
        self.centroids = np.array([centroid for centroid, _ in measures])
        self._radius = float(np.mean([radius for _, radius in measures]))
        self._lofts: list[ContourLoft] = []
        counts = np.sum([[len(edge) for edge in edges] for edges in self._edges], axis=0)
        # Each section's part of all edge points: the overall RMS weights sections by it.
        self._fractions = counts / counts.sum()
        # No image resolves a thousandth of the radius, and a tolerance of fifty radii constrains
        # nothing: both bound the numbers that the search has to do with.
        finest = 1e-3 * self._radius
        self._number = tolerance_number(min(max(tolerance, finest), 50.0 * self._radius))
        stored = tolerance_of(self._number)
        # The promise is the smaller of the tolerance asked and the one stored. A billionth of the
        # radius cannot be kept by any integers; it only keeps quotients by a tolerance of 0 finite.
        self._allowed = max(min(tolerance, stored), 1e-9 * self._radius)
        # A reader may measure at stations of equal chords along the axis, where distances come out
        # larger by 1e-4 at most.
        # (S,) RMS distance that each section may have, mm.
        self.limits = np.full(len(contours), (1.0 - 1e-4) * self._allowed)
        self._overall = self._allowed if overall is None else min(overall, self._allowed)
        # Steps go with the tolerance, but none is so long that it would leave nothing of a section:
        # a fifth of the narrowest half width.
        # The width along x is what rounding could make vanish; it is quantised in double steps.
        narrowest = min(float(np.ptp(contour.outer @ contour.x_dir)) for contour in contours)
        longest = 0.2 * min(self._radius, 0.5 * narrowest)
        self._unit = min(stored, max(1.25 * self._overall, finest), longest)
        # What steps are multiples of, in tolerances; 1 unless a section is too narrow.
        self.step_unit = self._unit / stored
        # Tilts are rounded by half a step: at the edge that is 0.6 of a tolerance at most.
        # (Half a step of 1/n at a radius R is off by R / 2n, and n >= 0.8 R / T.)
        steps = 0.8 * self._radius / self._allowed
        self._tilt_scale = min(max(0, math.ceil(math.log2(steps / COARSEST_TILTS))), 3)
        self.tolerance = stored  # The tolerance as the file says it, mm

    @property
    def _edges(self) -> list[list[NDArray[np.float64]]]:
        """The outer boundaries, and the lumens if they count."""
        edges = [[contour.outer for contour in self.contours]]
        if self._hollow:
            edges.append([one.lumen for one in self.contours if one.lumen is not None])
        return edges

    def _loft(self) -> list[ContourLoft]:
        if not self._lofts:
            normals = np.array([contour.normal for contour in self.contours])
            self._lofts = [ContourLoft.through(edges, normals) for edges in self._edges]
        return self._lofts

    def subset(self, chosen: NDArray[np.intp], settings: EncoderSettings) -> "CandidateEncoder":
        """Return an encoder of some of the sections, growing, with the same steps and limits."""
        # Made by copying: steps, tilts and radius must be those of all sections, or integers found
        # here would not mean the same there.
        some = copy.copy(self)
        some.settings = settings
        some.contours = [self.contours[int(number)] for number in chosen]
        some.centroids = self.centroids[chosen]
        some.limits = self.limits[chosen]
        some.depth = _depth(len(chosen))
        some._lofts = []
        some._fractions = self._fractions[chosen] / self._fractions[chosen].sum()
        return some

    def evaluate_on_all(self, one: Encoding) -> Encoding | None:
        """Return an encoding of some of the sections, evaluated on all of them."""
        code = one.code
        sampling = AxisSampling(
            self.contours, self._loft(), self.centroids, one.sampling.axis, self.depth,
            4.0 * self._radius, settings=self.settings, left_handed=self._left_handed,
            frames_from=one.sampling,
        )  # fmt: skip
        return self.evaluate(sampling, code.section_scale, one.sections)

    def axis(
        self, levels: int, scale: int, reach: tuple[float, float] = (0.0, 0.0)
    ) -> QuantisedAxis:
        """Return the axis of 2^levels + 1 keys near the centroids, carried on by its reach, mm."""
        worth = self.settings.axis_bit_worth
        return quantised_axis(self.centroids, levels, scale, self.tolerance, worth, reach)

    def sample(self, levels: int, scale: int, depth: int, turn: int = 0) -> AxisSampling:
        """Return the contours sampled across an axis that ends beyond the end sections."""
        # The axis has 2^levels + 1 keys in steps of a scale, 2^depth + 1 candidates for key
        # sections and its half-curves a turn, as in `OrganCode`.
        reach = [0.0, 0.0]
        found: list[tuple[float, AxisSampling]] = []
        # Points beyond an end by a fifth of a step add 2 % to a distance of one unit (in squares).
        enclosed = 0.2 * self._unit
        # An axis is carried on at its ends by how far edges are beyond its ends' planes. That turns
        # the planes a little: four times are enough, or the best of them is taken.
        for _ in range(4):
            sampling = self._sample(self.axis(levels, scale, (reach[0], reach[1])), depth, turn)
            located, section = sampling.edges[0]
            beyond = [located.beyond[section == end] for end in (0, len(self.contours) - 1)]
            rms = [float(np.sqrt(np.mean(away * away))) for away in beyond]
            found.append((max(rms), sampling))
            if max(rms) <= enclosed:
                break
            for end in (0, 1):
                if rms[end] > 0.5 * enclosed:
                    # A little more than what is missing, so that the next plane is not just short.
                    reach[end] += 1.05 * float(beyond[end].max())
        return min(found, key=lambda one: one[0])[1]

    def _sample(self, axis: QuantisedAxis, depth: int, turn: int) -> AxisSampling:
        return AxisSampling(
            # Lofts go on for two diameters, because planes of oblique ends reach beyond them.
            self.contours, self._loft(), self.centroids, axis, depth, 4.0 * self._radius, turn,
            settings=self.settings, left_handed=self._left_handed, tilt_scale=self._tilt_scale,
        )  # fmt: skip

    def encode(
        self,
        sampling: AxisSampling,
        fraction: float,
        bit_worth: float,
        rounds: int,
        *,
        keys: NDArray[np.intp] | None = None,
        nearest: bool = False,
    ) -> list[Encoding]:
        """Return encodings in steps of a size, each refined from the one before."""
        # The step of shape coefficients is a share of the step unit, and a bit is worth so many
        # squared steps in the first encoding; there are none if the steps leave nothing of a
        # section. (K,) keys are the key sections, if they are chosen already. The nearest come as
        # near to the sections as the steps allow.
        scale = scale_number(fraction * self.step_unit)
        step = self.tolerance * scale_of(scale)
        weights = np.full(sampling.samples + 1, len(self.contours) / (sampling.samples + 1))
        sections = sampling.encoder.encode(step, bit_worth * step**2, weights, keys)
        first = self.evaluate(sampling, scale, sections)
        return [] if first is None else [first, *self.refine(first, rounds, nearest=nearest)]

    def refine(
        self, one: Encoding, rounds: int, *, nearest: bool = False, move_keys: bool = False
    ) -> list[Encoding]:
        """Return the encodings of at most so many refinement rounds, begun with one."""
        settings = self.settings
        scale, step = one.code.section_scale, one.code.section_step
        together = not nearest and self._overall < self._allowed
        penalty = settings.nearest_penalty if nearest else settings.penalty
        if together:
            # All sections' errors at their limit cost a share of the bits.
            errors = len(self.contours) * (self._overall / self._allowed) ** 2
            # The sum of D at the overall limit, times the slope, is that share of the file's bits.
            slope = settings.overall_fraction * 8.0 * len(one.data) / errors
            penalty = replace(penalty, slope=slope)
        controller = PenaltyController(penalty, together=together)
        found: list[Encoding] = []
        sampling, jacobian, still = one.sampling, one.sampling.jacobian(), 0
        for _ in range(rounds):
            # Enough, the price found, or twice nothing changed although the penalty did.
            if (nearest and one.worst <= 1.0) or controller.settled or still == 2:
                break
            refinement = Refinement(
                jacobian, one.sections, signal_steps(step), self.limits, one.rms,
                controller.penalty, settings,
            )  # fmt: skip
            sections = refinement.refined(move_keys=move_keys)
            encoding = self.evaluate(sampling, scale, sections)
            if encoding is None:
                break
            found.append(encoding)
            same = _same(sections, one.sections)
            still = still + 1 if same else 0
            if same and encoding.worst <= 1.0 and not together:
                break
            if settings.penalty_learned:
                controller.learn(
                    float((encoding.rms / self.limits).max()), encoding.overall / self._overall
                )
            # With an overall limit, one that missed it is not gone on from if one that kept it is
            # there: it has lost key sections, and refinement does not put them back.
            if not together or encoding.worst <= 1.0 or one.worst > 1.0:
                one = encoding
        return found

    def evaluate(
        self, sampling: AxisSampling, scale: int, sections: KeySections
    ) -> Encoding | None:
        """Return how well integers keep the sections, or None if they make no organ."""
        axis = sampling.axis
        code = OrganCode(
            units=self._units,
            left_handed=self._left_handed,
            tolerance=self._number,
            axis_scale=axis.scale,
            start_axis=sampling.start_axis,
            roll=sampling.roll,
            turn=sampling.turn,
            tilt_scale=sampling.tilt_scale,
            tilts=sampling.tilts,
            ends=axis.ends,
            bends=axis.bends,
            section_scale=scale,
            candidates=sampling.candidates,
            keys=sections.keys,
            outer=sections.stored[0],
            lumen=sections.stored[1] if len(sections.stored) > 1 else None,
        )
        rms = sampling.section_rms(code.keys, code.signals())
        # Steps as long as a section is wide may leave none of it.
        if rms is None:
            return None
        overall = math.sqrt(float(self._fractions @ (rms * rms)))
        worst = max(float((rms / self.limits).max()), overall / self._overall)
        return Encoding(code, sampling, rms, overall, worst)

    def crossed_walls(self, one: Encoding) -> NDArray[np.intp]:
        """Return the sections next to which the lumen is not inside the outer boundary."""
        if not self._hollow:
            return np.zeros(0, dtype=np.intp)
        organ = one.code.organ()
        walls = (closed_outlines(organ.rows_at(organ.stations, wall), 96) for wall in _WALLS)
        crossed = np.array(
            [thinnest_wall(outer, lumen) <= 0.0 for outer, lumen in zip(*walls, strict=True)]
        )
        at = np.linspace(0.0, 1.0, one.sampling.pieces + 1)[crossed]
        nearest = np.abs(one.sampling.places - at[:, np.newaxis]).argmin(axis=1)
        return np.unique(nearest)

    def has_outliers(self, one: Encoding) -> bool:
        """Return whether an outline runs far from the edge between edge points."""
        # Beyond 0.4 of the mean radius: a half-curve of degree 6 that has run away between edge
        # points, as it can where sections have few. Each of those may still have the outline near:
        # the outline is compared with the edge, not the other way round.
        organ, edges = one.code.organ(), one.sampling.outlines
        stations = np.linspace(0.0, organ.length, len(edges.outer))
        rings = [edges.outer] if edges.lumen is None else [edges.outer, edges.lumen]
        return any(
            float(polygon_distances(outline, edge).max()) > 0.4 * self._radius
            for wall, edges_of_wall in zip(_WALLS, rings, strict=False)
            for outline, edge in zip(
                closed_outlines(organ.rows_at(stations, wall), 32), edges_of_wall, strict=True
            )
        )


def thinnest_wall(outer: NDArray[np.float64], lumen: NDArray[np.float64]) -> float:
    """Return the thinnest wall between two outlines, below 0 where the lumen is not inside."""
    # Measured from the lumen's corners to the outer outline's sides.
    squared, inside = polygon_sides(lumen, outer)
    away = np.sqrt(squared)
    return float(np.where(inside, away, -away).min())


def _same(one: KeySections, other: KeySections) -> bool:
    return np.array_equal(one.keys, other.keys) and np.array_equal(one.stored, other.stored)


def _depth(sections: int) -> int:
    """Return how often the axis is halved for the candidates for key sections."""
    # Up to 2^0.4 sections a candidate: the next power of two would double the bits that say where
    # keys are.
    return min(max(1, math.ceil(math.log2(max(2, sections - 1)) - 0.4)), LARGEST_KEY_DEPTH)
