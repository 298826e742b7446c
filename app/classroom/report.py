"""Results for people: tables and plots as HTML, and a report of a page a person to print."""

import html
from collections import Counter
from collections.abc import Sequence
from importlib.resources import files

from app.classroom.exercise_file import AssignedExercise
from app.classroom.results import Result, Standing, best, bests, results, shown_names
from app.classroom.store import Assignment, ClassStore, now
from app.simulation import MOST_POINTS

DISCLAIMER = "Not clinically validated, not a medical device. No score of OSATS or GOALS."
WIDTH, LABEL, RIGHT, ROW = 640.0, 150.0, 16.0, 22.0
"""px of a plot, of its labels, of its right margin and of a row."""
PEAK = "Peak stress in the wall, % of its break"


def style() -> str:
    """Return the style of the teacher's page and of reports."""
    return files("app.classroom").joinpath("class.css").read_text(encoding="utf-8")


def results_html(store: ClassStore) -> str:
    """Return the results of a class: an exercise after the other, newest first, then free runs."""
    found = results(store)
    if not found:
        return "<p class='empty'>No results yet.</p>"
    sections: list[str] = []
    for each in reversed(store.assignments()):
        tries = [one for one in found if one.run.assignment_id == each.id]
        if tries:
            sections.append(_assignment_html(each, tries))
    if pictures := _photographs(store, found):
        sections.append(
            f"<details><summary>Photographs for the record</summary>{pictures}</details>"
        )
    if levels := [one for one in found if one.run.level is not None]:
        sections.append(
            f"<details><summary>Tries at levels of the course ({len(levels)})</summary>"
            f"{_whys(levels)}{_table(levels, who=True, what=True)}</details>"
        )
    if free := [one for one in found if one.run.assignment_id is None and one.run.level is None]:
        sections.append(
            f"<details><summary>Runs outside the class's exercises ({len(free)})</summary>"
            f"{_table(free, who=True, what=True)}</details>"
        )
    return "".join(sections)


def _photographs(store: ClassStore, found: Sequence[Result]) -> str:
    """Return the photographs of runs, each with the points that are computed and those given."""
    taken, given, names = store.photographed(), store.ratings(), shown_names(store.people())
    sections: list[str] = []
    for each in reversed(found):
        run = each.run
        if run.id not in taken:
            continue
        key = html.escape(run.id, quote=True)
        pictures = "".join(
            f"<img width='220' alt='The triangle from the {('front', 'back')[number]}' "
            f"src='photograph?run={key}&amp;number={number}'> "
            for number in range(taken[run.id])
        )
        options = "".join(
            f"<option{' selected' if given.get(run.id) == points else ''}>{points}</option>"
            for points in range(MOST_POINTS + 1)
        )
        computed = each.measures.get("critical_view_points")
        sections.append(
            f"<figure>{pictures}<figcaption>{html.escape(names.get(run.person_id, ''))}, "
            f"{html.escape(run.title)}, {_when(run.started_at)}: computed {computed} of "
            f"{MOST_POINTS}; <label>yours <select class='rating' data-run='{key}'>"
            f"<option value=''>none</option>{options}</select></label></figcaption></figure>"
        )
    return "".join(sections)


def report_page(store: ClassStore, person_id: str | None = None) -> str:
    """Return a page to print: a page a person, of all or of one."""
    found = results(store)
    names = shown_names(store.people())
    pages: list[str] = []
    for who, name in names.items():
        if person_id not in (None, who):
            continue
        own = [each for each in found if each.run.person_id == who]
        pages.append(_person_html(store, name, own))
    title = html.escape(store.title)
    return (
        f"<!doctype html><html lang='en'><head><meta charset='utf-8'><title>{title}: report</title>"
        f"<style>{style()}</style></head><body class='report'>"
        f"{''.join(pages) or '<p>Nobody is in this class yet.</p>'}</body></html>"
    )


