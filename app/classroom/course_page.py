"""A class's course as HTML: who needs help and why, where everybody stands, how they learn."""

import html
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime

from app.classroom.class_course import ClassCourse
from app.classroom.course import Course
from app.classroom.progress import (
    LEAST_TRIES,
    LevelStanding,
    Try,
    learning_curve,
    needs,
    next_level,
)
from app.classroom.results import shown_names
from app.classroom.store import ClassStore

MARKS = {"locked": "", "open": "", "mastered": "✓ ", "due": "↻ "}
WIDTH, HEIGHT, LEFT, BOTTOM = 260.0, 84.0, 34.0, 22.0
"""px of a plot, of the room left of it and below."""


def level_choices(course: Course) -> str:
    """Return the options of a choice of level: the course's own order, and each level."""
    levels = "".join(
        f"<option value='{each.id}'>{html.escape(each.title)}</option>" for each in course.level
    )
    return f"<option value=''>In the course's order</option>{levels}"


def course_html(store: ClassStore, book: ClassCourse) -> str:
    """Return the course of a class: rows by need, people and levels, learning curves."""
    course = book.course
    if course is None:
        return ""
    names, tries, today = shown_names(store.people()), book.tries(), datetime.now(UTC)
    if not names:
        return "<p class='empty'>Nobody has joined yet.</p>" + _benchmarks(course)
    wanted = {each.id: each.level for each in store.people()}
    reasons = needs(course, {who: tries[who] for who in names}, today)
    found = {who: book.standing(tries[who]) for who in names}
    order = list(reasons)
    return (
        _helped(names, reasons, tries)
        + _grid(course, names, order, found, wanted)
        + _curves(course, names, order, found, tries)
        + _benchmarks(course)
    )


def _helped(
    names: Mapping[str, str], reasons: Mapping[str, list[str]], tries: Mapping[str, Sequence[Try]]
) -> str:
    rows = "".join(
        f"<tr><th scope='row'>{html.escape(names[who])}</th>"
        f"<td>{html.escape(' '.join(why))}</td>"
        f"<td><a class='button' href='../?replay={tries[who][-1].run_id}' target='_blank'>"
        "Show the last run</a></td></tr>"
        for who, why in reasons.items()
        if why
    )
    if not rows:
        return "<h3>Who needs help</h3><p class='empty'>Nobody, as far as tries at levels tell.</p>"
    return (
        "<h3>Who needs help</h3><table class='needs'><thead><tr><th scope='col'>Name</th>"
        f"<th scope='col'>Why</th><th scope='col'>Look</th></tr></thead><tbody>"
        f"{rows}</tbody></table>"
    )


def _grid(
    course: Course,
    names: Mapping[str, str],
    order: Sequence[str],
    found: Mapping[str, Sequence[LevelStanding]],
    wanted: Mapping[str, str | None],
) -> str:
    heads = "".join(f"<th scope='col'>{html.escape(each.title)}</th>" for each in course.level)
    rows: list[str] = []
    for who in order:
        now = next_level(found[who], wanted[who])
        cells = "".join(_cell(each, each is now) for each in found[who])
        choices = level_choices(course).replace(
            f"value='{wanted[who] or ''}'", f"value='{wanted[who] or ''}' selected"
        )
        name = html.escape(names[who])
        rows.append(
            f"<tr><th scope='row'>{name}</th>{cells}<td><select class='level' data-person='{who}' "
            f"aria-label='Level of {name}'>{choices}</select></td></tr>"
        )
    return (
        "<h3>People and levels</h3><table class='grid'><thead><tr><th scope='col'>Name</th>"
        f"{heads}<th scope='col'>Level to do</th></tr></thead><tbody>{''.join(rows)}"
        "</tbody></table>"
        "<p class='empty'>✓ mastered, ↻ to be shown again; passes in a row of those wanted, and "
        "tries. The level that comes next is framed.</p>"
    )


def _cell(each: LevelStanding, now: bool) -> str:
    if not each.tries and each.state == "locked" and not now:
        return "<td class='locked'>–</td>"
    when = "" if each.mastered_at is None else f" {each.mastered_at:%d %b}"
    count = f"{each.tries} {'try' if each.tries == 1 else 'tries'}"
    look = f"{each.state}{' now' if now else ''}"
    return (
        f"<td class='{look}' title='{html.escape(each.last, quote=True)}'>"
        f"{MARKS[each.state]}{each.row} of {each.passes}<br><small>{count}{when}</small></td>"
    )


