"""The stage: files of the expected size, a hook under the duct, a camera that shows the clamps."""

import io
import math
from contextlib import nullcontext
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import trimesh
import viser
from hypothesis import example, given, settings
from hypothesis import strategies as st
from projection import picture_points

from app.simulation import THESIS_PRESET, preset_named
from app.trainer.stage.appearance import appearance_of
from app.trainer.stage.camera import OVERVIEW, viewpoint
from app.trainer.stage.clamps import JAW_LENGTH, clamp_glb
from app.trainer.stage.hook import hook_glb
from app.trainer.stage.neighbours import neighbours_glb
from app.trainer.stage.stage import Stage
from app.trainer.stage.textures import smooth_noise
from app.trainer.stage.tissue_bed import tissue_bed_glb

RADII = (4.45, 2.7)
TISSUE = (205, 140, 92)
BILE_DUCT = appearance_of(preset_named(THESIS_PRESET))
CLIENT_BYTES = 1_000_000  # what a browser downloads for the full look
TOUCH = 0.5  # mm between the hook and the duct's underside
PICTURE_MARGIN = 0.97  # of the picture's half width or height
FLOAT32 = 1e-5  # GLB files hold single precision


def loaded(glb: bytes) -> trimesh.Scene:
    """The file as trimesh reads it back."""
    scene = trimesh.load(io.BytesIO(glb), file_type="glb")
    assert isinstance(scene, trimesh.Scene)
    return scene


def full_files(radius: float) -> dict[str, bytes]:
    """Every file of the full look."""
    return {
        "bed": tissue_bed_glb(),
        "neighbours": neighbours_glb(),
        "first": clamp_glb("first", radius=radius, bite=0.8, tissue=TISSUE),
        "second": clamp_glb("second", radius=radius, bite=0.8, tissue=TISSUE),
        "hook": hook_glb(radius),
    }


@pytest.mark.parametrize("radius", RADII)
def test_files_are_small_enough(radius: float) -> None:
    assert sum(len(file) for file in full_files(radius).values()) < CLIENT_BYTES


@pytest.mark.parametrize("name", ["bed", "neighbours", "first", "second", "hook"])
def test_files_hold_unit_normals_that_agree_with_the_winding(name: str) -> None:
    for mesh in loaded(full_files(4.45)[name]).geometry.values():
        assert isinstance(mesh, trimesh.Trimesh)
        assert "vertex_normals" in mesh._cache  # read from the file, not computed
        normals = np.asarray(mesh.vertex_normals)
        np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-4)
        areas = mesh.area_faces
        corner_normals = normals[mesh.faces].sum(axis=1)
        agreement = np.einsum("ij,ij->i", corner_normals, mesh.face_normals)
        assert areas[agreement < 0.0].sum() < 1e-3 * areas.sum()


@pytest.mark.parametrize("name", ["first", "hook"])
def test_instruments_are_closed_and_wound_outwards(name: str) -> None:
    for mesh in loaded(full_files(4.45)[name]).geometry.values():
        assert isinstance(mesh, trimesh.Trimesh)
        # Rounded ends close in a pole of coinciding vertices: weld them to see a closed surface.
        welded = trimesh.Trimesh(mesh.vertices, mesh.faces)
        welded.update_faces(welded.nondegenerate_faces())
        assert welded.is_watertight
        assert welded.is_winding_consistent
        assert welded.volume > 0.0


@pytest.mark.parametrize("radius", RADII)
def test_clamp_bites_the_end_from_above_and_below(radius: float) -> None:
    bite = 0.8
    steel, shaft, cuff = loaded(
        clamp_glb("first", radius=radius, bite=bite, tissue=TISSUE)
    ).geometry.values()
    over_the_end = steel.vertices[steel.vertices[:, 0] > 0.0]
    for up in (1.0, -1.0):
        jaw = over_the_end[up * over_the_end[:, 2] > 0.0]
        nearest = np.abs(jaw[:, 2]).min() / radius
        assert bite - 0.15 < nearest <= bite
        assert np.ptp(jaw[:, 1]) > 1.6 * radius
    assert steel.bounds[1][0] < radius
    assert shaft.bounds[0][0] < -100.0
    assert cuff.bounds[0][0] > -JAW_LENGTH * radius
    assert np.abs(cuff.bounds[:, 2]).max() <= radius


