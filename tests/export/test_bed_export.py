"""A duct freed from its bed, as other people's programs read it, from one motion."""

import csv
import json
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import tubes
from gltf_reader import Gltf
from other_programs import three_viewer, validated
from program import refused, run
from simulated import phantom
from test_vtk_gltf import blocks
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkPolyData
from vtkmodules.vtkIOXML import vtkXMLPolyDataReader

from app.export.bed_export import BedExport
from app.export.strand_mesh import RADIUS
from app.export.strands import StrandsSnapshot
from app.simulation import PIECES, Specimen, bed_named, preset_named
from assets import BILE_DUCT
from organ_geometry.mesh import organ_skin
from organ_geometry.mesh.gltf_file import metres
from physics.bed import Hand, pull

EDGE_LENGTH = 1.2
RINGS = 14
"""Vertices of a strand: two rings of a tube, and ring and tip of two stubs."""
FREED = "freed"


@cache
def freed() -> BedExport:
    """The phantom on few strands, lifted and pulled sideways until many have parted."""
    return BedExport(
        Specimen(preset_named("thesis-bile-duct"), phantom(), bed_named("normal")),
        31.0,
        ((0.0, 0.0, 4.0), (1.0, 3.0, 9.0)),
        steps=12,
        elements=40,
        strands=120,
        edge_length=EDGE_LENGTH,
    )


@cache
def model() -> Gltf:
    return Gltf(freed().content(".glb"))


@cache
def torn() -> BedExport:
    """The phantom on few strands that are as tough as it is strong."""
    inflamed = replace(freed().specimen, bed=bed_named("inflamed"))
    export = replace(freed(), specimen=inflamed, hook=25.4, path=((0.0, 2.0, 14.0),))
    return replace(export, steps=10, strands=150)


@cache
def torn_model() -> Gltf:
    return Gltf(torn().content(".glb"))


def strands(key: int, export: BedExport | None = None) -> StrandsSnapshot:
    export = export or freed()
    found = export.motion.strands_at(key, export.dissection.driving)
    assert found is not None
    return found


def vtp(path: Path) -> vtkPolyData:
    reader = vtkXMLPolyDataReader()
    reader.SetFileName(str(path))
    reader.Update()
    return reader.GetOutput()


def radius() -> float:
    return 1e-3 * freed().dissection.organ.mean_radius


def test_the_motion_is_solve_s_history() -> None:
    """The same numbers as `solve --bed` gives, and strands that have parted to draw."""
    motion, history = freed().dissected
    assert motion.name == "free"
    assert [reading.force for reading in motion.readings[1:]] == pytest.approx(
        np.linalg.norm(history.forces[:, 0], axis=1)
    )
    assert motion.bed is not None
    assert motion.bed.freed[1:] == pytest.approx(history.freed)
    assert (motion.bed.damage[1:] >= 1.0).sum(axis=1).tolist() == history.broken.tolist()
    assert 30 < history.broken[-1] < 110
    assert not motion.transforms[0].any()
    # The bed is below the duct, and force is only where a strand is taut and whole.
    last = strands(12)
    assert (last.force[last.parted] == 0.0).all()
    assert last.force.max() > 0.01


@pytest.mark.parametrize("key", [0, 4, 12])
def test_the_organ_s_joints_follow_the_beam_in_space(key: int) -> None:
    export, motion = freed(), freed().motion
    skin = organ_skin(export.dissection.organ, edge_length=EDGE_LENGTH)
    bound = skin.bound_to(export.dissection.driving)
    wanted = bound.deform(motion.transforms[key], np.empty_like(skin.vertices))
    found = model().vertices("organ", "free", float(motion.times[key]))
    for places, side in zip(found, ("outer", "inside"), strict=True):
        assert np.abs(places - metres(wanted[skin.side(side)[0]])).max() < 1e-4 * radius()
    if key == 12:  # sideways too, and turned about the pull
        moved = (wanted - skin.vertices) @ export.dissection.frame
        assert moved.max(axis=0)[1:] == pytest.approx([3.0, 9.0], abs=0.7)


