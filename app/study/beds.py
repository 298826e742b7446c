"""Ducts of a study that a hook lifts off their beds, one after the other."""

from typing import Any

import msgspec
import numpy as np

from app.simulation import (
    ASSUMED_PRESET,
    THESIS_PRESET,
    BedPreset,
    Preset,
    Specimen,
    bed_named,
    pull_and_hold,
)
from app.study.ducts import (
    Block,
    Outputs,
    groups,
    strength_of,
)
from app.study.inputs import BED
from app.study.plan import Plan
from organ_geometry import Organ
from physics import Exact, NoEquilibrium
from physics.bed import Bed, Hand, History, SpaceBeam

STEPS, ELEMENTS = 40, 40
OUTPUTS = (
    "threshold_MPa",
    "largest_force_N",
    "freed_mm",
    "work_mJ",
    "least_distance_to_break",
    "break_force_N",
    "break_deflection_mm",
    "last_lift_mm",
    "last_force_N",
    "last_distance_to_break",
)


def solve_beds(plan: Plan, block: Block) -> tuple[Outputs, list[str]]:
    """Return the outputs of ducts that are lifted off their beds, and a fault, or '', for each."""
    outputs = {name: np.full(block.count, np.nan) for name in OUTPUTS}
    faults = [""] * block.count
    for words, which in groups(block):
        for i in which.tolist():
            one = block.subset(np.array([i]))
            try:
                found = _lifted(plan, words, one)
            except ValueError as error:
                faults[i] = str(error)
                continue
            for name, value in found.items():
                outputs[name][i] = value
    return outputs, faults


def bed_of(preset: BedPreset, given: dict[str, float]) -> BedPreset:
    """Return a bed with other numbers, by the names of the inputs without `bed.`."""
    # For an area of the layer: strength 2 G / failure_mm, stiffness that over yield_mm.
    failure = given.get("failure_mm", preset.failure_mm)
    length = given.get("yield_mm", preset.yield_mm)
    toughness = given.get("toughness_J_per_m2", preset.toughness_J_per_m2)
    if "strength_kPa" in given:
        toughness = 0.5 * given["strength_kPa"] * failure
    if "stiffness_kPa_per_mm" in given:
        if "strength_kPa" in given:
            length = given["strength_kPa"] / given["stiffness_kPa_per_mm"]
        else:
            toughness = 0.5 * given["stiffness_kPa_per_mm"] * length * failure
    if not length <= failure:
        raise ValueError(f"strands yield at {length:.4g} mm, after they part at {failure:.4g} mm")
    names = {"scatter", "slack_mm", "gap_mm", "around_deg"} & set(given)
    return msgspec.structs.replace(
        preset,
        toughness_J_per_m2=toughness,
        yield_mm=length,
        failure_mm=failure,
        **{name: given[name] for name in names},
    )


def _lifted(plan: Plan, words: dict[str, str], one: Block) -> dict[str, float]:
    numbers = {name: float(row[0]) for name, row in one.numbers.items()}
    of_bed = {key.removeprefix(BED): v for key, v in numbers.items() if key.startswith(BED)}
    organ = plan.organ(words["organ"]) if "organ" in words else None
    preset = plan.preset(words.get("preset", THESIS_PRESET if organ is None else ASSUMED_PRESET))
    if "law" in words:
        law = words["law"].removesuffix(" with shear")
        constant = numbers["stiffening"] if law == "exponential" else None
        preset = msgspec.structs.replace(preset, law=law, stiffening=constant)
    elements = int(of_bed.get("elements", ELEMENTS))
    hook = of_bed.get("hook_mm")
    specimen = Specimen.of_sections(
        _preset_of(preset, numbers),
        organ,
        bed_of(bed_named(words.get("bed.name", "normal")), of_bed),
        bed_seed=int(of_bed.get("seed", 1)),
        threshold_MPa=_threshold(preset, organ, numbers),
        relaxation="step_s" in of_bed,
    )
    at = 0.5 * specimen.beam.span if hook is None else hook
    beam = specimen.space_beam(elements=elements, nodes_at=[at])
    strands = int(of_bed["strands"]) if "strands" in of_bed else None
    until = of_bed.get("until")
    history = lift(
        beam,
        specimen.layer(beam, strands),
        at=at,
        to=of_bed["lift_mm"],
        steps=int(of_bed.get("steps", STEPS)),
        until=None if until is None else (1.0 - until) * specimen.threshold,
        step_seconds=of_bed.get("step_s"),
        hold_seconds=of_bed.get("hold_s"),
        relaxing=specimen.relaxing(),
    )
    return _read(history, specimen.threshold)


def _preset_of(preset: Preset, numbers: dict[str, float]) -> Preset:
    """Return a preset with a duct's own numbers."""
    kind = preset.beam
    sizes = {name: numbers[name] for name in kind.__struct_fields__ if name in numbers}
    names = ("modulus_MPa", "poisson_ratio")
    changed = {name: numbers[name] for name in names if name in numbers}
    if "break_force_N" in numbers:
        changed |= {"break_stress_MPa": None, "break_force_N": numbers["break_force_N"]}
    return msgspec.structs.replace(preset, beam=msgspec.structs.replace(kind, **sizes), **changed)


def _threshold(preset: Preset, organ: Organ | None, numbers: dict[str, float]) -> float | None:
    """Return the threshold, MPa; None where it follows from the duct's own force at break."""
    if "break_force_N" in numbers:
        return None
    given = numbers.get("break_stress_MPa", preset.break_stress_MPa)
    return strength_of(preset, organ, Exact(preset.law_in_space)) if given is None else given


def lift(
    beam: SpaceBeam, bed: Bed | None, *, at: float, to: float, steps: int, **held: Any
) -> History:
    """Lift a beam off a bed by a hook at a station, mm; `held` is for `pull_and_hold`."""
    hand = Hand(at=at, path=((0.0, 0.0, to),), steps=steps)
    try:
        return pull_and_hold(beam, bed, hand, **held)
    except NoEquilibrium as lost:
        raise ValueError(f"no equilibrium: {lost}") from None


def _read(history: History, strength: float) -> dict[str, float]:
    assert history.stress is not None  # noqa: S101 (a duct has a wall)
    forces = np.sqrt((history.forces[:, 0] ** 2).sum(axis=1))
    lifts = history.hands[:, 0, 2]
    found = {
        "threshold_MPa": strength,
        "largest_force_N": float(forces.max()),
        "freed_mm": float(history.freed[-1]),
        "work_mJ": float(history.work[-1]),
        "least_distance_to_break": 1.0 - float(history.stress.max()) / strength,
        "last_lift_mm": float(lifts[-1]),
        "last_force_N": float(forces[-1]),
        "last_distance_to_break": 1.0 - float(history.stress[-1]) / strength,
    }
    over = np.flatnonzero(history.stress >= strength)
    if over.size:
        # Between the steps before and after, in proportion to the stress.
        stress, force, lifted = (
            np.concatenate([[0.0], row]) for row in (history.stress, forces, lifts)
        )
        k = int(over[0])
        fraction = (strength - stress[k]) / (stress[k + 1] - stress[k])
        found["break_force_N"] = float(force[k] + fraction * (force[k + 1] - force[k]))
        found["break_deflection_mm"] = float(lifted[k] + fraction * (lifted[k + 1] - lifted[k]))
    return found
