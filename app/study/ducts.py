# Ducts are either `Ducts` or beams, which is looked at where they differ.
# pyright: reportUnknownVariableType=false, reportUnknownMemberType=false
# pyright: reportUnknownArgumentType=false
"""A block of ducts of a study: what each bears, by its own inputs."""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import lru_cache

import msgspec
import numpy as np
from numpy.typing import NDArray

from app.simulation import (
    ASSUMED_PRESET,
    THESIS_PRESET,
    OrganBeam,
    Preset,
    RoundBeam,
    organ_beam,
)
from app.study.plan import Plan
from organ_geometry import Organ
from physics import Beam, Exact, Theory, VaryingBeam, law_named, theory_named
from physics.many import Beams, Ducts, SolvedDucts, solve_many

Row = NDArray[np.float64]
Outputs = dict[str, Row]
"""(N,) rows by name; nan where there is none."""

# A grasp is this part of the span from a clamp at least.
FIRST_FRACTION = 1e-9


class Block:
    """Inputs of N ducts: (N,) numbers by name, and words by name with an index for each duct."""

    def __init__(
        self,
        count: int,
        numbers: Mapping[str, Row],
        words: Mapping[str, tuple[tuple[str, ...], NDArray[np.int64]]],
    ) -> None:
        self.count = count
        self.numbers = numbers
        self.words = words

    def number(self, name: str, otherwise: float | None) -> Row:
        """Return an input, or what it is where it is not given; nan for None."""
        if name in self.numbers:
            return self.numbers[name]
        return np.full(self.count, np.nan if otherwise is None else otherwise)

    def subset(self, which: NDArray[np.int64]) -> "Block":
        """Return some of the ducts."""
        return Block(
            which.size,
            {name: row[which] for name, row in self.numbers.items()},
            {name: (values, at[which]) for name, (values, at) in self.words.items()},
        )


def groups(block: Block) -> Iterator[tuple[dict[str, str], NDArray[np.int64]]]:
    """Give the words that ducts have in common, and the indices of these ducts."""
    names = list(block.words)
    if not names:
        yield {}, np.arange(block.count)
        return
    codes = np.stack([block.words[name][1] for name in names])
    kinds, which = np.unique(codes, axis=1, return_inverse=True)
    for k in range(kinds.shape[1]):
        words = {name: block.words[name][0][int(kinds[i, k])] for i, name in enumerate(names)}
        yield words, np.flatnonzero(which.ravel() == k)


def solve_pulls(plan: Plan, block: Block) -> tuple[Outputs, list[str]]:
    """Return the outputs of ducts that are pulled free of a bed, and a fault, or '', for each."""
    by_force, by_deflection = "force_N" in block.numbers, "deflection_mm" in block.numbers
    loaded = by_force or by_deflection
    names = ["threshold_MPa", "break_force_N", "break_deflection_mm", "break_station_mm"]
    if loaded:
        names.append("deflection_mm" if by_force else "force_N")
        names += ["normal_stress_MPa", "bending_stress_MPa", "distance_to_break"]
    outputs = {name: np.full(block.count, np.nan) for name in names}
    faults = [""] * block.count
    for words, which in groups(block):
        some = block.subset(which)
        for theory, at in _theories(words, some):
            few, rows = some.subset(at), which[at]
            sound, ducts, thresholds, unsound = _set_up(plan, words, theory, few)
            for i, why in unsound.items():
                faults[int(rows[i])] = why
            if not sound.size:
                continue
            load = few.subset(sound).numbers
            found = solve_many(
                theory,
                ducts,
                thresholds,
                force=load.get("force_N"),
                deflection=load.get("deflection_mm"),
            )
            rows = rows[sound]
            for name, row in _named(found, thresholds, by_force=by_force).items():
                if name in outputs:
                    outputs[name][rows] = row
            if loaded:
                for i in np.flatnonzero(np.isnan(found.normal_stress)):
                    faults[int(rows[i])] = "no equilibrium under the load"
    return outputs, faults