@pytest.mark.parametrize("key", [0, 4, 8, 12])
def test_whole_strands_reach_the_duct_and_parted_ones_are_stubs(key: int) -> None:
    motion, now = freed().motion, strands(key)
    (places,) = model().vertices("strands", "free", float(motion.times[key]))
    rings = places.reshape(-1, RINGS, 3)
    foot, end, foot_stub, end_stub = (rings[:, a : a + 3] for a in (0, 3, 6, 10))
    for ring, at in (
        (foot, now.feet),
        (end, now.ends),
        (foot_stub, now.feet),
        (end_stub, now.ends),
    ):
        assert np.abs(ring.mean(axis=1) - metres(at[:, 0])).max() < 2e-4 * radius()
    tips = metres(np.stack([now.feet[:, 1], now.ends[:, 1]], axis=1))
    assert np.abs(rings[:, [9, 13]] - tips).max() < 2e-4 * radius()

    def thickness(ring: np.ndarray) -> np.ndarray:
        return 1e3 * np.linalg.norm(ring - ring.mean(axis=1, keepdims=True), axis=2).max(axis=1)

    parted = now.parted
    assert parted.any() or key < 8
    for tube, stub in ((foot, foot_stub), (end, end_stub)):
        assert thickness(tube)[~parted] == pytest.approx(RADIUS, rel=1e-3)
        assert thickness(stub)[parted] == pytest.approx(RADIUS, rel=1e-3)
        assert thickness(tube)[parted] == pytest.approx(0.0, abs=1e-4)
        assert thickness(stub)[~parted] == pytest.approx(0.0, abs=1e-4)


def test_the_validator_has_nothing_to_say(tmp_path: Path) -> None:
    path = tmp_path / "free.glb"
    result = freed().write(path)
    assert result.animations == ("free",)
    still, whole, apart = (tmp_path / f"{name}.glb" for name in ("still", "whole", "apart"))
    assert torn().write(apart).surfaces == ("organ", *PIECES)
    replace(freed(), stress_colors=True).write(still)
    replace(freed(), path=((0.0, 0.0, 0.0), (0.0, 0.0, -0.2)), steps=2).write(whole)  # none parts
    for report in validated(path, still, whole, apart):
        assert report["issues"]["messages"] == []


def test_a_path_that_tears_ends_in_two_pieces_on_their_strands() -> None:
    """The hook lets go, and each piece comes to hang on the strands and the clamp that are its."""
    export, (motion, history) = torn(), torn().dissected
    assert export.tear is not None
    assert motion.bed is not None
    assert motion.bed.tear is not None
    assert export.tear.broken
    assert 1 < history.steps < export.steps
    steps = int(motion.whole.sum()) - 1
    assert steps == history.steps, "the last key of the whole duct is the one in which it tears"
    fractions = [1.0 - each.check.distance_to_break for each in motion.readings[: steps + 1]]
    assert max(fractions[:-1]) <= 1.0 < fractions[-1]
    assert motion.readings[-1].force == 0.0
    last, before = strands(len(motion.times) - 1, export), strands(steps, export)
    assert 0 < last.parted.sum() < 150
    assert (last.parted >= before.parted).all(), "what has parted never heals"
    assert last.force.sum() < 0.1 * before.force.sum()
    # Apart in the middle, each still in its clamp and fallen back towards the bed.
    one, two = export.snapshot().surfaces
    assert (one.name, two.name) == PIECES
    assert one.vertices[:, 0].max() < two.vertices[:, 0].min()
    for surface, clamp in ((one, 0), (two, 1)):
        held = np.abs(surface.skin.stations - export.dissection.clamps[clamp]) < 0.5
        assert np.abs(surface.vertices - surface.skin.vertices)[held].max() < 0.05
        away = np.abs(surface.skin.stations - motion.bed.tear) > 8.0  # the rim itself draws back
        assert np.abs(surface.vertices - surface.skin.vertices)[away].max() < 1.0


