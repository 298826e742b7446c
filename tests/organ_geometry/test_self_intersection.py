"""Skins at rest are embedded: no face is flat, and none goes through another."""

import numpy as np
import pytest
import trimesh
from scipy.spatial import KDTree
from tubes import mesh_of, tube

from organ_geometry.mesh.skin import organ_skin
from organ_geometry.mesh.tear import torn_pieces

UP = np.array([0.0, 0.0, 1.0])


def crossings(mesh: trimesh.Trimesh) -> int:
    """How many edges of a mesh go through a face that they share no vertex with."""
    corners = mesh.triangles
    middles = corners.mean(axis=1)
    reach = np.linalg.norm(corners - middles[:, None], axis=2).max()
    edges = mesh.vertices[mesh.edges_unique]
    half = 0.5 * np.linalg.norm(edges[:, 1] - edges[:, 0], axis=1).max()
    near = KDTree(middles).query_ball_point(edges.mean(axis=1), reach + half)
    edge = np.repeat(np.arange(len(edges)), [len(each) for each in near])
    face = np.concatenate([np.array(each, dtype=int) for each in near])
    ends, faces = mesh.edges_unique[edge], mesh.faces[face]
    apart = ~(ends[:, :, None] == faces[:, None, :]).any(axis=(1, 2))
    edge, face = edge[apart], face[apart]
    # Moeller and Trumbore (1997): the edge as a ray, hit within its own length.
    origin, direction = edges[edge, 0], edges[edge, 1] - edges[edge, 0]
    first, second = (corners[face, k] - corners[face, 0] for k in (1, 2))
    across = np.cross(direction, second)
    determinant = np.einsum("ij,ij->i", first, across)
    crossing = np.abs(determinant) > 1e-12
    scale = 1.0 / np.where(crossing, determinant, 1.0)
    offset = origin - corners[face, 0]
    u = np.einsum("ij,ij->i", offset, across) * scale
    turned = np.cross(offset, first)
    v = np.einsum("ij,ij->i", direction, turned) * scale
    along = np.einsum("ij,ij->i", second, turned) * scale
    inside = (u > 0.0) & (v > 0.0) & (u + v < 1.0) & (along > 0.0) & (along < 1.0)
    return int((crossing & inside).sum())


def test_crossings_are_found_where_there_are_some() -> None:
    box = trimesh.creation.box((2.0, 2.0, 2.0))
    other = trimesh.creation.box((2.0, 2.0, 2.0))
    assert crossings(box) == 0
    other.apply_translation((0.9, 0.8, 0.7))
    vertices = np.concatenate([box.vertices, other.vertices])
    faces = np.concatenate([box.faces, other.faces + len(box.vertices)])
    assert crossings(trimesh.Trimesh(vertices, faces, process=False)) > 0


@pytest.mark.slow
@pytest.mark.parametrize("wall", [None, 1.0, 0.2])
def test_skins_of_organs_and_pieces_are_embedded(wall: float | None) -> None:
    edge_length = 1.2
    organ = tube(wall=wall, sag=6.0)
    skins = [organ_skin(organ, edge_length=edge_length)]
    for station in (0.0, 20.0):
        pieces = torn_pieces(organ, station, UP, edge_length=edge_length)
        skins += [piece.skin for piece in pieces]
    for skin in skins:
        mesh = mesh_of(skin)
        assert mesh.is_watertight
        assert mesh.is_winding_consistent
        assert mesh.volume > 0.0
        assert mesh.area_faces.min() > 1e-4 * edge_length**2
        assert crossings(mesh) == 0
