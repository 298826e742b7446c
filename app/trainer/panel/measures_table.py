"""A run's measures as a table: published names, units, which way is better, and other tries."""

import html
import math
from collections.abc import Mapping, Sequence
from typing import Literal, NamedTuple

from app.simulation import Measures, Outcome
from app.simulation.bed import DissectionMeasures
from app.trainer.panel.controls import KPA_PER_MPA, figure

__all__ = ["dissection_html", "measures_html", "outcome_html"]

_PASSED, _FAILED, _PLAIN = "#35c28f", "#ff6b5e", "#c9ccd1"


Better = Literal["lower", "higher", ""]
_ARROWS: dict[Better, str] = {"lower": "↓", "higher": "↑", "": ""}
TOO_SHORT = "too short"
DISTANCE = "smallest_distance_to_break"
_CELL = "text-align:right;padding:3px 0 3px 8px"


_AnyMeasures = Measures | DissectionMeasures


class _Row(NamedTuple):
    """One measure: its factor and unit as shown, which way is better, and what it means."""

    key: str
    name: str
    unit: str
    better: Better
    meaning: str
    factor: float = 1.0


_ROWS = (
    _Row("time_s", "Time", "s", "lower", "Length of the run, from the first pull to its end."),
    _Row("maximum_force_N", "Maximum force", "N", "lower", "Largest force."),
    _Row(
        "mean_absolute_nonzero_force_N", "Mean absolute non-zero force", "N", "lower",
        "Mean of the force over the time in which there was any.",
    ),
    _Row(
        "force_sd_N", "Its standard deviation", "N", "lower",
        "How much the force varied over the same time.",
    ),
    _Row(
        "maximum_loading_rate_N_per_s", "Maximum rate of loading", "N/s", "lower",
        "Fastest growth of the force, over a tenth of a second.",
    ),
    _Row(
        "overshoot", "Overshoot", "%", "lower",
        "How far the duct was pulled past the goal, by the deflection in the goal's middle.", 100.0,
    ),
    _Row(
        "force_time_product_N_s", "Force-time product", "N s", "lower",
        "Sum of the force over time, also called impulse. It rewards haste: read it with the "
        "rate of loading.",
    ),
    _Row(
        "time_over_threshold_s", "Time over {threshold} N", "s", "lower",
        "Time over threshold: with more force than the task threshold, which is the exercise's "
        "limit of force, or half the force at break.",
    ),
    _Row(
        "path_length_mm", "Path length", "mm", "lower",
        "Way of the hook while it held the duct.",
    ),
    _Row(
        "economy_of_motion", "Economy of motion", "", "higher",
        "Farthest distance of the hook from where it took hold, over its path: 1 for one "
        "straight pull.",
    ),
    _Row(
        "smoothness", "Smoothness", "", "higher",
        "Log dimensionless jerk of the hook: the nearer to zero, the smoother; -5.3 is the "
        "smoothest reach there is. Said only of a run with a whole movement, half a second or "
        "longer, that has come to rest.",
    ),
    _Row(
        DISTANCE, "Smallest distance to break", "%", "higher",
        "How near the duct came to its break: 0 % is the break.", 100.0,
    ),
)  # fmt: skip


