"""`bluntdissect solve --load`: loads that benches have besides a pull across."""

import math
from typing import TYPE_CHECKING

from app.command_line.answer import answer

if TYPE_CHECKING:
    from physics import Beam, Law

LOADS = ("across", "along", "avulsion", "inflation")


def solve_load_case(
    load: str,
    beam: "Beam",
    law: "Law",
    threshold: float | None,
    *,
    force: float | None,
    elongation: float | None,
    angle: float | None,
    pressure: float | None,
    as_json: bool,
) -> None:
    """Solve a pull along, an avulsion or an inflation, and answer."""
    from physics.bed.avulsion import avulse
    from physics.load_cases import inflate, pull_along, rupture_along

    if load == "inflation":
        if pressure is None:
            raise ValueError("an inflation needs --pressure, kPa")
        _none_of(load, {"--force": force, "--deflection": elongation, "--angle": angle})
        blown = inflate(beam, 1e-3 * pressure)
        answer(
            {
                "load": load,
                "pressure_kPa": pressure,
                "length_mm": blown.length,
                "diameter_mm": blown.diameter,
                "hoop_stress_MPa": blown.hoop_stress,
                "axial_stress_MPa": blown.axial_stress,
            },
            [
                ("load", "inflation of a thin incompressible neo-Hookean tube, ends closed"),
                ("pressure", f"{pressure:.6g} kPa"),
                ("length", f"{blown.length:.6g} mm"),
                ("outer diameter", f"{blown.diameter:.6g} mm"),
                ("hoop stress", f"{1e3 * blown.hoop_stress:.6g} kPa, nominal"),
                ("stress along", f"{1e3 * blown.axial_stress:.6g} kPa, nominal"),
            ],
            as_json=as_json,
        )
        return
    _none_of(load, {"--pressure": pressure})
    if load == "avulsion":
        if threshold is None:
            raise ValueError("an avulsion needs a strength: --threshold, MPa, or a --preset")
        _none_of(load, {"--force": force, "--deflection": elongation})
        degrees = 0.0 if angle is None else angle
        torn = avulse(beam, law, threshold, math.radians(degrees))
        answer(
            {
                "load": load,
                "law": law.name,
                "angle_deg": degrees,
                "breaks_at_N": torn.force,
                "moved_mm": torn.moved,
                "station_mm": torn.station,
            },
            [
                ("load", f"avulsion: one end held, the other led away at {degrees:g} degrees"),
                ("law", law.name),
                ("breaks at", f"{torn.force:.6g} N"),
                ("moved by", f"{torn.moved:.6g} mm"),
                ("breaks", f"{torn.station:.6g} mm from the end that is held"),
            ],
            as_json=as_json,
        )
        return
    _none_of(load, {"--angle": angle})
    pulled = pull_along(beam, law, force=force, elongation=elongation)
    rupture = None if threshold is None else rupture_along(beam, law, threshold)
    answer(
        {
            "load": load,
            "law": law.name,
            "force_N": pulled.force,
            "elongation_mm": pulled.elongation,
            "stress_MPa": pulled.stress,
            "threshold_MPa": threshold,
            "distance_to_break": None if threshold is None else 1.0 - pulled.stress / threshold,
            "breaks_at_N": None if rupture is None else rupture.force,
            "breaks_at_mm": None if rupture is None else rupture.elongation,
        },
        [
            ("load", "a pull along the axis"),
            ("law", law.name),
            ("force", f"{pulled.force:.6g} N"),
            ("elongation", f"{pulled.elongation:.6g} mm"),
            ("stress", f"{1e3 * pulled.stress:.6g} kPa, nominal"),
            *(
                []
                if rupture is None or threshold is None
                else [
                    ("distance to break", f"{100.0 * (1.0 - pulled.stress / threshold):.2f} %"),
                    ("breaks at", f"{rupture.force:.6g} N, {rupture.elongation:.6g} mm longer"),
                ]
            ),
        ],
        as_json=as_json,
    )


def _none_of(load: str, options: dict[str, float | None]) -> None:
    for name, value in options.items():
        if value is not None:
            raise ValueError(f"{name} is not of --load {load}: leave it out")
