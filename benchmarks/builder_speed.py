"""Speed of the organ builder beside marching cubes, and its memory."""

import os
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import dataclass
from importlib import import_module
from multiprocessing import get_context
from pathlib import Path

import cv2
import numpy as np

from benchmarks.tube_images import LEVEL, SIDE, SMOOTH, draw_tube_images
from organ_geometry import build_organ, read_image_stack, trace_organ

SLICES, RUNS = 300, 3
MANY_SLICES = 2000
WARM_SLICES = 24
PEER_FACES = 2000
MEBIBYTE = 2**20


@dataclass(frozen=True, slots=True)
class BuilderRates:
    """Images a second, decoded from PNG and made into an organ or a mesh."""

    ours: float  # Of the organ builder, from the images to the organ of its file, 1/s
    edges: float  # Of its first part, from the images to their edges, 1/s
    # Of scikit-image's marching cubes and fast-simplification, 1/s; None if they are missing.
    peer: float | None
    note: str = ""  # Why there is no peer


def builder_rates() -> BuilderRates:
    """Time the organ builder and marching cubes with decimation on one stack, by turns."""
    # Of so many runs of each, the fastest counts: other work on the machine only adds time.
    times: dict[str, list[float]] = {"ours": [], "edges": [], "peer": []}
    note = ""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place) / "tube"
        draw_tube_images(folder, SLICES)
        for _ in range(RUNS):
            start = time.perf_counter()
            build_organ(read_image_stack(folder))
            times["ours"].append(time.perf_counter() - start)
            start = time.perf_counter()
            trace_organ(read_image_stack(folder))
            times["edges"].append(time.perf_counter() - start)
            if note:
                continue
            start = time.perf_counter()
            try:
                cubes_of_images(folder)
            except ModuleNotFoundError as missing:
                note = f"{missing.name} is not installed: pip install .[bench]"
                continue
            times["peer"].append(time.perf_counter() - start)
    fastest = {key: SLICES / min(values) for key, values in times.items() if values}
    return BuilderRates(fastest["ours"], fastest["edges"], fastest.get("peer"), note)


def cubes_of_images(folder: Path) -> int:
    """Make a mesh of a folder of PNG images as others do: all in memory, cubes, fewer triangles."""
    measure = import_module("skimage.measure")
    simplification = import_module("fast_simplification")
    files = sorted(folder.glob("*.png"))
    volume = np.empty((len(files), SIDE, SIDE), dtype=np.uint8)

    def read(place: int) -> None:
        volume[place] = np.asarray(cv2.imread(str(files[place]), cv2.IMREAD_GRAYSCALE))

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        list(pool.map(read, range(len(files))))
    vertices, faces, _, _ = measure.marching_cubes(volume, LEVEL)
    middle = vertices.mean(axis=0)
    _, few = simplification.simplify(vertices - middle, faces, target_count=PEER_FACES)
    return len(few)


def builder_memory() -> dict[str, float]:
    """Return the peak memory of a long stack's build, in a process of its own."""
    with tempfile.TemporaryDirectory() as place:
        few, many = Path(place) / "few", Path(place) / "many"
        draw_tube_images(few, WARM_SLICES)
        draw_tube_images(many, MANY_SLICES, SMOOTH)
        with ProcessPoolExecutor(1, get_context("spawn")) as pool:
            growth, seconds = pool.submit(_growth, few, many).result()
    return {
        "slices": MANY_SLICES,
        "growth_mib": growth / MEBIBYTE,
        "volume_mib": MANY_SLICES * SIDE * SIDE / MEBIBYTE,
        "seconds": seconds,
    }


def _growth(few: Path, many: Path) -> tuple[float, float]:
    """Return the bytes by which a long stack exceeds a short one's largest memory, and its time."""
    build_organ(read_image_stack(few))
    before = _largest_memory()
    start = time.perf_counter()
    build_organ(read_image_stack(many))
    seconds = time.perf_counter() - start
    return _largest_memory() - before, seconds


def _largest_memory() -> float:
    """Return the largest resident memory that this process has had, bytes."""
    # Not getrusage: it starts with the memory of the process that this one was forked from.
    for line in Path("/proc/self/status").read_text(encoding="ascii").splitlines():
        if line.startswith("VmHWM:"):
            return 1024.0 * float(line.split()[1])
    raise OSError("/proc/self/status has no VmHWM, which is the largest resident memory")