def test_torn_pieces_and_their_strands_move_as_drawn_here() -> None:
    export = torn()
    motion, moments = export.motion, list(export.snapshots())
    first = int(motion.whole.sum())
    wanted = dict(enumerate([each for _, each in moments[:first]]))
    wanted |= dict(enumerate([each for _, each in moments[first:]], first + 1))
    assert len(wanted) == len(motion.times) - 1
    for key in (4, first + 3, first + 12, len(motion.times) - 1):
        time = float(motion.times[key])
        for surface in wanted[key].surfaces:
            found = torn_model().vertices(surface.name, "free", time)
            for places, side in zip(found, ("outer", "inside"), strict=True):
                at = metres(surface.vertices[surface.skin.side(side)[0]])
                assert np.abs(places - at).max() < 1e-4 * radius()
        for name in {"organ", *PIECES} - {each.name for each in wanted[key].surfaces}:
            for places in torn_model().vertices(name, "free", time):
                assert np.ptp(places, axis=0).max() < 1e-6
        now = strands(key, export)
        (places,) = torn_model().vertices("strands", "free", time)
        ends = places.reshape(-1, RINGS, 3)[:, 3:6].mean(axis=1)
        assert np.abs(ends - metres(now.ends[:, 0])).max() < 2e-4 * radius()


def test_three_js_plays_it() -> None:
    motion = freed().motion
    with three_viewer(freed().content(".glb")) as viewer:
        assert viewer.clips == {"free": pytest.approx(motion.times[-1])}
        for key in (4, 12):
            time = float(motion.times[key])
            found = viewer.places("free", time)
            assert found.keys() == {"organ", "strands"}
            for name, places in found.items():
                wanted = np.concatenate(model().vertices(name, "free", time))
                assert np.abs(places - wanted).max() < 1e-4 * radius()


def test_vtk_plays_it(tmp_path: Path) -> None:
    path = tmp_path / "free.glb"
    freed().write(path)
    time = float(freed().motion.times[12])
    # The organ's node comes after its armature's, which holds the strands.
    wanted = [*model().vertices("strands", "free", time), *model().vertices("organ", "free", time)]
    found = blocks(path, "free", time)
    assert sorted(len(each) for each in found) == sorted(len(each) for each in wanted)
    for got, places in zip(found, wanted, strict=True):
        assert np.abs(got - places).max() < 1e-4 * radius()


def test_vtk_reads_surface_and_strands_of_the_series(tmp_path: Path) -> None:
    path = tmp_path / "free.pvd"
    result = freed().write(path)
    assert len(result.files) == 1 + 2 * 13
    text = path.read_text()
    assert text.count('part="0"') == text.count('part="1"') == 13
    motion = freed().motion
    surface = vtp(tmp_path / "free_frames" / "free_0012.vtp")
    data = {
        surface.GetPointData().GetArrayName(k): vtk_to_numpy(surface.GetPointData().GetArray(k))
        for k in range(surface.GetPointData().GetNumberOfArrays())
    }
    worst = motion.readings[12].check
    # The outermost fibre may lie between two vertices, and the drawn section is not the bar's.
    assert data["total_stress_MPa"].max() == pytest.approx(worst.total_stress, rel=0.1)
    assert data["distance_to_break"].min() == pytest.approx(worst.distance_to_break, abs=0.08)
    assert data[FREED].min() == 0.0
    assert data[FREED].max() == 1.0
    station = freed().dissection.clamps[0] + freed().hook
    skin = organ_skin(freed().dissection.organ, edge_length=EDGE_LENGTH)
    assert data[FREED][np.abs(skin.stations - station) < 1.0].min() > 0.9

    lines = vtp(tmp_path / "free_frames" / "free_strands_0012.vtp")
    now = strands(12)
    cells = lines.GetCellData()
    parted = vtk_to_numpy(cells.GetArray("parted"))
    assert lines.GetNumberOfLines() == (~now.parted).sum() + 2 * now.parted.sum()
    assert parted.sum() == 2 * now.parted.sum()
    number = vtk_to_numpy(cells.GetArray("strand"))
    assert vtk_to_numpy(cells.GetArray("force_N")) == pytest.approx(now.force[number], rel=1e-5)
    assert vtk_to_numpy(cells.GetArray("damage")) == pytest.approx(now.damage[number], rel=1e-5)
    first = vtk_to_numpy(lines.GetPoints().GetData()).reshape(-1, 2, 3)
    whole = parted == 0
    assert first[whole, 0] == pytest.approx(now.feet[number[whole], 0], abs=1e-4)
    assert first[whole, 1] == pytest.approx(now.ends[number[whole], 0], abs=1e-4)


def test_the_last_moment_as_vtp_has_its_strands_beside_it(tmp_path: Path) -> None:
    path = tmp_path / "last.vtp"
    result = freed().write(path)
    assert [file.name for file in result.files] == ["last.vtp", "last_strands.vtp"]
    assert vtp(result.files[1]).GetNumberOfLines() > 120


