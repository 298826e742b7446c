"""Ducts by the thousand: where each breaks, and what it bears under a load.

The cubic beam and the string in closed form, the exact beam in compiled code, other theories one
duct after the other. Each agrees with `Theory.pull`, `check_rupture` and `break_of` for that duct.

Closed forms, for a grasp at a, b = S - a: the cubic's stress is quadratic in the deflection d,
T/E = 3 d^2 S^2 / (20 a^2 b^2) + c k d with its largest curvature k d. The string at its break has
the length L = S (1 + T/E) = l_a + l_b, and l_a^2 - l_b^2 = a^2 - b^2, so that
l_a = (L + (a^2 - b^2)/L)/2 and d = (l_a^2 - a^2)^(1/2).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from physics.beam import Beam
from physics.cubic import Cubic
from physics.equilibrium import NoEquilibrium
from physics.exact import Exact
from physics.exact import many as exact
from physics.pull import break_of
from physics.rupture import check_rupture, critical_stations
from physics.section import Ring
from physics.taut_string import TautString
from physics.theory import Theory

Row = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Beams:
    """N beams of some shapes, each grasped at one place: an (N,) row for what else they have."""

    shapes: Sequence[Beam]  # whose material is not looked at
    which: NDArray[np.int64]  # shape of each beam
    modulus: Row  # MPa
    poisson_ratio: Row
    grasp: Row  # from the first clamp, mm

    @property
    def span(self) -> Row:
        """(N,) mm."""
        return np.array([shape.span for shape in self.shapes])[self.which]

    def beam(self, i: int) -> Beam:
        """Return one of them."""
        shape = self.shapes[int(self.which[i])]
        return shape.of_material(float(self.modulus[i]), float(self.poisson_ratio[i]))


@dataclass(frozen=True, slots=True)
class Ducts:
    """N beams of constant section, each grasped at one place: an (N,) row for each property."""

    span: Row  # mm
    area: Row  # mm^2
    second_moment: Row  # mm^4
    fibre_distance: Row  # mm
    modulus: Row  # MPa
    poisson_ratio: Row
    grasp: Row  # from the first clamp, mm

    def beam(self, i: int) -> Beam:
        """Return one of them."""
        values = (float(getattr(self, field.name)[i]) for field in fields(self)[:-1])
        return Beam(*values)


@dataclass(frozen=True, slots=True)
class SolvedDucts:
    """What N ducts bear: (N,) rows, nan where a theory finds none or none was asked for."""

    break_force: Row  # the grasper's whole force at the break, N
    break_deflection: Row  # mm
    break_station: Row  # mm from the first clamp
    force: Row  # under the load: N
    deflection: Row  # mm
    normal_stress: Row  # at the place of the highest stress, MPa
    bending_stress: Row  # there, MPa


def solve_many(
    theory: Theory,
    ducts: Ducts | Beams,
    threshold: Row | None = None,
    *,
    force: Row | None = None,
    deflection: Row | None = None,
) -> SolvedDucts:
    """Return the breaks of ducts at thresholds, MPa, and their loads by force, N, or place, mm."""
    if force is not None and deflection is not None:
        raise ValueError("give either forces or deflections")
    by_force = force is not None
    none = np.full(ducts.grasp.size, np.nan)
    load = force if force is not None else none if deflection is None else deflection
    limit = none if threshold is None else threshold
    if isinstance(theory, Exact):
        if isinstance(ducts, Beams):
            return _exact_of_shapes(theory, ducts, limit, load, by_force=by_force)
        return _exact(theory, ducts, limit, load, by_force=by_force)
    if isinstance(ducts, Ducts) and (
        isinstance(theory, TautString) or (isinstance(theory, Cubic) and theory.q != "fitted")
    ):
        return _closed(theory, ducts, limit, load, by_force=by_force)
    return _one_by_one(theory, ducts.beam, ducts.grasp, limit, load, by_force=by_force)


def _exact(theory: Exact, ducts: Ducts, limit: Row, load: Row, *, by_force: bool) -> SolvedDucts:
    span, modulus = ducts.span, ducts.modulus
    unit = modulus * ducts.area
    columns = np.zeros((exact.DUCT_ROWS, span.size))
    columns[exact.MOMENT_2] = ducts.second_moment / (ducts.area * span**2)
    columns[exact.REACH_OUT] = ducts.fibre_distance / span
    columns[exact.GRASP] = ducts.grasp / span
    columns[exact.LIMIT] = limit / modulus
    columns[exact.LOAD] = load / (unit if by_force else span)
    columns[exact.NU] = ducts.poisson_ratio
    rings = [
        Ring(*each) for each in zip(ducts.area.tolist(), ducts.second_moment.tolist(), strict=True)
    ]
    found = exact.solve_exact_ducts(theory.law, theory.intervals, columns, rings, by_force=by_force)
    return _in_units(found, unit, span, modulus)


def _exact_of_shapes(
    theory: Exact, beams: Beams, limit: Row, load: Row, *, by_force: bool
) -> SolvedDucts:
    # A set-up serves all beams of a shape, a grasp and, where sections shear, a Poisson's ratio:
    # of any modulus, for all is without units.
    ratios = beams.poisson_ratio if theory.law.shear else np.full(beams.grasp.size, 0.3)
    alike, group = np.unique(
        np.stack([beams.which, beams.grasp, ratios]), axis=1, return_inverse=True
    )
    order = np.argsort(group.ravel(), kind="stable")
    ends = np.cumsum(np.bincount(group.ravel(), minlength=alike.shape[1]))
    found = np.empty((exact.SOLVED_ROWS, beams.grasp.size))
    unit, span = np.empty(beams.grasp.size), beams.span
    built: dict[tuple[float, float], Beam] = {}
    for (which, grasp, ratio), rows in zip(alike.T.tolist(), np.split(order, ends), strict=False):
        beam = built.get((which, ratio))
        if beam is None:
            beam = built[which, ratio] = beams.shapes[int(which)].of_material(1.0, ratio)
        unit[rows] = beams.modulus[rows] * beam.mean_section[0]
        found[:, rows] = theory.pull(beam, grasp).solve_loads(
            limit[rows] / beams.modulus[rows],
            load[rows] / (unit[rows] if by_force else span[rows]),
            by_force=by_force,
        )
    return _in_units(found, unit, span, beams.modulus)


def _in_units(found: NDArray[np.float64], unit: Row, span: Row, modulus: Row) -> SolvedDucts:
    at = exact.LOADED
    return SolvedDucts(
        found[0] * unit,
        found[1] * span,
        found[2] * span,
        found[at] * unit,
        found[at + 1] * span,
        found[at + 3] * modulus,
        (found[at + 4] - found[at + 3]) * modulus,
    )


def _closed(
    theory: TautString | Cubic, ducts: Ducts, limit: Row, load: Row, *, by_force: bool
) -> SolvedDucts:
    span, modulus, a = ducts.span, ducts.modulus, ducts.grasp
    b = span - a
    if isinstance(theory, Cubic):
        assert not isinstance(theory.q, str)  # noqa: S101 (the caller has looked)
        ratio = span / (a * b)
        k1 = 3.0 * modulus * ducts.second_moment * ratio**3
        k3 = 0.045 * theory.q * ducts.area * modulus * span * ratio**4
        stretch = 0.15 * ratio**2
        at_clamp = 3.0 * span / (a * b * np.minimum(a, b))
        at_grasp = 6.0 / (a * b)
        bent = ducts.fibre_distance * np.maximum(at_clamp, at_grasp)
        strain = limit / modulus
        broken = 2.0 * strain / (bent + np.sqrt(bent**2 + 4.0 * stretch * strain))

        def force_of(d: Row) -> Row:
            return (k1 + k3 * d**2) * d

        pulled = _cubic_root(k1, k3, load) if by_force else load
        normal, bending = modulus * stretch * pulled**2, modulus * bent * np.abs(pulled)
        clamp_first = np.where(a <= b, 0.0, span)
        station = np.where(at_clamp > at_grasp * (1.0 + 1e-9), clamp_first, a)
    else:
        length = span * (1.0 + limit / modulus)
        la = 0.5 * (length + (a * a - b * b) / length)
        broken = np.sqrt((la - a) * (la + a))
        stiffness = modulus * ducts.area / span

        def stretched(d: Row) -> Row:
            square = d * d
            return square / (np.hypot(a, d) + a) + square / (np.hypot(b, d) + b)

        def force_of(d: Row) -> Row:
            return stiffness * stretched(d) * (d / np.hypot(a, d) + d / np.hypot(b, d))

        pulled = load
        if by_force:
            beams = [ducts.beam(i) for i in range(span.size)]
            pulled = np.array(
                [
                    theory.pull(beam, at).to_force(each).deflection
                    for beam, at, each in zip(beams, a.tolist(), load.tolist(), strict=True)
                ]
            )
        normal, bending = modulus * stretched(pulled) / span, np.zeros_like(span)
        station = a
    return SolvedDucts(
        force_of(broken),
        broken,
        np.where(np.isnan(broken), np.nan, station),
        load if by_force else force_of(load),
        pulled,
        normal,
        np.where(np.isnan(normal), np.nan, bending),
    )


def _cubic_root(bending: Row, stretching: Row, force: Row) -> Row:
    """Return the one real root of F = k1 d + k3 d^3, by sinh; see `physics.cubic`."""
    linear = force / bending
    argument = 1.5 * linear * np.sqrt(3.0 * stretching / bending)
    small = np.abs(argument) < 1e-8
    safe = np.where(small, 1.0, argument)
    return np.where(small, linear, 3.0 * linear * np.sinh(np.arcsinh(safe) / 3.0) / safe)


def _one_by_one(
    theory: Theory,
    beam_of: Callable[[int], Beam],
    grasps: Row,
    limit: Row,
    load: Row,
    *,
    by_force: bool,
) -> SolvedDucts:
    rows = np.full((7, grasps.size), np.nan)
    for i, grasp in enumerate(grasps.tolist()):
        pull = theory.pull(beam_of(i), grasp)
        if limit[i] > 0.0:
            event = break_of(pull, float(limit[i]))
            if event is not None:
                rows[:3, i] = event.force, event.deflection, event.check.station
        if not np.isnan(load[i]):
            try:
                pull = pull.to_force(load[i]) if by_force else pull.to_deflection(load[i])
                check = check_rupture(pull.sample(critical_stations(pull.beam, grasp)), 1.0)
            except NoEquilibrium:
                continue
            rows[3:, i] = pull.force, pull.deflection, check.normal_stress, check.bending_stress
    return SolvedDucts(*rows)
