"""A step of 1/1000 s of a duct in its bed while strands part, beside peers of as many strands.

Processor time, in which what else the machine does counts only by what it takes of the caches.
"""

import time
from collections.abc import Callable
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console

from benchmarks.duct import DUCT
from kernel_cache import njit
from physics import Exponential, Law, Linear, NeoHooke
from physics.bed import BeamOnBed, Bed, Relaxation, SpaceBeam, Strands

Floats = NDArray[np.float64]

ELEMENTS, STEPS, SECONDS = 40, 2000, 1e-3
LIFT = 6e-3
"""mm a step: 6 mm/s, at which strands part from the second half of a second on."""
DENSITY = 1e-9
"""tonne/mm^3."""


LINEAR = Linear(shear=True)
TWO = Relaxation((0.2, 0.225), (3.83, 30.15))
"""Two branches, of strands and of the wall."""


def layer(strands: int) -> Bed:
    """Return a normal bed of so many strands."""
    return Bed(
        strands=strands, stiffness=0.036, toughness=0.109, softening=8.0 / 3.0, floor=0.3,
        around=1.2, fan=0.4, slack=1.0, scatter=0.3, jitter=1.0, seed=7,
    )  # fmt: skip


def timed(step: Callable[[int], object]) -> Floats:
    """Return the times of `STEPS` steps, us, after some that warm up."""
    times = np.empty(STEPS)
    for number in range(STEPS):
        start = time.thread_time()
        step(number)
        times[number] = 1e6 * (time.thread_time() - start)
    return times[50:]


def ours(
    strands: int, law: Law = LINEAR, *, relaxation: Relaxation | None = None
) -> tuple[Floats, int]:
    """Return the times of our steps and how many strands have parted."""
    beam = SpaceBeam.of(DUCT, law=law, elements=ELEMENTS)
    bed = layer(strands)
    live = BeamOnBed(
        beam, bed.strands_under(beam), floor=bed.floor_under(beam),
        strand_relaxation=relaxation, wall_relaxation=relaxation,
    )  # fmt: skip
    node = live.take(0.5 * beam.span)
    start = live.places[node].copy()

    def step(number: int) -> None:
        live.lead(node, start + np.array([0.0, 0.0, LIFT * number]))
        live.tick(SECONDS)

    return timed(step), live.broken


@njit(cache=True)
def strand_forces(
    x: Floats, f: Floats, node: NDArray[np.int64], arm: Floats, feet: Floats, law: Floats,
    most: Floats,
) -> None:  # fmt: skip
    """Add the forces of strands that yield and part to those on the nodes."""
    for s in range(node.size):
        if most[s] >= law[3, s]:
            continue
        d0 = x[node[s], 0] + arm[s, 0] - feet[s, 0]
        d1 = x[node[s], 1] + arm[s, 1] - feet[s, 1]
        d2 = x[node[s], 2] + arm[s, 2] - feet[s, 2]
        length = np.sqrt(d0 * d0 + d1 * d1 + d2 * d2)
        u = length - law[1, s]
        if u <= 0.0:
            continue
        most[s] = max(most[s], u)
        soft = 1.0
        if most[s] > law[2, s]:
            soft = law[2, s] * (law[3, s] - most[s]) / (most[s] * (law[3, s] - law[2, s]))
        pull = soft * law[0, s] * u / length
        f[node[s], 0] -= pull * d0
        f[node[s], 1] -= pull * d1
        f[node[s], 2] -= pull * d2


@njit(cache=True)
def spring_step(
    x: Floats, v: Floats, rest: Floats, node: NDArray[np.int64], arm: Floats, feet: Floats,
    law: Floats, most: Floats, stretching: float, bending: float, mass: float, count: int,
) -> None:  # fmt: skip
    """Take `count` semi-implicit steps of masses with springs along, between and to the bed."""
    dt = SECONDS / count
    nodes = x.shape[0]
    f = np.zeros_like(x)
    for _ in range(count):
        f[:] = 0.0
        for i in range(nodes - 1):
            d = x[i + 1] - x[i]
            length = np.sqrt((d * d).sum())
            pull = stretching * (length - rest[i]) / length
            f[i] += pull * d
            f[i + 1] -= pull * d
        for i in range(1, nodes - 1):
            bend = bending * (x[i - 1] - 2.0 * x[i] + x[i + 1])
            f[i] += 2.0 * bend
            f[i - 1] -= bend
            f[i + 1] -= bend
        strand_forces(x, f, node, arm, feet, law, most)
        for i in range(1, nodes - 1):
            if i != nodes // 2:
                for r in range(3):
                    v[i, r] = 0.999 * v[i, r] + dt * f[i, r] / mass
                    x[i, r] += dt * v[i, r]


