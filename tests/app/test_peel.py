"""`bluntdissect peel`, and `solve --bed`: scenes, what they answer, and wrong ones."""

import csv
import json
import math
import re
from pathlib import Path

import numpy as np
import pytest
from program import refused, run

from app.bed_preset import bed_presets
from app.command_line.bed_options import BED_NAMES
from app.peel import read_scene
from app.peel.tables import (
    BeamTable,
    BedTable,
    FluidTable,
    HandTable,
    JoinTable,
    LayerTable,
    RodTable,
    StrandTable,
    TimeTable,
    TubeTable,
)

ROOT = Path(__file__).parents[2]
DOCS = (ROOT / "docs" / "peel.md").read_text()

BEAM = """
[beam]
span_mm = 60.0
elements = 60
ends = ["clamped", "free"]
axial_stiffness_N = 8.0
shear_stiffness_N = 50.0
bending_stiffness_N_mm2 = 1.5
torsion_stiffness_N_mm2 = 1.5
"""
BED = """
[bed]
to_mm = 45.0
strands = 90
stiffness_N_per_mm2 = 0.3
toughness_N = 0.12
"""
HAND = """
[[hand]]
at_mm = 60.0
path_mm = [[0.0, 0.0, 0.0], [0.0, 0.0, 12.0]]
steps = 12
"""
ROW = {
    "hand_mm",
    "force_N",
    "freed_mm",
    "strands_broken",
    "work_mJ",
    "stored_mJ",
    "dissipated_mJ",
    "snap_mJ",
}


def scene(folder: Path, *sections: str) -> Path:
    path = folder / "scene.toml"
    path.write_text("\n".join(sections))
    return path


def peeled(path: Path, *options: object) -> dict:
    done = run("peel", path, "--json", *options)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    return json.loads(done.stdout)


def test_the_scene_of_the_docs_and_its_history(tmp_path: Path) -> None:
    (example,) = re.findall(r"```toml\n(.*?)```", DOCS, flags=re.DOTALL)
    assert example == (ROOT / "assets" / "peel_scene.toml").read_text()
    # Its first fifth, coarser: the whole takes longer than a test should.
    example = example.replace("elements = 240", "elements = 120").replace("40.0]]", "8.0]]")
    example = example.replace("strands = 480", "strands = 240").replace("steps = 400", "steps = 16")
    table = tmp_path / "history.csv"
    found = peeled(scene(tmp_path, example), "-o", table)
    steps = found["steps"]
    assert [set(step) for step in steps] == [ROW] * 15 + [ROW | {"shape_mm"}]
    last = steps[-1]
    assert last["hand_mm"] == [0.0, 0.0, 8.0]
    assert np.shape(last["shape_mm"]) == (121, 3)
    assert last["shape_mm"][-1] == [160.0, 0.0, 8.0]
    sums = [s["stored_mJ"] + s["dissipated_mJ"] + s["snap_mJ"] - s["work_mJ"] for s in steps]
    assert np.abs(sums).max() <= 1e-4 * last["work_mJ"]
    assert found["residual_ratio"] == pytest.approx(np.abs(sums).max() / last["work_mJ"], rel=1e-6)
    with table.open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 16
    assert float(rows[-1]["force_z_N"]) == last["force_N"][2]
    assert float(rows[-1]["work_mJ"]) == last["work_mJ"]


def test_every_field_is_in_the_docs() -> None:
    for table in (
        BeamTable, BedTable, HandTable, RodTable, StrandTable, TubeTable, JoinTable, LayerTable,
        FluidTable, TimeTable,
    ):  # fmt: skip
        for field in table.__struct_fields__:
            assert f"`{field}`" in DOCS or f"`{field} =" in DOCS, field


