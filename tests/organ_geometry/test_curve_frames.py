"""Curves are smoothed without pulling bends inward, and frames turn no more than they must."""

import numpy as np
import pytest

from organ_geometry.reslice.curve_frames import (
    evenly_spaced,
    rotation_minimising_frames,
    smooth_points,
    smooth_tangents,
)


def test_points_are_evenly_spaced_along_a_polyline() -> None:
    corners = np.array([[0.0, 0, 0], [3, 0, 0], [3, 4, 0]])
    points = evenly_spaced(corners, 0.9)
    # 7 long: eight steps of 0.875 are nearest to 0.9.
    assert len(points) == 9
    np.testing.assert_allclose(points[4], [3.0, 0.5, 0.0])
    np.testing.assert_array_equal(points[[0, -1]], corners[[0, -1]])


@pytest.mark.parametrize("reach", [2, 5, 50])
def test_a_cubic_is_its_own_smooth_curve(reach: int) -> None:
    t = np.linspace(-1.0, 1.0, 30)[:, np.newaxis]
    points = np.hstack([t, t**2 - t, 2.0 * t**3])
    np.testing.assert_allclose(smooth_points(points, reach), points, atol=1e-12)
    slopes = np.hstack([np.ones_like(t), 2.0 * t - 1.0, 6.0 * t**2])
    slopes /= np.linalg.norm(slopes, axis=1, keepdims=True)
    tangents = smooth_tangents(points, reach)
    inner = slice(min(reach, 14), 30 - min(reach, 14)) if reach < 15 else slice(14, 15)
    np.testing.assert_allclose(tangents[inner], slopes[inner], atol=0.05 if reach == 50 else 1e-10)
    # Nearer to an end the tangent stays.
    first = tangents[: min(reach, 14) + 1]
    np.testing.assert_array_equal(first, np.broadcast_to(tangents[0], first.shape))


def test_noise_is_smoothed_and_a_bend_is_not() -> None:
    angles = np.linspace(0.0, np.pi, 120)
    circle = 20.0 * np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1)
    noisy = circle + np.random.default_rng(0).normal(scale=0.5, size=circle.shape)
    radii = np.linalg.norm(smooth_points(noisy, 12)[12:-12], axis=1)
    # A mean over the same points would have radius 19.7.
    assert abs(radii.mean() - 20.0) < 0.05
    assert radii.std() < 0.25


def test_frames_turn_against_the_torsion() -> None:
    # On a helix the Frenet frame turns by the torsion times the arc length: closed form.
    radius, rise = 3.0, 1.5
    pace = np.hypot(radius, rise)
    s = np.linspace(0.0, 30.0, 3001)
    angle = s / pace
    points = np.stack([radius * np.cos(angle), radius * np.sin(angle), rise * angle], axis=1)
    tangents = np.stack([-radius * np.sin(angle), radius * np.cos(angle), 0 * s + rise], 1) / pace
    normals = np.stack([-np.cos(angle), -np.sin(angle), 0 * s], axis=1)
    frames = rotation_minimising_frames(points, tangents, normals[0])
    np.testing.assert_allclose(
        np.swapaxes(frames, 1, 2) @ frames, np.broadcast_to(np.eye(3), frames.shape), atol=1e-12
    )
    np.testing.assert_allclose(np.linalg.det(frames), 1.0)
    np.testing.assert_array_equal(frames[:, :, 2], tangents)
    binormals = np.cross(tangents, normals)
    turned = np.unwrap(
        np.arctan2(
            (frames[:, :, 0] * binormals).sum(axis=1), (frames[:, :, 0] * normals).sum(axis=1)
        )
    )
    torsion = rise / pace**2
    np.testing.assert_allclose(turned, -torsion * s, atol=1e-5)


def test_a_direction_along_the_curve_is_replaced() -> None:
    points = np.stack([np.arange(4.0), np.zeros(4), np.zeros(4)], axis=1)
    tangents = np.broadcast_to([1.0, 0.0, 0.0], (4, 3))
    frames = rotation_minimising_frames(points, tangents, np.array([1.0, 0.0, 0.0]))
    np.testing.assert_allclose(np.linalg.det(frames), 1.0)
