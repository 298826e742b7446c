"""What a study of validity reports, from an export for research: groups, retest, pass mark, curves.

Nothing here says that results mean anything for patients. Sources: area under the curve, DeLong et
al. 1988 (Biometrics 44:837) by midranks, Sun and Xu 2014 (IEEE Signal Process Lett 21:1389); g,
Hedges 1981 (J Educ Stat 6:107); intraclass correlation ICC(2,1), Shrout and Fleiss 1979 (Psychol
Bull 86:420), its interval McGraw and Wong 1996 (Psychol Methods 1:30); standard error of
measurement, Weir 2005 (J Strength Cond Res 19:231); alpha, Cronbach 1951 (Psychometrika 16:297);
several tests, Holm 1979 (Scand J Stat 6:65); pass mark by contrasting groups, Livingston and Zieky
1982. They need scipy.
"""

import csv
import math
from collections.abc import Mapping, Sequence
from importlib import import_module
from pathlib import Path
from statistics import median
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from app.classroom.progress import LEAST_TRIES, learning_curve

CONFIDENCE = 0.95
MEASURES = ("consequential", "incidents", "time_s", "peak_stress_ratio")
"""The first is the primary one. Of all of them less is better."""
LEAST_PEOPLE = 3
"""People of a group, or of a retest, without whom nothing is worked out."""

NONE = math.nan
"""Where there is no value: in JSON null."""

Vector = NDArray[np.float64]


class Estimate(msgspec.Struct, frozen=True):
    """A value with its interval of 95 %."""

    value: float
    low: float
    high: float


class Plan(msgspec.Struct, frozen=True):
    """What was fixed before the data were seen."""

    novices: str  # name of the group
    experts: str
    tries: int = 3  # first attempts of a task that count
    retest_from: int = 7  # days after the first try
    retest_to: int = 14


class KnownGroups(msgspec.Struct, frozen=True):
    """Whether a measure tells novices from experts in a task, each person by one mean."""

    task: str
    measure: str
    novices: int
    experts: int
    novice_mean: float
    novice_sd: float
    expert_mean: float
    expert_sd: float
    hedges_g: float
    area_under_curve: Estimate  # that a novice has more than an expert
    mann_whitney_p: float
    holm_p: float  # among all tasks and measures


class Reliability(msgspec.Struct, frozen=True):
    """Whether a measure is the same again: between attempts, and after some days."""

    task: str
    measure: str
    consistent_people: int
    cronbach_alpha: float  # of the first attempts
    retested_people: int
    intraclass_correlation: Estimate  # ICC(2,1): the last attempts before, the first after
    standard_error: float  # of measurement, in the measure's unit
    smallest_change: float  # that is larger than the error in 95 % of people


class PassMark(msgspec.Struct, frozen=True):
    """Where novices and experts part, by normal curves, and who is wrong there."""

    task: str
    measure: str
    mark: float
    false_pass: float  # share of novices below it
    false_fail: float  # share of experts above it


class Learning(msgspec.Struct, frozen=True):
    """How many people learnt in a task, as a curve fits better than a constant."""

    task: str
    measure: str
    people: int  # with six attempts or more
    learnt: int
    plateau: float  # median try by which 90 % of the way was done


class Evidence(msgspec.Struct, frozen=True):
    """All that an export shows by a plan."""

    plan: Plan
    people: dict[str, int]  # by group
    attempts: int
    given_up: int  # attempts, which do not count
    known_groups: list[KnownGroups]
    reliability: list[Reliability]
    pass_marks: list[PassMark]
    learning: list[Learning]


