"""The band of the distance to break, against ducts that are solved one by one."""

import numpy as np
import pytest

from app.simulation import Spread, preset_named
from physics import Cubic, Exact, NeoHooke, TautString, Theory
from physics.many import Ducts, solve_many


@pytest.mark.parametrize("theory", [Cubic(), TautString(), Exact(), Exact(NeoHooke())])
def test_a_band_holds_nine_of_ten_ducts_that_are_bent_alike(theory: Theory) -> None:
    duct = preset_named("thesis-bile-duct").round_beam()
    spread, count = Spread(1.5, 1.3), 2000
    generator = np.random.default_rng(3)
    moduli = duct.modulus * 1.5 ** generator.standard_normal(count)
    strengths = 0.4 * 1.3 ** generator.standard_normal(count)

    def distances(moduli: np.ndarray, strengths: np.ndarray) -> np.ndarray:
        def row(value: float) -> np.ndarray:
            return np.full(moduli.size, value)

        ducts = Ducts(
            row(duct.span),
            row(duct.area),
            row(duct.second_moment),
            row(duct.fibre_distance),
            moduli,
            row(duct.poisson_ratio),
            row(0.5 * duct.span),
        )
        found = solve_many(theory, ducts, deflection=row(8.0))
        return 1.0 - (found.normal_stress + found.bending_stress) / strengths

    (distance,) = distances(np.array([duct.modulus]), np.array([0.4]))
    low, high = spread.band(distance)
    others = distances(moduli, strengths)
    # Three standard deviations of a count.
    assert np.mean(np.maximum(others, 0.0) < low) == pytest.approx(0.05, abs=0.015)
    assert np.mean(others > high) == pytest.approx(0.05, abs=0.015)
    assert np.mean(others <= 0.0) == pytest.approx(spread.torn(distance), abs=0.03)


def test_a_band_ends_where_ducts_are_torn_and_is_a_point_for_ducts_alike() -> None:
    assert Spread(1.0, 1.0).band(0.38) == pytest.approx((0.38, 0.38))
    assert (Spread(1.0, 1.0).torn(0.38), Spread(1.0, 1.0).torn(0.0)) == (0.0, 1.0)
    assert Spread(2.0, 1.0).band(0.1)[0] == 0.0
    assert Spread(2.0, 1.5).torn(0.0) == pytest.approx(0.5)
    assert Spread(2.0, 1.5).band(1.0) == (1.0, 1.0)


def test_a_preset_states_its_factors() -> None:
    ureter = preset_named("human-ureter")
    assert Spread.of(ureter) == Spread(1.0, 1.14)
    assert Spread.of(preset_named("thesis-bile-duct")) == Spread(1.5, 1.3)
