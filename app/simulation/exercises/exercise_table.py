"""The exercises that the trainer has, as far as they are the same on every duct."""

from dataclasses import dataclass

from app.simulation.inputs.inputs import ALL_INSTRUMENTS, HOLDING, INSTRUMENTS, Instrument


@dataclass(frozen=True)
class ExerciseKind:
    """An exercise as it is on every duct.

    In a bed the limits are `spare` times the stress that good hands need in an even one, and
    `spare_force` times an instrument's force: about four standard deviations over beds of 20 seeds,
    and the strongest place of a scattered bed asks for more than an even one (docs/measures.md).
    At least `lifted` of the stress of hands that lift the duct off instead is allowed.
    """

    title: str
    method: str
    errors: tuple[str, ...]  # classes that fail it
    instruments: tuple[Instrument, ...] = INSTRUMENTS
    in_hand: tuple[Instrument, ...] = ()  # at the start, if not the usual
    first_hand: int = 0  # that is led at the start
    errors_at_end: tuple[str, ...] = ()  # that fail it once all else is done
    time_limit_s: float = 60.0
    spare: float = 1.0
    spare_force: float | None = None
    lifted: float = 0.0


TOO_FAST = ("fast_pull", "near_break_fast")
WITH_JAWS = (
    "blind_stab", "jumping_jaws", "stirring", "ploughing", "fast_in_tissue", "fast_pull",
    "instrument_on_wall",
)  # fmt: skip
EXERCISES: dict[str, ExerciseKind] = {
    "window": ExerciseKind(
        "Open a window", "pass the dissector behind it and open the jaws",
        WITH_JAWS, in_hand=("hook", "dissector"), first_hand=1, time_limit_s=120.0, spare=1.1,
        lifted=1.0 / 3.0,
    ),
    "follow_front": ExerciseKind(
        "Follow the front",
        "it is divided and its end is free; take hold where it is free no more, lift, let go, "
        "and take hold again",
        ("ahead_of_front", "repeated_holds", "one_go", "leaning", "behind_front", *TOO_FAST),
        HOLDING, errors_at_end=("unseen",), time_limit_s=120.0, spare=1.2,
    ),
    "free_scar": ExerciseKind(
        "Free a scar with two hands",
        "hold it up with one hand; with the other pass the closed dissector behind the duct, just "
        "beside the scar, and open the jaws there",
        ("no_traction", "traction_lost", "leaning", *WITH_JAWS), in_hand=("grasper", "dissector"),
        errors_at_end=("unseen", "near_break_fast"), time_limit_s=120.0, spare=1.4, spare_force=1.5,
    ),
    "first_view": ExerciseKind(
        "First view",
        "part what holds the tubes of the triangle, with the right angle behind and between them; "
        "what holds the gallbladder to the liver counts, too, and parts with the dissector",
        ("wrong_structure", "bleeding"), ALL_INSTRUMENTS, in_hand=("grasper", "right angle"),
        first_hand=1, time_limit_s=1200.0,
    ),
    "critical_view": ExerciseKind(
        "Critical view",
        "show the two structures that alone enter the gallbladder, clear the triangle and free "
        "the lower third of the cystic plate, between gallbladder and liver",
        (
            "wrong_structure", "mistaken", "clip_wrong_tube", "divided_before_view", "clip_short",
            "bleeding",
        ),
        ALL_INSTRUMENTS, in_hand=("grasper", "right angle"), first_hand=1, time_limit_s=1800.0,
    ),
    "who_is_who": ExerciseKind(
        "Who is who",
        "choose a structure and press it in the picture; the scope may be moved, no hand is",
        ("mistaken", "named_unsafe", "held_back"),
        ALL_INSTRUMENTS, time_limit_s=180.0,
    ),
    "stop_bleeding": ExerciseKind(
        "Stop a bleeding",
        "the cystic artery tears with your first touch; bring the open clip applier past it, a jaw "
        "on either side, between the tear and where its blood comes from, and clip it",
        ("wrong_structure", "clip_wrong_tube", "clip_astray", "unattended_bleeding", "blind_stab"),
        ALL_INSTRUMENTS, in_hand=("grasper", "clip applier"), first_hand=1, time_limit_s=30.0,
        spare=4.0,
        errors_at_end=(
            "tension_on_vessel", "instrument_on_wall", "fast_in_tissue", "jumping_jaws", "unseen",
        ),
    ),
    "hold_stretch": ExerciseKind("Hold a stretch", "", TOO_FAST),
    "approach_break": ExerciseKind("Approach the break", "", TOO_FAST),
    "gentle_lifts": ExerciseKind("Dissect gently", "", TOO_FAST, time_limit_s=90.0),
}  # fmt: skip
"""What the trainer offers, by name."""
