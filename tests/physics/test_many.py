"""Ducts by the thousand bear what each of them bears alone."""

import numpy as np
import pytest

from physics import (
    Beam,
    Cubic,
    Exact,
    Fem,
    Linear,
    NeoHooke,
    NoEquilibrium,
    TautString,
    Theory,
    VaryingBeam,
    break_of,
    check_rupture,
    critical_stations,
)
from physics.exact.many import lateral_constants
from physics.many import Beams, Ducts, solve_many
from physics.section import lateral_constant


def drawn_ducts(count: int, central: bool) -> tuple[Ducts, np.ndarray, np.ndarray]:
    """Ducts, full and hollow, with thresholds, MPa, and forces, N."""
    drawn = np.random.default_rng(3)
    span, diameter = drawn.uniform(40.0, 60.0, count), drawn.uniform(4.0, 9.0, count)
    bore = np.where(np.arange(count) % 2, diameter - 2.0 * drawn.uniform(0.8, 1.5, count), 0.0)
    modulus = drawn.uniform(0.1, 10.0, count)
    area = np.pi / 4.0 * (diameter**2 - bore**2)
    ducts = Ducts(
        span,
        area,
        np.pi / 64.0 * (diameter**4 - bore**4),
        0.5 * diameter,
        modulus,
        drawn.choice([0.3, 0.45], count),
        span * (0.5 if central else drawn.uniform(0.2, 0.8, count)),
    )
    return ducts, modulus * drawn.uniform(0.05, 0.6, count), 0.02 * modulus * area


@pytest.mark.slow
@pytest.mark.parametrize("central", [True, False])
@pytest.mark.parametrize(
    ("theory", "count"),
    [
        (Cubic(), 5),
        (TautString(), 5),
        (Exact(), 5),
        (Exact(Linear(shear=True)), 3),
        (Exact(NeoHooke()), 3),
        (Fem(), 1),
    ],
    ids=str,
)
def test_each_bears_what_it_bears_alone(theory: Theory, count: int, central: bool) -> None:
    compare_one_by_one(theory, *drawn_ducts(count, central))


def compare_one_by_one(
    theory: Theory, ducts: Ducts | Beams, thresholds: np.ndarray, forces: np.ndarray
) -> None:
    found = solve_many(theory, ducts, thresholds, force=forces)
    places = solve_many(theory, ducts, deflection=found.deflection)
    for i in range(forces.size):
        beam, grasp = ducts.beam(i), float(ducts.grasp[i])
        event = break_of(theory.pull(beam, grasp), thresholds[i])
        pull = theory.pull(beam, grasp).to_force(forces[i])
        check = check_rupture(pull.sample(critical_stations(beam, grasp)), 1.0)
        at_break = [np.nan] * 3  # the linear law with shear softens without end
        if event is not None:
            at_break = [event.force, event.deflection, event.check.station]
        wanted = (
            *at_break,
            pull.force,
            pull.deflection,
            check.normal_stress,
            check.bending_stress,
        )
        got = [getattr(found, name)[i] for name in found.__slots__]
        if event is not None and np.isclose(got[2], beam.span - event.check.station):
            got[2] = event.check.station  # its mirror image, where it is grasped in the middle
        assert got == pytest.approx(wanted, rel=1e-9, abs=1e-12, nan_ok=True)
        assert places.force[i] == pytest.approx(forces[i], rel=1e-9)


