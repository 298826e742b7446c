"""Rigged organs: what a viewer shows at each key is what our own skinning gives."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from gltf_reader import Gltf
from other_programs import three_viewer, validated
from rigged import Rigged, keys_to_see, rigged

from app.export.motion import Motion, MotionKey
from app.export.rigged_organ import LEAD, rigged_organ
from app.simulation import PIECES
from organ_geometry.mesh.gltf_file import metres

OF_RADIUS = 1e-4
"""How near a viewer's vertices must be to ours, in parts of the organ's radius."""
SPECK = 1e-6
"""Size of a mesh that is hidden, m: a thousandth of what the eye sees of a duct on a screen."""
KINDS = [("thesis-bile-duct", False), ("porcine-bile-duct", True)]


@pytest.fixture(params=KINDS, ids=[preset for preset, _ in KINDS])
def duct(request: pytest.FixtureRequest) -> Rigged:
    return rigged(*request.param)


def largest(got: list[np.ndarray], wanted: list[np.ndarray]) -> float:
    return max(float(np.abs(a - b).max()) for a, b in zip(got, wanted, strict=True))


def size(places: list[np.ndarray]) -> float:
    return float(np.ptp(np.concatenate(places), axis=0).max())


def test_rest_is_the_still_mesh_to_the_bit(duct: Rigged) -> None:
    gltf = Gltf(duct.content)
    for name in ("organ", *PIECES):
        for primitive, wanted in zip(gltf.primitives(name), duct.rest(name), strict=True):
            stored = gltf.array(primitive["attributes"]["POSITION"])
            assert np.array_equal(stored, wanted)
    # Joints at 50 mm in single precision: 3e-9 m.
    assert largest(gltf.vertices("organ"), duct.rest("organ")) < 1e-5 * duct.radius


@pytest.mark.parametrize("name", ["organ", *PIECES])
def test_every_mesh_is_closed(duct: Rigged, name: str) -> None:
    gltf = Gltf(duct.content)
    places: list[np.ndarray] = []
    faces: list[np.ndarray] = []
    before = 0
    for primitive in gltf.primitives(name):
        places.append(gltf.array(primitive["attributes"]["POSITION"]))
        faces.append(gltf.array(primitive["indices"]).reshape(-1, 3) + before)
        before += len(places[-1])
    points, same = np.unique(np.concatenate(places), axis=0, return_inverse=True)
    closed = trimesh.Trimesh(points, same[np.concatenate(faces)], process=False)
    assert closed.is_watertight
    assert closed.is_winding_consistent
    skin = duct.skin if name == "organ" else duct.pieces[PIECES.index(name)].skin
    ours = trimesh.Trimesh(skin.vertices, skin.faces, process=False)
    assert closed.volume == pytest.approx(1e-9 * ours.volume, rel=1e-4)


def test_pieces_share_no_vertex_with_each_other_or_the_whole(duct: Rigged) -> None:
    gltf = Gltf(duct.content)
    used = [
        primitive["attributes"]["POSITION"]
        for name in ("organ", *PIECES)
        for primitive in gltf.primitives(name)
    ]
    assert len(set(used)) == len(used) == 6
    # The torn rims are at one place, yet have faces of their own that close them.
    first, second = (np.concatenate(duct.rest(name)) for name in PIECES)
    shared = {tuple(row) for row in first.tolist()} & {tuple(row) for row in second.tolist()}
    assert len(shared) >= 24


def test_at_most_four_joints_with_weights_of_one_in_all(duct: Rigged) -> None:
    gltf = Gltf(duct.content)
    for name in ("organ", *PIECES):
        node = gltf.tree["nodes"][gltf.node(name)]
        joints = len(gltf.tree["skins"][node["skin"]]["joints"])
        for primitive in gltf.primitives(name):
            attributes = primitive["attributes"]
            assert "JOINTS_1" not in attributes
            weights = gltf.array(attributes["WEIGHTS_0"])
            assert weights.sum(axis=1) == pytest.approx(1.0, abs=1e-12)
            assert gltf.array(attributes["JOINTS_0"]).max() == joints - 1


def test_joints_are_a_chain_from_clamp_to_clamp_or_to_the_tear(duct: Rigged) -> None:
    gltf = Gltf(duct.content)
    dissection = duct.order.dissection
    positions = metres(dissection.driving.positions)
    clamps = np.searchsorted(dissection.driving.stations, dissection.clamps).tolist()
    for name in ("organ", *PIECES):
        skin = gltf.tree["skins"][gltf.tree["nodes"][gltf.node(name)]["skin"]]
        assert all(
            gltf.parents[child] == joint
            for joint, child in zip(skin["joints"], skin["joints"][1:], strict=False)
        )
        steps = [
            gltf.tree["nodes"][joint].get("translation", (0.0,) * 3) for joint in skin["joints"]
        ]
        places = np.cumsum(steps, axis=0)
        binds = gltf.array(skin["inverseBindMatrices"]).reshape(-1, 4, 4).swapaxes(1, 2)
        assert np.array_equal(binds[:, :3, :3], np.tile(np.eye(3), (len(places), 1, 1)))
        assert binds[:, :3, 3] == pytest.approx(-places, abs=1e-8)
        count = len(places) - 1  # less the anchor
        start = clamps[1] - count + 1 if name == "second_piece" else clamps[0]
        wanted = positions[start : start + count]
        wanted = wanted[::-1] if name == "second_piece" else wanted
        assert places[1:] == pytest.approx(wanted, abs=1e-8)
        assert np.linalg.norm(places[1] - places[0]) == pytest.approx(1e-3 * LEAD, rel=1e-4)
        if name == "organ":
            assert count == clamps[1] - clamps[0] + 1


def test_each_key_is_our_own_skinning(duct: Rigged) -> None:
    gltf = Gltf(duct.content)
    for motion in duct.motions:
        assert gltf.duration(motion.name) == pytest.approx(motion.times[-1])
        for key in keys_to_see(motion):
            seen = duct.shown(motion, key)
            time = float(np.float32(motion.times[key]))
            for name in ("organ", *PIECES):
                got = gltf.vertices(name, motion.name, time)
                if name in seen:
                    assert largest(got, seen[name]) < OF_RADIUS * duct.radius
                else:
                    assert size(got) < SPECK


def test_shapes_of_a_rim_are_shown_in_parts_from_nothing_to_all(duct: Rigged) -> None:
    gltf = Gltf(duct.content)
    weights = [
        gltf.array(animation["samplers"][channel["sampler"]]["output"])
        for animation in gltf.tree["animations"]
        for channel in animation["channels"]
        if channel["target"]["path"] == "weights"
    ]
    assert len(weights) == len(PIECES)
    assert all(each.min() >= 0.0 and each.max() <= 1.0 for each in weights)


def test_pieces_take_over_in_the_pose_that_the_whole_one_broke_in(duct: Rigged) -> None:
    _, tear = duct.motions
    last = int(np.flatnonzero(tear.whole)[-1])
    assert tear.times[last] == tear.times[last + 1]
    assert tear.fronts[last + 1] == 0.0
    assert tear.transforms[last + 1] == pytest.approx(tear.transforms[last], abs=1e-12)
    assert np.array_equal(tear.transforms[-1], np.zeros_like(tear.transforms[-1]))


def test_pull_ends_under_the_force_that_is_given() -> None:
    duct = rigged()
    pull, _ = duct.motions
    dissection, event = duct.order.dissection, duct.order.break_event
    assert event is not None
    driving = dissection.driving
    at = int(np.argmin(np.abs(dissection.beam_stations - duct.order.grasp)))
    lift = pull.transforms[-1, at] @ np.append(driving.positions[at], 1.0) @ dissection.frame[:, 2]
    pulled = (
        duct.order.theory.pull(dissection.beam, duct.order.grasp)
        .to_force(event.force)
        .sample(dissection.beam_stations)
    )
    assert lift == pytest.approx(pulled.across[at], rel=1e-9)
    assert not pull.transforms[0].any()


def test_a_recorded_series_is_exported_the_same_way() -> None:
    duct = rigged()
    tear = duct.motions[1]
    keys = [
        MotionKey(float(time), transforms, reading, float(front))
        for time, transforms, reading, front in zip(
            tear.times, tear.transforms, tear.readings, tear.fronts, strict=True
        )
    ]
    again = Motion.of("tear", keys)
    content = rigged_organ(
        duct.skin,
        duct.order.dissection.driving,
        [duct.motions[0], again],
        duct.pieces,
        radius=duct.order.dissection.organ.mean_radius,
    )
    assert content == duct.content


def test_a_reset_makes_the_organ_whole_again() -> None:
    """A recorded run may go from whole to torn and back."""
    duct = rigged()
    tear = duct.motions[1]
    rest = np.zeros_like(tear.transforms[0])
    first, last = tear.readings[0], tear.readings[-1]
    keys = [
        MotionKey(0.0, rest, first),
        MotionKey(1.0, tear.transforms[-1], last, 2.0),
        MotionKey(2.0, rest, first),
    ]
    gltf = Gltf(
        rigged_organ(
            duct.skin,
            duct.order.dissection.driving,
            [Motion.of("run", keys)],
            duct.pieces,
            radius=1e3 * duct.radius,
        )
    )
    for time, whole in ((0.0, True), (0.9, True), (1.0, False), (1.9, False), (2.0, True)):
        assert (size(gltf.vertices("organ", "run", time)) > 0.005) is whole
        assert (size(gltf.vertices(PIECES[0], "run", time)) > 0.005) is not whole


def test_a_motion_that_is_not_rigid_or_lacks_its_pieces_is_refused() -> None:
    duct = rigged()
    driving = duct.order.dissection.driving
    stretched = duct.motions[0].transforms[0].copy()
    stretched[3, 0, 0] = 0.1
    key = MotionKey(0.0, stretched, duct.motions[0].readings[0])
    with pytest.raises(ValueError, match="must be rigid"):
        rigged_organ(duct.skin, driving, [Motion.of("pull", [key])], radius=4.0)
    with pytest.raises(ValueError, match="pieces are not given"):
        rigged_organ(duct.skin, driving, duct.motions, radius=4.0)
    with pytest.raises(ValueError, match="must grow"):
        Motion.of("pull", [key, key])
    with pytest.raises(ValueError, match="no key"):
        Motion.of("pull", [])


def test_khronos_finds_nothing_to_say(tmp_path: Path) -> None:
    paths: list[Path] = []
    for number, kind in enumerate(KINDS):
        paths.append(tmp_path / f"duct_{number}.glb")
        paths[-1].write_bytes(rigged(*kind).content)
    order = rigged().order
    for name, wanted in (
        ("still", replace(order, static=True)),
        ("torn", replace(order, torn=True)),
        ("colored", replace(order, stress_colors=True, force=2.0)),
    ):
        paths.append(tmp_path / f"{name}.glb")
        wanted.write(paths[-1])
    for path, report in zip(paths, validated(*paths), strict=True):
        assert report["issues"]["messages"] == [], (path.name, report["issues"])
        assert report["issues"]["numErrors"] == report["issues"]["numWarnings"] == 0
        assert report["info"]["totalTriangleCount"]


def test_three_js_plays_what_our_own_skinning_gives() -> None:
    duct = rigged()
    with three_viewer(duct.content) as viewer:
        assert viewer.clips == pytest.approx(
            {motion.name: float(motion.times[-1]) for motion in duct.motions}
        )
        for motion in duct.motions:
            for key in keys_to_see(motion)[:: 1 if motion.name == "pull" else 3]:
                found = viewer.places(motion.name, float(np.float32(motion.times[key])))
                seen = duct.shown(motion, key)
                assert found.keys() == {"organ", *PIECES}
                for name, places in found.items():
                    if name in seen:
                        assert largest([places], [np.concatenate(seen[name])]) < (
                            OF_RADIUS * duct.radius
                        )
                    else:
                        assert size([places]) < SPECK
