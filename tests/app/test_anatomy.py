"""Anatomy files are read with errors that name line and tube; cases keep to their frequencies."""

import json
import math
import re
from pathlib import Path
from statistics import NormalDist

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from program import refused, run

from app.anatomy import (
    Anatomy,
    anatomy_network,
    anatomy_toml,
    drawn_anatomy,
    read_anatomy,
    shipped_anatomies,
    tube_lines,
)
from app.anatomy.anatomy_geometry import joined_station
from app.anatomy.frequencies import Fraction, Size, Tied, case_of, frequencies
from app.anatomy.tube_kinds import kind_of_name
from app.simulation import bed_presets

SHIPPED = shipped_anatomies()
NORMAL = SHIPPED["normal"].read_text()
CASES = (20, pytest.param(200, marks=pytest.mark.long))
"""How many drawn cases are looked at."""
SIGMAS = 4.0
"""Of a count or a mean over the seeds: by chance, one of 16,000 is further off."""


@pytest.mark.parametrize("name", SHIPPED)
def test_a_shipped_anatomy_is_whole_and_comes_back_from_its_text(name: str, tmp_path: Path) -> None:
    read = read_anatomy(SHIPPED[name])
    assert read.name == name
    assert read.title
    assert anatomy_toml(read) == SHIPPED[name].read_text()
    lines = tube_lines(read)
    for join in read.join:
        place = lines[join.to].at(joined_station(join, lines[join.to]))
        assert np.linalg.norm(lines[join.tube].places[-join.end] - place) < 0.05
    copy = tmp_path / "copy.toml"
    copy.write_text(anatomy_toml(read))
    assert read_anatomy(copy) == read


def test_the_five_differ_in_what_they_are_named_for() -> None:
    found = {name: read_anatomy(path) for name, path in SHIPPED.items()}
    assert next(iter(found)) == "normal"
    assert len(found) == 5

    def length(name: str, tube: str) -> float:
        return tube_lines(found[name])[tube].length

    assert length("short-cystic", "cystic") == pytest.approx(10.0, rel=0.01)
    assert length("parallel-low", "cystic") == pytest.approx(40.0, rel=0.01)

    def roots(anatomy: Anatomy) -> list[str]:
        return [j.to for j in anatomy.join if j.tube.startswith("artery") and j.end == 0]

    assert roots(found["normal"]) == ["rha"]
    assert roots(found["artery-outside"]) == []
    assert roots(found["accessory-artery"]) == ["rha", "rha"]
    # The duct joins low and runs beside the common duct: further below its end, at a small angle.
    low, usual = found["parallel-low"], found["normal"]
    assert _below_confluence(low) > _below_confluence(usual) + 15.0
    assert _angle(low) < 20.0 < 35.0 < _angle(usual) < 50.0


def _below_confluence(anatomy: Anatomy) -> float:
    join = next(join for join in anatomy.join if join.tube == "cystic")
    common = tube_lines(anatomy)["common"]
    return common.length - joined_station(join, common)


def _angle(anatomy: Anatomy) -> float:
    """Between the cystic duct's first 5 mm and the common duct above it, degrees."""
    lines = tube_lines(anatomy)
    join = next(join for join in anatomy.join if join.tube == "cystic")
    at = joined_station(join, lines["common"])
    up = lines["common"].at(at + 5.0) - lines["common"].at(at)
    direction = lines["cystic"].at(5.0) - lines["cystic"].at(0.0)
    return math.degrees(math.acos(up @ direction / np.linalg.norm(up) / np.linalg.norm(direction)))


@pytest.fixture(scope="module", params=CASES)
def cases(request: pytest.FixtureRequest) -> list[Anatomy]:
    """Drawn cases; each is checked as it is made: joined, and clear of each other."""
    return [drawn_anatomy(seed) for seed in range(1, request.param + 1)]