def standing_svg(where: Standing) -> str:
    """Return a plot of everybody's best peak, without names: one's own is the filled one."""
    y, x0, x1 = 20.0, 12.0, 318.0

    def x(fraction: float) -> float:
        return x0 + min(max(fraction, 0.0), 1.0) * (x1 - x0)

    dots = "".join(_mark(x(peak), y, passed, own=False) for peak, passed in where.others)
    if where.own is not None:
        dots += _mark(x(where.own), y, where.own_passed, own=True)
    ticks = "".join(
        f"<text x='{x(t / 100)}' y='46' text-anchor='middle'>{t}</text>" for t in (0, 50, 100)
    )
    return (
        "<svg viewBox='0 0 330 64' width='100%' role='img' aria-label='Where you stand' "
        "font-size='11' fill='currentColor' stroke='none'>"
        f"<path d='M{x0} 32H{x1}' stroke='currentColor' opacity='.5'/>{ticks}"
        f"<text x='165' y='61' text-anchor='middle'>{PEAK}</text>{dots}</svg>"
    )


def _brief_html(asked: AssignedExercise) -> str:
    return f"<p>{html.escape(f'{asked.exercise.task} {asked.exercise.full_caution}')}</p>"


def _assignment_html(each: Assignment, tries: Sequence[Result]) -> str:
    asked = AssignedExercise.of_json(each.exercise)
    tops = bests(tries).values()
    passed = sum(one.run.passed is True for one in tops)
    return (
        f"<section><h3>{html.escape(asked.title)} <small>set {_when(each.set_at)}</small></h3>"
        f"{_brief_html(asked)}"
        f"<p><b>{passed} of {len(tops)}</b> passed, in {len(tries)} "
        f"{'try' if len(tries) == 1 else 'tries'}.</p>"
        f"{_whys(tries)}{_plot(tries)}{_table(tries, who=True, what=False)}</section>"
    )


def _whys(tries: Sequence[Result]) -> str:
    """Return what tries failed by, the most frequent first."""
    found = Counter(each.why for each in tries if each.run.passed is False)
    if not found:
        return ""
    counted = ", ".join(f"{html.escape(why)} ({count})" for why, count in found.most_common())
    return f"<p><b>Failed by:</b> {counted}.</p>"


def _person_html(store: ClassStore, name: str, own: Sequence[Result]) -> str:
    sections = [
        f"<article><header><h1>{html.escape(name)}</h1><p>{html.escape(store.title)} · "
        f"{_when(now())}</p></header>"
    ]
    for each in store.assignments():
        tries = [one for one in own if one.run.assignment_id == each.id]
        if tries:
            asked = AssignedExercise.of_json(each.exercise)
            top = best(tries)
            words = "No try was finished." if top is None else html.escape(top.run.reason)
            sections.append(
                f"<section><h3>{html.escape(asked.title)}</h3>"
                f"{_brief_html(asked)}"
                f"<p><b>Best try:</b> {words}</p>{_plot(tries, by_try=True)}"
                f"{_table(tries, who=False, what=False)}</section>"
            )
    if free := [one for one in own if one.run.assignment_id is None]:
        longest = sum(one.seconds for one in free)
        sections.append(
            f"<section><h3>Other runs</h3><p>{len(free)}, {longest / 60.0:.1f} minutes in all.</p>"
            f"{_table(free[-10:], who=False, what=True)}</section>"
        )
    if len(sections) == 1:
        sections.append("<p>No results yet.</p>")
    sections.append(f"<footer>{DISCLAIMER}</footer></article>")
    return "".join(sections)


