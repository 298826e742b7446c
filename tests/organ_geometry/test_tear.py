"""Torn organs: two closed pieces that together are the organ, opening from the stretched side."""

import numpy as np
import pytest
import trimesh
from tubes import LENGTH, RADIUS, mesh_of, tube

from organ_geometry.mesh.skin import organ_skin
from organ_geometry.mesh.tear import _draw_back, torn_pieces

UP = np.array([0.0, 0.0, 1.0])
EDGE = 0.6


@pytest.mark.parametrize("wall", [None, 1.0])
@pytest.mark.parametrize("station", [0.0, 11.0, 25.4, LENGTH])
def test_pieces_are_closed_and_make_up_the_organ(wall: float | None, station: float) -> None:
    organ = tube(wall=wall)
    meshes = [mesh_of(piece.skin) for piece in torn_pieces(organ, station, UP, edge_length=EDGE)]
    for mesh in meshes:
        assert mesh.is_watertight
        assert mesh.is_winding_consistent
        assert mesh.volume > 0.0
        assert mesh.area_faces.min() > 0.0
    whole = mesh_of(organ_skin(organ, edge_length=EDGE)).volume
    # The rings of pieces and whole lie elsewhere: a thousandth of the volume.
    assert sum(mesh.volume for mesh in meshes) == pytest.approx(whole, rel=1e-3)


def test_rims_coincide_until_the_tear_opens() -> None:
    organ = tube(wall=1.0)
    first, second = torn_pieces(organ, 20.0, UP, edge_length=EDGE)
    walls = 2
    rim_of_first = _rings(first.skin.vertices, walls)[:, -1]
    rim_of_second = _rings(second.skin.vertices, walls)[:, 0]
    assert np.array_equal(rim_of_first, rim_of_second)
    assert np.ptp(rim_of_first[0, :, 0]) > 0.1 * RADIUS  # ragged


def _rings(vertices: np.ndarray, walls: int) -> np.ndarray:
    """(walls, rings, sides, 3) of a skin whose sides are those of `tube` at `EDGE`."""
    sides = round(2.0 * np.pi * tube().mean_radius / EDGE)
    return vertices.reshape(walls, -1, sides, 3)


def test_tear_starts_on_the_tension_side_and_crosses_the_section() -> None:
    organ = tube(wall=1.0)
    for side in (UP, -UP):
        first, second = torn_pieces(organ, 25.4, side, edge_length=EDGE)
        gaps = []
        for front in (0.0, 0.5, 1.0, 2.0):
            near = _rings(first.open(front, first.skin.vertices.copy()), 2)[0, -1]
            far = _rings(second.open(front, second.skin.vertices.copy()), 2)[0, 0]
            gaps.append(far[:, 0] - near[:, 0])
            assert (gaps[-1] >= 0.0).all()
        height = _rings(first.skin.vertices, 2)[0, -1] @ side
        top, bottom = height.argmax(), height.argmin()
        assert not gaps[0].any()
        assert gaps[1][top] > 0.0 == gaps[1][bottom]
        # The rim's own height differs from the section's by as much as the calibre does along it.
        assert gaps[2][top] > 50.0 * gaps[2][bottom]
        assert gaps[3].min() > 0.5 * RADIUS
        # What tore first has drawn back the most: evenly from one side to the other.
        across = np.polynomial.Polynomial.fit(height, gaps[3], 1)
        assert across.deriv()(0.0) > 0.1
        assert np.abs(gaps[3] - across(height)).max() < 0.02 * RADIUS


def test_free_rim_is_flared_and_its_wall_thinned() -> None:
    organ = tube(wall=1.0)
    piece, _ = torn_pieces(organ, 25.4, UP, edge_length=EDGE, down=np.zeros(3))
    at_rest = np.linalg.norm(_rings(piece.skin.vertices, 2)[:, :, :, 1:], axis=-1)
    opened = piece.open(2.0, piece.skin.vertices.copy())
    now = np.linalg.norm(_rings(opened, 2)[:, :, :, 1:], axis=-1)
    assert now[0, -1].mean() > 1.05 * at_rest[0, -1].mean()
    walls_at_rest, walls = at_rest[0] - at_rest[1], now[0] - now[1]
    np.testing.assert_allclose(walls[-1], 0.4 * walls_at_rest[-1], atol=0.15 * RADIUS)
    assert walls.min() > 0.0
    far = piece.skin.stations.reshape(2, *now.shape[1:])[0] < 25.4 - 2.0 * RADIUS
    np.testing.assert_allclose(now[0][far], at_rest[0][far], atol=1e-5)


def test_free_end_hangs_down_whichever_side_tore_first() -> None:
    for side in (UP, -UP):
        for piece in torn_pieces(tube(), 25.4, side, edge_length=EDGE, down=-UP):
            opened = piece.open(2.0, piece.skin.vertices.copy())
            sunk = (piece.skin.vertices - opened) @ UP
            rim = np.abs(piece.skin.stations - 25.4) < 0.3 * RADIUS
            assert 0.15 * RADIUS < sunk[rim].mean() < 0.4 * RADIUS


def test_ends_in_the_clamps_do_not_move() -> None:
    organ = tube()
    for piece in torn_pieces(organ, 30.0, UP, edge_length=EDGE):
        end = 0.0 if piece.skin.stations.min() == 0.0 else LENGTH
        held = piece.skin.stations == end
        opened = piece.open(2.0, piece.skin.vertices.copy())
        assert np.array_equal(opened[held], piece.skin.vertices[held])


def test_open_pieces_stay_closed_surfaces_apart_from_each_other() -> None:
    organ = tube(wall=1.0)
    meshes = [
        trimesh.Trimesh(
            piece.open(2.0, piece.skin.vertices.copy()), piece.skin.faces, process=False
        )
        for piece in torn_pieces(organ, 25.4, UP, edge_length=EDGE)
    ]
    assert all(mesh.is_watertight and mesh.is_winding_consistent for mesh in meshes)
    assert meshes[0].bounds[1, 0] < meshes[1].bounds[0, 0]


def test_raggedness_is_the_seed_s() -> None:
    organ = tube()
    same = [torn_pieces(organ, 25.4, UP, edge_length=EDGE, seed=s)[0].skin for s in (3, 3, 4)]
    assert np.array_equal(same[0].vertices, same[1].vertices)
    assert not np.array_equal(same[0].vertices, same[2].vertices)


def test_station_lies_on_the_organ() -> None:
    for station in (-0.1, LENGTH + 0.1, np.nan):
        with pytest.raises(ValueError, match="station of a tear"):
            torn_pieces(tube(), station, UP, edge_length=EDGE)


def test_kernel_is_its_python_form() -> None:
    piece, _ = torn_pieces(tube(), 25.4, UP, edge_length=3.0)
    compiled, plain = piece.skin.vertices.copy(), piece.skin.vertices.copy()
    piece.open(1.3, compiled)
    _draw_back.py_func(plain, piece.height, piece.retreat, 1.3)
    assert compiled == pytest.approx(plain, abs=1e-6)
