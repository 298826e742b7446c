"""Skins: closed, the organ's volume, still at rest to the bit, rigid where the transform is."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tubes import LENGTH, mesh_of, tube

from organ_geometry.driving_points import DrivingPoints
from organ_geometry.mesh.skin import _blend, organ_skin
from organ_geometry.mesh.tear import torn_pieces


def bend(points: DrivingPoints, height: float) -> np.ndarray:
    """Transforms of an arch of some height across the x axis, in the x-z plane."""
    fraction = points.stations / points.stations[-1]
    out = np.empty((fraction.size, 3, 4))
    slope = 16.0 * height / LENGTH * fraction * (1.0 - fraction) * (1.0 - 2.0 * fraction) * 2.0
    return points.transforms(
        np.zeros_like(fraction),
        16.0 * height * (fraction * (1.0 - fraction)) ** 2,
        np.arctan(slope),
        np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]),
        out,
    )


@pytest.mark.parametrize("wall", [None, 1.0])
@pytest.mark.parametrize("left_handed", [False, True])
@pytest.mark.parametrize("edge_length", [0.4, 1.5])
def test_skin_is_closed_and_wound_outwards(
    wall: float | None, left_handed: bool, edge_length: float
) -> None:
    organ = tube(wall=wall, left_handed=left_handed)
    mesh = mesh_of(organ_skin(organ, edge_length=edge_length))
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.volume > 0.0
    assert mesh.euler_number == (0 if wall else 2)  # a ring has a hole, a rod has none
    assert mesh.area_faces.min() > 0.0


@pytest.mark.parametrize("wall", [None, 1.0])
def test_skin_has_the_volume_of_the_organ(wall: float | None) -> None:
    organ = tube(wall=wall)
    stations = np.linspace(0.0, organ.length, 2001)
    volume = np.trapezoid(organ.section_properties(stations).area, stations)
    coarse, fine = (
        abs(mesh_of(organ_skin(organ, edge_length=edge)).volume / volume - 1.0)
        for edge in (1.0, 0.25)
    )
    # A polygon of n sides misses (2 pi / n)^2 / 6 of a circle's area; the wall's is a difference.
    assert fine < 1e-3
    assert fine < coarse / 4.0


@pytest.mark.parametrize("wall", [None, 1.0])
@pytest.mark.parametrize("sag", [0.0, 6.0])
def test_rest_pose_returns_the_organ_to_the_bit(wall: float | None, sag: float) -> None:
    organ = tube(wall=wall, sag=sag)
    skin = organ_skin(organ, edge_length=0.7)
    points = DrivingPoints.of(organ, spacing=0.8)
    out = np.full_like(skin.vertices, np.nan)
    skin.bound_to(points).deform(bend(points, 0.0), out)
    assert out.tobytes() == skin.vertices.tobytes()


@pytest.mark.parametrize("wall", [None, 1.0])
def test_bent_skin_stays_closed_and_keeps_its_volume(wall: float | None) -> None:
    organ = tube(wall=wall)
    skin = organ_skin(organ, edge_length=0.5)
    points = DrivingPoints.of(organ, spacing=0.8)
    out = np.empty_like(skin.vertices)
    skin.bound_to(points).deform(bend(points, 8.0), out)
    bent = mesh_of(skin, out)
    assert bent.is_watertight
    assert bent.is_winding_consistent
    # Sections stay as they are and turn with the axis, so the volume grows with its length, by
    # Pappus: int sec(slope) dx is 1.10 here.
    fraction = np.linspace(0.0, 1.0, 4001)
    slope = 32.0 * 8.0 / LENGTH * fraction * (1.0 - fraction) * (1.0 - 2.0 * fraction)
    longer = np.trapezoid(np.hypot(1.0, slope), fraction)
    assert bent.volume / mesh_of(skin).volume == pytest.approx(longer, rel=0.01)


def test_axis_vertices_follow_the_driving_points() -> None:
    organ = tube()
    skin = organ_skin(organ, edge_length=0.5)
    points = DrivingPoints.of(organ, spacing=0.8)
    out = np.empty_like(skin.vertices)
    skin.bound_to(points).deform(bend(points, 8.0), out)
    # The two last vertices are the ends' centres: they are driving points, and stay in the clamps.
    assert out[-2:] == pytest.approx(skin.vertices[-2:], abs=1e-5)
    ring = np.abs(skin.stations[:-2] - 25.4) < 0.3
    middle = out[:-2][ring].mean(axis=0)
    assert middle[2] - skin.vertices[:-2][ring].mean(axis=0)[2] == pytest.approx(8.0, rel=1e-3)


@settings(deadline=None, max_examples=30)
@given(
    st.floats(-3.0, 3.0),
    st.lists(st.floats(-20.0, 20.0), min_size=2, max_size=2),
)
def test_one_rigid_motion_moves_all_vertices_rigidly(angle: float, shift: list[float]) -> None:
    """Driving points that all turn about the origin and move alike carry the skin as a whole."""
    organ = tube(sag=5.0)
    skin = organ_skin(organ, edge_length=2.0)
    points = DrivingPoints.of(organ, spacing=5.0)
    turn = np.array(
        [
            [np.cos(angle), 0.0, -np.sin(angle)],
            [0.0, 1.0, 0.0],
            [np.sin(angle), 0.0, np.cos(angle)],
        ]
    )
    moved = points.positions @ turn.T + [shift[0], 0.0, shift[1]]
    transforms = np.empty((points.stations.size, 3, 4))
    points.transforms(
        moved[:, 0] - points.positions[:, 0],
        moved[:, 2] - points.positions[:, 2],
        np.full(points.stations.size, angle),
        np.eye(3),
        transforms,
    )
    out = np.empty_like(skin.vertices)
    skin.bound_to(points).deform(transforms, out)
    expected = skin.vertices.astype(np.float64) @ turn.T + [shift[0], 0.0, shift[1]]
    assert out == pytest.approx(expected, abs=2e-5)  # single precision of some 100 mm


def test_weights_blend_neighbours_and_reach_one_at_the_points() -> None:
    points = DrivingPoints(np.array([0.0, 1.0, 4.0]), np.zeros((3, 3)))
    index, weight = points.binding(np.array([-1.0, 0.0, 0.25, 1.0, 2.5, 4.0, 9.0]))
    assert index.tolist() == [0, 0, 0, 1, 1, 1, 1]
    assert weight.tolist() == [0.0, 0.0, 0.25, 0.0, 0.5, 1.0, 1.0]


def test_key_sections_and_clamps_have_driving_points() -> None:
    organ = tube()
    points = DrivingPoints.of(organ, spacing=1.0, at=np.array([3.21, 47.0]))
    for station in (*organ.key_stations, 3.21, 47.0):
        assert np.abs(points.stations - station).min() < 1e-9
    assert np.diff(points.stations).max() <= 1.0 + 1e-9
    assert points.positions == pytest.approx(organ.axis_at(points.stations))


def test_kernel_is_its_python_form() -> None:
    organ = tube()
    skin = organ_skin(organ, edge_length=4.0)
    points = DrivingPoints.of(organ, spacing=5.0)
    bound, transforms = skin.bound_to(points), bend(points, 7.0)
    compiled, plain = np.empty_like(skin.vertices), np.empty_like(skin.vertices)
    bound.deform(transforms, compiled)
    _blend.py_func(skin.vertices, bound.starts, bound.index, bound.weight, transforms, plain)
    assert compiled == pytest.approx(plain, abs=1e-5)


@pytest.mark.parametrize("ragged", [False, True])
def test_each_vertex_follows_the_blend_of_its_own_points(ragged: bool) -> None:
    """Runs of vertices share a blend; at a ragged rim each vertex is a run of its own."""
    organ = tube(wall=1.0)
    skin = organ_skin(organ, edge_length=1.5)
    if ragged:
        skin = torn_pieces(organ, 20.0, np.array([0.0, 0.0, 1.0]), edge_length=1.5)[0].skin
    points = DrivingPoints.of(organ, spacing=3.0)
    bound, transforms = skin.bound_to(points), bend(points, 7.0)
    weight = bound.weight[:, None, None]
    blends = (1.0 - weight) * transforms[bound.index] + weight * transforms[bound.index + 1]
    places = np.concatenate([skin.vertices, np.ones((len(skin.vertices), 1))], axis=1)
    wanted = skin.vertices + np.einsum("vij,vj->vi", blends, places)
    deformed = bound.deform(transforms, np.empty_like(skin.vertices))
    assert np.abs(deformed - wanted).max() < 1e-5  # single precision at 50 mm
    assert (len(bound.starts) > 100) is ragged
    assert np.array_equal(bound.starts[[0, -1]], [0, len(skin.vertices)])


def test_deforming_changes_nothing_but_the_output() -> None:
    organ = tube()
    skin = organ_skin(organ, edge_length=2.0)
    points = DrivingPoints.of(organ, spacing=5.0)
    transforms = bend(points, 3.0)
    before = skin.vertices.tobytes(), transforms.tobytes()
    skin.bound_to(points).deform(transforms, np.empty_like(skin.vertices))
    assert (skin.vertices.tobytes(), transforms.tobytes()) == before


@pytest.mark.parametrize("edge_length", [0.0, -1.0, np.nan, np.inf, 4.6])
def test_edge_length_is_above_zero(edge_length: float) -> None:
    with pytest.raises(ValueError, match="edge_length must be above 0 mm"):
        organ_skin(tube(), edge_length=edge_length)


def test_absurd_edge_length_is_refused_before_it_fills_the_memory() -> None:
    with pytest.raises(ValueError, match="600,000"):
        organ_skin(tube(), edge_length=1e-3)


def test_driving_points_need_growing_stations() -> None:
    with pytest.raises(ValueError, match="growing"):
        DrivingPoints(np.array([0.0, 0.0]), np.zeros((2, 3)))
    with pytest.raises(ValueError, match="shape"):
        DrivingPoints(np.array([0.0, 1.0]), np.zeros((3, 3)))
    with pytest.raises(ValueError, match="spacing"):
        DrivingPoints.of(tube(), spacing=0.0)