def _named(found: SolvedDucts, thresholds: Row, *, by_force: bool) -> Outputs:
    stress = found.normal_stress + found.bending_stress
    return {
        "threshold_MPa": thresholds,
        "break_force_N": found.break_force,
        "break_deflection_mm": found.break_deflection,
        "break_station_mm": found.break_station,
        **({"deflection_mm": found.deflection} if by_force else {"force_N": found.force}),
        "normal_stress_MPa": found.normal_stress,
        "bending_stress_MPa": found.bending_stress,
        "distance_to_break": 1.0 - stress / thresholds,
    }


def _theories(words: dict[str, str], block: Block) -> Iterator[tuple[Theory, NDArray[np.int64]]]:
    """Give the theories of ducts with the same words, which differ by one constant at most."""
    name, law = words.get("theory", "exact"), words.get("law", "linear")
    constant = {"cubic": "q", "exact": "stiffening" if law == "exponential" else ""}.get(name, "")
    if constant not in block.numbers:
        yield _theory(name, law, None), np.arange(block.count)
        return
    values, which = np.unique(block.numbers[constant], return_inverse=True)
    for k, value in enumerate(values.tolist()):
        yield _theory(name, law, value), np.flatnonzero(which == k)


def _theory(name: str, law: str, constant: float | None) -> Theory:
    """Return a theory by its name, the exact one with a law; q or the law's stiffening if given."""
    if name != "exact":
        return theory_named(name, q=constant)
    plain = law.removesuffix(" with shear")
    return Exact(law_named(plain, shear=plain != law, stiffening=constant))


def _set_up(
    plan: Plan, words: dict[str, str], theory: Theory, block: Block
) -> tuple[NDArray[np.int64], Ducts | Beams, Row, dict[int, str]]:
    """Return which ducts can be solved, these, their thresholds, and why the others cannot."""
    organ = plan.organ(words["organ"]) if "organ" in words else None
    preset = plan.preset(words.get("preset", THESIS_PRESET if organ is None else ASSUMED_PRESET))
    if organ is None:
        ducts, unsound = round_ducts(preset, block)
    else:
        ducts, unsound = _organ_ducts(organ, preset, theory, block)
    sound = np.array([i for i in range(block.count) if i not in unsound], dtype=np.int64)
    if not sound.size:
        return sound, ducts, np.empty(0), unsound
    block = block.subset(sound)
    thresholds = block.number("break_stress_MPa", preset.break_stress_MPa)
    if "break_force_N" in block.numbers:
        # The break is known by its force at mid-span: the stress that the theory has there.
        force = block.numbers["break_force_N"]
        middle = replace(ducts, grasp=0.5 * ducts.span)
        there = solve_many(theory, middle, force=force)
        thresholds = there.normal_stress + there.bending_stress
    elif "break_stress_MPa" not in block.numbers and preset.break_stress_MPa is None:
        thresholds = np.full(block.count, strength_of(preset, organ, theory))
    return sound, ducts, thresholds, unsound


@lru_cache(maxsize=64)
def strength_of(preset: Preset, organ: Organ | None, theory: Theory) -> float:
    """Return the stress at which the preset's own duct breaks, MPa, as this theory reads it."""
    return preset.threshold(
        theory, preset.round_beam() if organ is None else organ_beam(organ, preset)
    )


def round_ducts(preset: Preset, block: Block) -> tuple[Ducts, dict[int, str]]:
    """Return round ducts, of those that are sound, and why the others are none."""
    if not isinstance(preset.beam, RoundBeam):
        raise ValueError(f"preset {preset.name} needs an organ: its beam is the organ's own")
    span = block.number("span_mm", preset.beam.span_mm)
    diameter = block.number("diameter_mm", preset.beam.diameter_mm)
    wall = block.number("wall_mm", preset.beam.wall_mm)
    grasp, unsound = _grasps(block, span)
    for i in np.flatnonzero(wall >= 0.5 * diameter):
        unsound[int(i)] = f"a wall of {wall[i]:.4g} mm leaves no bore in {diameter[i]:.4g} mm"
    bore = np.where(np.isnan(wall), 0.0, diameter - 2.0 * wall)
    rows = (
        span,
        np.pi / 4.0 * (diameter**2 - bore**2),
        np.pi / 64.0 * (diameter**4 - bore**4),
        0.5 * diameter,
        block.number("modulus_MPa", preset.modulus_MPa),
        block.number("poisson_ratio", preset.poisson_ratio),
        grasp,
    )
    sound = np.array([i not in unsound for i in range(block.count)])
    return Ducts(*(row[sound] for row in rows)), unsound


