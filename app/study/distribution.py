# SciPy has no types.
# pyright: reportMissingTypeStubs=false
"""Distributions of an input, by their quantile functions: a draw from [0, 1] gives a value."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Row = NDArray[np.float64]

EDGE = 2.0**-53
"""Draws are kept this far from 0 and 1, where a quantile may be infinite."""


@dataclass(frozen=True, slots=True)
class Choices:
    """Discrete values, each with its probability."""

    values: tuple[object, ...]
    weights: tuple[float, ...]

    def at(self, draws: Row) -> NDArray[np.int64]:
        """Return the (N,) indices of the values that draws from [0, 1] give."""
        fractions = np.cumsum(self.weights) / math.fsum(self.weights)
        return np.minimum(np.searchsorted(fractions, draws, side="right"), len(self.values) - 1)


@dataclass(frozen=True, slots=True)
class Distribution:
    """A continuous distribution."""

    shape: str  # of `SHAPES`
    parameters: dict[str, float]  # by name, as in the plan

    def at(self, draws: Row) -> Row:
        """Return the (N,) values that draws from [0, 1] give."""
        quantile = SHAPES[self.shape].quantile(self.parameters)
        return quantile(np.clip(draws, EDGE, 1.0 - EDGE))


@dataclass(frozen=True, slots=True)
class Shape:
    """A family of distributions: the sets of parameters that give one, and those it may have."""

    given_by: tuple[tuple[str, ...], ...]
    optional: tuple[str, ...]
    quantile: Callable[[dict[str, float]], Callable[[Row], Row]]


def _uniform(given: dict[str, float]) -> Callable[[Row], Row]:
    low, high = given["low"], given["high"]
    return lambda draws: low + draws * (high - low)


def _log_uniform(given: dict[str, float]) -> Callable[[Row], Row]:
    if given["low"] <= 0.0:
        raise ValueError(f"low must be above 0, got {given['low']:g}")
    low, high = math.log(given["low"]), math.log(given["high"])
    return lambda draws: np.exp(low + draws * (high - low))


def _triangular(given: dict[str, float]) -> Callable[[Row], Row]:
    low, mode, high = given["low"], given["mode"], given["high"]
    if not low <= mode <= high:
        raise ValueError(f"mode must lie between low and high, got {mode:g}")
    left, width = mode - low, high - low

    def quantile(draws: Row) -> Row:
        rising = low + np.sqrt(draws * left * width)
        falling = high - np.sqrt((1.0 - draws) * (high - mode) * width)
        return np.where(draws * width < left, rising, falling)

    return quantile


def _normal(given: dict[str, float]) -> Callable[[Row], Row]:
    _above_zero(given, "sd")
    return _cut_normal(given["mean"], given["sd"], given.get("low"), given.get("high"))


def _log_normal(given: dict[str, float]) -> Callable[[Row], Row]:
    if "median" in given:
        _above_zero(given, "median")
        if given["factor"] <= 1.0:
            raise ValueError(
                f"factor, the geometric standard deviation, must be above 1, got "
                f"{given['factor']:g}"
            )
        centre, sd = math.log(given["median"]), math.log(given["factor"])
    else:
        _above_zero(given, "mean", "sd")
        variance = math.log1p((given["sd"] / given["mean"]) ** 2)
        centre, sd = math.log(given["mean"]) - 0.5 * variance, math.sqrt(variance)
    cuts = [given.get(name) for name in ("low", "high")]
    if cuts[1] is not None and cuts[1] <= 0.0:
        raise ValueError(f"high must be above 0, got {cuts[1]:g}")
    low, high = (None if cut is None or cut <= 0.0 else math.log(cut) for cut in cuts)
    of_log = _cut_normal(centre, sd, low, high)
    return lambda draws: np.exp(of_log(draws))


def _cut_normal(
    mean: float, sd: float, low: float | None, high: float | None
) -> Callable[[Row], Row]:
    from scipy.special import ndtr, ndtri

    first = 0.0 if low is None else float(ndtr((low - mean) / sd))
    last = 1.0 if high is None else float(ndtr((high - mean) / sd))
    if last - first < 1e-9:
        raise ValueError("low and high leave nothing of the distribution")

    def quantile(draws: Row) -> Row:
        found = mean + sd * ndtri(first + draws * (last - first))
        return np.clip(found, low, high) if (low, high) != (None, None) else found

    return quantile


def _above_zero(given: dict[str, float], *names: str) -> None:
    for name in names:
        if given[name] <= 0.0:
            raise ValueError(f"{name} must be above 0, got {given[name]:g}")


# Distributions by name.
SHAPES: dict[str, Shape] = {
    "uniform": Shape((("low", "high"),), (), _uniform),
    "loguniform": Shape((("low", "high"),), (), _log_uniform),
    "triangular": Shape((("low", "mode", "high"),), (), _triangular),
    "normal": Shape((("mean", "sd"),), ("low", "high"), _normal),
    "lognormal": Shape((("median", "factor"), ("mean", "sd")), ("low", "high"), _log_normal),
}


def distribution_of(shape: str, given: dict[str, float]) -> Distribution:
    """Return a distribution from its parameters; a `ValueError` says what is wrong with them."""
    if shape not in SHAPES:
        raise ValueError(f"distribution must be one of {', '.join(SHAPES)}, got {shape!r}")
    family = SHAPES[shape]
    known = {name for names in family.given_by for name in names} | set(family.optional)
    for name in given:
        if name not in known:
            raise ValueError(f"a {shape} distribution has no {name!r}, only {_words(family)}")
    needed = [names for names in family.given_by if set(names) <= set(given)]
    extra = {name for names in family.given_by for name in names} & set(given)
    if len(needed) != 1 or extra != set(needed[0]):
        raise ValueError(f"a {shape} distribution is given by {_words(family)}")
    for name, value in given.items():
        if not math.isfinite(value):
            raise ValueError(f"{name} must be a finite number, got {value}")
    if "low" in given and "high" in given and not given["low"] < given["high"]:
        raise ValueError(f"low must be below high, got {given['low']:g} and {given['high']:g}")
    family.quantile(given)
    return Distribution(shape, dict(given))


def _words(family: Shape) -> str:
    pairs = " or ".join(" and ".join(names) for names in family.given_by)
    return f"{pairs}; low and high cut it off" if family.optional else pairs
