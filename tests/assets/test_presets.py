"""The presets are complete, and those of the thesis are its inch, psi and pound-force figures."""

import math
import tomllib
from typing import Any

import pytest

from assets import PRESETS

INCH_MM = 25.4
PSI_MPA = 0.00689475729
POUND_FORCE_N = 4.4482216
# The presets give six or seven digits.
PRINTED_DIGITS = 1e-5
# Two digits where a figure is derived.
DERIVED_DIGITS = 0.02

LIST: list[dict[str, Any]] = tomllib.loads(PRESETS.read_text(encoding="utf-8"))["preset"]
BY_NAME = {preset["name"]: preset for preset in LIST}
REQUIRED = {
    "name",
    "title",
    "description",
    "beam",
    "modulus_MPa",
    "poisson_ratio",
    "source",
    "confidence",
    "confidence_note",
}
BREAKS = {"break_force_N", "break_stress_MPa"}
FACTORS = {"modulus_factor", "strength_factor"}


def approx(value: float) -> Any:
    return pytest.approx(value, rel=PRINTED_DIGITS)


def test_names_are_unique_and_the_default_comes_first() -> None:
    assert len(BY_NAME) == len(LIST)
    assert LIST[0]["name"] == "thesis-bile-duct"


@pytest.mark.parametrize("preset", LIST, ids=BY_NAME)
def test_a_preset_is_complete(preset: dict[str, Any]) -> None:
    assert preset.keys() >= REQUIRED
    options = {"looks_like", "law", "stiffening", "relaxation", "tear_mm_per_s"}
    assert preset.keys() <= REQUIRED | BREAKS | FACTORS | options
    assert len(preset.keys() & BREAKS) == 1
    for name in ("title", "description", "source", "confidence_note"):
        assert preset[name].strip() == preset[name] != ""
        assert "  " not in preset[name]
    assert preset["confidence"] in {"high", "medium", "low"}
    for name in {"modulus_MPa"} | (preset.keys() & BREAKS):
        assert preset[name] > 0.0
    for name in preset.keys() & FACTORS:
        assert preset[name] > 1.0
    assert 0.0 <= preset["poisson_ratio"] < 0.5


@pytest.mark.parametrize("preset", LIST, ids=BY_NAME)
def test_a_beam_is_round_with_its_size_or_the_organ_s_own(preset: dict[str, Any]) -> None:
    beam = preset["beam"]
    if beam["section"] == "organ":
        assert beam.keys() == {"section"}
    else:
        assert beam["section"] == "round"
        assert {"section", "span_mm", "diameter_mm"} <= beam.keys()
        assert beam.keys() <= {"section", "span_mm", "diameter_mm", "wall_mm"}


@pytest.mark.parametrize(
    ("name", "diameter_inch", "modulus_psi"),
    [
        ("thesis-bile-duct", 0.35, 45.0),
        ("thesis-rubber", 0.4, 1500.0),
        ("thesis-thin-rubber", 0.1, 1500.0),
    ],
)
def test_thesis_figures(name: str, diameter_inch: float, modulus_psi: float) -> None:
    preset = BY_NAME[name]
    assert preset["beam"]["span_mm"] == approx(2.0 * INCH_MM)
    assert preset["beam"]["diameter_mm"] == approx(diameter_inch * INCH_MM)
    assert preset["modulus_MPa"] == approx(modulus_psi * PSI_MPA)
    assert preset["poisson_ratio"] == 0.3


def test_the_duct_of_the_thesis_tears_at_twice_its_half_load() -> None:
    assert BY_NAME["thesis-bile-duct"]["break_force_N"] == approx(2.0 * 0.4 * POUND_FORCE_N)


def test_derived_figures_follow_from_those_that_their_sources_give() -> None:
    duct = BY_NAME["porcine-bile-duct"]
    axial_stress = 0.005 * (9.3 / 2.0) / (2.0 * 1.0)
    assert duct["modulus_MPa"] == pytest.approx(
        axial_stress / (30.5 / 24.4 - 1.0), rel=DERIVED_DIGITS
    )
    assert duct["break_stress_MPa"] == pytest.approx(
        duct["modulus_MPa"] * 30.672 / 45.0, rel=DERIVED_DIGITS
    )
    cystic = BY_NAME["porcine-cystic-duct"]
    area = math.pi * (3.0 - 0.5) * 0.5
    assert cystic["break_stress_MPa"] == pytest.approx(4.8 / area, rel=DERIVED_DIGITS)
    assert cystic["modulus_MPa"] == pytest.approx(4.8 / area / (6.0 / 25.0), rel=DERIVED_DIGITS)
    ureter = BY_NAME["human-ureter"]
    assert ureter["break_stress_MPa"] == pytest.approx(902.43 / 100.0, rel=DERIVED_DIGITS)
    assert ureter["modulus_MPa"] == pytest.approx(
        ureter["break_stress_MPa"] / 0.80, rel=DERIVED_DIGITS
    )
