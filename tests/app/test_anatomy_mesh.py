"""The surfaces of an anatomy's tubes: closed one by one, and closed as one."""

import json
import struct
from pathlib import Path

import numpy as np
import pytest
import trimesh
from drawn_labels import Drawn, drawn_volume, write
from program import refused, run

from app.anatomy import read_anatomy, shipped_anatomies, tube_lines
from organ_geometry import round_organ

NORMAL = ["common", "cystic", "gallbladder", "rha", "artery"]


def mesh_of(path: Path) -> trimesh.Trimesh:
    mesh = trimesh.load_mesh(path)
    assert isinstance(mesh, trimesh.Trimesh)
    return mesh


def test_a_round_organ_has_its_circles_areas() -> None:
    turn = np.linspace(0.0, 1.5, 40)
    axis = np.stack([30 * np.sin(turn), 30 * np.cos(turn), 4 * turn], axis=1)
    radii = np.linspace(2.0, 3.0, 40)
    organ = round_organ(axis, radii, "arc")
    np.testing.assert_allclose(organ.axis, axis)
    # Degree-6 half-curves follow a circle to about a thousandth of its area.
    areas = organ.section_properties(organ.stations).area
    np.testing.assert_allclose(areas, np.pi * radii**2, rtol=2e-3)


def test_a_glb_has_each_tube_by_its_name(tmp_path: Path) -> None:
    path = tmp_path / "normal.glb"
    assert run("anatomy", "normal", "--mesh", path).returncode == 0
    content = path.read_bytes()
    (size,) = struct.unpack("<I", content[12:16])
    tree = json.loads(content[20 : 20 + size])
    assert [node["name"] for node in tree["nodes"]] == NORMAL
    assert [mesh["name"] for mesh in tree["meshes"]] == NORMAL


def test_every_tube_is_closed(tmp_path: Path) -> None:
    path = tmp_path / "normal.stl"
    assert run("anatomy", "normal", "--mesh", path).returncode == 0
    parts = mesh_of(path).split(only_watertight=True)
    assert len(parts) == len(NORMAL)
    lines = tube_lines(read_anatomy(shipped_anatomies()["normal"]))
    volumes = sorted(float(part.volume) for part in parts)
    round_ones = sorted(
        float(np.trapezoid(np.pi * line.radius**2, line.stations)) for line in lines.values()
    )
    # Polygons in circles, and frusta along bent axes.
    assert volumes == pytest.approx(round_ones, rel=0.06)


@pytest.mark.parametrize("name", shipped_anatomies())
def test_merged_tubes_are_one_closed_surface(name: str, tmp_path: Path) -> None:
    """As far as they join: so no joined tube's surface stands off the one that it joins."""
    pytest.importorskip("manifold3d")
    apart, one = tmp_path / "apart.ply", tmp_path / "one.ply"
    assert run("anatomy", name, "--mesh", apart).returncode == 0
    assert run("anatomy", name, "--mesh", one, "--merged").returncode == 0
    whole = mesh_of(one)
    assert whole.is_watertight
    assert whole.is_winding_consistent
    # An artery from below is joined to the gallbladder, and the hepatic artery to nothing then.
    assert whole.body_count == (2 if name == "artery-outside" else 1)
    volumes = [float(part.volume) for part in mesh_of(apart).split()]
    assert max(volumes) < whole.volume < sum(volumes)


def test_a_patient_s_organs_are_merged_where_they_stand(tmp_path: Path) -> None:
    pytest.importorskip("manifold3d")
    pytest.importorskip("SimpleITK")
    drawn = {
        1: Drawn((20.0, 30.0, 40.0), (20.0, 30.0, 90.0), 3.0),
        2: Drawn((20.0, 30.0, 64.0), (4.0, 30.0, 83.0), 2.0),
    }
    labels = write(drawn_volume(drawn, 0.8), tmp_path / "labels.nrrd")
    (tmp_path / "names.json").write_text('{"1": "common duct", "2": "cystic duct"}')
    case = tmp_path / "case"
    done = run("anatomy", "--labels", labels, "--names", tmp_path / "names.json", "-o", case)
    assert done.returncode == 0, done.stderr
    path = tmp_path / "case.stl"
    assert run("anatomy", case / "anatomy.toml", "--mesh", path, "--merged").returncode == 0
    whole = mesh_of(path)
    assert whole.is_watertight
    assert whole.body_count == 1
    np.testing.assert_allclose(whole.bounds[0], [2.5, 27.0, 40.0], atol=1.0)
    np.testing.assert_allclose(whole.bounds[1], [23.0, 33.0, 90.0], atol=1.0)


def test_an_organ_elsewhere_is_refused(tmp_path: Path) -> None:
    text = shipped_anatomies()["normal"].read_text()
    path = tmp_path / "anatomy.toml"
    path.write_text(text.replace('kind = "duct"', 'kind = "duct"\norgan = "../x.organ"', 1))
    assert "beside the anatomy" in refused(["anatomy", path, "--mesh", tmp_path / "a.stl"])


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["normal", "--merged"], "--merged goes with --mesh"),
        (["normal", "--mesh", "a.step"], ".stl"),
        (["normal", "--mesh", "a.glb", "--merged"], ".stl"),
        (["--list", "--mesh", "a.stl"], "--mesh is of one anatomy"),
    ],
)
def test_wrong_words_are_refused(arguments: list[object], says: str) -> None:
    assert says in refused(["anatomy", *arguments])
