"""Downloads: files hold what the session shows, without a browser."""

import csv
import io
from dataclasses import replace
from threading import Thread
from zipfile import ZipFile

import numpy as np
import pytest
import trimesh
from scipy.spatial import KDTree
from simulated import bed_session, phantom, pull, pull_session, settle, tear
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkIOXML import vtkXMLPolyDataReader

from app.export.pull_export import PullExport
from app.simulation import Reading, Session, Specimen, preset_named
from app.trainer.client.workers import EXPORT_VERTICES as VERTICES
from app.trainer.pages.downloads import SUFFIXES, download, export_on_screen, run_download
from organ_geometry.organ import Organ
from organ_geometry.organ_file import organ_from_bytes
from physics import Cubic, Exact


def session(preset: str = "thesis-bile-duct") -> Session:
    """A duct by another theory than the first, with a grasp and threshold of its own."""
    found = pull_session(phantom(), preset_named(preset), vertices=300, seed=5)
    found.choose_theory(Exact())
    found.set_grasp(0.4 * found.tissue.dissection.beam.span)
    found.set_threshold(1.2 * found.planar.threshold)
    found.advance(30)
    return found


def vtp(content: bytes) -> dict[str, np.ndarray]:
    """A VTP's points and arrays, by VTK."""
    reader = vtkXMLPolyDataReader()
    reader.ReadFromInputStringOn()
    reader.SetInputString(content.decode("latin-1"))
    reader.Update()
    surface = reader.GetOutput()
    data = surface.GetPointData()
    return {"points": vtk_to_numpy(surface.GetPoints().GetData()).copy()} | {
        data.GetArrayName(k): vtk_to_numpy(data.GetArray(k)).copy()
        for k in range(data.GetNumberOfArrays())
    }


@pytest.mark.parametrize("preset", ["thesis-bile-duct", "porcine-bile-duct"])
def test_an_order_is_the_duct_as_it_is_pulled(preset: str) -> None:
    shown = session(preset)
    pull(shown, 0.3 * shown.planar.force_limit)
    order, reading = export_on_screen(shown, VERTICES), shown.reading()
    assert order.dissection.organ is shown.tissue.dissection.organ
    assert order.dissection.preset == shown.tissue.dissection.preset
    assert order.theory.name == Exact().name
    assert order.force is not None
    beam = shown.tissue.dissection.beam
    pulled = order.theory.pull(beam, shown.planar.grasp).to_force(order.force)
    assert pulled.deflection == pytest.approx(reading.deflection, rel=1e-6)
    assert (order.grasp, order.threshold, order.seed) == (
        shown.planar.grasp,
        shown.tissue.threshold,
        5,
    )
    assert order.force == reading.force > 0.0
    assert not order.torn
    assert order.break_event is not None
    assert reading.breaks_at is not None
    assert order.break_event.force == pytest.approx(reading.breaks_at.force, rel=1e-6)


def test_a_hand_s_pull_is_the_force_that_the_beam_answers_with() -> None:
    shown = session()
    shown.grab(0, 20.0)
    shown.lift(5.0)
    settle(shown)
    order = export_on_screen(shown, VERTICES)
    assert order.grasp == 20.0
    assert order.force is not None
    assert order.force == shown.reading().force > 0.0
    beam = shown.tissue.dissection.beam
    again = order.theory.pull(beam, 20.0).to_force(order.force)
    assert again.deflection == pytest.approx(5.0, rel=1e-6)