@pytest.mark.slow
def test_every_seed_builds_what_was_drawn(cases: list[Anatomy]) -> None:
    for anatomy in cases:
        lines = tube_lines(anatomy)
        assert lines["cystic"].length == pytest.approx(
            anatomy.drawn["cystic_duct_length_mm"], rel=0.02
        )
        arteries = sum(tube.name.startswith("artery") for tube in anatomy.tube)
        assert arteries == {"none": 0, "double": 2, "both": 2}.get(
            str(anatomy.drawn["cystic_artery"]), 1
        )
        if anatomy.drawn["cystic_artery"] in ("inside", "double", "both"):
            # From wall to wall: less the radii of the two that it joins.
            root = next(join for join in anatomy.join if (join.tube, join.end) == ("artery", 0))
            assert root.to == "rha"
            neck = np.interp(5.0, lines["gallbladder"].stations, lines["gallbladder"].radius)
            visible = lines["artery"].length - float(neck) - float(lines["rha"].radius[0])
            assert visible == pytest.approx(anatomy.drawn["cystic_artery_length_mm"], abs=1.5)
        assert {layer.preset for layer in anatomy.layer} <= set(bed_presets())
        assert anatomy_network(anatomy).strands.count > 500


def test_arteries_leave_the_walls_that_they_join_at_once(cases: list[Anatomy]) -> None:
    for anatomy in cases:
        lines = tube_lines(anatomy)
        for join in anatomy.join:
            if join.tube.startswith("artery"):
                tube, to = lines[join.tube], lines[join.to]
                at = int(np.abs(to.stations - joined_station(join, to)).argmin())
                along = tube.length - tube.stations if join.end else tube.stations
                beyond = along > 2.0 * (tube.radius[0] + to.radius[at]) + 0.5
                apart = np.linalg.norm(tube.places[beyond, np.newaxis] - to.places, axis=2)
                assert (apart - to.radius).min() > tube.radius[0] - 0.1, (anatomy.name, join)


def test_a_case_comes_back_from_its_text(cases: list[Anatomy], tmp_path: Path) -> None:
    for anatomy in cases[:10]:
        path = tmp_path / f"{anatomy.name}.toml"
        path.write_text(anatomy_toml(anatomy))
        assert read_anatomy(path) == anatomy
    assert anatomy_toml(drawn_anatomy(1)) == anatomy_toml(cases[0])
    assert anatomy_toml(cases[0]) != anatomy_toml(cases[1])


def test_shares_of_kinds_are_the_published_ones_within_the_sampling_error(
    cases: list[Anatomy],
) -> None:
    for name, fraction in frequencies().fraction.items():
        assert sum(fraction.values.values()) == pytest.approx(1.0)
        for kind, wanted in fraction.values.items():
            count = sum(anatomy.drawn[name] == kind for anatomy in cases)
            spread = math.sqrt(len(cases) * wanted * (1.0 - wanted))
            assert abs(count - len(cases) * wanted) <= SIGMAS * spread, (name, kind)


def test_means_of_sizes_are_the_published_ones_within_the_sampling_error(
    cases: list[Anatomy],
) -> None:
    for name, size in frequencies().size.items():
        drawn = np.array([float(anatomy.drawn[name]) for anatomy in cases])
        assert drawn.min() >= size.low
        assert drawn.max() <= size.high
        draws = (np.arange(2000) + 0.5) / 2000
        whole = np.array([size.at(float(draw)) for draw in draws])
        error = whole.std() / math.sqrt(len(cases))
        assert abs(drawn.mean() - whole.mean()) <= SIGMAS * error, name


@given(st.floats(0.0, 1.0, exclude_max=True))
def test_a_size_cut_off_at_both_ends_has_its_distribution(draw: float) -> None:
    size = Size(mean=20.0, sd=8.0, source="", low=5.0, high=45.0)
    value, normal = size.at(draw), NormalDist(20.0, 8.0)
    assert 5.0 <= value <= 45.0
    fraction = (normal.cdf(value) - normal.cdf(5.0)) / (normal.cdf(45.0) - normal.cdf(5.0))
    assert fraction == pytest.approx(draw, abs=1e-4)  # it is rounded to 0.001 mm


