"""What one step of a trainee's session costs: beam, criterion and skin, without a viewer."""

import time

import numpy as np

from app.command_line.load import shipped_organ
from app.simulation.session import Session

__all__ = ["step_figures"]

TICK = 1.0 / 30.0
"""Time from one step to the next, s."""
PULLS = 40
"""Times that the duct is let go and pulled again."""
SKINS = 2000


def step_figures() -> dict[str, float]:
    """Return the median time of one step of a pulled session, whole and of its skin.

    Returns
    -------
    dict[str, float]
        `vertices` of the skin, `step_us` and `skin_us`.
    """
    session = Session(shipped_organ())
    dissection = session.dissection
    limit = 0.6 * session.force_limit

    def timed(times: list[float], force: float) -> None:
        session.set_force(force)
        while True:
            start = time.perf_counter()
            moved = session.step(TICK)
            if not moved:
                return
            times.append(time.perf_counter() - start)

    timed([], limit)
    steps: list[float] = []
    for _ in range(PULLS):
        timed(steps, 0.0)
        timed(steps, limit)
    surface = session.surfaces[0]
    bound = surface.skin.bound_to(dissection.driving)
    transforms = dissection.rest_transforms()
    out = np.empty_like(surface.vertices)
    skins: list[float] = []
    for _ in range(SKINS):
        start = time.perf_counter()
        bound.deform(transforms, out)
        skins.append(time.perf_counter() - start)
    return {
        "vertices": float(len(out)),
        "step_us": 1e6 * float(np.median(steps)),
        "skin_us": 1e6 * float(np.median(skins)),
    }
