"""The exercises that a duct has, with limits that follow from its own break and from its bed.

A free duct's follow from where it breaks. In a bed good hands (`scripted_hands`) do each
exercise beforehand, with strands of even strength: what they need, with the kind's `spare` on
top, is the limit. In the window they hardly load the duct; there the limit is a part, `lifted`, of
what pulling it off takes. The bed's seed is the first one with which good hands pass. At an anatomy
the limit is of the blood that they lose until they have stopped a bleeding. Errors fail an exercise
too: it is not to be passed by what it does not teach.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

import msgspec
import numpy as np

from app.anatomy import Anatomy
from app.bed_preset import BedPreset, bed_named, named_or_whole
from app.simulation.exercises.exercise import Exercise, Limit, Opening
from app.simulation.exercises.exercise_table import EXERCISES
from app.simulation.exercises.goals import (
    CriticalView,
    FreeLength,
    Goal,
    Stay,
    StopBleeding,
    WhoIsWho,
)
from app.simulation.inputs.clock import REACTION_SECONDS
from app.simulation.runs.run_file import anatomy_or_name
from app.simulation.scripts.scripted_hands import MANNERS, Lift, Technique, perform
from app.simulation.session.session import Session
from app.simulation.specimen.grasped_beam import GraspedBeam
from app.simulation.specimen.specimen import Specimen
from app.simulation.tissue.safety import Safety
from app.simulation.tissue.spatial_tissue import FREED_FRACTION

# Deflection to hold, and its tolerance, over the deflection at break.
HOLD_FRACTION, HOLD_TOLERANCE = 0.6, 0.05
HOLD_SECONDS = 3.0
HOLD_FORCE = 1.1
"""Force limit over the largest that the hold needs."""
MARGIN = 0.15  # distance to break to approach, the same as the read-out's "Stop"
STAY_SECONDS = 1.0
# Factors of safety, strength over stress: to work at, and never to go below.
WORKING_SAFETY, LEAST_SAFETY = 2.0, 1.5
# Half width of the working band, over the deflection at its middle.
BAND_FRACTION = 0.08
# Deflection at which the duct counts as led back, over that at the band's middle.
SLACK_FRACTION = 0.25
LIFTS, LIFT_SECONDS = 3, 1.0

# Lengths over the span: of the window to be freed, of a divided duct's free end, and of what is to
# be freed from there on.
WINDOW_FRACTION, OPENED_FRACTION, FOLLOW_FRACTION = 0.25, 0.12, 0.6
# Strands that may tear out of sight, of those to be parted.
HIDDEN_FRACTION = 0.1
LOOSEST = 0.95
"""An exercise whose limit of stress comes out above this part of the break is not offered."""
MOST_SEEDS = 20
SCAR = "scar"
POINTS, FIRST_POINTS = 5, 3  # of the critical view of safety, and for who begins
STAY_CLIPS, GO_CLIPS = 2, 1  # on the side of a structure that stays, and on that which goes
VIEWS = {
    "critical_view": CriticalView(POINTS, stay=STAY_CLIPS, go=GO_CLIPS),
    "first_view": CriticalView(FIRST_POINTS),
}
STOPPED_SECONDS = 3.0
FEW = 300
"""Vertices of a duct that nobody sees."""
MOST_STRANDS = 10**6
"""A limit that limits nothing, while good hands find what they need."""


IN_BED = ("window", "follow_front", "free_scar")
AT_ANATOMY = ("first_view", "critical_view", "who_is_who", "stop_bleeding")
"""Exercises at an anatomy, through the laparoscope."""
EXPOSED = (0.35, 0.75, 1.0)
"""Parts of what holds the structures that have parted in a picture, by its anatomy's seed."""
TRACTION_MM = 9.0
"""mm that the gallbladder is lifted in each other picture: it draws out the common duct."""


def exercises_offered(session: Session, *, relaxes: bool = False) -> tuple[Exercise, ...]:
    """Return the exercises for a session's duct: a second's work the first time in a bed."""
    # Tissue relaxes in them, and while limits are found, as is asked for and not as in the session.
    specimen = session.specimen
    if specimen.anatomy is not None:
        return _at_anatomy(specimen.anatomy)
    if specimen.bed is not None:
        found = _in_bed(session, relaxes=relaxes).values()
        return tuple(each for each in found if isinstance(each, Exercise))
    return () if specimen.theory is None else _of_free_duct(session.task_beam())


