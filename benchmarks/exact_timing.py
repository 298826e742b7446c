"""Time of a warm solve of the exact beam, inside compiled code and from Python, on one core.

Run from the root of the repository: ``python -m benchmarks.exact_timing``.
"""

import time
from collections.abc import Callable

import numpy as np
from numba import njit
from numpy.typing import NDArray

from physics import Beam, Exact
from physics import exact_kernels as kernels

DUCT = Beam.round(span=50.8, diameter=8.89, modulus=0.310264)
FORCE = 3.5
"""The grasper's whole force at which the duct of the thesis breaks, N."""
THEORIES = {
    "linear": Exact(),
    "linear, shear": Exact(shear=True),
    "neo-hooke, shear": Exact(shear=True, law="neo-hooke"),
}
SOLVES = 5000
REPEATS = 9


@njit  # not cached: a cache does not notice a change in the kernels' file
def walk(
    state: kernels.State, law: int, grasp: int, control: int, loads: NDArray[np.float64]
) -> int:
    """Solve for one load after the other; return how many were not found."""
    missed = 0
    for load in loads:
        missed += kernels.solve(state, law, grasp, control, load) != kernels.FOUND
    return missed


def steps(middle: float) -> NDArray[np.float64]:
    """Return loads around a middle one that rise and fall by 1 % from one to the next.

    Parameters
    ----------
    middle
        The middle load.

    Returns
    -------
    NDArray[np.float64]
        (SOLVES,) loads.
    """
    wave = np.abs((np.arange(SOLVES) % 80) - 40) - 20.0
    return middle * 1.01**wave


def fastest(action: Callable[[], object]) -> float:
    """Return the shortest time of some runs, us per solve.

    Parameters
    ----------
    action
        What to run.

    Returns
    -------
    float
        The time.
    """
    action()
    times: list[float] = []
    for _ in range(REPEATS):
        start = time.perf_counter()
        action()
        times.append(time.perf_counter() - start)
    return 1e6 * min(times) / SOLVES


def warm(theory: Exact, grasp: float, control: int) -> tuple[float, float]:
    """Return the time of a warm solve, us, compiled and called from Python.

    Parameters
    ----------
    theory
        The theory.
    grasp
        Distance of the grasp from the first clamp, mm.
    control
        `kernels.BY_FORCE` or `kernels.BY_DEFLECTION`.

    Returns
    -------
    tuple[float, float]
        Both times.

    Raises
    ------
    RuntimeError
        If a load was not found.
    """
    solver = theory.solver(DUCT, grasp)
    deflection = solver.solve_force(FORCE)
    by_force = control == kernels.BY_FORCE
    state, law, part = solver._state, solver._law, solver._part
    loads = steps(float(state[4][kernels.FORCE if by_force else kernels.DEFLECTION]))
    if walk(state, law, part, control, loads):
        raise RuntimeError("a load of the walk was not found")
    compiled = fastest(lambda: walk(state, law, part, control, loads))
    listed = steps(FORCE if by_force else deflection).tolist()
    solve = solver.solve_force if by_force else solver.solve_deflection
    return compiled, fastest(lambda: [solve(load) for load in listed])


def cold(theory: Exact, grasp: float) -> float:
    """Return the time of a solve from rest, us, called from Python.

    Parameters
    ----------
    theory
        The theory.
    grasp
        Distance of the grasp from the first clamp, mm.

    Returns
    -------
    float
        The time.
    """
    solver = theory.solver(DUCT, grasp)

    def again() -> None:
        for _ in range(SOLVES):
            solver.rest()
            solver.solve_force(FORCE)

    return fastest(again)


def main() -> None:
    """Print a table of microseconds."""
    print(f"{'us a solve; warm: load step 1 %':44} {'compiled':>9} {'Python':>9}")
    for name, theory in THEORIES.items():
        for place, grasp in (("centre", 25.4), ("30 %", 15.24)):
            for control, by in ((kernels.BY_FORCE, "force"), (kernels.BY_DEFLECTION, "deflection")):
                compiled, called = warm(theory, grasp, control)
                print(f"{name + ', ' + place + ', by ' + by:44} {compiled:9.2f} {called:9.2f}")
            print(f"{name + ', ' + place + ', cold':44} {'':9} {cold(theory, grasp):9.1f}")


if __name__ == "__main__":
    main()
