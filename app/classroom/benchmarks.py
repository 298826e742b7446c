"""Benchmarks of a course: from runs of chosen people, or of scripted hands until there are any."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from app.anatomy import anatomy_named
from app.classroom.course import INCIDENTS, LOWER, Benchmark, Course, Level
from app.classroom.progress import Try, value_of
from app.simulation import (
    FEW,
    MANNERS,
    Incident,
    Metrics,
    Session,
    Specimen,
    free_specimen,
    perform,
    specimen_in_bed,
)
from organ_geometry import Organ

TREMOR_MM = 0.3
PACES = (0.7, 1.0, 1.3)
"""Speeds of scripted hands, over those of the good ones."""
FRACTION = 0.95
"""Share of the runs of scripted hands that keep their benchmark: who passes so often needs 3.3
tries for three passes in a row."""
LEAST_EXPERTS, LEAST_JUDGED = 3, 4
"""Experts without which there is no benchmark, and without which none is left out."""
MOST_SCORE, OF_NORMAL = 3.5, 0.6745
"""Modified z-score beyond which an expert is left out (Iglewicz and Hoaglin 1993, How to Detect and
Handle Outliers), and the median absolute deviation of a normal curve of unit standard deviation."""


class _Trembling(Session):
    """A session whose hands tremble about where they are led: noise of about 8 Hz."""

    noise: np.random.Generator
    off: NDArray[np.float64]

    def move_hand(self, hand: int, place: Sequence[float] | NDArray[np.float64]) -> None:
        """Lead a hand to about a place."""
        fresh = self.noise.normal(0.0, TREMOR_MM * math.sqrt(1.0 - 0.2**2), 3)
        self.off[hand] = 0.2 * self.off[hand] + fresh
        super().move_hand(hand, np.asarray(place) + self.off[hand])


def scripted_try(level: Level, organ: Organ, *, row: int, seed: int, pace: float) -> Session:
    """Return a session in which good hands that tremble did a level, `pace` times as fast."""
    exercise = level.try_on(organ, None, row=row, seed=seed).exercise
    opening = exercise.opening
    if opening is None:
        specimen = free_specimen(organ)
    elif opening.anatomy is not None:
        specimen = Specimen.of_anatomy(anatomy_named(opening.anatomy))
    else:
        specimen = specimen_in_bed(organ, bed_seed=opening.bed_seed)
    session = _Trembling(specimen, vertices=FEW)
    session.noise, session.off = np.random.default_rng(seed), np.zeros((2, 3))
    session.start_exercise(exercise)
    good: Any = MANNERS[level.goal]["good"]
    quick = {"seconds": good.seconds / pace} if opening is None else {"speed": pace * good.speed}
    perform(session, replace(good, **quick))
    session.finish()
    return session


def scripted_benchmarks(
    course: Course, organ: Organ
) -> tuple[list[Benchmark], dict[str, tuple[int, int]]]:
    """Return benchmarks by scripted hands, and how many runs of each level passed, of how many."""
    # A run of each seed, the beds and paces in turn; those that failed do not count. A level that
    # scripted hands do not do keeps what its file has.
    found: list[Benchmark] = []
    passed: dict[str, tuple[int, int]] = {}
    margins = {
        (each.level, each.metric): each.margin
        for each in course.benchmark
        if each.source == "scripted"
    }
    for level in course.level:
        if not level.benchmarks or level.goal not in MANNERS:
            continue
        runs: list[tuple[Metrics, list[Incident]]] = []
        for number, seed in enumerate(level.seeds):
            session = scripted_try(level, organ, row=number, seed=seed, pace=PACES[number // 3 % 3])
            outcome = session.run.outcome
            if outcome is not None and outcome.passed:
                runs.append((session.metrics(), session.run.incidents()))
        passed[level.id] = len(runs), len(level.seeds)
        if not runs:
            raise ValueError(f"scripted hands passed level {level.id} on none of its beds")
        for metric in level.benchmarks:
            made = scripted_benchmark(level.id, metric, runs)
            margin = margins.get((level.id, metric), made.margin)
            found.append(msgspec.structs.replace(made, margin=margin))
    return found, passed


def scripted_benchmark(
    level: str, metric: str, runs: Sequence[tuple[Metrics, list[Incident]]]
) -> Benchmark:
    """Return the benchmark that most of some runs of scripted hands keep, all of which passed."""
    found = [value_of(metric, *each) for each in runs]
    values = np.array([each for each in found if each is not None])
    if not values.size:
        raise ValueError(f"no run of level {level} has the metric {metric!r} of its benchmark")
    fraction = FRACTION if LOWER[metric] else 1.0 - FRACTION
    mark = float(np.quantile(values, fraction, method="higher" if LOWER[metric] else "lower"))
    return _benchmark(level, metric, mark, values, "scripted", 0)


def expert_benchmarks(course: Course, tries: Mapping[str, Sequence[Try]]) -> list[Benchmark]:
    """Return benchmarks from chosen people's tries that passed: the mean of each one's mean."""
    found: list[Benchmark] = []
    for level in course.level:
        for metric in dict.fromkeys([*level.benchmarks, INCIDENTS, "time_s"]):
            means = _means(level.id, metric, tries.values())
            if len(means) < LEAST_EXPERTS:
                continue
            values = np.array(means)
            near = near_others(values)
            kept = values[near]
            found.append(
                _benchmark(
                    level.id, metric, float(kept.mean()), kept, "experts", int((~near).sum())
                )
            )
    if not found:
        raise ValueError(
            f"a benchmark needs passes of {LEAST_EXPERTS} people in a level; no level has them"
        )
    return found


def near_others(values: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return (N,) which of some experts' values lie near the others'; of few all."""
    # A z-score cannot exceed (N - 1) / sqrt(N), which is below 1.96 up to five experts: the median
    # and the median deviation find one among four. Where most are alike there is no spread.
    away = np.abs(values - np.median(values))
    deviation = float(np.median(away))
    if len(values) < LEAST_JUDGED or deviation == 0.0:
        return np.ones(len(values), dtype=bool)
    return OF_NORMAL * away <= MOST_SCORE * deviation


def _means(level: str, metric: str, tries: Iterable[Sequence[Try]]) -> list[float]:
    """Return each person's mean over the tries of a level that passed."""
    own = (
        [value for each in of_one if each.level == level and each.passed
         if (value := each.value(metric)) is not None]
        for of_one in tries
    )  # fmt: skip
    return [sum(each) / len(each) for each in own if each]


def _benchmark(
    level: str, metric: str, value: float, values: NDArray[np.float64], source: str, out: int
) -> Benchmark:
    return Benchmark(
        level=level, metric=metric, value=round(value, 4), mean=round(float(values.mean()), 4),
        sd=round(float(values.std(ddof=1)), 4) if len(values) > 1 else 0.0, n=len(values),
        source="experts" if source == "experts" else "scripted",
        date=datetime.now(UTC).date().isoformat(), left_out=out,
    )  # fmt: skip
