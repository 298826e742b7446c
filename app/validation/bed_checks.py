"""The beam in space and its bed against closed forms, published figures, finer meshes, mirrors."""

import math
from dataclasses import dataclass, replace

import numpy as np

from physics.bed import Bed, End, Hand, History, SpaceBeam, Strands, pull
from physics.bed.peel_theory import (
    cantilever_compliance,
    double_peel_force,
    end_deflection,
    peel_force,
    peel_toughness,
)

PEELS = (*((degrees, 8.0) for degrees in (30, 60, 90, 120, 150)), (30, 20.0), (150, 20.0))
"""Degrees at which a strip is peeled, and its stretching stiffness, N."""


@dataclass(frozen=True, slots=True)
class BedCheck:
    """One figure of the beam on its bed beside what it is held against."""

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
    """Solve the scenes; takes some thirty seconds."""
    return [
        bathe(),
        elastica(),
        pushed(),
        taut(),
        hetenyi(1e5),
        hetenyi(6.85),
        order_of_convergence(),
        kanninen(),
        *(kendall(*each) for each in PEELS),
        double_peel(),
        *resolutions(),
        mirrored(),
    ]


def bathe() -> BedCheck:
    """Load a bend of 45 degrees and radius 100 by 600 across its plane [Bathe, Bolourchi 1979]."""
    angles = np.linspace(0.0, math.pi / 4.0, 33)
    axis = 100.0 * np.stack([np.sin(angles), 1.0 - np.cos(angles), 0.0 * angles], axis=1)
    rows = np.array([1e7, 5e6, 5e6, 1e7 / 12.0, 1e7 / 12.0, 1e7 / 12.0])
    beam = SpaceBeam.from_axis(axis=axis, elements=32, ends=("clamped", "free"), stiffness=rows)
    hand = Hand(at=beam.span, path=((0.0, 0.0, 600.0),), by="force", steps=2)
    history = pull(beam, None, [hand])
    return BedCheck(
        "45-degree bend (Bathe 1979; Simo 1986)",
        "height of its end under 600",
        float(history.shape[-1, 2]),
        53.37,
        history.residual_ratio,
    )


def elastica() -> BedCheck:
    """Buckle a column until its end has turned by 80 degrees [Euler 1744]."""
    span, bending, half = 100.0, 10.0, math.radians(40.0)
    # P/P_crit = (2 K / pi)^2 and deflection/span = 2 sin(half) / K; K by means of a and b.
    a, b = 1.0, math.cos(half)
    for _ in range(20):
        a, b = 0.5 * (a + b), math.sqrt(a * b)
    complete = math.pi / (2.0 * a)
    force = (complete / span) ** 2 * bending
    beam = _beam(span, 80, (1e4, 1e4, bending), ends=("clamped", "free"))
    hand = Hand(at=span, path=((-force, 0.0, 0.0),), by="force", steps=3)
    history = pull(beam, None, [hand], plane=True)
    return BedCheck(
        "Column beyond its buckling load (elastica, Euler 1744)",
        "deflection of its end turned by 80 degrees, mm",
        abs(float(history.hands[-1, 0, 2])),
        2.0 * math.sin(half) / complete * span,
        history.residual_ratio,
    )


def pushed() -> BedCheck:
    """Push one end of a pinned column in by 0.2 mm: beyond its buckling load [Timoshenko 1961]."""
    span, bending, shortening = 100.0, 100.0, 0.2
    beam = _beam(span, 100, (1e4, 1e7, bending), ends=("pinned", "roller"))
    hand = Hand(at=span, path=((-shortening, 0.0, 0.0),), steps=4, along=(True, False, False))
    history = pull(beam, None, [hand])
    critical = bending * (math.pi / span) ** 2
    return BedCheck(
        "Column pushed beyond its buckling load (Timoshenko 1961)",
        "force, N",
        -float(history.forces[-1, 0, 0]),
        critical * (1.0 + 0.5 * shortening / span),
        history.residual_ratio,
    )


def taut() -> BedCheck:
    """Lead a thin beam away sideways and up at a quarter of its span: a string between pins."""
    span, at, stretching, off = 100.0, 25.0, 50.0, (12.0, 20.0)
    beam = _beam(span, 60, (stretching, 1e6, 1e-4), ends=("pinned", "pinned"), nodes_at=(at,))
    history = pull(beam, None, [Hand(at=at, path=((0.0, *off),), steps=4)])
    sides = [(rest, math.hypot(rest, *off)) for rest in (at, span - at)]
    across = sum(stretching * (length / rest - 1.0) / length for rest, length in sides)
    return BedCheck(
        "Thin beam led off its line (a string between two pins)",
        "force across, N",
        math.hypot(*history.forces[-1, 0, 1:]),
        across * math.hypot(*off),
        history.residual_ratio,
    )


def order_of_convergence() -> BedCheck:
    """Halve the elements of Hetenyi's beam: the error must fall as their length squared."""
    coarse, fine = hetenyi(1e5, 120), hetenyi(1e5)
    return BedCheck(
        "Order of convergence (Hetenyi 1946)",
        "log2 of errors with 120 and 240 elements",
        math.log2(coarse.error / fine.error),
        2.0,
        coarse.unexplained,
    )