def test_tied_kinds_keep_their_share_over_both_halves() -> None:
    values = {"high": 0.1, "mid": 0.78, "low": 0.12}
    fraction = Fraction(values, "", tied=Tied("length", above=["low"], below=["high"]))
    draws = (np.arange(1000) + 0.5) / 1000
    found = {half: [fraction.at(float(draw), half) for draw in draws] for half in (0.25, 0.75)}
    assert "low" not in found[0.25]
    assert "high" not in found[0.75]
    for kind, wanted in values.items():
        count = sum(each.count(kind) for each in found.values())
        assert count / 2000 == pytest.approx(wanted, abs=0.0015)


def test_a_further_frequency_changes_no_other_draw(monkeypatch: pytest.MonkeyPatch) -> None:
    before = case_of(7)
    known = frequencies()
    more = Size(mean=1.0, sd=0.1, source="")
    grown = type(known)(size={"another_mm": more, **known.size}, fraction=known.fraction)
    monkeypatch.setattr("app.anatomy.frequencies.frequencies", lambda: grown)
    after = case_of(7)
    assert after.kinds == before.kinds
    assert before.sizes.items() < after.sizes.items()


def test_every_frequency_has_a_source_or_is_named_as_assumed() -> None:
    known = frequencies()
    for each in [*known.size.values(), *known.fraction.values()]:
        assert each.source
        assert "None" not in each.source or each.assumed


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("common_duct", "duct"),
        ("Gallbladder", "organ"),
        ("right hepatic artery", "artery"),
        ("portal_vein", "vein"),
        ("Liver", "shown"),
        ("duodenum", "shown"),
        ("thing 3", None),
    ],
)
def test_a_name_means_a_kind(name: str, kind: str | None) -> None:
    assert kind_of_name(name) == kind


def edited(change: str, by: str, count: int = 1) -> str:
    assert change in NORMAL
    return NORMAL.replace(change, by, count)


def line_of(text: str, sought: str, after: str = "") -> int:
    start = text.index(after)
    return text.count("\n", 0, text.index(sought, start)) + 1


