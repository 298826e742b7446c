"""Organs of known shape have the surface and the sections of that shape."""

import dataclasses
import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from organ_geometry import organ as organ_module
from organ_geometry.organ import Organ

Tube = Callable[..., Organ]

# A circle of two polynomials of degree six is off by 1.1 % of its radius at the upright ends and by
# 0.3 % RMS; most of that averages out in the area and, less, in the second moment.
RADIUS_FRACTION = 0.012
AREA_FRACTION = 0.003
SECOND_MOMENT_FRACTION = 0.006
ROUNDING = 1e-12

STATIONS = np.linspace(0.0, 10.0, 7)


def test_a_cylinder_has_its_area_and_second_moment(make_tube: Tube) -> None:
    organ = make_tube([3.0, 3.0, 3.0])
    for direction in (None, [0.0, 0.0, 1.0], [0.0, 2.0, 0.0], [1.0, -1.0, 1.0]):
        pull = None if direction is None else np.array(direction)
        found = organ.section_properties(STATIONS, pull)
        np.testing.assert_allclose(found.area, np.pi * 3.0**2, rtol=AREA_FRACTION)
        np.testing.assert_allclose(
            found.second_moment, np.pi * 6.0**4 / 64.0, rtol=SECOND_MOMENT_FRACTION
        )
        np.testing.assert_allclose(found.fibre_distance, 3.0, rtol=RADIUS_FRACTION)


def test_a_hollow_cylinder_is_its_wall(make_tube: Tube) -> None:
    organ = make_tube([3.0, 3.0], inner=[2.0, 2.0])
    found = organ.section_properties(STATIONS)
    assert organ.hollow
    # The wall is a difference, so errors of both boundaries fall on a smaller number.
    np.testing.assert_allclose(found.area, np.pi * (9.0 - 4.0), rtol=2 * AREA_FRACTION)
    np.testing.assert_allclose(
        found.second_moment, np.pi * (6.0**4 - 4.0**4) / 64.0, rtol=2 * SECOND_MOMENT_FRACTION
    )
    np.testing.assert_allclose(found.fibre_distance, 3.0, rtol=RADIUS_FRACTION)


def test_an_ellipse_bends_about_the_axis_across_the_direction(make_tube: Tube) -> None:
    round_organ = make_tube([2.0, 2.0])
    rows = np.array(round_organ.outer)
    # Half the height and shifted by (4, 1): half axes 2 along x (space y), 1 along y (space -z).
    rows[:, 2:] *= 0.5
    rows[:, [2, 9]] += 1.0
    rows[:, 0] += 4.0
    organ = dataclasses.replace(round_organ, outer=rows)
    up = organ.section_properties(STATIONS)
    flat, tall = np.pi * 2.0 * 1.0**3 / 4.0, np.pi * 2.0**3 * 1.0 / 4.0
    np.testing.assert_allclose(up.second_moment, flat, rtol=SECOND_MOMENT_FRACTION)
    np.testing.assert_allclose(up.fibre_distance, 1.0, rtol=RADIUS_FRACTION)
    aside = organ.section_properties(STATIONS, np.array([0.0, 1.0, 0.0]))
    np.testing.assert_allclose(aside.second_moment, tall, rtol=SECOND_MOMENT_FRACTION)
    np.testing.assert_allclose(aside.fibre_distance, 2.0, rtol=RADIUS_FRACTION)
    # Second moments about perpendicular axes add up to the same for any pair of directions.
    one = organ.section_properties(STATIONS, np.array([0.0, 0.6, 0.8])).second_moment
    other = organ.section_properties(STATIONS, np.array([0.0, -0.8, 0.6])).second_moment
    np.testing.assert_allclose(one + other, up.second_moment + aside.second_moment)


def test_the_surface_of_a_cylinder(make_tube: Tube) -> None:
    organ = make_tube([3.0, 3.0, 3.0])
    angles = np.linspace(0.0, 2.0 * np.pi, 40)
    stations = np.linspace(0.0, 10.0, 40)
    points = organ.surface(stations, angles)
    np.testing.assert_allclose(points[:, 0], stations, atol=ROUNDING)
    np.testing.assert_allclose(np.hypot(points[:, 1], points[:, 2]), 3.0, rtol=RADIUS_FRACTION)
    # A quarter turn from x_dir (+y) is down the image (-z).
    poles = organ.surface(np.full(2, 5.0), np.radians([90.0, 270.0]))
    np.testing.assert_allclose(poles, [[5, 0, -3], [5, 0, 3]], atol=3.0 * RADIUS_FRACTION)
    right, left = organ.surface(np.full(2, 5.0), np.radians([10.0, 170.0]))
    assert right[1] > 2.9
    assert left[1] < -2.9


