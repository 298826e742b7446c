"""The thesis's rule keeps the sections that can be foretold."""

from collections.abc import Callable

import numpy as np
import pytest

from organ_geometry.curves.half_curves import closed_outlines
from organ_geometry.curves.key_sections import key_sections
from organ_geometry.organ import Organ

Tube = Callable[..., Organ]


def cone(make_tube: Tube, sections: int, step: float) -> Organ:
    return make_tube(10.0 + step * np.arange(sections))


@pytest.mark.parametrize("every", [1, 2, 3, 5])
def test_a_cone_keeps_sections_at_equal_steps(make_tube: Tube, every: int) -> None:
    organ = cone(make_tube, 16, 0.1)
    # Between every - 1 and every steps of radius; the upright ends of a half-curve take 1 % off.
    tolerance = 0.1 * (every - 0.5)
    expected = [*range(0, 15, every), 15]
    assert key_sections(organ.outer, None, tolerance).tolist() == expected


def test_tolerance_zero_keeps_all_and_a_huge_one_keeps_two(make_tube: Tube) -> None:
    organ = cone(make_tube, 9, 0.01)
    assert key_sections(organ.outer, None, 0.0).tolist() == list(range(9))
    assert key_sections(organ.outer, None, 1e6).tolist() == [0, 8]


def test_a_cylinder_keeps_two_sections_at_tolerance_zero(make_tube: Tube) -> None:
    assert key_sections(make_tube([3.0] * 12).outer, None, 0.0).tolist() == [0, 11]


def test_a_sudden_change_keeps_the_section_before_it(make_tube: Tube) -> None:
    organ = make_tube([5.0] * 8 + [6.0] * 8)
    assert key_sections(organ.outer, None, 0.1).tolist() == [0, 7, 8, 15]


def test_the_comparison_is_with_the_last_key_section(make_tube: Tube) -> None:
    # Each section differs from its neighbour by less than the tolerance.
    organ = make_tube([5.0, 5.06, 5.12, 5.18, 5.24])
    assert key_sections(organ.outer, None, 0.1).tolist() == [0, 2, 4]


def test_a_lumen_counts(make_tube: Tube) -> None:
    organ = make_tube([5.0] * 9, inner=[3.0, 3.0, 3.0, 3.0, 3.5, 3.5, 3.5, 3.5, 3.5])
    assert key_sections(organ.outer, None, 0.1).tolist() == [0, 8]
    assert key_sections(organ.outer, organ.lumen, 0.1).tolist() == [0, 3, 4, 8]


def test_what_is_left_out_stays_within_twice_the_tolerance(make_tube: Tube) -> None:
    rng = np.random.default_rng(3)
    for tolerance in (0.05, 0.2, 0.5):
        radii = 10.0 + np.cumsum(rng.normal(0.0, 0.15, 60))
        rows = make_tube(radii).outer
        keys = key_sections(rows, None, tolerance)
        decoded = np.stack([np.interp(np.arange(60), keys, rows[keys, i]) for i in range(16)], 1)
        away = np.linalg.norm(closed_outlines(decoded) - closed_outlines(rows), axis=2)
        # Circles about one centre: the distance is the difference of radii at every point.
        assert away.mean(axis=1).max() < 2.0 * tolerance * 1.02
        assert 2 < len(keys) < 60
