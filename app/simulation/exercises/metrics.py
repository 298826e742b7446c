"""Metrics: each measure of a run, with its name, unit and meaning (docs/measures.md)."""

import re
from typing import Any, Literal, NamedTuple

import msgspec

from app.anatomy import tube_title

Metrics = dict[str, Any]
"""The metrics of a run by key: a number, a list of one of each hand, the name of a tube, or what is
known of the tear; None where the run gives none."""
DISTANCE_TO_BREAK = "smallest_distance_to_break"
MOST_DIGITS = 6


class Metric(NamedTuple):
    """One measure: its factor and unit as shown, which of two is better, and what it means."""

    key: str
    title: str
    unit: str
    better: Literal["lower", "higher", ""]
    meaning: str
    factor: float = 1.0
    by_hand: str = ""  # of what there is one for each hand, the title with hands
    limited: str = ""  # a limit of it, in words with {limit}
    passed: str = ""  # that it is passed, in a sentence with {value} and {limit} without full stop
    tube: str = ""  # key of the name of the tube that it is of, where there are several

    def limit_words(self, limit: float) -> str:
        """Return a limit of it, in words."""
        bound = "at least" if self.better == "higher" else "at most"
        general = f"{self._plain.lower()} {bound} {{limit:.3g}} {self.unit}"
        return (self.limited or general).format(limit=self.factor * limit).strip()

    def passed_words(self, value: float, limit: float) -> str:
        """Return that it is past a limit, in a sentence without its full stop."""
        general = f"{self._plain} was {{value:.4g}} {self.unit}, past {{limit:.3g}} {self.unit}"
        words, value, limit = self.passed or general, self.factor * value, self.factor * limit
        # As many more digits as tell the two apart.
        for _ in range(MOST_DIGITS):
            if words.format(value=value, limit=limit) != words.format(value=limit, limit=limit):
                break
            words = re.sub(r"\.(\d)([fg])", lambda at: f".{int(at[1]) + 1}{at[2]}", words)
        return words.format(value=value, limit=limit).strip()

    @property
    def _plain(self) -> str:
        return self.title.partition(" {")[0]

    def name(self, metrics: Metrics) -> str:
        """Return its title in a run."""
        if isinstance(metrics[self.key], list):
            return self.by_hand
        title, tube = self.title.format(**metrics), metrics.get(self.tube)
        return title if tube is None else f"{title}, {tube_title(tube)}"