def _table(found: Sequence[Result], *, who: bool, what: bool) -> str:
    """Return runs as a table: `who` did them, with links, as the teacher's page has them."""
    heads = [
        *(["Name"] if who else []), *(["Exercise"] if what else ["Try"]), "When", "Outcome",
        "Time, s", "Peak stress, % of break", "Freed, mm", "Largest force, N", "Why",
        *([""] if who else []),
    ]  # fmt: skip
    rows: list[str] = []
    for each in reversed(found):
        run, measures = each.run, each.measures
        freed = measures.get("freed_mm")
        cells = [
            *([html.escape(each.name)] if who else []),
            html.escape(run.title) if what else str(each.number),
            _when(run.started_at),
            f"<span class='{each.word.replace(' ', '-')}'>{each.word}</span>",
            f"{each.seconds:.1f}",
            f"{100.0 * each.peak:.0f}",
            "–" if freed is None else f"{freed:.1f}",
            f"{each.force:.2f}",
            html.escape(run.reason),
        ]
        if who:
            cells.append(
                f"<a href='../?replay={run.id}' target='_blank'>Replay</a> "
                f"<a href='run?id={run.id}' download>JSON</a>"
            )
        rows.append("<tr>" + "".join(f"<td>{cell}</td>" for cell in cells) + "</tr>")
    head = "".join(f"<th scope='col'>{each}</th>" for each in heads)
    return f"<table><thead><tr>{head}</tr></thead><tbody>{''.join(rows)}</tbody></table>"


def _plot(tries: Sequence[Result], *, by_try: bool = False) -> str:
    """Return a plot of each try's peak, a row a person or a try, with the limit if there is one."""
    done = [each for each in tries if each.run.passed is not None]
    if not done:
        return ""
    labels = [f"Try {each.number}" if by_try else each.name for each in done]
    rows = {label: place for place, label in enumerate(dict.fromkeys(labels))}
    bottom = ROW * len(rows) + 8.0

    def x(fraction: float) -> float:
        return LABEL + min(max(fraction, 0.0), 1.0) * (WIDTH - LABEL - RIGHT)

    sections = [
        f"<text x='{LABEL - 10}' y='{ROW * place + 16}' text-anchor='end'>"
        f"{html.escape(label[:24])}</text>"
        f"<path d='M{LABEL} {ROW * place + 12}H{WIDTH - RIGHT}' class='rule'/>"
        for label, place in rows.items()
    ]
    limit = done[-1].limit
    if limit is not None:
        sections.append(
            f"<path d='M{x(limit)} 0V{bottom}' class='limit'/>"
            f"<text x='{x(limit)}' y='{bottom + 28}' text-anchor='middle' class='limit-label'>"
            f"limit {100.0 * limit:.0f}</text>"
        )
    sections += [
        _mark(x(each.peak), ROW * rows[label] + 12.0, each.run.passed is True, own=True)
        for label, each in zip(labels, done, strict=True)
    ]
    sections += [
        f"<text x='{x(t / 100)}' y='{bottom + 14}' text-anchor='middle'>{t}</text>"
        for t in range(0, 101, 20)
    ]
    return (
        f"<figure><svg viewBox='0 0 {WIDTH:g} {bottom + 32:g}' width='{WIDTH:g}' role='img' "
        f"aria-label='{PEAK}'>{''.join(sections)}</svg><figcaption>{PEAK}: "
        "<span class='passed'>●</span> passed, <span class='failed'>✕</span> failed.</figcaption>"
        "</figure>"
    )


def _mark(x: float, y: float, passed: bool, *, own: bool) -> str:
    """Return a mark of a try: a dot if it passed, a cross if not, faint for others."""
    look = f"class='mark {'passed' if passed else 'failed'}{'' if own else ' other'}'"
    colour = "#4aa3ff" if passed else "#e69f00"
    fade = "" if own else " opacity='.55'"
    if passed:
        return f"<circle cx='{x:.1f}' cy='{y}' r='{5 if own else 4}' fill='{colour}'{fade} {look}/>"
    r = 5.0 if own else 3.5
    return (
        f"<path d='M{x - r:.1f} {y - r}l{2 * r} {2 * r}m0 {-2 * r}l{-2 * r} {2 * r}' fill='none' "
        f"stroke='{colour}' stroke-width='2.2'{fade} {look}/>"
    )


def _when(text: str) -> str:
    """Return a time for people."""
    return f"<time>{html.escape(text[:16].replace('T', ' '))}</time>"