CYSTIC = '[[tube]]\nname = "cystic"'
BROKEN: dict[str, tuple[str, str, str]] = {
    # What is wrong: the file, what its line holds, and what the message says.
    "unknown field": (
        edited("radius_mm = 1.4", "radius_mm = 1.4\ncolour = 3"), "colour = 3", "'cystic'.*colour",
    ),
    "a word for a number": (edited("radius_mm = 1.4", 'radius_mm = "thin"'), '"thin"', "'cystic'"),
    "a point of two": (
        edited("points_mm = [[0.0, 1.0, -1.0]", "points_mm = [[0.0, 1.0]"),
        "[[0.0, 1.0]", "'common'.*points_mm",
    ),
    "no wall": (edited("wall_mm = 0.42\n", ""), CYSTIC, "'cystic'.*wall_mm"),
    "a wall that fills the bore": (
        edited("wall_mm = 0.42", "wall_mm = 1.4"), "wall_mm = 1.4", "'cystic'.*bore",
    ),
    "a radius below 0": (
        edited("radius_mm = 1.4", "radius_mm = -1.4"), "radius_mm = -1.4", "'cystic'.*from 0.01",
    ),
    "a modulus that is not finite": (
        edited("modulus_MPa = 0.6", "modulus_MPa = inf"), "modulus_MPa = inf", "'gallbladder'",
    ),
    "one element": (edited("elements = 14", "elements = 1"), "elements = 1\n", "'gallbladder'"),
    "a kind that is none": (edited('kind = "organ"', 'kind = "bag"'), '"bag"', "'gallbladder'"),
    "two tubes of one name": (
        edited('name = "gallbladder"', 'name = "cystic"'), "name = \"cystic\"\nkind = \"organ\"",
        "'cystic'.*another",
    ),
    "no name": (edited('name = "cystic"\nkind', 'name = ""\nkind'), 'name = ""', "needs a name"),
    "a joined end without a join": (
        edited('ends = ["joined", "free"]', 'ends = ["joined", "joined"]'),
        '["joined", "joined"]', "end 1 of tube 'cystic'",
    ),
    "a clamped end with a join": (
        edited('ends = ["joined", "free"]', 'ends = ["clamped", "free"]'),
        '["clamped", "free"]', "end 0 of tube 'cystic'",
    ),
    "a join to nobody": (edited('to = "common"', 'to = "comon"'), 'to = "comon"', "'comon'"),
    "a join beyond the end": (
        re.sub(r"at_mm = 28\.\d+", "at_mm = 99.0", NORMAL), "at_mm = 99.0", "'cystic'.*99",
    ),
    "tubes that do not meet": (
        re.sub(r"at_mm = 28\.\d+", "at_mm = 20.0", NORMAL), "at_mm = 20.0",
        "'cystic' does not meet 'common'",
    ),
    "a join before its tube": (
        edited(
            'tube = "cystic"\nend = 0\nto = "common"', 'tube = "common"\nend = 0\nto = "cystic"'
        ),
        'to = "cystic"', "'common' must stand after 'cystic'",
    ),
    "radii that cross": (
        edited("radius_mm = 1.45", "radius_mm = 3.5"), "points_mm", "'rha' crosses 'common'",
    ),
    "a tissue that nobody knows": (
        edited('preset = "normal"', 'preset = "soft"'), 'preset = "soft"', "'soft'",
    ),
    "a case of a tissue that nobody knows": (
        edited("seed = 7", 'seed = 7\ntissue = "soft"'), 'tissue = "soft"',
        "no tissue 'soft'; there are normal, loose, firm, inflamed, scar",
    ),
    "a layer to its own tube": (
        edited('tube = "artery"\nto = "cystic"', 'tube = "artery"\nto = "artery"'),
        'to = "artery"', "another tube",
    ),
    "no strands": (edited("strands = 200", "strands = 0"), "strands = 0", "strands"),
    "a layer beyond its tube": (
        edited("to_mm = 9.0", "to_mm = 900.0"), "to_mm = 900.0", "'gallbladder'.*900",
    ),
    "a direction of length 2": (
        edited("toward = [0.68, 0.6, 0.42]", "toward = [0.0, 0.0, 2.0]"), "toward = [0.0",
        "length 1",
    ),
    "one point": (
        re.sub(r"(?<=radius_mm = 1.4)", "", re.sub(
            r"points_mm = \[\[28\.0.*\]\]", "points_mm = [[28.0, 0.0, 0.0]]", NORMAL)),
        "points_mm = [[28.0, 0.0, 0.0]]", "'cystic'.*2 or more",
    ),
    "a point far away": (
        re.sub(r"(?<=points_mm = \[\[28\.0).*\]\]", ", 0.0, 0.0], [1e300, 0.0, 0.0]]", NORMAL),
        "points_mm = [[28.0, 0.0, 0.0], [1e300", "'cystic'.*within 10,000 mm",
    ),
    "a wall of nearly nothing": (
        edited("wall_mm = 0.42", "wall_mm = 1e-10"), "wall_mm = 1e-10", "'cystic'.*from 0.001",
    ),
    "a modulus beyond all": (
        edited("modulus_MPa = 0.6", "modulus_MPa = 1e300"), "modulus_MPa = 1e300", "'gallbladder'",
    ),
    "an organ elsewhere": (
        edited('kind = "duct"', 'kind = "duct"\norgan = "../x.organ"'), "organ = ",
        "beside the anatomy",
    ),
    "a seed below 0": (edited("seed = 7", "seed = -5"), "seed = -5", "seed must be 0 to"),
    "too many strands": (
        edited("strands = 200", "strands = 1000000"), "strands = 1000000", "1 to 200,000",
    ),
    "strands that part before they yield": (
        edited('to = "cystic"\npreset', 'to = "cystic"\nyield_mm = 5.0\nfailure_mm = 1.0\npreset'),
        "failure_mm = 1.0", "'artery' to 'cystic'.*part at 1 mm",
    ),
    "strands that yield at nothing": (
        edited('to = "cystic"\npreset', 'to = "cystic"\nyield_mm = 1e-300\npreset'),
        "yield_mm = 1e-300", "yield_mm must be from",
    ),
    "a place that is no turn": (
        edited("[[tube]]", "[place]\norigin_LPS_mm = [0, 0, 0]\n"
               "rows_LPS = [[2, 0, 0], [0, 1, 0], [0, 0, 1]]\n\n[[tube]]"),
        "rows_LPS = ", "directions of a turn",
    ),
    "a face before a joint": (
        edited("face_mm = 3.2", "face_mm = -3.2"), "face_mm = -3.2", "'cystic'.*face_mm.*from 0",
    ),
    "a face beyond the tube": (
        edited("face_mm = 3.2", "face_mm = 32.0"), "face_mm = 32.0", "'cystic'.*length of 23",
    ),
    "a tube that touches itself": (
        NORMAL + '\n[[touch]]\ntube = "rha"\nto = "rha"\nlength_mm = 8.0\n', 'to = "rha"\nlength',
        "'rha' touches itself",
    ),
    "a touch of negative length": (
        NORMAL + '\n[[touch]]\ntube = "rha"\nto = "common"\nlength_mm = -8.0\n',
        "length_mm = -8.0", "length_mm must be from 0",
    ),
    "two points in one place": (
        re.sub(r"points_mm = \[\[28\.0.*\]\]",
               "points_mm = [[28.0, 0.0, 0.0], [28.0, 0.0, 0.0], [30.0, 4.0, 0.0]]", NORMAL),
        "points_mm = [[28.0, 0.0, 0.0], [28", "'cystic'.*on top",
    ),
}  # fmt: skip


