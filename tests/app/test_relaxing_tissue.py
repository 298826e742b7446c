"""Tissue that relaxes while it is held: presets, scenes, `solve --bed`, sessions and their runs."""

import json
import math
import re
from itertools import pairwise
from pathlib import Path

import msgspec
import numpy as np
import pytest
from program import refused, run
from simulated import phantom

from app.relaxation_preset import relaxation_named
from app.simulation import (
    FEW,
    Replay,
    RunFileError,
    Session,
    Specimen,
    bed_named,
    bed_presets,
    exercises_offered,
    preset_named,
    read_run,
    run_json,
)
from app.simulation.scripts.scripted_hands import Lift, perform
from physics.bed import Relaxation

SCENE = """
[beam]
span_mm = 60.0
elements = 40
axial_stiffness_N = 8.0
shear_stiffness_N = 50.0
bending_stiffness_N_mm2 = 1.5
torsion_stiffness_N_mm2 = 1.5

[bed]
strands = 60
stiffness_N_per_mm2 = 0.3
toughness_N = 0.12

[[hand]]
at_mm = 30.0
path_mm = [[0.0, 0.0, 0.6], [0.0, 0.0, 0.6]]
steps = [4, 10]
"""
DOCS = (Path(__file__).parents[2] / "docs" / "peel.md").read_text()
_, TIME, _ = re.findall(r"```text\n(.*?)```", DOCS, flags=re.DOTALL)


def test_areolar_tissue_relaxes_between_its_published_moduli() -> None:
    """4.77 kPa at once and 2.75 kPa in the end (Iatridis 2003)."""
    areolar = relaxation_named("areolar").made()
    assert areolar.stiffness(0.0) == 1.0
    assert 4.77 * areolar.stiffness(1e5) == pytest.approx(2.75, abs=0.005)
    for bed in bed_presets().values():
        assert bed.relaxation == "areolar"
    assert preset_named("thesis-rubber").relaxation is None


def test_a_scene_with_time_relaxes_while_its_hand_waits(tmp_path: Path) -> None:
    found = {}
    for name, time in (("at once", ""), ("timed", TIME.replace("0.5", "2.0"))):
        path = tmp_path / "scene.toml"
        path.write_text(SCENE + time)
        done = run("peel", path, "--json", "-o", tmp_path / f"{name}.csv")
        assert done.returncode == 0, done.stderr
        found[name] = json.loads(done.stdout)["steps"]
    assert [step["time_s"] for step in found["timed"]] == [2.0 * t for t in range(1, 15)]
    forces = [step["force_N"][2] for step in found["timed"]]
    assert all(b < a for a, b in pairwise(forces[3:]))
    assert forces[-1] < 0.85 * forces[3]
    gone = [step["viscous_mJ"] for step in found["timed"]]
    assert all(b > a for a, b in pairwise(gone))
    at_once = found["at once"]
    assert at_once[-1]["force_N"] == at_once[3]["force_N"]
    assert "time_s" not in at_once[0]
    head = (tmp_path / "timed.csv").read_text().splitlines()[0]
    assert head.endswith("snap_mJ,time_s,viscous_mJ")


@pytest.mark.parametrize(
    ("time", "message"),
    [
        ("step_s = 1.0", r"\[time\] needs strands or wall"),
        ('step_s = 0.0\nstrands = "areolar"', r"step_s of \[time\] must be above 0 s"),
        (
            'step_s = 1.0\nstrands = "tar"',
            "unknown relaxation 'tar'; there are: areolar, tube-wall",
        ),
        (
            "step_s = 1.0\nwall = { fractions = [0.5], times_s = [20.0] }",
            "a relaxation of 20 s is longer than the run of 14 s",
        ),
        (
            "step_s = 1.0\nwall = { fractions = [0.5, 0.6], times_s = [1.0, 2.0] }",
            "fractions of a relaxation must sum to less than 1, got 1.1",
        ),
        (
            "step_s = 1.0\nwall = { fractions = [0.5], times_s = [-2.0] }",
            "a time of a relaxation must be above 0 s, got -2",
        ),
    ],
)
def test_an_impossible_time_is_one_sentence(tmp_path: Path, time: str, message: str) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(f"{SCENE}\n[time]\n{time}\n")
    refusal = refused(["peel", path])
    assert re.search(message, refusal), refusal


