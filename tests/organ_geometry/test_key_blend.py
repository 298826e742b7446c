"""What lies between key sections: the cubic Hermite spline with parabolas' slopes."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import CubicHermiteSpline

from organ_geometry.curves.key_blend import KeyBlend

KEYS = st.sets(st.integers(1, 63), max_size=12).map(lambda inner: np.array([0, *sorted(inner), 64]))
EVERYWHERE = np.linspace(0.0, 64.0, 513)


def blended(keys: np.ndarray, values: np.ndarray) -> np.ndarray:
    return KeyBlend.at(EVERYWHERE, keys).of(values[:, np.newaxis])[:, 0]


@pytest.mark.slow
@settings(deadline=None, max_examples=100)
@given(keys=KEYS, seed=st.integers(0, 2**32 - 1))
def test_it_is_scipy_s_spline_of_the_parabolas_slopes(keys: np.ndarray, seed: int) -> None:
    values = np.random.default_rng(seed).normal(size=len(keys))
    found = blended(keys, values)
    lines = np.diff(values) / np.diff(keys)
    slopes = np.full(len(keys), lines[0])
    for key in range(1, len(keys) - 1):
        near = slice(key - 1, key + 2)
        parabola = np.polynomial.Polynomial.fit(keys[near], values[near], 2)
        slopes[key] = parabola.deriv()(keys[key])
    if len(keys) > 2:
        slopes[[0, -1]] = (3.0 * lines[[0, -1]] - slopes[[1, -2]]) / 2.0
    expected = CubicHermiteSpline(keys, values, slopes)(EVERYWHERE)
    np.testing.assert_allclose(found, expected, atol=1e-10 * (1.0 + np.abs(expected).max()))


@settings(deadline=None, max_examples=50)
@given(keys=KEYS)
def test_what_is_straight_stays_straight(keys: np.ndarray) -> None:
    np.testing.assert_allclose(
        blended(keys, 3.0 - 0.25 * keys), 3.0 - 0.25 * EVERYWHERE, atol=1e-11
    )


def test_keys_have_their_values_to_the_bit_and_so_do_places_beyond() -> None:
    keys, values = np.array([0, 3, 4, 9]), np.random.default_rng(3).normal(size=(4, 16))
    np.testing.assert_array_equal(KeyBlend.at(keys, keys).of(values), values)
    np.testing.assert_array_equal(
        KeyBlend.at(np.array([-2.0, 11.0]), keys).of(values), values[[0, -1]]
    )


@pytest.mark.parametrize("pieces", [4, 8, 16, 32])
def test_halving_the_distance_of_keys_divides_the_error_by_eight(pieces: int) -> None:
    """Inside, where slopes are right to the second order, the error is of the third."""
    inside = (EVERYWHERE > 16.0) & (EVERYWHERE < 48.0)

    def error(count: int) -> float:
        keys = np.arange(count + 1) * (64 // count)
        off = blended(keys, np.sin(0.1 * keys)) - np.sin(0.1 * EVERYWHERE)
        return float(np.abs(off[inside]).max())

    assert 6.5 < error(pieces) / error(2 * pieces) < 17.0
