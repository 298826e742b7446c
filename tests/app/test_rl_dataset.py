"""Demonstrations as data sets: they replay to the bit, go on, and other readers take them."""

import importlib.util
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from PIL import Image
from program import refused
from simulated import phantom, replayed

from app.rl.dataset import make_dataset
from app.rl.demonstration import demonstrate
from app.rl.environment import DissectionEnv
from app.simulation import read_run

ROOT = Path(__file__).parents[2]
WINDOW = {"exercise": "window", "bed": "normal"}


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("data")
    summary = make_dataset(folder, "bluntdissect/window-v0", WINDOW, range(21, 24), tremor=0.1)
    assert summary["episodes"] == 3
    assert summary["passed"] == 3
    assert summary["errors"] == {}
    return folder


def episode(folder: Path, number: int) -> dict[str, np.ndarray]:
    """One episode as its file has it."""
    table = pq.read_table(folder / "data" / str(number) / "part-0.parquet")
    observed = table["observations"].combine_chunks()
    names = [each.name for each in observed.type]
    found = {name: np.stack(observed.field(name).to_numpy(zero_copy_only=False)) for name in names}
    return found | {
        "actions": np.stack(table["actions"].to_numpy()),
        "rewards": table["rewards"].to_numpy(),
        "over": table["terminations"].to_numpy() | table["truncations"].to_numpy(),
    }


def test_episodes_replay_from_their_files_to_the_bit(made: Path) -> None:
    env = DissectionEnv(**WINDOW)
    for number in range(3):
        about = json.loads((made / "data" / str(number) / "metadata.json").read_text())
        file = episode(made, number)
        observed, _ = env.reset(options=about["options"])
        for step in range(about["total_steps"]):
            for key, each in observed.items():
                assert np.array_equal(file[key][step], each.ravel()), (step, key)
            observed, reward, terminated, truncated, _ = env.step(file["actions"][step])
            assert reward == file["rewards"][step]
            assert (terminated or truncated) == file["over"][step]
        assert np.array_equal(file["strands"][-1], observed["strands"])
        kept = read_run((made / about["run"]).read_bytes())
        assert kept.metrics == env.run_file().metrics
        assert kept.log.inputs == env.run_file().log.inputs
        assert about["passed"]
        assert replayed(kept, phantom()).metrics == about["metrics"]


def test_lerobot_s_files_hold_the_same_frames(made: Path) -> None:
    root = made / "lerobot"
    info = json.loads((root / "meta/info.json").read_text())
    table = pq.read_table(root / "data/chunk-000/file-000.parquet")
    episodes = pq.read_table(root / "meta/episodes/chunk-000/file-000.parquet").to_pylist()
    assert info["codebase_version"] == "v3.0"
    assert info["total_frames"] == table.num_rows == sum(each["length"] for each in episodes)
    assert set(info["features"]) == set(table.column_names)
    for number, each in enumerate(episodes):
        start, end = each["dataset_from_index"], each["dataset_to_index"]
        file, rows = episode(made, number), table.slice(start, end - start)
        assert np.array_equal(np.stack(rows["action"].to_numpy()), file["actions"][:-1])
        state = np.stack(rows["observation.state"].to_numpy())
        wanted = [file[key][:-1] for key in ("hands", "wall", "goal")]
        assert np.array_equal(state, np.concatenate(wanted, axis=1))
        assert rows["next.done"].to_pylist() == [*[False] * (end - start - 1), True]
        seconds = np.arange(end - start) / info["fps"]
        assert rows["timestamp"].to_numpy() == pytest.approx(seconds, abs=1e-6)
        assert each["stats/action/max"] == pytest.approx(file["actions"][:-1].max(axis=0))


@pytest.mark.long  # a process is ended
def test_a_data_set_that_was_ended_goes_on(made: Path) -> None:
    kept, lost = (made / "data" / str(number) / "part-0.parquet" for number in (0, 2))
    before, again = kept.stat().st_mtime_ns, lost.read_bytes()
    lost.with_name("metadata.json").unlink()
    lost.write_bytes(b"half")
    make_dataset(made, "bluntdissect/window-v0", WINDOW, range(21, 24), tremor=0.1, workers=2)
    assert kept.stat().st_mtime_ns == before
    assert lost.read_bytes() == again
    with pytest.raises(ValueError, match=r"made otherwise \(algorithm_name\)"):
        make_dataset(made, "bluntdissect/window-v0", WINDOW, range(21, 24), tremor=0.2)


