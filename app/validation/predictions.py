"""Published experiments, predicted from constants of other papers: files, draws and z.

An experiment is a TOML file: what was measured (mean, sd, n), how it was loaded, and the inputs of
the prediction, each with its unit, its value or distribution and its source. Draws of the inputs
give a distribution of predictions, as in a study.
"""

import math
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path

import msgspec
import numpy as np
from numpy.typing import NDArray

from app.bounded_file import decoded, read_bounded
from assets import EXPERIMENTS
from physics import Beam, LawName, NoEquilibrium, law_named
from physics.bed.avulsion import avulse
from physics.bed.peel_theory import peel_force, peel_toughness
from physics.load_cases import inflate, rupture_along

Draw = Mapping[str, float]

MOST_BYTES = 100_000
DRAWS, SEED = 512, 1


class Input(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """What a prediction takes as known: a value, or a distribution as in a study's plan."""

    unit: str
    source: str
    value: float | None = None
    distribution: str | None = None
    mean: float | None = None
    sd: float | None = None
    median: float | None = None
    factor: float | None = None
    mode: float | None = None
    low: float | None = None
    high: float | None = None


class Experiment(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A published experiment and what its prediction is made from."""

    title: str
    source: str
    protocol: str
    load: str  # of `LOADS`
    quantity: str
    unit: str
    mean: float
    n: int
    inputs: dict[str, Input]
    why: str  # a sentence on how near it comes
    figures: str  # how mean and sd follow from what is printed
    sd: float | None = None
    law: LawName = "neo-hooke"
    stiffening: float | None = None


class Prediction(msgspec.Struct, frozen=True):
    """An experiment beside what is predicted of it."""

    experiment: Experiment
    mean: float
    sd: float
    low: float  # 5 % of the draws are below
    median: float
    high: float  # 5 % are above
    z: float  # (theirs - ours)/sqrt(sd^2 + sd^2)
    lost: float  # share of draws that do not bear the load, of which nothing is predicted


def _tube(x: Draw) -> Beam:
    return Beam.round(
        span=x.get("length", 1.0),
        diameter=x["diameter"],
        wall=x["wall"],
        modulus=x["modulus"],
        poisson_ratio=0.3,
    )


def _along(experiment: Experiment, x: Draw) -> Draw:
    law = law_named(experiment.law, stiffening=experiment.stiffening)
    torn = rupture_along(_tube(x), law, x["strength"])
    return {"force": torn.force, "elongation": torn.elongation}


def _avulsion(experiment: Experiment, x: Draw) -> Draw:
    law = law_named(experiment.law, stiffening=experiment.stiffening)
    torn = avulse(_tube(x), law, x["strength"], math.radians(x["angle"]))
    return {"force": torn.force, "elongation": torn.moved}


def _inflation(_: Experiment, x: Draw) -> Draw:
    blown = inflate(_tube(x), 1e-3 * x["pressure"])
    return {"length": blown.length, "diameter": blown.diameter}


def _burst(_: Experiment, x: Draw) -> Draw:
    # Laplace: the nominal hoop stress times the wall at rest is p r of the bore as it is then.
    return {"pressure": 1e3 * x["strength"] * x["wall"] / (0.5 * x["bore"])}


def _peel(_: Experiment, x: Draw) -> Draw:
    # A T is two arms at a right angle to the front, each with half of the toughness; 1 J/m2 is
    # 1e-3 N/mm.
    stretching = x["modulus"] * x["thickness"]
    if "toughness" in x:
        force = peel_force(0.5 * math.pi, 0.5e-3 * x["toughness"], stretching)
        return {"force_per_width": 1e3 * force}
    toughness = peel_toughness(1e-3 * x["force_per_width"], 0.5 * math.pi, stretching)
    return {"toughness": 2e3 * toughness}


UNITS = {
    "angle": "deg",
    "bore": "mm",
    "diameter": "mm",
    "elongation": "mm",
    "force": "N",
    "force_per_width": "mN/mm",
    "length": "mm",
    "modulus": "MPa",
    "pressure": "kPa",
    "strength": "MPa",
    "thickness": "mm",
    "toughness": "J/m2",
    "wall": "mm",
}
TUBE = {"length", "diameter", "wall", "modulus"}
LOADS: dict[
    str, tuple[Callable[[Experiment, Draw], Draw], tuple[tuple[set[str], set[str]], ...]]
] = {
    "along": (_along, ((TUBE | {"strength"}, {"force", "elongation"}),)),
    "avulsion": (_avulsion, ((TUBE | {"strength", "angle"}, {"force", "elongation"}),)),
    "inflation": (_inflation, ((TUBE | {"pressure"}, {"length", "diameter"}),)),
    "burst": (_burst, (({"bore", "wall", "strength"}, {"pressure"}),)),
    "peel": (
        _peel,
        (
            ({"toughness", "modulus", "thickness"}, {"force_per_width"}),
            ({"force_per_width", "modulus", "thickness"}, {"toughness"}),
        ),
    ),
}
"""How a specimen is loaded: the prediction of a draw, and the inputs that each quantity needs."""


def shipped() -> list[Experiment]:
    """Return the experiments that ship, by their files' names."""
    return [read_experiment(path) for path in sorted(EXPERIMENTS.glob("*.toml"))]


def read_experiment(path: Path) -> Experiment:
    """Return the experiment in a file; a `ValueError` says what is wrong with it."""
    content = read_bounded(path, MOST_BYTES, "experiment")
    name = f"{path} is no experiment"
    found = decoded(msgspec.toml.decode, content, Experiment, name, lines=True)
    if found.load not in LOADS:
        raise ValueError(f"{path}: load must be one of {', '.join(LOADS)}, got {found.load!r}")
    cases = LOADS[found.load][1]
    quantities = sorted({name for _, given in cases for name in given})
    fitting = [needs for needs, given in cases if found.quantity in given]
    if not fitting:
        raise ValueError(
            f"{path}: quantity of {found.load} must be one of {', '.join(quantities)}, got "
            f"{found.quantity!r}"
        )
    if set(found.inputs) != fitting[0]:
        raise ValueError(
            f"{path}: inputs of {found.load} for {found.quantity} are "
            f"{', '.join(sorted(fitting[0]))}, got {', '.join(sorted(found.inputs)) or 'none'}"
        )
    if found.unit != UNITS[found.quantity]:
        raise ValueError(
            f"{path}: unit of {found.quantity} must be {UNITS[found.quantity]}, got {found.unit!r}"
        )
    for key, each in found.inputs.items():
        if each.unit != UNITS[key]:
            raise ValueError(
                f"{path}: unit of inputs.{key} must be {UNITS[key]}, got {each.unit!r}"
            )
        if not each.source.strip():
            raise ValueError(f"{path}: inputs.{key} has no source")
        if (each.value is None) == (each.distribution is None):
            raise ValueError(f"{path}: inputs.{key} must have either a value or a distribution")
    if found.n < 1 or not math.isfinite(found.mean) or (found.sd is not None and found.sd <= 0.0):
        raise ValueError(f"{path}: mean must be a number, sd above 0 and n 1 or more")
    law_named(found.law, stiffening=found.stiffening)
    return found


def predicted(experiment: Experiment) -> Prediction:
    """Return the distribution of predictions, and how far off it is.

    Parameters
    ----------
    experiment
        As it was read.

    Returns
    -------
    Prediction

    Raises
    ------
    ValueError
        If an input has no such distribution, or no draw of them can be.
    """
    columns = _columns(experiment)
    count = next(iter(columns.values())).size
    predict = LOADS[experiment.load][0]
    values: list[float] = []
    for k in range(count):
        draw = {name: float(column[k]) for name, column in columns.items()}
        with suppress(NoEquilibrium):
            values.append(predict(experiment, draw)[experiment.quantity])
    if not values:
        raise ValueError(f"{experiment.title}: no draw of the inputs bears the load")
    found = np.array(values)
    mean, sd = float(found.mean()), float(found.std(ddof=1)) if found.size > 1 else 0.0
    low, median, high = (float(each) for each in np.quantile(found, [0.05, 0.5, 0.95]))
    both = math.hypot(sd, experiment.sd or 0.0)
    z = (experiment.mean - mean) / both if both > 0.0 else math.nan
    return Prediction(experiment, mean, sd, low, median, high, z, 1.0 - found.size / count)


def _columns(experiment: Experiment) -> dict[str, NDArray[np.float64]]:
    """Return the draws of each input, by a scrambled Sobol' sequence."""
    try:
        from app.study.distribution import distribution_of
        from app.study.sampling import draws
    except ImportError as error:
        raise ValueError("predictions need SciPy: pip install 'bluntdissect[report]'") from error
    drawn = {name: each for name, each in experiment.inputs.items() if each.value is None}
    points = draws(max(len(drawn), 1), 0, DRAWS, sampling="sobol", seed=SEED, indices=False)
    columns: dict[str, NDArray[np.float64]] = {}
    for name, each in experiment.inputs.items():
        if each.value is not None:
            columns[name] = np.full(DRAWS, each.value)
            continue
        given = msgspec.to_builtins(each)
        parameters = {
            key: float(value)
            for key, value in given.items()
            if key not in ("unit", "source", "distribution", "value") and value is not None
        }
        try:
            shape = distribution_of(str(each.distribution), parameters)
        except ValueError as error:
            raise ValueError(f"{experiment.title}: inputs.{name}: {error}") from None
        columns[name] = shape.at(points[:, list(drawn).index(name)])
    return columns
