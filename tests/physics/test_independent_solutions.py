"""Beams of own sections and paths of hooks, against solutions that share nothing with the program.

The plane beam's equations [Reissner 1972] are integrated by `scipy`, from clamp to clamp.
"""

import math
from functools import partial

import numpy as np
import pytest
from scipy.integrate import solve_bvp

from physics import Beam, Exact, Linear, VaryingBeam
from physics.bed import BeamOnBed, Bed, SpaceBeam

SPAN, MODULUS, POISSON = 36.0, 0.31, 0.3
# A hollow taper: outer radius 2.4 to 4.2 mm, wall 1.0 to 0.7 mm.
AT = np.linspace(0.0, SPAN, 25)
OUTER, WALL = 2.4 + 1.8 * AT / SPAN, 1.0 - 0.3 * AT / SPAN
AREA = math.pi * (OUTER**2 - (OUTER - WALL) ** 2)
SECOND = 0.25 * math.pi * (OUTER**4 - (OUTER - WALL) ** 4)
SHEARED = 0.55 * AREA
TAPER = VaryingBeam(
    stations=AT, areas=AREA, second_moments=SECOND, fibre_distances=OUTER, modulus=MODULUS,
    poisson_ratio=POISSON, shear_areas=SHEARED,
)  # fmt: skip


def integrated(grasp: float, deflection: float, *, shear: bool) -> tuple[float, float]:
    """Return the force, N, and the largest stress, MPa, of the taper, by collocation."""
    lengths = grasp, SPAN - grasp

    def stations(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return lengths[0] * t, grasp + lengths[1] * t

    def resultants(theta: np.ndarray, along: float, up: float) -> tuple[np.ndarray, np.ndarray]:
        cos, sin = np.cos(theta), np.sin(theta)
        return along * cos + up * sin, up * cos - along * sin

    def slopes(t: np.ndarray, y: np.ndarray, p: np.ndarray) -> np.ndarray:
        # Of both parts: places along and up, rotation and moment; p: forces along, and up in each.
        out: list[np.ndarray] = []
        for index, s in enumerate(stations(t)):
            _, _, theta, moment = y[4 * index : 4 * index + 4]
            normal, across = resultants(theta, p[0], p[1 + index])
            area, second, sheared = (np.interp(s, AT, row) for row in (AREA, SECOND, SHEARED))
            longer = 1.0 + normal / (MODULUS * area)
            slides = across / (0.5 * MODULUS / (1.0 + POISSON) * sheared) if shear else 0.0 * s
            cos, sin = np.cos(theta), np.sin(theta)
            rows = [
                longer * cos - slides * sin, longer * sin + slides * cos,
                moment / (MODULUS * second), slides * normal - longer * across,
            ]  # fmt: skip
            out += [lengths[index] * row for row in rows]
        return np.array(out)

    def held(a: np.ndarray, b: np.ndarray, p: np.ndarray, goal: float) -> np.ndarray:
        del p
        ends = [*a[:3], b[4] - SPAN, *b[5:7], *(b[:4] - a[4:]), b[1] - goal]
        return np.array(ends)

    t = np.linspace(0.0, 1.0, 61)
    y, p = np.zeros((8, t.size)), np.array([0.0, 1e-3, -1e-3])
    y[0], y[4] = stations(t)
    solved = None
    for goal in np.array([0.05, 0.3, 0.65, 1.0]) * deflection:
        solved = solve_bvp(slopes, partial(held, goal=goal), t, y, p=p, tol=1e-7, max_nodes=20_000)
        assert solved.success, solved.message
        t, y, p = solved.x, solved.y, solved.p
    assert solved is not None
    fine, worst = np.linspace(0.0, 1.0, 400), 0.0
    y = solved.sol(fine)
    for index, s in enumerate(stations(fine)):
        area, second, outer = (np.interp(s, AT, row) for row in (AREA, SECOND, OUTER))
        normal, _ = resultants(y[4 * index + 2], p[0], p[1 + index])
        worst = max(worst, float((normal / area + np.abs(y[4 * index + 3]) * outer / second).max()))
    return float(p[1] - p[2]), worst


@pytest.mark.parametrize("shear", [False, True])
@pytest.mark.parametrize(("grasp", "deflection"), [(12.0, 3.0), (26.0, 6.0)])
def test_a_hollow_taper_bears_what_reissner_s_equations_say(
    grasp: float, deflection: float, *, shear: bool
) -> None:
    force, worst = integrated(grasp, deflection, shear=shear)
    pull = Exact(Linear(shear=shear)).pull(TAPER, grasp).to_deflection(deflection)
    assert pull.force == pytest.approx(force, rel=2e-5)
    there = pull.sample(np.linspace(0.0, SPAN, 400))
    assert (there.normal_stress + there.bending_stress).max() == pytest.approx(worst, rel=2e-3)


def held() -> tuple[BeamOnBed, int]:
    """A duct in a bed whose strands are far from yielding, and its hooked node."""
    duct = SpaceBeam.of(Beam.round(span=50.8, diameter=8.89, modulus=0.310264), elements=24)
    layer = Bed(strands=200, stiffness=0.02, toughness=500.0, softening=1.5, floor=0.3, fan=0.4,
                seed=3)  # fmt: skip
    made = BeamOnBed(duct, layer.strands_under(duct))
    return made, made.take(20.0)


def test_forces_and_energy_do_not_depend_on_the_path_and_come_back() -> None:
    """Where no strand yields: by two ways to one place, there and back, and there again."""
    directions = (
        [(0.0, 0.0, 3.0), (2.0, 1.0, 5.0)],
        [(4.0, 0.0, 1.0), (4.0, 3.0, 4.0), (2.0, 1.0, 5.0)],
        [(2.0, 1.0, 5.0), (0.5, 0.2, 1.0), (2.0, 1.0, 5.0)],
    )
    ends: list[list[float]] = []
    for direction in directions:
        made, node = held()
        rest, before = made.rest_place(node), np.zeros(3)
        for corner in direction:
            for index in np.linspace(0.1, 1.0, 10):
                made.lead(node, rest + before + index * (np.array(corner) - before))
                made.advance()
            before = np.array(corner)
        energy = made.energy
        assert energy.dissipated == 0.0
        assert energy.work == pytest.approx(energy.stored, rel=1e-4)
        ends.append([*made.hand_force(node).tolist(), energy.stored])
    for end in ends[1:]:
        assert end == pytest.approx(ends[0], rel=1e-7, abs=1e-8)


def test_small_pulls_of_two_hooks_are_reciprocal() -> None:
    """Betti: the force at one hook by the other's displacement, and the other way round."""
    made, first = held()
    nodes = first, made.take(36.0)
    lifted = [made.rest_place(node) + np.array([1.0, 0.5, 3.0]) for node in nodes]  # none is slack

    def force_at(moved: int, by: float) -> float:
        for number, (node, place) in enumerate(zip(nodes, lifted, strict=True)):
            made.lead(node, place + np.array([0.0, 0.0, by * (number == moved)]))
        made.advance()
        return float(made.hand_force(nodes[1 - moved])[2])

    force_at(0, 0.0)
    one, other = ((force_at(each, 0.01) - force_at(each, -0.01)) for each in (0, 1))
    assert one == pytest.approx(other, rel=1e-4)
