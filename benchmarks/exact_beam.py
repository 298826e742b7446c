"""Time of a solve of the exact beam, inside compiled code and from Python, on one core."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from benchmarks.duct import CENTRE, DUCT, FORCE, OFF_CENTRE, relative_error, walk_about
from benchmarks.engine import Engine
from benchmarks.stopwatch import microseconds
from physics import Exact, Linear, NeoHooke
from physics.exact import symbols
from physics.exact.newton import solve
from physics.exact.state import State
from physics.exact.symbols import BY_DEFLECTION, BY_FORCE, FOUND

THEORIES = {
    "exact": ("exact", Exact()),
    "exact_shear": ("exact, shear", Exact(Linear(shear=True))),
    "exact_neo_hooke": ("exact, neo-hooke", Exact(NeoHooke())),
}
"""Keys of the figures, titles and theories."""
GRASPS = {"centre": ("centre", CENTRE), "offcentre": ("30 %", OFF_CENTRE)}
SOLVES = 5000
COLD_SOLVES = 1000


@njit  # not cached: it is compiled for this run only
def walk(
    state: State,
    fibres: NDArray[np.float64] | None,
    grasp: int | None,
    control: int,
    loads: NDArray[np.float64],
) -> int:
    """Solve for one load after the other; return how many were not found."""
    missed = 0
    for load in loads:
        missed += solve(state, fibres, grasp, control, load) != FOUND
    return missed


def compiled(theory: Exact, grasp: float, control: int) -> float:
    """Return the time of a warm solve inside compiled code, us."""
    pull = theory.pull(DUCT, grasp).to_force(FORCE)
    state, fibres, grasp_node = pull._state, pull._fibres, pull._grasp
    here = pull._line[symbols.FORCE if control == BY_FORCE else symbols.DEFLECTION]
    loads = walk_about(float(here), SOLVES)
    if walk(state, fibres, grasp_node, control, loads):
        raise RuntimeError("a load of the walk was not found")
    return microseconds(lambda: walk(state, fibres, grasp_node, control, loads), SOLVES)


def called(theory: Exact, grasp: float) -> float:
    """Return the time of a warm solve by force called from Python, us."""
    solve = theory.pull(DUCT, grasp).to_force
    loads = walk_about(FORCE, SOLVES).tolist()

    def again() -> None:
        for load in loads:
            solve(load)

    return microseconds(again, SOLVES)


def cold(theory: Exact, grasp: float) -> float:
    """Return the time of a solve by force from rest, called from Python, us."""
    solver = theory.pull(DUCT, grasp)

    def again() -> None:
        for _ in range(COLD_SOLVES):
            solver.rest()
            solver.to_force(FORCE)

    return microseconds(again, COLD_SOLVES)


def exact_engines() -> list[Engine]:
    """Return the exact beam's times: by law and grasp, force and deflection, warm and cold."""
    engines: list[Engine] = []
    for name, (law, theory) in THEORIES.items():
        for place, (at, grasp) in GRASPS.items():
            error = relative_error(
                theory.pull(DUCT, grasp).to_force(FORCE).deflection, theory, grasp
            )
            warm, pulled = compiled(theory, grasp, BY_FORCE), f"{law}, {at}"
            held = compiled(theory, grasp, BY_DEFLECTION)
            key = name if name != "exact" and place == "centre" else f"{name}_{place}"
            call = "exact" if key == "exact_centre" else key
            asked, unloaded = called(theory, grasp), cold(theory, grasp)
            timed = [
                Engine(f"{key}_warm", pulled, warm, error),
                Engine(f"{key}_deflection_warm", f"{pulled}, by deflection", held, error),
                Engine(f"{call}_python_call", f"{pulled}, a call", asked, error),
                Engine(f"{call}_cold", f"{pulled}, a cold call", unloaded, error),
            ]
            engines += [engine.checked() for engine in timed]
    return engines
