"""`bluntdissect fit`: material and bed from measured force-deflection curves."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import msgspec
import typer

from app.command_line.answer import AsJson, answer, print_lines
from app.command_line.bed_options import BED_NAMES
from app.command_line.load import (
    PRESET_HELP,
    AxialCoupling,
    Grasp,
    Law,
    Shear,
    TheoryName,
    chosen_theory,
    duct_of,
)
from app.command_line.study import need

if TYPE_CHECKING:
    from app.simulation import OrganBeam, Preset, RoundBeam
    from app.study.bed_fit import BedFit
    from app.study.curves import Curve
    from app.study.fit import Estimate, Fit, MeasuredPull
    from organ_geometry import Organ

FIGURES = (".png", ".svg", ".pdf")
IDENTIFIED = {
    "identified": "",
    "correlated": ", correlated with another",
    "unidentified": ", hardly identified",
}
"""How far the data tell a parameter, in words that follow its region."""


def fit(
    curves: Annotated[
        list[Path],
        typer.Argument(help="CSV files with columns such as deflection_mm and force_N."),
    ],
    preset: Annotated[
        str | None, typer.Option(help=f"The duct, for what is not given: {PRESET_HELP}")
    ] = None,
    organ: Annotated[
        Path | None,
        typer.Option(help="An organ file, whose own sections were pulled; a span in its middle."),
    ] = None,
    span: Annotated[float | None, typer.Option(help="mm between the clamps.")] = None,
    diameter: Annotated[float | None, typer.Option(help="Outer diameter, mm.")] = None,
    wall: Annotated[float | None, typer.Option(help="Wall of a tube, mm; full if none.")] = None,
    grasp: Grasp = None,
    theory: TheoryName = "exact",
    q: AxialCoupling = None,
    shear: Shear = False,
    law: Law = None,
    poisson: Annotated[
        str | None, typer.Option(help="Poisson's ratio, or 'fit' to seek it, too.")
    ] = None,
    broke: Annotated[
        bool, typer.Option("--broke", help="The last point of each curve is the break.")
    ] = False,
    bed: Annotated[
        str | None,
        typer.Option(help=f"Seek stiffness and toughness of a bed, from {BED_NAMES}."),
    ] = None,
    modulus: Annotated[
        float | None, typer.Option(help="Bed: the duct's modulus, MPa; the preset's if none.")
    ] = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Write a preset of what was found, .toml.")
    ] = None,
    name: Annotated[str, typer.Option(help="Name of that preset.")] = "measured-duct",
    figure: Annotated[
        Path | None, typer.Option(help="Draw curves, fit and residuals: .png, .svg or .pdf.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Find modulus, strength or a bed from measured pulls, and say what they cannot tell.

    Examples: bluntdissect fit pull.csv --span 50.8 --diameter 8.9 -o mine.toml, or
    bluntdissect fit lift.csv --bed normal
    """
    from app.simulation import RoundBeam, Specimen
    from app.study.curves import read_curves
    from organ_geometry import check_target, read_organ

    need("scipy", *(["matplotlib"] if figure is not None else []))
    for target, kinds in ((output, (".toml",)), (figure, FIGURES)):
        if target is not None:
            if target.suffix.lower() not in kinds:
                raise ValueError(f"{target} must end in {' or '.join(kinds)}")
            check_target(target)
    base = duct_of(preset, organ)
    if organ is None and not isinstance(base.beam, RoundBeam):
        raise ValueError(
            f"preset {base.name} is of an organ's own sections: give --organ, or --span and "
            "--diameter of a round duct"
        )
    if organ is not None and bed is not None:
        raise ValueError("--bed seeks the bed of a round duct: leave out --organ")
    shape = None if organ is None else read_organ(organ)
    Specimen.of_sections(base, shape)  # an organ goes with a preset that takes its sections
    free = poisson == "fit"
    ratio = base.poisson_ratio
    if poisson is not None and not free:
        try:
            ratio = float(poisson)
        except ValueError:
            raise ValueError(f"--poisson must be a number or 'fit', not {poisson}") from None
    found = [curve for path in curves for curve in read_curves(path, broke=broke)]
    given = {"span_mm": span, "diameter_mm": diameter, "wall_mm": wall, "grasp_mm": grasp}
    for curve in found:
        if shape is not None and (diameter is not None or "diameter_mm" in curve.facts):
            raise ValueError(f"{curve.name}: an organ has its own sections; leave out the diameter")
        if shape is None and preset is None:
            missing = [
                f"--{key.removesuffix('_mm')}"
                for key in ("span_mm", "diameter_mm")
                if given[key] is None and key not in curve.facts
            ]
            if missing:
                raise ValueError(
                    f"{curve.name}: give {' and '.join(missing)}, a --preset, or lines such as "
                    "'# span_mm = 50.8' above the header"
                )
    kinds = [_kind(curve, base, given, shape) for curve in found]
    pulls = [
        _measured(
            curve, msgspec.structs.replace(base, beam=kind, poisson_ratio=ratio), given, shape
        )
        for curve, kind in zip(found, kinds, strict=True)
    ]
    if bed is not None:
        if output is not None or free:
            raise ValueError("--bed seeks a bed: -o and --poisson fit go with pulls of a free duct")
        result, lines, residuals = _bed_result(pulls, bed, modulus or base.modulus_MPa)
        title = f"bed {bed}"
    else:
        if modulus is not None:
            raise ValueError("--modulus goes with --bed; a pull's modulus is sought")
        from physics import theory_words

        chosen = chosen_theory(theory, q=q, shear=shear, law=law)
        result, lines, residuals = _pull_result(
            pulls,
            chosen,
            free=free,
            base=msgspec.structs.replace(base, beam=kinds[0]),
            name=name,
            output=output,
        )
        title = theory_words(chosen)
    if organ is not None:
        which = "sections all along it" if theory == "exact" else "its weakest section"
        span_of = f"{pulls[0].beam.span:.4g} mm between the clamps"
        lines.insert(1, ("organ", f"{organ}, {span_of}, {which}"))
        result["organ"] = str(organ)
    if figure is not None:
        from app.study.fit_figure import draw_fit

        draw_fit(found, residuals, title, figure)
    answer(result, lines, as_json=as_json)
    if not as_json:
        print_lines(("written", path) for path in (output, figure) if path is not None)


