"""The search for the fewest bytes: which axis, which steps, and which integers in them.

Discrete choices, tried one by one:

    levels    the axis has 2^levels + 1 keys; fewest bits for the centroids alone, and one less
    scales    step of the axis and of the sections, as `scale_of` numbers, in step units
    depth     2^depth pieces between candidates for key sections
    turn      rotation of the half-curves in their sections

Axes of a few levels and steps are each encoded in the first section step, with few rounds; the one
of most promise, bytes times how much its worst section exceeds its limit, is encoded in the other
steps. What keeps the tolerance is sorted by bytes, and the first without crossed walls and outlines
where no edge is comes out. A long stack is searched by a sample of its sections first, which those
join that the sample's encoding misses.
"""

from collections.abc import Iterator
from contextlib import suppress

import numpy as np
from numpy.typing import NDArray

from organ_geometry.curves.key_sections import key_sections
from organ_geometry.encoder.axis_encoder import most_levels
from organ_geometry.encoder.axis_sampling import AxisSampling, best_turn
from organ_geometry.encoder.candidate import CandidateEncoder, Encoding
from organ_geometry.encoder.costs import PenaltyController
from organ_geometry.encoder.refinement import Refinement
from organ_geometry.encoder.settings import sample_settings
from organ_geometry.organ_file.coefficients import signals_to_rows
from organ_geometry.organ_file.organ_code import (
    LARGEST_KEY_DEPTH,
    scale_number,
    scale_of,
    signal_steps,
)


class ToleranceNotMet(Exception):  # noqa: N818
    """No encoding kept the tolerance."""

    def __init__(
        self, section: int, nearest_mm: float, overall_mm: float, setting: tuple[int, int, int]
    ) -> None:
        super().__init__(section, nearest_mm, overall_mm, setting)
        # Levels of the axis, levels of the candidates for key sections, and rotation.
        self.setting = setting
        self.section = section  # The worst one of the nearest encoding
        # RMS distance of that section in it, and of all sections, mm.
        self.nearest_mm = nearest_mm
        self.overall_mm = overall_mm


