"""The duct in its bed in MuJoCo, beside ours: what a step of the same length costs."""

import time
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.rl.episode import Episode
from app.rl.task import Task
from app.simulation import TICK_SECONDS
from physics.bed import BeamOnBed
from physics.bed.kernels import STIFF

Floats = NDArray[np.float64]

SUBSTEPS = 8  # of a tick of the session
STEPS, BLOCKS, LIFT_MM = 240, 5, 2.0
MASS = 1e-4
"""tonne of a link. A real one's is thousands of times less, at which springs that are stepped
explicitly would need as many more steps."""
DAMPING = 0.05
"""s, damping over stiffness."""


def scene(beam: BeamOnBed) -> str:
    """Return the duct as links with ball joints, and its strands as tendons that only pull."""
    # Of its integrators Euler's is the fastest here: the implicit ones took 2 and 7 times as long.
    places, elements = beam.rest_places, len(beam.places) - 1
    lengths = np.sqrt((np.diff(places, axis=0) ** 2).sum(axis=1))
    state, order = beam.state, np.argsort(beam.order)
    ends, feet = beam.strand_ends(), beam.strand_feet()
    stiffness = state.strand[STIFF][order]
    # Which link a strand holds: the one at whose first node it is.
    links = np.minimum(np.searchsorted(places[:, 0], ends[:, 0], side="right") - 1, elements - 1)
    bodies, tendons = "", ""
    for e in range(elements):
        at = places[e] - places[max(e - 1, 0)] if e else places[0]
        turning = MASS * lengths[e] ** 2
        stiff = float(state.stiff[e, 4] / lengths[e])
        sites = "".join(
            f'<site name="end{k}" pos="{_three(ends[k] - places[e])}"/>'
            for k in np.flatnonzero(links == max(e, 0))
        )
        name = ' name="held"' if e == elements // 2 else ""
        bodies += (
            f'<body{name} pos="{_three(at)}"><joint type="ball" stiffness="{stiff!r}" '
            f'damping="{DAMPING * stiff!r}"/><inertial pos="0 0 0" mass="{MASS}" '
            f'diaginertia="{_three(np.full(3, turning))}"/>{sites}'
        )
    bodies += "</body>" * elements
    for k in range(len(ends)):
        far, spring = float(np.sqrt(((ends[k] - feet[k]) ** 2).sum())), float(stiffness[k])
        tendons += (
            f'<spatial stiffness="{spring!r}" damping="{DAMPING * spring!r}" '
            f'springlength="0 {far!r}"><site site="foot{k}"/><site site="end{k}"/></spatial>'
        )
    bed = "".join(f'<site name="foot{k}" pos="{_three(each)}"/>' for k, each in enumerate(feet))
    return (
        f'<mujoco><option timestep="{TICK_SECONDS / SUBSTEPS!r}" integrator="Euler" '
        f'gravity="0 0 0"><flag contact="disable"/></option><worldbody>{bed}{bodies}'
        f"</worldbody><tendon>{tendons}</tendon></mujoco>"
    )


def _three(values: Floats) -> str:
    return " ".join(repr(float(each)) for each in values)


def beside_mujoco() -> dict[str, Any]:
    """Return the time of a step of either, us, by turns in one run; or why there is none."""
    try:
        mujoco = import_module("mujoco")
    except ImportError as failure:
        return {"note": str(failure)}
    episode = Episode(Task())
    session = episode.session
    beam = session.spatial.beam
    model = mujoco.MjModel.from_xml_string(scene(beam))
    data = mujoco.MjData(model)
    held = model.body("held").id
    middle = 0.5 * session.spatial.dissection.beam.span
    start = np.array(session.grab(0, middle))
    session.move_hand(0, start + np.array([0.0, 0.0, LIFT_MM]))
    session.advance(30)
    ours, theirs = [], []
    data.xfrc_applied[held, 2] = session.spatial.forces[0][2]
    for _ in range(BLOCKS):
        before = time.process_time()
        mujoco.mj_step(model, data, nstep=STEPS)
        theirs.append(time.process_time() - before)
        before = time.process_time()
        for _ in range(STEPS // SUBSTEPS):
            beam.tick(TICK_SECONDS, ticks=SUBSTEPS)
        ours.append(time.process_time() - before)
    moved = float(data.xpos[held, 2]) - float(beam.rest_places[len(beam.places) // 2, 2])
    return {
        "ours_us": 1e6 * min(ours) / STEPS,
        "mujoco_us": 1e6 * min(theirs) / STEPS,
        "mujoco_lifted_mm": moved,
        "lifted_mm": LIFT_MM,
        "mujoco": mujoco.__version__,
        "tendons": int(model.ntendon),
        "freedoms": int(model.nv),
    }
