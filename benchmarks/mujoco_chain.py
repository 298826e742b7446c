"""The duct in MuJoCo: half of it, as 40 rigid links with a slide and a hinge each, settled."""

from importlib import import_module
from typing import Any

import numpy as np

from benchmarks.duct import CENTRE, DUCT, FORCE, SETTLED, STEP, relative_error, walk_about
from benchmarks.engine import Engine, unavailable
from benchmarks.stopwatch import microseconds

KEY, NAME = "mujoco_warm", "MuJoCo"
LINKS = 40
DENSITY = 1e-9
"""tonne/mm^3; the state at rest does not depend on it."""
SECONDS = 1e-2
# Time step, s, and damping over stiffness, s: of those tried, the ones that settle soonest.
DAMPING = 1e-3
REST = 500
"""Steps after which the chain is at rest."""
SOLVES = 80


def mujoco_engine() -> Engine:
    """Return the time of a settling to within `SETTLED` after a step by 1 % of the load."""
    try:
        mujoco = import_module("mujoco")
    except ImportError as failure:
        return unavailable(KEY, NAME, failure)
    try:
        return _timed(mujoco)
    except Exception as failure:  # whatever a peer raises, the others are still measured
        return unavailable(KEY, NAME, failure)


def _timed(mujoco: Any) -> Engine:
    model = mujoco.MjModel.from_xml_string(chain())
    data = mujoco.MjData(model)
    grasped = model.body("grasped").id

    def deflection_after(force: float, steps: int) -> float:
        data.xfrc_applied[grasped, 1] = 0.5 * force
        mujoco.mj_step(model, data, nstep=steps)
        return float(data.xpos[grasped, 1])

    error = relative_error(deflection_after(FORCE, REST))
    steps = 1
    for force in (FORCE * (1.0 + STEP), FORCE):
        passed = np.array([deflection_after(force, 1) for _ in range(REST)])
        moving = np.abs(passed / passed[-1] - 1.0) > SETTLED
        steps = max(steps, int(np.flatnonzero(moving)[-1]) + 2)
    forces = walk_about(FORCE, SOLVES).tolist()

    def walk() -> None:
        for force in forces:
            deflection_after(force, steps)

    time = microseconds(walk, SOLVES)
    return Engine(KEY, f"{NAME}, 40 slides and hinges", time, error).checked()


def chain() -> str:
    """Return the model's description."""
    length = CENTRE / LINKS
    mass = DENSITY * DUCT.area * length
    turning = mass * (DUCT.second_moment / DUCT.area + length**2 / 12.0)
    bending = DUCT.modulus * DUCT.second_moment / length
    stretching = DUCT.modulus * DUCT.area / length

    def joint(kind: str, axis: str, stiffness: float) -> str:
        damping = DAMPING * stiffness
        springs = f'stiffness="{stiffness!r}" damping="{damping!r}"'
        return f'<joint type="{kind}" axis="{axis}" {springs}/>'

    def inertia(at: float) -> str:
        inertias = f"{turning!r} {turning!r} {turning!r}"
        return f'<inertial pos="{at!r} 0 0" mass="{mass!r}" diaginertia="{inertias}"/>'

    hinge = joint("hinge", "0 0 1", bending)
    end_hinge = joint("hinge", "0 0 1", 2.0 * bending)
    slide = joint("slide", "1 0 0", stretching)
    links = [
        f'<body pos="{length if link else 0.0!r} 0 0">{hinge if link else end_hinge}{slide}'
        f"{inertia(0.5 * length)}"
        for link in range(LINKS)
    ]
    return (
        '<mujoco><compiler angle="radian"/>'
        f'<option timestep="{SECONDS}" integrator="discrete" gravity="0 0 0" solver="PGS"'
        ' jacobian="dense" tolerance="1e-10"><flag contact="disable" refsafe="disable"/></option>'
        f"<worldbody>{''.join(links)}"
        f'<body name="grasped" pos="{length!r} 0 0">{end_hinge}{inertia(0.0)}'
        f'<site name="grasped"/></body>{"</body>" * LINKS}'
        f'<body pos="{CENTRE} 0 0"><joint type="slide" axis="0 1 0"/>{inertia(0.0)}'
        '<site name="guide"/></body></worldbody><equality><weld site1="grasped" site2="guide"'
        ' solref="-1e9 -1e5" solimp="0.9999 0.9999 0.001"/></equality></mujoco>'
    )
