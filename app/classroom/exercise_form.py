"""The form of an exercise that a teacher sets: its fields as HTML, by goal."""

import html
from collections.abc import Mapping

from app.anatomy import shipped_anatomies
from app.classroom.exercise_file import (
    DRAWN,
    GOALS,
    NUMBERS,
    PULLS,
    USUAL,
    DuctChoice,
    ExerciseFile,
    Goal,
)
from app.simulation import (
    AT_ANATOMY,
    ERROR_CLASSES,
    METRIC_OF,
    Feedback,
    bed_presets,
    renamed_numbers,
)

FIELDS = {
    "length_mm": "Length to be freed, mm",
    "from_mm": "From, mm from the first clamp",
    "to_mm": "To, mm from the first clamp",
    "deflection_mm": "Deflection to hold, mm",
    "tolerance_mm": "Within, mm",
    "low": "Lowest of the band",
    "high": "Highest of the band",
    "seconds": "Time to stay there, or stopped, s",
    "points": "Points of the critical view, of 6",
    "stay": "Clips to stay, 0 for the view alone",
    "go": "Clips to go, 0 for the view alone",
    "repeats": "How many times",
    "return_below": "Led back below",
    "time_limit_s": "Time, s",
}
WORDS = {
    Feedback.CONTINUOUS: "Figures all the time",
    Feedback.FADING: "Figures that fade",
    Feedback.SUMMARY: "Figures in the result only",
}
CLASS_OWN = "The class's"


def exercise_form(now: ExerciseFile | None) -> str:
    """Return the fields of an exercise file, filled with the one that is set now, if one is."""
    # The page's script writes the file from them.
    duct = DuctChoice() if now is None else now.duct
    limits = {} if now is None else renamed_numbers(now.limits)
    errors = {} if now is None else now.errors
    title, text = ("", "") if now is None else (now.title, now.text)
    goal, feedback = (None, None) if now is None else (now.goal, now.feedback)
    numbers = "".join(_numbers(each, limits if each == goal else {}) for each in GOALS)
    fails = "".join(
        _number(f"errors.{each.key}", each.title, 1.0, "1", errors.get(each.key))
        for each in ERROR_CLASSES.values()
        if each.key != "tear"
    )
    seed = duct.seed if goal is not None else None
    beds = {"": CLASS_OWN} | {each: each for each in bed_presets()}
    anatomies = {each: each for each in shipped_anatomies()} | {DRAWN: "Drawn by a seed"}
    return (
        f"<div class='fields'><label>Exercise {_choice('goal', {**GOALS}, goal)}</label>"
        f"<label>Title <input id='title' maxlength='60' value='{html.escape(title)}'></label>"
        "<label class='wide'>What you tell the trainees <input id='words' maxlength='1000' "
        f"value='{html.escape(text)}'></label>"
        f"<label>Feedback {_choice('feedback', {**WORDS}, feedback)}</label>"
        "<label class='of-bed'>Bed "
        f"{_choice('bed', beds, duct.bed)}</label><label class='of-anatomy'>Anatomy "
        f"{_choice('anatomy', anatomies, duct.anatomy or USUAL)}</label>"
        f"{_number('seed', 'Seed', 1.0, '1', seed, 'of-bed of-anatomy')}"
        f"<input type='hidden' id='preset' value='{html.escape(duct.preset or '')}'>"
        f"<input type='hidden' id='relaxes' value='{'true' if duct.relaxes else ''}'></div>"
        "<details><summary>Limits</summary><p class='empty'>What is left empty is worked out "
        f"for the duct.</p>{numbers}</details><details><summary>Errors that fail it</summary>"
        "<p class='empty'>The most incidents that do not fail it. What is left empty is as in the "
        f"trainer.</p><div class='fields' id='errors'>{fails}</div></details>"
    )


def _choice(name: str, options: Mapping[str, str], chosen: str | None) -> str:
    """Return a choice by what its options mean."""
    shown = "".join(
        f"<option value='{html.escape(each)}'{' selected' if each == chosen else ''}>"
        f"{html.escape(words)}</option>"
        for each, words in options.items()
    )
    return f"<select id='{name}'>{shown}</select>"


def _numbers(goal: Goal, now: Mapping[str, float]) -> str:
    fields: list[str] = []
    for key in NUMBERS[goal]:
        metric = METRIC_OF.get(key)
        if metric is None or key in FIELDS:
            fields.append(_number(f"limits.{key}", FIELDS[key], 1.0, "any", now.get(key)))
            continue
        bound = "at least" if metric.better == "higher" else "at most"
        unit = f", {metric.unit}" if metric.unit else ""
        label = f"{metric.title} {bound}{unit}"
        fields.append(_number(f"limits.{key}", label, metric.factor, "any", now.get(key)))
    where = "" if goal in PULLS else "anatomy" if goal in AT_ANATOMY else "bed"
    return f"<div class='fields' data-goal='{goal}' data-where='{where}'>{''.join(fields)}</div>"


def _number(
    key: str, label: str, factor: float, step: str, now: float | None, look: str = ""
) -> str:
    value = "" if now is None else f"{factor * now:.12g}"
    return (
        f"<label class='{look}'>{html.escape(label)} <input type='number' min='0' step='{step}' "
        f"data-key='{key}' data-factor='{factor:g}' value='{value}'></label>"
    )
