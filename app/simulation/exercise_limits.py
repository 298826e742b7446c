"""Exercises for a duct in its bed, with limits that follow from both.

Good hands (`app.simulation.scripted_hands`) do each exercise beforehand, in the same bed with
strands of even strength: what they need, with `SPARE` on top, is the limit. In the window they
hardly load the duct; there the limit is `WINDOW_PART` of what pulling it off takes. Errors of
`FAILING` fail it too: an exercise is not to be passed by what it does not teach. The bed's seed is
the first one with which good hands pass.
"""

from dataclasses import replace
from functools import lru_cache

import msgspec

from app.simulation.bed_preset import BedPreset, bed_named, named_or_whole
from app.simulation.bed_trial import BedTrial
from app.simulation.dissection_measures import DissectionMeasures, DissectionMeasureTaker
from app.simulation.exercise import BedExercise, BedExerciseName, Outcome
from app.simulation.inputs import HOLDING, INSTRUMENTS, Instrument
from app.simulation.scripted_hands import MANNERS, BedManner, script
from app.simulation.spatial_tissue import FREED_PART, SpatialTissue
from app.simulation.specimen import Specimen

__all__ = ["bed_exercises", "rehearsed"]

SPARE: dict[BedExerciseName, float] = {"window": 1.1, "follow_front": 1.2, "free_scar": 1.12}
SPARE_FORCE = 1.5
"""Limits of the stress and of an instrument's force, over what good hands need in an even bed:
about four standard deviations over beds of 20 seeds, and the strongest place of a scattered bed
asks for more than an even one (docs/measures.md)."""
WITH_JAWS = (
    "blind_stab", "jumping_jaws", "stirring", "ploughing", "fast_in_tissue", "fast_pull",
)  # fmt: skip
FAILING: dict[BedExerciseName, tuple[str, ...]] = {
    "window": WITH_JAWS,
    "follow_front": (
        "ahead_of_front", "repeated_holds", "one_go", "leaning", "behind_front", "fast_pull",
    ),
    "free_scar": ("no_traction", "traction_lost", *WITH_JAWS),
}  # fmt: skip
"""Error classes that fail an exercise: what it teaches cannot be passed by."""
WINDOW_PART = 1.0 / 3.0
# Lengths over the span: of the window to be freed, of a divided duct's free end, and of what is to
# be freed from there on.
WINDOW_SHARE, OPENED_SHARE, FOLLOW_SHARE = 0.25, 0.12, 0.6
# Strands that may tear out of sight, of those to be parted.
HIDDEN_PART = 0.1
LOOSEST = 0.95
"""An exercise whose limit of stress comes out above this part of the break is not offered."""
MOST_SEEDS = 20
SCAR = "scar"


def bed_exercises(specimen: Specimen) -> tuple[BedExercise, ...]:
    """Return the exercises for a duct; the scar's, and others in a bed with one, in their own."""
    bed = specimen.bed
    assert bed is not None  # noqa: S101 (the caller's)
    plain = bed if bed.patch is None else bed_named("normal")
    scarred = bed if bed.patch is not None else bed_named(SCAR)
    found = [
        _offered(replace(specimen, bed=each), name)
        for name, each in (("window", plain), ("follow_front", plain), ("free_scar", scarred))
    ]
    return tuple(each for each in found if each is not None)


@lru_cache(maxsize=32)
def _offered(specimen: Specimen, name: BedExerciseName) -> BedExercise | None:
    """Return an exercise with its limits and a seed, or None where good hands cannot do it."""
    bed, seed = specimen.bed, specimen.bed_seed
    assert bed is not None  # noqa: S101 (the caller's)
    span = specimen.beam.span
    goal = _goal(span, name, bed, seed)
    even = SpatialTissue(
        replace(specimen, bed=msgspec.structs.replace(bed, scatter=0.0), bed_seed=1)
    )
    manners = MANNERS[name]
    needed, outcome = rehearsed(even, goal, manners["good"])
    if not outcome.passed:
        return None
    share = SPARE[name] * needed.peak_stress_ratio
    if name == "window":
        pulled, _ = rehearsed(even, goal, BedManner(pulls=True))
        share = max(share, WINDOW_PART * pulled.peak_stress_ratio)
    if share > LOOSEST:
        return None
    force = SPARE_FORCE * needed.maximum_instrument_force_N
    strands = even.beam.strands.count / span
    for each in range(seed, seed + MOST_SEEDS):
        exercise = msgspec.structs.replace(
            goal,
            bed_seed=each,
            stress_ratio_limit=share,
            time_to_break_limit_s=0.0,
            out_of_sight_limit=round(HIDDEN_PART * strands * goal.free_mm),
            instrument_force_limit_N=force if name == "free_scar" else None,
            errors=dict.fromkeys(FAILING[name], 0),
        )
        duct = SpatialTissue(replace(specimen, bed_seed=each))
        if rehearsed(duct, exercise, manners["good"])[1].passed:
            return exercise
    return None


def _goal(span: float, name: BedExerciseName, bed: BedPreset, seed: int) -> BedExercise:
    """Return what is to be freed, with limits that hardly limit and no errors that fail it."""
    a, b, free, opened = 0.0, span, WINDOW_SHARE * span, None
    instruments: tuple[Instrument, ...] = INSTRUMENTS
    if name == "follow_front":
        b, free = (1.0 - OPENED_SHARE) * span, FOLLOW_SHARE * span
        opened, instruments = (b, span), HOLDING
    elif name == "free_scar":
        assert bed.patch is not None  # noqa: S101 (the caller has looked)
        a, b = bed.patch.from_share * span, bed.patch.to_share * span
        free = FREED_PART * (b - a)
    return BedExercise(
        name=name,
        bed=named_or_whole(bed),
        bed_seed=seed,
        free_mm=free,
        from_mm=a,
        to_mm=b,
        instruments=instruments,
        stress_ratio_limit=0.999,
        time_to_break_limit_s=0.0,
        out_of_sight_limit=10**6,
        opened_mm=opened,
        divided=opened is not None,
        one_stretch=name == "window",
    )


def rehearsed(
    duct: SpatialTissue, exercise: BedExercise, manner: BedManner
) -> tuple[DissectionMeasures, Outcome]:
    """Do an exercise with scripted hands on a duct by itself."""
    taker = DissectionMeasureTaker(duct, exercise)
    trial = BedTrial(exercise, taker)
    duct.prepare(exercise)
    taker.start()
    for _ in script(duct, duct, exercise, manner):
        taker.take(moved=duct.advance())
        trial.take()
        if trial.outcome is not None:
            return taker.measures(), trial.outcome
    return taker.measures(), Outcome(False, f"The hands were done with {trial.standing}.")
