"""Runs at several tubes as files: each tube moves as the session moved it, with its stresses."""

from functools import cache
from html import unescape
from io import BytesIO
from pathlib import Path
from zipfile import ZipFile

import numpy as np
import pytest
import trimesh
from gltf_reader import Gltf
from other_programs import validated
from program import refused, run
from test_bed_export import vtp
from vtkmodules.util.numpy_support import vtk_to_numpy

from app.anatomy import anatomy_named
from app.export.motion import WHOLE
from app.export.recorded_run import RecordedRun, rigged_runs, run_snapshots
from app.export.recorded_tubes import recorded_runs
from app.simulation import FEW, Session, Specimen, performed, read_script, run_json
from app.trainer.pages.downloads import run_download
from assets import SCRIPTS
from organ_geometry.mesh import organ_skin

TORN = ("artery_first_piece", "artery_second_piece")


@cache
def hasty() -> Session:
    """Return a session in which hasty jaws tore the artery."""
    session = Session(Specimen.of_anatomy(anatomy_named("normal")), vertices=FEW)
    performed(read_script(SCRIPTS / "hasty.toml"), session)
    return session


@cache
def recorded() -> dict[str, RecordedRun]:
    organ = hasty().specimen.organ
    assert organ is not None
    runs = recorded_runs(hasty().run_file().log, organ, frames=40)
    return {run.names[0]: run for run in runs}


@pytest.fixture(scope="module")
def run_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("run") / "run.json"
    path.write_bytes(run_json(hasty().run_file()))
    return path


def test_each_tube_is_a_mesh_that_moves_by_its_own_rig() -> None:
    """The torn artery comes in two more pieces; driving points are where the tissue has them."""
    runs, tissue = recorded(), hasty().spatial
    assert tuple(runs) == tissue.tubes.names
    for number, (name, each) in enumerate(runs.items()):
        last = each.motion.transforms[-1]
        whole = bool(each.motion.whole[-1])
        assert whole == (name != "artery")
        wanted = tissue.tubes.surfaces[number].move(
            tissue.beam, np.empty_like(last), None if whole else 0, tissue.torn_elements[number]
        )
        assert (last == wanted).all()
    assert runs["artery"].motion.fronts[0] == WHOLE
    assert runs["artery"].motion.fronts[-1] == pytest.approx(2.0)
    gltf = Gltf(rigged_runs(tuple(runs.values()), edge_length=0.8))
    names = {mesh["name"] for mesh in gltf.tree["meshes"]}
    assert names == {*tissue.tubes.names, *TORN}
    assert [each["name"] for each in gltf.tree["animations"]] == ["run"]
    assert len(gltf.tree["skins"]) == len(names)


def test_strands_are_where_the_tissue_has_them() -> None:
    """Also those between tubes, whose feet move; their forces are those of the stretched lines."""
    tissue = hasty().spatial
    runs = tuple(recorded().values())
    (_, first), *_, (time, shown) = run_snapshots(runs, edge_length=2.0)
    assert time == pytest.approx(hasty().run_file().log.ticks / 30.0)
    order = np.concatenate(tissue.tubes.strands_of)
    strands, beam, now = tissue.tubes.strands.some(order), tissue.beam, shown.strands
    assert now is not None
    assert first.strands is not None
    assert (now.damage == beam.damage[order]).all()
    feet, ends = beam.strand_feet(order), beam.strand_ends(order)
    on_tube = strands.to >= 0
    assert 300 < on_tube.sum() < len(order)
    moved = now.feet[:, 0] - first.strands.feet[:, 0]
    assert np.abs(moved - (feet - strands.feet)).max() < 1e-9
    assert np.abs(feet - strands.feet)[on_tube].max() > 1.0, "they have moved"
    assert (feet == strands.feet)[~on_tube].all()
    # Drawn ends follow the surface between nodes, farthest from a node's own on the widest tube.
    thin = strands.tubes != tissue.tubes.names.index("gallbladder")
    assert np.abs(now.ends[:, 0] - ends)[thin].max() < 0.3
    assert np.abs(now.ends[:, 0] - ends).max() < 2.5
    elongation = np.sqrt(((ends - feet) ** 2).sum(axis=1)) - strands.length
    taut = (elongation > 0.0) | (strands.bilateral > 0.0)
    wanted = np.where(taut, (1.0 - beam.damage[order]) * strands.stiffness * elongation, 0.0)
    assert now.force == pytest.approx(wanted, rel=1e-12, abs=1e-15)


def test_the_command_writes_a_glb(run_path: Path, tmp_path: Path) -> None:
    """A glTF validator finds no error in it."""
    out = tmp_path / "run.glb"
    done = run("replay", run_path, "-o", out, "--frames", 10, "--edge-length", 1.0)
    assert done.returncode == 0, done.stderr
    assert validated(out)[0]["issues"]["numErrors"] == 0


