"""A debrief: the errors of a run on its time, each with what to do instead and its moment."""

import html
from collections.abc import Callable, Sequence

import numpy as np
import viser
from numpy.typing import NDArray

from app.simulation import ERROR_CLASSES, Exercise, Incident, Metrics, Series
from app.trainer.panel.controls import on_click
from app.trainer.panel.plots import DISTANCE_COLOUR, HAND_COLOURS, LIMIT_COLOUR

__all__ = ["BEFORE", "add_debrief", "where"]

BEFORE = 1.0
"""s before an error from which its moment is played."""
MOST_ERRORS = 12
"""Errors that are told one by one, the first of a run."""
MOST_POINTS = 300
WIDTH, HEIGHT, LEFT, ROW = 420.0, 92.0, 34.0, 15.0
"""px of the picture, of its curve, of the room left of it, and of a hand's row of marks."""
HANDS = ("left hand", "right hand")


def where(each: Incident, *, hands: bool) -> str:
    """Return by which hand and where an error was made, in a few words; one hand needs no name."""
    parts = [HANDS[each.hand]] if hands and each.hand is not None else []
    if each.station_mm is not None:
        parts.append(f"at {each.station_mm:.0f} mm")
    if each.consequence != "none":
        parts.append(each.consequence)
    return ", ".join(parts)


def add_debrief(
    gui: viser.GuiApi,
    exercise: Exercise | None,
    series: Series,
    metrics: Metrics,
    incidents: Sequence[Incident],
    expert: tuple[Metrics, Sequence[Incident]] | None,
    watch: Callable[[float], object],
) -> None:
    """Add a run's errors: three numbers, all on its time, and each with a button to its moment.

    `watch` plays the run from a time, s, on.
    """
    in_space = "stress_ratio" in series.columns
    fraction = series["stress_ratio"] if in_space else 1.0 - series["distance_to_break"]
    limit = None if exercise is None else exercise.limit_of.get("peak_stress_ratio")
    gui.add_html(_numbers_html(metrics, incidents, expert, limit))
    if len(fraction):
        gui.add_html(_timeline_html(series["time_s"], fraction, limit, incidents, in_space))
    if not incidents:
        gui.add_html(_line("No errors were found in this run."))
    for number, each in enumerate(incidents[:MOST_ERRORS], 1):
        at = max(each.start_s - BEFORE, 0.0)
        button = gui.add_button(
            f"{number}. {ERROR_CLASSES[each.error].title}, {each.start_s:.1f} s",
            icon=viser.Icon.PLAYER_PLAY,
            color="gray",
            hint=f"Play it from {at:.1f} s on",
        )
        on_click(button, lambda at=at: watch(at))
        small = where(each, hands=in_space)
        gui.add_html(
            _line(f"{html.escape(each.sentence)} <small>{html.escape(small)}</small>", "error")
        )
    if len(incidents) > MOST_ERRORS:
        gui.add_html(_line(f"And {len(incidents) - MOST_ERRORS} more, which a replay shows."))


def _line(content: str, name: str = "errors") -> str:
    return (
        f"<div data-testid='{name}' style='padding:0 12px 10px;font-size:13px;line-height:1.4'>"
        f"{content}</div>"
    )


def _numbers_html(
    metrics: Metrics,
    incidents: Sequence[Incident],
    expert: tuple[Metrics, Sequence[Incident]] | None,
    limit: float | None,
) -> str:
    """Return errors, highest stress and time of a run beside those of the scripted expert."""
    peak = 100.0 * (1.0 - float(metrics["smallest_distance_to_break"]))
    rows = [["Errors", f"{len(incidents)}"], ["Peak, % of break", f"{peak:.0f}"]]
    rows.append(["Time, s", f"{float(metrics['time_s']):.1f}"])
    head = ["", "you"]
    if expert is not None:
        best, found = expert
        highest = 100.0 * (1.0 - float(best["smallest_distance_to_break"]))
        figures = f"{len(found)}", f"{highest:.0f}", f"{float(best['time_s']):.1f}"
        head.append("scripted expert")
        rows = [[*row, figure] for row, figure in zip(rows, figures, strict=True)]
    if limit is not None:
        head.append("limit")
        ends = "", f"{100.0 * limit:.0f}", ""
        rows = [[*row, end] for row, end in zip(rows, ends, strict=True)]
    cell = "<td style='text-align:right;padding:1px 0 1px 14px'>{}</td>"
    heads = "".join(f"<th style='text-align:right;font-weight:400'>{each}</th>" for each in head)
    body = "".join(
        f"<tr><td>{row[0]}</td>{''.join(cell.format(each) for each in row[1:])}</tr>"
        for row in rows
    )
    return _line(
        "<table style='font-variant-numeric:tabular-nums;border-collapse:collapse'><thead>"
        f"<tr>{heads}</tr></thead><tbody>{body}</tbody></table>",
        "debrief-numbers",
    )