def test_presets_patches_hands_and_strands_together(tmp_path: Path) -> None:
    path = scene(
        tmp_path,
        """
        [beam]
        axis_mm = [[0, 0, 0], [15, 2, 0], [30, 3, 1], [45, 2, 0], [60, 0, 0]]
        elements = 48
        diameter_mm = 6.0
        modulus_MPa = 0.3
        break_stress_MPa = 0.2
        ends = ["clamped", "pinned"]
        [[bed]]
        preset = "firm"
        seed = 3
        to_mm = 25.0
        [[bed]]
        from_mm = 30.0
        to_mm = 55.0
        strands = 60
        stations_mm = [30.0, 55.0]
        stiffness_N_per_mm2 = [0.1, 0.2]
        toughness_N = [0.1, 0.2]
        fan_deg = 10.0
        [[bed.patch]]
        from_mm = 40.0
        to_mm = 45.0
        factor = 4.0
        [[strand]]
        at_mm = 27.0
        stiffness_N_per_mm = 0.2
        strength_N = 0.1
        [[hand]]
        at_mm = 20.0
        path_mm = [[0.0, 1.0, 3.0]]
        steps = 3
        [[hand]]
        at_mm = 40.0
        path_N = [[0.0, 0.0, 0.5]]
        steps = 2
        from_step = 2
        """,
    )
    found = peeled(path)
    assert len(found["steps"]) == 4
    first, last = found["steps"][0], found["steps"][-1]
    assert first["hands"][1] == {"hand_mm": None, "force_N": None}
    assert last["hands"][1]["force_N"] == [0.0, 0.0, 0.5]
    assert last["hand_mm"] == pytest.approx([0.0, 1.0, 3.0], abs=1e-9)
    assert 0.0 < last["distance_to_break_percent"] < first["distance_to_break_percent"] <= 100.0
    assert found["least_distance_to_break_percent"] <= last["distance_to_break_percent"]
    assert found["residual_ratio"] < 1e-4


def test_strands_of_a_bilateral_preset_push_as_they_pull(tmp_path: Path) -> None:
    bed = """
        [bed]
        preset = "firm"
        bilateral = true
        slack_mm = 0.0
        floor_N_per_mm2 = 0.0
        around_deg = 0.0
        fan_deg = 0.0
        """
    up, down = (
        peeled(scene(tmp_path, BEAM, bed, HAND.replace("12.0", far).replace("= 12", "= 1")))
        for far in ("0.001", "-0.001")
    )
    force = up["steps"][-1]["force_N"][2]
    assert force > 1e-5
    assert down["steps"][-1]["force_N"][2] == pytest.approx(-force, rel=1e-3)


