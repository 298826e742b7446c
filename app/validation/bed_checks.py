"""A beam on a bed of strands held against closed forms of springs, cracks and peeling."""

import math
from dataclasses import dataclass, replace

import numpy as np

from physics.bed import Bed, End, Hand, SpaceBeam, Strands, pull
from physics.bed.peel_theory import (
    cantilever_compliance,
    double_peel_force,
    end_deflection,
    peel_force,
    peel_toughness,
)

__all__ = ["BedCheck", "bed_checks"]

ANGLES = (30, 60, 90, 120, 150)
"""Degrees at which a strip is peeled."""


@dataclass(frozen=True, slots=True)
class BedCheck:
    """One figure of the beam on its bed beside its closed form."""

    name: str
    quantity: str  # with its unit
    found: float
    expected: float
    unexplained: float  # work that the energy balance leaves open, over all work

    @property
    def error(self) -> float:
        """Of what was found, %."""
        return 100.0 * (self.found / self.expected - 1.0)


def bed_checks() -> list[BedCheck]:
    """Solve the scenes; takes some twenty seconds."""
    return [
        hetenyi(1e5),
        hetenyi(6.85),
        kanninen(),
        *(kendall(degrees) for degrees in ANGLES),
        double_peel(),
    ]


def hetenyi(shear: float) -> BedCheck:
    """Lift the free end of a long beam on springs [Hetenyi 1946]; `shear` stiffness, N."""
    force, bed, bending = 1e-3, 0.05, 100.0
    beam = _beam(120.0, 240, (1e3, shear, bending), ends=("free", "clamped"))
    springs = Bed(stiffness=bed, toughness=1e6, strands=960, two_sided=True, gap=1e3)
    hand = Hand(at=0.0, path=((0, 0, force),), by="force", steps=1)
    history = pull(beam, springs, [hand], plane=True)
    return BedCheck(
        f"Beam on springs, shear stiffness {shear:g} N (Hetenyi 1946)",
        "deflection of its end, mm",
        float(history.hands[-1, 0, 2]),
        end_deflection(force, bed, bending, shear),
        history.open_share,
    )


def kanninen() -> BedCheck:
    """Open a double cantilever a little: its compliance at a crack of 20 mm [Kanninen 1973]."""
    crack, bed, bending, opened = 20.0, 0.05, 100.0, 1e-3
    beam = _beam(150.0, 240, (1e3, 1e5, bending), ends=("free", "clamped"))
    springs = Bed(from_mm=crack, stiffness=bed, toughness=1e6, strands=800, two_sided=True, gap=1e3)
    hand = Hand(at=0.0, path=((0, 0, opened),), steps=1, along=(False, False, True))
    history = pull(beam, springs, [hand], plane=True)
    return BedCheck(
        "Double cantilever (Kanninen 1973)",
        "compliance at a crack of 20 mm, mm/N",
        opened / float(history.forces[-1, 0, 2]),
        cantilever_compliance(crack, bed, bending),
        history.open_share,
    )


def kendall(degrees: int) -> BedCheck:
    """Peel a strip off at an angle [Kendall 1975]: mean of the last 30 of 40 mm."""
    angle, stretching, toughness, arm, span = math.radians(degrees), 8.0, 0.12, 30.0, 130.0
    beam = _beam(span, 260, (stretching, 50.0, 1.5), ends=("clamped", "free"))
    bed = Bed(to_mm=span - arm, strands=500, stiffness=0.3, toughness=toughness, floor=2.0)
    stretch = 1.0 + peel_force(angle, toughness, stretching) / stretching
    parts = np.linspace(0.0, 1.0, 13)
    reach = arm * (1.0 + (stretch - 1.0) * parts)
    x, z = reach * np.cos(angle * parts) - arm, reach * np.sin(angle * parts)
    run = 40.0  # mm of the front
    x = np.append(x, x[-1] + run * (stretch * math.cos(angle) - 1.0))
    z = np.append(z, z[-1] + run * stretch * math.sin(angle))
    path = tuple((float(a), 0.0, float(b)) for a, b in zip(x, z, strict=True))
    hand = Hand(at=span, path=path, steps=(2,) * 12 + (80,))
    history = pull(beam, bed, [hand], plane=True)
    last = history.forces[-60:, 0]
    sizes, angles = np.hypot(last[:, 0], last[:, 2]), np.arctan2(last[:, 2], last[:, 0])
    apparent = [
        peel_toughness(float(size), float(at), stretching)
        for size, at in zip(sizes, angles, strict=True)
    ]
    return BedCheck(
        f"Peeling at {degrees} degrees (Kendall 1975)",
        "toughness that its force stands for, N",
        float(np.mean(apparent)),
        toughness,
        history.open_share,
    )


def double_peel() -> BedCheck:
    """Lift the middle of a long strip that peels on both sides [Putignano 2014]."""
    stretching, bending, toughness, span = 19.2586, 2.0, 0.2, 160.0
    beam = _beam(span, 120, (stretching, 6.85, bending), nodes_at=(span / 2,))
    one = Bed(strands=240, stiffness=0.5, toughness=0.5 * toughness, floor=1.0)
    straight = one.strands_under(beam)
    # Pairs at 45 degrees along the axis: such a bed resists sliding as it does lifting.
    crossed = [
        replace(
            straight,
            feet=straight.feet + np.array([lean, 0.0, 0.0]),
            length=np.full(straight.count, 3.0 * math.sqrt(2.0)),
        )
        for lean in (-3.0, 3.0)
    ]
    hand = Hand(at=span / 2, path=((0, 0, 16.0),), steps=30, along=(False, True, True))
    history = pull(beam, Strands.joined(crossed), [hand], plane=True, floor=one.floor_under(beam))
    return BedCheck(
        "Double peeling (Putignano 2014; arms without bending)",
        "force, N",
        float(history.forces[-8:, 0, 2].mean()),
        double_peel_force(toughness, stretching)[0],
        history.open_share,
    )


def _beam(
    span: float,
    elements: int,
    stiffness: tuple[float, float, float],
    *,
    ends: tuple[End, End] = ("clamped", "clamped"),
    nodes_at: tuple[float, ...] = (),
) -> SpaceBeam:
    axial, shear, bending = stiffness
    rows = np.array([axial, shear, shear, bending, bending, bending])
    return SpaceBeam.made(
        span=span,
        elements=elements,
        stiffness=rows,
        ends=ends,
        nodes_at=nodes_at,
    )
