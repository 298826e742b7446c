"""The fewest bytes of our organ file at an error, by default effort; times to write and read it."""

import math
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.organ_sets import OrganSet
from benchmarks.peer_meshes import Mesh, tube_faces
from benchmarks.stopwatch import microseconds
from organ_geometry import (
    BuiltOrgan,
    Organ,
    Promise,
    ToleranceTooSmall,
    TraceOptions,
    build_fitted,
    fit_organ,
    read_organ,
    trace_organ,
    write_organ,
)

STATIONS, ANGLES = 600, 64
CHECK_POINTS = 10_000
# Tolerances of each section, in target errors: the target is the error of all together, sought with
# each of these in turn, because the steps of integers are multiples of them.
LOOSE_FRACTIONS = (3.0, 4.0, 5.0)

# Most organs built in a search, and the share of the target from which one is near enough.
STEPS, NEAR_ENOUGH = 5, 0.985
# An overall tolerance that is refused is raised by the one; none is below the other, in targets.
RAISE, LEAST_FRACTION = 1.15, 0.3


@dataclass(frozen=True, slots=True, eq=False)
class OrganBytes:
    """An organ read back from its file, with the file's bytes."""

    # Promised for each section and for all together, mm.
    tolerance: float
    overall: float
    built: BuiltOrgan
    size: int  # Bytes of the whole file
    rms: float  # RMS distance of the surface read back to the true surface, mm
    seconds: float  # Time to encode it, s


class OrganSearch:
    """Searches the builder's tolerance for the fewest bytes at an error."""

    def __init__(self, organ: OrganSet) -> None:
        self.tried = 0  # Number of organs built
        self._organ = organ
        trace = TraceOptions(edge_shift_mm=organ.edge_shift)
        self._fitted = fit_organ(organ.stack, trace_organ(organ.stack, trace))

    def at(self, tolerance: float, overall: float) -> OrganBytes | None:
        """Return the organ of a tolerance, or None if the builder says that it cannot be kept."""
        # RMS distances, mm: what each section may have, and what all together may.
        self.tried += 1
        started = time.perf_counter()
        try:
            built = build_fitted(
                self._fitted,
                Promise(tolerance_mm=tolerance, overall_mm=overall),
            )
        except ToleranceTooSmall:
            return None
        seconds = time.perf_counter() - started
        size, organ = stored(built.organ)
        rms = self._organ.rms(organ_mesh(organ), CHECK_POINTS)
        return OrganBytes(tolerance, overall, built, size, rms, seconds)

    def best(self, target: float) -> OrganBytes | None:
        """Return the smallest organ file whose error is a target at most."""
        overall = target
        enough: list[OrganBytes] = []
        for loose in LOOSE_FRACTIONS:
            found = self._sought(target, loose, overall)
            enough += found
            if found:
                overall = max(one.overall for one in found)
        return min(enough, key=lambda one: one.size, default=None)

    def _sought(self, target: float, loose: float, overall: float) -> list[OrganBytes]:
        """Return organs that reach a target, the RMS distance of all sections sought for it."""
        refused = 0.0
        enough: list[OrganBytes] = []
        for _ in range(STEPS):
            found = self.at(loose * target, overall)
            if found is None:
                refused, overall = overall, RAISE * overall
                continue
            if found.rms <= target:
                enough.append(found)
                if found.rms >= NEAR_ENOUGH * target:
                    break
            # What edges and mesh differ by adds to what edges and organ do, in squares.
            squared = overall**2 + (0.5 * (1.0 + NEAR_ENOUGH) * target) ** 2 - found.rms**2
            overall = max(math.sqrt(max(squared, 0.0)), LEAST_FRACTION * target)
            if overall <= refused:
                break
        return enough


def organ_mesh(organ: Organ, stations: int = STATIONS, angles: int = ANGLES) -> Mesh:
    """Return an organ's outer surface as a fine open tube, evaluated from the organ's curves."""
    along = np.linspace(0.0, organ.length, stations)
    around = 2.0 * np.pi * np.arange(angles) / angles
    points = organ.surface(np.repeat(along, angles), np.tile(around, stations))
    return points, tube_faces(stations, angles)


def stored(organ: Organ) -> tuple[int, Organ]:
    """Return the bytes of an organ's file, and the organ that is read from it."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "bench.organ"
        write_organ(organ, path)
        return path.stat().st_size, read_organ(path)


def file_times(organ: Organ, vertices: int) -> dict[str, float]:
    """Return the times to write and read an organ's file, the fastest of some runs."""
    stations = max(2, round(math.sqrt(2.0 * vertices)))
    angles = max(8, round(vertices / stations))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "bench.organ"
        write = 1e-3 * microseconds(lambda: write_organ(organ, path), 1)
        read = 1e-3 * microseconds(lambda: read_organ(path), 1)
        whole = 1e-3 * microseconds(lambda: organ_mesh(read_organ(path), stations, angles), 1)
    return {"write_ms": write, "read_ms": read, "read_and_mesh_ms": whole}
