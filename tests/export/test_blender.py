"""Blender: every kind of GLB opens, plays by its tracks, and shows what our own skinning gives.

A long test: Blender is a module of 370 MB for one version of Python, in an environment of its own,
which `make test-all` makes.
"""

import json
import os
import subprocess
from dataclasses import dataclass, replace

import numpy as np
import pytest
from other_programs import HERE, missing
from rigged import rigged, walls
from simulated import phantom
from test_bed_export import freed, model, torn_model
from test_bed_export import torn as apart
from test_recorded_run import VERTICES, again, played, recorded
from test_rigged_organ import SPECK

from app.export.recorded_run import RUN, rigged_runs
from app.simulation import PIECES, TICK_SECONDS
from app.simulation.specimen.drawn_duct import DrawnDuct

pytestmark = pytest.mark.long

ALL = ("organ", *PIECES)
OF_RADIUS = 1e-3
"""How near Blender's vertices must be to ours, in parts of the radius."""
LONGEST_BONE = 8e-3
"""m: less than the duct is thick."""


@dataclass(frozen=True)
class Seen:
    """What Blender shows of a file, turned back to y up."""

    report: dict
    places: dict[str, np.ndarray]

    def shown(self, animation: str) -> list[tuple[float, dict[str, np.ndarray]]]:
        """Each time that was looked at, s, and (V, 3) places of each mesh then, m."""
        return [
            (time, {name: self.places[f"{animation}/{number}/{name}"] for name in self.meshes})
            for number, time in enumerate(self.report["times"][animation])
        ]

    @property
    def meshes(self) -> list[str]:
        return sorted(name for name, kind in self.report["objects"].items() if kind == "MESH")


def size(places: np.ndarray) -> float:
    return float(np.ptp(places, axis=0).max())


@pytest.fixture(scope="module")
def seen(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Seen]:
    python = os.environ.get("BLENDER_PYTHON")
    if python is None:
        missing("no Python with bpy: run `make test-all`, or set BLENDER_PYTHON to one")

    folder = tmp_path_factory.mktemp("blender")
    order = rigged().order
    edge_length = DrawnDuct(phantom(), VERTICES).edge_length
    contents = {
        "duct": rigged().content,
        "far": rigged("porcine-bile-duct", exact=True).content,
        "still": replace(order, static=True).content(".glb"),
        "torn": replace(order, torn=True).content(".glb"),
        "stress": replace(order, stress_colors=True, force=2.0).content(".glb"),
        "run": rigged_runs([played(torn=True)], edge_length=edge_length),
        "let_go": rigged_runs([played(torn=False)], edge_length=edge_length),
        "free": freed().content(".glb"),
        "apart": apart().content(".glb"),
    }
    files = [folder / f"{name}.glb" for name in contents]
    for file, content in zip(files, contents.values(), strict=True):
        file.write_bytes(content)
    done = subprocess.run(
        [python, HERE / "blender_reader.py", folder, *files],
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )
    assert done.returncode == 0, done.stderr[-2000:]
    found: dict[str, Seen] = {}
    for name in contents:
        report = json.loads((folder / f"{name}.json").read_text())
        with np.load(folder / f"{name}.npz") as arrays:
            # x, z, -y: glTF has y up.
            places = {key: arrays[key][:, [0, 2, 1]] * (1, 1, -1) for key in arrays.files}
        found[name] = Seen(report, places)
    print(f"Blender {found['duct'].report['blender']}")
    return found


def largest(got: np.ndarray, wanted: list[np.ndarray]) -> float:
    return float(np.abs(got - np.concatenate(wanted)).max())


@pytest.mark.parametrize("name", ["duct", "far", "run", "let_go"])
def test_a_rig_is_chains_of_short_bones_with_their_meshes_and_nothing_else(
    seen: dict[str, Seen], name: str
) -> None:
    report = seen[name].report
    meshes = ["organ"] if name == "let_go" else list(ALL)
    rigs = {f"{mesh}_rig" for mesh in meshes}
    assert report["objects"] == {**dict.fromkeys(rigs, "ARMATURE"), **dict.fromkeys(meshes, "MESH")}
    assert {mesh: report["parents"][mesh] for mesh in meshes} == {
        mesh: f"{mesh}_rig" for mesh in meshes
    }
    assert all(other.startswith("Icosphere") for other in report["hidden"])  # the importer's own
    assert report["unit"] == ["METRIC", 1.0]
    for mesh in meshes:
        bones = report["armatures"][f"{mesh}_rig"]
        assert [bone["parent"] for bone in bones] == [None, *(bone["name"] for bone in bones[:-1])]
        assert [bone["name"] for bone in bones] == [
            f"{mesh}_anchor", *(f"{mesh}_joint_{number:03d}" for number in range(len(bones) - 1))
        ]  # fmt: skip
        assert all(1e-3 < bone["length"] < LONGEST_BONE for bone in bones)
    assert all(materials == ["outer wall", "inside"] for materials in report["materials"].values())


@pytest.mark.parametrize("name", ["duct", "far"])
def test_as_opened_the_organ_is_whole(seen: dict[str, Seen], name: str) -> None:
    places = seen[name].places
    assert size(places["opened/organ"]) == pytest.approx(1e-3 * phantom().length, rel=0.01)
    assert all(size(places[f"opened/{piece}"]) < SPECK for piece in PIECES)


