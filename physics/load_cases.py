"""Loads that benches have besides a pull across: along the axis, out of the root, and pressure.

Stresses are nominal, force over the area at rest, as strengths are published.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from physics.beam import Beam
from physics.equilibrium import NoEquilibrium
from physics.exact import Law, Linear
from physics.exact.fibre_laws import fibre_pull
from physics.quantity import finite, positive

# Sections at which an organ's own are looked at; longest stretch that is tried.
SECTIONS, MOST_STRETCH = 201, 1e3


@dataclass(frozen=True, slots=True)
class PullAlong:
    """A beam pulled along its axis, one end held."""

    force: float  # N
    elongation: float  # mm
    stress: float  # largest over its sections, MPa


@dataclass(frozen=True, slots=True)
class Inflation:
    """A tube under a pressure inside, its ends closed and free to move apart."""

    pressure: float  # MPa
    length: float  # mm
    diameter: float  # outer, mm
    hoop_stress: float  # MPa
    axial_stress: float  # MPa


def nominal_stress(law: Law, beam: Beam, stretch: float) -> float:
    """Return the stress of a bar of the beam's material at a stretch, its sides free, MPa."""
    if isinstance(law, Linear):
        return beam.modulus * (stretch - 1.0)
    g = 0.5 / (1.0 + beam.poisson_ratio)
    ratio = (1.0 - 2.0 * beam.poisson_ratio) * g
    return beam.modulus * float(fibre_pull(stretch, 0.0, g, ratio, law.stiffening))


def pull_along(
    beam: Beam, law: Law, *, force: float | None = None, elongation: float | None = None
) -> PullAlong:
    """Return a beam that is pulled along its axis.

    Parameters
    ----------
    beam, law
        At rest, and its wall's law.
    force, elongation
        One of both, 0 or more, N or mm.

    Returns
    -------
    PullAlong

    Raises
    ------
    ValueError
        If not one of both is given, or it is below 0.
    """
    if (force is None) == (elongation is None):
        raise ValueError("give either the force (N) or the elongation (mm) of a pull along")
    value = finite(force if force is not None else elongation or 0.0, "a pull along", "N or mm")
    if value < 0.0:
        raise ValueError(f"a pull along must be 0 or more, got {value:g}")
    if force is not None:
        return _pulled(beam, law, value)
    # The stiffest of laws, a straight line at rest, bounds the force from no side: double it.
    low, high = 0.0, beam.modulus * beam.area * value / beam.span
    while high > 0.0 and _pulled(beam, law, high).elongation < value:
        low, high = high, 2.0 * high
    found = _root(lambda f: _pulled(beam, law, f).elongation - value, low, high) if high else 0.0
    return _pulled(beam, law, found)


def rupture_along(beam: Beam, law: Law, threshold: float) -> PullAlong:
    """Return the pull along under which the weakest section bears its threshold, MPa."""
    return _pulled(beam, law, positive(threshold, "threshold", "MPa") * float(_areas(beam).min()))


def inflate(beam: Beam, pressure: float) -> Inflation:
    """Return a round tube blown up by a pressure inside.

    The wall is a thin incompressible neo-Hookean one (G = E/3) about its middle radius, closed at
    ends that are free to move apart: with lambda of hoop, length and, their product's inverse,
    thickness,

        G (l_h^2 - l_t^2) = p r/t,   G (l_z^2 - l_t^2) = p r/(2 t),   r = r_0 l_h,  t = t_0 l_t.

    Parameters
    ----------
    beam
        A tube at rest; its Poisson's ratio does not matter.
    pressure
        MPa, 0 or more.

    Returns
    -------
    Inflation

    Raises
    ------
    ValueError
        If the beam is no tube, or the pressure below 0.
    NoEquilibrium
        If the tube bears no such pressure: beyond its largest one it grows without end.
    """
    outer = beam.fibre_distance
    inner = math.sqrt(max(outer * outer - beam.area / math.pi, 0.0))
    if inner <= 1e-9 * outer:
        raise ValueError("a full bar cannot be blown up; give the tube's wall, mm")
    if finite(pressure, "pressure", "MPa") < 0.0:
        raise ValueError(f"pressure must be 0 MPa or more, got {pressure:g} MPa")
    wall, middle, shear = outer - inner, 0.5 * (outer + inner), beam.modulus / 3.0

    def lengthwise(hoop: float) -> float:
        # hoop^2 = 2 z^2 - 1/(hoop z)^2: the hoop stress is twice that along.
        square = hoop * hoop
        return math.sqrt(0.25 * (square + math.sqrt(square * square + 8.0 / square)))

    def pressure_at(hoop: float) -> float:
        thin = 1.0 / (hoop * lengthwise(hoop))
        return shear * (hoop * hoop - thin * thin) * wall * thin / (middle * hoop)

    hoops = np.linspace(1.0, 3.0, 401)
    bears = np.array([pressure_at(float(each)) for each in hoops])
    most = int(bears.argmax())
    if pressure > bears[most]:
        raise NoEquilibrium(
            f"the tube bears {bears[most]:.4g} MPa at most, under which it grows without end"
        )
    hoop = _root(lambda h: pressure_at(h) - pressure, 1.0, float(hoops[most])) if pressure else 1.0
    along = lengthwise(hoop)
    thin = 1.0 / (hoop * along)
    true = shear * (hoop * hoop - thin * thin)
    return Inflation(
        pressure,
        length=beam.span * along,
        diameter=2.0 * middle * hoop + wall * thin,
        hoop_stress=true / hoop,
        axial_stress=0.5 * true / along,
    )


def _areas(beam: Beam) -> np.ndarray:
    """Return (S,) areas of sections all along, mm^2."""
    count = 1 if beam.is_constant else SECTIONS
    at = (np.arange(count) + 0.5) * beam.span / count
    return beam.sections_at(at, shear_areas=False).areas


def _pulled(beam: Beam, law: Law, force: float) -> PullAlong:
    areas = _areas(beam)
    stretches = [_stretch(law, beam, force / area) for area in areas.tolist()]
    longer = beam.span * (float(np.mean(stretches)) - 1.0)
    return PullAlong(force, longer, force / float(areas.min()))


def _stretch(law: Law, beam: Beam, stress: float) -> float:
    """Return the stretch at which the law has a stress, MPa."""
    if stress == 0.0 or isinstance(law, Linear):
        return 1.0 + stress / beam.modulus
    high = 2.0
    while nominal_stress(law, beam, high) < stress:
        high *= 2.0
        if high > MOST_STRETCH:
            raise NoEquilibrium(f"the law has no stretch below {MOST_STRETCH:g} for {stress:g} MPa")
    return _root(lambda x: nominal_stress(law, beam, x) - stress, 1.0, high)


def _root(of: Callable[[float], float], low: float, high: float) -> float:
    """Return where a growing function is 0, by bisection down to neighbouring numbers."""
    while low < (middle := 0.5 * (low + high)) < high:
        low, high = (middle, high) if of(middle) < 0.0 else (low, middle)
    return high