def test_a_duct_that_is_held_in_its_bed_comes_back_from_its_break() -> None:
    path = "--bed", "firm", "--hook", 31, "--lift", 4, "--steps", 10, "--elements", 24, "--json"
    found = []
    for options in ((), ("--step-seconds", 0.5, "--hold", 10)):
        done = run("solve", *path, *options)
        assert done.returncode == 0, done.stderr
        found.append(json.loads(done.stdout))
    still, held = found
    assert len(still["steps"]) == 10
    assert len(held["steps"]) == 30
    left = [step["distance_to_break_percent"] for step in held["steps"][9:]]
    assert all(b > a for a, b in pairwise(left))
    before = re.search(r"before the hold: \S+ N, distance to break (\S+) %", held["notes"][-1])
    assert before is not None
    assert float(before[1]) == pytest.approx(left[0], abs=0.005)
    for wrong, message in (
        (("--hold", 10), "--hold goes with --lift and --step-seconds"),
        (("--until", 100), "--until goes with --lift and must be above 0 and below 100 %"),
        (("--step-seconds", -1), "--step-seconds must be above 0 s"),
    ):
        assert message in refused(["solve", *path, *wrong])


def test_a_lift_ends_at_a_distance_to_break_and_is_held_there() -> None:
    """The table of theory.md: a wait of 10 s, here in a coarser bed."""
    of_bed = ["--bed", "firm", "--preset", "thesis-bile-duct", "--elements", 24, "--strands", 200]
    lift = ["--lift", 30, "--steps", 150, "--until", 40, "--step-seconds", 0.1, "--hold", 10]
    steps = json.loads(run("solve", *of_bed, *lift, "--json").stdout)["steps"]
    left = [step["distance_to_break_percent"] for step in steps]
    lifted = len(steps) - 100
    assert left[lifted - 1] == pytest.approx(40.0, abs=0.01)
    assert steps[lifted]["hand_mm"] == steps[-1]["hand_mm"] == steps[lifted - 1]["hand_mm"]
    assert left[-1] == pytest.approx(45.9, abs=1.0)
    highest = [step["highest_at_mm"] for step in steps]
    assert highest[-1] == pytest.approx(25.4, abs=0.5)  # at the hook


def bits(session: Session) -> bytes:
    beam = session.spatial.beam
    return beam.places.tobytes() + beam.damage.tobytes() + repr(beam.energy).encode()


@pytest.mark.parametrize("relaxation", [False, True])
def test_a_run_plays_again_as_it_relaxed(relaxation: bool) -> None:
    """Runs have the constants that they were made with; without any nothing relaxes."""
    specimen = Specimen(
        preset_named("thesis-bile-duct"), phantom(), bed_named("normal"), relaxation=relaxation
    )
    session = Session(specimen, vertices=300)
    start = session.grab(0, 25.0)
    assert start is not None
    for tick in range(40):
        session.move_hand(0, start + np.array([0.0, 0.0, 0.1 * tick]))
        session.advance()
    pulled, used = session.reading().force, session.reading().stress_ratio
    for _ in range(150):
        session.advance()
    after = session.reading()
    if relaxation:
        assert after.force < 0.97 * pulled
        assert after.stress_ratio < 0.98 * used
        assert after.energy.viscous > 0.0
    else:
        assert after.energy.viscous == 0.0
    session.finish()
    content = run_json(session.run_file())
    start_of = json.loads(content)["log"]["start"]
    assert (start_of["strand_relaxation"] is not None) == relaxation
    again = Replay(read_run(content).log, phantom(), vertices=300)
    again.seek_tick(again.log.ticks)
    assert bits(again.session) == bits(session)


