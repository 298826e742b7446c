"""Error classes of blunt dissection, as data: what each is, when it begins, and what to do instead.

An incident of a class is one opening and one closing of its condition, as raters of a human
reliability analysis (OCHRA) count errors, and not a count of ticks. Each number follows from the
tissue, from the duct or from a reaction time, or is a choice and says so: no publication gives
limits of force or speed for blunt dissection. docs/errors.md is made from this table.
"""

from collections.abc import Callable, Mapping
from typing import NamedTuple

from app.simulation.inputs.clock import REACTION_SECONDS
from app.simulation.inputs.hand import GRIP_N

CLOSED_AFTER = 0.4
"""s without its condition after which an incident is over."""

MODES: dict[int, str] = {
    2: "step done in part",
    3: "step repeated or carried on",
    6: "step out of order",
    7: "too much speed, force or distance",
    9: "wrong direction or place",
    10: "wrong object",
}
"""External error modes of OCHRA (Tang et al. 2004) that the classes here are of."""


class Conditions(NamedTuple):
    """What parameters are derived from."""

    yield_mm: float  # elongation at which a strand begins to soften
    failure_mm: float  # and at which it has parted
    radius_mm: float  # of the duct
    stress_ratio_limit: float | None  # of the exercise, if there is one
    out_of_sight_limit: float | None


class Parameter(NamedTuple):
    """A number of a class: itself, or how it is derived."""

    key: str
    unit: str
    value: float | Callable[[Conditions], float]
    why: str  # its derivation or source

    def of(self, tissue: Conditions | None) -> float:
        """Return its value in a tissue; one that is not derived from it has the same in all."""
        if not callable(self.value):
            return self.value
        assert tissue is not None  # noqa: S101 (the caller has looked)
        return self.value(tissue)


class ErrorClass(NamedTuple):
    """A class of errors.

    `happened` and `instead` are filled with the values of an incident; `happened` is a clause that
    can follow a colon.
    """

    key: str
    title: str
    mode: int  # of OCHRA, in `MODES`
    begins: str  # the condition, which ends it as well
    happened: str
    instead: str
    parameters: tuple[Parameter, ...] = ()
    if_named: bool = False  # whether it is one only in an exercise that names it
    is_result: bool = False  # whether it comes of another error, if one began before it
    past_tubes: bool = False  # whether one incident may pass several tubes; it names the first


def _blind_speed(tissue: Conditions) -> float:
    return 2.0 * tissue.radius_mm / REACTION_SECONDS


def _jaw_speed(tissue: Conditions) -> float:
    return 2.0 * _strand_speed(tissue)


def _pull_speed(tissue: Conditions) -> float:
    return 1.5 * _strand_speed(tissue)


def _most_stress(tissue: Conditions) -> float:
    return tissue.stress_ratio_limit or 1.0


def _most_unseen(tissue: Conditions) -> float:
    return max(3.0, round(0.15 * (tissue.out_of_sight_limit or 0)))


def _strand_speed(tissue: Conditions) -> float:
    return (tissue.failure_mm - tissue.yield_mm) / REACTION_SECONDS


STRAND_SPEED = Parameter(
    "speed", "mm/s", _strand_speed,
    "(part - yield) / reaction time: a strand that begins to yield has not parted before the hand "
    "can stop",
)  # fmt: skip
LEAST_PULL = Parameter("pull", "N", 0.2, "a choice: a hold that pulls less does nothing")
REACTION = Parameter("seconds", "s", REACTION_SECONDS, "a visual reaction time, docs/measures.md")

