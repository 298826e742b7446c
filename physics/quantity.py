"""Checks of the numbers that enter the physics: named, with their unit and what would be right."""

import math

import numpy as np
from numpy.typing import NDArray


def finite(value: float, name: str, unit: str) -> float:
    """Return the value as a float if it is a finite number."""
    number = _number(value, name, unit)
    if not math.isfinite(number):
        raise ValueError(f"{name} must be a finite number of {unit}, got {number}")
    return number


def positive(value: float, name: str, unit: str) -> float:
    """Return the value as a float if it is finite and above zero."""
    number = _number(value, name, unit)
    if not (math.isfinite(number) and number > 0.0):
        raise ValueError(f"{name} must be above 0 {unit}, got {number} {unit}")
    return number


def _number(value: float, name: str, unit: str) -> float:
    """Return the value as a float; text is none, whatever it says."""
    if isinstance(value, str | bytes):
        raise ValueError(f"{name} must be a number of {unit}, got the text {value!r}")
    return float(value)


def stations_on(span: float, stations: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return (N,) stations, mm from the first clamp, as floats; they must all lie on the span."""
    row = np.asarray(stations, dtype=np.float64)
    if row.ndim != 1:
        raise ValueError(f"stations must be a row of distances in mm, got shape {row.shape}")
    if row.size and not (row.min() >= 0.0 and row.max() <= span):
        raise ValueError(
            f"stations must lie from 0 to the span of {span} mm, got {row.min()} to {row.max()} mm"
        )
    return row