def evidence_of(folder: Path, plan: Plan) -> Evidence:
    """Return what an export shows.

    Parameters
    ----------
    folder
        That `write_research` has written.
    plan
        What was fixed beforehand.

    Returns
    -------
    Evidence

    Raises
    ------
    ValueError
        If it is no export, or a group is not in it.
    """
    group = {
        row["person"]: row["group"] for row in _table(folder / "people.csv", ("person", "group"))
    }
    rows = _table(folder / "attempts.csv", ("person", "task", "day", "outcome", *MEASURES))
    groups = {name: sum(each == name for each in group.values()) for name in group.values()}
    for name in (plan.novices, plan.experts):
        if not name or name not in groups:
            there = ", ".join(sorted(filter(None, groups))) or "none"
            raise ValueError(f"there is no group {name!r} in {folder}; there are: {there}")
    counted = [row for row in rows if row["outcome"] != "given up"]
    known: list[KnownGroups] = []
    reliable: list[Reliability] = []
    marks: list[PassMark] = []
    learnt: list[Learning] = []
    for task in sorted({row["task"] for row in counted}):
        of_task = [row for row in counted if row["task"] == task]
        for measure in MEASURES:
            own: dict[str, list[tuple[int, float]]] = {}
            for row in of_task:
                if row[measure]:
                    place = int(row["day"]), float(row[measure])
                    own.setdefault(row["person"], []).append(place)
            first = {
                who: np.array([value for _, value in tries[: plan.tries]])
                for who, tries in own.items()
                if len(tries) >= plan.tries
            }
            novices, experts = (
                np.array([each.mean() for who, each in first.items() if group.get(who) == name])
                for name in (plan.novices, plan.experts)
            )
            if min(len(novices), len(experts)) >= LEAST_PEOPLE:
                known.append(_known_groups(task, measure, novices, experts))
                marks.append(PassMark(task, measure, *pass_mark(novices, experts)))
            reliable.append(_reliability(task, measure, plan, list(first.values()), own))
            learnt.append(_learning(task, measure, own))
    adjusted = holm([each.mann_whitney_p for each in known])
    return Evidence(
        plan=plan,
        people=groups,
        attempts=len(rows),
        given_up=len(rows) - len(counted),
        known_groups=[
            msgspec.structs.replace(each, holm_p=p) for each, p in zip(known, adjusted, strict=True)
        ],
        reliability=reliable,
        pass_marks=marks,
        learning=learnt,
    )


def evidence_lines(found: Evidence) -> list[str]:
    """Return it as lines of text to read and to quote."""
    plan = found.plan
    groups = (f"{count} of group {name or '(not named)'}" for name, count in found.people.items())
    lines = [
        "Not clinically validated: whether a measure tells groups apart, no more.",
        f"People: {', '.join(groups)}",
        f"Attempts: {found.attempts}, of which {found.given_up} were given up and do not count",
        "",
        f"Novices ({plan.novices}) against experts ({plan.experts}), each by the mean of the first "
        f"{plan.tries} attempts",
    ]
    lines.extend(
        f"  {each.task}, {each.measure}: {each.novices} novices {_number(each.novice_mean)} (sd "
        f"{_number(each.novice_sd)}), {each.experts} experts {_number(each.expert_mean)} (sd "
        f"{_number(each.expert_sd)}); g {_number(each.hedges_g)}, area under the curve "
        f"{_interval(each.area_under_curve)}, Mann-Whitney p {_number(each.mann_whitney_p)}, by "
        f"Holm {_number(each.holm_p)}"
        for each in found.known_groups
    )
    lines += ["", f"Reliability; retest from day {plan.retest_from} to {plan.retest_to}"]
    lines.extend(
        f"  {each.task}, {each.measure}: alpha {_number(each.cronbach_alpha)} "
        f"({each.consistent_people} people); ICC(2,1) {_interval(each.intraclass_correlation)}, "
        f"standard error {_number(each.standard_error)}, smallest change "
        f"{_number(each.smallest_change)} ({each.retested_people} people)"
        for each in found.reliability
    )
    lines += ["", "Pass marks by contrasting groups"]
    lines.extend(
        f"  {each.task}, {each.measure}: {_number(each.mark)}; shares of novices below "
        f"{_number(each.false_pass)}, of experts above {_number(each.false_fail)}"
        for each in found.pass_marks
    )
    lines += ["", f"Learning curves of who has {LEAST_TRIES} attempts or more"]
    lines.extend(
        f"  {each.task}, {each.measure}: {each.learnt} of {each.people} learnt, plateau by try "
        f"{_number(each.plateau)}"
        for each in found.learning
    )
    return lines