def test_second_clamp_mirrors_the_first() -> None:
    first, second = (
        loaded(clamp_glb(end, radius=4.45, bite=0.8, tissue=TISSUE)).bounds
        for end in ("first", "second")
    )
    assert first is not None
    assert second is not None
    np.testing.assert_allclose(-first[::-1, 0], second[:, 0], rtol=FLOAT32)
    np.testing.assert_allclose(first[:, 1:], second[:, 1:], rtol=FLOAT32)


def test_bed_lies_around_the_duct_and_below_it() -> None:
    (bed,) = loaded(tissue_bed_glb()).geometry.values()
    below = bed.vertices[(np.abs(bed.vertices[:, 0]) < 27) & (np.abs(bed.vertices[:, 1]) < 6)]
    assert below[:, 2].min() > -8.0
    assert below[:, 2].max() < 2.0
    assert np.ptp(bed.vertices[:, 0]) > 200.0


def test_plain_bed_is_light() -> None:
    assert len(tissue_bed_glb(rows=28, columns=36, pixels=384)) < 90_000


@pytest.mark.parametrize("radius", RADII)
def test_hook_lies_against_the_underside(scene: viser.SceneApi, radius: float) -> None:
    stage = Stage(scene, span=50.8, radius=radius, appearance=BILE_DUCT, look="plain")
    point = np.array([21.0, 0.5, 4.0])
    stage.place_hook(point)
    frame = scene.get_handle_by_name("/stage/hook")
    assert isinstance(frame, viser.FrameHandle)
    wire = next(iter(loaded(hook_glb(radius, detail=0.5)).geometry.values()))
    assert isinstance(wire, trimesh.Trimesh)
    turn = np.asarray(trimesh.transformations.quaternion_matrix(frame.wxyz))[:3, :3]
    placed = trimesh.Trimesh(wire.vertices @ turn.T + frame.position, wire.faces, process=False)
    underside = point - [0.0, 0.0, radius]
    samples = trimesh.sample.sample_surface(placed, 20_000, seed=1)[0]
    assert np.linalg.norm(np.asarray(samples) - underside, axis=1).min() < TOUCH
    # Nothing of the bend cuts deep into the duct, and the tip shows on the viewer's side.
    clearance = np.linalg.norm((wire.vertices)[:, 1:], axis=1).min()
    assert clearance > radius - TOUCH
    assert wire.vertices[:, 1].min() < -radius


@given(
    span=st.floats(30.0, 110.0),
    radius=st.sampled_from(RADII),
    aspect=st.floats(0.46, 2.2),
)
@example(span=30.0, radius=4.45, aspect=0.799)
@settings(deadline=None)
def test_camera_shows_both_clamps_and_the_lifted_duct(
    span: float, radius: float, aspect: float
) -> None:
    view = viewpoint(span, radius, aspect)
    wanted = np.array(
        [
            [x, y, z]
            for x in (-radius, 0.0, span, span + radius)
            for y in (-radius, radius)
            for z in (-1.4 * radius, 1.4 * radius)
        ]
        + [[0.5 * span, 0.0, 0.28 * span]]
    )
    seen = picture_points(view, wanted, aspect)
    assert np.abs(seen).max() < PICTURE_MARGIN
    # As large as it can be: something reaches almost to an edge.
    assert np.abs(seen[:, 0]).max() > 0.75 or np.abs(seen[:, 1]).max() > 0.6
    if aspect < 0.8:  # over a phone's panel, also what a dissector does below the duct
        below = np.array([[0.5 * span, -13.0, -1.7 * radius]])
        assert picture_points(view, below, aspect)[0, 1] > (0.26 if aspect < 0.5 else 0.1)


@pytest.mark.parametrize("numbers", [(0.0, 4.45, 1.3), (50.8, -1.0, 1.3), (50.8, 4.45, math.nan)])
def test_camera_refuses_impossible_numbers(numbers: tuple[float, float, float]) -> None:
    with pytest.raises(ValueError, match="must be positive"):
        viewpoint(*numbers)


@pytest.mark.parametrize("look", ["full", "plain"])
def test_stage_adds_and_removes_its_nodes(scene: viser.SceneApi, look: str) -> None:
    assert look in ("full", "plain")
    names = ("tissue_bed", "neighbours", "clamps/first", "clamps/second", "hook/instrument")
    for _ in range(2):  # a second stage can be built where the first was
        stage = Stage(
            scene,
            span=50.8,
            radius=4.45,
            appearance=BILE_DUCT,
            look="full" if look == "full" else "plain",
        )
        assert all(scene.get_handle_by_name(f"/stage/{name}") is not None for name in names)
        stage.remove()
        stage.remove()
        assert all(scene.get_handle_by_name(f"/stage/{name}") is None for name in names)


