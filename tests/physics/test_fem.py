"""The finite elements against ANSYS, against beam theory, against themselves."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.validation.thesis_tables import INCH, LBF, PSI, TABLE_6_1, TABLE_6_2, TABLE_6_3, Table
from physics import (
    Beam,
    Cubic,
    Fem,
    NoEquilibrium,
    break_of,
    check_rupture,
    corotational,
    critical_stations,
)

DUCT = Beam.round(span=50.8, diameter=8.89, modulus=45.0 * PSI)
EI = DUCT.modulus * DUCT.second_moment
EVERYWHERE = np.linspace(0.0, 50.8, 101)

slender_beams = st.builds(
    Beam.round,
    span=st.floats(40.0, 200.0),
    diameter=st.floats(1.0, 10.0),
    modulus=st.floats(1e-3, 1e3),
)
fractions = st.one_of(st.just(0.5), st.floats(0.05, 0.95))
deflections = st.floats(1e-4, 1.0)


@pytest.mark.parametrize(
    ("table", "largest"),
    # 6.1 and 6.2 give three or four digits, which is half of what is left there.
    [(TABLE_6_1, 0.41), (TABLE_6_2, 0.481), (TABLE_6_3, 0.0134)],
    ids=["6.1", "6.2", "6.3"],
)
def test_every_row_of_ansys(table: Table, largest: float) -> None:
    beam = Beam.round(span=2.0 * table.half_span, diameter=table.diameter, modulus=table.modulus)
    for force, _, ansys in table.rows:
        deflection = Fem().pull(beam, table.half_span).to_force(2.0 * force).deflection
        assert 100.0 * abs(deflection / ansys - 1.0) < largest, force
        back = Fem().pull(beam, table.half_span).to_deflection(deflection).force
        assert back == pytest.approx(2.0 * force, rel=1e-9)


def test_energetic_elements_are_softer_at_large_pulls_only() -> None:
    """The geometrically exact beam lies up to 3.5 % above ANSYS's column of table 6.3."""
    beam = Beam.round(span=2.0, diameter=0.35, modulus=45.0)
    above = [
        100.0 * (Fem(energetic=True).pull(beam, 1.0).to_force(2.0 * force).deflection / ansys - 1.0)
        for force, _, ansys in TABLE_6_3.rows
    ]
    assert above[0] == pytest.approx(0.0, abs=0.05)
    assert max(above) == pytest.approx(3.51, abs=0.01)


@pytest.mark.parametrize("grasp", [25.4, 12.0, 5.0])
def test_small_pulls_are_those_of_the_linear_clamped_beam(grasp: float) -> None:
    """Cubic elements bend exactly as the linear beam does: deflection, moment, shear, energy."""
    small = 1e-7
    fem = Fem(elements=3).pull(DUCT, grasp).to_deflection(small).sample(EVERYWHERE)
    linear = Cubic(q=0.0).pull(DUCT, grasp).to_deflection(small).sample(EVERYWHERE)
    assert fem.force == pytest.approx(linear.force, rel=1e-9)
    assert fem.across == pytest.approx(linear.across, rel=1e-9, abs=1e-9 * small)
    assert fem.rotation == pytest.approx(linear.rotation, rel=1e-9, abs=1e-9 * small)
    scale = np.abs(linear.moment).max()
    assert fem.moment == pytest.approx(linear.moment, abs=1e-9 * scale)
    assert fem.shear_force == pytest.approx(linear.shear_force, rel=1e-7)
    assert fem.strain_energy == pytest.approx(0.5 * linear.force * small, rel=1e-9)


def test_thin_beam_pulled_far_is_nearly_the_string() -> None:
    beam = Beam.round(span=100.0, diameter=0.05, modulus=1.0)
    half, delta = 50.0, 20.0
    taut = 2.0 * beam.area * (np.hypot(half, delta) / half - 1.0) * delta / np.hypot(half, delta)
    assert Fem().pull(beam, half).to_deflection(delta).force == pytest.approx(taut, rel=3e-3)


@settings(deadline=None, max_examples=30)
@given(slender_beams, fractions, deflections)
def test_energy_grows_by_force_times_deflection(
    beam: Beam, fraction: float, relative: float
) -> None:
    """DU = F d(delta), by central differences: what `energetic` stands for."""
    grasp, delta, at = fraction * beam.span, relative * beam.span, np.zeros(1)
    step = 1e-4 * delta
    theory = Fem(energetic=True)
    energies = [
        theory.pull(beam, grasp).to_deflection(delta + d).sample(at).strain_energy
        for d in (-step, step)
    ]
    slope = (energies[1] - energies[0]) / (2.0 * step)
    assert slope == pytest.approx(theory.pull(beam, grasp).to_deflection(delta).force, rel=1e-6)


