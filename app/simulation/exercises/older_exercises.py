"""Exercises as they were written before goal, limits and opening were apart, as those of today."""

from typing import Any

from app.simulation.exercises.exercise_table import EXERCISES

RENAMED_LIMITS = {
    "share_limit": "peak_stress_ratio",
    "stress_ratio_limit": "peak_stress_ratio",
    "time_to_break_limit_s": "shortest_time_to_break_s",
    "out_of_sight_limit": "strands_broken_out_of_sight",
    "instrument_force_limit_N": "maximum_instrument_force_N",
    "force_limit_N": "maximum_force_N",
    "reserve_limit": "smallest_distance_to_break",
    "overshoot_limit": "overshoot",
    "loading_rate_limit_N_per_s": "maximum_loading_rate_N_per_s",
    "mean_force_limit_N": "mean_absolute_nonzero_force_N",
    "product_limit_N_s": "force_time_product_N_s",
}
"""Metrics by the names that their limits had."""
RENAMED_GOALS = {
    "free_mm": "length_mm",
    "margin": "high",
    "low_mm": "low",
    "high_mm": "high",
    "slack_mm": "return_below",
    "lifts": "repeats",
}
NAMES = {
    "hold-stretch": "hold_stretch",
    "approach-break": "approach_break",
    "gentle-lifts": "gentle_lifts",
    "gentle-dissection": "least_impulse",
}
KINDS = {
    "hold_stretch": {"kind": "stay", "quantity": "deflection_mm"},
    "approach_break": {"kind": "stay", "quantity": "distance_to_break", "low": 0.0},
    "gentle_lifts": {"kind": "stay", "quantity": "deflection_mm"},
    "least_impulse": {"kind": "break_apart"},
    "free_stretch": {"kind": "free_length"},
}
OPENING = {"bed", "bed_seed", "opened_mm", "divided"}
GOAL = {"from_mm", "to_mm", "one_stretch", "seconds"}
AT_END = "mean_absolute_nonzero_force_N"


def renamed_numbers(numbers: dict[str, Any]) -> dict[str, Any]:
    """Return numbers of a goal and of limits by their present names."""
    renamed = RENAMED_LIMITS | RENAMED_GOALS
    return {renamed.get(key, key): each for key, each in numbers.items()}


def renamed_goal(fields: dict[str, Any]) -> dict[str, Any]:
    """Return the fields of a goal by their present names; a middle with a tolerance is a band."""
    found = renamed_numbers(fields)
    if "deflection_mm" in found or "tolerance_mm" in found:
        low, high = found.get("low", 0.0), found.get("high", 0.0)
        middle = found.pop("deflection_mm", 0.5 * (low + high))
        half = found.pop("tolerance_mm", 0.5 * (high - low))
        found |= {"low": middle - half, "high": middle + half}
    return found


def renamed_exercise(exercise: dict[str, Any]) -> dict[str, Any]:
    """Return an exercise of any version as one of today; what it has wrong is left to be found."""
    if "goal" in exercise:
        return exercise
    old = dict(exercise)
    kind = old.pop("exercise", "free_stretch")
    kind = NAMES.get(kind, kind)
    name = str(old.pop("name", kind)).replace("-", "_")
    if kind not in KINDS:
        raise ValueError(f"{kind!r} is no exercise; there are: {', '.join(KINDS)}")
    errors, time_limit = old.pop("errors", {}), old.pop("time_limit_s", None)
    goal = renamed_goal({key: old.pop(key) for key in (*GOAL, *RENAMED_GOALS, "deflection_mm",
                                                       "tolerance_mm") if key in old})  # fmt: skip
    opening = {key: each for key in OPENING if (each := old.pop(key, None)) is not None}
    limits = [] if kind == "least_impulse" else [{"of": "tear", "value": 0}]
    limits += [{"of": key, "value": most} for key, most in errors.items()]
    for key in [each for each in old if each in RENAMED_LIMITS]:
        # A time to break of 0 s and no force of an instrument stood for no limit.
        if value := old.pop(key):
            of = RENAMED_LIMITS[key]
            limits.append({"of": of, "value": value, **({"at_end": True} if of == AT_END else {})})
        elif key == "out_of_sight_limit":
            limits.append({"of": RENAMED_LIMITS[key], "value": 0})
    known = EXERCISES.get(name)
    found = old | {
        "name": name,
        "title": "Least force-time product" if known is None else known.title,
        "method": "" if known is None else known.method,
        "goal": KINDS[kind] | goal,
        "limits": limits,
        "time_limit_s": time_limit or (120.0 if opening else 60.0),
    }
    return found | {"opening": opening} if opening else found