def mass_spring(strands: int) -> tuple[Floats, int]:
    """Return the times of a mass-spring bed of the same strands, without torsion and turning."""
    beam = SpaceBeam.of(DUCT, elements=ELEMENTS)
    each = layer(strands).strands_under(beam)
    x = beam.places.copy()
    h = beam.span / ELEMENTS
    node = np.rint(each.stations / h).astype(np.int64)
    law = np.stack([each.stiffness, each.length, each.yield_elongation, each.failure_elongation])
    stretching, bending = DUCT.modulus * DUCT.area / h, DUCT.modulus * DUCT.second_moment / h**3
    mass = DENSITY * DUCT.area * h
    # Stable below 2 over the fastest mode, of alternate nodes.
    count = int(np.ceil(SECONDS * np.sqrt((4.0 * stretching + 16.0 * bending) / mass) / 1.8))
    v, most = np.zeros_like(x), np.zeros(each.count)
    rest = np.full(ELEMENTS, h)
    arm = each.ends - x[node]

    def step(number: int) -> None:
        x[ELEMENTS // 2, 2] = LIFT * number
        spring_step(x, v, rest, node, arm, each.feet, law, most, stretching, bending, mass, count)

    return timed(step), int((most >= law[3]).sum())


def mujoco(strands: int) -> tuple[Floats, int]:
    """Return the times of MuJoCo: links with a slide and a hinge each, strands as tendons."""
    peer: Any = import_module("mujoco")
    beam = SpaceBeam.of(DUCT, elements=ELEMENTS)
    each = layer(strands).strands_under(beam)
    model = peer.MjModel.from_xml_string(_model(beam, each))
    data = peer.MjData(model)
    breaking = each.length + each.failure_elongation

    def step(number: int) -> None:
        data.mocap_pos[0, 2] = LIFT * number
        peer.mj_step(model, data)
        model.tendon_stiffness[data.ten_length > breaking] = 0.0

    times = timed(step)
    if not np.isfinite(data.qpos).all():
        raise ArithmeticError("its chain has left")
    return times, int((model.tendon_stiffness == 0.0).sum())


def elastica(strands: int) -> tuple[Floats, int]:
    """Return the times of PyElastica: a Cosserat rod in explicit steps, the same strands on it."""
    peer: Any = import_module("elastica")
    beam = SpaceBeam.of(DUCT, elements=ELEMENTS)
    each = layer(strands).strands_under(beam)
    node = np.rint(each.stations / (beam.span / ELEMENTS)).astype(np.int64)
    law = np.stack([each.stiffness, each.length, each.yield_elongation, each.failure_elongation])
    most, arm, middle = np.zeros(each.count), each.ends - beam.places[node], ELEMENTS // 2

    classes = (peer.BaseSystemCollection, peer.Constraints, peer.Forcing, peer.Damping)
    simulator = type("Simulator", classes, {})()

    class Pulls(peer.NoForces):
        def apply_forces(self, system: Any, time: float = 0.0) -> None:
            x, f = system.position_collection.T, system.external_forces.T
            strand_forces(x, f, node, arm, each.feet, law, most)

    class Held(peer.ConstraintBase):
        height = 0.0

        def constrain_values(self, system: Any, time: float) -> None:
            system.position_collection[2, middle] = Held.height

        def constrain_rates(self, system: Any, time: float) -> None:
            system.velocity_collection[:, middle] = 0.0

    rod = peer.CosseratRod.straight_rod(
        ELEMENTS, np.zeros(3), np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0]), beam.span,
        float(beam.radius[0]), DENSITY, youngs_modulus=DUCT.modulus,
        shear_modulus=0.5 * DUCT.modulus / (1.0 + DUCT.poisson_ratio),
    )  # fmt: skip
    # A wave crosses half an element in a step: 0.7 of one leaves it.
    count = int(np.ceil(SECONDS / (0.5 * beam.span / ELEMENTS * np.sqrt(DENSITY / DUCT.modulus))))
    dt = SECONDS / count
    simulator.append(rod)
    ends = {"constrained_position_idx": (0, -1), "constrained_director_idx": (0, -1)}
    simulator.constrain(rod).using(peer.FixedConstraint, **ends)
    simulator.constrain(rod).using(Held)
    simulator.add_forcing_to(rod).using(Pulls)
    simulator.dampen(rod).using(
        peer.AnalyticalLinearDamper, uniform_damping_constant=100.0, time_step=dt
    )
    simulator.finalize()
    stepper = peer.PositionVerlet()

    def step(number: int) -> None:
        Held.height = LIFT * number
        for index in range(count):
            stepper.step(simulator, number * SECONDS + index * dt, dt)

    times = timed(step)
    if not np.isfinite(rod.position_collection).all():
        raise ArithmeticError("its rod has left")
    return times, int((most >= law[3]).sum())


