"""A Y frame's joint lifted far, in OpenSeesPy and here, in one run.

Run from the root of the repository: ``python -m benchmarks.opensees_frame``, after
``pip install .[bench]``. OpenSeesPy has corotational elastic elements without shear, ours shear
10,000 times as stiff as they stretch. Both err by the square of an element's length, so that two
meshes give the height for none.
"""

from importlib import import_module
from itertools import pairwise

import numpy as np

from app.validation.network_checks import (
    AREA,
    FRAME,
    FRAME_FORCE,
    FRAME_TORSION,
    MOMENT,
    y_frame,
)

MESHES = (40, 80)
"""Elements an arm."""
STEPS = 20
TIGHT = 1e-10
"""Update, mm and radians, below which its Newton method stops."""


def opensees_height(elements: int) -> float:
    """Return the height of the joint, mm, by OpenSeesPy with so many elements an arm."""
    opensees = import_module("openseespy.opensees")
    opensees.wipe()
    opensees.model("basic", "-ndm", 3, "-ndf", 6)
    joint, last = 1, 1
    opensees.node(joint, *FRAME["a"][1])
    opensees.timeSeries("Linear", 1)
    opensees.pattern("Plain", 1, 1)
    for arm, (begin, end, factor) in enumerate(FRAME.values(), 1):
        near, far = (end, begin) if arm == 1 else (begin, end)
        # Each arm's own y is level: none is upright.
        opensees.geomTransf("Corotational", arm, 0.0, 0.0, 1.0)
        nodes = [joint, *range(last + 1, last + 1 + elements)]
        for node, part in zip(nodes[1:], np.linspace(0.0, 1.0, elements + 1)[1:], strict=True):
            place = (1.0 - part) * np.array(near) + part * np.array(far)
            opensees.node(node, *place.tolist())
        section = factor * AREA, 1.0, 1.0, factor * FRAME_TORSION, factor * MOMENT, factor * MOMENT
        for i, j in pairwise(nodes):
            opensees.element("elasticBeamColumn", j, i, j, *section, arm)
        last = nodes[-1]
        opensees.fix(last, 1, 1, 1, 1, 1, 1)
    opensees.load(joint, *FRAME_FORCE, 0.0, 0.0, 0.0)
    opensees.constraints("Plain")
    opensees.numberer("RCM")
    opensees.system("BandGen")
    opensees.test("NormDispIncr", TIGHT, 50, 0)
    # Newton's method alone loses the finer mesh.
    opensees.algorithm("NewtonLineSearch", "-type", "Bisection")
    opensees.integrator("LoadControl", 1.0 / STEPS)
    opensees.analysis("Static", "-noWarnings")
    lost, height = opensees.analyze(STEPS), opensees.nodeDisp(joint, 3)
    opensees.wipe()
    if lost:
        raise RuntimeError(f"OpenSeesPy lost the equilibrium with {elements} elements an arm")
    return float(height)


def extrapolated(coarse: float, fine: float) -> float:
    """Return what elements without length would give, of two meshes, one twice as fine."""
    return fine + (fine - coarse) / 3.0


def main() -> None:
    """Print heights by both, and how far they are apart."""
    theirs = [opensees_height(each) for each in MESHES]
    ours = [y_frame(each).found for each in MESHES]
    rows = list(zip((f"{each} elements an arm" for each in MESHES), theirs, ours, strict=True))
    rows.append(("extrapolated", extrapolated(*theirs), extrapolated(*ours)))
    print("height of the joint, mm    OpenSeesPy        here  difference, %")
    for name, their, our in rows:
        print(f"{name:23}  {their:12.6f}{our:12.6f}{100.0 * (our / their - 1.0):+15.5f}")


if __name__ == "__main__":
    main()
