"""A debrief: what to do next time, three numbers, and a run's errors, each with its moment."""

import html
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
import viser
from numpy.typing import NDArray

from app.simulation import (
    CONSEQUENCES,
    ERROR_CLASSES,
    METRIC_OF,
    Exercise,
    FreeLength,
    Incident,
    Metrics,
    Outcome,
    Series,
)
from app.trainer.client.replay_playback import BEFORE
from app.trainer.panel.controls import command, figure
from app.trainer.panel.plots import DISTANCE_COLOUR, HAND_COLOURS, LIMIT_COLOUR
from app.trainer.viser_bridge.private_api import page_number

MOST_ERRORS, MOST_ALIKE = 12, 3
"""Errors that are listed one by one, the most important of a run, and of those of one class."""
MOST_POINTS = 300
WIDTH, HEIGHT, LEFT, ROW = 260.0, 80.0, 30.0, 15.0
"""px of the picture, of its curve, of the room left of it, and of a hand's row of marks."""
DIGIT, APART = 6.0, 3.0
"""px of a digit of an error's number beside its mark, and between two of them."""
LIST_PX, BESIDE_PX, SHOWN = 140, 660, 2
"""Least height of the list of errors, and what all else takes of a screen: the list scrolls, and
has what a large screen leaves; and how many errors the smallest list shows."""
HANDS = ("left hand", "right hand")
PAST = "#ff8a80"
HEAD = "text-align:right;font-weight:400;padding-left:12px;max-width:72px;vertical-align:bottom"


class Done(NamedTuple):
    """A run that is over: its measures, errors, and what the instruments showed."""

    metrics: Metrics
    incidents: Sequence[Incident]
    series: Series


def where(each: Incident, *, hands: bool) -> str:
    """Return by which hand and where an error was made, in a few words; one hand needs no name."""
    phrases = [HANDS[each.hand]] if hands and each.hand is not None else []
    if each.station_mm is not None:
        phrases.append(f"at {each.station_mm:.0f} mm")
    if each.consequence != "none":
        # Beside a near miss, 'minor' alone would seem the lesser.
        phrases.append("minor harm" if each.consequence == "minor" else each.consequence)
    return ", ".join(phrases)


def next_time(
    exercise: Exercise,
    outcome: Outcome | None,
    metrics: Metrics,
    tries: Sequence[Sequence[Incident]],
    decided: Incident | None = None,
) -> str:
    """Return what to do in the next try, in a sentence.

    Parameters
    ----------
    exercise, outcome, metrics
        Of this try.
    tries
        The errors of the last tries, this one's at the end.
    decided
        The error that failed it, if one did.

    Returns
    -------
    str
    """
    errors = [each for one in tries for each in one if each.error != "tear"]
    # What was wrong in earlier tries says nothing of one without errors.
    without = not tries[-1] and outcome is not None
    if decided is not None or (errors and not without):
        # What failed it; else the commonest error of this try, or of most tries; of those what was
        # done, not what came of it, by their order.
        often = Counter(key for one in tries for key in {each.error for each in one})
        last = decided
        if last is None:
            here, rank = Counter(each.error for each in tries[-1]), list(ERROR_CLASSES)
            key = min(
                {each.error for each in errors},
                key=lambda each: (
                    ERROR_CLASSES[each].is_result, -here[each], -often[each], rank.index(each)
                ),
            )  # fmt: skip
            last = next(each for each in reversed(errors) if each.error == key)
        tried = often[last.error]
        again = f" That was an error in {tried} of {len(tries)} tries." * (tried > 1)
        return f"{last.instead}{again}"
    if outcome is not None and outcome.passed:
        return "Do it once more, to show that it was no luck."
    if exercise.opening is not None and exercise.opening.torn is not None:
        return (
            "Lose no time: press on the cross, roll in until the tip is in the ring, then press G."
        )
    for each in exercise.limits:
        metric = METRIC_OF.get(each.of)
        value: float | list[float] | None = metrics.get(each.of)
        largest = max(value) if isinstance(value, list) else value
        if metric is not None and largest is not None and each.passed_by(largest):
            words = metric.limit_words(each.value)
            return f"{words[0].upper()}{words[1:]}."
    if isinstance(exercise.goal, FreeLength):
        return (
            "Do what the line Next asks for without a rest: quickly in the open, slowly in tissue."
        )
    return "Lose no time where nothing is under load, and go on slowly where the wall is."


