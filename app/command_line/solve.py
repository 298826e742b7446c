"""`bluntdissect solve`: one beam under one pull, in numbers."""

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from app.command_line.answer import AsJson, answer
from app.command_line.bed_options import BedOptions
from app.command_line.load import (
    PRESET_HELP,
    AxialCoupling,
    Grasp,
    Law,
    Shear,
    Stiffening,
    TheoryName,
    chosen_theory,
    duct_of,
    specimen_from,
    with_law,
)
from app.command_line.load_cases import LOADS, solve_load_case
from app.command_line.shared_options import given_options, options_of

if TYPE_CHECKING:
    from physics import Beam, Theory

# mm, MPa and N: far beyond any tissue, far from where numbers run over.
MOST_LENGTH, MOST_MODULUS, MOST_FORCE = 1e6, 1e9, 1e9
# mm, MPa and diameters: beyond them a unit is most likely wrong, or it is no beam.
SHORTEST_MM, STEEL_MPA, SLENDER = 1.0, 2.1e5, 2.0
OF_ROUND_BEAM = ("span", "diameter", "modulus", "poisson", "wall")
"""Parameters of a beam that no preset brings."""
OF_PULL = (
    *OF_ROUND_BEAM, "grasp", "force", "deflection", "q", "shear", "theory", "load", "angle",
    "pressure",
)  # fmt: skip
"""Parameters of a duct without a bed, and of one in a bed."""
OF_BED = ("output", "step_seconds", "hold", "until")


@options_of(BedOptions)
def solve(
    context: typer.Context,
    preset: Annotated[str | None, typer.Option(help=f"A duct: {PRESET_HELP}")] = None,
    organ: Annotated[
        Path | None,
        typer.Option(
            help="Organ whose own sections are solved, of a --preset that takes them or of an "
            "assumed material; the shipped one if such a preset comes without."
        ),
    ] = None,
    span: Annotated[float | None, typer.Option(help="Round beam: mm between the clamps.")] = None,
    diameter: Annotated[float | None, typer.Option(help="Round beam: diameter, mm.")] = None,
    modulus: Annotated[float | None, typer.Option(help="Round beam: Young's modulus, MPa.")] = None,
    poisson: Annotated[
        float | None, typer.Option(help="Round beam: Poisson's ratio; 0.3 if not given.")
    ] = None,
    grasp: Grasp = None,
    force: Annotated[
        float | None,
        typer.Option(help="The grasper's whole force, N; below zero it pulls the other way."),
    ] = None,
    deflection: Annotated[float | None, typer.Option(help="Deflection of the grasp, mm.")] = None,
    wall: Annotated[
        float | None, typer.Option(help="Round beam: wall, mm; a full bar if not given.")
    ] = None,
    load: Annotated[
        str,
        typer.Option(help="across (by --theory), along, avulsion or inflation (by --law)."),
    ] = "across",
    angle: Annotated[
        float | None, typer.Option(help="Avulsion: between the pull and the axis, degrees.")
    ] = None,
    pressure: Annotated[float | None, typer.Option(help="Inflation: inside, kPa.")] = None,
    theory: TheoryName = "cubic",
    q: AxialCoupling = None,
    shear: Shear = False,
    law: Law = None,
    stiffening: Stiffening = None,
    threshold: Annotated[
        float | None,
        typer.Option(help="Stress at which it breaks, MPa; the preset's own if not given."),
    ] = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Bed: write the history as CSV here.")
    ] = None,
    step_seconds: Annotated[
        float | None,
        typer.Option(
            help="Bed: time that a step takes, s, in which strands and wall relax; none relax if "
            "not given."
        ),
    ] = None,
    hold: Annotated[
        float | None, typer.Option(help="Bed: after --lift hold for so many seconds.")
    ] = None,
    until: Annotated[
        float | None, typer.Option(help="Bed: end --lift at this distance to break, %.")
    ] = None,
    as_json: AsJson = False,
    **options: Any,
) -> None:
    """Solve a beam under a pull: deflection, force, stresses and distance to break.

    Examples: bluntdissect solve --preset thesis-bile-duct --force 3.56, or
    bluntdissect solve --span 50.8 --diameter 8.89 --modulus 0.310264 --deflection 10 --json, or
    bluntdissect solve --bed firm --hook 31 --lift 6, or
    bluntdissect solve --bed firm --hook 31 --lift 6 --step-seconds 0.1 --hold 10
    """
    in_bed = BedOptions(**options)
    in_bed.check(context, of_bed=OF_BED, of_pull=OF_PULL)
    if in_bed.bed is not None:
        _solve_in_bed(
            in_bed.bed,
            in_bed,
            preset,
            organ,
            threshold,
            output,
            (law, stiffening),
            (step_seconds, hold, until),
            as_json=as_json,
        )
        return
    from physics import Exact, Linear

    for name, value, unit, most in (
        ("--span", span, "mm", MOST_LENGTH),
        ("--diameter", diameter, "mm", MOST_LENGTH),
        ("--modulus", modulus, "MPa", MOST_MODULUS),
        ("--force", force, "N", MOST_FORCE),
        ("--deflection", deflection, "mm", MOST_LENGTH),
    ):
        if value is not None and most < abs(value) < math.inf:
            raise ValueError(f"{name} can be at most {most:g} {unit}, got {value:g} {unit}")
    if load == "across" and force is not None and force < 0.0:
        raise ValueError(
            f"--force must be 0 N or more, as a hook pulls and does not push: {force:g} N"
        )
    if load not in LOADS:
        raise ValueError(f"--load must be one of {', '.join(LOADS)}, got {load!r}")
    if load == "across" and not (angle is None and pressure is None):
        raise ValueError("--angle is of --load avulsion and --pressure of --load inflation")
    if load != "across":
        if given_options(context, ("theory", "q", "grasp")):
            raise ValueError(f"--theory, --q and --grasp are not of --load {load}: give --law")
        if law is None and (preset is not None or organ is not None):
            own = with_law(duct_of(preset, organ), law, stiffening)
            law, stiffening = own.law, own.stiffening
        theory, shear = "exact", law in (None, "linear")
    chosen = chosen_theory(theory, q=q, shear=shear, law=law, stiffening=stiffening)
    if preset is not None or organ is not None:
        if given := given_options(context, OF_ROUND_BEAM):
            brings = "--preset" if preset is not None else "--organ"
            raise ValueError(f"{brings} brings its own beam; leave out {', '.join(given)}")
        specimen = specimen_from(preset, organ, theory=chosen, threshold_MPa=threshold)
        duct = _Duct(
            specimen.beam,
            specimen.section,
            specimen.threshold,
            specimen.preset.name,
            specimen.preset.strength if threshold is None else None,
            specimen.doubt,
        )
    else:
        duct = _round_duct(span, diameter, modulus, poisson, wall, threshold)
    if load != "across":
        solve_load_case(
            load,
            duct.beam,
            chosen.law if isinstance(chosen, Exact) else Linear(shear=True),
            duct.threshold,
            force=force,
            elongation=deflection,
            angle=angle,
            pressure=pressure,
            as_json=as_json,
        )
        return
    result, lines = _pull_across(duct, chosen, grasp, force, deflection)
    answer(result, lines, as_json=as_json)


