"""Tubes that join, and strands between them, against closed forms and another program."""

import math

import numpy as np
from numpy.typing import NDArray

from app.validation.bed_checks import BedCheck
from physics.bed import BeamOnBed, End, Join, Network, SpaceBeam, Strands
from physics.bed.kernels import CONTACT_STIFFNESS
from physics.bed.peel_theory import cantilever_compliance

Floats = NDArray[np.float64]

OUTER, INNER = 2.0, 1.4
"""mm, of a tube's radii; its modulus is 1 MPa, its Poisson's ratio 0.49."""
AREA = math.pi * (OUTER**2 - INNER**2)
MOMENT = math.pi / 4.0 * (OUTER**4 - INNER**4)
FRAME = {
    "a": ((0.0, 0.0, 0.0), (20.0, 0.0, 0.0), 1.0),
    "b": ((20.0, 0.0, 0.0), (36.0, 13.0, 5.0), 0.5),
    "c": ((20.0, 0.0, 0.0), (39.0, -13.0, 9.0), 0.2),
}
"""Arms of a Y: first and second end, mm, and a factor on the tube's stiffness."""
FRAME_TORSION = 2.0 / 2.98 * MOMENT
"""N mm^2."""
FRAME_FORCE = (0.05, 0.06, 0.35)  # N
FRAME_HEIGHT = 9.518614
"""mm by which a Y frame's joint rises under that force: OpenSeesPy 3.7.1, `elasticBeamColumn` and
`Corotational`, 40 and 80 elements an arm, extrapolated."""


def network_checks() -> list[BedCheck]:
    """Solve the scenes; takes some seconds."""
    return [portal(), y_frame(), two_beams(), t_peel(), crossed_tubes()]


def portal() -> BedCheck:
    """Push a corner: P h^3 (2 + 3 k)/(12 E I (1 + 6 k)), k = I_b h/(I_c b) [Kleinlogel]."""
    stiff = 1e6 * AREA
    column = np.array([stiff, stiff, stiff, MOMENT, MOMENT, MOMENT])
    across = column * np.array([1.0, 1.0, 1.0, 1.0, 0.6, 0.6])
    tubes = {
        "a": _straight((0, 0, 0), (0, 30, 0), 10, column, ("clamped", "free")),
        "b": _straight((0, 30, 0), (24, 30, 0), 10, across, ("free", "free")),
        "c": _straight((24, 0, 0), (24, 30, 0), 10, column, ("clamped", "free")),
    }
    made = BeamOnBed(Network(tubes, [Join("b", 0, "a", 30.0), Join("c", 1, "b", 24.0)]))
    node, force, ratio = int(made.nodes_of("a")[-1]), 1e-5, 0.6 * 30.0 / 24.0
    made.push(node, (force, 0.0, 0.0))
    made.advance()
    sway = force * 30.0**3 * (2.0 + 3.0 * ratio) / (12.0 * MOMENT * (1.0 + 6.0 * ratio))
    found = float(made.places[node, 0] - made.rest_place(node)[0])
    return _check("Portal (Kleinlogel)", "sway under 1e-5 N, mm", found, sway, made)


