"""Preset files: what is written is read again, what is wrong is printed, and runs keep theirs."""

import json
import tomllib
from pathlib import Path

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from program import printed, refused
from simulated import phantom, pull, pull_session, replayed, tear

from app.simulation import (
    LIMITS,
    OrganBeam,
    Preset,
    RoundBeam,
    chosen_preset,
    preset_named,
    preset_toml,
    presets,
    read_preset,
    read_run,
    run_json,
)

OWN = Preset(
    "mine",
    OrganBeam(wall_mm=0.7, clamps_mm=(5.0, 45.0)),
    modulus_MPa=1.0 / 3.0,
    poisson_ratio=0.41,
    break_stress_MPa=0.1234567890123,
    source='My own "bench", 2026: \\ stretched by hand.\nTwice. µ',
)


def number(name: str) -> st.SearchStrategy[float]:
    low, high, _ = LIMITS[name]
    return st.floats(low, high, allow_nan=False)


@pytest.mark.slow
@settings(deadline=None)
@given(
    number("modulus_MPa"),
    number("poisson_ratio"),
    number("break_force_N"),
    st.booleans(),
    st.text(st.characters(codec="utf-8"), max_size=200),
)
def test_what_is_written_is_read_to_the_bit(
    modulus: float, nu: float, strength: float, by_force: bool, source: str
) -> None:
    preset = Preset(
        "mine",
        RoundBeam(40.0, 8.0, wall_mm=1.5),
        modulus_MPa=modulus,
        poisson_ratio=nu,
        break_force_N=strength if by_force else None,
        break_stress_MPa=None if by_force else strength,
        source=source,
    )
    content = preset_toml(preset)
    assert read_preset(content, "mine.toml") == preset
    assert set(tomllib.loads(content.decode())) == {"preset"}


@pytest.mark.parametrize("name", list(presets()))
def test_presets_that_ship_go_through_a_file(name: str) -> None:
    assert read_preset(preset_toml(preset_named(name)), "a.toml") == preset_named(name)


