"""Organ files beside meshes packed by Draco, the builder beside marching cubes, and its memory."""

import math
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from importlib import import_module
from multiprocessing import get_context
from os import cpu_count
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from benchmarks.builder_speed import BuilderRates, builder_memory, builder_rates
from benchmarks.draco_peer import DracoMesh, DracoSearch
from benchmarks.organ_bytes import CHECK_POINTS, OrganBytes, OrganSearch, file_times, organ_mesh
from benchmarks.organ_sets import DATA, SETS, OrganSet, missing_sets
from benchmarks.surface_distance import spread_points
from organ_geometry import build_organ

WISHED = (1.0, 2.0)
LEVELS = (1.0, 1.25, 1.5, 2.0, 3.0, 4.0, 6.0)
"""Errors, % of the radius: those wished, and what is taken where one is not reached by both."""

# Surface points that an organ is read for where there is no peer's mesh to have as many as.
USUAL_VERTICES = 300


def set_figures(name: str) -> dict[str, Any]:
    """Return the figures of one set."""
    started = time.perf_counter()
    organ = OrganSet(name)
    ours = OrganSearch(organ)
    notes: list[str] = []
    peers: DracoSearch | None = None
    try:
        peers = DracoSearch(organ)
    except ModuleNotFoundError as missing:
        notes.append(f"{missing.name} is not installed: pip install .[bench]")

    def smallest(percent: float) -> tuple[OrganBytes, DracoMesh | None] | None:
        target = 0.01 * percent * organ.radius
        file = ours.best(target)
        if file is None or peers is None:
            return None if file is None else (file, None)
        mesh = peers.best(target)
        return None if mesh is None else (file, mesh)

    rows: list[dict[str, Any]] = []
    last: tuple[OrganBytes, DracoMesh | None] | None = None
    for percent, last in levels_of_both(smallest):
        file, mesh = last
        rows.append(
            {
                "percent": percent,
                "organ_bytes": file.size,
                "organ_percent": 100.0 * file.rms / organ.radius,
                "organ_tolerance_mm": file.tolerance,
                "command": compress_command(organ, file),
                "sections_kept": file.built.sections_kept,
                "draco_bytes": None if mesh is None else mesh.size,
                "draco_percent": None if mesh is None else 100.0 * mesh.rms / organ.radius,
                "draco_mesh": None if mesh is None else str(mesh),
                "ratio": None if mesh is None else file.size / mesh.size,
            }
        )
    if len(rows) < len(WISHED):
        notes.append(f"{name}: {len(rows)} errors up to {LEVELS[-1]:g} % were reached by both")
    return {
        "radius_mm": organ.radius,
        "levels": rows,
        "accuracy": accuracy(organ),
        "times_ms": {} if last is None else times_of(*last),
        "organs_built": ours.tried,
        "draco_settings": 0 if peers is None else peers.tried,
        "seconds": time.perf_counter() - started,
        "notes": notes,
    }


def compress_command(organ: OrganSet, file: OrganBytes) -> str:
    """Return the command that writes an organ's file again."""
    return (
        f"bluntdissect compress {organ.stack.source} -o {organ.name}.organ "
        f"--edge-shift-mm {organ.edge_shift!r} --tolerance-mm {file.tolerance!r} "
        f"--overall-mm {file.overall!r}"
    )


def levels_of_both(
    smallest: Callable[[float], tuple[OrganBytes, DracoMesh | None] | None],
) -> list[tuple[float, tuple[OrganBytes, DracoMesh | None]]]:
    """Return both files at each error wished, or at the next error that both reach."""
    found: list[tuple[float, tuple[OrganBytes, DracoMesh | None]]] = []
    above = 0.0
    for wish in WISHED:
        for percent in LEVELS:
            if percent < wish or percent <= above:
                continue
            above = percent
            both = smallest(percent)
            if both is not None:
                found.append((percent, both))
                break
    return found


def accuracy(organ: OrganSet) -> dict[str, float] | None:
    """Return how near the edges and the organ of the usual tolerance are to the reference mesh."""
    # Mean distances `edges_mm`, `edges_px`, `organ_mm` and `organ_px`; None without a reference.
    if not organ.reference_files:
        return None
    edges = float(organ.inner_distances(np.concatenate(organ.contours)).mean())
    built = build_organ(organ.stack)
    surface = organ.inner_distances(spread_points(*organ_mesh(built.organ), CHECK_POINTS)[0])
    mean = float(surface.mean()) if len(surface) else math.nan
    return {
        "edges_mm": edges,
        "edges_px": edges / organ.pixel,
        "organ_mm": mean,
        "organ_px": mean / organ.pixel,
    }