def _model(beam: SpaceBeam, each: Strands) -> str:
    """Return MuJoCo's description: planar, both ends held by welds, as the middle is."""
    h = beam.span / ELEMENTS
    mass = 1e3 * DENSITY * DUCT.area * h
    turn = mass * (DUCT.second_moment / DUCT.area + h * h / 12.0)
    stretch, bend = DUCT.modulus * DUCT.area / h, DUCT.modulus * DUCT.second_moment / h
    node = np.minimum(np.rint(each.stations / h).astype(int), ELEMENTS - 1)
    arms = each.ends - beam.places[node]
    open_, close = "", ""
    for link in range(ELEMENTS):
        sites = (
            "".join(
                f'<site name="e{i}" pos="{arms[i, 0]!r} {arms[i, 1]!r} {arms[i, 2]!r}"/>'
                for i in np.flatnonzero(node == link)
            )
            .replace("np.float64(", "")
            .replace(")", "")
        )
        open_ += (
            f'<body name="b{link}" pos="{h if link else 0.0} 0 0">'
            f'<joint type="hinge" axis="0 -1 0" stiffness="{bend}" damping="{1e-3 * bend}"/>'
            f'<joint type="slide" axis="1 0 0" stiffness="{stretch}" damping="{1e-3 * stretch}"/>'
            f'<inertial pos="{0.5 * h} 0 0" mass="{mass}" diaginertia="{turn} {turn} {turn}"/>'
            f"{sites}"
        )
        close += "</body>"
    feet = "".join(
        f'<site name="f{i}" pos="{a} {b} {c}"/>' for i, (a, b, c) in enumerate(each.feet.tolist())
    )
    tendons = "".join(
        f'<spatial stiffness="{k}" springlength="0 {length}"><site site="e{i}"/>'
        f'<site site="f{i}"/></spatial>'
        for i, (k, length) in enumerate(
            zip(each.stiffness.tolist(), each.length.tolist(), strict=True)
        )
    )
    return (
        f'<mujoco><compiler angle="radian"/><option timestep="{SECONDS}" '
        'integrator="implicitfast" gravity="0 0 0"><flag contact="disable"/></option>'
        f'<worldbody><body name="hand" mocap="true" pos="{0.5 * beam.span} 0 0"/>'
        f"{feet}{open_}{close}</worldbody><equality>"
        f'<connect body1="hand" body2="b{ELEMENTS // 2}" anchor="0 0 0"/>'
        f'<connect body1="b{ELEMENTS - 1}" anchor="{h} 0 0"/></equality>'
        f"<tendon>{tendons}</tendon></mujoco>"
    )


PLAYS = {
    "ours_600": lambda: ours(600),
    "ours_neo_hooke_600": lambda: ours(600, NeoHooke()),
    "ours_exponential_600": lambda: ours(600, Exponential(6.0)),
    "ours_relaxing_600": lambda: ours(600, relaxation=TWO),
    "ours_2000": lambda: ours(2000),
    "mass_spring_600": lambda: mass_spring(600),
    "mujoco_600": lambda: mujoco(600),
    "pyelastica_600": lambda: elastica(600),
}


def bed_figures() -> dict[str, Any]:
    """Return medians and 99.9th percentiles, us, and the strands that parted; notes on peers."""
    figures: dict[str, Any] = {}
    for name, play in PLAYS.items():
        try:
            times, parted = play()
        except Exception as failure:  # whatever a peer raises, the others are still measured
            figures[f"{name}_note"] = str(failure)
            continue
        figures[f"{name}_median_us"] = float(np.median(times))
        figures[f"{name}_p99_9_us"] = float(np.percentile(times, 99.9))
        figures[f"{name}_parted"] = parted
    return figures


def measure_bed(console: Console) -> dict[str, Any]:
    """Print and return the figures of a step."""
    ours(1)
    with console.status("Pulling ducts off their beds ..."):
        figures = bed_figures()
    console.print(
        f"\nDuct of {ELEMENTS} elements lifted off its bed: processor time of a step of 1/1000 s"
    )
    first = figures["ours_600_median_us"]
    for name in PLAYS:
        if f"{name}_note" in figures:
            console.print(f"{name}: {figures[f'{name}_note']}", highlight=False, markup=False)
            continue
        median = figures[f"{name}_median_us"]
        console.print(
            f"{name:<16} median {median:.0f} us ({median / first:.2g} of ours), 99.9 % "
            f"{figures[f'{name}_p99_9_us']:.0f} us; {figures[f'{name}_parted']} strands parted",
            highlight=False,
        )
    return figures
