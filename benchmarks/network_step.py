# matplotlib's types are partial.
# pyright: reportUnknownMemberType=false
"""A step of 1/1000 s of an anatomy's tubes: what rods, tubes and strands cost.

Processor time, in which what else the machine does counts only by what it takes of the caches; of
steps that each wait for their millisecond, as a haptic loop's do, also time by the clock.
"""

import time
from io import BytesIO
from itertools import product
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray
from rich.console import Console

from app.anatomy.anatomy_file import anatomy_named, shipped_anatomies
from app.anatomy.anatomy_network import AnatomyNetwork, anatomy_network
from app.anatomy.figure import figure_kind
from app.anatomy.tables import Anatomy, LayerTable
from app.study.report import COLOURS
from benchmarks.stopwatch import REPEATS, wait_until
from organ_geometry import write_atomic
from physics.bed import BeamOnBed
from physics.bed.layout import Coupling

Floats = NDArray[np.float64]

ANATOMY = "normal"
"""That whose tubes and strands are varied."""
STEPS, SECONDS = 1000, 1e-3
WARM_STEPS = 50
"""Steps that are not counted."""
LIFT = 8e-3
"""mm a step: 8 mm/s."""
STRANDS = (0.25, 0.5, 1.0, 2.0)
"""Times those of the anatomy, in which each number of tubes is lifted."""
DENSE = 1.55
"""Times the strands between tubes: some 1,500 in all then, 40 to 45 % of them between tubes."""
COUPLINGS: tuple[Coupling, Coupling] = ("exact", "lagged")
LED = ((1e-3, 8.0), (1.0 / 30.0, 8.0), (1.0 / 30.0, 25.0))
"""s of a step and mm/s of the hand, at which both are compared."""


def subset_of(anatomy: Anatomy, tubes: int, strands: float = 1.0, between: float = 1.0) -> Anatomy:
    """Return an anatomy of its first tubes, with so many times the strands (between tubes)."""
    names = {tube.name for tube in anatomy.tube[:tubes]}

    def count(layer: LayerTable) -> int:
        times = strands * (1.0 if layer.to == "bed" else between)
        return max(1, round(times * layer.strands))

    return msgspec.structs.replace(
        anatomy,
        tube=anatomy.tube[:tubes],
        join=[join for join in anatomy.join if join.tube in names],
        layer=[
            msgspec.structs.replace(layer, strands=count(layer))
            for layer in anatomy.layer
            if {layer.tube, layer.to} <= names | {"bed"}
        ],
    )


def step_times(live: BeamOnBed, *, rods: bool, paced: bool) -> tuple[Floats, Floats]:
    """Return processor time and time by the clock of each step of a lift of the last duct, us."""
    # Steps that are paced each begin in a millisecond of their own.
    name = "gallbladder" if "gallbladder" in live.network.tubes else "common"
    node = live.take(0.3 * live.network.tubes[name].span, name)
    start = live.places[node].copy()
    if rods:
        # A grasper's jaws between cystic duct and common duct, which open slowly.
        middle = live.places_at(np.array([8.0]), "cystic")[0]
        for rod in range(2):
            live.set_rod(rod, middle + np.array([0.0, 2.0 + rod, 1.0]), (0.0, 0.0, 1.0), 0.6)
    processor, clock = np.empty((2, STEPS))
    due = time.perf_counter()
    for number in range(STEPS):
        if paced:
            due = max(due + SECONDS, time.perf_counter())
            wait_until(due)
        begun, seen = time.thread_time(), time.perf_counter()
        live.lead(node, start + np.array([0.0, 0.0, LIFT * number]))
        for rod in range(2 if rods else 0):
            tip = live.state.rods_to[rod, :3]
            live.lead_rod(rod, tip + np.array([(2 * rod - 1) * 2e-3, 0.0, 0.0]))
        live.tick(SECONDS)
        clock[number] = 1e6 * (time.perf_counter() - seen)
        processor[number] = 1e6 * (time.thread_time() - begun)
    return processor[WARM_STEPS:], clock[WARM_STEPS:]


