"""The numbers belong to the organ in hand: built from images, solved, exported and shown alike."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from own_organ import DISTANCE, IMAGES, built_bar
from program import printed, refused, run
from simulated import phantom, pull_session

from app.simulation import presets
from assets import BILE_DUCT
from organ_geometry.organ_file import read_organ
from physics import THEORIES

MODULUS, STRENGTH = 0.310264, 0.2115
"""Of an organ that nobody has printed anything about, MPa."""


def curve(organ: Path, *options: object) -> np.ndarray:
    """(N, 2) force, N, and deflection, mm, that the real command exports."""
    path = organ.with_suffix(".csv")
    done = run("export", organ, "-o", path, "--frames", 2000, *options)
    assert done.returncode == 0, done.stderr
    assert "assumed-duct" in done.stdout
    assert "the organ's own full sections" in done.stdout
    return np.loadtxt(path, delimiter=",", skiprows=1, usecols=(0, 1))


@pytest.mark.slow
def test_a_bar_twice_as_thick_is_sixteen_times_as_stiff(tmp_path: Path) -> None:
    """From images to the exported curve; 192 E I / S^3 in the limit of small deflections."""
    stiffness: list[float] = []
    for diameter in (4.0, 8.0):
        organ = built_bar(tmp_path, diameter)
        force, deflection = curve(organ)[1]
        assert deflection < 0.1 * diameter
        span = read_organ(organ).length
        assert span == pytest.approx((IMAGES - 1) * DISTANCE, rel=2e-3)
        theory = 192.0 * MODULUS * math.pi / 64.0 * diameter**4 / span**3
        # Two degree-6 curves leave 0.5 % of a circle's area aside.
        assert force / deflection == pytest.approx(theory, rel=0.03)
        stiffness.append(force / deflection)
    assert stiffness[1] / stiffness[0] == pytest.approx(16.0, rel=0.03)


def test_a_hollow_bar_from_images_is_a_ring(tube_file: Path) -> None:
    found = json.loads(printed("solve", "--organ", tube_file, "--force", 0.01, "--json"))
    assert found["area_mm2"] == pytest.approx(math.pi * (16.0 - 6.25), rel=0.03)
    assert found["second_moment_mm4"] == pytest.approx(math.pi / 4.0 * (256.0 - 2.5**4), rel=0.03)
    assert found["fibre_distance_mm"] == pytest.approx(4.0, rel=0.02)
    assert found["span_mm"] == pytest.approx(58.0, rel=2e-3)
    assert found["threshold_MPa"] == STRENGTH
    assert "own hollow sections" in found["section"]


def test_the_thesis_s_bar_on_another_organ_says_so(tube_file: Path, tmp_path: Path) -> None:
    done = printed("export", tube_file, "-o", tmp_path / "a.csv", "--preset", "thesis-bile-duct")
    assert (
        "a full round bar, 50.8 mm between the clamps, 8.89 mm thick; not the organ's own" in done
    )
    line = refused(("solve", "--organ", tube_file, "--preset", "thesis-bile-duct", "--force", 1))
    assert "brings its own beam" in line


@pytest.mark.slow
@pytest.mark.parametrize("theory", list(THEORIES))
@pytest.mark.parametrize("preset", list(presets()))
@pytest.mark.parametrize("whose", ["own", pytest.param("shipped", marks=pytest.mark.long)])
def test_page_solve_and_export_agree_to_the_digit(
    whose: str, preset: str, theory: str, tube_file: Path, tmp_path: Path
) -> None:
    file = BILE_DUCT if whose == "shipped" else tube_file
    organ = phantom() if whose == "shipped" else read_organ(tube_file)
    session = pull_session(organ, presets()[preset], vertices=300)
    session.choose_theory(THEORIES[theory]())
    given = ("--preset", preset, "--theory", theory, "--json")
    # On the page the grasp is in the middle until it is moved.
    bar = presets()[preset].beam.__class__.__name__ == "RoundBeam"
    which = () if bar else ("--organ", file)
    event = session.reading().breaks_at
    force = 0.5 * (session.planar.force_limit / 1.5 if event is None else event.force)
    solved = json.loads(printed("solve", *which, *given, "--force", repr(force)))
    path = tmp_path / "curve.csv"
    exported = json.loads(
        printed("export", file, "-o", path, *given, "--frames", 3, "--force", repr(force))
    )
    assert session.tissue.threshold == solved["threshold_MPa"] == exported["threshold_MPa"]
    found = None if event is None else event.force
    assert found == solved["breaks_at_N"] == exported["breaks_at_N"]
    session.set_target_force(force)
    while session.advance():
        pass
    reading = session.reading()
    last = path.read_text().splitlines()[-1].split(",")
    names = path.read_text().splitlines()[0].split(",")
    rows = dict(zip(names, map(float, last), strict=True))
    check = reading.check
    for shown, name in (
        (reading.force, "force_N"),
        (reading.deflection, "deflection_mm"),
        (check.normal_stress, "normal_stress_MPa"),
        (check.bending_stress, "bending_stress_MPa"),
        (check.distance_to_break, "distance_to_break"),
    ):
        # As many digits as the read-out has.
        assert f"{shown:.6g}" == f"{solved[name]:.6g}" == f"{rows[name]:.6g}"