def test_a_cone_is_straight_between_its_key_sections(make_tube: Tube) -> None:
    thin = make_tube(np.linspace(1.0, 3.0, 9))
    two_keys = dataclasses.replace(thin, keys=np.array([0, 8]), outer=thin.outer[[0, 8]])
    stations = np.random.default_rng(1).uniform(0.0, 10.0, 200)
    angles = np.random.default_rng(2).uniform(0.0, 2.0 * np.pi, 200)
    np.testing.assert_allclose(
        two_keys.surface(stations, angles), thin.surface(stations, angles), atol=ROUNDING
    )


def test_key_rows_are_exact_at_key_stations(make_tube: Tube) -> None:
    radii = np.random.default_rng(4).uniform(1.0, 2.0, 12)
    organ = make_tube(radii, inner=0.5 * radii)
    np.testing.assert_array_equal(organ.rows_at(organ.key_stations), organ.outer)
    np.testing.assert_array_equal(organ.rows_at(organ.key_stations, "lumen"), organ.lumen)


def test_stations_beyond_the_ends_are_the_ends(make_tube: Tube) -> None:
    organ = make_tube([1.0, 2.0, 3.0])
    angles = np.array([0.3, 0.3])
    np.testing.assert_array_equal(
        organ.surface(np.array([-1.0, 11.0]), angles), organ.surface(np.array([0.0, 10.0]), angles)
    )


def test_lengths_along_a_bent_axis(make_tube: Tube) -> None:
    axis = np.array([[0.0, 0.0, 0.0], [3.0, 4.0, 0.0], [3.0, 4.0, 12.0]])
    organ = dataclasses.replace(make_tube([1.0, 1.0, 1.0]), axis=axis)
    assert organ.stations.tolist() == [0.0, 5.0, 17.0]
    assert organ.length == 17.0
    np.testing.assert_allclose(
        organ.axis_at(np.array([2.5, 11.0])), [[1.5, 2.0, 0.0], [3.0, 4.0, 6.0]]
    )


def test_frames_between_sections_are_perpendicular_and_half_way(make_tube: Tube) -> None:
    straight = make_tube([1.0, 1.0])
    turn = np.radians(40.0)
    rotation = np.array(
        [[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1.0]]
    )
    for mirrored in (False, True):
        frame = np.array(straight.frames[0])
        if mirrored:
            frame[:, 1] *= -1.0
        organ = dataclasses.replace(straight, frames=np.stack([frame, rotation @ frame]))
        found = organ.frames_at(np.array([0.0, 2.0, 5.0, 10.0]))
        products = np.einsum("nij,nik->njk", found, found)
        np.testing.assert_allclose(products, np.broadcast_to(np.eye(3), (4, 3, 3)), atol=ROUNDING)
        np.testing.assert_allclose(np.linalg.det(found), organ.handedness)
        np.testing.assert_allclose(found[0], frame, atol=ROUNDING)
        np.testing.assert_allclose(found[3], rotation @ frame, atol=ROUNDING)
        half = np.radians(20.0)
        np.testing.assert_allclose(found[2][:, 2], [np.cos(half), np.sin(half), 0], atol=ROUNDING)


def test_handedness(make_tube: Tube) -> None:
    organ = make_tube([1.0, 1.0])
    assert organ.handedness == -1
    mirrored = np.array(organ.frames)
    mirrored[:, :, 1] *= -1.0
    assert dataclasses.replace(organ, frames=mirrored).handedness == 1


def test_mean_radius_and_key_points(make_tube: Tube) -> None:
    organ = make_tube([1.0, 3.0])
    # The area of a cone of mean radius 2 lies between key sections in the coefficients' mean.
    assert make_tube([2.0, 2.0]).mean_radius == pytest.approx(2.0, rel=AREA_FRACTION)
    assert organ.mean_radius == pytest.approx(2.0, rel=AREA_FRACTION)
    points = organ.key_points(16)
    assert points.shape == (32, 3)
    assert set(points[:, 0]) == {0.0, 10.0}
    np.testing.assert_allclose(np.hypot(points[16:, 1], points[16:, 2]), 3.0, rtol=RADIUS_FRACTION)