def test_a_clock_that_goes_on_moves_nothing_while_an_order_is_written(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    shown = session()
    reading, moves = shown.reading, list[bool]()

    def read() -> Reading:
        clock = Thread(target=lambda: moves.append(shown.lock.acquire(blocking=False)))
        clock.start()
        clock.join()
        return reading()

    monkeypatch.setattr(shown, "reading", read)
    export_on_screen(shown, VERTICES)
    assert moves == [False]


def test_a_duct_that_springs_back_is_held_where_it_is() -> None:
    shown = session()
    shown.grab(0, 20.0)
    shown.lift(5.0)
    settle(shown)
    shown.release()
    shown.advance()
    reading, order = shown.reading(), export_on_screen(shown, VERTICES)
    assert reading.force == 0.0
    assert 0.0 < reading.deflection < 5.0
    assert order.force is not None
    held = order.theory.pull(shown.tissue.dissection.beam, 20.0).to_force(order.force)
    assert held.deflection == pytest.approx(reading.deflection, rel=1e-6)


def test_a_mesh_has_about_as_many_vertices_as_it_may() -> None:
    for most in (2_000, VERTICES):
        content = download(session(), ".stl", most).content
        mesh = trimesh.load(io.BytesIO(content), file_type="stl")
        assert isinstance(mesh, trimesh.Trimesh)
        mesh.merge_vertices()
        assert 0.6 * most < len(mesh.vertices) < 1.2 * most


def test_still_meshes_are_the_duct_as_it_is() -> None:
    shown = session()
    pull(shown, 0.3 * shown.planar.force_limit)
    reading = shown.reading()
    mesh = trimesh.load(io.BytesIO(download(shown, ".stl", VERTICES).content), file_type="stl")
    assert isinstance(mesh, trimesh.Trimesh)
    mesh.merge_vertices()
    assert mesh.is_watertight
    arrays = vtp(download(shown, ".vtp", VERTICES).content)
    assert mesh.bounds == pytest.approx(
        np.stack([arrays["points"].min(0), arrays["points"].max(0)])
    )
    least = arrays["distance_to_break"].min()
    assert least == pytest.approx(reading.check.distance_to_break, abs=0.03)
    # With the session's edges the vertices are the session's.
    order = replace(export_on_screen(shown, VERTICES), edge_length=shown.drawn.edge_length)
    (drawn,) = shown.drawn.surfaces
    assert vtp(order.content(".vtp"))["points"] == pytest.approx(drawn.vertices, abs=1e-4)


def test_a_torn_duct_is_two_pieces_with_the_rim_that_is_seen() -> None:
    shown = session()
    tear(shown)
    order = export_on_screen(shown, VERTICES)
    assert order.torn
    mesh = trimesh.load(io.BytesIO(download(shown, ".stl", VERTICES).content), file_type="stl")
    assert isinstance(mesh, trimesh.Trimesh)
    mesh.merge_vertices()
    assert mesh.body_count == 2
    assert mesh.is_watertight
    # With the session's edges the pieces are the session's, to the bit.
    edge_length = shown.drawn.edge_length
    pieces = order.pieces(edge_length)
    assert pieces is not None
    for surface, piece in zip(shown.drawn.surfaces, pieces, strict=True):
        assert surface.skin.vertices == pytest.approx(piece.skin.vertices, abs=1e-4)


@pytest.mark.parametrize("torn", [False, True])
def test_what_moves_goes_to_the_force_or_over_the_break(torn: bool) -> None:
    shown = session()
    if torn:
        tear(shown)
    else:
        pull(shown, 0.3 * shown.planar.force_limit)
    order = export_on_screen(shown, VERTICES)
    end = None if torn else order.force
    moving = replace(order, force=end, torn=False)
    assert download(shown, ".glb", VERTICES).content == moving.content(".glb")
    (head, *rows) = csv.reader(io.StringIO(download(shown, ".csv", VERTICES).content.decode()))
    assert head[0].startswith("force")
    assert order.break_event is not None
    assert float(rows[-1][0]) == pytest.approx(order.break_event.force, rel=1e-8)


def test_a_page_at_rest_goes_over_the_break() -> None:
    page = download(session(), ".html", VERTICES)
    assert page.name.endswith(".html")
    assert b"drawn, not computed" in page.content


def test_a_duct_that_does_not_break_is_pulled_as_far_as_the_grasper_can() -> None:
    shown = pull_session(phantom(), preset_named("thesis-rubber"), vertices=300)
    shown.set_threshold(shown.planar.threshold_range[1])
    shown.advance(30)
    order = export_on_screen(shown, VERTICES)
    rows = list(csv.reader(io.StringIO(download(shown, ".csv", VERTICES).content.decode())))
    end = shown.planar.force_limit if order.break_event is None else order.break_event.force
    assert float(rows[-1][0]) == pytest.approx(end, rel=1e-8)


def test_the_organ_file_is_the_organ() -> None:
    found = download(session(), ".organ", VERTICES)
    assert found.name == f"{phantom().name}.organ"
    again = organ_from_bytes(found.content)
    assert np.array_equal(again.axis, phantom().axis)
    assert np.array_equal(again.outer, phantom().outer)


def test_an_organ_of_no_file_and_unknown_kinds_are_refused() -> None:
    organ = phantom()
    other = Organ(organ.axis, organ.frames, organ.keys, organ.outer, name="../a b/\u00fc")
    shown = pull_session(other, vertices=300)
    with pytest.raises(ValueError, match="built from images"):
        download(shown, ".organ", VERTICES)
    assert download(shown, ".csv", VERTICES).name == "a_b_\u00fc.csv"
    for suffix in (".pvd", ".exe", "glb", ""):
        with pytest.raises(ValueError, match="a download must be one of"):
            download(shown, suffix, VERTICES)
    assert set(SUFFIXES) == {".glb", ".stl", ".vtp", ".csv", ".html", ".organ"}


@pytest.mark.parametrize("suffix", [".glb", ".stl", ".ply", ".obj", ".vtp", ".csv"])
def test_content_is_what_is_written(suffix: str, tmp_path_factory: pytest.TempPathFactory) -> None:
    shown = session()
    order = PullExport(
        Specimen(shown.tissue.dissection.preset, phantom(), theory=Cubic()),
        shown.planar.grasp,
        force=1.0,
        frames=4,
        edge_length=2.0,
    )
    path = tmp_path_factory.mktemp("orders") / f"organ{suffix}"
    assert order.write(path).files == (path,)
    assert path.read_bytes() == order.content(suffix)
    with pytest.raises(ValueError, match="series of files"):
        order.content(".pvd")


@pytest.mark.parametrize("lift", [8.0, 40.0], ids=["whole", "torn"])
def test_a_dissection_is_written_as_it_went_and_as_it_is_at_its_end(lift: float) -> None:
    shown = bed_session(phantom(), vertices=300)
    place = shown.grab(0, 20.0)
    assert place is not None
    shown.move_hand(0, place + np.array([0.0, 0.0, lift]))
    shown.advance(150)
    run, reading = shown.run_file(), shown.reading()
    assert (reading.torn_at is not None) == (lift > 20.0)

    def file(suffix: str) -> bytes:
        return run_download(run, phantom(), suffix, VERTICES).content

    assert b'"name":"run"' in file(".glb")
    assert b"A recorded run of" in file(".html")
    solid = trimesh.load_mesh(io.BytesIO(file(".stl")), file_type="stl")
    assert solid.is_watertight
    assert solid.body_count == (1 if reading.torn_at is None else 2)
    with ZipFile(io.BytesIO(file(".zip"))) as packed:
        surface, strands = (vtp(packed.read(name)) for name in packed.namelist())
    total = surface["total_stress_MPa"].max() / shown.tissue.threshold
    assert total == pytest.approx(reading.stress_ratio, abs=0.05)
    # Whole strands end at the surface, wherever it or its pieces have come to lie (but for the
    # rim of a tear, which opens).
    ends = strands["points"].reshape(-1, 2, 3)[: reading.strands - reading.broken, 1]
    away, _ = KDTree(surface["points"]).query(ends)
    assert np.median(away) < 0.3


def test_no_file_of_a_run_that_has_not_begun() -> None:
    with pytest.raises(ValueError, match="no run yet"):
        run_download(None, phantom(), ".glb", VERTICES)
    assert run_download(None, phantom(), ".organ", VERTICES).content == phantom().encoded
