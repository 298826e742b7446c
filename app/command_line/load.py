"""Shared by the commands: an organ from a file or the shipped one, and a theory."""

from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, get_args

import typer

if TYPE_CHECKING:
    from app.anatomy import Anatomy
    from app.simulation import Preset, Specimen
    from organ_geometry import Organ
    from physics import LawName, Theory

PRESET_NAMES = (
    "thesis-bile-duct, assumed-duct, thesis-rubber, thesis-thin-rubber, porcine-bile-duct, "
    "porcine-gallbladder, human-ureter or porcine-cystic-duct"
)
"""For the help, which must not wait until the presets are read; a test compares."""

PRESET_HELP = f"{PRESET_NAMES}; or a preset file, .toml."

# Options that commands share.
Grasp = Annotated[
    float | None, typer.Option(help="mm from the first clamp; the middle if not given.")
]
TheoryName = Annotated[str, typer.Option(help="cubic, string, exact, fem or mass-spring.")]
AxialCoupling = Annotated[
    str | None,
    typer.Option(help="Cubic: axial coupling, a number or 'fitted'; 0.5 if not given."),
]
Shear = Annotated[bool, typer.Option("--shear", help="Exact: let sections shear.")]
Law = Annotated[
    str | None,
    typer.Option(
        help="Exact: linear, neo-hooke or exponential (with shear); linear if not given. Bed: the "
        "preset's own."
    ),
]
Stiffening = Annotated[
    float | None,
    typer.Option(help="Exponential law: beta of sigma = alpha (e^(beta eps) - 1)."),
]


def organ_from(path: Path | None, longest_mm: float = inf) -> "Organ":
    """Return the organ in a file, or the shipped one."""
    from organ_geometry import read_organ

    organ = shipped_organ() if path is None else read_organ(path)
    if organ.length > longest_mm:
        raise ValueError(
            f"{path or organ.name}: the organ is {organ.length:,.0f} mm long and --organ-mm "
            f"allows {longest_mm:,.0f} mm"
        )
    return organ


def shipped_organ() -> "Organ":
    """Return the organ that ships with the trainer: nothing need be built before the first page."""
    from assets import BILE_DUCT
    from organ_geometry import read_organ

    return read_organ(BILE_DUCT)


def anatomy_from(source: str) -> "Anatomy":
    """Return an anatomy by a shipped one's name, or that of a file."""
    from app.anatomy import read_anatomy, shipped_anatomies

    return read_anatomy(shipped_anatomies().get(source, Path(source)))


def duct_of(preset: str | None, organ: Path | None) -> "Preset":
    """Return a preset, or the one of what is given: an organ's assumed material, a round duct."""
    from app.simulation import ASSUMED_PRESET, THESIS_PRESET, chosen_preset

    return chosen_preset(preset or (THESIS_PRESET if organ is None else ASSUMED_PRESET))


def with_law(preset: "Preset", law: str | None, stiffening: float | None = None) -> "Preset":
    """Return a preset with another law of its wall in space, if one is given."""
    from msgspec.structs import replace

    if law is None and stiffening is None:
        return preset
    return replace(preset, law=_law_name(law or preset.law), stiffening=stiffening)


def specimen_from(
    preset: str | None,
    organ: Path | None,
    *,
    law: str | None = None,
    stiffening: float | None = None,
    **settings: Any,
) -> "Specimen":
    """Return a specimen by a preset and an organ's file; the shipped organ where one is needed."""
    from app.simulation import RoundBeam, Specimen

    duct = with_law(duct_of(preset, organ), law, stiffening)
    needed = organ is not None or not isinstance(duct.beam, RoundBeam)
    return Specimen.of_sections(duct, organ_from(organ) if needed else None, **settings)


def chosen_theory(
    name: str, *, q: str | None, shear: bool, law: str | None, stiffening: float | None = None
) -> "Theory":
    """Return the theory that the options ask for."""
    from physics import theory_named

    chosen = None if law is None else _law_name(law)
    number: float | Literal["fitted"] | None
    try:
        number = None if q is None else "fitted" if q == "fitted" else float(q)
    except ValueError:
        raise ValueError(f"--q must be a number or 'fitted', not {q}") from None
    return theory_named(name, q=number, shear=shear, law=chosen, stiffening=stiffening)


def _law_name(law: str) -> "LawName":
    from physics import LawName

    for name in get_args(LawName):
        if law == name:
            return name
    raise ValueError(f"--law must be {' or '.join(get_args(LawName))}, not {law}")