def not_offered(session: Session) -> dict[str, str]:
    """Return why exercises in a bed are not offered in a session's, by name."""
    found = _in_bed(session, relaxes=False)
    return {name: each for name, each in found.items() if isinstance(each, str)}


def _exercise(
    name: str, goal: Goal, limits: Sequence[Limit], opening: Opening | None = None
) -> Exercise:
    kind = EXERCISES[name]
    return Exercise(
        name=name,
        title=kind.title,
        goal=goal,
        method=kind.method,
        limits=(
            Limit("tear", 0),
            *(Limit(each, 0) for each in kind.errors),
            *limits,
            *(Limit(each, 0, at_end=True) for each in kind.errors_at_end),
        ),
        opening=opening,
        instruments=kind.instruments,
        in_hand=kind.in_hand,
        time_limit_s=kind.time_limit_s,
    )


def exercise_at(anatomy: Anatomy, name: str) -> Exercise | None:
    """Return one of the exercises at an anatomy, or None where it cannot be done."""
    return _offered_at(msgspec.json.encode(anatomy), name)


def _at_anatomy(anatomy: Anatomy) -> tuple[Exercise, ...]:
    """Return the exercises at an anatomy; none where there is no gallbladder."""
    found = (exercise_at(anatomy, name) for name in AT_ANATOMY)
    return tuple(exercise for exercise in found if exercise is not None)