def test_every_command_takes_a_file(tube_file: Path, tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_bytes(preset_toml(OWN))
    options = ("--preset", file, "--json")
    found = json.loads(printed("solve", "--organ", tube_file, "--force", 0.01, *options))
    assert found["preset"] == "mine"
    assert found["threshold_MPa"] == OWN.break_stress_MPa
    assert found["span_mm"] == 40.0
    made = json.loads(printed("export", tube_file, "-o", tmp_path / "a.csv", *options))
    assert made["preset"] == "mine"
    assert made["breaks_at_N"] == found["breaks_at_N"]
    assert "own outline with a wall of 0.7 mm" in made["section"]


GOOD = """
[[preset]]
name = "mine"
beam = { section = "organ" }
modulus_MPa = 0.3
break_stress_MPa = 0.2
"""


def test_a_short_file_is_enough(tmp_path: Path) -> None:
    file = tmp_path / "Mine.TOML"
    file.write_text(GOOD)
    preset = chosen_preset(str(file))
    assert preset == Preset("mine", OrganBeam(), modulus_MPa=0.3, break_stress_MPa=0.2)
    assert (preset.poisson_ratio, preset.confidence, preset.label) == (0.3, "low", "mine")
    assert "yours" in preset.source.lower()


BAD = {
    "no TOML": ("this is = no toml =", "is no preset"),
    "no UTF-8": (b"\xff\xfe\x00", "is no preset"),
    "nothing": ("", "is no preset"),
    "two": (GOOD + GOOD, "must have one [[preset]], it has 2"),
    "misspelt": (GOOD + "modulus_kPa = 3.0", "`modulus_kPa`"),
    "no modulus": (GOOD.replace("modulus_MPa = 0.3", ""), "`modulus_MPa`"),
    "words": (GOOD.replace("0.3", '"soft"'), "Expected `float`, got `str` - at `modulus_MPa`"),
    "below zero": (GOOD.replace("0.3", "-0.3"), "modulus_MPa must be from 1e-05 to 1e+06 MPa"),
    "no number": (GOOD.replace("0.3", "nan"), "modulus_MPa must be from 1e-05 to 1e+06 MPa"),
    "boundless": (GOOD.replace("0.2", "inf"), "break_stress_MPa must be from 1e-07 to 1e+06"),
    "no break": (GOOD.replace("break_stress_MPa = 0.2", ""), "either break_force_N or break"),
    "two breaks": (GOOD + "break_force_N = 1", "either break_force_N or break_stress_MPa"),
    "Poisson": (GOOD + "poisson_ratio = 0.5", "poisson_ratio must be from 0 to 0.499, got 0.5"),
    "square": (GOOD.replace("organ", "square"), "square"),
    "thick wall": (
        GOOD.replace(
            'section = "organ"', 'section = "round", span_mm = 9, diameter_mm = 4, wall_mm = 2'
        ),
        "wall_mm must be below half the diameter, 2 mm, got 2 mm",
    ),
    "clamps": (
        GOOD.replace('section = "organ"', 'section = "organ", clamps_mm = [9, 4]'),
        "clamps_mm must be two places along the organ",
    ),
    "no name": (GOOD.replace("mine", " "), "a preset must have a name"),
    "large": (GOOD + "#" * 200_000, "more than 100,000 bytes"),
}


@pytest.mark.parametrize("name", list(BAD))
def test_a_bad_file_is_refused_in_a_line(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    content, words = BAD[name]
    file = tmp_path / "bad.toml"
    file.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(ValueError, match=r"bad\.toml") as refusal:
        chosen_preset(str(file))
    assert words in str(refusal.value)
    assert "$" not in str(refusal.value)


def test_commands_refuse_bad_and_missing_files(tube_file: Path, tmp_path: Path) -> None:
    file = tmp_path / "bad.toml"
    file.write_text(GOOD.replace("0.3", "-1"))
    line = refused(("solve", "--preset", file, "--force", 1))
    assert "modulus_MPa must be from" in line
    output = tmp_path / "a.glb"
    assert "bad.toml" in refused(("export", tube_file, "-o", output, "--preset", file))
    assert "bad.toml" in refused(("trainer", "--port", 0, "--preset", file))
    missing = tmp_path / "missing.toml"
    assert "no such file" in refused(("solve", "--preset", missing, "--force", 1))
    assert not output.exists()


@pytest.mark.parametrize("beam", [OWN.beam, RoundBeam(40.0, 8.0, wall_mm=1.0, first_clamp_mm=3.0)])
def test_a_run_with_a_preset_of_one_s_own_is_made_again_to_the_bit(
    beam: OrganBeam | RoundBeam,
) -> None:
    preset = msgspec.structs.replace(OWN, beam=beam)
    session = pull_session(phantom(), preset, vertices=300)
    pull(session, 0.3 * session.planar.force_limit)
    session.set_grasp(0.4 * session.tissue.dissection.beam.span)
    tear(session)
    run = session.run_file()
    assert run.metrics["tear"] is not None
    read = read_run(run_json(run))
    assert read.log.start.preset == preset
    assert replayed(read, phantom()) == run


def test_a_run_names_a_preset_that_ships_and_keeps_an_edited_one_of_its_name() -> None:
    for preset in (
        preset_named("porcine-bile-duct"),
        msgspec.structs.replace(preset_named("porcine-bile-duct"), modulus_MPa=0.06),
    ):
        session = pull_session(phantom(), preset, vertices=300)
        pull(session, 0.1)
        kept = session.run_file().log.start.preset
        assert kept == (preset.name if preset.ships else preset)


def test_a_run_with_a_bad_preset_of_its_own_is_refused() -> None:
    session = pull_session(phantom(), OWN, vertices=300)
    pull(session, 0.1)
    tree = json.loads(run_json(session.run_file()))
    tree["log"]["start"]["preset"]["modulus_MPa"] = -1.0
    with pytest.raises(ValueError, match="modulus_MPa must be from"):
        read_run(json.dumps(tree).encode())


@pytest.mark.parametrize("name", ["thesis-bile-duct", "porcine-bile-duct"])
def test_runs_of_before_still_play(name: str) -> None:
    """Made before presets could be one's own, and before beams could vary."""
    content = (Path(__file__).parent / "older_runs" / f"{name}.json").read_bytes()
    original = read_run(content)
    assert original.metrics == json.loads(content)["measures"], "as that program wrote them"
    assert {"tear", "smoothness", "path_length_mm"} <= original.metrics.keys()
    found = replayed(original, phantom())
    assert found.metrics["smoothness"] is not None
    assert original.agrees_with(found)