def test_the_references_elements_give_away_some_energy() -> None:
    """(M1 + M2) / L0 is no derivative: at the break of figure 6.28 4.2 % of the force are lost."""
    clamp = np.zeros(1)

    def slope_over_force(delta: float) -> float:
        ends = (
            Fem().pull(DUCT, 25.4).to_deflection(delta + d).sample(clamp) for d in (-1e-3, 1e-3)
        )
        low, high = (end.strain_energy for end in ends)
        return (high - low) / 2e-3 / Fem().pull(DUCT, 25.4).to_deflection(delta).force

    assert slope_over_force(0.1) == pytest.approx(1.0, abs=1e-4)
    broken = Fem().pull(DUCT, 25.4).to_force(0.8 * LBF).deflection
    assert slope_over_force(broken) == pytest.approx(0.9577, abs=1e-4)


def test_stresses_at_the_break_are_those_of_the_exact_beam() -> None:
    """4.1 + 25.6 psi at P = 0.4 lbf of table 6.3, from a converged geometrically exact beam."""
    stations = critical_stations(DUCT, 25.4)
    pulled = Fem(energetic=True).pull(DUCT, 25.4).to_force(0.8 * LBF).sample(stations)
    check = check_rupture(pulled, 1.0)
    assert check.normal_stress / PSI == pytest.approx(4.1, abs=0.05)
    assert check.bending_stress / PSI == pytest.approx(25.6, abs=0.05)
    assert pulled.deflection / INCH == pytest.approx(0.4658919, rel=5e-4)


@pytest.mark.parametrize(
    ("force", "deflection"),
    [
        (0.02, 0.0148755),
        (0.2, 0.1322969),
        (0.4, 0.223556),
        (0.8, 0.3479564),
        (2.0, 0.5821096),
        (5.0, 0.9816811),
    ],
)
def test_off_centre_pulls_are_those_of_another_program(force: float, deflection: float) -> None:
    """OpenSeesPy 3.8, 80 elasticBeamColumn elements, Corotational: table 6.3 pulled at 30 %."""
    beam = Beam.round(span=2.0, diameter=0.35, modulus=45.0)
    # Their elements are all as long, these are as many on either side.
    assert Fem(energetic=True).pull(beam, 0.6).to_force(force).deflection == pytest.approx(
        deflection, rel=3e-4
    )


@settings(deadline=None, max_examples=50)
@given(slender_beams, fractions, st.floats(1e-2, 1.0), st.booleans())
def test_the_two_sides_balance_the_pull(
    beam: Beam, fraction: float, relative: float, energetic: bool
) -> None:
    """N = H cos(theta) + P sin(theta) with one H and one P on each side, and F the two P's sum."""
    grasp, delta = fraction * beam.span, relative * beam.span
    far = 1.0 - fraction
    pieces = np.array([0.0, 0.3 * fraction, 0.5 * fraction, 1.0 - 0.5 * far, 1.0 - 0.3 * far, 1.0])
    pulled = (
        Fem(energetic=energetic).pull(beam, grasp).to_deflection(delta).sample(pieces * beam.span)
    )
    tension, turn = pulled.normal_force, pulled.rotation
    scale = np.abs(tension).max() + pulled.force
    along = tension[0]
    assert tension[-1] == pytest.approx(along, abs=1e-8 * scale)
    across = (tension[1:-1] - along * np.cos(turn[1:-1])) / np.sin(turn[1:-1])
    assert across[0] == pytest.approx(across[1], abs=1e-5 * scale)
    assert across[2] == pytest.approx(across[3], abs=1e-5 * scale)
    assert across[0] - across[3] == pytest.approx(pulled.force, abs=1e-5 * scale)


@settings(deadline=None, max_examples=30)
@given(slender_beams, fractions, deflections)
def test_shear_is_the_slope_of_the_moment(beam: Beam, fraction: float, relative: float) -> None:
    grasp, delta = fraction * beam.span, relative * beam.span
    x = np.array([0.31, 0.3101]) * beam.span
    x = x if np.all(x < grasp) or np.all(x > grasp) else x + 0.4 * beam.span
    pulled = Fem(elements=1).pull(beam, grasp).to_deflection(delta).sample(x)
    slope = np.diff(pulled.moment) / np.diff(x)
    scale = 1e-7 * np.abs(pulled.moment).max() / (x[1] - x[0])
    assert pulled.shear_force[:1] == pytest.approx(slope, rel=1e-9, abs=scale)


