"""The surfaces of an anatomy's tubes: closed one by one, and closed as one."""

import re
import shutil
from pathlib import Path

import numpy as np
import pytest
import trimesh
from drawn_labels import Drawn, drawn_volume, write
from gltf_reader import Gltf
from other_programs import validated
from program import refused, run
from rigged import walls

from app.anatomy import place_of, read_anatomy, shipped_anatomies, tube_lines
from app.anatomy.anatomy_mesh import EDGE_FRACTION
from app.simulation import Tubes
from organ_geometry import read_organ, round_organ
from organ_geometry.mesh import organ_skin
from physics.bed import BeamOnBed

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


def test_every_tube_is_closed(tmp_path: Path) -> None:
    path = tmp_path / "normal.stl"
    assert run("anatomy", "normal", "--mesh", path).returncode == 0
    pieces = mesh_of(path).split(only_watertight=True)
    assert len(pieces) == len(NORMAL)
    lines = tube_lines(read_anatomy(shipped_anatomies()["normal"]))
    volumes = sorted(float(piece.volume) for piece in pieces)
    round_ones = sorted(
        float(np.trapezoid(np.pi * line.radius**2, line.stations)) for line in lines.values()
    )
    # Polygons in circles, and frusta along bent axes.
    assert volumes == pytest.approx(round_ones, rel=0.06)


def test_a_zip_has_an_stl_of_each_tube(tmp_path: Path) -> None:
    """Each closed, by the tube's name, and together what the one STL has."""
    apart, one = tmp_path / "tubes.zip", tmp_path / "tubes.stl"
    for path in (apart, one):
        assert run("anatomy", "normal", "--mesh", path).returncode == 0
    shutil.unpack_archive(apart, tmp_path / "tubes")
    tubes = {path.stem: mesh_of(path) for path in (tmp_path / "tubes").iterdir()}
    assert sorted(tubes) == sorted(NORMAL)
    whole = mesh_of(one)
    for tube in tubes.values():
        assert tube.is_watertight
        assert tube.body_count == 1
    assert sum(len(tube.faces) for tube in tubes.values()) == len(whole.faces)
    assert sum(tube.volume for tube in tubes.values()) == pytest.approx(whole.volume, rel=1e-9)
    assert max(tubes, key=lambda name: tubes[name].volume) == "gallbladder"