def _kind(
    curve: "Curve", base: "Preset", given: dict[str, float | None], organ: "Organ | None"
) -> "RoundBeam | OrganBeam":
    """Return the duct of a curve: by its file, the options, the preset."""
    from app.simulation import OrganBeam, RoundBeam
    from app.study.ducts import sized_beam

    sizes = {name: curve.facts.get(name, value) for name, value in given.items()}
    kind = base.beam
    wall = kind.wall_mm if sizes["wall_mm"] is None else sizes["wall_mm"]
    if isinstance(kind, OrganBeam):
        assert organ is not None  # noqa: S101 (the command has looked)
        return sized_beam(organ, kind, wall, sizes["span_mm"])
    span, diameter = sizes["span_mm"], sizes["diameter_mm"]
    return RoundBeam(
        span_mm=kind.span_mm if span is None else span,
        diameter_mm=kind.diameter_mm if diameter is None else diameter,
        wall_mm=wall,
    )


def _measured(
    curve: "Curve", preset: "Preset", given: dict[str, float | None], organ: "Organ | None"
) -> "MeasuredPull":
    from app.simulation import Specimen
    from app.study.fit import MeasuredPull

    beam = Specimen.of_sections(preset, organ).beam
    grasp = curve.facts.get("grasp_mm", given["grasp_mm"])
    return MeasuredPull(
        curve, beam, beam.grasped_at(0.5 * beam.span if grasp is None else grasp)[0]
    )


Result = tuple[dict[str, Any], list[tuple[str, str]], list[Any]]
"""As JSON, as lines, and the residuals of each curve."""


def _pull_result(
    pulls: "list[MeasuredPull]",
    theory: Any,
    *,
    free: bool,
    base: "Preset",
    name: str,
    output: Path | None,
) -> Result:
    from app.study.fit import fit_pulls
    from physics import theory_words

    fitted = fit_pulls(pulls, theory, free_ratio=free)
    words = theory_words(theory)
    if output is not None:
        from app.simulation import preset_toml
        from organ_geometry import write_atomic

        write_atomic(output, preset_toml(_preset(fitted, pulls, base, name, words)))
    options = {"theory": theory.name, **theory.options}
    curves = [
        {
            "name": each.curve.name,
            "points": int(each.curve.forces.size),
            "modulus_alone_MPa": alone,
            "broke": each.curve.broke,
            "deflection_mm": each.curve.deflections.tolist(),
        }
        for each, alone in zip(pulls, fitted.alone, strict=True)
    ]
    return _result(
        fitted, options | {"regions": "95 %, profile likelihood"}, ("theory", words), curves
    )