@pytest.mark.parametrize("at", [47.1238, 47.1239, 47.13])
def test_the_end_of_an_arc_is_held_by_its_length_to_some_digits(tmp_path: Path, at: float) -> None:
    """A quarter circle pressed out of its plane: P R^3 (pi / 4 EI + (3 pi - 8) / 4 GJ)."""
    angles = np.linspace(0.0, 0.5 * math.pi, 9)
    points = [[30.0 * math.sin(a), 30.0 * (1.0 - math.cos(a)), 0.0] for a in angles.tolist()]
    beam = f"""
        [beam]
        axis_mm = {points}
        elements = 120
        ends = ["clamped", "free"]
        axial_stiffness_N = 1e5
        shear_stiffness_N = 1e7
        bending_stiffness_N_mm2 = 80.0
        torsion_stiffness_N_mm2 = 30.0
        """
    push = f"[[hand]]\nat_mm = {at}\npath_N = [[0.0, 0.0, 1e-5]]\nsteps = 1\n"
    (step,) = peeled(scene(tmp_path, beam, push))["steps"]
    expected = 1e-5 * 30.0**3 * (math.pi / 320.0 + (3.0 * math.pi - 8.0) / 120.0)
    assert step["hand_mm"][2] == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize(
    ("sections", "output"),
    [
        ((BEAM, BED), "needs a [[hand]] or a [[rod]]"),
        (
            (BEAM.replace("elements = 60", "elements = 5"), BED, HAND),
            "up to 12 mm long, but on its bed it bends over 6.63 mm: elements must be 10 or",
        ),
        ((BEAM.replace("= 60.0", "= 4000.0"), BED, HAND), "elements must be 544 or more"),
        ((BEAM, BED.replace("0.12", "0.0"), HAND), "toughness of a bed must be above 0"),
        ((BEAM, BED.replace("0.3", "-0.3"), HAND), "stiffness of a bed must be above 0"),
        ((BEAM, BED.replace("45.0", "90.0"), HAND), "0 to 90 mm lies outside the beam"),
        ((BEAM, BED + "scatter = -0.1\n", HAND), "scatter of a bed must be from 0 to 1, got -0.1"),
        ((BEAM, '[bed]\npreset = "firm"\nbilateral = true', HAND), "bilateral bed cannot be slack"),
        ((BEAM, BED, HAND, HAND), "two hooks are on top of one another at 60 mm"),
        ((BEAM, BED, HAND.replace("60.0", "0.0")), "behind a clamp"),
        ((BEAM, BED, HAND.replace("60.0", "70.0")), "is not on the beam"),
        ((BEAM, BED, HAND.replace("12.0", "nan")), "must be finite numbers"),
        ((BEAM, BED, HAND.replace("[0.0, 0.0, 12.0]", "[0.0, 12.0]")), "in path_mm (line"),
        ((BEAM.replace("8.0", "0.0"), BED, HAND), "the axial stiffness must be above 0 N"),
        (
            (BEAM, BED + "stifness = 1.0\n", HAND),
            ", softening, bilateral, floor_N_per_mm2",
        ),
        ((BEAM.replace('"clamped"', '"glued"', 1), BED, HAND), ") in ends (line 5)"),
        ((BEAM.replace('"clamped"', '"glued"', 1), BED, HAND), "'glued' (there are clamped, "),
        ((BEAM, "[[strand]]\nat_mm = 5.0\nstiffness_N_per_mm = 1.0\n", HAND), "strength_N"),
        ((BEAM.replace('"free"', '"loose"'), BED, HAND), "loose"),
        (("[beam", BED, HAND), "scene.toml"),
    ],
)
def test_refuses_what_is_wrong(tmp_path: Path, sections: tuple[str, ...], output: str) -> None:
    table = tmp_path / "history.csv"
    message = refused(["peel", scene(tmp_path, *sections), "-o", table])
    assert output in message
    assert not table.exists()


