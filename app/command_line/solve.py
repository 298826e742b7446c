"""`bluntdissect solve`: one beam under one pull, in numbers."""

import json
import math
from pathlib import Path
from typing import Annotated

import typer

from app.command_line.bed_options import (
    Bed,
    BedSeed,
    Elements,
    Hook,
    HookPath,
    Lift,
    Steps,
    StrandCount,
    check_options,
    hook_path,
)
from app.command_line.load import (
    PRESET_HELP,
    THEORY_HELP,
    chosen_theory,
    equilibrium,
    organ_from,
    theory_options,
)

__all__ = ["solve"]

# mm, MPa and N: far beyond any tissue, far from where numbers run over.
MOST_LENGTH, MOST_MODULUS, MOST_FORCE = 1e6, 1e9, 1e9


def solve(
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
    grasp: Annotated[
        float | None, typer.Option(help="mm from the first clamp; the middle if not given.")
    ] = None,
    force: Annotated[
        float | None,
        typer.Option(help="The grasper's whole force, N; below zero it pulls the other way."),
    ] = None,
    deflection: Annotated[float | None, typer.Option(help="Deflection of the grasp, mm.")] = None,
    theory: Annotated[str, typer.Option(help=THEORY_HELP)] = "cubic",
    q: Annotated[
        str | None,
        typer.Option(help="Cubic: axial coupling, a number or 'fitted'; 0.5 if not given."),
    ] = None,
    shear: Annotated[bool, typer.Option("--shear", help="Exact: let sections shear.")] = False,
    law: Annotated[
        str | None,
        typer.Option(help="Exact: linear or neo-hooke (with shear); linear if not given."),
    ] = None,
    threshold: Annotated[
        float | None,
        typer.Option(help="Stress at which it breaks, MPa; the preset's own if not given."),
    ] = None,
    bed: Bed = None,
    seed: BedSeed = 1,
    hook: Hook = None,
    lift: Lift = None,
    path: HookPath = None,
    steps: Steps = 60,
    elements: Elements = 80,
    strands: StrandCount = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Bed: write the history as CSV here.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object on stdout.")] = False,
) -> None:
    """Solve a beam under a pull: deflection, force, stresses and distance to break.

    Examples: bluntdissect solve --preset thesis-bile-duct --force 3.56, or
    bluntdissect solve --span 50.8 --diameter 8.89 --modulus 0.310264 --deflection 10 --json, or
    bluntdissect solve --bed firm --hook 31 --lift 6
    """
    of_bed = {"--hook": hook, "--lift": lift, "--path": path, "--strands": strands, "-o": output}
    of_bed |= {"--seed": seed != 1 or None, "--steps": steps != 60 or None}
    of_bed |= {"--elements": elements != 80 or None}
    of_pull = {"--grasp": grasp, "--force": force, "--deflection": deflection}
    of_pull |= {"--span": span, "--diameter": diameter, "--modulus": modulus, "--q": q}
    of_pull |= {"--poisson": poisson, "--law": law, "--shear": shear or None}
    of_pull |= {"--theory": theory != "cubic" or None}
    check_options(bed, of_bed, of_pull)
    if bed is not None:
        in_bed(
            bed,
            preset=preset,
            organ=organ,
            seed=seed,
            hook=hook,
            way=hook_path(lift, path),
            steps=steps,
            elements=elements,
            strands=strands,
            threshold=threshold,
            output=output,
            as_json=as_json,
        )
        return
    from app.simulation import ASSUMED_PRESET, Dissection, RoundBeam, chosen_preset
    from physics import Beam, break_of, check_rupture
    from physics.quantity import positive

    for name, value, unit, most in (
        ("--span", span, "mm", MOST_LENGTH),
        ("--diameter", diameter, "mm", MOST_LENGTH),
        ("--modulus", modulus, "MPa", MOST_MODULUS),
        ("--force", force, "N", MOST_FORCE),
        ("--deflection", deflection, "mm", MOST_LENGTH),
    ):
        if value is not None and most < abs(value) < math.inf:
            raise ValueError(f"{name} can be at most {most:g} {unit}, got {value:g} {unit}")
    chosen = chosen_theory(theory, q=q, shear=shear, law=law)
    options = theory_options(chosen)
    round_beam = {
        "--span": span,
        "--diameter": diameter,
        "--modulus": modulus,
        "--poisson": poisson,
    }
    given = [name for name, value in round_beam.items() if value is not None]
    section, strength = "a full round bar", None
    if preset is not None or organ is not None:
        if given:
            brings = "--preset" if preset is not None else "--organ"
            raise ValueError(f"{brings} brings its own beam; leave out {', '.join(given)}")
        duct = chosen_preset(preset or ASSUMED_PRESET)
        if isinstance(duct.beam, RoundBeam):
            if organ is not None:
                raise ValueError(f"preset {preset} brings its own beam; leave out --organ")
            beam = duct.round_beam()
            section = "a full round bar" if duct.beam.wall_mm is None else "a round tube"
        else:
            dissection = Dissection.of(organ_from(organ), duct)
            beam, section = dissection.beam, dissection.section(chosen)
        limit = duct.threshold(chosen, beam) if threshold is None else threshold
        strength = duct.strength if threshold is None else None
        preset = duct.name
    else:
        if span is None or diameter is None or modulus is None:
            raise ValueError(
                "give a --preset, an --organ, or --span, --diameter and --modulus of a round beam"
            )
        beam = Beam.round(
            span=span,
            diameter=diameter,
            modulus=modulus,
            poisson_ratio=0.3 if poisson is None else poisson,
        )
        limit = threshold
    if limit is not None:
        positive(limit, "threshold", "MPa")

    pulled = equilibrium(chosen, beam, grasp=grasp, force=force, deflection=deflection)
    # Without a threshold any will do to find the place of the highest stress.
    check = check_rupture(pulled, 1.0 if limit is None else limit)
    event = None if limit is None else break_of(chosen.pull(beam, pulled.grasp), limit)
    result = {
        "theory": chosen.name,
        "preset": preset,
        "section": section,
        "span_mm": beam.span,
        "area_mm2": beam.area,
        "second_moment_mm4": beam.second_moment,
        "fibre_distance_mm": beam.fibre_distance,
        "force_N": pulled.force,
        "deflection_mm": pulled.deflection,
        "normal_stress_MPa": check.normal_stress,
        "bending_stress_MPa": check.bending_stress,
        "strength": strength,
        "threshold_MPa": limit,
        "distance_to_break": None if limit is None else check.distance_to_break,
        "breaks_at_N": None if event is None else event.force,
        **options,
    }
    if as_json:
        print(json.dumps(result))
        return
    side = {1: ", on the side of the pull", -1: ", on the side away from the pull", 0: ""}
    lines = [
        ("theory", ", ".join([chosen.name, *(f"{key} {value}" for key, value in options.items())])),
        *([] if preset is None else [("preset", preset)]),
        ("section", section),
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
            *([] if strength is None else [("strength as given", strength)]),
            ("threshold", f"{1e3 * limit:.6g} kPa"),
            ("distance to break", f"{100.0 * check.distance_to_break:.2f} %{state}"),
            (
                "breaks at",
                "no force it can be pulled with" if event is None else f"{event.force:.6g} N",
            ),
        ]
    for name, value in lines:
        print(f"{name:<18} {value}")


