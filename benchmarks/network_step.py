"""A step of 1/1000 s of an anatomy's tubes: what rods, tubes and strands cost.

Processor time, in which what else the machine does counts only by what it takes of the caches.
"""

import time
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray
from rich.console import Console

from app.anatomy.anatomy_file import anatomy_named, shipped_anatomies
from app.anatomy.anatomy_network import AnatomyNetwork, anatomy_network
from app.anatomy.tables import Anatomy
from physics.bed import BeamOnBed
from physics.bed.layout import Coupling

Floats = NDArray[np.float64]

ANATOMY = "normal"
"""That whose tubes and strands are varied."""
STEPS, SECONDS = 1000, 1e-3
LIFT = 8e-3
"""mm a step: 8 mm/s."""
COUPLINGS: tuple[Coupling, Coupling] = ("exact", "lagged")
LED = ((1e-3, 8.0), (1.0 / 30.0, 8.0), (1.0 / 30.0, 25.0))
"""s of a step and mm/s of the hand, at which both are compared."""


def subset_of(anatomy: Anatomy, tubes: int, strands: float = 1.0) -> Anatomy:
    """Return an anatomy of its first tubes, with so many times the strands."""
    names = {tube.name for tube in anatomy.tube[:tubes]}
    return msgspec.structs.replace(
        anatomy,
        tube=anatomy.tube[:tubes],
        join=[join for join in anatomy.join if join.tube in names],
        layer=[
            msgspec.structs.replace(layer, strands=max(1, round(strands * layer.strands)))
            for layer in anatomy.layer
            if {layer.tube, layer.to} <= names | {"bed"}
        ],
    )


def pulled(live: BeamOnBed, rods: bool) -> dict[str, float]:
    """Return median and 99.9th percentile of a step, us, while the last duct is lifted."""
    name = "gallbladder" if "gallbladder" in live.network.tubes else "common"
    node = live.take(0.3 * live.network.tubes[name].span, name)
    start = live.places[node].copy()
    if rods:
        # A grasper's jaws between cystic duct and common duct, which open slowly.
        middle = live.places_at(np.array([8.0]), "cystic")[0]
        for rod in range(2):
            live.set_rod(rod, middle + np.array([0.0, 2.0 + rod, 1.0]), (0.0, 0.0, 1.0), 0.6)
    times = np.empty(STEPS)
    for number in range(STEPS):
        begun = time.thread_time()
        live.lead(node, start + np.array([0.0, 0.0, LIFT * number]))
        for rod in range(2 if rods else 0):
            tip = live.state.rods_to[rod, :3]
            live.lead_rod(rod, tip + np.array([(2 * rod - 1) * 2e-3, 0.0, 0.0]))
        live.tick(SECONDS)
        times[number] = 1e6 * (time.thread_time() - begun)
    return {
        "median_us": float(np.median(times[50:])),
        "p99_9_us": float(np.percentile(times[50:], 99.9)),
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


def measure_network(console: Console) -> dict[str, Any]:
    """Print and return the figures of a step, all of one run."""
    usual = anatomy_named(ANATOMY)
    others = [anatomy_named(each) for each in shipped_anatomies() if each != ANATOMY]
    count = len(usual.tube)
    cases = [
        *((usual, count, 1.0, rods) for rods in (False, True)),
        *((usual, tubes, 1.0, False) for tubes in range(1, count)),
        *((usual, count, strands, False) for strands in (0.25, 0.5, 2.0)),
        *((each, len(each.tube), 1.0, False) for each in others),
    ]
    figures: dict[str, Any] = {}
    console.print("\nTubes, lifted: processor time of a step of 1/1000 s, us")
    for anatomy, tubes, strands, rods in cases:
        begun = time.thread_time()
        network = anatomy_network(subset_of(anatomy, tubes, strands))
        live = network.on_bed(rods=2)
        built = time.thread_time() - begun
        found = pulled(live, rods)
        found |= {"strands": network.strands.count, "nodes": len(live.places)}
        found |= {"blocks": len(live.state.block), "built_ms": 1e3 * built}
        key = f"{anatomy.name}_{tubes}_tubes_{strands:g}_strands"
        figures[key + ("_two_rods" if rods else "")] = found
        console.print(
            f"{anatomy.name}, {tubes} tubes, {found['nodes']} nodes, {found['strands']} strands"
            f"{', two rods' if rods else ''}: median "
            f"{found['median_us']:.0f}, 99.9 % {found['p99_9_us']:.0f}",
            highlight=False,
        )
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