def times_of(file: OrganBytes, mesh: DracoMesh | None, runs: int = 9) -> dict[str, float]:
    """Return the times to write and to read both files."""
    vertices = USUAL_VERTICES if mesh is None else mesh.faces // 2
    times = {"build_ms": 1e3 * file.seconds, **file_times(file.built.organ, vertices)}
    if mesh is not None:
        encode, decode = mesh.times(import_module("DracoPy"), runs)
        times |= {"draco_encode_ms": 1e3 * encode, "draco_decode_ms": 1e3 * decode}
    return times


def measure_geometry(console: Console) -> dict[str, Any]:
    """Print and return the figures of the geometry."""
    missing = missing_sets()
    names = [name for name in SETS if name not in missing]
    notes = [f"{', '.join(missing)}: no images in {DATA}, so not measured"] if missing else []
    with console.status("Building organs and timing marching cubes ..."):
        rates = builder_rates()
        memory = builder_memory()
    with (
        console.status("Searching organ files and Draco meshes ..."),
        ProcessPoolExecutor(cpu_count(), get_context("spawn")) as pool,
    ):
        sets = dict(zip(names, pool.map(set_figures, names), strict=True))
    for figures in sets.values():
        notes += [note for note in figures["notes"] if note not in notes]
    if rates.note:
        notes.append(rates.note)

    console.print()
    console.print(rates_table(rates))
    if sets:
        console.print(bytes_table(sets))
        console.print(surface_table(sets))
    lines = [
        f"Memory: {memory['slices']:.0f} images grow it by {memory['growth_mib']:.1f} MiB, their "
        f"volume is {memory['volume_mib']:.0f} MiB: "
        f"{memory['growth_mib'] / memory['volume_mib']:.3f} of it, in {memory['seconds']:.1f} s",
    ]
    lines += [
        f"{row['organ_bytes']} B: {row['command']}"
        for figures in sets.values()
        for row in figures["levels"]
    ]
    for line in (*lines, *notes):
        console.print(line, highlight=False, markup=False, soft_wrap=True)
    return {
        "sets": sets,
        "builder": {
            "images_per_s": rates.ours,
            "edges_images_per_s": rates.edges,
            "marching_cubes_images_per_s": rates.peer,
            "ratio": None if rates.peer is None else rates.ours / rates.peer,
        },
        "memory": memory,
        "notes": notes,
    }


def rates_table(rates: BuilderRates) -> Table:
    """Return images a second as a table."""
    table = plain_table("Images of 512 x 512 a second, from PNG files, and ours over the peer's")
    for heading in ("", "images/s", "ratio"):
        table.add_column(heading, justify="right" if heading else "left")
    peer = rates.peer
    for name, rate in (
        ("organ builder", rates.ours),
        ("  its edges alone", rates.edges),
        ("marching cubes and decimation", peer),
    ):
        table.add_row(
            name,
            "-" if rate is None else f"{rate:.0f}",
            "" if rate is None or peer is None else f"{rate / peer:.2f}",
        )
    return table


def bytes_table(sets: dict[str, dict[str, Any]]) -> Table:
    """Return bytes at equal errors as a table."""
    table = plain_table("Bytes at the same RMS distance to the true surface, % of the mean radius")
    for heading in ("", "%", "organ", "Draco", "ratio", "Draco's mesh"):
        table.add_column(heading, justify="left" if heading in {"", "Draco's mesh"} else "right")
    for name, figures in sets.items():
        for row in figures["levels"]:
            peer = row["draco_mesh"]
            table.add_row(
                name,
                f"{row['percent']:g}",
                str(row["organ_bytes"]),
                "-" if peer is None else str(row["draco_bytes"]),
                "-" if peer is None else f"{row['ratio']:.3f}",
                "" if peer is None else peer.partition(": ")[2],
            )
    return table


def surface_table(sets: dict[str, dict[str, Any]]) -> Table:
    """Return distances to the reference meshes, and times of the files, as a table."""
    table = plain_table("Mean distance to the reference mesh, px; time, ms, of the last file above")
    for heading in ("", "edges", "organ", "write", "read", "+ mesh", "Draco enc.", "dec."):
        table.add_column(heading, justify="right" if heading else "left")
    keys = ("write_ms", "read_ms", "read_and_mesh_ms", "draco_encode_ms", "draco_decode_ms")
    for name, figures in sets.items():
        near, times = figures["accuracy"], figures["times_ms"]
        table.add_row(
            name,
            *("-" if near is None else f"{near[key]:.2f}" for key in ("edges_px", "organ_px")),
            *(f"{times[key]:.2f}" if key in times else "-" for key in keys),
        )
    return table


def plain_table(title: str) -> Table:
    """Return a table without lines."""
    return Table(title=title, title_justify="left", title_style="", box=None, pad_edge=False)
