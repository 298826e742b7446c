"""Time of one step of a trainee's session: beam, criterion and skin, without a viewer."""

import time
from collections.abc import Callable

import numpy as np

from app.command_line.load import shipped_organ
from app.simulation import Session, free_specimen
from physics import Exact

PULLS = 40
"""Times that the duct is let go and pulled again."""
SKINS = 2000


def step_figures() -> dict[str, float]:
    """Return the median time of one step of a pulled session, whole and of its skin."""
    session = Session(free_specimen(shipped_organ()))
    dissection = session.tissue.dissection
    limit = 0.6 * session.planar.force_limit

    def timed(times: list[float], force: float) -> None:
        session.set_target_force(force)
        while True:
            start = time.perf_counter()
            moved = session.advance()
            if not moved:
                return
            times.append(time.perf_counter() - start)

    timed([], limit)
    steps: list[float] = []
    for _ in range(PULLS):
        timed(steps, 0.0)
        timed(steps, limit)
    surface = session.drawn.surfaces[0]
    bound = surface.skin.bound_to(dissection.driving)
    transforms = dissection.rest_transforms()
    out = np.empty_like(surface.vertices)
    return {
        "vertices": float(len(out)),
        "step_us": 1e6 * float(np.median(steps)),
        "skin_us": _median_us(lambda _: bound.deform(transforms, out)),
    } | _beside_figures()


def _beside_figures() -> dict[str, float]:
    """Return the times of a hand, of companions beside the duct, and of a duct at rest."""
    session = Session(free_specimen(shipped_organ()))
    stress = np.empty(len(session.drawn.surfaces[0].vertices), dtype=np.float32)
    far = 0.8 * session.planar.deflection_limit
    session.grab(0, session.planar.grasp)

    def drag(turn: int) -> None:
        session.lift(far * (0.5 + 0.3 * (turn % 2)))
        session.advance()

    found = {"hand_us": _median_us(drag)}
    session.choose_ghost(Exact())
    found["ghost_us"] = _median_us(drag)
    session.choose_ghost(None)
    session.show_chain(True)
    found["chain_us"] = _median_us(drag)
    session.show_chain(False)
    while session.advance():
        pass
    found["idle_us"] = _median_us(lambda _: session.advance())
    found["stress_us"] = _median_us(lambda _: session.stress(stress))
    return found


def _median_us(action: Callable[[int], object]) -> float:
    times: list[float] = []
    for turn in range(SKINS):
        start = time.perf_counter()
        action(turn)
        times.append(time.perf_counter() - start)
    return 1e6 * float(np.median(times))