@pytest.mark.long
def test_a_dask_cluster_makes_the_same_files(made: Path, tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=2, processes=False, dashboard_address=None
    ) as cluster:
        make_dataset(
            tmp_path, "bluntdissect/window-v0", WINDOW, range(21, 24), tremor=0.1,
            scheduler=cluster.scheduler_address,
        )  # fmt: skip
    for number in range(3):
        for name in ("part-0.parquet", "metadata.json"):
            mine = tmp_path / "data" / str(number) / name
            assert mine.read_bytes() == (made / "data" / str(number) / name).read_bytes()


@pytest.mark.long
def test_the_example_judges_on_two_workers_as_here() -> None:
    pytest.importorskip("distributed")
    done = subprocess.run(
        [sys.executable, "examples/judge_on_workers.py", "--workers", "2", "--beds", "21-23"],
        cwd=ROOT, capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert done.stdout.startswith("3 of 3 beds passed; the same here: True\n")
    assert "on 2 workers" in done.stdout


@pytest.mark.long
def test_minari_s_own_reader_takes_it(made: Path) -> None:
    minari = pytest.importorskip("minari")
    found = minari.MinariDataset(made / "data")
    assert found.total_episodes == 3
    assert found.env_spec.kwargs["exercise"] == "window"
    for each in found:
        file = episode(made, each.id)
        assert np.array_equal(each.actions, file["actions"][:-1])
        assert np.array_equal(each.observations["strands"], file["strands"])
        assert each.terminations.tolist() == file["over"][:-1].tolist()


@pytest.mark.long
def test_lerobot_s_own_reader_takes_it(made: Path) -> None:
    datasets = pytest.importorskip("lerobot.datasets.lerobot_dataset")
    found = datasets.LeRobotDataset("bluntdissect/window", root=made / "lerobot")
    assert found.num_episodes == 3
    assert np.array_equal(found[5]["action"].numpy(), episode(made, 0)["actions"][5])


def test_the_example_learns_from_it_and_judges(
    made: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """On one bed, after a hundredth of its steps: it has learnt something, if not enough."""
    spec = importlib.util.spec_from_file_location("clone", ROOT / "examples" / "clone_window.py")
    assert spec is not None
    assert spec.loader is not None
    clone = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(clone)
    seen, done = clone.demonstrations(made)
    monkeypatch.setattr(clone, "STEPS", 300)
    learnt = clone.Network(seen, done)
    error = ((learnt.forward((seen - learnt.mean) / learnt.scale)[1] - done) ** 2).mean()
    assert error < 0.3 * done.var(axis=0).mean()
    monkeypatch.setattr(clone, "STEPS", 30)
    monkeypatch.setattr(clone, "UNSEEN", [21])
    monkeypatch.setattr(clone, "CURVE_STEPS", (0, 30))
    monkeypatch.setattr(clone, "CURVE_BEDS", [21])
    monkeypatch.setattr(sys, "argv", ["clone_window.py", str(made), "--curve", "curve.png"])
    monkeypatch.chdir(made)
    clone.main()
    lines = capsys.readouterr().out.splitlines()
    heads = [line.split(":")[0] for line in lines]
    assert heads == ["step 0", "step 30", "clone", "random", "scripted"]
    assert lines[0] == "step 0: 0 of 1 beds passed"
    assert (made / "clone.onnx").exists()
    assert lines[4].startswith("scripted: 1 of 1 beds passed, 1 without an error")
    with Image.open(made / "curve.png") as picture:
        assert picture.size == (960, 600)


@pytest.mark.parametrize("exercise", ["follow_front", "free_scar"])
def test_good_hands_pass_without_an_error_through_actions(exercise: str) -> None:
    env = DissectionEnv(exercise=exercise)
    shown = demonstrate(env, 21, tremor=0.1)
    assert env.episode is not None
    assert shown.terminated
    assert env.episode.info()["passed"]
    assert env.episode.info()["errors"] == 0
    assert np.abs(shown.actions).max() <= 1.0


def test_bad_orders_are_refused_in_one_line(tmp_path: Path) -> None:
    for words, message in (
        (("--seeds", "9-3"), "--seeds must be FIRST-LAST, such as 1-20, got 9-3"),
        (("--exercise", "knot"), "exercise must be one of 'window'"),
        (("--seeds", "1", "--manner", "rude"), "hands that are good, hasty, clumsy, got 'rude'"),
    ):
        assert message in refused(["dataset", "-o", tmp_path / "out", "--workers", 1, *words])