def test_stage_refuses_impossible_numbers(scene: viser.SceneApi) -> None:
    with pytest.raises(ValueError, match="span and radius"):
        Stage(scene, span=0.0, radius=4.45, appearance=BILE_DUCT)
    stage = Stage(scene, span=50.8, radius=4.45, appearance=BILE_DUCT, look="plain")
    with pytest.raises(ValueError, match="point must be"):
        stage.place_hook((0.0, math.inf, 0.0))


class PretendedCamera:
    """A browser's camera without a browser."""

    def __init__(self, aspect: float) -> None:
        self.aspect = aspect
        self.position = self.look_at = self.up_direction = np.zeros(3)
        self.fov = self.near = self.far = self.max_orbit_distance = 0.0


def test_framing_outlives_a_reset_and_a_new_shape_but_not_the_user(
    scene: viser.SceneApi, monkeypatch: pytest.MonkeyPatch
) -> None:
    now = [100.0]
    monkeypatch.setattr("app.trainer.stage.stage.time.monotonic", lambda: now[0])
    monkeypatch.setattr("app.trainer.stage.stage.keep_in_sight", lambda *_, **__: None)
    camera = PretendedCamera(1.6)
    client: Any = SimpleNamespace(camera=camera, atomic=nullcontext)
    stage = Stage(scene, span=50.8, radius=4.45, appearance=BILE_DUCT, look="plain")
    stage.frame_camera(client)
    np.testing.assert_allclose(camera.position, viewpoint(50.8, 4.45, 1.6).position)
    now[0] += 30.0  # a slow page
    camera.position = np.full(3, 3.0)  # the browser resets the camera after it connects
    stage.camera_moved(client)
    np.testing.assert_allclose(camera.position, viewpoint(50.8, 4.45, 1.6).position)
    stage.camera_moved(client)  # it is there
    now[0] += 2.0
    camera.position = np.full(3, 3.0)
    stage.camera_moved(client)
    np.testing.assert_allclose(camera.position, viewpoint(50.8, 4.45, 1.6).position)
    now[0] += 10.0
    camera.aspect = 0.6  # the window is turned
    stage.camera_moved(client)
    np.testing.assert_allclose(camera.position, viewpoint(50.8, 4.45, 0.6).position)
    stage.camera_moved(client)
    now[0] += 10.0
    assert stage.view(client) is None  # the standard view
    looked_from = np.array([0.0, -90.0, 40.0])
    camera.position = looked_from
    stage.camera_moved(client)
    seen = stage.view(client)
    np.testing.assert_array_equal(seen, [*(looked_from - camera.look_at), *looked_from])
    camera.aspect = 1.2
    stage.camera_moved(client)
    np.testing.assert_array_equal(camera.position, looked_from)
    # A page may be so slow that the reset comes after it seemed to have settled.
    camera.position, camera.look_at = OVERVIEW.position, OVERVIEW.look_at
    stage.camera_moved(client)
    np.testing.assert_allclose(camera.position, viewpoint(50.8, 4.45, 1.2).position)
    stage.camera_moved(client)  # it is there
    now[0] += 10.0
    stage.frame_camera(client)
    np.testing.assert_allclose(camera.position, viewpoint(50.8, 4.45, 1.2).position)
    stage.camera_moved(client)  # brought home by the user, who goes on at once
    now[0] += 0.5
    camera.position = looked_from
    stage.camera_moved(client)
    np.testing.assert_array_equal(camera.position, looked_from)
    stage.frame_camera(client)
    stage.remove()
    camera.aspect = 2.0
    stage.camera_moved(client)
    np.testing.assert_allclose(camera.position, viewpoint(50.8, 4.45, 1.2).position)


def test_files_are_built_once() -> None:
    assert tissue_bed_glb() is tissue_bed_glb()
    assert hook_glb(4.45) is hook_glb(4.45)


def test_noise_is_the_same_every_time() -> None:
    first, second = (smooth_noise((32, 48), cells=2.0, fall=2.0, seed=3) for _ in range(2))
    np.testing.assert_array_equal(first, second)
    assert first.shape == (32, 48)
    assert abs(float(first.mean()) - 0.5) < 0.02