def test_tubes_of_one_file_name_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "anatomy.toml"
    path.write_text(
        shipped_anatomies()["normal"]
        .read_text()
        .replace('"cystic"', '"a b"')
        .replace('"artery"\nkind', '"a_b"\nkind')
        .replace('tube = "artery"', 'tube = "a_b"')
    )
    said = refused(["anatomy", path, "--mesh", tmp_path / "tubes.zip"])
    assert "two surfaces have the file name a_b.stl: rename one of them" in said
    assert not (tmp_path / "tubes.zip").exists()


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
    volumes = [float(piece.volume) for piece in mesh_of(apart).split()]
    assert max(volumes) < whole.volume < sum(volumes)


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a case of two ducts, found in labels."""
    pytest.importorskip("SimpleITK")
    tmp_path = tmp_path_factory.mktemp("labels")
    drawn = {
        1: Drawn((20.0, 30.0, 40.0), (20.0, 30.0, 90.0), 3.0),
        2: Drawn((20.0, 30.0, 64.0), (4.0, 30.0, 83.0), 2.0),
    }
    labels = write(drawn_volume(drawn, 0.8), tmp_path / "labels.nrrd")
    (tmp_path / "names.json").write_text('{"1": "common duct", "2": "cystic duct"}')
    case = tmp_path / "case"
    done = run("anatomy", "--labels", labels, "--names", tmp_path / "names.json", "-o", case)
    assert done.returncode == 0, done.stderr
    return case


def test_a_case_s_tubes_have_their_organs_and_move_with_their_beams(case: Path) -> None:
    """The organ of the file to the bit; and beams that turn as a whole turn it in LPS."""
    anatomy = read_anatomy(case / "anatomy.toml")
    tubes, (rows, origin) = Tubes.of_anatomy(anatomy), place_of(anatomy)
    bed = BeamOnBed(tubes.network)
    angle, shift = 0.7, np.array([3.0, -2.0, 5.0])
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    bed.state.x[:] = bed.state.x @ turn.T + shift
    w, x, y, z = bed.state.q.T.copy()
    c, s = np.cos(angle / 2), np.sin(angle / 2)
    bed.state.q[:] = np.stack([c * w - s * z, c * x - s * y, c * y + s * x, c * z + s * w], axis=1)
    for name, dissection, surface in zip(
        tubes.names, tubes.dissections, tubes.surfaces, strict=True
    ):
        organ = dissection.organ
        assert organ.encoded == (case / f"{name}.organ").read_bytes()
        skin = organ_skin(organ, edge_length=1.0)
        moved = surface.move(bed, dissection.rest_transforms())
        found = skin.bound_to(dissection.driving).deform(moved, np.empty_like(skin.vertices))
        local = (skin.vertices - origin) @ rows.T
        wanted = (local @ turn.T + shift) @ rows + origin
        # Points of the organ's axis are moved as the beam's, which lies up to 0.05 mm beside it.
        np.testing.assert_allclose(found, wanted, atol=0.05)


def test_a_case_s_glb_has_a_rig_for_each_tube(case: Path, tmp_path: Path) -> None:
    path = tmp_path / "case.glb"
    assert run("anatomy", case / "anatomy.toml", "--mesh", path).returncode == 0
    gltf = Gltf(path.read_bytes())
    names = ["common_duct", "cystic_duct"]
    assert [mesh["name"] for mesh in gltf.tree["meshes"]] == names
    assert [skin["name"] for skin in gltf.tree["skins"]] == names
    assert "animations" not in gltf.tree
    (report,) = validated(path)
    assert report["issues"]["numErrors"] == 0
    for name in names:
        organ = read_organ(case / f"{name}.organ")
        skin = organ_skin(organ, edge_length=EDGE_FRACTION * organ.mean_radius)
        for shown, wanted in zip(gltf.vertices(name), walls(skin, skin.vertices), strict=True):
            np.testing.assert_allclose(shown, wanted, atol=1e-7)


def test_an_organ_of_another_tube_is_refused(case: Path, tmp_path: Path) -> None:
    other = tmp_path / "other"
    shutil.copytree(case, other)
    (other / "cystic_duct.organ").write_bytes((case / "common_duct.organ").read_bytes())
    assert re.search(
        r"anatomy.toml, line \d+: tube 'cystic_duct': its organ's axis is [\d.]+ mm from",
        refused(["anatomy", other / "anatomy.toml"]),
    )
    (other / "cystic_duct.organ").write_bytes(b"no organ")
    assert "cystic_duct.organ" in refused(["anatomy", other / "anatomy.toml"])


def test_an_anatomy_can_hold_its_organs(case: Path, tmp_path: Path) -> None:
    """Written elsewhere it has what was beside it; content that is none is named."""
    alone = tmp_path / "alone.toml"
    assert run("anatomy", case / "anatomy.toml", "-o", alone).returncode == 0
    assert read_anatomy(alone) == read_anatomy(case / "anatomy.toml")
    text = re.sub(r'organ = "[^"]*"', 'organ = "bm90aGluZw=="', alone.read_text(), count=1)
    alone.write_text(text)
    assert "neither a file's name" in refused(["anatomy", alone])


def test_a_patient_s_organs_are_merged_where_they_stand(case: Path, tmp_path: Path) -> None:
    pytest.importorskip("manifold3d")
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
    assert "beside the anatomy" in refused(["anatomy", path])


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["normal", "--merged"], "--merged goes with --mesh"),
        (["normal", "--mesh", "a.step"], ".stl"),
        (["normal", "--mesh", "a.glb", "--merged"], ".stl"),
        (["normal", "--mesh", "a.zip", "--merged"], ".stl, .ply, .obj, not"),
        (["--list", "--mesh", "a.stl"], "--mesh is of one anatomy"),
    ],
)
def test_wrong_words_are_refused(arguments: list[object], says: str) -> None:
    assert says in refused(["anatomy", *arguments])
