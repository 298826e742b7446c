"""The form of an exercise that a teacher sets: its fields as HTML, by goal."""

import html

from app.anatomy import shipped_anatomies
from app.classroom.exercise_file import DRAWN, GOALS, NUMBERS, PULLS, Goal
from app.simulation import AT_ANATOMY, ERROR_CLASSES, METRIC_OF, Feedback, bed_presets

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


def exercise_form() -> str:
    """Return the fields of an exercise file; the page's script writes the file from them."""
    goals = "".join(f"<option value='{goal}'>{title}</option>" for goal, title in GOALS.items())
    beds = "".join(f"<option>{html.escape(name)}</option>" for name in bed_presets())
    anatomies = "".join(f"<option>{html.escape(each)}</option>" for each in shipped_anatomies())
    feedback = "".join(
        f"<option value='{each.value}'>{words}</option>" for each, words in WORDS.items()
    )
    numbers = "".join(_numbers(goal) for goal in GOALS)
    errors = "".join(
        _number(f"errors.{each.key}", each.title, 1.0, "1")
        for each in ERROR_CLASSES.values()
        if each.key != "tear"
    )
    return (
        f"<div class='fields'><label>Exercise <select id='goal'>{goals}</select></label>"
        "<label>Title <input id='title' maxlength='60'></label>"
        "<label class='wide'>What you tell the trainees <input id='words' maxlength='1000'></label>"
        f"<label>Feedback <select id='feedback'>{feedback}</select></label>"
        "<label class='of-bed'>Bed <select id='bed'><option value=''>The class's</option>"
        f"{beds}</select></label><label class='of-anatomy'>Anatomy <select id='anatomy'>{anatomies}"
        f"<option value='{DRAWN}'>Drawn by a seed</option></select></label>"
        f"{_number('seed', 'Seed', 1.0, '1', 'of-bed of-anatomy')}</div>"
        "<details><summary>Limits</summary><p class='empty'>What is left empty is worked out "
        f"for the duct.</p>{numbers}</details><details><summary>Errors that fail it</summary>"
        "<p class='empty'>The most incidents that do not fail it. What is left empty is as in the "
        f"trainer.</p><div class='fields' id='errors'>{errors}</div></details>"
    )


def _numbers(goal: Goal) -> str:
    fields: list[str] = []
    for key in NUMBERS[goal]:
        metric = METRIC_OF.get(key)
        if metric is None or key in FIELDS:
            fields.append(_number(f"limits.{key}", FIELDS[key], 1.0, "any"))
            continue
        bound = "at least" if metric.better == "higher" else "at most"
        unit = f", {metric.unit}" if metric.unit else ""
        label = f"{metric.title} {bound}{unit}"
        fields.append(_number(f"limits.{key}", label, metric.factor, "any"))
    where = "" if goal in PULLS else "anatomy" if goal in AT_ANATOMY else "bed"
    return f"<div class='fields' data-goal='{goal}' data-where='{where}'>{''.join(fields)}</div>"


def _number(key: str, label: str, factor: float, step: str, look: str = "") -> str:
    return (
        f"<label class='{look}'>{html.escape(label)} <input type='number' min='0' step='{step}' "
        f"data-key='{key}' data-factor='{factor:g}'></label>"
    )
