"""Anatomies of a study that are pulled, or that scripted hands dissect, one after the other."""

import math
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from app.anatomy import Anatomy, checked
from app.simulation import (
    FEW,
    TICK_SECONDS,
    Script,
    Session,
    Specimen,
    Step,
    performed,
)
from app.study.ducts import Block, groups
from app.study.inputs import ANATOMY
from app.study.plan import Plan

FIRST_TORN = "first_torn"
"""Column of the tube that tears first; null where none does."""
SPEED = 8.0
"""mm/s, of a pull that gives none: the most at which a page's hand draws a tube."""
NUMBERS = (
    "tear_s", "first_torn_mm", "break_force_N", "break_deflection_mm", "peak_stress_ratio",
    "strands_broken", "critical_view", "lost_blood_ml", "lost_bile_ml",
)  # fmt: skip


def solve_anatomies(
    plan: Plan, block: Block, seeds: NDArray[np.int64]
) -> tuple[dict[str, Any], list[str]]:
    """Return the columns of anatomies of so many seeds, and a fault, or '', for each."""
    # Columns of words are (words, index), with an index of -1 where there is none.
    names = [each for each in NUMBERS if each != "break_deflection_mm" or _pulled(block)]
    outputs: dict[str, Any] = {name: np.full(block.count, np.nan) for name in names}
    faults, torn = [""] * block.count, [""] * block.count
    for words, which in groups(block):
        for i in which.tolist():
            numbers = {
                name.removeprefix(ANATOMY): float(row[i]) for name, row in block.numbers.items()
            }
            given = {name.removeprefix(ANATOMY): word for name, word in words.items()}
            try:
                torn[i], found = _performed(plan, given, numbers, int(seeds[i]))
            except ValueError as error:
                faults[i] = str(error)
                continue
            for name, value in found.items():
                outputs[name][i] = value
    tubes = sorted({*torn} - {""})
    at = np.array([tubes.index(each) if each else -1 for each in torn], dtype=np.int64)
    return {FIRST_TORN: (tuple(tubes), at), "case": seeds, **outputs}, faults


def _pulled(block: Block) -> bool:
    return f"{ANATOMY}script" not in block.words


def _performed(
    plan: Plan, words: dict[str, str], numbers: dict[str, float], seed: int
) -> tuple[str, dict[str, float]]:
    """Return which tube of a case tears first, '' if none, and what else comes of it."""
    anatomy = checked(_changed(plan.anatomy(words.get("name"), seed), numbers))
    session = Session(Specimen.of_anatomy(anatomy), vertices=FEW)
    tissue = session.spatial
    place = np.zeros(3)  # from which the grasper pulls, mm
    if "script" in words:
        done = performed(plan.script(words["script"]), session)
    else:
        held = performed(Script(step=_grasp(words["tube"], numbers["at_mm"])), session)
        if held.refused:
            raise ValueError(f"nothing was pulled: {held.refused[0]}")
        place = tissue.hands[0].place.copy()
        done = performed(Script(step=[_pull(numbers)]), session)
    reading, tear, view = session.reading(), done.tear, done.view
    assert view is not None  # noqa: S101 (of a performance that is over)
    found = {
        "peak_stress_ratio": reading.peak_stress_ratio,
        "strands_broken": float(reading.broken),
        "critical_view": float(view.total),
        **{f"lost_{each.name}_ml": each.lost_ml for each in reading.fluids},
    }
    if tear is None:
        return "", found
    found |= {
        "tear_s": tear.tick * TICK_SECONDS,
        "first_torn_mm": tear.station,
        "break_force_N": done.tear_force,
    }
    if "script" not in words:
        found["break_deflection_mm"] = math.dist(tissue.hands[0].place.tolist(), place.tolist())
    return tear.tube, found


def _changed(anatomy: Anatomy, numbers: dict[str, float]) -> Anatomy:
    """Return an anatomy with walls and tissue of a draw."""
    tubes = [
        msgspec.structs.replace(
            tube,
            modulus_MPa=tube.modulus_MPa * numbers.get("modulus_factor", 1.0),
            strength_MPa=numbers.get(f"{tube.kind}_strength_MPa", tube.strength_MPa)
            * numbers.get("strength_factor", 1.0),
        )
        for tube in anatomy.tube
    ]
    layers = [
        msgspec.structs.replace(layer, factor=layer.factor * numbers.get("toughness_factor", 1.0))
        for layer in anatomy.layer
    ]
    return msgspec.structs.replace(anatomy, tube=tubes, layer=layers)


def _grasp(tube: str, at: float) -> list[Step]:
    return [
        Step(do="take", instrument="grasper"),
        Step(do="grab", tube=tube, at_mm=at),
    ]


def _pull(numbers: dict[str, float]) -> Step:
    """Return a pull, which ends where something tears."""
    azimuth, elevation = (
        math.radians(numbers.get(name, otherwise))
        for name, otherwise in (("azimuth_deg", 0.0), ("elevation_deg", 90.0))
    )
    far, level = numbers["pull_mm"], math.cos(elevation)
    direction = level * math.cos(azimuth), level * math.sin(azimuth), math.sin(elevation)
    x, y, z = (far * each for each in direction)
    return Step(
        do="lead", by_mm=(x, y, z), speed_mm_per_s=numbers.get("speed_mm_per_s", SPEED), stop_at=1.0
    )
