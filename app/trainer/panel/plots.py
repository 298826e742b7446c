"""Plots: uPlot charts in the panel's colours, with a key of our own below."""

from collections.abc import Mapping, Sequence

import numpy as np
import viser
from numpy.typing import NDArray
from viser import uplot

from app.simulation import HANDS, Exercise, Series, Stay, loading_rates

AXIS_COLOUR = "#c9ccd1"
GOAL_COLOUR, GOAL_AREA = "#5cc8ff", "rgba(92,200,255,.25)"
LIMIT_COLOUR = "#ff6b5e"
GRID = uplot.Axis_Grid(stroke="rgba(255,255,255,.08)")
MOST_POINTS = 600
"""Most points of a plot over time: more than a panel has pixels."""
TO_BREAK, DISTANCE_COLOUR = "to break (%)", "#f2b134"
HAND_COLOURS = "#35c28f", "#5aa9ff"

Curve = NDArray[np.float64]


def axes(x: str, y: str) -> tuple[uplot.Axis, uplot.Axis]:
    """Return a chart's two axes."""
    return (
        uplot.Axis(stroke=AXIS_COLOUR, label=x, labelSize=18, size=34, grid=GRID),
        uplot.Axis(stroke=AXIS_COLOUR, label=y, labelSize=18, size=52, grid=GRID),
    )


def line(label: str, colour: str, width: float = 1.5, dash: tuple[float, ...] = ()) -> uplot.Series:
    """Return a series that is drawn as a line."""
    series = uplot.Series(
        label=label,
        stroke=colour,
        width=width,
        points=uplot.Series_Points(show=False),
        pxAlign=0,  # rounded to whole pixels, a slope would be a staircase
    )
    if dash:
        series["dash"] = dash
    return series


def dots(label: str, colour: str) -> uplot.Series:
    """Return a series that is drawn as points, NaN between them."""
    return uplot.Series(
        label=label,
        stroke=colour,
        width=0,
        points=uplot.Series_Points(show=True, size=6, space=0, width=1, stroke=colour, fill=colour),
    )


def goal_area() -> uplot.Series:
    """Return a series that is filled from the axis up to it: where a goal lies."""
    return uplot.Series(
        label="goal",
        stroke=GOAL_COLOUR,
        width=1,
        fill=GOAL_AREA,
        points=uplot.Series_Points(show=False),
    )


def key_html(series: Sequence[uplot.Series]) -> str:
    """Return a plot's key as HTML, each mark drawn as its series is."""
    marks = "".join(
        "<span style='white-space:nowrap;margin-right:12px'><span style='display:inline-block;"
        f"vertical-align:middle;margin-right:5px;{_mark(each)}'></span>{each.get('label')}</span>"
        for each in series
    )
    return (
        "<div data-testid='plot-key' style='padding:0 12px 8px;font-size:11px;line-height:1.7;"
        f"opacity:.9'>{marks}</div>"
    )


def _mark(series: uplot.Series) -> str:
    colour, width = str(series.get("stroke", "")), series.get("width", 1.0)
    if not width:
        return f"width:7px;height:7px;border-radius:4px;background:{colour}"
    line_css = f"width:20px;height:{max(2.0, width):g}px;background:"
    if "dash" not in series:
        return f"{line_css}{colour}"
    ink, gap = series["dash"]
    return (
        f"{line_css}repeating-linear-gradient(90deg,{colour} 0 {ink:g}px,"
        f"transparent {ink:g}px {ink + gap:g}px)"
    )