def _timeline_html(
    time: NDArray[np.float64],
    fraction: NDArray[np.float64],
    limit: float | None,
    incidents: Sequence[Incident],
    in_space: bool,
) -> str:
    """Return the stress over time with numbered marks of errors below it, a row for each hand."""
    end = max(float(time[-1]), 1.0)

    def x(seconds: float) -> float:
        return LEFT + min(seconds / end, 1.0) * (WIDTH - LEFT - 6.0)

    def y(part: float) -> float:
        return HEIGHT - min(max(part, 0.0), 1.0) * (HEIGHT - 8.0)

    even = np.linspace(0, len(time) - 1, min(len(time), MOST_POINTS)).round().astype(int)
    index = np.unique(np.append(even, int(np.argmax(fraction))))  # the peak is what counts
    curve = " ".join(
        f"{x(float(t)):.1f},{y(float(s)):.1f}"
        for t, s in zip(time[index], fraction[index], strict=True)
    )
    parts = [
        f"<path d='M{LEFT} {y(0.0)}H{WIDTH}M{LEFT} {y(1.0)}H{WIDTH}' stroke='currentColor' "
        "opacity='.3' fill='none'/>",
        f"<polyline points='{curve}' fill='none' stroke='{DISTANCE_COLOUR}' stroke-width='2'/>",
    ]
    if limit is not None:
        parts.append(
            f"<path d='M{LEFT} {y(limit):.1f}H{WIDTH}' stroke='{LIMIT_COLOUR}' "
            "stroke-dasharray='6 4' fill='none'/>"
        )
    parts += [
        f"<text x='{LEFT - 4}' y='{y(part) + 4:.1f}' text-anchor='end'>{100 * part:.0f}</text>"
        for part in (0.0, 1.0)
    ]
    rows = HANDS if in_space else ("errors",)
    for number, each in enumerate(incidents[:MOST_ERRORS], 1):
        row = each.hand if in_space and each.hand is not None else 0
        top = HEIGHT + 4.0 + ROW * row
        start, stop = x(each.start_s), max(x(each.end_s), x(each.start_s) + 3.0)
        parts.append(
            f"<rect x='{start:.1f}' y='{top}' width='{stop - start:.1f}' height='{ROW - 5}' rx='2' "
            f"fill='{HAND_COLOURS[row]}'/><text x='{stop + 2:.1f}' y='{top + 9}'>{number}</text>"
        )
    bottom = HEIGHT + 6.0 + ROW * len(rows)
    parts += [
        f"<text x='{LEFT - 4}' y='{HEIGHT + 13 + ROW * row}' text-anchor='end'>{name}</text>"
        for row, name in enumerate(("left", "right") if in_space else ("",))
    ]
    parts += [
        f"<text x='{x(at):.1f}' y='{bottom + 10}' text-anchor='{anchor}'>{at:.3g}</text>"
        for at, anchor in ((0.0, "middle"), (end, "end"))
    ]
    label = (
        f"Stress of the wall in % of its break over {end:.1f} s, at most "
        f"{100.0 * float(fraction.max()):.0f} %; errors: {len(incidents)}"
    )
    return _line(
        "<small>Stress of the wall, % of its break, over time in s; below it the errors, by hand"
        f"</small><svg viewBox='0 0 {WIDTH:g} {bottom + 14:g}' width='100%' role='img' "
        f"aria-label='{label}' font-size='10' fill='currentColor' data-testid='timeline'>"
        f"{''.join(parts)}</svg>",
        "debrief",
    )