def test_mean_radius_is_found_once_when_it_is_asked_for(
    make_tube: Tube, monkeypatch: pytest.MonkeyPatch
) -> None:
    found: list[int] = []
    moments = organ_module._moments
    monkeypatch.setattr(
        organ_module, "_moments", lambda outlines: found.append(1) or moments(outlines)
    )
    organ = make_tube([1.0, 3.0])
    assert not found
    assert organ.mean_radius == organ.mean_radius
    assert found == [1]
    same = dataclasses.replace(organ, name="another")
    assert same.mean_radius == organ.mean_radius
    assert pickle.loads(pickle.dumps(organ)).mean_radius == organ.mean_radius


def test_arrays_are_copied_and_locked(make_tube: Tube) -> None:
    given = make_tube([1.0, 1.0], inner=[0.5, 0.5])
    axis = np.array(given.axis)
    organ = dataclasses.replace(given, axis=axis)
    axis[0] = 7.0
    assert organ.axis[0].tolist() == [0.0, 0.0, 0.0]
    for name in ("axis", "frames", "keys", "outer", "lumen"):
        with pytest.raises(ValueError, match="read-only"):
            getattr(organ, name)[0] = 0


def with_value(array: Any, place: Any, value: float) -> Any:
    changed = np.array(array)
    changed[place] = value
    return changed


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda o: {"axis": o.axis[:1]}, "two or more sections, not 1"),
        (lambda o: {"axis": o.axis[:, :2]}, r"axis must have shape \(3, 3\), not \(3, 2\)"),
        (lambda o: {"axis": with_value(o.axis, 1, np.nan)}, "axis must be finite"),
        (lambda o: {"axis": o.axis[[0, 0, 2]]}, "neighbouring points of axis must be apart"),
        (lambda o: {"frames": o.frames[:2]}, r"frames must have shape \(3, 3, 3\)"),
        (lambda o: {"frames": 1.01 * o.frames}, "perpendicular unit columns to within 0.001"),
        (lambda o: {"frames": o.frames * [[[1.0]], [[1.0]], [[-1.0]]]}, "all right-handed or all"),
        (lambda o: {"keys": np.array([0, 1])}, "keys must increase from 0 to 2"),
        (lambda o: {"keys": np.array([0, 2, 2])}, "keys must increase from 0 to 2"),
        (lambda o: {"keys": np.array([1, 2])}, "keys must increase from 0 to 2"),
        (lambda o: {"keys": np.array([0.0, 1.0, 2.0])}, "keys must be .* whole numbers"),
        (lambda o: {"keys": np.array([0])}, "keys must be .* two or more"),
        (lambda o: {"outer": o.outer[:2]}, r"outer must have shape \(3, 16\), not \(2, 16\)"),
        (lambda o: {"outer": with_value(o.outer, (1, 5), np.inf)}, "outer must be finite"),
        (lambda o: {"outer": with_value(o.outer, (1, 1), 0.0)}, "half width in outer must be"),
        (lambda o: {"lumen": with_value(o.outer, (1, 1), -1.0)}, "half width in lumen must be"),
        (lambda o: {"tolerance_mm": -1.0}, "tolerance_mm must be 0 mm or more"),
        (lambda o: {"tolerance_mm": np.nan}, "tolerance_mm must be 0 mm or more"),
    ],
)
def test_what_makes_no_organ_is_refused(
    make_tube: Tube, change: Callable[[Organ], dict[str, Any]], message: str
) -> None:
    organ = make_tube([1.0, 1.1, 1.2])
    with pytest.raises(ValueError, match=message):
        dataclasses.replace(organ, **change(organ))


def test_a_direction_along_the_axis_is_refused(make_tube: Tube) -> None:
    organ = make_tube([1.0, 1.0])
    with pytest.raises(ValueError, match="points along the axis"):
        organ.section_properties(STATIONS, np.array([1.0, 0.0, 0.0]))
    for wrong in (np.zeros(3), np.array([1.0, np.nan, 0.0]), np.ones(2)):
        with pytest.raises(ValueError, match=r"direction must be \(3,\), finite and not zero"):
            organ.section_properties(STATIONS, wrong)


def test_a_solid_organ_has_no_lumen(make_tube: Tube) -> None:
    organ = make_tube([1.0, 1.0])
    assert not organ.hollow
    with pytest.raises(ValueError, match="solid and has no lumen"):
        organ.surface(np.array([1.0]), np.array([0.0]), "lumen")