_DISSECTION_ROWS = (
    _Row("time_s", "Time", "s", "lower", "Length of the run, from the first touch to its end."),
    _Row("freed_mm", "Freed", "mm", "higher", "Length of duct whose strands have parted."),
    _Row(
        "longest_freed_stretch_mm", "Longest freed stretch", "mm", "higher",
        "The longest part of the duct that is free throughout.",
    ),
    _Row(
        "strands_parted", "Strands parted", "", "", "Strands that have parted, of all that held.",
    ),
    _Row(
        "strands_parted_by_hand", "By the left / right hand", "", "",
        "To which hand those strands are put down.",
    ),
    _Row(
        "strands_parted_out_of_sight", "Parted out of sight", "", "lower",
        "Strands that parted where neither the picture nor an instrument near by shows them.",
    ),
    _Row(
        "peak_stress_share", "Peak stress", "% of break", "lower",
        "The highest stress in the wall by the threshold: 100 % tears.", 100.0,
    ),
    _Row(
        "shortest_time_to_break_s", "Shortest time to break", "s", "higher",
        "How long the duct would have lasted at its fastest loading, over a tenth of a second: "
        "whoever leaves less than a reaction time cannot stop.",
    ),
    _Row(
        "time_above_half_s", "Time above half of the break", "s", "lower",
        "Time with a stress above half of the threshold.",
    ),
    _Row(
        "work_mJ", "Work of the left / right hand", "mJ", "lower",
        "What each hand has put into duct and tissue.",
    ),
    _Row(
        "parted_energy_mJ", "Energy into strands", "mJ", "", "What parting the strands has taken.",
    ),
    _Row(
        "duct_energy_mJ", "Energy in the duct", "mJ", "lower",
        "The most that the stretched and bent duct has held at once.",
    ),
    _Row(
        "economy_of_work", "Economy of work", "", "higher",
        "Energy into strands by the work of both hands: 1 would spare the duct wholly.",
    ),
    _Row(
        "maximum_force_N", "Maximum force, left / right", "N", "lower", "Largest force of a hand.",
    ),
    _Row(
        "maximum_instrument_force_N", "Maximum force of jaws or swab", "N", "lower",
        "Largest force on a jaw or a swab.",
    ),
    _Row(
        "force_time_product_N_s", "Force-time product, left / right", "N s", "lower",
        "Sum of the force over time. It rewards haste: read it with the loading.",
    ),
    _Row(
        "traction_angle_deg", "Angle of traction", "°", "lower",
        "Mean angle between the pull on the duct and straight off the bed, weighted by force.",
    ),
)  # fmt: skip


def outcome_html(outcome: Outcome | None, title: str, remark: str) -> str:
    """Return the outcome of a run as HTML; a run without one was not judged."""
    if outcome is None:
        word, colour, reason = "Not judged", _PLAIN, "No exercise, or one that was stopped."
    else:
        word, colour = ("Passed", _PASSED) if outcome.passed else ("Not passed", _FAILED)
        reason = outcome.reason
    return (
        f"<div data-testid='outcome' data-outcome='{word}' style='padding:0 12px 16px'>"
        "<div style='display:flex;justify-content:space-between;align-items:center'>"
        f"<span style='font-size:14px;opacity:.8'>{html.escape(title)}</span>"
        f"<span style='border:1px solid {colour};color:{colour};border-radius:99px;"
        f"padding:2px 12px;font-weight:600;font-size:13px'>{word}</span></div>"
        f"<div style='font-size:15px;margin-top:4px'>{html.escape(reason)}</div>"
        + (
            f"<div data-testid='remark' style='font-size:13px'>{html.escape(remark)}</div>"
            * (remark != "")
        )
        + "</div>"
    )


def measures_html(
    measures: Measures,
    beside: Mapping[str, Measures],
    limits: Mapping[str, float],
    *,
    sought_break: bool,
) -> str:
    """Return a pull's measures as HTML."""
    # Where coming near the break was the goal, neither way is better.
    threshold = figure(measures.task_threshold_N)
    rows = [
        row._replace(better="") if sought_break and row.key == DISTANCE else row
        for row in _ROWS
        if row.key != "overshoot" or measures.overshoot is not None
    ]
    rows = [row._replace(name=row.name.format(threshold=threshold)) for row in rows]
    return _table_html(rows, measures, beside, limits, _tear_html(measures))


def dissection_html(
    measures: DissectionMeasures,
    beside: Mapping[str, DissectionMeasures],
    limits: Mapping[str, float],
) -> str:
    """Return a dissection's measures as HTML, pairs as those of the left and the right hand."""
    return _table_html(_DISSECTION_ROWS, measures, beside, limits)


