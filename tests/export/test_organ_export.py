"""Orders: every kind of file holds what was asked for, read by other people's programs."""

import csv
import re
import subprocess
import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from gltf_reader import Gltf
from other_programs import program
from simulated import phantom
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkIOXML import vtkXMLPolyDataReader

from app.export.organ_export import SUFFIXES
from app.export.pull_export import PullExport
from app.simulation import Specimen, preset_named
from organ_geometry.mesh.color import stress_colors
from organ_geometry.mesh.skin import organ_skin
from physics import Cubic, check_rupture, critical_stations

EDGE_LENGTH = 1.0
FIGURES = {
    "displacement_mm",
    "normal_stress_MPa",
    "bending_stress_MPa",
    "total_stress_MPa",
    "distance_to_break",
    "surface",
}


@pytest.fixture(scope="module")
def order() -> PullExport:
    specimen = Specimen(preset_named("thesis-bile-duct"), phantom(), theory=Cubic())
    return PullExport(
        specimen,
        0.5 * specimen.beam.span,
        force=2.0,
        frames=5,
        edge_length=EDGE_LENGTH,
    )


def read_vtp(path: Path) -> tuple[np.ndarray, np.ndarray, dict[str, np.ndarray]]:
    """Points, faces and figures, by VTK."""
    reader = vtkXMLPolyDataReader()
    reader.SetFileName(str(path))
    reader.Update()
    surface = reader.GetOutput()
    data = surface.GetPointData()
    return (
        vtk_to_numpy(surface.GetPoints().GetData()).copy(),
        vtk_to_numpy(surface.GetPolys().GetConnectivityArray()).reshape(-1, 3).copy(),
        {
            data.GetArrayName(k): vtk_to_numpy(data.GetArray(k)).copy()
            for k in range(data.GetNumberOfArrays())
        },
    )


def rows_of(path: Path) -> dict[str, np.ndarray]:
    with path.open() as file:
        names, *rows = csv.reader(file)
    return dict(zip(names, np.array(rows, dtype=float).T, strict=True))


def test_vtk_reads_the_stresses_at_the_surface(order: PullExport, tmp_path: Path) -> None:
    path = tmp_path / "duct.vtp"
    delivery = order.write(path)
    points, faces, figures = read_vtp(path)
    assert figures.keys() == FIGURES
    assert len(points) == delivery.vertices
    assert len(faces) == delivery.faces
    skin = organ_skin(order.dissection.organ, edge_length=EDGE_LENGTH)
    assert points - figures["displacement_mm"] == pytest.approx(skin.vertices, abs=1e-5)
    lifts = figures["displacement_mm"] @ order.dissection.frame[:, 2]
    assert lifts.max() == pytest.approx(delivery.deflection, rel=0.01)
    total = figures["normal_stress_MPa"] + figures["bending_stress_MPa"]
    assert figures["total_stress_MPa"] == pytest.approx(total, abs=1e-7)
    beam = order.dissection.beam
    threshold = order.dissection.preset.threshold(order.theory, beam)
    distance = figures["distance_to_break"]
    assert distance == pytest.approx(1.0 - total / threshold, abs=1e-5)
    pulled = (
        order.theory.pull(beam, order.grasp)
        .to_force(2.0)
        .sample(critical_stations(beam, order.grasp))
    )
    # No vertex stands just where the beam's stress is highest, and the side that is stretched there
    # is not the one that reaches farther out.
    highest = check_rupture(pulled, threshold).distance_to_break
    assert highest - 1e-6 < distance.min() < highest + 0.05


def test_a_series_grows_with_the_force(order: PullExport, tmp_path: Path) -> None:
    path = tmp_path / "pull.pvd"
    delivery = order.write(path)
    frames = [
        (float(item.attrib["timestep"]), tmp_path / item.attrib["file"])
        for item in ET.parse(path).getroot().iter("DataSet")
    ]
    assert [force for force, _ in frames] == pytest.approx(np.linspace(0.0, 2.0, 5))
    assert (path, *(file for _, file in frames)) == delivery.files
    assert {entry.name for entry in tmp_path.iterdir()} == {"pull.pvd", "pull_frames"}
    lowest = [read_vtp(file)[2]["distance_to_break"].min() for _, file in frames]
    assert lowest[0] == 1.0
    assert (np.diff(lowest) < 0.0).all()
    # Written again, a shorter series leaves nothing of the longer one.
    replace(order, frames=2).write(path)
    assert len(list((tmp_path / "pull_frames").iterdir())) == 2