def test_pull_lifts_the_whole_organ_by_what_the_theory_says_and_shows_no_piece(
    seen: dict[str, Seen],
) -> None:
    duct, order = rigged(), rigged().order
    pull = duct.motions[0]
    shown = seen["duct"].shown("pull")
    assert shown[-1][0] == pytest.approx(float(pull.times[-1]), abs=1e-6)
    for time, places in shown:
        assert all(size(places[piece]) < SPECK for piece in PIECES), time
        keys = np.flatnonzero(np.abs(pull.times - time) < 1e-6)
        for key in keys.tolist():
            wanted = duct.shown(pull, key)["organ"]
            assert largest(places["organ"], wanted) < OF_RADIUS * duct.radius, time
    event = order.break_event
    assert event is not None
    # The vertices nearest the grasp, at rest and under the break's force.
    rest, end = shown[0][1]["organ"], shown[-1][1]["organ"]
    near = np.abs(rest[:, 0] - 1e-3 * (order.dissection.clamps[0] + order.grasp)) < 8e-4
    assert near.sum() >= 20
    lift = 1e3 * float((end - rest)[near, 1].mean())
    assert lift == pytest.approx(event.deflection, rel=0.01)
    assert np.abs((end - rest)[:, 2]).max() < 1e-5  # straight up


@pytest.mark.parametrize(("name", "animation"), [("duct", "tear"), ("far", "tear"), ("run", RUN)])
def test_a_tear_shows_the_whole_and_then_two_pieces_apart(
    seen: dict[str, Seen], name: str, animation: str
) -> None:
    states: list[bool] = []
    for _, places in seen[name].shown(animation):
        whole = size(places["organ"]) > SPECK
        assert [size(places[piece]) > SPECK for piece in PIECES] == [not whole] * 2
        states.append(whole)
    assert states == sorted(states, reverse=True)
    assert states[0]
    assert not states[-1]
    last = seen[name].shown(animation)[-1][1]
    first, second = (last[piece][:, 0] for piece in PIECES)
    assert second.min() > first.max()


def test_the_end_of_a_tear_is_our_own(seen: dict[str, Seen]) -> None:
    duct = rigged()
    tear = duct.motions[1]
    time, places = seen["duct"].shown("tear")[-1]
    assert time == pytest.approx(float(tear.times[-1]), abs=1e-3)
    wanted = duct.shown(tear, len(tear.times) - 1)
    for piece in PIECES:
        assert largest(places[piece], wanted[piece]) < OF_RADIUS * duct.radius


def test_a_recorded_run_ends_as_the_session_drew_it(seen: dict[str, Seen]) -> None:
    session = again(torn=True).session
    again(torn=True).seek_tick(10**6)
    last = seen["run"].shown(RUN)[-1][1]
    radius = 1e-3 * phantom().mean_radius
    for surface in session.drawn.surfaces:
        drawn = walls(surface.skin, surface.vertices)
        assert largest(last[surface.name], drawn) < OF_RADIUS * radius
    seconds = recorded(torn=False).log.ticks * TICK_SECONDS
    assert seen["let_go"].shown(RUN)[-1][0] == pytest.approx(seconds, abs=1e-3)


@pytest.mark.parametrize(
    ("name", "meshes"), [("still", ["organ"]), ("torn", list(PIECES)), ("stress", ["organ"])]
)
def test_still_files_are_their_meshes_and_nothing_else(
    seen: dict[str, Seen], name: str, meshes: list[str]
) -> None:
    report, places = seen[name].report, seen[name].places
    assert report["objects"] == dict.fromkeys(meshes, "MESH")
    assert report["hidden"] == []
    assert report["times"] == {}
    if name == "still":
        assert np.array_equal(
            places["opened/organ"].astype(np.float32), np.concatenate(rigged().rest("organ"))
        )
    for mesh in meshes:
        assert bool(report["colors"][mesh]) is (name == "stress")
        across = np.ptp(places[f"opened/{mesh}"], axis=0)
        assert 2e-3 < across[0] < 0.06  # m


def test_a_duct_is_freed_from_its_bed_with_its_strands(seen: dict[str, Seen]) -> None:
    """One armature, two meshes and nothing else; both follow it and the strands part."""
    found = seen["free"]
    meshes = dict.fromkeys(("organ", "strands"), "MESH")
    assert found.report["objects"] == {"organ_rig": "ARMATURE", **meshes}
    assert found.report["materials"]["strands"] == ["strands"]
    shown = found.shown("free")
    assert len(shown) == 13
    for time, places in shown:
        for name, got in places.items():
            wanted = np.concatenate(model().vertices(name, "free", time))
            assert np.abs(got - wanted).max() < 1e-4 * rigged().radius, (name, time)


def test_a_duct_that_tears_in_its_bed_is_two_pieces_on_their_strands(seen: dict[str, Seen]) -> None:
    """An armature each for the organ, its pieces and the strands, and what is seen of each."""
    found, motion = seen["apart"], apart().motion
    meshes = (*ALL, "strands")
    assert found.report["objects"] == {
        **dict.fromkeys((f"{mesh}_rig" for mesh in meshes), "ARMATURE"),
        **dict.fromkeys(meshes, "MESH"),
    }
    tears = float(motion.times[motion.whole][-1])
    shown = found.shown("free")
    assert shown[0][0] < tears < shown[-1][0]
    for time, places in shown:
        for name, got in places.items():
            wanted = np.concatenate(torn_model().vertices(name, "free", time))
            assert np.abs(got - wanted).max() < OF_RADIUS * rigged().radius, (name, time)
        if abs(time - tears) > 0.05:
            for name in ALL:
                assert (size(places[name]) < SPECK) == ((name == "organ") == (time > tears))