ERROR_CLASSES: Mapping[str, ErrorClass] = {
    each.key: each
    for each in (
        ErrorClass(
            "wrong_structure", "Handled a wrong structure", 10,
            "a hold pulls with more than `pull` on a tube that the exercise is not about",
            "at {t:.1f} s you pulled on the {name} with {force_N:.1f} N, which is not to be "
            "touched here",
            "Follow a structure both ways before you take hold of it.",
            (LEAST_PULL,),
            if_named=True,
        ),
        ErrorClass(
            "mistaken", "Took one structure for another", 10,
            "a tube is marked as a structure that it is not",
            "at {t:.1f} s you took the {name} for the {taken}",
            "Follow it both ways: what alone runs into the gallbladder is the cystic duct or its "
            "artery; what runs on to the liver is neither.",
        ),
        ErrorClass(
            "named_unsafe", "Named before it was safe", 6,
            "a tube is marked while the critical view of safety has fewer than `points`",
            "at {t:.1f} s you took the {name} for the {taken} with {points:.0f} of 6 points of the "
            "critical view",
            "Say that it is not yet safe, and have more freed first.",
            (Parameter("points", "", 5.0, "Strasberg and Brunt 2010: all three parts, one short"),),
            if_named=True,
        ),
        ErrorClass(
            "held_back", "Called a safe view unsafe", 2,
            "it is said that it is not yet safe to tell with as many points as `named_unsafe` asks",
            "at {t:.1f} s you called it not yet safe with {points:.0f} of 6 points of the "
            "critical view",
            "All three parts are shown: follow each structure, and name it.",
            if_named=True,
        ),
        ErrorClass(
            "clip_wrong_tube", "Clipped or divided a wrong tube", 10,
            "a clip or a division is on a tube that the exercise is not about",
            "at {t:.1f} s you {did} the {name} at {at_mm:.0f} mm, which is not to be closed here",
            "Show both ends of a structure before you close it.",
            if_named=True,
        ),
        ErrorClass(
            "clip_astray", "Clipped where it stops nothing", 9,
            "`seconds` after a clip on a tube that bleeds, more than `fraction` of what flowed out "
            "of it still does",
            "at {t:.1f} s your clip on the {name} at {at_mm:.0f} mm had stopped nothing",
            "Look which end bleeds, and clip between it and where the blood comes from.",
            (
                Parameter("seconds", "s", 0.5, "two reaction times"),
                Parameter("fraction", "", 0.9, "a choice: a clip on one of two ways in stops more"),
            ),
        ),
        ErrorClass(
            "divided_before_view", "Divided before the critical view", 6,
            "a tube that enters the gallbladder is divided while the critical view of safety has "
            "fewer than `points`",
            "at {t:.1f} s you divided the {name} with {points:.0f} of 6 points of the critical "
            "view",
            "Free both structures, the triangle and the lower plate first.",
            (Parameter("points", "", 5.0, "Strasberg and Brunt 2010: all three parts, one short"),),
        ),
        ErrorClass(
            "clip_short", "Divided with too few clips", 2,
            "a tube that enters the gallbladder is divided with fewer than `clips` on the side "
            "that stays",
            "at {t:.1f} s you divided the {name} with {clips:.0f} clips on the side that stays",
            "Put two clips on the side that stays before you divide.",
            (Parameter("clips", "", 2.0, "two on the side that stays, as is taught"),),
        ),
        ErrorClass(
            "unattended_bleeding", "Went on while a vessel bled", 2,
            "a vessel has bled for more than `seconds`, and strands part meanwhile on a hand that "
            "is farther than `away` from it",
            "at {t:.1f} s the {name} had bled for {seconds:.0f} s, {lost_ml:.1f} ml, while you "
            "went on {distance_mm:.0f} mm away",
            "Stop, press on it first, look, and then close it.",
            (
                Parameter("seconds", "s", 5.0, "a choice: as long as it takes to see it and stop"),
                Parameter("away", "mm", 10.0, "a choice: nearer, the hand may be at the vessel"),
            ),
        ),
        ErrorClass(
            "ahead_of_front", "Held ahead of the front", 9,
            "a hold that pulls with more than `pull` was taken more than `near` beyond a free "
            "stretch, where the duct is still fixed; not while the other hand has a dissector or "
            "a swab, as it then holds the duct up",
            "at {t:.1f} s you took hold at {at_mm:.0f} mm, {distance_mm:.0f} mm ahead of the free "
            "stretch, and pulled on hidden strands",
            "Take hold at the front, at {front_mm:.0f} mm.",
            (
                Parameter("near", "mm", 2.0, "the step of a good hand"),
                LEAST_PULL,
            ),
        ),
        ErrorClass(
            "blind_stab", "Stabbed in unseen", 7,
            "the tip of an instrument that touches strands moves faster than `speed`, over 0.1 s, "
            "where a tube hides it from the viewer",
            "at {t:.1f} s the tip went in behind {what} at {speed_mm_per_s:.0f} mm/s, where you "
            "could not see it: {distance_mm:.0f} mm in a reaction time",
            "Go in at {speed_limit_mm_per_s:.0f} mm/s or less, or turn the view.",
            (
                Parameter(
                    "speed", "mm/s", _blind_speed,
                    "duct's thickness / reaction time: how far the tip goes before the hand can "
                    "stop",
                ),
            ),
            past_tubes=True,
        ),
        ErrorClass(
            "jumping_jaws", "Jaws thrown open", 7,
            "a strand on a jaw parts while the opening grows faster than `speed`, over 0.1 s",
            "at {t:.1f} s the jaws opened at {speed_mm_per_s:.0f} mm/s and {strands:.0f} strands "
            "parted at once",
            "Open them over a second or two and stop when you feel them yield.",
            (
                Parameter(
                    "speed", "mm/s", _jaw_speed,
                    "twice (part - yield) / reaction time, as both jaws move",
                ),
            ),
        ),
        ErrorClass(
            "stirring", "Stirred with the jaws", 9,
            "on jaws that do not open `strands` strands have parted within `seconds`, and the tip "
            "has turned back `turns` times by more than 2 mm",
            "from {t:.1f} s on you swept the jaws to and fro, and {strands:.0f} strands parted",
            "Stop behind the duct and open the jaws: that loads its wall least.",
            (
                Parameter("strands", "", 5.0, "a choice: fewer part beside a dissector that waits"),
                Parameter("turns", "", 2.0, "to and fro"),
                Parameter("seconds", "s", 5.0, "a choice"),
            ),
        ),
        ErrorClass(
            "ploughing", "Ploughed with the jaws", 9,
            "on jaws that do not open `strands` strands have parted within `seconds`, and the tip "
            "has moved on by more than `travel` meanwhile; or more than `in_all` have in the run",
            "from {t:.1f} s on you pushed the jaws through strands without opening them, "
            "{distance_mm:.0f} mm far, and {strands:.0f} parted",
            "Stop behind the duct and open the jaws: that loads its wall least.",
            (
                Parameter("strands", "", 5.0, "a choice: fewer part beside a dissector that waits"),
                Parameter("travel", "mm", 3.0, "more than a hand that holds still trembles"),
                Parameter("seconds", "s", 5.0, "a choice"),
                Parameter("in_all", "", 75.0, "half of the strands about 13 mm, a window's length"),
            ),
        ),
        ErrorClass(
            "fast_in_tissue", "Instrument too fast in tissue", 7,
            "`strands` strands on a jaw or a swab part in one tick while its tip moves faster than "
            "`speed`, over 0.1 s",
            "at {t:.1f} s you swept the {tool} through strands at {speed_mm_per_s:.0f} mm/s, and "
            "{strands:.0f} parted",
            "Go in slowly, below {speed_limit_mm_per_s:.0f} mm/s you can stop in time, and then "
            "spread.",
            (
                STRAND_SPEED,
                Parameter("strands", "", 2.0, "a choice: one may part by itself"),
            ),
        ),
        ErrorClass(
            "repeated_holds", "Took hold again and again", 2,
            "one hand takes hold `holds` times within `seconds`, each within 2 mm of the last",
            "at {t:.1f} s you took hold {holds:.0f} times in a second at {at_mm:.0f} mm",
            "Take one good bite: each hold crushes the wall.",
            (
                Parameter("holds", "", 3.0, "a choice: more than two a second"),
                Parameter("seconds", "s", 1.0, "a choice"),
            ),
        ),
        ErrorClass(
            "hold_slipped", "Lost the hold", 2,
            "tissue slips out of a grasper, as it does at a pull of "
            f"{GRIP_N:g} N (3); a hook does not let it slip",
            "at {t:.1f} s {what} slipped out of the grasper at {at_mm:.0f} mm, at {force_N:.1f} N",
            "Take a better bite and pull less, or free it first.",
            is_result=True,
        ),
        ErrorClass(
            "one_go", "Pulled on in one go", 3,
            "the front has moved on by more than `far` from a hold that goes on pulling with more "
            "than `pull`",
            "from {t:.1f} s on one hold pulled on while the front ran {distance_mm:.0f} mm away "
            "from it",
            "Let go and take hold again every 2 mm: short lifts at the front.",
            (
                Parameter("far", "mm", 5.0, "as far as strands beside an instrument are seen"),
                LEAST_PULL,
            ),
        ),
        ErrorClass(
            "leaning", "Pulled sideways", 9,
            "the mean pull of a hold over 0.3 s leans sideways by more than `angle` for `seconds`, "
            "and is above `pull`",
            "at {t:.1f} s you pulled {angle_deg:.0f} degrees off straight up{to}, which loads one "
            "side of the wall",
            "Lead it back over where it was held at rest, and pull straight off the bed.",
            (
                Parameter("angle", "deg", 20.0, "a choice: sideways pull is a third of the pull"),
                Parameter("pull", "N", 0.2, "a choice: below it a tremor decides the direction"),
                Parameter("seconds", "s", 0.13, "a choice: a tremor does not lean that long"),
            ),
        ),
        ErrorClass(
            "behind_front", "Held behind the front", 9,
            "a hold that pulls with more than `pull` was taken farther than `far` inside the free "
            "stretch; not while the "
            "other hand has a dissector or a swab",
            "at {t:.1f} s you took hold at {at_mm:.0f} mm, {distance_mm:.0f} mm behind the front, "
            "where free duct stretches instead of the layer",
            "Take hold at the front, at {front_mm:.0f} mm.",
            (
                Parameter("far", "mm", 3.0, "a good hand's step and a bin of 1 mm"),
                LEAST_PULL,
            ),
        ),
        ErrorClass(
            "fast_pull", "Loaded faster than you can react", 7,
            "with the stress ratio s above `least`, (1 - s) over its growth is below `seconds`, "
            "over 0.13 s; or strands part while a hold moves faster than `speed`, over 0.13 s; of "
            "two hands it is the one whose motion does more work on the wall, and none that is "
            "still",
            "at {t:.1f} s you pulled at {speed_mm_per_s:.0f} mm/s, and {outcome}",
            "Lift at half that speed, and slower still near the break.",
            (
                REACTION,
                Parameter("least", "", 0.1, "a choice: below it a tremor is most of the growth"),
                Parameter(
                    "speed", "mm/s", _pull_speed,
                    "1.5 (part - yield) / reaction time: the duct gives way by some of what the "
                    "hand moves",
                ),
            ),
        ),
        ErrorClass(
            "near_break_fast", "Near the break and not slower", 7,
            "the stress ratio s is above `least`, now and as a mean of 0.13 s; (1 - s) over its "
            "growth over 0.4 s is below `seconds`",
            "at {t:.1f} s the wall was at {stress_percent:.0f} % of its break and rose by "
            "{growth_percent_per_s:.0f} % a second",
            "Past half of the break slow down, so that two reaction times are left.",
            (
                Parameter("least", "", 0.5, "half of the break"),
                Parameter("seconds", "s", 2.0 * REACTION_SECONDS, "two reaction times"),
            ),
        ),
        ErrorClass(
            "no_traction", "Dissected without traction", 2,
            "strands part on an instrument while no hand holds the duct",
            "at {t:.1f} s strands parted while nothing held the duct up, so that it gives way "
            "instead of the layer",
            "Hold it up with the other hand first.",
            if_named=True,
        ),
        ErrorClass(
            "traction_lost", "Traction lost while dissecting", 2,
            "strands yield on an instrument while the other hand has let the duct down by more "
            "than `down`, as a mean over 0.3 s; its hold has pulled with more than `pull`, and now "
            "has less than `fraction` of that; not at an anatomy",
            "at {t:.1f} s the hold had gone from {most_force_N:.1f} to {force_N:.1f} N while the "
            "other hand dissected",
            "Keep the duct taut.",
            (
                Parameter("pull", "N", 0.5, "a choice"),
                Parameter("fraction", "", 0.3, "a choice"),
                Parameter("down", "mm", 1.0, "more than a hand that holds still trembles"),
            ),
        ),
        ErrorClass(
            "over_lifted", "Lifted higher than needed", 7,
            "the stress ratio is above `most` while a hand holds the duct, which lies in one bed",
            "at {t:.1f} s the wall was at {stress_percent:.0f} % of its break, lifted "
            "{lifted_mm:.0f} mm, and {stress_limit_percent:.0f} % is enough here",
            "Lift less, until the strands are just taut.",
            (
                Parameter(
                    "most", "",
                    _most_stress,
                    "the exercise's limit; without an exercise the break itself",
                ),
            ),
        ),
        ErrorClass(
            "tension_on_vessel", "Strained a vessel", 7,
            "the stress ratio of an artery or a vein is above `most`; it is put down to the hand "
            "that pulls or presses hardest",
            "at {t:.1f} s the {name} was at {stress_percent:.0f} % of its break{by}",
            "Ease the traction, and free it before you lift more.",
            (Parameter("most", "", 0.5, "half of the break"),),
        ),
        ErrorClass(
            "instrument_on_wall", "Pressed on the wall itself", 7,
            "for 0.13 s a jaw or swab presses on a tube that does not bleed with more than `least` "
            "and `fraction` of what breaks it; at an anatomy on no vessel, and while that tube's "
            "wall is at more than `near` of its break",
            "at {t:.1f} s the {tool} pressed on {what} with {force_N:.1f} N",
            "Press on no wall: lead the instrument aside, to where only strands are.",
            (
                Parameter(
                    "fraction", "", 0.1,
                    "a choice. The stress is that of a point load on a beam on an elastic "
                    "foundation, the strands (Hetenyi 1946): 0.46 N on the thesis's duct in the "
                    "bed *normal*, which a push there lifts to 0.09 of its break",
                ),
                Parameter("least", "N", 0.1, "a choice: less is a touch"),
                Parameter(
                    "near", "",
                    0.5,
                    "half of the break. Among several tubes jaws rest on walls on both sides, "
                    "which the formula leaves out",
                ),
            ),
        ),
        ErrorClass(
            "out_of_view", "Worked outside the picture", 9,
            "through a laparoscope: an instrument moves among strands, or moves a hold that pulls "
            "with more than `pull`, outside the picture for `seconds`",
            "at {t:.1f} s the {tool} worked outside the picture for {seconds:.1f} s",
            "Stop, bring the camera along, and go on once you see the tip.",
            (
                LEAST_PULL,
                Parameter("seconds", "s", 0.5, "two reaction times"),
            ),
        ),
        ErrorClass(
            "unseen", "Parted what you did not see", 9,
            "in one tick `strands` or more strands part on the side away from the viewer, more "
            "than 5 mm from every instrument",
            "at {t:.1f} s {strands:.0f} strands on the far side parted, out of sight",
            "Lift less and work closer, or turn the view.",
            (
                Parameter(
                    "strands", "",
                    _most_unseen,
                    "a choice: 0.15 of the exercise's limit, and at least 3",
                ),
            ),
        ),
        ErrorClass(
            "bleeding", "A vessel bled", 7,
            "blood flows out of a tube",
            "at {t:.1f} s the {name} began to bleed and lost {lost_ml:.1f} ml in {seconds:.0f} s",
            "Press on it first, then look, and then close it.",
            is_result=True,
        ),
        ErrorClass(
            "nick", "Wall nicked", 7,
            "the wall of a duct or of another tube tears part of the way, where it does not part "
            "at once",
            "at {t:.1f} s the wall of the {name} tore to {section_fraction:.2g} of its section at "
            "{at_mm:.0f} mm{by}{leak}",
            "Ease the pull as soon as the wall gives, and hold it elsewhere: at three quarters it "
            "parts.",
            is_result=True,
        ),
        ErrorClass(
            "tear", "A tube tore", 7,
            "the stress in the wall of a duct or of another tube has reached its threshold; of "
            "several tubes it is known what did it, and since when the stress was above `near`",
            "at {t:.1f} s the {name} tore at {at_mm:.0f} mm{by}",
            "Stay below the break: watch the distance to it.",
            (Parameter("near", "", 0.7, "where the page stops an instrument the first time"),),
            is_result=True,
        ),
    )
}  # fmt: skip
"""All classes by key, the order being that in which `cause_of` takes them for a failure's cause."""