def test_a_series_does_not_take_a_stranger_s_folder(order: PullExport, tmp_path: Path) -> None:
    precious = tmp_path / "pull_frames" / "precious"
    precious.parent.mkdir()
    precious.touch()
    with pytest.raises(ValueError, match="which is there already"):
        order.write(tmp_path / "pull.pvd")
    assert precious.exists()
    assert [entry.name for entry in tmp_path.iterdir()] == ["pull_frames"]


def test_a_series_that_fails_leaves_nothing(order: PullExport, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="past the break"):
        replace(order, force=9.0).write(tmp_path / "pull.pvd")
    assert not list(tmp_path.iterdir())


def test_curve_is_the_theory_s(order: PullExport, tmp_path: Path) -> None:
    path = tmp_path / "curve.csv"
    event = order.break_event
    assert event is not None
    delivery = replace(order, force=None).write(path)
    rows = rows_of(path)
    assert len(rows["force_N"]) == 5
    assert delivery.force == event.force == pytest.approx(rows["force_N"][-1])
    beam = order.dissection.beam
    wanted = [
        Cubic().pull(beam, order.grasp).to_force(force).deflection for force in rows["force_N"]
    ]
    assert rows["deflection_mm"] == pytest.approx(np.array(wanted), rel=1e-8)
    assert rows["distance_to_break"][[0, -1]] == pytest.approx([1.0, 0.0], abs=1e-8)
    total = rows["normal_stress_MPa"] + rows["bending_stress_MPa"]
    assert rows["total_stress_MPa"] == pytest.approx(total)


def test_axis_is_where_the_skin_s_axis_is(order: PullExport, tmp_path: Path) -> None:
    path = tmp_path / "axis.csv"
    delivery = replace(order, table="axis").write(path)
    rows = rows_of(path)
    places = np.stack([rows[f"{name}_mm"] for name in "xyz"], axis=1)
    dissection = order.dissection
    rest = dissection.organ.axis_at(dissection.clamps[0] + rows["station_mm"])
    lifts = (places - rest) @ dissection.frame[:, 2]
    assert lifts == pytest.approx(rows["across_mm"], abs=1e-6)
    assert lifts.max() == pytest.approx(delivery.deflection)
    # The moment's slope is the shear force: trapezia on a cubic's second derivative are exact.
    slope = np.diff(rows["moment_N_mm"]) / np.diff(rows["station_mm"])
    inside = np.abs(rows["station_mm"][1:-1] - order.grasp) > 1.0
    middles = 0.5 * (rows["shear_force_N"][1:] + rows["shear_force_N"][:-1])
    assert slope[1:][inside] == pytest.approx(middles[1:][inside], rel=0.02, abs=1e-3)


def test_a_threshold_of_one_s_own_moves_the_break(order: PullExport) -> None:
    half = replace(order.specimen, threshold_MPa=0.5 * order.threshold)
    weak = replace(order, specimen=half)
    own, half = order.break_event, weak.break_event
    assert own is not None
    assert half is not None
    assert half.force < own.force
    assert half.check.total_stress == pytest.approx(0.5 * order.threshold)


