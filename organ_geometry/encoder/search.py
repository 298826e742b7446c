"""The search for the fewest bytes: which axis, which steps, and which numbers in them."""

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from organ_geometry.curves.key_sections import key_sections
from organ_geometry.encoder.axis_encoder import coded_axis, most_levels
from organ_geometry.encoder.axis_sampling import OrganCut, best_turn
from organ_geometry.encoder.candidate import AXIS_PRICE, KeptCode, OrganAttempts
from organ_geometry.organ_file.coefficients import signals_to_rows
from organ_geometry.organ_file.organ_code import LARGEST_KEY_DEPTH, scale_number, scale_of

Effort: TypeAlias = Literal["quick", "full"]
Search: TypeAlias = Literal["quick", "full", "sample"]


@dataclass(frozen=True, slots=True)
class _Tries:
    """What is tried.

    Attributes
    ----------
    levels
        Levels of the axis, beyond those that its centroids are kept by in fewest bits.
    axis_steps, steps
        Steps of the axis and of half-curves, in tolerances.
    prices
        What a bit is worth in the sections that the search for fewer bits begins with.
    axes
        How many axes are tried in all steps or some of them.
    rounds
        Most attempts with each.
    refined, fine_rounds
        How many of the smallest have their key sections moved, and most attempts with each.
    """

    levels: tuple[int, ...]
    axis_steps: tuple[float, ...]
    steps: tuple[float, ...]
    prices: tuple[float, ...]
    axes: int
    rounds: int
    refined: int = 0
    fine_rounds: int = 0


_TRIES = {
    "quick": _Tries((0, -1), (1.0, 2.0), (0.75, 0.5, 1.0), (0.1,), 2, 6),
    "full": _Tries((0, -1, -2), (1.0, 1.5, 2.0, 3.0), (0.75, 0.5, 1.0), (0.1, 0.3), 3, 10, 5, 6),
    "sample": _Tries((0, -1), (1.5,), (0.75, 1.0), (0.1,), 1, 5),
}
_FEW_ROUNDS = 3
# Steps of half-curves where none of those will do, and the finest.
_FINER_STEPS, _FINEST_STEP = (0.35, 0.25, 0.15), 1.0 / 16.0
_NEAREST_LEVELS = (1, 0)
# A turn that leaves so little of the error is taken; of one that leaves less than all but a little,
# it shows only in the end.
_TURN_PAYS, _TURN_MAY_PAY = 0.7, 0.95
_THESIS_PRICE = 0.1
_TIGHTENINGS, _TIGHTER = 3, 0.6
_NEAREST_ROUNDS, _FINER_CANDIDATES = 1, 1
# Where first attempts are so far off, in tolerances, and finest steps so far, more are of no use.
_FAR, _OUT_OF_REACH = 1.3, 1.15


class NotKept(Exception):  # noqa: N818
    """No attempt kept the tolerance.

    Attributes
    ----------
    section
        The section that was off furthest in the nearest attempt.
    nearest_mm, overall_mm
        Its RMS distance there, and that of all sections, mm.
    way
        Levels of the axis and of the candidates for key sections, and the half-curves' turn there.
    """

    def __init__(
        self, section: int, nearest_mm: float, overall_mm: float, way: tuple[int, int, int]
    ) -> None:
        super().__init__(section, nearest_mm, overall_mm, way)
        self.way = way
        self.section = section
        self.nearest_mm = nearest_mm
        self.overall_mm = overall_mm