class Search:
    """Searches for an organ's integers."""

    def __init__(self, candidates: CandidateEncoder, *, sampled: bool = False) -> None:
        # The search lowers limits of the candidates, which must be its own. What comes of a sample
        # of the sections is only a start, and is given up sooner.
        self._candidates = candidates
        self._settings = candidates.settings
        self._sampled = sampled
        self._middle: int | None = None
        self._turn = 0  # Rotation of half-curves, known with the axes' levels

    def fewest_bytes(self) -> Encoding:
        """Return the encoding of fewest bytes that keeps the tolerance."""
        crossed = np.zeros(0, dtype=np.intp)
        # Where the walls cross, limits of those sections are lowered; after three times, at a fifth
        # of the tolerance, the wall is thinner than can be represented.
        for _ in range(4):
            kept = self._kept_soonest()
            whole: list[Encoding] = []
            for one in sorted(kept, key=lambda one: len(one.data)):
                crossed = self._candidates.crossed_walls(one)
                if not crossed.size and not self._candidates.has_outliers(one):
                    return one
                if not crossed.size:
                    whole.append(one)
            if whole:
                return self._without_outliers() or whole[0]
            self._candidates.limits[crossed] *= 0.6
        index = self._candidates.contours[int(crossed[0])].index
        raise ValueError(
            f"the lumen of section {index} is not inside its outer boundary: images with a wall "
            f"between them are needed, or a smaller tolerance"
        )

    def _without_outliers(self) -> Encoding | None:
        """Return the smallest encoding without outlier outlines, of any axis, or None."""
        candidates = self._candidates
        kept = self._searched((candidates.depth,), every=True)
        with suppress(ToleranceNotMet):
            kept.append(self.nearest())
        fitting = (
            one
            for one in kept
            if not candidates.crossed_walls(one).size and not candidates.has_outliers(one)
        )
        return min(fitting, key=lambda one: len(one.data), default=None)

    def _kept_soonest(self) -> list[Encoding]:
        """Return encodings that keep the tolerance, with candidates for keys as few as will do."""
        # Half the candidates often do, and take fewer bits to say which are keys.
        *coarser, depth = range(max(1, self._candidates.depth - 1), self._candidates.depth + 1)
        if not self._sampled:
            kept = self._searched((*coarser, depth), last=True)
        else:
            kept = self._searched(tuple(coarser))
            if not kept:
                kept = self._searched((depth,), last=True)
        if not kept:
            # A change between two neighbouring sections may need key sections closer than those.
            exact = self.nearest()
            kept = [exact, *self._searched((exact.sampling.depth,))]
        return kept

    def _searched(
        self, depths: tuple[int, ...], *, last: bool = False, every: bool = False
    ) -> list[Encoding]:
        """Return encodings that keep the tolerance, of several axes and in several steps."""
        settings, candidates = self._settings, self._candidates
        first_step, *steps = settings.section_steps
        worth = settings.bit_worth
        kept: list[Encoding] = []
        tried: list[tuple[float, AxisSampling]] = []
        nearest = np.inf
        for sampling in self._samplings(depths):
            found = candidates.encode(sampling, first_step, worth, settings.choice_rounds)
            kept += _keeping(found)
            nearest = min([nearest, *(one.worst for one in found)])
            if found:
                # Bytes of what keeps the tolerance; more where the last round still misses it.
                size = len(found[-1].data) * max(1.0, found[-1].worst)
                tried.append((size, sampling))
        axes = [sampling for _, sampling in sorted(tried, key=lambda one: one[0])]
        more_rounds = settings.rounds > settings.choice_rounds
        # Where all first encodings miss their limits by a third, no other step will keep them,
        # unless the finest steps do.
        if not more_rounds and nearest > 1.3:
            if not last:
                return []
            self._check_within_reach()
        # The best axis is encoded in all section steps, the first left out where it would repeat,
        # round for round, what the axis was chosen by.
        for sampling in axes if every else axes[:1]:
            for step in [first_step, *steps] if more_rounds or every else steps:
                kept += _keeping(candidates.encode(sampling, step, worth, settings.rounds))
        best_of_depth = {sampling.depth: sampling for sampling in reversed(axes)}
        for step in settings.finer_steps:
            if kept:
                break
            for sampling in best_of_depth.values():
                kept += _keeping(candidates.encode(sampling, step, worth, settings.rounds))
        kept.sort(key=lambda one: len(one.data))
        for one in kept[: settings.moved]:
            kept += _keeping(candidates.refine(one, settings.moved_rounds, move_keys=True))
        return kept

    def _check_within_reach(self) -> None:
        """Raise unless the finest steps come near the tolerance: coarser ones will not either."""
        try:
            self.nearest()
        except ToleranceNotMet as error:
            if error.nearest_mm > 1.15 * float(self._candidates.limits.max()):
                raise

    def nearest(self, setting: tuple[int, int, int] | None = None) -> Encoding:
        """Return the encoding in finest steps that comes nearest to the sections."""
        candidates = self._candidates
        first = candidates.depth
        waiting = (
            [setting]
            if setting is not None
            else [(levels, first, self._turn) for levels in self._levels((1, 0))]
        )
        found: list[tuple[float, tuple[int, int, int], Encoding]] = []
        while waiting:
            levels, depth, turn = waiting.pop(0)
            sampling = candidates.sample(levels, scale_number(candidates.step_unit), depth, turn)
            keys = np.arange(sampling.candidates + 1, dtype=np.intp)
            # A sixteenth of the tolerance, at every candidate: finer ones come no nearer.
            tried = candidates.encode(sampling, 1.0 / 16.0, 0.0, 1, keys=keys, nearest=True)
            found += [(one.worst, (levels, depth, turn), one) for one in tried]
            found = sorted(found, key=lambda one: one[0])[:1]
            if found and found[0][0] <= 1.0:
                return found[0][2]
            # The best of these is tried with twice the candidates too.
            deeper = depth + 1
            if (
                not waiting
                and setting is None
                and found
                and deeper <= min(first + 1, LARGEST_KEY_DEPTH)
            ):
                levels, _, turn = found[0][1]
                waiting = [(levels, deeper, turn)]
        if not found:
            raise ValueError("the sections make no organ: their widths vanish")
        # None was kept: name the section that is off furthest, and the best way found.
        _, nearest, best = found[0]
        worst = int(best.rms.argmax())
        index = candidates.contours[worst].index
        raise ToleranceNotMet(index, float(best.rms[worst]), best.overall, nearest)

    def by_the_thesis(self) -> Encoding:
        """Return the encoding of the key sections that the thesis's rule keeps."""
        exact = self.nearest()
        candidates, sampling = self._candidates, exact.sampling
        finer = sampling.samples // sampling.candidates
        rows = [signals_to_rows(fit[::finer]) for fit in sampling.encoder.fits]
        lumen = rows[1] if len(rows) > 1 else None
        threshold = candidates.tolerance
        # Quarter steps, so that it is the sections left out that make the error.
        scale = scale_number(0.25 * candidates.step_unit)
        step = candidates.tolerance * scale_of(scale)
        weights = np.full(sampling.samples + 1, len(candidates.contours) / (sampling.samples + 1))
        worth = self._settings.bit_worth * step * step
        # The rule's threshold is lowered until the promise is kept, 24 times to a 200th.
        for _ in range(24):
            keys = key_sections(rows[0], lumen, threshold)
            sections = sampling.encoder.encode(step, worth, weights, keys)
            encoding = candidates.evaluate(sampling, scale, sections)
            if encoding is not None and encoding.worst <= 1.0:
                return encoding
            threshold *= 0.8  # 0.8^24 is a 200th
        return exact

    def _levels(self, beyond: tuple[int, ...]) -> Iterator[int]:
        """Yield levels of the axis, counted from those of the centroids' fewest bits."""
        candidates = self._candidates
        most = most_levels(len(candidates.centroids))
        if self._middle is None:
            scale = scale_number(candidates.step_unit)
            costs = [candidates.axis(levels, scale).cost for levels in range(1, most + 1)]
            self._middle = 1 + int(np.argmin(costs))
            sampling = candidates.sample(self._middle, scale, candidates.depth)
            turn, fraction = best_turn(sampling.outlines.outer)
            self._turn = turn if fraction < self._settings.rotation_used else 0
        for more in beyond:
            if 1 <= self._middle + more <= most:
                yield self._middle + more

    def _samplings(self, depths: tuple[int, ...]) -> Iterator[AxisSampling]:
        """Yield the contours sampled across axes of several levels and steps, and rotated."""
        settings, candidates = self._settings, self._candidates
        for levels in self._levels(settings.axis_levels):
            for fraction in settings.axis_steps:
                scale = scale_number(fraction * candidates.step_unit)
                for depth in depths:
                    yield candidates.sample(levels, scale, depth, self._turn)


