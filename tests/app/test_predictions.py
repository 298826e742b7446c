"""Published experiments predicted: files, draws, the committed page, and wrong files."""

import math
import re
from pathlib import Path

import pytest
from program import refused, run

from app.validation.predictions import Prediction, predicted, read_experiment, shipped
from app.validation.predictions_page import predictions_page

ROOT = Path(__file__).parents[2]
FORCE = ROOT / "assets" / "experiments" / "cystic-duct-force.toml"
STRAIGHT = """\
title = "A tube"
source = "made"
protocol = "pulled"
load = "along"
quantity = "{quantity}"
unit = "{unit}"
law = "linear"
mean = {mean}
sd = 1.0
n = 4
figures = "made"
why = "made"
inputs.length = {{ unit = "mm", source = "made", value = 20.0 }}
inputs.diameter = {{ unit = "mm", source = "made", value = 4.0 }}
inputs.wall = {{ unit = "mm", source = "made", value = 1.0 }}
inputs.modulus = {{ unit = "MPa", source = "made", value = 5.0 }}
inputs.strength = {{ unit = "MPa", source = "made", distribution = "normal", mean = 2.0, sd = 0.2 }}
"""


@pytest.fixture(scope="module")
def found() -> list[Prediction]:
    return [predicted(each) for each in shipped()]


@pytest.mark.parametrize(("quantity", "unit", "each"), [("force", "N", 3.0 * math.pi),
                                                        ("elongation", "mm", 4.0)])  # fmt: skip
def test_a_straight_pull_is_strength_by_area_and_by_modulus(
    quantity: str, unit: str, each: float, tmp_path: Path
) -> None:
    path = tmp_path / "e.toml"
    path.write_text(STRAIGHT.format(quantity=quantity, unit=unit, mean=2.0 * each + 1.0))
    ours = predicted(read_experiment(path))
    assert (ours.mean, ours.sd) == pytest.approx((2.0 * each, 0.2 * each), rel=5e-3)
    assert ours.z == pytest.approx(1.0 / math.hypot(1.0, 0.2 * each), rel=2e-2)
    assert ours.lost == 0.0


def test_eight_experiments_or_more_have_sources_for_all_that_they_take(
    found: list[Prediction],
) -> None:
    assert len(found) >= 8
    for each in found:
        of = each.experiment
        assert of.source
        assert of.why.endswith(".")
        assert all(one.source for one in of.inputs.values())
        assert each.low < each.median < each.high
        assert math.isfinite(each.z)


def test_the_committed_page_is_what_is_predicted(found: list[Prediction]) -> None:
    page, committed = predictions_page(found), (ROOT / "docs" / "predictions.md").read_text()
    number = re.compile(r"[-+]?\d+(?:\.\d+)?")
    assert number.sub("#", page) == number.sub("#", committed)
    numbers = ([float(each) for each in number.findall(text)] for text in (page, committed))
    assert next(numbers) == pytest.approx(next(numbers), rel=2e-2, abs=0.11)


def test_the_peel_s_energy_follows_from_its_force(found: list[Prediction]) -> None:
    """2 F (1 + e/2), e the arms' stretch: what Sommer printed, within its own scatter."""
    by_title = {each.experiment.title: each for each in found}
    for word, energy in (("round", 51.0), ("lengthwise", 76.0)):
        ours = by_title[f"Media of human aortas peeled {word}: energy from force"]
        assert ours.median == pytest.approx(energy, rel=0.12)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('unit = "N"\n', "", "Object missing required field `unit`"),
        ('unit = "N"\n', 'unit = "lbf"\n', "unit of force must be N, got 'lbf'"),
        ('load = "along"', 'load = "twist"', "load must be one of along, avulsion"),
        ('quantity = "force"', 'quantity = "mass"', "quantity of along must be one of elongation"),
        ("[inputs.wall]", "[inputs.walls]", "inputs of along for force are diameter, length"),
        ('[inputs.wall]\nunit = "mm"', '[inputs.wall]\nunit = "cm"', "inputs.wall must be mm"),
        ('[inputs.wall]\nunit = "mm"\n', "[inputs.wall]\n", "missing required field `unit`"),
        ("low = 0.3\n", "", "inputs.wall: a uniform distribution is given by low and high"),
        ("sd = 1.47", "sd = 0", "sd above 0 and n 1 or more"),
        ('title = "', 'titel = "', "unknown field `titel`"),
        ('law = "neo-hooke"', 'law = "gum"', "Invalid enum value 'gum'"),
    ],
)
def test_what_is_wrong_in_a_file_is_named(old: str, new: str, message: str, tmp_path: Path) -> None:
    text = FORCE.read_text()
    assert old in text
    path = tmp_path / "mine.toml"
    path.write_text(text.replace(old, new, 1))
    assert message in refused(["validate", "--experiment", path])


def test_the_command_predicts_one_experiment() -> None:
    message = run("validate", "--experiment", FORCE).stdout
    assert "4.8 (1.47) N, n = 10" in message
    assert "z                  -0.7" in message
    assert "writes no page" in refused(["validate", "--experiment", FORCE, "-o", "docs"])
