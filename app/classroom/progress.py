"""Where a person stands in a course, who needs help and why: from the course and the runs kept."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from datetime import datetime, timedelta
from math import log
from statistics import median
from typing import Any, Literal, cast

import msgspec
import numpy as np

from app.classroom.course import INCIDENTS, LOWER, SAFE_FRACTION, Course, Level
from app.classroom.store import RunRecord
from app.simulation import (
    AT_ANATOMY,
    ERROR_CLASSES,
    METRICS,
    Feedback,
    Incident,
    Metrics,
    cause_of,
    read_incidents,
    renamed_metrics,
)

CLOSED_SECONDS = 0.4
"""s after its last tick for which an incident counts as going on (`Incident`)."""
SAME_CAUSE, IDLE_DAYS, MANY_TIMES = 3, 7, 2.0
"""Tries in a row that fail for one cause, days without a run, and tries over the class's median,
from which on somebody is said to need help."""
GOOD, BAD, WRONG = 0.05, 0.2, 0.05
"""Shares of tries that a good and a bad hand fail, and of decisions that are wrong."""
LEAST_TRIES = 6
"""Tries without which no learning curve is fitted."""
TITLES = {each.key: (each.title, each.unit, each.factor) for each in METRICS}

State = Literal["locked", "open", "mastered", "due"]


class Try(msgspec.Struct, frozen=True):
    """One try at a level, as it was kept."""

    run_id: str
    level: str
    seed: int | None  # of the bed; None without one
    at: datetime
    passed: bool
    reason: str
    seconds: float
    incidents: tuple[Incident, ...]
    metrics: Metrics

    @classmethod
    def of(cls, run: RunRecord) -> "Try":
        """Return a run of a level as a try; one that was given up or cut short has failed."""
        assert run.level is not None  # noqa: S101 (the caller has looked)
        metrics = renamed_metrics(msgspec.json.decode(run.measures))
        return cls(
            run_id=run.id,
            level=run.level,
            seed=run.seed,
            at=datetime.fromisoformat(run.started_at),
            passed=run.passed is True,
            reason=run.reason or ("It was given up." if run.finished else "It was cut short."),
            seconds=float(metrics["time_s"]),
            incidents=tuple(read_incidents(run.incidents)),
            metrics=metrics,
        )

    @property
    def cause(self) -> str:
        """The error class that the failure is put down to (`cause_of`), or nothing."""
        cause = None if self.passed else cause_of(self.incidents, self.seconds)
        return "" if cause is None else cause.error

    @property
    def torn(self) -> bool:
        """Whether the duct tore, or another injury was done."""
        return self.metrics.get("tear") is not None or any(
            each.consequence == "injury" for each in self.incidents
        )

    @property
    def seconds_in_tissue(self) -> float:
        """Time in tissue, which older runs lack: of those it is the whole time."""
        return float(self.metrics.get("time_in_tissue_s", self.seconds))

    def safe_fraction(self, safety: Iterable[str]) -> float:
        """Return the share of the time in tissue without an incident of some error classes."""
        # A bleeding goes on outside tissue, too. All of it counts, and may last longer.
        wanted, last, lost = set(safety), 0.0, 0.0
        for each in sorted(self.incidents, key=lambda each: each.start_s):
            if each.error in wanted:
                start = max(each.start_s, last)
                last = max(min(each.end_s + CLOSED_SECONDS, self.seconds), last)
                lost += max(last - start, 0.0)
        handled = self.seconds_in_tissue
        return max(1.0 - lost / handled, 0.0) if handled > 0.0 else float(lost == 0.0)

    def value(self, metric: str) -> float | None:
        """Return a metric of it, or how many incidents it has; None where it has none such."""
        return value_of(metric, self.metrics, self.incidents)


def value_of(metric: str, metrics: Metrics, incidents: Sequence[Incident]) -> float | None:
    """Return a metric of a run, of the hand that has more, or how many incidents there are."""
    if metric == INCIDENTS:
        return float(len(incidents))
    found: Any = metrics.get(metric)
    if isinstance(found, (list, tuple)):
        found = max(
            (each for each in cast("Sequence[Any]", found) if each is not None), default=None
        )
    return None if found is None else float(found)


class LevelStanding(msgspec.Struct, frozen=True):
    """Where somebody stands in a level, and what the next try at it is."""

    level: str
    title: str
    state: State
    row: int  # passes in a row on beds not seen before, practice left out
    passes: int  # that are wanted
    tries: int
    seed: int | None  # of the next try
    feedback: Feedback
    mastered_at: datetime | None
    mastered_by: str | None  # the run
    last: str  # how the last try ended


def unmet(course: Course, level: Level, done: Try) -> str:
    """Return why a try does not count as a pass, in a sentence; empty if it does."""
    if not done.passed:
        return done.reason
    if done.torn:
        return "Passed, but with an injury."
    fraction = done.safe_fraction(level.safety)
    if fraction < SAFE_FRACTION:
        named = {each.error for each in done.incidents} & set(level.safety)
        titles = ", ".join(ERROR_CLASSES[each].title.lower() for each in sorted(named))
        time = "time in tissue" if "time_in_tissue_s" in done.metrics else "time"
        return (
            f"Passed, but only {100.0 * fraction:.0f} % of the {time} was without errors of safety "
            f"({titles}); {100.0 * SAFE_FRACTION:.0f} % are asked for."
        )
    for metric, mark in course.marks(level).items():
        value = done.value(metric)
        title, unit, scale = TITLES.get(metric, ("Incidents of errors", "", 1.0))
        if value is None:
            return (
                f"Passed, but this exercise measures no {title[0].lower()}{title[1:]}, which the "
                "level's benchmark asks for."
            )
        if value > mark + 1e-9 if LOWER[metric] else value < mark - 1e-9:
            amount = f" {unit}" if unit else ""
            return (
                f"Passed, but {title[0].lower()}{title[1:]}: {scale * value:.3g}{amount}, "
                f"{'at most' if LOWER[metric] else 'at least'} {scale * mark:.3g}{amount} "
                "by the benchmark."
            )
    return ""


def standings(course: Course, tries: Sequence[Try], today: datetime) -> list[LevelStanding]:
    """Return where somebody stands in each level, from all his tries, oldest first."""
    by_level: dict[str, list[Try]] = {each.id: [] for each in course.level}
    for each in tries:
        if each.level in by_level:
            by_level[each.level].append(each)
    mastered: set[str] = set()
    found: list[LevelStanding] = []
    for level in course.level:
        each = _standing(course, level, by_level[level.id], today, mastered)
        if each.mastered_at is not None:
            mastered.add(level.id)
        found.append(each)
    return found


def _standing(
    course: Course, level: Level, tries: Sequence[Try], today: datetime, mastered: set[str]
) -> LevelStanding:
    seen = Counter[int | None]()
    where = "an anatomy" if level.goal in AT_ANATOMY else "a bed"
    row, at, missed, run = 0, None, False, None
    checks: list[datetime] = []
    last, before = "", None
    for each in tries:
        why = unmet(course, level, each)
        last = why or "Passed."
        # The last one once more is practice, also where all were seen as often.
        practice = level.seeded and (
            seen[each.seed] > min(seen[seed] for seed in level.seeds)
            or (each.seed == before and seen[each.seed] > 0 and len(level.seeds) > 1)
        )
        seen[each.seed] += 1
        before = each.seed
        if practice:
            last += f" Practice: on {where} that was seen before."
        elif at is None:
            row = 0 if why else row + 1
            if row >= level.passes:
                at, run = each.at, each.run_id
                checks = [at + timedelta(days=days) for days in course.retention.days]
        elif checks and each.at >= checks[0]:
            missed = bool(why)
            while checks and not missed and each.at >= checks[0]:
                checks.pop(0)
    is_due = bool(checks) and today >= checks[0]
    state: State = "locked"
    if at is not None:
        state = "due" if is_due else "mastered"
        row = level.passes - 1 if is_due else level.passes
        last = f"A pass on {where} not seen before brings it back." if is_due and missed else last
    elif set(level.needs) <= mastered:
        state = "open"
    seed = min(level.seeds, key=lambda seed: seen[seed]) if level.seeded else None
    return LevelStanding(
        level=level.id,
        title=level.title,
        state=state,
        row=row,
        passes=level.passes,
        tries=len(tries),
        seed=seed,
        feedback=level.feedback[min(row, len(level.feedback) - 1)],
        mastered_at=at,
        mastered_by=run,
        last=last,
    )


def next_level(found: Sequence[LevelStanding], wanted: str | None = None) -> LevelStanding | None:
    """Return what comes next: a level that the teacher wants, one that is due, or an open one."""
    for each in found:
        if each.level == wanted and each.state != "mastered":
            return each
    for state in ("due", "open"):
        for each in found:
            if each.state == state:
                return each
    return None


def sequential_test(passed: Iterable[bool]) -> Literal["good", "bad", "open"]:
    """Return whether somebody fails `GOOD` of the tries or `BAD`, as soon as that is decided.

    Wald's sequential probability ratio test (Wald 1945, Ann Math Stat 16:117) of the tries in their
    order.

    Returns
    -------
    "good", "bad" or "open", which is not decided

    Examples
    --------
    >>> sequential_test([False, False, True, False])
    'bad'
    """
    bound, total = log((1.0 - WRONG) / WRONG), 0.0
    for each in passed:
        total += log((1.0 - BAD) / (1.0 - GOOD)) if each else log(BAD / GOOD)
        if abs(total) >= bound:
            return "bad" if total > 0.0 else "good"
    return "open"


def needs(
    course: Course, tries: Mapping[str, Sequence[Try]], today: datetime
) -> dict[str, list[str]]:
    """Return why each person needs help, in sentences; those with the most reasons first."""
    counts: dict[str, list[int]] = {}
    for own in tries.values():
        for level, number in Counter(each.level for each in own).items():
            counts.setdefault(level, []).append(number)
    middles = {level: median(numbers) for level, numbers in counts.items()}
    found = {who: _reasons(course, own, middles, today) for who, own in tries.items()}
    return dict(sorted(found.items(), key=lambda each: -len(each[1])))


def _reasons(
    course: Course, tries: Sequence[Try], middles: Mapping[str, float], today: datetime
) -> list[str]:
    if not tries:
        return []
    # A teacher may have put somebody on a level out of order: the one last tried is looked at.
    where = next_level(standings(course, tries, today), tries[-1].level)
    if where is None:
        return []
    found: list[str] = []
    own = [each for each in tries if each.level == where.level]
    causes = [each.cause for each in own[-SAME_CAUSE:]]
    if len(causes) == SAME_CAUSE and causes[0] and len(set(causes)) == 1:
        run = _in_a_row([each.cause for each in own], causes[0])
        title = ERROR_CLASSES[causes[0]].title
        found.append(f"{run} tries in a row failed for one cause: {title.lower()}.")
    level = course.level_of(where.level)
    kept = [not unmet(course, level, each) for each in own]
    if sequential_test(kept) == "bad":
        found.append(
            f"{kept.count(False)} of {len(kept)} tries at {level.title!r} did not pass: more "
            "than the one in twenty of somebody who can do it."
        )
    middle = middles.get(where.level, 0.0)
    if len(own) > MANY_TIMES * middle > 0.0:
        found.append(f"{len(own)} tries at {level.title!r}; half of the class needs {middle:g}.")
    idle = (today - tries[-1].at).days
    if idle >= IDLE_DAYS:
        found.append(f"No try for {idle} days.")
    return found


def _in_a_row(causes: Sequence[str], cause: str) -> int:
    count = 0
    for each in reversed(causes):
        if each != cause:
            break
        count += 1
    return count


class LearningCurve(msgspec.Struct, frozen=True):
    """A curve y = level + (first - level) exp(-(try - 1) / tries) that was fitted to tries."""

    first: float
    level: float  # where it leads
    tries: float  # that bring it nearer by a factor of e
    plateau: float  # the try by which 90 % of the way is done

    def at(self, number: float) -> float:
        """Return its value at a try, the first being 1."""
        return self.level + (self.first - self.level) * float(np.exp(-(number - 1.0) / self.tries))


def learning_curve(values: Sequence[float]) -> LearningCurve | None:
    """Return the learning curve of tries; None if a flat line does nearly as well, or of few."""
    # Least squares over a grid of time constants. It is kept if its corrected Akaike criterion is
    # lower than a constant's by 2 (Burnham and Anderson 2002).
    n = len(values)
    if n < LEAST_TRIES:
        return None
    y, t = np.asarray(values, dtype=np.float64), np.arange(n)
    best: tuple[float, float, Any] | None = None
    for tries in np.geomspace(0.5, 3.0 * n, 60):
        columns = np.column_stack((np.ones(n), np.exp(-t / tries)))
        found = np.linalg.lstsq(columns, y, rcond=None)[0]
        squares = float(((columns @ found - y) ** 2).sum())
        if best is None or squares < best[0]:
            best = squares, float(tries), found
    assert best is not None  # noqa: S101 (the grid is not empty)
    squares, tries, (level, change) = best
    # 4 and 2 parameters, the spread among them.
    flat = _criterion(float(((y - y.mean()) ** 2).sum()), n, 2)
    if _criterion(squares, n, 4) > flat - 2.0:
        return None
    return LearningCurve(float(level + change), float(level), tries, 1.0 + tries * log(10.0))


def _criterion(squares: float, n: int, k: int) -> float:
    return n * log(max(squares, 1e-12) / n) + 2.0 * k + 2.0 * k * (k + 1.0) / (n - k - 1.0)
