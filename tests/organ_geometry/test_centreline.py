"""The middle of a tube of voxels is found from end to end."""

import numpy as np
import pytest
from numpy.typing import NDArray

from organ_geometry.reslice.centreline import NoTube, Tube, centreline
from organ_geometry.reslice.curve_frames import evenly_spaced
from organ_geometry.reslice.minimal_path import arc_lengths, minimal_path
from organ_geometry.reslice.plane_cut import plane_cut
from organ_geometry.reslice.section_planes import section_planes

SIZES = np.array([0.5, 0.5, 0.8])


def capsule(
    ends: NDArray[np.float64],
    radius: float,
    shape: tuple[int, int, int],
    sizes: NDArray[np.float64],
) -> NDArray[np.bool_]:
    """Voxels nearer to the line between two points than a radius, mm."""
    k, j, i = np.indices(shape)
    places = np.stack([i, j, k], axis=-1) * sizes
    direction = ends[1] - ends[0]
    along = np.clip(((places - ends[0]) @ direction) / (direction @ direction), 0.0, 1.0)
    return np.linalg.norm(places - ends[0] - along[..., None] * direction, axis=-1) < radius


ENDS = np.array([[6.0, 7.0, 7.0], [30.0, 22.0, 40.0]])
RADIUS = 4.0
SHAPE = (60, 60, 80)


def off_axis(points: NDArray[np.float64]) -> NDArray[np.float64]:
    direction = (ENDS[1] - ENDS[0]) / np.linalg.norm(ENDS[1] - ENDS[0])
    off = points - ENDS[0]
    return np.linalg.norm(off - np.outer(off @ direction, direction), axis=1)


@pytest.mark.slow
def test_the_minimal_path_keeps_to_the_middle() -> None:
    direction = minimal_path(capsule(ENDS, RADIUS, SHAPE, SIZES), SIZES)
    stations = arc_lengths(direction.points)
    inner = (stations > 2 * RADIUS) & (stations < stations[-1] - 2 * RADIUS)
    assert off_axis(direction.points[inner]).max() < 1.5 * SIZES.max()
    # Depths by steps between voxels are a little above straight distances.
    assert np.median(direction.depths) == pytest.approx(RADIUS, rel=0.15)


@pytest.mark.slow
def test_voxels_are_put_together_where_they_are_many(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("organ_geometry.reslice.minimal_path.MOST_VOXELS", 1500)
    direction = minimal_path(capsule(ENDS, RADIUS, SHAPE, SIZES), SIZES)
    stations = arc_lengths(direction.points)
    inner = (stations > 2 * RADIUS) & (stations < stations[-1] - 2 * RADIUS)
    assert off_axis(direction.points[inner]).max() < 2.5 * SIZES.max()


def test_the_centreline_is_the_axis_from_tip_to_tip() -> None:
    inside = capsule(ENDS, RADIUS, SHAPE, SIZES)
    line = centreline(Tube(inside.astype(np.uint8) * np.uint8(255), SIZES))
    assert off_axis(line.points).max() < 0.25 * SIZES.max()
    length = np.linalg.norm(ENDS[1] - ENDS[0]) + 2 * RADIUS
    # It ends with the last point inside, an eighth of the radius or a voxel before the tip.
    assert length - 2.5 < arc_lengths(line.points)[-1] < length + 0.5
    assert line.points[0, 2] < line.points[-1, 2]


def test_a_section_is_a_disc_of_the_tube_s_area() -> None:
    tube = Tube(capsule(ENDS, RADIUS, SHAPE, SIZES).astype(np.uint8) * np.uint8(255), SIZES)
    direction = (ENDS[1] - ENDS[0]) / np.linalg.norm(ENDS[1] - ENDS[0])
    x_dir = np.cross(direction, [0.0, 0.0, 1.0])
    x_dir /= np.linalg.norm(x_dir)
    frame = np.stack([x_dir, np.cross(direction, x_dir), direction], axis=1)
    section, pixel = tube.section(ENDS.mean(axis=0) + 0.7 * x_dir, frame, RADIUS)
    np.testing.assert_allclose(section.mean(axis=0), [-0.7, 0.0], atol=0.1)
    assert len(section) * pixel**2 == pytest.approx(np.pi * RADIUS**2, rel=0.03)
    far, _ = tube.section(ENDS.mean(axis=0) + 100.0, frame, RADIUS)
    assert far.shape == (0, 2)


@pytest.mark.parametrize(
    ("inside", "message"),
    [
        (np.zeros((4, 4, 4), dtype=np.uint8), "fewer than two voxels"),
        (
            capsule(np.array([[9.0, 9, 9], [10.0, 9, 9]]), 6.0, (20, 20, 20), np.ones(3)),
            "must be long and thin",
        ),
    ],
)
def test_what_is_no_tube_is_refused(inside: NDArray[np.uint8], message: str) -> None:
    with pytest.raises(NoTube, match=message):
        centreline(Tube(inside.astype(np.uint8) * np.uint8(255), np.ones(3)))


def test_a_plane_of_linear_levels_is_linear_and_beyond_is_the_outside() -> None:
    k, j, i = np.indices((6, 7, 8))
    levels = (10 + 3 * i + 4 * j + 5 * k).astype(np.uint16)
    centre = np.array([3.25, 2.5, 2.75])
    steps = np.array([[0.5, 0.25, 0.25], [-0.25, 0.5, -0.25]])
    image = plane_cut(levels, 7.0, centre, steps, (3, 5))
    right, down = np.arange(5) - 2.0, np.arange(3) - 1.0
    slope = np.array([3.0, 4.0, 5.0])
    expected = 10 + centre @ slope + right * (steps[0] @ slope) + down[:, None] * (steps[1] @ slope)
    np.testing.assert_allclose(image, expected, atol=0.5)
    assert image.dtype == np.uint16
    assert (plane_cut(levels, 7.0, centre + 50.0, steps, (3, 5)) == 7).all()


def test_planes_turn_so_as_not_to_cross_in_a_bend(monkeypatch: pytest.MonkeyPatch) -> None:
    # A corner in the middle of a block: planes across both legs meet at once.
    corner = evenly_spaced(np.array([[6.0, 30, 20], [30, 30, 20], [30, 6, 20]]), 1.0)
    tube = Tube(np.full((41, 61, 61), 255, dtype=np.uint8), np.ones(3))
    depths = np.full(len(corner), 1.5)
    turned = section_planes(tube, corner, depths, 3.0)
    monkeypatch.setattr("organ_geometry.reslice.section_planes._TURN_FACTORS", (1.0,))
    assert section_planes(tube, corner, depths, 3.0).crossing > turned.crossing
    # Pixels of 1 mm, up to three depths from the middle.
    assert turned.reach == pytest.approx(5.0)