@dataclass(frozen=True, slots=True)
class _Duct:
    """A beam, and what is known of it."""

    beam: "Beam"
    section: str  # which is solved, in words
    threshold: float | None  # MPa
    preset: str | None = None
    strength: str | None = None  # as the preset gives it
    doubt: str = ""  # about its law


def _round_duct(
    span: float | None,
    diameter: float | None,
    modulus: float | None,
    poisson: float | None,
    wall: float | None,
    threshold: float | None,
) -> _Duct:
    from physics import Beam
    from physics.quantity import positive

    if span is None or diameter is None or modulus is None:
        raise ValueError(
            "give a --preset, an --organ, or --span, --diameter and --modulus of a round beam"
        )
    if threshold is not None:
        positive(threshold, "threshold", "MPa")
    beam = Beam.round(
        span=span,
        diameter=diameter,
        modulus=modulus,
        poisson_ratio=0.3 if poisson is None else poisson,
        wall=wall,
    )
    return _Duct(beam, "a full round bar" if wall is None else "a round tube", threshold)


def _pull_across(
    duct: _Duct,
    theory: "Theory",
    grasp: float | None,
    force: float | None,
    deflection: float | None,
) -> tuple[dict[str, object], list[tuple[str, str]]]:
    """Solve a pull across a duct; return what came of it, by key and in words."""
    from physics import break_of, check_rupture, critical_stations, theory_words

    if (force is None) == (deflection is None):
        raise ValueError("give either --force (N) or --deflection (mm)")
    beam, limit = duct.beam, duct.threshold
    at = 0.5 * beam.span if grasp is None else grasp
    stations = critical_stations(beam, at)
    pull = theory.pull(beam, at)
    if force is not None:
        pull.to_force(force)
    elif deflection is not None:
        pull.to_deflection(deflection)
    pulled = pull.sample(stations)
    # Without a threshold any will do to find the place of the highest stress.
    check = check_rupture(pulled, 1.0 if limit is None else limit)
    event = None if limit is None else break_of(theory.pull(beam, pulled.grasp), limit)
    notes = [*([duct.doubt] if duct.doubt else []), *_doubts(beam, pulled.deflection)]
    result: dict[str, object] = {
        "theory": theory.name,
        "preset": duct.preset,
        "section": duct.section,
        "span_mm": beam.span,
        "area_mm2": beam.area,
        "second_moment_mm4": beam.second_moment,
        "fibre_distance_mm": beam.fibre_distance,
        "force_N": pulled.force,
        "deflection_mm": pulled.deflection,
        "normal_stress_MPa": check.normal_stress,
        "bending_stress_MPa": check.bending_stress,
        "station_mm": check.station,
        "side": {1: "pull", -1: "away", 0: None}[check.tension_side],
        "strength": duct.strength,
        "threshold_MPa": limit,
        "distance_to_break": None if limit is None else check.distance_to_break,
        "breaks_at_N": None if event is None else event.force,
        **theory.options,
        **({"notes": notes} if notes else {}),
    }
    side = {1: ", on the side of the pull", -1: ", on the side away from the pull", 0: ""}
    lines = [
        ("theory", theory_words(theory)),
        *([] if duct.preset is None else [("preset", duct.preset)]),
        ("section", duct.section),
        (
            "beam",
            f"span {beam.span:.6g} mm, area {beam.area:.6g} mm^2, second moment "
            f"{beam.second_moment:.6g} mm^4, outer fibre at {beam.fibre_distance:.6g} mm, "
            f"modulus {beam.modulus:.6g} MPa",
        ),
        ("force", f"{pulled.force:.6g} N"),
        ("deflection", f"{pulled.deflection:.6g} mm"),
        ("normal stress", f"{1e3 * check.normal_stress:.6g} kPa"),
        ("bending stress", f"{1e3 * check.bending_stress:.6g} kPa"),
        (
            "highest at",
            f"{check.station:.6g} mm from the first clamp{side[check.tension_side]}",
        ),
    ]
    if limit is None:
        lines.append(("threshold", "none given (--threshold MPa)"))
    else:
        state = "  it breaks" if check.broken else ""
        lines += [
            *([] if duct.strength is None else [("strength as given", duct.strength)]),
            ("threshold", f"{1e3 * limit:.6g} kPa"),
            ("distance to break", f"{100.0 * check.distance_to_break:.2f} %{state}"),
            (
                "breaks at",
                "no force it can be pulled with" if event is None else f"{event.force:.6g} N",
            ),
        ]
    lines += [("note", each) for each in notes]
    return result, lines