def in_bed(
    name: str,
    *,
    preset: str | None,
    organ: Path | None,
    seed: int,
    hook: float | None,
    way: tuple[tuple[float, float, float], ...],
    steps: int,
    elements: int,
    strands: int | None,
    threshold: float | None,
    output: Path | None,
    as_json: bool,
) -> None:
    """Pull a duct off its bed and report the history; the options are those of `solve`."""
    from app.command_line.peel import report_history
    from app.simulation import (
        ASSUMED_PRESET,
        THESIS_PRESET,
        Dissection,
        RoundBeam,
        chosen_preset,
    )
    from app.simulation.bed import beam_in_space, bed_named
    from organ_geometry import check_target
    from physics import Exact, Linear
    from physics.bed import Hand, SpaceBeam, pull
    from physics.quantity import positive

    if output is not None:
        check_target(output)
    layer = bed_named(name)
    duct = chosen_preset(preset or (THESIS_PRESET if organ is None else ASSUMED_PRESET))
    theory = Exact(Linear(shear=True))
    if isinstance(duct.beam, RoundBeam):
        if organ is not None:
            raise ValueError(f"preset {duct.name} brings its own beam; leave out --organ")
        bar = duct.round_beam()
        at = 0.5 * bar.span if hook is None else hook
        beam = SpaceBeam.of(bar, elements=elements, nodes_at=[at])
        limit = duct.threshold(theory, bar) if threshold is None else threshold
    else:
        dissection = Dissection.of(organ_from(organ), duct)
        at = 0.5 * dissection.beam.span if hook is None else hook
        beam = beam_in_space(dissection, elements=elements, nodes_at=[at])
        limit = duct.threshold(theory, dissection.beam) if threshold is None else threshold
    positive(limit, "threshold", "MPa")
    hand = Hand(at=at, path=way, steps=steps)
    history = pull(beam, layer.bed(beam, seed=seed, strands=strands), [hand])
    report_history(history, limit, output, as_json=as_json)
