"""Values of incidents as they were kept before, by their present names."""

from collections.abc import Mapping

PRESENT = {
    "a": "angle_deg",
    "d": "distance_mm",
    "f": "force_N",
    "front": "front_mm",
    "g": "growth_percent_per_s",
    "left": "outcome",
    "m": "lifted_mm",
    "ml": "lost_ml",
    "n": "strands",
    "p": "stress_percent",
    "s": "seconds",
    "speed": "speed_limit_mm_per_s",
    "v": "speed_mm_per_s",
    "x": "at_mm",
}
OF_CLASS = {
    "clip_short": {"n": "clips"},
    "divided_before_view": {"n": "points"},
    "held_back": {"n": "points"},
    "named_unsafe": {"n": "points"},
    "nick": {"s": "section_fraction"},
    "over_lifted": {"most": "stress_limit_percent"},
    "repeated_holds": {"n": "holds"},
    "traction_lost": {"most": "most_force_N"},
}
"""Those of one class of errors that mean something else in others, or have no such name there."""


def with_present_names(error: str, values: Mapping[str, float | str]) -> dict[str, float | str]:
    """Return an incident's values with their present names."""
    names = PRESENT | OF_CLASS.get(error, {})
    return {names.get(key, key): value for key, value in values.items()}
