"""A run's measures as a table: published names, units, which way is better, and other tries."""

import html
import math
from collections.abc import Mapping, Sequence

from app.simulation import DISTANCE_TO_BREAK, METRICS, Metric, Metrics, Outcome
from app.trainer.panel.controls import KPA_PER_MPA, figure

_PASSED, _FAILED, _PLAIN = "#35c28f", "#ff6b5e", "#c9ccd1"


_ARROWS = {"lower": "↓", "higher": "↑", "": ""}
TOO_SHORT = "too short"
_CELL = "text-align:right;padding:3px 0 3px 8px"


def outcome_html(
    outcome: Outcome | None, title: str, remark: str, standing: str, *, asked: bool
) -> str:
    """Return a run's outcome as HTML; without one it was stopped as far as its `standing`."""
    if outcome is None:
        word, colour = "Not judged", _PLAIN
        reason = "You stopped it before its end." if asked else "It was no exercise."
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
            f"<div data-testid='standing' style='font-size:13px;opacity:.8'>"
            f"{html.escape(standing[:1].upper() + standing[1:])}.</div>"
        )
        * (standing != "")
        + (
            f"<div data-testid='remark' style='font-size:13px'>{html.escape(remark)}</div>"
            * (remark != "")
        )
        + "</div>"
    )


def measures_html(
    metrics: Metrics,
    beside: Mapping[str, Metrics],
    limits: Mapping[str, float],
    *,
    sought_break: bool = False,
    torn: str = "",
) -> str:
    """Return measures as HTML beside other runs' and limits; `torn` names the tube of several."""
    # Where coming near the break was the goal, neither is better.
    rows = [
        each._replace(better="") if sought_break and each.key == DISTANCE_TO_BREAK else each
        for each in METRICS
        if each.key in metrics and not (each.key == "overshoot" and metrics[each.key] is None)
    ]
    # A row's name opens its definition. Its `data-` attributes hold the unrounded figures.
    limits = {key: limits[key] for key in metrics if key in limits}
    heads = ["this try", *beside, *(["limit"] if limits else [])]
    columns = "".join(
        f"<th style='{_CELL};font-weight:500'>{html.escape(head)}</th>" for head in heads
    )
    body = "".join(_row_html(row, metrics, list(beside.values()), limits) for row in rows)
    return (
        "<div data-testid='measures' style='padding:0 8px 10px;overflow-x:auto'>"
        "<table style='width:100%;border-collapse:collapse;font-size:13px;line-height:1.35;"
        "font-variant-numeric:tabular-nums'><thead>"
        "<tr style='font-size:12px;vertical-align:bottom'>"
        "<th style='text-align:left;font-weight:400'>↓ lower, ↑ higher is better</th>"
        f"{columns}</tr></thead><tbody>{body}</tbody></table>{_tear_html(metrics, torn)}</div>"
    )


def _row_html(
    row: Metric,
    measures: Metrics,
    beside: Sequence[Metrics],
    limits: Mapping[str, float],
) -> str:
    exact = ",".join("" if v is None else repr(float(v)) for v in _values(row, measures))
    cells = [f"<b>{_shown(row, measures)}</b>", *(_shown(row, each) for each in beside)]
    title = html.escape(row.name(measures))
    if limits:
        limit = limits.get(row.key)
        if limit is not None and isinstance(measures[row.key], int):
            limit = round(limit)
        cells.append("" if limit is None else _figure(row, limit))
    meaning = html.escape(row.meaning, quote=True)
    figures = "".join(f"<td style='{_CELL}'>{cell}</td>" for cell in cells)
    unit = f" <span style='white-space:nowrap'>({row.unit})</span>" if row.unit else ""
    sign = _ARROWS[row.better]
    arrow = f" <span role='img' aria-label='{row.better} is better'>{sign}</span>" if sign else ""
    return (
        f"<tr data-measure='{row.key}' data-value='{exact}'"
        f" data-better='{row.better}' title='{meaning}'"
        " style='border-top:1px solid rgba(255,255,255,.08);vertical-align:top'>"
        f"<td style='padding:3px 0'><details><summary style='cursor:help;list-style:none'>"
        f"{title}{unit}{arrow} <span style='border:1px solid;border-radius:9px;padding:0 4px;"
        "font-size:9px'>?</span></summary>"
        f"<div style='padding:2px 0 4px'>{meaning}</div></details></td>{figures}</tr>"
    )


def _values(row: Metric, metrics: Metrics) -> Sequence[float | None]:
    value: float | Sequence[float | None] | None = metrics.get(row.key)
    return value if isinstance(value, Sequence) else (value,)


def _shown(row: Metric, measures: Metrics) -> str:
    values = _values(row, measures)
    if row.key == "smoothness" and values == (None,) and measures.get("path_length_mm"):
        return TOO_SHORT
    least = 0.0 if row.key == DISTANCE_TO_BREAK else -math.inf
    return " / ".join(_figure(row, None if v is None else max(v, least)) for v in values)


def _figure(row: Metric, value: float | None) -> str:
    if isinstance(value, int):
        return f"{value:,}"  # it counts
    return figure(None if value is None else row.factor * value)


def _tear_html(metrics: Metrics, torn: str) -> str:
    tear = metrics["tear"]
    if tear is None:
        return ""
    side = {"pull": ", on the side of the pull", "away": ", on the side away from the pull",
            "even": ", evenly around"}.get(tear.get("side", ""), "")  # fmt: skip
    normal, bending, threshold = (
        KPA_PER_MPA * tear[key]
        for key in ("normal_stress_MPa", "bending_stress_MPa", "threshold_MPa")
    )
    end = f"the first end of the {torn}" if torn else "the left clamp"
    load = ""
    if "force_N" in tear:
        force, deflection = figure(tear["force_N"]), figure(tear["deflection_mm"])
        load = f" and {force} N, {deflection} mm out"
    return (
        "<div data-testid='tear-measure' style='padding:6px 0;font-size:13px;line-height:1.4'>"
        f"<b>Tear</b> at {tear['time_s']:.2f} s{load}: {tear['station_mm']:.1f} mm "
        f"from {end}{side}. Normal stress + bending stress &gt; threshold: "
        f"{figure(normal)} + {figure(bending)} = {figure(normal + bending)} kPa &gt; "
        f"{figure(threshold)} kPa.</div>"
    )