def test_a_grasp_slides_through_the_middle_without_a_jump() -> None:
    """Halves and the whole span are the same beam."""
    middle = Fem().pull(DUCT, 25.4).to_deflection(12.0).sample(EVERYWHERE)
    beside = Fem().pull(DUCT, 25.4 + 1e-9).to_deflection(12.0).sample(EVERYWHERE)
    assert beside.force == pytest.approx(middle.force, rel=1e-8)
    assert beside.across == pytest.approx(middle.across, abs=1e-7)
    assert beside.along == pytest.approx(middle.along, abs=1e-7)
    assert beside.rotation == pytest.approx(middle.rotation, abs=1e-8)
    scale = middle.total_stress.max()
    assert beside.total_stress == pytest.approx(middle.total_stress, abs=1e-8 * scale)
    assert beside.strain_energy == pytest.approx(middle.strain_energy, rel=1e-8)


def test_more_elements_come_nearer_by_the_square() -> None:
    """The error falls by four when the elements are halved."""
    counts = (10, 20, 40, 320)
    forces = [Fem(n, energetic=True).pull(DUCT, 18.0).to_deflection(12.0).force for n in counts]
    errors = np.abs(np.array(forces[:3]) - forces[3])
    assert errors[:2] / errors[1:] == pytest.approx([4.0, 4.0], rel=0.1)


def test_a_crushed_element_is_the_end_and_no_break() -> None:
    stout = Beam.round(span=5.0, diameter=5.0, modulus=1.0)
    with pytest.raises(NoEquilibrium, match=r"deflection must .* got 5 mm"):
        Fem().pull(stout, 2.5).to_deflection(5.0)
    assert break_of(Fem().pull(stout, 2.5), 1e4) is None
    event = break_of(Fem().pull(stout, 2.5), 0.5)
    assert event is not None
    assert event.check.total_stress == pytest.approx(0.5, rel=1e-9)


@pytest.mark.parametrize("elements", [0, -3, 2.5])
def test_elements_are_counted(elements: float) -> None:
    with pytest.raises(ValueError, match="elements must be a whole number above 0"):
        Fem(elements=elements)  # pyright: ignore[reportArgumentType]


@pytest.mark.parametrize("energetic", [False, True])
@pytest.mark.parametrize("by_force", [False, True])
def test_compiled_and_plain_kernels_agree(
    energetic: bool, by_force: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    rest = np.array([0.5, 0.5, 0.7, 0.7])
    args = (rest, 1.0, 0.02, energetic, corotational.LAST_OF_SPAN, 2, 0.4, by_force)
    compiled, plain = np.empty((5, 3)), np.empty((5, 3))
    force = corotational.pull_from_rest(*args, compiled)
    for name in ("element_state", "_balance", "_hold", "_eliminate", "_carry", "_newton"):
        kernel = getattr(corotational, name)
        monkeypatch.setattr(corotational, name, getattr(kernel, "py_func", kernel))
    kernel = corotational.pull_from_rest
    assert getattr(kernel, "py_func", kernel)(*args, plain) == pytest.approx(force, rel=1e-12)
    assert plain == pytest.approx(compiled, rel=1e-10, abs=1e-12)


def test_tangent_is_the_derivative_of_the_forces() -> None:
    random = np.random.default_rng(3)
    rest, ea, ei = np.array([0.5, 0.6, 0.4]), 2.0, 0.3
    moved = 0.2 * random.standard_normal((4, 3))
    for energetic in (False, True):

        def balance(
            places: np.ndarray, energetic: bool = energetic
        ) -> tuple[np.ndarray, np.ndarray]:
            forces, tangent = np.empty((4, 3)), np.empty((4, 3, 3, 3))
            state = corotational.element_state(rest, places, ea, ei, energetic)
            carried = state[:, 4:6]
            corotational._balance(rest, places, ea, ei, energetic, state, carried, forces, tangent)
            return forces, tangent

        tangent = balance(moved)[1]
        for node in range(4):
            for freedom in range(3):
                step = np.zeros((4, 3))
                step[node, freedom] = 1e-6
                slope = (balance(moved + step)[0] - balance(moved - step)[0]) / 2e-6
                for other in range(4):
                    expected = np.zeros(3)
                    if abs(other - node) <= 1:
                        expected = tangent[other, 1 + node - other, :, freedom]
                    assert slope[other] == pytest.approx(expected, abs=1e-7)