class EncoderSearch:
    """Searches for an organ's numbers.

    Parameters
    ----------
    attempts
        Makes and measures numbers. The search sets its limits: it needs its own.
    """

    def __init__(self, attempts: OrganAttempts) -> None:
        self._attempts = attempts
        self._middle: int | None = None
        self._turn, self._turned = 0, 1.0

    def in_fewest_bytes(self, effort: Search = "quick") -> KeptCode:
        """Return the numbers of fewest bytes that keep the tolerance."""
        thin = np.zeros(0, dtype=np.intp)
        for _ in range(1 + _TIGHTENINGS):
            kept = self._kept_soonest(effort)
            whole: list[KeptCode] = []
            for one in sorted(kept, key=lambda one: len(one.data)):
                thin = self._attempts.thin(one)
                if not thin.size and not self._attempts.strays(one):
                    return one
                if not thin.size:
                    whole.append(one)
            if whole:
                return self._steadier(effort) or whole[0]
            # Where the walls cross, sections must be kept more nearly.
            self._attempts.limits[thin] *= _TIGHTER
        index = self._attempts.contours[int(thin[0])].index
        raise ValueError(
            f"the lumen of section {index} is not inside its outer boundary: images with a wall "
            f"between them are needed, or a smaller tolerance"
        )

    def _steadier(self, effort: Search) -> KeptCode | None:
        """Return numbers of which no outline goes where no edge is, of any axis, or None."""
        attempts = self._attempts
        kept = self._searched(effort, (attempts.depth,), every=True)
        with suppress(NotKept):
            kept.append(self.nearest())
        fitting = (one for one in kept if not attempts.thin(one).size and not attempts.strays(one))
        return min(fitting, key=lambda one: len(one.data), default=None)

    def _kept_soonest(self, effort: Search) -> list[KeptCode]:
        """Return numbers that keep the tolerance, with candidates for keys as few as will do."""
        *coarser, depth = range(max(1, self._attempts.depth - 1), self._attempts.depth + 1)
        if effort != "sample":
            kept = self._searched(effort, (*coarser, depth), last=True)
        else:
            kept = self._searched(effort, tuple(coarser))
            if not kept:
                kept = self._searched(effort, (depth,), last=True)
        if not kept:
            # What changes between two sections may need keys at less than their distance.
            exact = self.nearest()
            kept = [exact, *self._searched(effort, (exact.cut.depth,))]
        return kept

    def _searched(
        self, effort: Search, depths: tuple[int, ...], *, last: bool = False, every: bool = False
    ) -> list[KeptCode]:
        """Return numbers that keep the tolerance, of several axes and in steps of several sizes."""
        tries, attempts = _TRIES[effort], self._attempts
        kept: list[KeptCode] = []
        tried: list[tuple[float, OrganCut]] = []
        nearest = np.inf
        for cut in self._cuts(effort, depths):
            found = attempts.descended(cut, tries.steps[0], tries.prices[0], _FEW_ROUNDS)
            kept += _keeping(found)
            nearest = min([nearest, *(one.worst for one in found)])
            if found:
                size = len(found[-1].data) * max(1.0, found[-1].worst)
                tried.append((size, cut))
        tried = _best_of_each_depth(tried)
        if effort != "full" and nearest > _FAR:
            if not last:
                return []
            self._check_within_reach()
        # The axis of most promise is tried with all steps, the next with some.
        for number, (_, cut) in enumerate(tried if every else tried[: tries.axes]):
            steps = tries.steps if number == 0 or effort == "full" else tries.steps[:2]
            # A few rounds were enough to choose an axis by, and are for a sample.
            for step in steps[1:] if effort == "sample" else steps:
                for price in tries.prices:
                    kept += _keeping(attempts.descended(cut, step, price, tries.rounds))
        for step in _FINER_STEPS:
            if kept:
                break
            for _, cut in tried[:2]:
                kept += _keeping(attempts.descended(cut, step, tries.prices[0], tries.rounds))
        kept.sort(key=lambda one: len(one.data))
        for one in kept[: tries.refined]:
            kept += _keeping(attempts.lowered(one, tries.fine_rounds, move_keys=True))
        return kept

    def _check_within_reach(self) -> None:
        """Check that finest steps come near to what is to be kept; coarser ones will not either."""
        try:
            self.nearest()
        except NotKept as error:
            if error.nearest_mm > _OUT_OF_REACH * float(self._attempts.limits.max()):
                raise

    def nearest(self, way: tuple[int, int, int] | None = None) -> KeptCode:
        """Return the numbers in finest steps that come nearest to the sections."""
        attempts = self._attempts
        first = attempts.depth
        ways = (
            [way]
            if way is not None
            else [
                (levels, first, turn)
                for levels in self._levels(_NEAREST_LEVELS)
                for turn in self._turns("quick")
            ]
        )
        found: list[tuple[float, tuple[int, int, int], KeptCode]] = []
        while ways:
            levels, depth, turn = ways.pop(0)
            cut = attempts.cut(levels, scale_number(attempts.usual), depth, turn)
            keys = np.arange(cut.candidates + 1, dtype=np.intp)
            tried = attempts.descended(
                cut, _FINEST_STEP, 0.0, _NEAREST_ROUNDS, keys=keys, near=True
            )
            found += [(one.worst, (levels, depth, turn), one) for one in tried]
            found = sorted(found, key=lambda one: one[0])[:1]
            if found and found[0][0] <= 1.0:
                return found[0][2]
            deeper = depth + 1
            if (
                not ways
                and way is None
                and found
                and deeper <= min(first + _FINER_CANDIDATES, LARGEST_KEY_DEPTH)
            ):
                levels, _, turn = found[0][1]
                ways = [(levels, deeper, turn)]
        if not found:
            raise ValueError("the sections make no organ: their widths vanish")
        _, nearest, best = found[0]
        worst = int(best.rms.argmax())
        index = attempts.contours[worst].index
        raise NotKept(index, float(best.rms[worst]), best.overall, nearest)

    def by_the_thesis(self) -> KeptCode:
        """Return the numbers of the key sections that the thesis's rule keeps."""
        exact = self.nearest()
        cut = exact.cut
        finer = cut.samples // cut.candidates
        rows = [signals_to_rows(fit[::finer]) for fit in cut.encoder.fits]
        lumen = rows[1] if len(rows) > 1 else None
        threshold = self._attempts.tolerance
        scale = scale_number(0.25 * self._attempts.usual)
        step = self._attempts.tolerance * scale_of(scale)
        weights = np.full(cut.samples + 1, len(self._attempts.contours) / (cut.samples + 1))
        for _ in range(24):
            keys = key_sections(rows[0], lumen, threshold)
            sections = cut.encoder.coded(step, _THESIS_PRICE * step * step, weights, keys)
            attempt = self._attempts.measured(cut, scale, sections)
            if attempt is not None and attempt.worst <= 1.0:
                return attempt
            threshold *= 0.8
        return exact

    def _levels(self, beyond: tuple[int, ...]) -> Iterator[int]:
        """Yield levels of the axis, so many beyond those that keep its centroids in fewest bits."""
        attempts = self._attempts
        most = most_levels(len(attempts.centroids))
        if self._middle is None:
            scale = scale_number(attempts.usual)
            costs = [
                coded_axis(attempts.centroids, levels, scale, attempts.tolerance, AXIS_PRICE).cost
                for levels in range(1, most + 1)
            ]
            self._middle = 1 + int(np.argmin(costs))
            cut = attempts.cut(self._middle, scale, attempts.depth)
            self._turn, self._turned = best_turn(cut.outlines.outer)
        for more in beyond:
            if 1 <= self._middle + more <= most:
                yield self._middle + more

    def _turns(self, effort: Search) -> list[int]:
        """Return how far half-curves are turned in their sections, once axes' levels are known."""
        if self._turned < _TURN_PAYS:
            return [self._turn]
        may_pay = effort == "full" and self._turned < _TURN_MAY_PAY
        return [0, self._turn] if may_pay else [0]

    def _cuts(self, effort: Search, depths: tuple[int, ...]) -> Iterator[OrganCut]:
        """Yield the contours cut across axes of several steps and numbers of keys, and turned."""
        tries, attempts = _TRIES[effort], self._attempts
        for levels in self._levels(tries.levels):
            for share in tries.axis_steps:
                scale = scale_number(share * attempts.usual)
                for depth in depths:
                    for turn in self._turns(effort):
                        yield attempts.cut(levels, scale, depth, turn)


def _best_of_each_depth(tried: list[tuple[float, OrganCut]]) -> list[tuple[float, OrganCut]]:
    """Return cuts by what they promise, the best of each depth before the second best of any."""
    ranked: list[tuple[int, float, int]] = []
    of_depth: dict[int, int] = {}
    for number in sorted(range(len(tried)), key=lambda number: tried[number][0]):
        size, cut = tried[number]
        before = of_depth.setdefault(cut.depth, 0)
        of_depth[cut.depth] += 1
        ranked.append((before, size, number))
    return [tried[number] for _, _, number in sorted(ranked)]


def _keeping(attempts: list[KeptCode]) -> list[KeptCode]:
    return [one for one in attempts if one.worst <= 1.0]