def crossed_tubes(factor: float = 1.0, elements: int = 40) -> BedCheck:
    """Load a tube across another, `factor` times as stiff: P L^3/(48 E I) + P L/(4 G A) of each."""
    span, force = 40.0, 1e-4
    stiff = np.array([50.0, 400.0, 400.0, 60.0, 80.0, 80.0])
    half = 0.5 * span
    pins: tuple[End, End] = ("pinned", "pinned")
    low = _straight((0, -half, 0), (0, half, 0), elements, factor * stiff, pins)
    high = _straight((-half, 0, 2), (half, 0, 2), elements, stiff, pins)
    made = BeamOnBed(Network({"low": low, "high": high}, touching=np.inf))
    node = int(made.nodes_of("high")[elements // 2])
    made.push(node, (0.0, 0.0, -force))
    made.advance()
    give = span**3 / (48.0 * stiff[4]) + span / (4.0 * stiff[2])
    below = give / factor + elements / (span * CONTACT_STIFFNESS)
    found = float(made.rest_place(node)[2] - made.places[node, 2])
    expected = force / (1.0 / give + 1.0 / below)
    return _check("Two tubes across each other", "sag under 1e-4 N, mm", found, expected, made)


def y_frame(elements: int = 40) -> BedCheck:
    """Lift a Y frame's joint, its three ends clamped, until it has turned by 27 degrees."""
    tube = np.array([AREA, 1e4 * AREA, 1e4 * AREA, FRAME_TORSION, MOMENT, MOMENT])
    ends: dict[str, tuple[End, End]] = {"a": ("clamped", "free")}
    tubes = {
        name: _straight(begin, end, elements, factor * tube, ends.get(name, ("free", "clamped")))
        for name, (begin, end, factor) in FRAME.items()
    }
    made = BeamOnBed(Network(tubes, [Join("b", 0, "a", 20.0), Join("c", 0, "a", 20.0)]))
    node = made.take(20.0, "a", along=(False, False, False))
    for fraction in np.linspace(0.1, 1.0, 10).tolist():
        made.push(node, fraction * np.array(FRAME_FORCE))
        made.advance()
    found = float(made.places[node, 2] - made.rest_place(node)[2])
    return _check("Y frame (OpenSeesPy 3.7)", "height of its joint, mm", found, FRAME_HEIGHT, made)


def two_beams(elements: int = 128) -> BedCheck:
    """Open two beams joined by strands: each lies on a bed twice as stiff [Kanninen 1973]."""
    bending, force = 95.0, 1e-4
    rows = np.array([1e4, 1e4, 1e4, bending, bending, bending])
    made = _two_arms(160.0, elements, 120.0, 4 * elements, (0.3, 1e9, 2.0), rows)
    nodes = [int(made.nodes_of(name)[-1]) for name in ("top", "low")]
    for node, side in zip(nodes, (force, -force), strict=True):
        made.push(node, (0.0, 0.0, side))
    made.advance()
    opening = float(made.places[nodes[0], 2] - made.places[nodes[1], 2]) - 1.0
    expected = 2.0 * force * cantilever_compliance(40.0, 0.6, bending)
    return _check("Two beams joined by strands (Kanninen)", "opening, mm", opening, expected, made)


def t_peel(stretching: float = 8.0) -> BedCheck:  # N
    """Peel two arms apart: G = 2 F + F^2/EA, the work of both less what they store."""
    toughness = 0.12
    rows = np.array([stretching, 50.0, 50.0, 0.2, 0.2, 0.2])
    # What is still joined is short: a long tail would tilt, as nothing holds it level.
    length = 46.0
    made = _two_arms(length, 92, 30.0, 240, (0.3, toughness, 2.0), rows)
    nodes = [made.take(length, name, along=(False, False, True)) for name in ("top", "low")]
    # The force goes up and down with each element that parts: its mean is the work over the path.
    size, begin, end, before = 0.25, 80, 120, 0.0
    for step in range(1, end + 1):
        for node, side in zip(nodes, (size, -size), strict=True):
            made.lead(node, made.rest_place(node) + np.array([0.0, 0.0, side * step]))
        made.advance()
        if step == begin:
            before = made.energy.work
    expected = stretching * (math.sqrt(1.0 + toughness / stretching) - 1.0)
    found = (made.energy.work - before) / (2.0 * size * (end - begin))
    name = f"T-peel of two tubes, stretching stiffness {stretching:g} N"
    return _check(name, "force, N", found, expected, made)


def _check(name: str, quantity: str, found: float, expected: float, made: BeamOnBed) -> BedCheck:
    energy = made.energy
    return BedCheck(name, quantity, found, expected, abs(energy.residual / energy.work))


def _straight(
    begin: tuple[float, float, float],
    end: tuple[float, float, float],
    elements: int,
    stiffness: Floats,
    ends: tuple[End, End],
) -> SpaceBeam:
    axis = np.array([begin, end], dtype=np.float64)
    return SpaceBeam.from_axis(
        axis=axis, elements=elements, stiffness=stiffness, ends=ends, radius=1.0
    )


def _two_arms(
    length: float,
    elements: int,
    bond: float,
    count: int,
    law: tuple[float, float, float],
    stiffness: Floats,
) -> BeamOnBed:
    """Return two beams, one over the other, joined by strands up to `bond` that push as well."""
    gap, (per_mm, toughness, softening) = 1.0, law
    ends: tuple[End, End] = ("clamped", "free")
    top = _straight((0, 0, 0), (length, 0, 0), elements, stiffness, ends)
    low = _straight((0, 0, -gap), (length, 0, -gap), elements, stiffness, ends)
    x = (np.arange(count) + 0.5) * bond / count
    places = np.stack([x, 0.0 * x, 0.0 * x], axis=1)
    one = np.ones(count)
    yields = math.sqrt(2.0 * toughness / (per_mm * softening)) * one
    tissue = Strands(
        x, places, places - np.array([0.0, 0.0, gap]), per_mm * bond / count * one, gap * one,
        yields, softening * yields, one, np.zeros(count, np.int64), np.ones(count, np.int64), x,
    )  # fmt: skip
    return BeamOnBed(Network({"top": top, "low": low}), tissue, plane=True)