def area_under_curve(high: Sequence[float] | Vector, low: Sequence[float] | Vector) -> Estimate:
    """Return the share of pairs in which the first is above the second, ties by half.

    The interval is DeLong's on the scale of the logit. If all pairs agree there is no variance, and
    its end is 3 over the smaller group from 1 or 0: the rule of three.

    Returns
    -------
    Estimate

    Examples
    --------
    >>> area_under_curve([3, 4, 5], [1, 2, 4]).value.__round__(4)
    0.8333
    """
    one, other = np.asarray(high, dtype=np.float64), np.asarray(low, dtype=np.float64)
    m, n = len(one), len(other)
    # How far into the other group each is: DeLong's components.
    above = np.sign(one[:, None] - other[None, :]) / 2.0 + 0.5
    value = float(above.mean())
    room = 3.0 / min(m, n)
    if value in (0.0, 1.0):
        return Estimate(value, max(value - room, 0.0), min(value + room, 1.0))
    variance = float(above.mean(axis=1).var(ddof=1) / m + above.mean(axis=0).var(ddof=1) / n)
    middle = math.log(value / (1.0 - value))
    spread = _normal_quantile() * math.sqrt(variance) / (value * (1.0 - value))
    low_end, high_end = (1.0 / (1.0 + math.exp(-middle - sign * spread)) for sign in (-1.0, 1.0))
    return Estimate(value, low_end, high_end)


def hedges_g(one: Sequence[float] | Vector, other: Sequence[float] | Vector) -> float:
    """Return the difference of two means by their common standard deviation, without its bias.

    Returns
    -------
    float
        nan if no value differs within its group.

    Examples
    --------
    >>> round(hedges_g([4, 5, 6], [1, 2, 3]), 4)
    2.4
    """
    a, b = np.asarray(one, dtype=np.float64), np.asarray(other, dtype=np.float64)
    free = len(a) + len(b) - 2
    spread = math.sqrt(float(((a - a.mean()) ** 2).sum() + ((b - b.mean()) ** 2).sum()) / free)
    if spread == 0.0:
        return NONE
    return float(a.mean() - b.mean()) / spread * (1.0 - 3.0 / (4.0 * free - 1.0))


def intraclass_correlation(scores: Sequence[Sequence[float]] | Vector) -> Estimate:
    """Return ICC(2,1) of scores, shape (people, sessions): absolute agreement of single ones.

    Returns
    -------
    Estimate
        nan if no score differs.

    Examples
    --------
    The data of Shrout and Fleiss 1979:

    >>> one, two = [[9, 2, 5, 8], [6, 1, 3, 2], [8, 4, 6, 8]], [[7, 1, 2, 6], [10, 5, 6, 9]]
    >>> round(intraclass_correlation([*one, *two, [6, 2, 4, 7]]).value, 2)
    0.29
    """
    n, k, people, sessions, error = _squares(scores)
    whole = people + (k - 1) * error + k * (sessions - error) / n
    if whole == 0.0:
        return Estimate(NONE, NONE, NONE)
    value = (people - error) / whole
    if error == 0.0 or value >= 1.0:
        return Estimate(value, value, value)
    a = k * value / (n * (1.0 - value))
    b = 1.0 + k * value * (n - 1) / (n * (1.0 - value))
    free = (a * sessions + b * error) ** 2 / (
        (a * sessions) ** 2 / (k - 1) + (b * error) ** 2 / ((n - 1) * (k - 1))
    )
    f = _scipy_stats().f
    lower, upper = (
        float(f.ppf(0.5 + CONFIDENCE / 2.0, *pair)) for pair in ((n - 1, free), (free, n - 1))
    )
    rest = k * sessions + (k * n - k - n) * error
    return Estimate(
        value,
        n * (people - lower * error) / (lower * rest + n * people),
        n * (upper * people - error) / (rest + n * upper * people),
    )