def test_refuses_a_file_that_is_no_scene(tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    for content, output in (
        (b"#" * 20_000_001, "is no scene: it has more than 20,000,000 bytes"),
        (b"\xff\xfe", "scene.toml: it is not text"),
    ):
        path.write_bytes(content)
        assert output in refused(["peel", path])


def test_refuses_a_load_that_nothing_holds(tmp_path: Path) -> None:
    free = BEAM.replace('"clamped"', '"free"').replace("elements = 60", "elements = 12")
    push = "[[hand]]\nat_mm = 60.0\npath_N = [[0.0, 0.0, 5.0]]\nsteps = 5\n"
    message = refused(["peel", scene(tmp_path, free, BED, push)])
    assert "of 5: " in message
    assert "does anything hold the beam" in message


@pytest.mark.slow
def test_says_of_a_force_that_it_is_rounding(tmp_path: Path) -> None:
    push = "[[hand]]\nat_mm = 60.0\npath_N = [[0.0, 0.0, FORCE]]\nsteps = 2\n"
    stiff = re.sub(r"(axial|shear)_stiffness_N = .*", r"\1_stiffness_N = 1e12", BEAM)
    stiff = stiff.replace("elements = 60", "elements = 12").replace("= 1.5", "= 1e6")
    found = peeled(scene(tmp_path, stiff, push.replace("FORCE", "1e-4")))
    (note,) = found["notes"]
    assert "the force at 60 mm moves nothing" in note
    assert found["steps"][-1]["hand_mm"] == [0.0, 0.0, 0.0]
    assert note in run("peel", tmp_path / "scene.toml").stdout
    assert "notes" not in peeled(scene(tmp_path, stiff, push.replace("FORCE", "1.0")))
    bends = stiff.replace("= 1e6", "= 1.5")
    message = refused(["peel", scene(tmp_path, bends, push.replace("FORCE", "1.0"))])
    assert "the beam is so stiff" in message
    (enough,) = re.findall(r"rounding; (\S+) N along it", message)
    peeled(scene(tmp_path, bends.replace("1e12", enough), push.replace("FORCE", "1.0")))


def test_solve_pulls_a_duct_off_its_bed(tmp_path: Path) -> None:
    table = tmp_path / "history.csv"
    path = "[[0,3,9]]"
    done = run(
        *("solve", "--bed", "firm", "--seed", 7, "--hook", 31, "--path", path),
        *("--steps", 12, "--elements", 40, "--json", "-o", table),
    )
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    last = found["steps"][-1]
    assert last["hand_mm"] == pytest.approx([0.0, 3.0, 9.0], abs=1e-9)
    assert last["strands_broken"] > 200
    assert found["distance_to_break_percent"] == last["distance_to_break_percent"]
    assert 5.0 < found["distance_to_break_percent"] < 30.0
    assert found["residual_ratio"] < 1e-4
    assert table.read_text().splitlines()[0].endswith("distance_to_break_percent")
    output = run("solve", "--bed", "loose", "--lift", 2, "--steps", 4, "--elements", 40).stdout
    assert "strands broken" in output
    assert "distance to break" in output


@pytest.mark.parametrize(
    ("options", "output"),
    [
        (("--bed", "rock", "--lift", 3), "unknown bed 'rock'"),
        (("--bed", "firm"), "either --lift"),
        (("--bed", "firm", "--lift", 3, "--path", "[[0,0,1]]"), "either --lift"),
        (("--bed", "firm", "--path", "up"), "--path must be JSON"),
        (("--bed", "firm", "--path", "[[0,NaN,3]]"), "must be finite numbers"),
        (("--bed", "firm", "--hook", 51, "--lift", 3), "is not on the beam"),
        (("--bed", "firm", "--hook", 0, "--lift", 3), "behind a clamp"),
        (("--bed", "firm", "--lift", 3, "--force", 2), "leave out --force"),
        (("--preset", "thesis-bile-duct", "--force", 2, "--hook", 31), "--hook go with --bed"),
    ],
)
def test_solve_refuses_what_is_wrong(options: tuple[object, ...], output: str) -> None:
    assert output in refused(["solve", *options])


def test_help_names_every_bed_and_each_has_its_source() -> None:
    assert BED_NAMES.replace(" or ", ", ").split(", ") == list(bed_presets())
    for bed in bed_presets().values():
        assert len(bed.source) > 40 or bed.name == "scar"
        assert bed.confidence == "low"  # nobody has published the tissue around a bile duct
        assert bed.confidence_note


def test_solve_in_a_bed_takes_a_law_and_says_where_the_linear_one_is_not_good() -> None:
    own = ("solve", "--bed", "loose", "--preset", "assumed-duct", "--lift", 8, "--steps", 4)
    own = (*own, "--elements", 40, "--json")
    linear, fitting = (
        json.loads(run(*own, *law).stdout) for law in (("--law", "linear"), ("--law", "neo-hooke"))
    )
    assert json.loads(run(*own).stdout) == fitting
    assert "93.08 kPa, below the threshold" in linear["notes"][-1]
    assert "notes" not in fitting
    free = "solve", "--preset", "assumed-duct", "--theory", "exact", "--force", 0.1, "--json"
    assert "93.08 kPa, below the threshold" in json.loads(run(*free, "--shear").stdout)["notes"][0]
    assert "notes" not in json.loads(run(*free).stdout)
    assert linear["law"] == "linear"
    stiff = json.loads(run(*own, "--law", "exponential", "--stiffening", 8).stdout)
    found = [each["distance_to_break_percent"] for each in (linear, fitting, stiff)]
    assert found[2] < found[0] < found[1]
    assert "the exponential law has a stiffening" in refused([*own, "--law", "exponential"])
    assert "--law must be linear" in refused([*own, "--law", "cauchy"])


NETWORK, _, FLUID = re.findall(r"```text\n(.*?)```", DOCS, flags=re.DOTALL)


def test_a_network_of_the_docs_is_pulled_and_a_tube_of_it_tears(tmp_path: Path) -> None:
    table = tmp_path / "history.csv"
    found = peeled(scene(tmp_path, NETWORK), "-o", table)
    rows = found["steps"]
    assert len(rows) == 28
    assert found["residual_ratio"] < 1e-4
    last = rows[-1]["tubes"]
    assert set(last) == {"duct", "branch"}
    torn = [row["tubes"]["branch"]["torn_at_mm"] for row in rows]
    first = next(step for step, places in enumerate(torn) if places)
    assert rows[first]["tubes"]["branch"]["stress_MPa"] > 0.1
    assert all(row["tubes"]["branch"]["stress_MPa"] <= 0.1 for row in rows[:first])
    assert rows[first]["tubes"]["branch"]["distance_to_break_percent"] < 0.0
    assert last["duct"]["torn_at_mm"] == []
    assert "distance_to_break_percent" not in last["duct"]
    assert last["branch"]["freed_mm"] > 0.0
    # It tears where its stress is highest.
    assert torn[first] == [rows[first]["tubes"]["branch"]["highest_at_mm"]]
    with table.open() as lines:
        written = list(csv.DictReader(lines))
    assert [int(line["branch_tears"]) for line in written] == [len(each) for each in torn]
    assert float(written[-1]["duct_stress_MPa"]) == last["duct"]["stress_MPa"]
    assert "tube branch" in run("peel", tmp_path / "scene.toml").stdout


def test_a_network_of_the_docs_in_python_is_that_of_a_scene(tmp_path: Path) -> None:
    _, example = re.findall(r"```python\n(.*?)```", DOCS, flags=re.DOTALL)
    names: dict = {}
    exec(example, names)
    tubes = NETWORK.partition("[[layer]]")[0]
    hand = "[[hand]]" + NETWORK.partition("[[hand]]")[2]
    web = "strands = 60\nstiffness_N_per_mm2 = 0.05\ntoughness_N = 0.03\n"
    over = '[[layer]]\ntube = "branch"\nto = "duct"\nreach_mm = 12.0\n' + web
    found = scene(tmp_path, tubes, over, '[[layer]]\ntube = "duct"\n' + web, hand)
    run_of_scene = read_scene(found).run()
    history = names["history"]
    assert history.forces[:, 0].tolist() == run_of_scene.forces[:, 0].tolist()
    assert run_of_scene.tubes[1].torn[0] == (names["step"], names["place"])
    # As printed: how many strands there are, and how far a tube is from its break.
    whole = scene(tmp_path, found.read_text().replace("0, 0, 14", "0, 0, 1"))
    last = read_scene(whole).run()
    left = last.tubes[1].row(-1)["distance_to_break_percent"]
    printed = run("peel", whole).stdout
    assert f"{last.broken[-1]} of {last.damage.size} strands broken" in printed
    assert f"distance to break {left:.2f} %" in printed


def test_a_tube_of_a_network_is_nicked_before_it_tears(tmp_path: Path) -> None:
    table = tmp_path / "history.csv"
    found = peeled(scene(tmp_path, "tear_mm = 0.2\n" + NETWORK), "-o", table)
    branch = [row["tubes"]["branch"] for row in found["steps"]]
    nicks = [row for row in branch if 0.0 < row.get("nicked", 0.0) < 1.0]
    assert len(nicks) > 1
    assert not any(row["torn_at_mm"] for row in nicks)
    for row in nicks:  # the section is 2 mm high
        assert row["nick_mm"] == pytest.approx(2.0 * row["nicked"], rel=1e-12)
    steps = np.diff([row["nick_mm"] for row in nicks])
    assert np.all((np.abs(steps - 0.2) < 1e-12) | (steps == 0.0))
    assert steps.any()
    assert branch[-1]["nicked"] == 1.0
    assert branch[-1]["torn_at_mm"]
    assert not any("nick_mm" in row["tubes"]["duct"] for row in found["steps"])
    with table.open() as lines:
        written = list(csv.DictReader(lines))
    for name in ("nicked", "nick_mm"):
        assert [float(line[f"branch_{name}"]) for line in written] == [
            row.get(name, 0.0) for row in branch
        ]


@pytest.mark.parametrize("time", ["", '[time]\nstep_s = 0.5\nstrands = "areolar"\n'])
def test_a_network_of_one_tube_is_the_beam_on_its_bed(tmp_path: Path, time: str) -> None:
    """The same numbers, by either tables, also where both relax."""
    beam = 'ends = ["clamped", "free"]\nelements = 30\n'
    stiffness = "\n".join(BEAM.splitlines()[5:]) + "\n"
    axis = "[[0.0, 0.0, 0.0], [60.0, 0.0, 0.0]]\n"
    one = peeled(scene(tmp_path, "[beam]\naxis_mm = " + axis, beam + stiffness, BED, HAND, time))
    tube = '[[tube]]\nname = "a"\npoints_mm = ' + axis
    layer = BED.replace("[bed]", '[[layer]]\ntube = "a"')
    other = peeled(scene(tmp_path, tube, beam + stiffness, layer, HAND, time))
    assert (one["steps"][-1].get("viscous_mJ", 0.0) > 0.0) == bool(time)
    for row, same in zip(one["steps"], other["steps"], strict=True):
        assert same.pop("tubes")["a"]["freed_mm"] == row["freed_mm"]
        assert same == row


@pytest.mark.parametrize(
    ("old", "new", "output"),
    [
        (
            'to = "duct"\nat',
            'to = "vein"\nat',
            "joins 'vein', which must stand before it",
        ),
        ("at_mm = 20.0", "at_mm = 30.0", "end 0 of tube 'branch' is 10 mm away from 'duct'"),
        ('ends = ["joined"', 'ends = ["free"', "end 0 of tube 'branch' is joined in one of"),
        ('name = "branch"', 'name = "duct"', "there are two tubes 'duct'"),
        ('tube = "branch"\nto', 'tube = "vein"\nto', "[[layer]] 1: there is no tube 'vein'"),
        ('tube = "branch"\nat', 'tube = "vein"\nat', "there is no tube 'vein': duct, branch"),
        ("end = 0", "end = 2", "Invalid enum value 2"),
        ("reach_mm = 12.0", "reach = 12.0", "unknown field `reach`"),
        ('[[tube]]\nname = "duct"', BEAM + '[[tube]]\nname = "duct"', "no [beam], [bed] or"),
    ],
)
def test_refuses_networks_that_cannot_be(tmp_path: Path, old: str, new: str, output: str) -> None:
    assert old in NETWORK
    assert output in refused(["peel", scene(tmp_path, NETWORK.replace(old, new, 1))])


def to_the_branch_s_end(row: dict, elements: int) -> float:
    """Return the resistance up to the branch's last so many elements, kPa s/ml, as they lie."""
    nodes = np.array(row["shape_mm"])
    artery = nodes[:25][np.argsort(nodes[:25, 0])]  # nodes stand as they are solved for
    branch = np.concatenate([artery[12:13], nodes[25:]])[: elements + 1]

    def along(line: np.ndarray, rest: float, bore: float) -> float:
        chords = np.sqrt((np.diff(line, axis=0) ** 2).sum(axis=1))
        # A bore's volume stays: bore^2 rest = now^2 chord.
        return float((8 * 3.5e-3 * chords**3 / (math.pi * bore**4 * rest**2)).sum())

    feed = 12.0 / 4.0
    halves = [feed + along(line, 40 / 24, 1.2) for line in (artery[:13], artery[12:])]
    return 1 / sum(1 / each for each in halves) + along(branch, 30 / 16, 0.7)


def test_a_torn_tube_of_the_docs_loses_what_poiseuille_s_law_gives(tmp_path: Path) -> None:
    """Resistances in series and parallel by hand, of the tubes as they lie."""
    table = tmp_path / "history.csv"
    found = peeled(scene(tmp_path, FLUID), "-o", table)
    rows = found["steps"]
    artery, branch = ([row["tubes"][name] for row in rows] for name in ("artery", "branch"))
    torn = next(step for step, row in enumerate(branch) if row["torn_at_mm"])
    assert torn == 9
    assert [row["torn_at_mm"] for row in branch[torn:]] == [[30.0]] * 11
    # Exactly nothing without a tear.
    none = {"lost_ml": 0.0, "flow_ml_per_s": 0.0}
    for row in (*artery, *branch[:torn]):
        assert {key: row[key] for key in none} == none
    assert all(row["left_ml"] == {"blood": 5000.0} for row in rows[:torn])
    assert [row["time_s"] for row in rows] == [0.5 * step for step in range(1, 21)]
    assert "viscous_mJ" not in rows[0]

    whole = to_the_branch_s_end(rows[-1], 15) + 3 * 3.5e-3 / 0.7**3
    for step in range(12, 20):  # the hand waits, nothing moves
        left = rows[step - 1]["left_ml"]["blood"]
        rate = branch[step]["flow_ml_per_s"]
        assert rate == pytest.approx(12.0 * left / 5000.0 / whole, rel=1e-9)
    lost = np.cumsum([0.5 * row["flow_ml_per_s"] for row in branch])
    assert [row["lost_ml"] for row in branch] == pytest.approx(lost, rel=1e-12)
    for row, mine in zip(rows, branch, strict=True):
        assert row["left_ml"]["blood"] + mine["lost_ml"] == pytest.approx(5000.0, rel=1e-12)
    assert lost[-1] > 24.0

    with table.open() as lines:
        written = list(csv.DictReader(lines))
    for key in none:
        assert [float(line[f"branch_{key}"]) for line in written] == [row[key] for row in branch]
    assert float(written[-1]["blood_left_ml"]) == rows[-1]["left_ml"]["blood"]
    printed = run("peel", tmp_path / "scene.toml").stdout
    assert f"torn at 30 mm in step 10; lost {lost[-1]:.6g} ml" in printed


def test_a_wall_torn_in_part_leaks_once_the_tear_is_through_it(tmp_path: Path) -> None:
    """A hole as wide as the tear is deep beyond the wall of 0.3 mm."""
    rows = peeled(scene(tmp_path, "tear_mm = 0.2\n" + FLUID))["steps"]
    branch = [row["tubes"]["branch"] for row in rows]
    for row in branch:
        assert (row["flow_ml_per_s"] > 0.0) == (row.get("nick_mm", 0.0) > 0.3)
    # The same up to the first leak alone, so that the last row has the tubes as they lie then.
    step = next(step for step, row in enumerate(branch, 1) if row["flow_ml_per_s"] > 0.0)
    cut = FLUID.replace("[0, 0, 6], [0, 0, 6]", f"[0, 0, {0.5 * step}]")
    cut = cut.replace("steps = [12, 8]", f"steps = {step}")
    last = peeled(scene(tmp_path, "tear_mm = 0.2\n" + cut))["steps"][-1]
    assert last["tubes"]["branch"]["highest_at_mm"] == 30.0
    a = 0.5 * (last["tubes"]["branch"]["nick_mm"] - 0.3)
    hole = 3.5e-3 * (3 / a**3 + 8 * 0.3 / (math.pi * a**4))
    rate = 12.0 / (to_the_branch_s_end(last, 16) + hole)
    assert last["tubes"]["branch"]["flow_ml_per_s"] == pytest.approx(rate, rel=1e-9)
    assert last["tubes"]["branch"]["flow_ml_per_s"] == pytest.approx(
        branch[step - 1]["flow_ml_per_s"], rel=1e-9
    )


@pytest.mark.parametrize(
    ("old", "new", "output"),
    [
        ("[time]\nstep_s = 0.5\n", "", "[[fluid]] needs [time], whose step_s says"),
        ("bore_radius_mm = 0.7\n", "", "tube 'branch' has a fluid and needs bore_radius_mm"),
        ("= 0.7", "= 1.0", "bore_radius_mm of tube 'branch' must be below its radius of 1 mm"),
        ("= 0.7", "= 0.0", "bore_radius_mm of tube 'branch' must be above 0 mm, got 0.0 mm"),
        ("= 0.7", "= [0.7, 0.6]", "bore_radius_mm of tube 'branch' has 2 numbers; give stations"),
        ("fed_ends = []", "fed_ends = [0]", "end 0 of tube 'branch' is in fed_ends and joined"),
        ("fed_ends = []", "fed_ends = [2]", "Invalid enum value 2"),
        (
            "bore_radius_mm = 1.2",
            "bore_radius_mm = 1.2\nfed_ends = []",
            "[[fluid]] 'blood' comes into no tube: give one of its tubes fed_ends",
        ),
        ('fluid = "blood"', 'fluid = "bile"', "tube 'artery': there is no [[fluid]] 'bile': blood"),
        ('fluid = "blood"\n', "", "bore_radius_mm of tube 'artery' goes with a fluid"),
        ('name = "blood"', 'name = "bile"', "[[fluid]] 1: no tube has the fluid 'bile'"),
        ("= 3.5", "= 0.0", "viscosity_mPa_s of [[fluid]] 'blood' must be above 0 mPa s, got 0.0"),
        ("volume_ml = 5000.0", "volume_ml = nan", "volume_ml of [[fluid]] 'blood' must be above 0"),
        ("supply_ml_per_s", "supply_ml_s", "unknown field `supply_ml_s`"),
    ],
)
def test_refuses_fluids_that_cannot_be(tmp_path: Path, old: str, new: str, output: str) -> None:
    assert old in FLUID
    assert output in refused(["peel", scene(tmp_path, FLUID.replace(old, new, 1))])


def test_a_fluid_flows_in_tubes_alone(tmp_path: Path) -> None:
    fluid = "[[fluid]]" + FLUID.partition("[[fluid]]")[2].partition("[time]")[0]
    message = refused(["peel", scene(tmp_path, BEAM, BED, HAND, fluid)])
    assert "[[fluid]] and a hand's tube go with [[tube]], not [beam]" in message
    twice = FLUID.replace("[[fluid]]", fluid + "[[fluid]]")
    assert "there are two fluids 'blood'" in refused(["peel", scene(tmp_path, twice)])


def test_a_field_that_is_not_known_is_named_with_its_line(tmp_path: Path) -> None:
    wrong = NETWORK.replace("reach_mm", "reach", 1)
    rows = [line.partition(" ")[0] for line in wrong.splitlines()]
    words = refused(["peel", scene(tmp_path, wrong)])
    assert f"(line {rows.index('reach') + 1})" in words


def test_a_rod_s_tube_is_refused_with_why(tmp_path: Path) -> None:
    rod = "[[rod]]\npath_mm = [[20, -9, 3], [20, 0, 3]]\nshaft = [0, -1, 0]\nradius_mm = 1.0\n"
    wrong = NETWORK + rod + 'tube = "duct"\n'
    words = refused(["peel", scene(tmp_path, wrong)])
    assert "tube is no field of a [[rod]]: its places are given in space" in words
    assert f"(line {len(wrong.splitlines())})" in words
    for no_table in ("[rod]\ntube = 1\n", 'rod = ["tube"]\n'):
        assert "Expected `" in refused(["peel", scene(tmp_path, no_table)])


def test_older_keys_of_a_scene_are_read_and_give_the_same(tmp_path: Path) -> None:
    present = (BEAM, BED + "floor_N_per_mm2 = 0.1\nbilateral = true\n", HAND)
    older = [
        section.replace("_N_per_mm2", "_N_mm2").replace("bilateral", "two_sided")
        .replace("bending_stiffness_N_mm2", "bending_stiffness_Nmm2")
        .replace("torsion_stiffness_N_mm2", "torsion_stiffness_Nmm2")
        for section in present
    ]  # fmt: skip
    assert older[0] != present[0]
    assert older[1] != present[1]
    assert peeled(scene(tmp_path, *older)) == peeled(scene(tmp_path, *present))