def test_a_curved_duct_is_freed_as_it_lies() -> None:
    """By its own sections along its own axis, and drawn where the beam in space is."""
    bed, path = bed_named("firm"), ((0.0, 3.0, 9.0),)
    specimen = Specimen(preset_named("assumed-duct"), tubes.tube(wall=1.0, sag=5.0), bed)
    dissection = specimen.dissection
    export = BedExport(
        specimen, 27.0, path, steps=10, elements=40, strands=200, edge_length=EDGE_LENGTH
    )
    rest = dissection.space_beam(elements=40, nodes_at=[27.0])
    assert np.abs(rest.places[:, 1]).max() == pytest.approx(5.0, abs=0.1), "it is curved"
    solved = pull(rest, bed.bed(rest, strands=200), [Hand(at=27.0, path=path, steps=10)])
    history = export.dissected[1]
    assert np.array_equal(history.forces, solved.forces)
    assert 30 < history.broken[-1] < 150
    start, end = (moment for _, moment in list(export.snapshots())[::10])
    (before,), (after,) = start.surfaces, end.surfaces
    assert np.array_equal(before.vertices, before.skin.vertices)
    moved = (after.vertices - before.vertices) @ dissection.frame
    at = np.abs(after.skin.stations - dissection.clamps[0] - 27.0) < 0.7
    assert moved[at].mean(axis=0) == pytest.approx(history.hands[-1, 0], abs=0.25)
    held = (after.skin.stations <= 0.0) | (after.skin.stations >= dissection.clamps[1])
    assert np.abs(moved[held]).max() < 1e-6


def test_the_command_writes_what_solve_says(tmp_path: Path) -> None:
    """The history is `solve --bed -o`'s to the letter, on the same duct, bed and path."""
    bed = ["--bed", "loose", "--hook", "20", "--path", "[[0,1,3]]", "--steps", "4"]
    bed += ["--seed", "5", "--strands", "60", "--elements", "20"]
    one, two = tmp_path / "export.csv", tmp_path / "solve.csv"
    done = run("export", BILE_DUCT, *bed, "-o", one, "--json")
    assert done.returncode == 0, done.stderr
    assert run("solve", *bed, "-o", two).returncode == 0
    assert one.read_text() == two.read_text()
    facts, last = json.loads(done.stdout), list(csv.DictReader(one.read_text().splitlines()))[-1]
    assert facts["bed"] == "loose"
    assert facts["freed_mm"] == float(last["freed_mm"])
    assert facts["distance_to_break_percent"] == float(last["distance_to_break_percent"])


def test_the_command_says_where_the_duct_tore(tmp_path: Path) -> None:
    options = ["--bed", "firm", "--lift", "40", "--steps", "20", "--strands", "100", "--json"]
    done = run("export", BILE_DUCT, *options, "-o", tmp_path / "a.stl")
    assert done.returncode == 0, done.stderr
    facts = json.loads(done.stdout)
    assert facts["surfaces"] == list(PIECES)
    assert 0.0 <= facts["torn_at_mm"] <= 50.8
    assert facts["distance_to_break_percent"] < 0.0


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--bed", "firm", "--hook", "60", "--lift", "2"], "a hook at 60"),
        (["--bed", "firm"], "give either --lift"),
        (["--bed", "firm", "--lift", "3", "--path", "[[0,0,1]]"], "give either --lift"),
        (["--bed", "firm", "--path", "[[0,0,NaN]]"], "finite"),
        (["--bed", "silk", "--lift", "3"], "unknown bed 'silk'"),
        (["--bed", "firm", "--lift", "3", "--steps", "0"], "steps must be"),
        (["--bed", "firm", "--lift", "3", "--strands", "0"], "strands of a bed must be"),
        (["--bed", "firm", "--lift", "3", "--force", "2", "--torn"], "leave out --force, --torn"),
        (["--lift", "3", "--seed", "2"], "--lift, --seed go with --bed"),
    ],
)
def test_what_is_wrong_is_named_and_nothing_written(
    tmp_path: Path, options: list[str], words: str
) -> None:
    for suffix in ("glb", "pvd"):
        path = tmp_path / f"a.{suffix}"
        assert words in refused(["export", BILE_DUCT, *options, "-o", path])
    assert list(tmp_path.iterdir()) == []