class Debrief:
    """A run's debrief in a tab, shown anew when more of the run is known.

    Parameters
    ----------
    gui
        The tab's.
    exercise, advice
        What was to be done, and what to do next time.
    marks
        A course's benchmarks by metric.
    decided
        The error that failed it, which stands first.
    in_space
        Whether hands have led the run in space.
    play, play_expert
        Play the run, and the expert's, from a time, s, on.
    """

    def __init__(
        self,
        gui: viser.GuiApi,
        exercise: Exercise | None,
        advice: str,
        marks: Mapping[str, float],
        play: Callable[[float], object],
        play_expert: Callable[[float], object],
        *,
        decided: Incident | None,
        in_space: bool,
    ) -> None:
        self._decided = decided
        self._gui, self._exercise, self._advice, self._marks = gui, exercise, advice, marks
        self._play, self._play_expert, self._in_space = play, play_expert, in_space
        self._html = gui.add_html("")
        self._commands: dict[tuple[str, int], viser.CommandHandle] = {}

    def show(self, done: Done, expert: Done | None = None) -> None:
        """Show a run, with what it is compared with; a series without columns is not yet known."""
        series = done.series
        incidents = self._listed(done.incidents)
        exercise = self._exercise
        limits = {} if exercise is None else exercise.limit_of
        known = bool(series.columns)
        aligned = known and exercise is not None and isinstance(exercise.goal, FreeLength)
        same = _same_freed(series, expert.series) if aligned and expert is not None else None
        moments: list[str] = []
        rows: list[str] = []
        for number, each in enumerate(incidents, 1):
            at = max(each.start_s - BEFORE, 0.0)
            title = f"{number}. {ERROR_CLASSES[each.error].title}, {each.start_s:.1f} s"
            hint = f"Play it from {at:.1f} s on"
            moments.append(self._command("mine", number, title, hint, partial(self._play, at)))
            buttons = _button(moments[-1], title, hint)
            if same is not None:
                there = float(same[min(np.searchsorted(series["time_s"], at), len(same) - 1)])
                hint, act = "Play the scripted expert from where as much is free", self._play_expert
                named = f"{number}. The expert there"
                uuid = self._command("expert", number, named, hint, partial(act, there))
                buttons += " " + _button(uuid, "Expert there", hint)
            small = where(each, hands=self._in_space)
            rows.append(
                f"<li data-testid='error' style='margin:0 0 8px'>{buttons}<div>"
                f"{html.escape(each.sentence)} <small>{html.escape(small)}</small></div></li>"
            )
        more = Counter(ERROR_CLASSES[each.error].title for each in done.incidents)
        more.subtract(ERROR_CLASSES[each.error].title for each in incidents)
        if more.total():
            named = "; ".join(f"{title}, {count}" for title, count in more.most_common() if count)
            rows.append(
                f"<li data-testid='more-errors'>And {more.total()} more, which a replay shows: "
                f"{html.escape(named)}.</li>"
            )
        errors = (
            f"<small>{_count(len(done.incidents))}</small>"
            f"<ol style='list-style:none;margin:4px 0 0;padding:0;"
            f"max-height:max({LIST_PX}px,100dvh - {BESIDE_PX}px);"
            "overflow-y:auto;scrollbar-width:thin;scrollbar-color:#888 transparent' tabindex='0' "
            f"aria-label='Errors'>{''.join(rows)}</ol>"
            if rows
            else "<p data-testid='errors'>No errors were found in this run.</p>"
        )
        phrases = [_numbers_html(done, expert, limits, self._marks)]
        if not known or len(series["time_s"]):
            limit = limits.get("peak_stress_ratio")
            end = float(done.metrics["time_s"])
            phrases.append(
                _timeline_html(series, end, expert, same, limit, incidents, moments, self._in_space)
            )
        self._html.content = (
            "<div style='padding:0 12px 8px;font-size:13px;line-height:1.4'>"
            f"<p data-testid='next-time' style='margin:0 0 6px;font-size:14px'><b>Next time:</b> "
            f"{html.escape(self._advice)}</p>"
            f"{errors}<div style='display:flex;flex-wrap:wrap;gap:4px 12px;align-items:flex-start'>"
            f"{''.join(phrases)}</div></div>"
        )

    def forget(self) -> None:
        """Remove its commands, once it is closed."""
        for each in self._commands.values():
            each.remove()

    def _listed(self, incidents: Sequence[Incident]) -> list[Incident]:
        """Return the most important errors; few of one class, where not all can be listed."""
        listed, alike = list[Incident](), Counter[str]()
        most = MOST_ALIKE if len(incidents) > MOST_ERRORS else MOST_ERRORS
        for each in sorted(incidents, key=self._importance):
            if alike[each.error] < most:
                listed.append(each)
            alike[each.error] += 1
        return listed[:MOST_ERRORS]

    def _importance(self, each: Incident) -> tuple[object, ...]:
        """Return what orders errors: what failed it, then by what came of them, class and time."""
        rank = list(ERROR_CLASSES).index(each.error)
        return each != self._decided, -CONSEQUENCES.index(each.consequence), rank, each.start_s

    def _command(
        self, whose: str, number: int, name: str, hint: str, act: Callable[[], object]
    ) -> str:
        """Return the page's number of a command, which is made once: a button keeps its focus."""
        key = whose, number
        if key not in self._commands:
            self._commands[key] = command(self._gui, name, hint, act, slow=True)
        return page_number(self._commands[key])