def measurement_error(scores: Sequence[Sequence[float]] | Vector) -> tuple[float, float]:
    """Return the standard error of measurement, and the smallest change that is beyond it.

    Returns
    -------
    error
        Root of the residual's mean square.
    change
        1.96 sqrt(2) times that.
    """
    error = math.sqrt(_squares(scores)[-1])
    return error, _normal_quantile() * math.sqrt(2.0) * error


def cronbach_alpha(scores: Sequence[Sequence[float]] | Vector) -> float:
    """Return the internal consistency of scores, shape (people, attempts).

    Returns
    -------
    float
        nan if people do not differ.

    Examples
    --------
    >>> cronbach_alpha([[1, 1], [2, 2], [3, 3]])
    1.0
    """
    values = np.asarray(scores, dtype=np.float64)
    whole = float(values.sum(axis=1).var(ddof=1))
    if whole == 0.0:
        return NONE
    k = values.shape[1]
    return k / (k - 1) * (1.0 - float(values.var(axis=0, ddof=1).sum()) / whole)


def pass_mark(
    novices: Sequence[float] | Vector, experts: Sequence[float] | Vector
) -> tuple[float, float, float]:
    """Return where the normal curves of two groups cross between their means, and who is wrong.

    Returns
    -------
    mark
        What passes is at most this.
    false_pass, false_fail
        Shares of novices below and of experts above it, by the curves.

    All are nan if experts do not have less, a group does not vary, or the curves do not cross.

    Examples
    --------
    >>> [round(each, 3) for each in pass_mark([5, 6, 7], [1, 2, 3])]
    [4.0, 0.023, 0.023]
    """
    high, low = np.asarray(novices, dtype=np.float64), np.asarray(experts, dtype=np.float64)
    one, other = float(high.mean()), float(low.mean())
    s, t = float(high.std(ddof=1)), float(low.std(ddof=1))
    if not other < one or s == 0.0 or t == 0.0:
        return NONE, NONE, NONE
    # log of both densities: a x^2 + b x + c = 0
    a = 1.0 / t**2 - 1.0 / s**2
    b = 2.0 * (one / s**2 - other / t**2)
    c = other**2 / t**2 - one**2 / s**2 + 2.0 * math.log(t / s)
    roots = [-c / b] if abs(a) < 1e-12 else np.roots([a, b, c]).tolist()
    between = [x.real for x in map(complex, roots) if abs(x.imag) < 1e-9 and other < x.real < one]
    if not between:
        return NONE, NONE, NONE
    mark = between[0]
    return mark, _below(mark, one, s), 1.0 - _below(mark, other, t)


def holm(p: Sequence[float]) -> list[float]:
    """Return the p values of several tests, adjusted by Holm.

    Returns
    -------
    list of float
        In their order.

    Examples
    --------
    >>> holm([0.04, 0.01])
    [0.04, 0.02]
    """
    order = sorted(range(len(p)), key=lambda place: p[place])
    found, most = [0.0] * len(p), 0.0
    for done, place in enumerate(order):
        most = max(most, min((len(p) - done) * p[place], 1.0))
        found[place] = most
    return found


def _known_groups(task: str, measure: str, novices: Vector, experts: Vector) -> KnownGroups:
    tested = _scipy_stats().mannwhitneyu(novices, experts, alternative="two-sided")
    return KnownGroups(
        task=task, measure=measure, novices=len(novices), experts=len(experts),
        novice_mean=float(novices.mean()), novice_sd=float(novices.std(ddof=1)),
        expert_mean=float(experts.mean()), expert_sd=float(experts.std(ddof=1)),
        hedges_g=hedges_g(novices, experts),
        area_under_curve=area_under_curve(novices, experts),
        mann_whitney_p=float(tested.pvalue), holm_p=1.0,
    )  # fmt: skip


