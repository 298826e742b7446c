"""Tables: the force-deflection curve and the pulled axis, as CSV with units in the headings."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from app.export.motion import Motion
from app.simulation import Dissection
from physics import Pull, critical_stations

# Rows of an axis, besides those at the grasp and at a varying organ's own sections.
AXIS_STATIONS = 121


def curve_table(pull: Motion) -> bytes:
    """Return the force-deflection curve, with the highest stress at each force."""
    rows = [
        (
            reading.force,
            reading.deflection,
            reading.check.normal_stress,
            reading.check.bending_stress,
            reading.check.total_stress,
            reading.check.distance_to_break,
            reading.check.station,
        )
        for reading in pull.readings
    ]
    names = (
        "force_N",
        "deflection_mm",
        "normal_stress_MPa",
        "bending_stress_MPa",
        "total_stress_MPa",
        "distance_to_break",
        "station_mm",
    )
    return _csv(dict(zip(names, np.array(rows).T, strict=True)))


def axis_table(dissection: Dissection, pull: Pull, threshold: float) -> bytes:
    """Return the axis of a pulled beam, station by station."""
    stations = critical_stations(dissection.beam, pull.grasp, AXIS_STATIONS)
    pulled = pull.sample(stations)
    moved = np.stack([pulled.along - stations, pulled.across], axis=1)
    places = dissection.organ.axis_at(dissection.clamps[0] + stations)
    places += moved @ dissection.frame[:, [0, 2]].T
    return _csv(
        {
            "station_mm": stations,
            "along_mm": pulled.along,
            "across_mm": pulled.across,
            "rotation_rad": pulled.rotation,
            "x_mm": places[:, 0],
            "y_mm": places[:, 1],
            "z_mm": places[:, 2],
            "normal_force_N": pulled.normal_force,
            "shear_force_N": pulled.shear_force,
            "moment_N_mm": pulled.moment,
            "normal_stress_MPa": pulled.normal_stress,
            "bending_stress_MPa": pulled.bending_stress,
            "total_stress_MPa": pulled.total_stress,
            "distance_to_break": 1.0 - pulled.total_stress / threshold,
        }
    )


def _csv(columns: Mapping[str, NDArray[np.float64]]) -> bytes:
    # Adding 0 turns -0.0 into 0.0.
    rows = np.stack(list(columns.values()), axis=1) + 0.0
    lines = [",".join(columns), *(",".join(f"{each:.9g}" for each in row) for row in rows.tolist())]
    return ("\n".join(lines) + "\n").encode()