def figures_of(lifts: list[tuple[Floats, Floats]]) -> dict[str, float]:
    """Return the least median of some lifts and the 99.9th percentile of all their steps, us."""
    # Others can only make a lift longer; a loop at 1 kHz has to bear its slow steps all the same.
    (processor, clock) = np.stack(lifts, axis=1)
    return {
        "median_us": float(np.median(processor, axis=1).min()),
        "p99_9_us": float(np.percentile(processor, 99.9)),
        "clock_median_us": float(np.median(clock, axis=1).min()),
        "clock_p99_9_us": float(np.percentile(clock, 99.9)),
    }


def lifted(
    tubes: AnatomyNetwork, coupling: Coupling, seconds: float, speed: float
) -> tuple[Floats, float]:
    """Return a hand's force at each step of a lift of 12 mm, N, and the median time of one, s."""
    live = BeamOnBed(tubes.network, tubes.strands, floor=tubes.floor, coupling=coupling)
    node = live.take(0.3 * live.network.tubes["gallbladder"].span, "gallbladder")
    start, steps = live.places[node].copy(), round(12.0 / (speed * seconds))
    forces, times = np.empty(steps), np.empty(steps)
    for number in range(steps):
        begun = time.thread_time()
        live.lead(node, start + np.array([0.0, 0.0, speed * seconds * number]))
        live.tick(seconds)
        times[number] = time.thread_time() - begun
        forces[number] = np.linalg.norm(live.hand_force(node))
    return forces, float(np.median(times))


def draw_growth(figures: dict[str, Any], path: Path) -> None:
    """Draw a step's median time over strands, a line for each number of tubes."""
    from matplotlib.figure import Figure  # of the extra report

    figure = Figure(figsize=(7.0, 4.2), layout="constrained")
    axes = figure.subplots()
    count = len(anatomy_named(ANATOMY).tube)
    for tubes in range(count, 0, -1):
        for rods in (False, True) if tubes > 1 else (False,):
            found = [figures[_key(ANATOMY, tubes, strands, rods=rods)] for strands in STRANDS]
            axes.plot(
                [each["strands"] for each in found],
                [each["median_us"] for each in found],
                "s--" if rods else "o-",
                color=COLOURS[tubes - 1],
                markersize=4,
                label=f"{tubes} {'tubes' if tubes > 1 else 'tube'}{', two rods' if rods else ''}",
            )
    axes.set_xlabel("strands")
    axes.set_ylabel("a step of 1 ms, median, µs")
    axes.set_xlim(left=0.0)
    axes.set_ylim(bottom=0.0)
    axes.grid(alpha=0.3)
    figure.legend(loc="outside right center", frameon=False)
    drawn = BytesIO()
    kind = figure_kind(path)
    figure.savefig(drawn, format=kind, metadata={"Date": None} if kind == "svg" else None)
    write_atomic(path, drawn.getvalue())


def _key(name: str, tubes: int, strands: float, *, rods: bool) -> str:
    return f"{name}_{tubes}_tubes_{strands:g}_strands" + ("_two_rods" if rods else "")