def test_vtk_reads_tubes_strands_and_stresses_of_a_series(run_path: Path, tmp_path: Path) -> None:
    """A tube keeps its number when another one tears; distance to break is its own wall's."""
    out = tmp_path / "run.pvd"
    done = run("replay", run_path, "-o", out, "--frames", 12, "--edge-length", 1.0)
    assert done.returncode == 0, done.stderr
    text = out.read_text()
    assert text.count('part="0"') == text.count('part="1"') == 12
    names = hasty().spatial.tubes.names
    for number, wanted in (
        (0, list(names)),
        (11, [TORN[0] if name == "artery" else name for name in names] + [TORN[1]]),
    ):
        surface = vtp(tmp_path / "run_frames" / f"run_{number:04d}.vtp")
        found = surface.GetFieldData().GetAbstractArray("surfaces")
        assert [found.GetVariantValue(k).ToString() for k in range(len(wanted))] == wanted
        data = {
            surface.GetPointData().GetArrayName(k): vtk_to_numpy(surface.GetPointData().GetArray(k))
            for k in range(surface.GetPointData().GetNumberOfArrays())
        }
        assert (np.unique(data["surface"]) == np.arange(len(wanted))).all()
        assert data["freed"].min() == 0.0
        for tube, name in enumerate(names):
            at = data["surface"] == tube
            strength = hasty().spatial.strengths[tube]
            assert data["distance_to_break"][at] == pytest.approx(
                1.0 - data["total_stress_MPa"][at] / strength, abs=1e-5
            )
            check = recorded()[name].motion.readings[-1].check
            if number and name != "artery":
                worst = data["total_stress_MPa"][at].max()
                assert worst == pytest.approx(check.total_stress, rel=0.25, abs=1e-3)
    lines = vtp(tmp_path / "run_frames" / "run_strands_0011.vtp")
    parted = int((hasty().spatial.beam.damage >= 1.0).sum())
    assert lines.GetNumberOfLines() == hasty().spatial.tubes.strands.count + parted


def test_meshes_at_the_end_are_closed(run_path: Path, tmp_path: Path) -> None:
    import trimesh

    out = tmp_path / "run.stl"
    assert run("replay", run_path, "-o", out, "--edge-length", 1.0).returncode == 0
    mesh = trimesh.load_mesh(out)
    assert isinstance(mesh, trimesh.Trimesh)
    bodies = mesh.split(only_watertight=True)
    assert len(bodies) == len(hasty().spatial.tubes.names) + 1
    volume = sum(
        trimesh.Trimesh(skin.vertices, skin.faces).volume
        for each in recorded().values()
        for skin in [organ_skin(each.dissection.organ, edge_length=each.edges(1.0))]
    )
    assert mesh.volume == pytest.approx(volume, rel=0.02)


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["-o", "run.stl", "--frames", 5], "--frames is of a file that plays the run"),
        (["-o", "run.mp4"], "its name must end so"),
        (["--frames", 5], "give -o"),
    ],
)
def test_what_cannot_be_written_is_refused(
    run_path: Path, arguments: list[str | int], sentence: str
) -> None:
    assert sentence in refused(["replay", run_path, *arguments])


def test_the_end_of_a_run_has_an_stl_of_each_tube(run_path: Path, tmp_path: Path) -> None:
    """The torn artery's are two; each is closed, and together they are what the one STL has."""
    apart, one = tmp_path / "end.zip", tmp_path / "end.stl"
    for path in (apart, one):
        done = run("replay", run_path, "-o", path, "--edge-length", 1.0)
        assert done.returncode == 0, done.stderr
    with ZipFile(apart) as archive:
        tubes = {Path(name).stem: stl(archive.read(name)) for name in archive.namelist()}
    whole = [name for name in hasty().spatial.tubes.names if name != "artery"]
    assert set(tubes) == {*whole, *TORN}
    assert all(each.is_watertight and each.body_count == 1 for each in tubes.values())
    total = stl(one.read_bytes()).volume
    assert sum(each.volume for each in tubes.values()) == pytest.approx(total, rel=1e-9)


def test_a_page_sends_all_tubes_of_a_run() -> None:
    """Named after the anatomy; what plays it shows it through the scope."""
    organ = hasty().tissue.dissection.organ
    tubes = hasty().spatial.tubes.names

    def file(suffix: str) -> bytes:
        sent = run_download(hasty().run_file(), organ, suffix, vertices=2000)
        assert sent.name == f"normal{suffix}"
        return sent.content

    assert {mesh["name"] for mesh in Gltf(file(".glb")).tree["meshes"]} == {*tubes, *TORN}
    with ZipFile(BytesIO(file(".stl.zip"))) as archive:
        shown = {Path(name).stem: stl(archive.read(name)) for name in archive.namelist()}
    assert set(shown) == {*TORN, *tubes} - {"artery"}
    total = stl(file(".stl")).volume
    assert sum(each.volume for each in shown.values()) == pytest.approx(total, rel=1e-9)
    assert max(len(each.vertices) for each in shown.values()) == pytest.approx(2000, rel=0.2)
    with ZipFile(BytesIO(file(".zip"))) as archive:
        assert archive.namelist() == ["normal.vtp", "normal_strands.vtp"]
    assert "Calot's triangle, anatomy normal" in unescape(file(".html").decode())


def stl(content: bytes) -> trimesh.Trimesh:
    mesh = trimesh.load_mesh(BytesIO(content), file_type="stl")
    assert isinstance(mesh, trimesh.Trimesh)
    return mesh