def _bed_result(pulls: "list[MeasuredPull]", bed: str, modulus: float) -> Result:
    from dataclasses import replace

    from app.simulation import bed_named
    from app.study.bed_fit import fit_bed

    ducts = [replace(each, beam=replace(each.beam, modulus=modulus)) for each in pulls]
    fitted = fit_bed(ducts, bed_named(bed))
    in_plan = {
        name: getattr(fitted.bed, name) for name in ("toughness_J_per_m2", "yield_mm", "failure_mm")
    }
    curves = [{"name": each.curve.name} for each in pulls]
    return _result(fitted, {"bed": bed, "regions": "95 %, Jacobian"}, ("bed", bed), curves, in_plan)


def _result(
    fitted: "Fit | BedFit",
    head: dict[str, Any],
    line: tuple[str, str],
    curves: list[dict[str, Any]],
    in_plan: dict[str, float] | None = None,
) -> Result:
    """Return what was found, below a head and its line."""
    result: dict[str, Any] = {
        **head,
        "parameters": {each.key: _as_json(each) for each in fitted.sought},
        **(in_plan or {}),
        "noise_N": fitted.noise,
        "correlation": fitted.correlation,
        "condition": fitted.condition,
        "warnings": fitted.warnings,
        "curves": [
            {**curve, "residual_N": residual.tolist()}
            for curve, residual in zip(curves, fitted.residuals, strict=True)
        ],
    }
    points = sum(residual.size for residual in fitted.residuals)
    lines = [
        line,
        ("curves", f"{len(curves)}, {points} points"),
        *((each.name, _words(each)) for each in fitted.sought),
    ]
    if in_plan is not None:
        values = ", ".join(f"bed.{name} {value:.4g}" for name, value in in_plan.items())
        lines.append(("in a plan", values))
    lines.append(("noise", f"{fitted.noise:.3g} N (standard deviation of the force)"))
    lines += [("note" if i else "what to know", each) for i, each in enumerate(fitted.warnings)]
    return result, lines, fitted.residuals


def _preset(
    fitted: "Fit",
    pulls: "list[MeasuredPull]",
    base: "Preset",
    name: str,
    theory: str,
) -> "Preset":
    """Return the base with what was found; a break that was not is the base's own."""
    from app.simulation import Preset

    strength = fitted.strength
    note = "; ".join(fitted.warnings)
    stress = base.break_stress_MPa if strength is None else strength.value
    return Preset(
        name=name,
        title=name,
        description=f"Fitted to {len(pulls)} measured pull{'s' * (len(pulls) > 1)}.",
        beam=base.beam,
        modulus_MPa=fitted.modulus.value,
        poisson_ratio=fitted.poisson_ratio.value,
        break_stress_MPa=stress,
        break_force_N=base.break_force_N if stress is None else None,
        looks_like=base.looks_like,
        source=(
            f"bluntdissect fit, {theory}, 95 % by profile likelihood: "
            + "; ".join(f"{each.name} {_words(each)}" for each in fitted.sought)
            + f"; curves {', '.join(each.curve.name for each in pulls)}."
            + ("" if strength is not None else f" The break is that of preset {base.name}.")
        ),
        confidence="medium" if strength is not None else "low",
        confidence_note=(note[:1].upper() + note[1:] or "Measured") + ".",
    )


def _words(each: "Estimate") -> str:
    unit = f" {each.unit}" if each.unit else ""
    if each.identifiability == "fixed":
        return f"{each.value:.4g}{unit}, as given"
    how = IDENTIFIED[each.identifiability]
    return f"{each.value:.4g}{unit}, 95 % {each.low:.4g} to {each.high:.4g}{how}"


def _as_json(each: "Estimate") -> dict[str, Any]:
    return {
        "value": each.value,
        "unit": each.unit,
        "region_95": [each.low, each.high],
        "identifiability": each.identifiability,
    }