def _table_html(
    rows: Sequence[_Row],
    measures: _AnyMeasures,
    beside: Mapping[str, _AnyMeasures],
    limits: Mapping[str, float],
    below: str = "",
) -> str:
    """Return a run's measures beside those of other runs, and their limits."""
    # A row's name opens its definition. Its `data-` attributes hold the unrounded figures.
    heads = ["this try", *beside, *(["limit"] if limits else [])]
    columns = "".join(
        f"<th style='{_CELL};font-weight:500'>{html.escape(head)}</th>" for head in heads
    )
    body = "".join(_row_html(row, measures, list(beside.values()), limits) for row in rows)
    return (
        "<div data-testid='measures' style='padding:0 8px 10px;overflow-x:auto'>"
        "<table style='width:100%;border-collapse:collapse;font-size:13px;line-height:1.35;"
        "font-variant-numeric:tabular-nums'><thead>"
        "<tr style='font-size:12px;vertical-align:bottom'>"
        "<th style='text-align:left;font-weight:400'>↓ lower, ↑ higher is better</th>"
        f"{columns}</tr></thead><tbody>{body}</tbody></table>{below}</div>"
    )


def _row_html(
    row: _Row,
    measures: _AnyMeasures,
    beside: Sequence[_AnyMeasures],
    limits: Mapping[str, float],
) -> str:
    exact = ",".join("" if v is None else repr(float(v)) for v in _values(row, measures))
    cells = [f"<b>{_shown(row, measures)}</b>", *(_shown(row, each) for each in beside)]
    if limits:
        limit = limits.get(row.key)
        if limit is not None and isinstance(getattr(measures, row.key), int):
            limit = round(limit)
        cells.append("" if limit is None else _figure(row, limit))
    meaning = html.escape(row.meaning, quote=True)
    figures = "".join(f"<td style='{_CELL}'>{cell}</td>" for cell in cells)
    unit = f" <span style='white-space:nowrap'>({row.unit})</span>" if row.unit else ""
    arrow = _ARROWS[row.better]
    way = f" <span role='img' aria-label='{row.better} is better'>{arrow}</span>" if arrow else ""
    return (
        f"<tr data-measure='{row.key}' data-value='{exact}'"
        f" data-better='{row.better}' title='{meaning}'"
        " style='border-top:1px solid rgba(255,255,255,.08);vertical-align:top'>"
        f"<td style='padding:3px 0'><details><summary style='cursor:help;list-style:none'>"
        f"{row.name}{unit}{way} <span style='border:1px solid;border-radius:9px;padding:0 4px;"
        "font-size:9px'>?</span></summary>"
        f"<div style='padding:2px 0 4px'>{meaning}</div></details></td>{figures}</tr>"
    )


def _values(row: _Row, measures: _AnyMeasures) -> tuple[float | None, ...]:
    value: float | tuple[float, ...] | None = getattr(measures, row.key)
    return value if isinstance(value, tuple) else (value,)


def _shown(row: _Row, measures: _AnyMeasures) -> str:
    values = _values(row, measures)
    if row.key == "smoothness" and values == (None,) and getattr(measures, "path_length_mm", 0.0):
        return TOO_SHORT
    least = 0.0 if row.key == DISTANCE else -math.inf
    return " / ".join(_figure(row, None if v is None else max(v, least)) for v in values)


def _figure(row: _Row, value: float | None) -> str:
    if isinstance(value, int):
        return f"{value:,}"  # it counts
    return figure(None if value is None else row.factor * value)


def _tear_html(measures: Measures) -> str:
    tear = measures.tear
    if tear is None:
        return ""
    side = {"pull": "on the side of the pull", "away": "on the side away from the pull"}
    where = side.get(tear.side, "evenly around")
    total = KPA_PER_MPA * (tear.normal_stress_MPa + tear.bending_stress_MPa)
    return (
        "<div data-testid='tear-measure' style='padding:6px 0;font-size:13px;line-height:1.4'>"
        f"<b>Tear</b> at {tear.time_s:.2f} s and {figure(tear.force_N)} N, "
        f"{figure(tear.deflection_mm)} mm out: {tear.station_mm:.1f} mm from the left clamp, "
        f"{where}. {html.escape(tear.criterion)}: "
        f"{figure(KPA_PER_MPA * tear.normal_stress_MPa)}"
        f" + {figure(KPA_PER_MPA * tear.bending_stress_MPa)} = {figure(total)} kPa &gt; "
        f"{figure(KPA_PER_MPA * tear.threshold_MPa)} kPa.</div>"
    )