def _growth(console: Console, usual: Anatomy) -> dict[str, Any]:
    """Print and return the figures of numbers of tubes and strands, and of the other anatomies."""
    others = [anatomy_named(each) for each in shipped_anatomies() if each != ANATOMY]
    cases = {
        _key(ANATOMY, tubes, strands, rods=rods): (usual, tubes, strands, rods)
        for tubes in range(1, len(usual.tube) + 1)
        for rods in ((False, True) if tubes > 1 else (False,))
        for strands in STRANDS
    }
    cases |= {
        _key(each.name, len(each.tube), 1.0, rods=False): (each, len(each.tube), 1.0, False)
        for each in others
    }
    # In rounds of all cases, so that a slow while of the machine is not one case's alone.
    lifts: dict[str, list[tuple[Floats, Floats]]] = {key: [] for key in cases}
    built: dict[str, dict[str, float]] = {}
    for _ in range(REPEATS):
        for key, (anatomy, tubes, strands, rods) in cases.items():
            begun = time.thread_time()
            network = anatomy_network(subset_of(anatomy, tubes, strands))
            live = network.on_bed(rods=2)
            built[key] = {
                "built_ms": 1e3 * (time.thread_time() - begun),
                "strands": network.strands.count,
                "nodes": len(live.places),
                "blocks": len(live.state.block),
            }
            lifts[key].append(step_times(live, rods=rods, paced=False))
    figures = {key: figures_of(lifts[key]) | built[key] for key in cases}
    console.print("\nTubes, lifted: processor time of a step of 1/1000 s, us")
    for key, (anatomy, tubes, _, rods) in cases.items():
        found = figures[key]
        console.print(
            f"{anatomy.name}, {tubes} tubes, {found['nodes']} nodes, {found['strands']} strands"
            f"{', two rods' if rods else ''}: median "
            f"{found['median_us']:.0f}, 99.9 % {found['p99_9_us']:.0f}",
            highlight=False,
        )
    return figures


def _dense(console: Console, usual: Anatomy) -> dict[str, Any]:
    """Print and return the figures of more strands between tubes, also of steps at 1 kHz."""
    count = len(usual.tube)
    network = anatomy_network(subset_of(usual, count, between=DENSE))
    strands, between = network.strands.count, int((network.strands.to >= 0).sum())
    figures: dict[str, Any] = {"strands": strands, "between_tubes": between}
    console.print(
        f"{usual.name}, {count} tubes, {strands} strands, {between} of them between tubes "
        f"({between / strands:.0%})",
        highlight=False,
    )
    cases = list(product((False, True), (False, True)))
    lifts: dict[tuple[bool, bool], list[tuple[Floats, Floats]]] = {each: [] for each in cases}
    for _, (rods, paced) in product(range(REPEATS), cases):
        live = network.on_bed(rods=2)
        lifts[rods, paced].append(step_times(live, rods=rods, paced=paced))
    for (rods, paced), each in lifts.items():
        name = f"{'two rods' if rods else 'no rods'}, {'at 1 kHz' if paced else 'back to back'}"
        figures[name] = found = figures_of(each)
        console.print(
            f"  {name}: median {found['median_us']:.0f}, 99.9 % {found['p99_9_us']:.0f}; by the "
            f"clock {found['clock_median_us']:.0f}, {found['clock_p99_9_us']:.0f}",
            highlight=False,
        )
    return figures


def measure_network(console: Console, figure: Path | None = None) -> dict[str, Any]:
    """Print and return the figures of a step, all of one run, and draw how they grow."""
    usual = anatomy_named(ANATOMY)
    figures = _growth(console, usual)
    if figure is not None:
        draw_growth(figures, figure)
    figures["dense"] = _dense(console, usual)
    tubes = anatomy_network(usual)
    for seconds, speed in LED:
        (exact, cost), (lagged, saved) = (lifted(tubes, c, seconds, speed) for c in COUPLINGS)
        off = float(np.abs(lagged - exact).max() / exact.max())
        figures[f"lagged_{1e3 * seconds:.0f}_ms_{speed:g}_mm_per_s"] = {
            "off": off, "us": 1e6 * saved, "exact_us": 1e6 * cost,
        }  # fmt: skip
        console.print(
            f"strands between tubes lagged, not exactly coupled, {1e3 * seconds:.0f} ms a step, "
            f"{speed:g} mm/s: {1e6 * saved:.0f} for {1e6 * cost:.0f}, force off by {off:.2%}",
            highlight=False,
        )
    return figures