@pytest.mark.parametrize("what", BROKEN)
def test_a_broken_file_is_refused_with_its_line_and_tube(what: str, tmp_path: Path) -> None:
    text, place, says = BROKEN[what]
    path = tmp_path / "broken.toml"
    path.write_text(text)
    after = 'name = "rha"' if "cross" in what else ""
    message = refused(["anatomy", path])
    assert f"{path}, line {line_of(text, place, after)}: " in message
    assert re.search(says, message), message


@pytest.mark.parametrize("text", ["", "tube = []\nname = 'x'", "name = 3", "[[tube]", "\0"])
def test_what_is_no_anatomy_is_refused(text: str, tmp_path: Path) -> None:
    path = tmp_path / "no.toml"
    path.write_text(text)
    assert str(path) in refused(["anatomy", path])


def test_a_touch_lets_two_tubes_lie_against_each_other(tmp_path: Path) -> None:
    path = tmp_path / "touch.toml"
    text = edited("radius_mm = 1.45", "radius_mm = 3.5").replace(
        "[[layer]]",
        '[[touch]]\ntube = "rha"\nto = "common"\nlength_mm = 8.0\n\n[[touch]]\ntube = "rha"\n'
        'to = "cystic"\nlength_mm = 8.0\n\n[[layer]]',
        1,
    )
    path.write_text(text)
    assert len(read_anatomy(path).touch) == 2


def test_the_command_lists_draws_and_reads(tmp_path: Path) -> None:
    listed = json.loads(run("anatomy", "--list", "--json").stdout)
    assert [each["name"] for each in listed] == list(SHIPPED)
    path = tmp_path / "case.toml"
    drawn = run("anatomy", "--seed", 7, "-o", path, "--json")
    assert drawn.returncode == 0, drawn.stderr
    assert json.loads(drawn.stdout) == json.loads(run("anatomy", path, "--json").stdout)
    assert read_anatomy(path) == drawn_anatomy(7)
    output = run("anatomy", "short-cystic").stdout
    assert "cystic             duct, 10.0 mm long, radius 1.40 mm" in output


@pytest.mark.parametrize(("name", "mark"), [("a.png", b"\x89PNG"), ("a.svg", b"<?xml")])
def test_the_figure_is_a_picture(name: str, mark: bytes, tmp_path: Path) -> None:
    done = run("anatomy", "normal", "--figure", tmp_path / name)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / name).read_bytes().startswith(mark)


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ([], "--labels or --list"),
        (["normal", "--seed", 3], "--labels or --list"),
        (["abnormal"], "abnormal"),
        (["normal", "-o", "no/such/folder.toml"], "no folder"),
        (["normal", "--figure", "a.bmp"], ".png"),
        (["--list", "-o", "a.toml"], "--list"),
    ],
)
def test_wrong_words_are_refused(
    arguments: list[object], says: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert says in refused(["anatomy", *arguments])
