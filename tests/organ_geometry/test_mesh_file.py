"""Mesh files: what is written is what is read, whole or not at all."""

from io import BytesIO
from pathlib import Path
from zipfile import ZipFile

import numpy as np
import pytest
import trimesh
from tubes import tube

from organ_geometry.mesh.mesh_file import SUFFIXES, mesh_content
from organ_geometry.mesh.normals import vertex_normals
from organ_geometry.mesh.skin import Surface, organ_skin
from organ_geometry.mesh.tear import torn_pieces


def pieces_of(torn: bool) -> list[Surface]:
    organ = tube(wall=1.0)
    if not torn:
        skin = organ_skin(organ, edge_length=1.0)
        return [Surface("organ", skin, skin.vertices)]
    pieces = torn_pieces(organ, 25.4, np.array([0.0, 0.0, 1.0]), edge_length=1.0)
    return [
        Surface(name, piece.skin, piece.open(2.0, piece.skin.vertices.copy()))
        for name, piece in zip(("first_piece", "second_piece"), pieces, strict=True)
    ]


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("torn", [False, True])
def test_every_kind_comes_back_closed_and_in_place(tmp_path: Path, suffix: str, torn: bool) -> None:
    components = pieces_of(torn)
    path = tmp_path / f"duct{suffix}"
    path.write_bytes(mesh_content(components, suffix))
    # A vertex of an STL is written once for each of its triangles.
    loaded = trimesh.load_mesh(path, process=suffix in (".stl", ".zip"))
    if suffix == ".glb":  # a vertex for each side of an edge, at one place
        loaded.merge_vertices(merge_norm=True, merge_tex=True)
    vertices = np.concatenate([fraction.vertices for fraction in components])
    if suffix == ".glb":  # metres, y up
        vertices = 1e-3 * vertices[:, [0, 2, 1]] * [1.0, 1.0, -1.0]
    assert loaded.is_watertight
    assert loaded.is_winding_consistent
    assert loaded.bounds == pytest.approx(
        np.stack([vertices.min(axis=0), vertices.max(axis=0)]), rel=1e-5, abs=1e-6
    )
    expected = sum(
        trimesh.Trimesh(fraction.vertices, fraction.skin.faces, process=False).volume
        for fraction in components
    )
    scale = 1e-9 if suffix == ".glb" else 1.0
    assert loaded.volume == pytest.approx(scale * expected, rel=1e-4)
    assert len(loaded.split(only_watertight=True)) == len(components)
    assert [entry.name for entry in tmp_path.iterdir()] == [path.name]


def test_a_zip_has_an_stl_of_each_surface_by_its_name() -> None:
    """Names that lead elsewhere, as those of somebody's tubes may, stay in the folder."""
    (organ,) = pieces_of(torn=False)
    named = [Surface(name, organ.skin, organ.vertices) for name in ("../a/b", "\u00e9tat", "C:x y")]
    content = mesh_content(named, ".zip")
    assert content == mesh_content(named, ".zip")
    with ZipFile(BytesIO(content)) as archive:
        assert archive.namelist() == ["a_b.stl", "\u00e9tat.stl", "C_x_y.stl"]
        assert {archive.read(name) for name in archive.namelist()} == {
            mesh_content([organ], ".stl")
        }
    again = Surface("c:X\ty", organ.skin, organ.vertices)
    with pytest.raises(ValueError, match=r"two surfaces have the file name c_X_y\.stl"):
        mesh_content([*named, again], ".zip")


def test_glb_keeps_the_pieces_apart_and_shaded(tmp_path: Path) -> None:
    path = tmp_path / "duct.glb"
    path.write_bytes(mesh_content(pieces_of(torn=True), ".glb"))
    scene = trimesh.load_scene(path)
    names = {"_".join(name.split("_")[:2]) for name in scene.geometry}
    assert names == {"first_piece", "second_piece"}
    content = path.read_bytes()
    assert b'"NORMAL"' in content  # without normals viewers shade flat


def test_normals_of_a_sphere_point_outwards() -> None:
    sphere = trimesh.creation.icosphere(subdivisions=4)
    normals = vertex_normals(sphere.vertices.astype(np.float32), sphere.faces.astype(np.int32))
    # Facets of 1/16 of the radius: normals off by less than 1 %.
    assert np.abs(normals - sphere.vertices).max() < 1e-2