def _doubts(beam: "Beam", deflection: float) -> list[str]:
    """Return what makes a beam or a pull doubtful, in sentences: most likely a wrong unit."""
    thick, span = 2.0 * beam.fibre_distance, beam.span
    found: list[str] = []
    if span < SHORTEST_MM:
        found.append(f"a span of {span:g} mm is very short: lengths are in mm, not in m")
    if beam.modulus > STEEL_MPA:
        found.append(
            f"a modulus of {beam.modulus:g} MPa is above that of steel: moduli are in MPa, and "
            "1 MPa is 1000 kPa"
        )
    if span < SLENDER * thick:
        found.append(
            f"a beam of {thick:.4g} mm by {span:.4g} mm is hardly one: theories of beams hold "
            f"where the span is {SLENDER:g} diameters or more"
        )
    if abs(deflection) > span:
        found.append(
            f"the deflection is {abs(deflection) / span:.3g} times the span, where no theory "
            "of beams holds"
        )
    return found


def _solve_in_bed(
    name: str,
    options: BedOptions,
    preset: str | None,
    organ: Path | None,
    threshold: float | None,
    output: Path | None,
    law: tuple[str | None, float | None],
    times: tuple[float | None, float | None, float | None],
    *,
    as_json: bool,
) -> None:
    """Pull a duct off its bed and report the history."""
    import numpy as np

    from app.command_line.peel import report_history
    from app.simulation import bed_named, pull_and_hold
    from organ_geometry import check_target
    from physics.bed import Hand
    from physics.quantity import positive

    path = options.hook_path()
    step, hold, until = times
    if hold is not None and (step is None or options.lift is None):
        raise ValueError("--hold goes with --lift and --step-seconds")
    if until is not None and (options.lift is None or not 0.0 < until < 100.0):
        raise ValueError("--until goes with --lift and must be above 0 and below 100 %")
    for name_of, each in (("--step-seconds", step), ("--hold", hold)):
        _ = each is None or positive(each, name_of, "s")
    if output is not None:
        check_target(output)
    specimen = specimen_from(
        preset,
        organ,
        law=law[0],
        stiffening=law[1],
        bed=bed_named(name),
        bed_seed=options.seed,
        threshold_MPa=threshold,
        relaxation=step is not None,
    )
    at = 0.5 * specimen.beam.span if options.hook is None else options.hook
    beam = specimen.space_beam(elements=options.elements, nodes_at=[at])
    history = pull_and_hold(
        beam,
        specimen.layer(beam, options.strands),
        Hand(at=at, path=path, steps=options.steps),
        until=None if until is None else (1.0 - 0.01 * until) * specimen.threshold,
        step_seconds=step,
        hold_seconds=hold,
        relaxing=specimen.relaxing(),
    )
    notes = [*history.notes, specimen.doubt] if specimen.doubt else [*history.notes]
    if step is not None and hold is not None:
        last = history.steps - math.ceil(hold / step) - 1
        force = float(np.sqrt((history.forces[last, 0] ** 2).sum()))
        assert history.stress is not None  # noqa: S101 (a duct has a wall)
        left = 100.0 * (1.0 - float(history.stress[last]) / specimen.threshold)
        notes.append(f"before the hold: {force:.6g} N, distance to break {left:.2f} %")
    history = replace(history, notes=tuple(notes))
    report_history(history, specimen.threshold, output, law=specimen.preset.law, as_json=as_json)