def _grasps(block: Block, span: Row) -> tuple[Row, dict[int, str]]:
    grasp = block.number("grasp_fraction", 0.5) * span
    grasp = block.numbers.get("grasp_mm", grasp)
    wrong = ~((grasp > FIRST_FRACTION * span) & (grasp < (1.0 - FIRST_FRACTION) * span))
    unsound = {
        int(i): f"a grasp at {grasp[i]:.4g} mm is not between clamps {span[i]:.4g} mm apart"
        for i in np.flatnonzero(wrong)
    }
    return grasp, unsound


def _organ_ducts(
    organ: Organ, preset: Preset, theory: Theory, block: Block
) -> tuple[Ducts | Beams, dict[int, str]]:
    """Return beams of an organ's sections, or ducts of its weakest one where a theory knows one."""
    if not isinstance(preset.beam, OrganBeam):
        raise ValueError(f"preset {preset.name} brings its own beam; leave out the organ")
    wall = block.number("wall_mm", preset.beam.wall_mm)
    span = block.number("span_mm", None)
    # A beam of each wall and span; along an axis no two nan, which is none given, are alike.
    given = np.nan_to_num(np.stack([wall, span]), nan=-1.0)
    alike, which = np.unique(given, axis=1, return_inverse=True)
    which = which.ravel()
    shapes: list[Beam] = []
    unsound: dict[int, str] = {}
    for k, (w, s) in enumerate(alike.T.tolist()):
        try:
            beam = _organ_beam(organ, preset, None if w < 0.0 else w, None if s < 0.0 else s)
            assert beam.weakest is not None  # noqa: S101 (an organ's has one)
            shapes.append(beam if theory.takes_all_sections else beam.weakest)
        except ValueError as error:
            shapes.append(Beam.round(span=1.0, diameter=1.0, modulus=1.0))  # of nothing solved
            unsound |= dict.fromkeys(np.flatnonzero(which == k).tolist(), str(error))
    grasp, wrong = _grasps(block, np.array([beam.span for beam in shapes])[which])
    unsound = wrong | unsound
    sound = np.array([i not in unsound for i in range(block.count)])
    modulus = block.number("modulus_MPa", preset.modulus_MPa)
    ratio = block.number("poisson_ratio", preset.poisson_ratio)
    which, rows = which[sound], [each[sound] for each in (modulus, ratio, grasp)]
    if theory.takes_all_sections:
        return Beams(shapes, which, *rows), unsound
    names = ("span", "area", "second_moment", "fibre_distance")
    sizes = [np.array([getattr(beam, name) for beam in shapes])[which] for name in names]
    return Ducts(*sizes, *rows), unsound


@lru_cache(maxsize=4096)
def _organ_beam(
    organ: Organ, preset: Preset, wall: float | None, span: float | None
) -> VaryingBeam:
    assert isinstance(preset.beam, OrganBeam)  # noqa: S101 (the caller has looked)
    kind = sized_beam(organ, preset.beam, wall, span)
    return organ_beam(organ, msgspec.structs.replace(preset, beam=kind))


def sized_beam(organ: Organ, kind: OrganBeam, wall: float | None, span: float | None) -> OrganBeam:
    """Return an organ's beam with another wall and, where one is given, a span in its middle."""
    clamps = kind.clamps_mm
    if span is not None:
        middle = 0.5 * organ.length
        clamps = (middle - 0.5 * span, middle + 0.5 * span)
        if clamps[0] < 0.0:
            raise ValueError(
                f"a span of {span:.4g} mm is longer than the organ, {organ.length:.4g} mm"
            )
    return msgspec.structs.replace(kind, wall_mm=wall, clamps_mm=clamps)