def _curves(
    course: Course,
    names: Mapping[str, str],
    order: Sequence[str],
    found: Mapping[str, Sequence[LevelStanding]],
    tries: Mapping[str, Sequence[Try]],
) -> str:
    rows: list[str] = []
    for who in order:
        most = max(found[who], key=lambda each: each.tries)
        own = [each for each in tries[who] if each.level == most.level]
        if len(own) < 2:
            continue
        incidents = _curve("Incidents", [float(len(each.incidents)) for each in own], own)
        times = _curve("Time, s", [each.seconds for each in own], own)
        rows.append(
            f"<tr><th scope='row'>{html.escape(names[who])}<br><small>"
            f"{html.escape(course.level_of(most.level).title)}</small></th>"
            f"<td>{incidents}</td><td>{times}</td></tr>"
        )
    if not rows:
        return ""
    return (
        "<details class='curves'><summary>Learning curves</summary><p class='empty'>Of each one's "
        "level with the most tries: a dot passed, a cross did not. A line is drawn where an "
        f"exponential fits better than none, from {LEAST_TRIES} tries on; by the plateau 90 % of "
        "the way is done.</p><table><thead><tr><th scope='col'>Name</th><th scope='col'>Incidents"
        f"</th><th scope='col'>Time</th></tr></thead><tbody>{''.join(rows)}</tbody></table>"
        "</details>"
    )


def _curve(title: str, values: Sequence[float], own: Sequence[Try]) -> str:
    """Return the values of tries as a plot that says in words what it shows."""
    fitted = learning_curve(values)
    top = max([*values, 1.0])
    count = len(values)

    def x(number: float) -> float:
        return LEFT + (number - 0.5) / count * (WIDTH - LEFT - 4.0)

    def y(value: float) -> float:
        return (HEIGHT - BOTTOM) - min(max(value / top, 0.0), 1.0) * (HEIGHT - BOTTOM - 8.0)

    marks = "".join(
        f"<circle cx='{x(n):.1f}' cy='{y(value):.1f}' r='3.5' class='mark passed' fill='#4aa3ff'/>"
        if each.passed
        else f"<path d='M{x(n) - 3.5:.1f} {y(value) - 3.5:.1f}l7 7m0 -7l-7 7' stroke='#e69f00' "
        "stroke-width='2' fill='none' class='mark failed'/>"
        for n, (value, each) in enumerate(zip(values, own, strict=True), 1)
    )
    words = f"{title} of {count} tries, the first {values[0]:.3g}, the last {values[-1]:.3g}"
    line = ""
    if fitted is None:
        words += "; no curve fits better than a constant" if count >= LEAST_TRIES else ""
    else:
        places = [1.0 + (count - 1.0) * fraction / 30.0 for fraction in range(31)]
        points = " ".join(f"{x(place):.1f},{y(fitted.at(place)):.1f}" for place in places)
        line = f"<polyline points='{points}' fill='none' stroke='currentColor' opacity='.6'/>"
        words += f"; it leads to {fitted.level:.2g}, the plateau is by try {fitted.plateau:.0f}"
    base = HEIGHT - BOTTOM
    return (
        f"<svg viewBox='0 0 {WIDTH:g} {HEIGHT:g}' width='{WIDTH:g}' role='img' "
        f"aria-label='{words}'>"
        f"<path d='M{LEFT} {base}H{WIDTH}' class='rule'/><text x='{LEFT - 4}' y='{base + 4}' "
        f"text-anchor='end'>0</text><text x='{LEFT - 4}' y='12' text-anchor='end'>{top:.3g}</text>"
        f"<text x='{x(1):.0f}' y='{HEIGHT - 6}' text-anchor='middle'>1</text>"
        f"<text x='{x(count):.0f}' y='{HEIGHT - 6}' text-anchor='middle'>{count}</text>"
        f"{line}{marks}</svg><small>{words[words.find('; ') + 2 :] if ';' in words else ''}</small>"
    )


def _benchmarks(course: Course) -> str:
    rows = "".join(
        f"<li>{html.escape(course.level_of(each.level).title)}, {each.metric.replace('_', ' ')}: "
        f"{each.mark:g} ({html.escape(each.origin)})</li>"
        for each in course.benchmark
    )
    return f"<details><summary>Benchmarks</summary><ul>{rows}</ul></details>" if rows else ""