@pytest.mark.parametrize(
    "theory", [Exact(), Exact(Linear(shear=True)), Exact(NeoHooke()), Fem()], ids=str
)
def test_beams_of_varying_sections_bear_what_each_bears_alone(theory: Theory) -> None:
    stations = np.array([0.0, 12.0, 25.0, 25.0, 38.0, 50.0])
    areas = np.array([30.0, 22.0, 26.0, 18.0, 24.0, 30.0])
    odd = VaryingBeam(
        stations=stations,
        areas=areas,
        second_moments=areas**2 / 9.0,
        fibre_distances=np.sqrt(areas) / 1.6,
        offsets=None if isinstance(theory, Fem) else np.linspace(0.0, 0.4, 6),
        modulus=1.0,
    )
    # Half of its mirror image is solved where it is grasped in the middle.
    even = VaryingBeam.of(Beam.round(span=40.0, diameter=6.0, wall=1.0, modulus=1.0), 5)
    count = 2 if isinstance(theory, Fem) else 5
    modulus = np.array([0.2, 0.3, 0.4, 0.5, 0.3])[:count]
    beams = Beams(
        [odd, even],
        np.array([0, 1, 0, 1, 0])[:count],
        modulus,
        np.array([0.3, 0.3, 0.45, 0.45, 0.3])[:count],
        np.array([20.0, 20.0, 31.0, 9.0, 20.0])[:count],
    )
    compare_one_by_one(theory, beams, 0.3 * modulus, 0.4 * modulus)


def test_where_no_section_at_clamps_or_grasp_is_the_weakest() -> None:
    # Stretched to twice its length a neo-Hookean duct is stressed most between them.
    ducts, _, _ = drawn_ducts(2, central=False)
    theory, limit = Exact(NeoHooke()), 1.2 * ducts.modulus
    found = solve_many(theory, ducts, limit)
    for i in range(2):
        event = break_of(theory.pull(ducts.beam(i), float(ducts.grasp[i])), limit[i])
        assert event is not None
        assert found.break_deflection[i] == pytest.approx(event.deflection, rel=1e-9)
        assert 0.0 < found.break_station[i] < ducts.span[i]


def test_a_law_that_softens_breaks_where_the_threshold_is_first_reached() -> None:
    # The stress at the nearer clamp rises to 0.98154 E at 0.37 spans, falls to 0.724 E, and grows
    # without bound at hundreds of spans.
    theory, duct = Exact(Linear(shear=True)), Beam.round(span=40.0, diameter=6.0, modulus=1.0)
    shape = VaryingBeam.of(duct.of_material(1.0, 0.45), 5)
    limit = np.array([0.7, 0.8, 0.9, 0.98, 0.9815])
    row = np.ones(limit.size)
    beams = Beams([shape], np.zeros(limit.size, dtype=np.int64), row, 0.45 * row, 10.0 * row)
    found = solve_many(theory, beams, limit)
    for i, threshold in enumerate(limit.tolist()):
        event = break_of(theory.pull(beams.beam(i), 10.0), threshold)
        assert event is not None
        assert (found.break_force[i], found.break_deflection[i], found.break_station[i]) == (
            event.force,
            event.deflection,
            event.check.station,
        )
        assert event.check.total_stress == pytest.approx(threshold, rel=1e-9)
        assert event.deflection < 0.375 * 40.0
    assert np.all(np.diff(found.break_deflection) > 0.0)


def test_what_a_law_cannot_carry_is_no_number() -> None:
    ducts, _, forces = drawn_ducts(2, central=True)
    theory = Exact(Linear(shear=True))
    too_much = np.array([forces[0], 1e9])
    found = solve_many(theory, ducts, np.array([np.nan, 1.0]), force=too_much)
    assert np.isnan(found.break_force[0])
    assert np.isfinite(found.deflection[0])
    assert np.isnan(found.deflection[1])
    with pytest.raises(NoEquilibrium):
        theory.pull(ducts.beam(1), float(ducts.grasp[1])).to_force(1e9)


def test_no_duct_depends_on_those_before_it() -> None:
    ducts, thresholds, forces = drawn_ducts(6, central=False)
    theory = Exact(NeoHooke())
    together = solve_many(theory, ducts, thresholds, force=forces)
    last = Ducts(*(getattr(ducts, name)[4:] for name in ducts.__slots__))
    alone = solve_many(theory, last, thresholds[4:], force=forces[4:])
    for name in together.__slots__:
        assert np.array_equal(getattr(together, name)[4:], getattr(alone, name))


def test_lateral_constants_are_those_of_the_section() -> None:
    ratios = np.array([0.0, 0.12, 0.3, 0.3, 0.45, 0.499])
    assert lateral_constants(ratios) == pytest.approx(
        [lateral_constant(each) for each in ratios.tolist()], abs=1e-12
    )