def test_an_anatomy_relaxes_as_its_layers_and_walls_do_and_plays_again(tmp_path: Path) -> None:
    """Drawn out and held for 10 s by `perform`; without `--relax` nothing falls."""
    script = tmp_path / "hold.toml"
    script.write_text("""
step = [
  { do = "take", instrument = "grasper" },
  { do = "grab", tube = "gallbladder", at_mm = 8.0 },
  { do = "lead", by_mm = [1.0, 3.4, 3.1], speed_mm_per_s = 8 },
  { do = "wait", seconds = 10 },
]
""")
    found = {}
    for options in ((), ("--relax",)):
        output = tmp_path / f"run{len(options)}.json"
        run("perform", script, "-o", output, *options)
        replay = Replay(read_run(output.read_bytes()).log, phantom(), vertices=FEW)
        relaxing = replay.session.spatial.specimen.relaxing()
        wanted = relaxation_named("areolar").made(), relaxation_named("tube-wall").made()
        assert relaxing == (wanted if options else (None, None))
        replay.seek_tick(replay.log.ticks - 299)
        before = replay.session.reading()
        replay.seek_tick(replay.log.ticks)
        after = replay.session.reading()
        assert run_json(replay.run_file()) == output.read_bytes()
        assert abs(after.energy.residual) < 1e-4 * after.energy.work
        found[options] = after.force / before.force, after.stress_ratio / before.stress_ratio
        assert (after.energy.viscous > 0.0) == bool(options)
    assert found[()] == pytest.approx((1.0, 1.0), abs=1e-3)
    assert max(found["--relax",]) < 0.93


def test_exercises_say_whether_tissue_relaxes_in_them_and_practice_goes_on_as_before() -> None:
    specimen = Specimen(
        preset_named("thesis-bile-duct"), phantom(), bed_named("normal"), relaxation=True
    )
    session = Session(specimen, vertices=300)

    def fall() -> float:
        """Fall of the force in 5 s of holding, over the force."""
        start = session.grab(0, 25.0)
        assert start is not None
        session.move_hand(0, start + np.array([0.0, 0.0, 1.0]))
        session.advance(30)
        before = session.reading().force
        session.advance(150)
        return 1.0 - session.reading().force / before

    free = fall()
    assert free > 0.03
    for relaxes in (False, True):
        window = exercises_offered(session, relaxes=relaxes)[0]
        session.start_exercise(window)
        found = fall()
        assert found == pytest.approx(free, rel=0.02) if relaxes else abs(found) < 1e-3
        start = session.run_file().log.start
        assert (start.wall_relaxation is not None) is relaxes
        perform(session, Lift())
        run = session.run_file()
        assert Replay(run.log, phantom(), vertices=300).run_file() == run
    session.reset()
    assert fall() == free


def test_tissue_that_is_held_goes_on_until_it_has_relaxed() -> None:
    """Nodes of a duct that is held hardly move, while its force still falls."""
    quick = Relaxation((0.3,), (0.5,))
    session = Session(
        Specimen(preset_named("thesis-bile-duct"), phantom(), relaxation=(None, quick)),
        vertices=300,
    )
    start = session.grab(0, 25.0)
    assert start is not None
    session.move_hand(0, start + np.array([0.0, 0.0, 6.0]))
    ticks = next(tick for tick in range(3000) if not session.advance())
    assert ticks > 5 * 0.5 * 30
    held = session.reading().force
    for _ in range(300):
        session.spatial.beam.tick(1.0 / 30.0, ticks=8)
    beam = session.spatial.beam
    node = session.spatial.hands[0].node
    assert node is not None
    assert math.hypot(*beam.hand_force(node)) == pytest.approx(held, rel=1e-3)


def test_a_run_with_an_impossible_relaxation_is_refused() -> None:
    session = Session(Specimen(preset_named("thesis-bile-duct"), phantom(), bed_named("normal")))
    session.grab(0, 25.0)
    session.advance()
    session.finish()
    tree = msgspec.json.decode(run_json(session.run_file()))
    tree["log"]["start"]["wall_relaxation"] = {"fractions": [0.7, 0.7], "times_s": [1.0, 2.0]}
    with pytest.raises(RunFileError, match="fractions of a relaxation must sum to less than 1"):
        read_run(msgspec.json.encode(tree))
