"""A run's measures as a table: published names, units, and what each means at a click."""

import html

from app.simulation.measures import Measures
from app.simulation.trial import Outcome
from app.trainer.panel.controls import KPA_PER_MPA, figure

__all__ = ["measures_html", "outcome_html"]

_PASSED, _FAILED, _PLAIN = "#35c28f", "#ff6b5e", "#c9ccd1"


def outcome_html(outcome: Outcome | None, title: str) -> str:
    """Return how a run has ended, as HTML.

    Parameters
    ----------
    outcome
        Of its exercise; None for a run that was not judged.
    title
        Of the exercise, or of the run.

    Returns
    -------
    str
        HTML.
    """
    if outcome is None:
        word, colour, reason = "Not judged", _PLAIN, "A free pull, or one that was stopped."
    else:
        word, colour = ("Passed", _PASSED) if outcome.passed else ("Not passed", _FAILED)
        reason = outcome.reason
    return (
        f"<div data-testid='outcome' data-outcome='{word}' style='padding:0 12px 8px'>"
        "<div style='display:flex;justify-content:space-between;align-items:center'>"
        f"<span style='font-size:14px;opacity:.8'>{html.escape(title)}</span>"
        f"<span style='border:1px solid {colour};color:{colour};border-radius:99px;"
        f"padding:2px 12px;font-weight:600;font-size:13px'>{word}</span></div>"
        f"<div style='font-size:15px;margin-top:4px'>{html.escape(reason)}</div></div>"
    )


def measures_html(measures: Measures) -> str:
    """Return a run's measures as HTML.

    Parameters
    ----------
    measures
        The measures.

    Returns
    -------
    str
        One line each; a click on it opens its definition, which is its tooltip too. Its `data-`
        attributes carry the figures in full, in the units of `Measures`.
    """
    m = measures
    distance = 100.0 * max(m.smallest_distance_to_break, 0.0)
    rows = [
        _row("time_s", "Time", m.time_s, "s", "Length of the run, from the first pull to its end."),
        _row("maximum_force_N", "Maximum force", m.maximum_force_N, "N", "Largest force."),
        _row(
            "mean_absolute_nonzero_force_N",
            "Mean absolute non-zero force",
            m.mean_absolute_nonzero_force_N,
            "N",
            "Mean of the force over the time in which there was any.",
        ),
        _row(
            "force_sd_N",
            "Its standard deviation",
            m.force_sd_N,
            "N",
            "How much the force varied over the same time.",
        ),
        _row(
            "force_time_product_N_s",
            "Force-time product",
            m.force_time_product_N_s,
            "N s",
            "Sum of the force over time, also called impulse.",
        ),
        _row(
            "time_over_threshold_s",
            f"Time over {figure(m.task_threshold_N)} N",
            m.time_over_threshold_s,
            "s",
            "Time over threshold: with more force than the task threshold, which is the "
            "exercise's limit of force, or half the force at break.",
        ),
        _row(
            "path_length_mm",
            "Path length",
            m.path_length_mm,
            "mm",
            "Way of the hook while it held the duct.",
        ),
        _row(
            "economy_of_motion",
            "Economy of motion",
            m.economy_of_motion,
            "",
            "Farthest distance of the hook from where it took hold, over its path: 1 for one "
            "straight pull.",
        ),
        _row(
            "smoothness",
            "Smoothness",
            m.smoothness,
            "",
            "Log dimensionless jerk of the hook: the nearer to zero, the smoother; -5.3 is the "
            "smoothest reach there is.",
        ),
        _row(
            "smallest_distance_to_break",
            "Smallest distance to break",
            distance,
            "%",
            "How near the duct came to its break: 0 % is the break.",
            full=m.smallest_distance_to_break,
        ),
    ]
    tear = m.tear
    if tear is not None:
        side = {"pull": "on the side of the pull", "away": "on the side away from the pull"}
        where = side.get(tear.side, "evenly around")
        total = KPA_PER_MPA * (tear.normal_stress_MPa + tear.bending_stress_MPa)
        rows.append(
            "<div data-testid='tear-measure' style='padding:6px 12px;font-size:13px;"
            "line-height:1.4'>"
            f"<b>Tear</b> at {tear.time_s:.2f} s and {figure(tear.force_N)} N, "
            f"{figure(tear.deflection_mm)} mm out: {tear.station_mm:.1f} mm from the left clamp, "
            f"{where}. {html.escape(tear.criterion)}: "
            f"{figure(KPA_PER_MPA * tear.normal_stress_MPa)}"
            f" + {figure(KPA_PER_MPA * tear.bending_stress_MPa)} = {figure(total)} kPa &gt; "
            f"{figure(KPA_PER_MPA * tear.threshold_MPa)} kPa.</div>"
        )
    return f"<div data-testid='measures' style='padding-bottom:10px'>{''.join(rows)}</div>"


def _row(
    key: str, name: str, value: float | None, unit: str, meaning: str, *, full: float | None = None
) -> str:
    meaning = html.escape(meaning, quote=True)
    exact = value if full is None else full
    return (
        f"<details data-measure='{key}' data-value='{'' if exact is None else repr(float(exact))}'"
        f" title='{meaning}' style='padding:3px 12px;font-size:13px;"
        "border-bottom:1px solid rgba(255,255,255,.06)'>"
        "<summary style='display:flex;justify-content:space-between;cursor:help;list-style:none'>"
        f"<span>{name} <span style='opacity:.5;border:1px solid;border-radius:9px;"
        "padding:0 4px;font-size:9px'>?</span></span>"
        "<span style='font-variant-numeric:tabular-nums;white-space:nowrap'>"
        f"<b>{figure(value)}</b> "
        f"<span style='opacity:.7;display:inline-block;min-width:26px'>{unit}</span></span>"
        "</summary>"
        f"<div style='opacity:.75;padding:2px 0 4px'>{meaning}</div></details>"
    )