def resolutions() -> list[BedCheck]:
    """Peel with fewer elements, strands and steps than a finer scene of the same bed."""

    def peeled(elements: int, strands: int, steps: int) -> History:
        beam = _beam(80.0, elements, (8.0, 50.0, 1.5), ends=("clamped", "free"))
        bed = Bed(to_mm=60.0, strands=strands, stiffness=0.3, toughness=0.12)
        return pull(beam, bed, [Hand(at=80.0, path=((0.0, 0.0, 20.0),), steps=steps)])

    fine = peeled(160, 480, 20)
    return [
        BedCheck(
            f"Peeling with {name}",
            "work, mJ",
            float(coarse.work[-1]),
            float(fine.work[-1]),
            coarse.residual_ratio,
        )
        for name, coarse in (
            ("half the elements", peeled(80, 480, 20)),
            ("one strand for two elements, not eight", peeled(160, 60, 20)),
            ("half the steps", peeled(160, 480, 10)),
        )
    ]


def mirrored() -> BedCheck:
    """Pull sideways off a scattered bed, and to the other side off its mirror image."""
    beam = _beam(50.0, 40, (20.0, 7.0, 90.0), nodes_at=(30.0,))
    bed = Bed(
        strands=300, stiffness=0.09, toughness=0.27, floor=0.3, around=1.2, fan=0.4, scatter=0.3
    )
    strands, flip = bed.strands_under(beam), np.array([1.0, -1.0, 1.0])
    image = replace(strands, ends=strands.ends * flip, feet=strands.feet * flip)
    one, other = (
        pull(
            beam,
            each,
            [Hand(at=30.0, path=((0.0, side, 8.0),), steps=8)],
            floor=bed.floor_under(beam),
        )
        for each, side in ((strands, 4.0), (image, -4.0))
    )
    return BedCheck(
        "A bed and its mirror image",
        "force across, N",
        float(one.forces[-1, 0, 1]),
        -float(other.forces[-1, 0, 1]),
        one.residual_ratio,
    )


def hetenyi(shear: float, elements: int = 240) -> BedCheck:
    """Lift the free end of a long beam on springs [Hetenyi 1946]; `shear` stiffness, N."""
    force, bed, bending = 1e-3, 0.05, 100.0
    beam = _beam(120.0, elements, (1e3, shear, bending), ends=("free", "clamped"))
    springs = Bed(stiffness=bed, toughness=1e6, strands=4 * elements, bilateral=True, gap=1e3)
    hand = Hand(at=0.0, path=((0, 0, force),), by="force", steps=1)
    history = pull(beam, springs, [hand], plane=True)
    return BedCheck(
        f"Beam on springs, shear stiffness {shear:g} N (Hetenyi 1946)",
        "deflection of its end, mm",
        float(history.hands[-1, 0, 2]),
        end_deflection(force, bed, bending, shear),
        history.residual_ratio,
    )


def kanninen() -> BedCheck:
    """Open a double cantilever a little: its compliance at a crack of 20 mm [Kanninen 1973]."""
    crack, bed, bending, opened = 20.0, 0.05, 100.0, 1e-3
    beam = _beam(150.0, 240, (1e3, 1e5, bending), ends=("free", "clamped"))
    springs = Bed(from_mm=crack, stiffness=bed, toughness=1e6, strands=800, bilateral=True, gap=1e3)
    hand = Hand(at=0.0, path=((0, 0, opened),), steps=1, along=(False, False, True))
    history = pull(beam, springs, [hand], plane=True)
    return BedCheck(
        "Double cantilever (Kanninen 1973)",
        "compliance at a crack of 20 mm, mm/N",
        opened / float(history.forces[-1, 0, 2]),
        cantilever_compliance(crack, bed, bending),
        history.residual_ratio,
    )


def kendall(degrees: int, stretching: float) -> BedCheck:
    """Peel a strip off at an angle [Kendall 1975]: mean of the last 30 of 40 mm."""
    # Strands are short, so that they soon resist sliding: pulled along as far as its clamp, the
    # strip that still holds would be part of the balance, which is Kendall's for an endless one.
    angle, toughness, arm, span = math.radians(degrees), 0.12, 30.0, 130.0
    beam = _beam(span, 260, (stretching, 50.0, 1.5), ends=("clamped", "free"))
    bed = Bed(to_mm=span - arm, strands=500, stiffness=0.3, toughness=toughness, floor=2.0, gap=0.5)
    stretch = 1.0 + peel_force(angle, toughness, stretching) / stretching
    fractions = np.linspace(0.0, 1.0, 13)
    reach = arm * (1.0 + (stretch - 1.0) * fractions)
    x, z = reach * np.cos(angle * fractions) - arm, reach * np.sin(angle * fractions)
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
        f"Peeling at {degrees} degrees, stretching stiffness {stretching:g} N (Kendall 1975)",
        "toughness that its force stands for, N",
        float(np.mean(apparent)),
        toughness,
        history.residual_ratio,
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
        history.residual_ratio,
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
    return SpaceBeam.from_axis(
        span=span,
        elements=elements,
        stiffness=rows,
        ends=ends,
        nodes_at=nodes_at,
    )