def add_series_plots(gui: viser.GuiApi, series: Series, exercise: Exercise | None) -> None:
    """Plot a run over time: what its exercise's goal and limits are about, and the forces."""
    limits = {} if exercise is None else exercise.limit_of
    goal = None if exercise is None else exercise.goal
    band = None if goal is None else goal.band
    margin = None
    if isinstance(goal, Stay) and band is None:
        margin = 100.0 * goal.low, 100.0 * goal.high
    time, in_space = series["time_s"], "stress_ratio" in series.columns
    left = 1.0 - series["stress_ratio"] if in_space else series["distance_to_break"]
    reserve = limits.get("smallest_distance_to_break")
    if (ratio := limits.get("peak_stress_ratio")) is not None:
        reserve = 1.0 - ratio
    hands = (
        [
            np.sqrt(sum(series[f"hand_{hand + 1}_force_{axis}_N"] ** 2 for axis in "xyz"))
            for hand in range(HANDS)
        ]
        if in_space
        else [series["force_N"]]
    )
    forces: dict[str, Curve] = dict(zip(HAND_COLOURS, hands, strict=False))
    rate = limits.get("maximum_loading_rate_N_per_s")
    names = zip(("left hand", "right hand"), HAND_COLOURS, strict=True)
    marks = [line(*each, 2.0) for each in names] if in_space else []
    marks += [goal_area()] * (band is not None or margin is not None)
    drawn = (None if margin is not None else reserve), limits.get("maximum_force_N"), rate
    marks += [LIMIT] * any(each is not None for each in drawn)
    gui.add_html(key_html(marks))
    if band is not None:
        _add_plot(gui, time, "deflection (mm)", {"#e8eaed": series["deflection_mm"]}, band=band)
    _add_plot(
        gui,
        time,
        TO_BREAK,
        {DISTANCE_COLOUR: 100.0 * np.clip(left, 0.0, 1.0)},
        None if reserve is None or margin is not None else 100.0 * reserve,
        band=margin,
        top=108.0,
    )
    _add_plot(gui, time, "force (N)", forces, limits.get("maximum_force_N"))
    if rate is not None:
        rates = np.maximum(loading_rates(series), 0.0)
        _add_plot(gui, time, "loading (N/s)", {"#c58af9": rates}, rate)
    if "freed_mm" in series.columns:
        _add_plot(gui, time, "freed (mm)", {"#e8eaed": series["freed_mm"]})


def _add_plot(
    gui: viser.GuiApi,
    time: Curve,
    label: str,
    curves: Mapping[str, Curve],
    limit: float | None = None,
    *,
    band: tuple[float, float] | None = None,
    top: float | None = None,
) -> None:
    """Add a chart over time: curves by their colours, a limit as a line, a goal as a band."""
    if not time.size:  # the run was over before its first tick
        return
    even = np.linspace(0, time.size - 1, min(time.size, MOST_POINTS)).round().astype(int)
    # A peak is what a limit is judged by: it is drawn, however long the run was.
    extremes = [
        end(np.nan_to_num(each)) for each in curves.values() for end in (np.argmax, np.argmin)
    ]
    index = np.unique(np.concatenate([even, extremes]))
    time, drawn = time[index], [values[index] for values in curves.values()]
    low, high = (np.nan, np.nan) if band is None else band
    ends = [np.full_like(time, each) for each in (high, low, np.nan if limit is None else limit)]
    highest = max(*(float(np.nanmax(each, initial=1e-3)) for each in (*drawn, *ends)), 1e-3)
    gui.add_uplot(
        (time, *drawn, *ends),
        (
            uplot.Series(label="time, s"),
            *(line(label, colour, 2.0) for colour in curves),
            line("goal", GOAL_COLOUR, 1.0),
            line("goal, from", GOAL_COLOUR, 1.0),
            LIMIT,
        ),
        bands=(uplot.Band(series=(len(drawn) + 1, len(drawn) + 2), fill=GOAL_AREA),),
        scales={
            "x": uplot.Scale(time=False, range=(0.0, max(float(time[-1]), 1.0))),
            "y": uplot.Scale(range=(0.0, top or 1.08 * highest)),
        },
        axes=axes("time (s)", label),
        legend=uplot.Legend(show=False),
        aspect=2.6,
    )


LIMIT = line("limit", LIMIT_COLOUR, 1.5, (6, 4))
