"""The duct in OpenSeesPy: half of it, as 40 corotational elastic elements."""

import math
from collections.abc import Iterable
from importlib import import_module
from typing import Any

from benchmarks.duct import DUCT, FORCE, STEP, relative_error
from benchmarks.engine import Engine, unavailable
from benchmarks.stopwatch import microseconds
from physics import Beam

KEY, NAME = "opensees_warm", "OpenSeesPy"
ELEMENTS = 40
# Steps up, then as many down.
LEG = 20
# Steps to the whole force.
FROM_REST = 10
TIGHT = 1e-5
"""Update, mm, below which its Newton method stops; that leaves about the square, relative."""


def opensees_engine() -> Engine:
    """Return the time of a step by 1 % of the load, or why there is none."""
    try:
        # Its stub of a module raises RuntimeError where a library of the system is missing.
        opensees = import_module("openseespy.opensees")
    except (ImportError, RuntimeError) as failure:
        return unavailable(KEY, NAME, failure)
    try:
        return _timed(opensees)
    except Exception as failure:  # whatever a peer raises, the others are still measured
        return unavailable(KEY, NAME, failure)
    finally:
        opensees.wipe()


def opensees_deflections(beams: Iterable[Beam], forces: Iterable[float]) -> list[float]:
    """Return the deflections of ducts under whole forces at mid-span, one after the other."""
    opensees = import_module("openseespy.opensees")
    found: list[float] = []
    for beam, force in zip(beams, forces, strict=True):
        _load(opensees, beam, force)
        # From rest in one step it loses ducts whose modulus is low.
        opensees.integrator("LoadControl", 0.5 * force / FROM_REST)
        lost = opensees.analyze(FROM_REST)
        found.append(math.nan if lost else opensees.nodeDisp(ELEMENTS + 1, 2))
    opensees.wipe()
    return found


def _load(opensees: Any, beam: Beam, force: float) -> None:
    """Make a model of half a duct, whose load is half the force."""
    last = ELEMENTS + 1
    opensees.wipe()
    opensees.model("basic", "-ndm", 2, "-ndf", 3)
    for node in range(last):
        opensees.node(node + 1, 0.5 * beam.span * node / ELEMENTS, 0.0)
    opensees.fix(1, 1, 1, 1)
    opensees.fix(last, 1, 0, 1)
    opensees.geomTransf("Corotational", 1)
    section = beam.area, beam.modulus, beam.second_moment
    for element in range(1, last):
        opensees.element("elasticBeamColumn", element, element, element + 1, *section, 1)
    opensees.timeSeries("Linear", 1)
    opensees.pattern("Plain", 1, 1)
    opensees.load(last, 0.0, 1.0, 0.0)
    opensees.constraints("Plain")
    opensees.numberer("Plain")
    opensees.system("BandGen")
    opensees.test("NormDispIncr", TIGHT, 50, 0)
    # Newton's method alone does not find the way from rest.
    opensees.algorithm("NewtonLineSearch", "-type", "Bisection")
    opensees.integrator("LoadControl", 0.5 * force)
    opensees.analysis("Static", "-noWarnings")


def _timed(opensees: Any) -> Engine:
    _load(opensees, DUCT, FORCE)
    if opensees.analyze(1):
        raise RuntimeError("it did not find the equilibrium from rest")
    error = relative_error(opensees.nodeDisp(ELEMENTS + 1, 2))
    opensees.algorithm("Newton")

    def up_and_down() -> None:
        for step in (STEP, -STEP):
            opensees.integrator("LoadControl", 0.5 * FORCE * step)
            if opensees.analyze(LEG):
                raise RuntimeError("it lost the equilibrium after a step of the load")

    time = microseconds(up_and_down, 2 * LEG)
    return Engine(KEY, f"{NAME}, 40 corotational elements", time, error).checked()