METRICS = (
    Metric("time_s", "Time", "s", "lower", "Length of the run, from the first input to its end."),
    Metric(
        "time_in_tissue_s", "Time in tissue", "s", "",
        "Time in which a hand held tissue, or an instrument was among strands or pressed on "
        "a wall.",
    ),
    Metric("freed_mm", "Freed", "mm", "higher", "Length of duct whose strands have broken."),
    Metric(
        "longest_freed_stretch_mm", "Longest freed stretch", "mm", "higher",
        "The longest part of the duct that is free throughout.",
    ),
    Metric("strands", "Strands at the start", "", "", "Strands that held the duct."),
    Metric(
        "strands_broken", "Strands broken", "", "", "Strands that have broken, of all that held.",
    ),
    Metric(
        "strands_broken_by_hand", "Broken by the hand", "", "",
        "Strands that each hand broke.", by_hand="Broken by the left / right hand",
    ),
    Metric(
        "strands_broken_by_instrument", "Broken by jaws or swab", "", "",
        "Strands that a jaw or a swab touched as they broke.",
    ),
    Metric(
        "strands_broken_out_of_sight", "Broken out of sight", "", "lower",
        "Strands that broke where neither the picture nor an instrument near by shows them.",
        limited="no more than {limit:.0f} strands broken out of sight",
        passed="{value:.0f} strands broke out of sight, more than {limit:.0f}",
    ),
    Metric(
        "peak_stress_ratio", "Peak stress", "% of break", "lower",
        "The highest stress in the wall, as a part of the threshold: 100 % tears.", 100.0,
        limited="the wall never past {limit:.0f} % of its break",
        passed="The wall reached {value:.1f} % of its break, past {limit:.1f} %",
        tube="peak_stress_tube",
    ),
    Metric(
        "peak_stress_station_mm", "Place of the peak stress", "mm", "",
        "Where the wall had its highest stress, from the first clamp or the tube's first end.",
        tube="peak_stress_tube",
    ),
    Metric(
        "shortest_time_to_break_s", "Shortest time to break", "s", "higher",
        "How long the duct would have lasted at its fastest loading, over a tenth of a second: "
        "whoever leaves less than a reaction time cannot stop.",
        limited="never so fast that it would break within {limit:g} s",
        passed="The wall would have broken in {value:.4g} s, sooner than {limit:g} s, in which one "
        "can react",
    ),
    Metric(
        "time_above_half_s", "Time above half of the break", "s", "lower",
        "Time with a stress above half of the threshold.",
    ),
    Metric(
        "work_mJ", "Work", "mJ", "lower", "What each hand has put into duct and tissue.",
        by_hand="Work of the left / right hand",
    ),
    Metric(
        "strand_energy_mJ", "Energy into strands", "mJ", "",
        "Energy that breaking the strands has taken.",
    ),
    Metric(
        "duct_energy_mJ", "Energy in the duct", "mJ", "lower",
        "Largest elastic energy of the stretched and bent duct at any time.",
    ),
    Metric(
        "economy_of_work", "Economy of work", "", "higher",
        "Energy into strands divided by the work of both hands: 1 would not load the duct at all.",
    ),
    Metric(
        "maximum_force_N", "Maximum force", "N", "lower", "Largest force of a hand.",
        by_hand="Maximum force, left / right",
        limited="at most {limit:.3g} N",
        passed="The force reached {value:.3g} N, past {limit:.3g} N",
    ),
    Metric(
        "mean_absolute_nonzero_force_N", "Mean absolute non-zero force", "N", "lower",
        "Mean of the force over the time in which there was any.",
        limited="on average {limit:.3g} N",
        passed="The mean force was {value:.3g} N, past {limit:.3g} N",
    ),
    Metric(
        "force_sd_N", "Standard deviation of the force", "N", "lower",
        "How much the force varied over the same time.",
    ),
    Metric(
        "maximum_loading_rate_N_per_s", "Maximum rate of loading", "N/s", "lower",
        "Fastest growth of the force, over a tenth of a second.",
        limited="loaded by at most {limit:.3g} N/s",
        passed="It was loaded by {value:.3g} N/s, faster than {limit:.3g} N/s",
    ),
    Metric(
        "overshoot", "Overshoot", "%", "lower",
        "How far the duct was pulled past the goal, as a part of the deflection in its middle.",
        100.0,
        limited="no more than {limit:.0f} % past the goal",
        passed="It went {value:.0f} % past the goal, more than {limit:.0f} %",
    ),
    Metric(
        "maximum_instrument_force_N", "Maximum force of jaws or swab", "N", "lower",
        "Largest force on a jaw or a swab.",
        limited="jaws or swab pushed with at most {limit:.2g} N",
        passed="The instrument was pushed with {value:.2g} N, past {limit:.2g} N",
    ),
    Metric(
        "force_time_product_N_s", "Force-time product", "N s", "lower",
        "Sum of the force over time, also called impulse. It rewards haste: read it with the "
        "rate of loading.", by_hand="Force-time product, left / right",
        limited="no more than {limit:.3g} N s",
        passed="{value:.3g} N s was spent, more than {limit:.3g} N s",
    ),
    Metric(
        "time_over_threshold_s", "Time over {task_threshold_N:.3g} N", "s", "lower",
        "Time over threshold: with more force than the task threshold, which is the exercise's "
        "limit of force, or half the force at break.",
    ),
    Metric(
        "path_length_mm", "Path length", "mm", "lower", "Path of the hook while it held the duct.",
    ),
    Metric(
        "economy_of_motion", "Economy of motion", "", "higher",
        "Farthest distance of the hook from where it took hold, divided by its path: 1 for "
        "one straight pull.",
    ),
    Metric(
        "smoothness", "Smoothness", "", "higher",
        "Log dimensionless jerk of the hook: the nearer to zero, the smoother; -5.3 is the "
        "smoothest reach there is. Given only of a run with a whole movement, half a second or "
        "longer, that has come to rest.",
    ),
    Metric(
        "traction_angle_deg", "Angle of traction", "°", "lower",
        "Mean angle between the pull on the duct and straight off the bed, weighted by force.",
    ),
    Metric(
        "blood_lost_ml", "Blood lost", "ml", "lower",
        "What has flowed out of vessels, also what suction has taken up.",
        limited="no more than {limit:.3g} ml of blood lost",
        passed="{value:.3g} ml of blood were lost, more than {limit:.3g} ml",
    ),
    Metric(
        "critical_view_points", "Critical view of safety", "of 6", "higher",
        "Most points of the critical view of safety at once, with nothing torn.",
    ),
    Metric(
        "time_out_of_picture_s", "Time with a tip out of the picture", "s", "lower",
        "Time for which the tip of either hand was outside the scope's round picture.",
        limited="a tip out of the picture for no more than {limit:.3g} s",
        passed="A tip was out of the picture for {value:.3g} s, more than {limit:.3g} s",
    ),
    Metric(
        "scope_path_mm", "Path of the scope", "mm", "lower",
        "Path of the scope's tip, in steps of 5 mm or 5 degrees.",
    ),
    Metric(
        "horizon_deg", "Horizon", "°", "lower",
        "Mean turn of the picture's horizon from level, either way.",
    ),
    Metric(
        DISTANCE_TO_BREAK, "Smallest distance to break", "%", "higher",
        "How near the duct came to its break: 0 % is the break.", 100.0,
        limited="{limit:.0f} % left to the break",
        passed="The distance to break fell to {value:.0f} %, below {limit:.0f} %",
    ),
)  # fmt: skip
"""All measures that are numbers, but the task threshold, in the order in which they are shown."""
METRIC_OF = {each.key: each for each in METRICS}
"""Them by key."""


def metrics_of(measures: msgspec.Struct) -> Metrics:
    """Return measures by key."""
    # As a file has them: pairs are lists.
    return msgspec.json.decode(msgspec.json.encode(measures))
