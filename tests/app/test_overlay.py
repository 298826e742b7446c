"""What is drawn over the duct follows it, and is hidden until it is wanted."""

import numpy as np
import viser
from simulated import phantom, pull_session

from app.trainer.scene.comparison_meshes import ChainLines, GhostMesh
from app.trainer.scene.force_arrow import ForceArrow
from app.trainer.scene.overlay import CLEAR, KEY_POINTS_OF_A_SECTION, Overlay

SINGLE = 1e-4
"""mm: what float32 leaves of some 50 mm."""
PULL = np.array([0.0, 0.0, 1.0])


def node(scene: viser.SceneApi, name: str) -> viser.SceneNodeHandle:
    handle = scene.get_handle_by_name(name)
    assert handle is not None
    return handle


def test_overlay_lies_on_the_kept_sections_and_follows_the_driving_points(
    scene: viser.SceneApi,
) -> None:
    dissection = pull_session(phantom()).tissue.dissection
    organ, driving = dissection.organ, dissection.driving
    overlay = Overlay(scene, organ, driving)
    points = node(scene, "/organ/overlay/key_points")
    lines = node(scene, "/organ/overlay/sections")
    amber = node(scene, "/organ/overlay/driving_points")
    assert isinstance(points, viser.PointCloudHandle)
    assert isinstance(lines, viser.LineSegmentsHandle)
    assert isinstance(amber, viser.PointCloudHandle)
    assert not (points.visible)
    assert not (lines.visible)
    assert not (amber.visible)
    assert not (overlay.visible)
    overlay.visible = True
    assert points.visible
    assert lines.visible
    assert amber.visible

    at_rest = points.points.copy()
    assert len(at_rest) == KEY_POINTS_OF_A_SECTION * len(organ.key_stations)
    sections = np.repeat(organ.key_stations, KEY_POINTS_OF_A_SECTION)
    # Off the wall by as much as they are lifted, in the planes of their sections.
    axis = organ.axis_at(sections)
    wall = np.linalg.norm(at_rest - axis, axis=1) - CLEAR
    assert np.abs(wall / organ.mean_radius - 1.0).max() < 0.15
    np.testing.assert_allclose(lines.points[:, 1][:-1][::40], lines.points[:, 0][1:][::40])

    shift = np.array([0.4, -0.2, 3.0])
    transforms = np.zeros((driving.stations.size, 3, 4))
    transforms[:, :, 3] = shift
    before = amber.points.copy()
    overlay.show(transforms, PULL)
    np.testing.assert_allclose(
        points.points - at_rest, np.tile(shift, (len(at_rest), 1)), atol=SINGLE
    )
    np.testing.assert_allclose(amber.points - before, np.tile(shift, (len(before), 1)), atol=SINGLE)
    overlay.remove()
    assert scene.get_handle_by_name("/organ/overlay/key_points") is None


def test_force_arrow_stands_on_its_foot_along_the_force_with_its_number(
    scene: viser.SceneApi,
) -> None:
    arrow = ForceArrow(scene, 50.0, "/organ/force_0")
    drawn, label = node(scene, "/organ/force_0"), node(scene, "/organ/force_0_label")
    assert isinstance(drawn, viser.ArrowsHandle)
    assert isinstance(label, viser.LabelHandle)
    foot, tip = np.array([20.0, 0.0, 4.0]), np.array([20.0, 0.0, 9.0])
    arrow.show(foot, 2.0 * PULL, at_break=4.0)
    assert not drawn.visible
    arrow.visible = True
    arrow.show(foot, 2.0 * PULL, at_break=4.0)
    assert drawn.visible
    np.testing.assert_allclose(drawn.points, [[foot, tip]], atol=SINGLE)
    assert label.text == "2.00 N"
    np.testing.assert_allclose(label.position, tip)
    arrow.show(foot, 0.0 * PULL, at_break=4.0)
    assert not drawn.visible
    assert not label.visible


def test_ghost_and_chain_show_what_they_are_given(scene: viser.SceneApi) -> None:
    skin = pull_session(phantom()).drawn.surfaces[0].skin
    ghost, chain = GhostMesh(scene, skin), ChainLines(scene, 5)
    mesh, nodes = node(scene, "/organ/ghost"), node(scene, "/organ/chain/nodes")
    links = node(scene, "/organ/chain/links")
    assert isinstance(mesh, viser.MeshHandle)
    assert isinstance(nodes, viser.PointCloudHandle)
    assert isinstance(links, viser.LineSegmentsHandle)
    assert not (ghost.visible)
    assert not (mesh.visible)
    assert not (chain.visible)
    assert not (nodes.visible)
    assert not (links.visible)
    moved = skin.vertices + np.float32(1.5)
    ghost.show(moved)
    np.testing.assert_array_equal(mesh.vertices, moved[: len(mesh.vertices)])
    assert int(mesh.faces.max()) == len(mesh.vertices) - 1
    places = np.arange(15.0).reshape(5, 3)
    chain.show(places)
    np.testing.assert_array_equal(nodes.points, places)
    np.testing.assert_array_equal(links.points[:, 0], places[:-1])
    np.testing.assert_array_equal(links.points[:, 1], places[1:])