@lru_cache(maxsize=64)
def _offered_at(anatomy_json: bytes, name: str) -> Exercise | None:
    """Return an exercise at an anatomy, as JSON, or None where good hands cannot do it."""
    anatomy = msgspec.json.decode(anatomy_json, type=Anatomy)
    session = Session(Specimen.of_anatomy(anatomy), vertices=FEW)
    try:
        safety = Safety(session.spatial)
    except ValueError:
        return None
    where = Opening(anatomy=anatomy_or_name(anatomy))
    if name in VIEWS:
        exercise = _exercise(name, VIEWS[name], [], where)
        about = (safety.gallbladder, *safety.entering)
        return msgspec.structs.replace(exercise, about=about)
    if name == "who_is_who":
        seed = anatomy.seed or 0
        shown = msgspec.structs.replace(
            where,
            exposed=EXPOSED[seed % len(EXPOSED)],
            lifted_mm=TRACTION_MM * (seed // len(EXPOSED) % 2),
        )
        exercise = _exercise(name, WhoIsWho(POINTS), [], shown)
        # Judged once all is told.
        limits = (msgspec.structs.replace(each, at_end=True) for each in exercise.limits)
        return msgspec.structs.replace(exercise, limits=tuple(limits))
    kinds = {each.name: each.kind for each in anatomy.tube}
    artery = next((each for each in safety.entering if kinds[each] == "artery"), None)
    if artery is None:
        return None
    exercise = _exercise(
        name,
        StopBleeding(STOPPED_SECONDS),
        [],
        msgspec.structs.replace(where, torn=artery),
    )
    exercise = msgspec.structs.replace(exercise, about=(artery,))
    if not _passes(session, exercise, MANNERS[name]["good"]):
        return None
    most = EXERCISES[name].spare * session.metrics()["blood_lost_ml"]
    return exercise.with_limits({"blood_lost_ml": float(round(most))})


def _of_free_duct(duct: GraspedBeam) -> tuple[Exercise, ...]:
    """Return the exercises for a free duct; none if it cannot break."""
    event = duct.breaks_at
    working, most = (duct.load_at(1.0 / each) for each in (WORKING_SAFETY, LEAST_SAFETY))
    if event is None or working is None or most is None:
        return ()
    deflections, forces = duct.curve(60)
    low, held = (HOLD_FRACTION + sign * HOLD_TOLERANCE for sign in (-1.0, 1.0))
    low, held = low * event.deflection, held * event.deflection
    needed = float(np.interp(held, deflections, forces))
    middle = working.deflection
    high = (1.0 + BAND_FRACTION) * middle
    # At this rate the largest allowed force would grow to the break within a reaction time.
    rate = (event.force - most.force) / REACTION_SECONDS
    return (
        _exercise(
            "hold_stretch",
            Stay("deflection_mm", low, held, HOLD_SECONDS),
            [Limit("maximum_force_N", HOLD_FORCE * needed)],
        ),
        _exercise("approach_break", Stay("distance_to_break", 0.0, MARGIN, STAY_SECONDS), []),
        _exercise(
            "gentle_lifts",
            Stay(
                "deflection_mm", (1.0 - BAND_FRACTION) * middle, high, LIFT_SECONDS,
                repeats=LIFTS, return_below=SLACK_FRACTION * middle,
            ),
            [
                Limit("maximum_force_N", most.force),
                Limit("smallest_distance_to_break", 1.0 - 1.0 / LEAST_SAFETY),
                Limit("overshoot", (most.deflection - high) / middle),
                Limit("maximum_loading_rate_N_per_s", rate),
                Limit("mean_absolute_nonzero_force_N", working.force, at_end=True),
            ],
        ),
    )  # fmt: skip


def _in_bed(session: Session, *, relaxes: bool) -> dict[str, Exercise | str]:
    """Return the exercises in a bed; the scar's, and others in a bed with one, in their own."""
    specimen = replace(session.specimen, threshold_MPa=session.tissue.threshold, relaxation=relaxes)
    bed = specimen.bed
    assert bed is not None  # noqa: S101 (the caller's)
    plain = bed if bed.patch is None else bed_named("normal")
    scarred = bed if bed.patch is not None else bed_named(SCAR)
    beds = zip(IN_BED, (plain, plain, scarred), strict=True)
    return {name: _offered(replace(specimen, bed=each), name) for name, each in beds}


@lru_cache(maxsize=32)
def _offered(specimen: Specimen, name: str) -> Exercise | str:
    """Return an exercise with its limits and a seed, or why good hands cannot do it."""
    bed, seed, kind = specimen.bed, specimen.bed_seed, EXERCISES[name]
    relaxes = bool(specimen.relaxation)
    assert bed is not None  # noqa: S101 (the caller's)
    span = specimen.beam.span
    goal, opened = _goal(span, name, bed)
    session = Session(specimen, vertices=FEW)

    def asked(bed: BedPreset, seed: int, *limits: Limit) -> Exercise:
        where = Opening(
            named_or_whole(bed), seed, opened, divided=opened is not None, relaxes=relaxes
        )
        return _exercise(name, goal, limits, where)

    even = msgspec.structs.replace(
        asked(msgspec.structs.replace(bed, scatter=0.0), 1), limits=(Limit("tear", 0),)
    )
    good = MANNERS[name]["good"]
    if not _passes(session, even, good):
        outcome = session.run.outcome
        ended = session.run.standing if outcome is None else outcome.reason
        return f"good hands do not pass in an even bed: {ended}"
    needed = session.metrics()
    ratio = kind.spare * needed["peak_stress_ratio"]
    if kind.lifted:
        _passes(session, even, Lift())
        ratio = max(ratio, kind.lifted * session.metrics()["peak_stress_ratio"])
    if ratio > LOOSEST:
        return f"its limit of stress would be {100.0 * ratio:.0f} % of the break"
    hidden = round(HIDDEN_FRACTION * session.spatial.beam.strands.count / span * goal.length_mm)
    limits = [Limit("peak_stress_ratio", ratio), Limit("strands_broken_out_of_sight", hidden)]
    if kind.spare_force is not None:
        force = kind.spare_force * needed["maximum_instrument_force_N"]
        limits.append(Limit("maximum_instrument_force_N", force))
    exercises = (asked(bed, each, *limits) for each in range(seed, seed + MOST_SEEDS))
    passed = next((each for each in exercises if _passes(session, each, good)), None)
    return passed or f"good hands pass with none of {MOST_SEEDS} seeds of the bed's scatter"


def _goal(span: float, name: str, bed: BedPreset) -> tuple[FreeLength, tuple[float, float] | None]:
    """Return what is to be freed, and what is free at the start, mm from the first clamp."""
    match name:
        case "window":
            return FreeLength(WINDOW_FRACTION * span, 0.0, span, one_stretch=True), None
        case "follow_front":
            front = (1.0 - OPENED_FRACTION) * span
            return FreeLength(FOLLOW_FRACTION * span, 0.0, front), (front, span)
        case "free_scar":
            assert bed.patch is not None  # noqa: S101 (the caller has looked)
            a, b = bed.patch.from_fraction * span, bed.patch.to_fraction * span
            return FreeLength(FREED_FRACTION * (b - a), a, b), None
        case _:
            raise ValueError(f"exercise '{name}' has no goal in a bed")


def _passes(session: Session, exercise: Exercise, technique: Technique) -> bool:
    """Do an exercise with scripted hands; return whether it is passed."""
    session.start_exercise(exercise)
    perform(session, technique)
    return session.run.outcome is not None and session.run.outcome.passed