def _count(errors: int) -> str:
    """Return how many errors there were, and how they are listed."""
    if errors == 1:
        return "1 error"
    more = "scroll for all, " if errors > SHOWN else ""
    return f"{errors} errors, those with most harm first; {more}press one to see it"


def _button(uuid: str, text: str, hint: str) -> str:
    return (
        f"<button type='button' data-command='{uuid}' title='{html.escape(hint, quote=True)}' "
        "style='font:inherit;color:inherit;background:rgba(255,255,255,.1);cursor:pointer;"
        "border:1px solid rgba(255,255,255,.25);border-radius:6px;padding:3px 10px;"
        f"margin:0 4px 3px 0'><span aria-hidden='true'>▶ </span>{html.escape(text)}</button>"
    )


def _same_freed(mine: Series, theirs: Series) -> NDArray[np.float64]:
    """Return (T,) the time at which another run has freed as much as one at each tick, s."""
    freed = np.maximum.accumulate(theirs["freed_mm"])
    index = np.searchsorted(freed, mine["freed_mm"] - 1e-9)
    return theirs["time_s"][np.minimum(index, len(freed) - 1)]


def _numbers_html(
    done: Done, expert: Done | None, limits: Mapping[str, float], marks: Mapping[str, float]
) -> str:
    """Return errors, highest stress and time of a run beside those of the scripted expert."""
    named = [("incidents", "Errors"), ("peak_stress_ratio", "Peak stress, % of break"),
             ("time_s", "Time, s")]  # fmt: skip
    if "blood_lost_ml" in limits or "blood_lost_ml" in marks:
        named.append(("blood_lost_ml", "Blood lost, ml"))
    head = ["", "you", *(["scripted expert"] if expert is not None else [])]
    bounds = [("limit", limits), ("benchmark", marks)]
    bounds = [(name, each) for name, each in bounds if any(key in each for key, _ in named)]
    rows: list[str] = []
    for key, title in named:
        own = _number(done, key)
        past = any(own > each[key] * (1.0 + 1e-9) for _, each in bounds if key in each)
        shown = [_shown(key, own), *([_shown(key, _number(expert, key))] if expert else [])]
        if past:
            shown[0] = (
                f"<b style='color:{PAST}'><u>{shown[0]}</u>"
                "<span class='bd-unseen'>, past it</span></b>"
            )
        shown += [_shown(key, each[key]) if key in each else "" for _, each in bounds]
        cells = "".join(
            f"<td style='text-align:right;padding:1px 0 1px 12px'>{each}</td>" for each in shown
        )
        rows.append(f"<tr><th scope='row' style='text-align:left;font-weight:400'>{title}</th>"
                    f"{cells}</tr>")  # fmt: skip
    heads = "".join(
        f"<th scope='col' style='{HEAD}'>{each}</th>"
        for each in [*head[1:], *(name for name, _ in bounds)]
    )
    return (
        "<table data-testid='debrief-numbers' style='font-variant-numeric:tabular-nums;"
        f"border-collapse:collapse'><thead><tr><td></td>{heads}</tr></thead>"
        f"<tbody>{''.join(rows)}</tbody></table>"
    )