def test_admesh_finds_nothing_to_mend(order: PullExport, tmp_path: Path) -> None:
    for name, wanted, count in (
        ("rest", replace(order, force=None), 1),
        ("pulled", order, 1),
        ("torn", replace(order, force=None, torn=True), 2),
    ):
        path = tmp_path / f"{name}.stl"
        wanted.write(path)
        done = subprocess.run(
            [program("admesh"), path], capture_output=True, text=True, timeout=60, check=False
        )
        assert done.returncode == 0, done.stderr
        counts = dict(re.findall(r"^(.+?)\s*:\s+(-?\d+)", done.stdout, flags=re.MULTILINE))
        assert int(counts["Number of parts"]) == count
        for fault in (
            "Degenerate facets",
            "Edges fixed",
            "Facets removed",
            "Facets added",
            "Facets reversed",
            "Backwards edges",
            "Normals fixed",
        ):
            found = re.search(rf"{fault}\s*:\s+(\d+)", done.stdout)
            assert found, (fault, done.stdout)
            assert int(found.group(1)) == 0, (name, fault)
        volume = re.search(r"Volume\s*:\s+([-\d.]+)", done.stdout)
        assert volume
        ours = trimesh.load_mesh(path).volume
        assert float(volume.group(1)) == pytest.approx(ours, rel=1e-4)


def test_colours_of_stress_are_cividis_from_nothing_to_the_threshold() -> None:
    matplotlib = pytest.importorskip("matplotlib")
    used = np.linspace(0.0, 1.0, 256)
    wanted = 255.0 * matplotlib.colormaps["cividis"](np.arange(256))[:, :3]
    assert np.abs(stress_colors(1.0 - used) - wanted).max() <= 2.5
    outside = stress_colors(np.array([1.3, 1.0, 0.0, -0.2]))
    assert np.array_equal(outside[0], outside[1])
    assert np.array_equal(outside[2], outside[3])


@pytest.mark.parametrize("suffix", [".ply", ".glb"])
def test_colored_meshes_keep_their_colours(order: PullExport, tmp_path: Path, suffix: str) -> None:
    vtp, path = tmp_path / "duct.vtp", tmp_path / f"duct{suffix}"
    order.write(vtp)
    replace(order, stress_colors=True).write(path)
    points, _, figures = read_vtp(vtp)
    wanted = stress_colors(figures["distance_to_break"].astype(float)).astype(int)
    if suffix == ".ply":
        mesh = trimesh.load_mesh(path, process=False)
        assert np.array_equal(mesh.vertices, points.astype(float))
        colors: np.ndarray = mesh.visual.vertex_colors  # pyright: ignore
        assert np.abs(colors[:, :3].astype(int) - wanted).max() <= 1
        return
    gltf = Gltf(path.read_bytes())
    (outer, _) = gltf.primitives("organ")
    linear = gltf.array(outer["attributes"]["COLOR_0"])
    srgb = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    assert np.abs(255.0 * srgb[:, :3] - wanted[: len(srgb)]).max() < 1.5
    assert (linear[:, 3] == 1.0).all()


@pytest.mark.parametrize(
    ("change", "name", "words"),
    [
        ({"force": 4.0}, "a.glb", "past the break of thesis-bile-duct at 3.559 N"),
        ({"force": 4.0}, "a.csv", "past the break of thesis-bile-duct at 3.559 N"),
        ({"force": float("nan")}, "a.vtp", "force must be a finite number of N"),
        ({"force": -2.0}, "a.stl", "the hook pulls and does not push"),
        ({"frames": 1}, "a.glb", "frames must be 2"),
        ({"frames": 1_000_000}, "a.pvd", "to 2,000"),
        ({"edge_length": 0.08}, "a.glb", "viewers move at most 300,000"),
        ({"edge_length": 1e-4}, "a.vtp", "600,000"),
        ({"stress_colors": True}, "a.stl", ".ply, .glb"),
        ({"torn": True}, "a.pvd", "leave out --torn"),
        ({}, "a.blend", ", ".join(SUFFIXES)),
        ({}, "nowhere/a.glb", "there is no folder"),
    ],
)
def test_orders_that_cannot_be_carried_out_leave_no_file(
    order: PullExport, tmp_path: Path, change: dict[str, object], name: str, words: str
) -> None:
    with pytest.raises(ValueError, match=re.escape(words)):
        replace(order, **change).write(tmp_path / name)  # pyright: ignore[reportArgumentType]
    assert not list(tmp_path.iterdir())