def _reliability(
    task: str,
    measure: str,
    plan: Plan,
    first: Sequence[Vector],
    own: Mapping[str, Sequence[tuple[int, float]]],
) -> Reliability:
    pairs: list[tuple[float, float]] = []
    for tries in own.values():
        then = [value for day, value in tries if day < plan.retest_from][-plan.tries :]
        again = [value for day, value in tries if plan.retest_from <= day <= plan.retest_to]
        if then and again:
            pairs.append((float(np.mean(then)), float(np.mean(again[: plan.tries]))))
    correlation, error, change = Estimate(NONE, NONE, NONE), NONE, NONE
    if len(pairs) >= LEAST_PEOPLE:
        correlation = intraclass_correlation(pairs)
        error, change = measurement_error(pairs)
    alpha = NONE
    if len(first) >= LEAST_PEOPLE and plan.tries > 1:
        alpha = cronbach_alpha(np.array(first))
    return Reliability(task, measure, len(first), alpha, len(pairs), correlation, error, change)


def _learning(task: str, measure: str, own: Mapping[str, Sequence[tuple[int, float]]]) -> Learning:
    enough = [tries for tries in own.values() if len(tries) >= LEAST_TRIES]
    curves = [learning_curve([value for _, value in tries]) for tries in enough]
    plateaus = [each.plateau for each in curves if each is not None and each.level < each.first]
    return Learning(
        task, measure, len(enough), len(plateaus), median(plateaus) if plateaus else NONE
    )


def _squares(scores: Sequence[Sequence[float]] | Vector) -> tuple[int, int, float, float, float]:
    """Return people, sessions, and mean squares of people, of sessions and of the residual."""
    x = np.asarray(scores, dtype=np.float64)
    if x.ndim != 2 or min(x.shape) < 2:
        raise ValueError(f"scores must be of 2 people and 2 sessions at least, got {x.shape}")
    n, k = x.shape
    people, sessions, whole = x.mean(axis=1), x.mean(axis=0), x.mean()
    rest = x - people[:, None] - sessions[None, :] + whole
    return (
        n, k,
        float(k * ((people - whole) ** 2).sum() / (n - 1)),
        float(n * ((sessions - whole) ** 2).sum() / (k - 1)),
        float((rest**2).sum() / ((n - 1) * (k - 1))),
    )  # fmt: skip


def _interval(each: Estimate) -> str:
    return f"{_number(each.value)} ({_number(each.low)} to {_number(each.high)})"


def _number(value: float) -> str:
    return "-" if math.isnan(value) else f"{value:.3g}"


def _below(x: float, mean: float, sd: float) -> float:
    return 0.5 * math.erfc((mean - x) / (sd * math.sqrt(2.0)))


def _normal_quantile() -> float:
    return float(_scipy_stats().norm.ppf(0.5 + CONFIDENCE / 2.0))


def _scipy_stats() -> Any:
    try:
        return import_module("scipy.stats")
    except ImportError:
        raise ValueError("this needs scipy: pip install 'bluntdissect[study]'") from None


def _table(path: Path, wanted: Sequence[str]) -> list[dict[str, str]]:
    try:
        with path.open(encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
    except FileNotFoundError as error:
        raise ValueError(
            f"there is no {path}: give the folder that class research-export has written"
        ) from error
    except (OSError, UnicodeDecodeError) as error:
        raise ValueError(f"cannot read {path}: {error}") from error
    for name in wanted:
        if rows and name not in rows[0]:
            raise ValueError(f"{path} has no column {name}: is it an export for research?")
    return rows