def _number(done: Done, key: str) -> float:
    if key == "incidents":
        return float(len(done.incidents))
    if key == "peak_stress_ratio":
        return 1.0 - float(done.metrics["smallest_distance_to_break"])
    return float(done.metrics.get(key) or 0.0)


def _shown(key: str, value: float) -> str:
    if key == "incidents":
        return f"{value:.3g}"
    return f"{100.0 * value:.0f}" if key == "peak_stress_ratio" else f"{value:.1f}"


def _timeline_html(
    series: Series,
    end: float,
    expert: Done | None,
    same: NDArray[np.float64] | None,
    limit: float | None,
    incidents: Sequence[Incident],
    moments: Sequence[str],
    in_space: bool,
) -> str:
    """Return numbered errors by hand until an end, s, below the stress once its series is known."""
    known, end = bool(series.columns), max(end, 1.0)
    time = series["time_s"] if known else np.zeros(0)
    fraction = _fraction(series) if known else np.zeros(0)

    def x(seconds: float) -> float:
        return LEFT + min(seconds / end, 1.0) * (WIDTH - LEFT - 6.0)

    def y(level: float) -> float:
        return HEIGHT - min(max(level, 0.0), 1.0) * (HEIGHT - 8.0)

    index = np.zeros(0, dtype=int)
    if known:
        even = np.linspace(0, len(time) - 1, min(len(time), MOST_POINTS)).round().astype(int)
        index = np.unique(np.append(even, int(np.argmax(fraction))))  # the peak is what counts

    def curve(values: NDArray[np.float64]) -> str:
        return " ".join(
            f"{x(float(t)):.1f},{y(float(s)):.1f}"
            for t, s in zip(time[index], values[index], strict=True)
        )

    phrases = [
        f"<path d='M{LEFT} {y(0.0)}H{WIDTH}M{LEFT} {y(1.0)}H{WIDTH}' stroke='currentColor' "
        "opacity='.3' fill='none'/>",
    ]
    words = "Stress of the wall, % of break, over time in s; below it errors, by hand."
    words += " The stress comes once the run is replayed." * (not known)
    if same is not None and expert is not None:
        beside = np.interp(same, expert.series["time_s"], _fraction(expert.series))
        phrases.append(
            f"<polyline points='{curve(beside)}' fill='none' stroke='currentColor' opacity='.5' "
            "stroke-dasharray='2 3' data-testid='expert-curve'/>"
        )
        words += " Dotted: the scripted expert with as much free."
    phrases.append(
        f"<polyline points='{curve(fraction)}' fill='none' stroke='{DISTANCE_COLOUR}' "
        "stroke-width='2'/>"
    )
    if limit is not None:
        phrases.append(
            f"<path d='M{LEFT} {y(limit):.1f}H{WIDTH}' stroke='{LIMIT_COLOUR}' "
            "stroke-dasharray='6 4' fill='none'/>"
        )
    if known and in_space:
        parted = x(0.0) + (time[1:][np.diff(series["strands_broken"]) > 0.0] / end) * (
            x(end) - x(0.0)
        )
        ticks = "".join(f"M{place:.1f} {HEIGHT}v3" for place in np.unique(parted.round(1)))
        phrases.append(f"<path d='{ticks}' stroke='currentColor' opacity='.6' fill='none'/>")
        words += " Ticks: strands break."
    phrases += [
        f"<text x='{LEFT - 4}' y='{y(level) + 4:.1f}' text-anchor='end'>{100 * level:.0f}</text>"
        for level in (0.0, 1.0)
    ]
    rows = HANDS if in_space else ("errors",)
    spans = [(x(each.start_s), max(x(each.end_s), x(each.start_s) + 3.0)) for each in incidents]
    # What no hand alone has made stands across the rows of both.
    row_of = [each.hand if in_space else 0 for each in incidents]
    words += " Across both: what no hand alone has made." * (None in row_of)
    taken = [
        [span for span, at in zip(spans, row_of, strict=True) if at in (row, None)]
        for row in range(len(rows))
    ]
    for number, ((start, stop), hand, uuid) in enumerate(
        zip(spans, row_of, moments, strict=True), 1
    ):
        row = hand or 0
        top, tall = HEIGHT + 5.0 + ROW * row, 1 if hand is not None else len(rows)
        colour = "currentColor" if hand is None else HAND_COLOURS[hand]
        # Beside its mark, or before it; the more important ones come first.
        wide = DIGIT * len(str(number)) + APART
        places = [(stop + 2.0, stop + 2.0 + wide), (start - 2.0 - wide, start - 2.0)]
        free = (
            (low, high) for low, high in places
            if low >= LEFT and high <= WIDTH and all(high <= a or low >= b for a, b in taken[row])
        )  # fmt: skip
        room = next(free, None)
        name = ""
        if room is not None:
            taken[row].append(room)
            name = f"<text x='{room[0]:.1f}' y='{top + 9}'>{number}</text>"
        phrases.append(
            f"<g data-command='{uuid}' style='cursor:pointer'>"
            f"<rect x='{start:.1f}' y='{top}' width='{stop - start:.1f}' "
            f"height='{ROW * tall - 5}' rx='2' fill='{colour}'/>{name}</g>"
        )
    bottom = HEIGHT + 7.0 + ROW * len(rows)
    phrases += [
        f"<text x='{LEFT - 4}' y='{HEIGHT + 14 + ROW * row}' text-anchor='end'>{name}</text>"
        for row, name in enumerate(("left", "right") if in_space else ("",))
    ]
    phrases += [
        f"<text x='{x(at):.1f}' y='{bottom + 10}' text-anchor='{anchor}'>{shown}</text>"
        for at, anchor, shown in ((0.0, "middle", "0"), (end, "end", figure(end)))
    ]
    most = f", at most {100.0 * float(fraction.max()):.0f} %" if known else ""
    label = f"Stress of the wall in % of its break over {end:.1f} s{most}; errors: {len(incidents)}"
    return (
        "<div data-testid='debrief' style='flex:1 1 190px;max-width:320px'>"
        f"<svg viewBox='0 0 {WIDTH:g} {bottom + 14:g}' width='100%' role='img' "
        f"aria-label='{label}' font-size='10' fill='currentColor' data-testid='timeline'>"
        f"{''.join(phrases)}</svg><small>{words}</small></div>"
    )


def _fraction(series: Series) -> NDArray[np.float64]:
    """Return (T,) the stress over its threshold at the break."""
    in_space = "stress_ratio" in series.columns
    return series["stress_ratio"] if in_space else 1.0 - series["distance_to_break"]
