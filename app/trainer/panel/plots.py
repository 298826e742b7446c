"""Plots: uPlot charts in the panel's colours, with a key of their own below."""

from collections.abc import Sequence

import numpy as np
import viser
from numpy.typing import NDArray
from viser import uplot

from app.simulation.replay import Series

__all__ = ["Curve", "add_series_plots", "axes", "dots", "key_html", "line"]

AXIS_COLOUR = "#c9ccd1"
GRID = uplot.Axis_Grid(stroke="rgba(255,255,255,.08)")
MOST_POINTS = 600
"""Of a plot over time: more than a panel has pixels."""

Curve = NDArray[np.float64]


def axes(x: str, y: str) -> tuple[uplot.Axis, uplot.Axis]:
    """Return a chart's two axes.

    Parameters
    ----------
    x, y
        Their labels, with units.

    Returns
    -------
    tuple[uplot.Axis, uplot.Axis]
        The axes.
    """
    return (
        uplot.Axis(stroke=AXIS_COLOUR, label=x, labelSize=18, size=34, grid=GRID),
        uplot.Axis(stroke=AXIS_COLOUR, label=y, labelSize=18, size=52, grid=GRID),
    )


def line(label: str, colour: str, width: float = 1.5, dash: tuple[float, ...] = ()) -> uplot.Series:
    """Return a series that is drawn as a line.

    Parameters
    ----------
    label
        What it is, with its unit.
    colour
        CSS.
    width
        px.
    dash
        px of line and gap; solid without.

    Returns
    -------
    uplot.Series
        The series.
    """
    series = uplot.Series(
        label=label,
        stroke=colour,
        width=width,
        points=uplot.Series_Points(show=False),
        pxAlign=0,  # whole pixels make a staircase of a slope
    )
    if dash:
        series["dash"] = dash
    return series


def dots(label: str, colour: str) -> uplot.Series:
    """Return a series that is drawn as points, NaN between them.

    Parameters
    ----------
    label
        What it is, with its unit.
    colour
        CSS.

    Returns
    -------
    uplot.Series
        The series.
    """
    return uplot.Series(
        label=label,
        stroke=colour,
        width=0,
        points=uplot.Series_Points(show=True, size=6, space=0, width=1, stroke=colour, fill=colour),
    )


def key_html(series: Sequence[uplot.Series]) -> str:
    """Return a plot's key as HTML, each mark drawn as its series is.

    Parameters
    ----------
    series
        The series, their labels without units.

    Returns
    -------
    str
        HTML.
    """
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
    """Return how a series is drawn, as CSS."""
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


def add_series_plots(
    gui: viser.GuiApi, series: Series, *, force_line: float | None
) -> tuple[viser.GuiUplotHandle, viser.GuiUplotHandle]:
    """Add a run's force and its distance to break over time.

    Parameters
    ----------
    gui
        The client's own GUI.
    series
        The run, tick by tick.
    force_line
        A force to mark, N: the exercise's limit; None for none.

    Returns
    -------
    tuple[viser.GuiUplotHandle, viser.GuiUplotHandle]
        The two charts.
    """
    picked = np.unique(
        np.linspace(0, len(series.time) - 1, min(len(series.time), MOST_POINTS)).round().astype(int)
    )
    time = np.concatenate([[0.0], series.time[picked]])
    end = max(float(time[-1]), 1.0)
    force = np.concatenate([[0.0], series.force[picked]])
    distance = np.concatenate([[100.0], 100.0 * np.clip(series.distance_to_break[picked], 0, 1)])
    level = np.full_like(time, np.nan if force_line is None else force_line)
    highest = max(float(force.max()), force_line or 0.0, 1e-3)
    x = uplot.Scale(time=False, range=(0.0, end))
    first = gui.add_uplot(
        (time, force, level),
        (
            uplot.Series(label="time, s"),
            line("force F, N", "#35c28f", 2.0),
            line("limit, N", "#ff6b5e", 1.5, (6, 4)),
        ),
        scales={"x": x, "y": uplot.Scale(range=(0.0, 1.08 * highest))},
        axes=axes("time (s)", "force F (N)"),
        legend=uplot.Legend(show=False),
        aspect=2.3,
    )
    second = gui.add_uplot(
        (time, distance),
        (uplot.Series(label="time, s"), line("distance to break, %", "#f2b134", 2.0)),
        scales={"x": x, "y": uplot.Scale(range=(0.0, 108.0))},
        axes=axes("time (s)", "to break (%)"),
        legend=uplot.Legend(show=False),
        aspect=2.3,
    )
    return first, second