class SampledSearch:
    """Searches for a long organ's integers by some of its sections.

    Sections of one organ are much alike. Integers that keep every sixth to the tolerance keep
    nearly all of them; those that they do not keep join the search, until all are kept.
    """

    def __init__(self, candidates: CandidateEncoder) -> None:
        self._candidates = candidates

    def fewest_bytes(self) -> Encoding:
        """Return an encoding of few bytes that keeps the tolerance in every section."""
        whole = Search(self._candidates)
        try:
            found = self._by_samples()
        except ToleranceNotMet:
            # A tolerance that a sample cannot keep all sections cannot keep either; `nearest` names
            # the worst of them sooner than a whole search.
            whole.nearest()
            found = None
        except ValueError:
            found = None
        return whole.fewest_bytes() if found is None else found

    def _by_samples(self) -> Encoding | None:
        """Return an encoding found by samples that keeps all sections, or None."""
        candidates = self._candidates
        settings = sample_settings(candidates.settings)
        count = len(candidates.contours)
        joined = np.zeros(count, dtype=np.bool_)
        # Each size is tried twice, the second time with those that joined; then twice the size,
        # until that is most of all or enough for an axis of most keys, 3 x 2^7.
        size, tries = settings.sample, 2
        while True:
            joined[_spread(count, size)] = True
            sample = candidates.subset(np.flatnonzero(joined), settings)
            larger = size < 384 and 2 * size <= 0.5 * count
            tries -= 1
            try:
                found = Search(sample, sampled=True).fewest_bytes()
            except ToleranceNotMet:
                # The axis of so few sections may not have keys enough.
                if not larger:
                    raise
                size, tries = 2 * size, 2
                continue
            kept = self._kept_by_all(found, joined)
            if kept is not None:
                wrong = candidates.crossed_walls(kept).size or candidates.has_outliers(kept)
                return None if wrong else kept
            if tries == 0:
                if not larger:
                    return None
                size, tries = 2 * size, 2

    def _kept_by_all(self, found: Encoding, joined: NDArray[np.bool_]) -> Encoding | None:
        """Return an encoding like the one found that keeps all sections; they join where not."""
        candidates, limits = self._candidates, self._candidates.limits
        settings = candidates.settings
        kept = candidates.evaluate_on_all(found)
        if kept is None or kept.worst <= 1.0:
            return kept
        jacobian, code = kept.sampling.jacobian(), found.code
        controller = PenaltyController(settings.penalty)
        worst = np.inf
        # Rounds go on while each gains half a per cent.
        for _ in range(6):
            if kept.worst > 0.995 * worst:
                break
            worst = kept.worst
            joined[_worst_of_runs(kept.rms / limits)] = True
            slices = np.flatnonzero(joined)
            refinement = Refinement(
                jacobian.of_slices(slices), kept.sections, signal_steps(code.section_step),
                limits[slices], kept.rms[slices], controller.penalty, settings,
            )  # fmt: skip
            again = candidates.evaluate(kept.sampling, code.section_scale, refinement.refined())
            if again is None or again.worst <= 1.0:
                return again
            kept = again
            controller.learn(float((kept.rms / limits).max()), 1.0)
        return None


def _spread(count: int, size: int) -> NDArray[np.intp]:
    """Return about so many numbers of sections at equal distances, the first and last included."""
    pieces = -(-(count - 1) // max(1, round((count - 1) / size)))
    return np.linspace(0, count - 1, pieces + 1).round().astype(np.intp)


def _worst_of_runs(excess: NDArray[np.float64]) -> NDArray[np.intp]:
    """Return the worst of each run of sections that are beyond their limits, or nearly."""
    # Sections from 97 % of their limit on: keeping the others would push them over it.
    beyond = np.flatnonzero(excess > 0.97)
    runs = np.split(beyond, np.flatnonzero(np.diff(beyond) > 1) + 1)
    return np.array([run[excess[run].argmax()] for run in runs if len(run)], dtype=np.intp)


def _keeping(encodings: list[Encoding]) -> list[Encoding]:
    return [one for one in encodings if one.worst <= 1.0]
