"""Vectors and matrices in three dimensions as plain numbers; functions for other kernels alone."""

from collections.abc import Callable
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from kernel_cache import kernel

F = TypeVar("F", bound=Callable[..., object])

INNER = {"error_model": "numpy", "no_cpython_wrapper": True, "no_cfunc_wrapper": True}


def outer(function: F) -> F:
    """Return a function compiled for Python and for other kernels."""
    return kernel(error_model="numpy", nogil=True)(function)


def inner(function: F) -> F:
    """Return a function compiled for other compiled ones alone: no wrapper, less to compile."""
    return kernel(**INNER)(function)


def inlined(function: F) -> F:
    """Return a function that is compiled into its callers: a call copies the state."""
    return kernel(forceinline=True, **INNER)(function)


Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Nodes = NDArray[np.int32]
Bytes = NDArray[np.int8]


Three = tuple[float, float, float]


Four = tuple[float, float, float, float]


Nine = tuple[float, float, float, float, float, float, float, float, float]


@inner
def cross(a: Three, b: Three) -> Three:
    """Return a x b."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


@inner
def dot(a: Three, b: Three) -> float:
    """Return a . b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inner
def scaled(a: Three, s: float) -> Three:
    """Return s a."""
    return (s * a[0], s * a[1], s * a[2])


@inner
def added(a: Three, b: Three) -> Three:
    """Return a + b."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


@inner
def times_cross(m: Nine, v: Three) -> Nine:
    """Return the matrix m [v], rows after one another."""
    return (
        m[1] * v[2] - m[2] * v[1],
        m[2] * v[0] - m[0] * v[2],
        m[0] * v[1] - m[1] * v[0],
        m[4] * v[2] - m[5] * v[1],
        m[5] * v[0] - m[3] * v[2],
        m[3] * v[1] - m[4] * v[0],
        m[7] * v[2] - m[8] * v[1],
        m[8] * v[0] - m[6] * v[2],
        m[6] * v[1] - m[7] * v[0],
    )


@inner
def cross_times(v: Three, m: Nine) -> Nine:
    """Return the matrix [v] m, rows after one another."""
    return (
        v[1] * m[6] - v[2] * m[3],
        v[1] * m[7] - v[2] * m[4],
        v[1] * m[8] - v[2] * m[5],
        v[2] * m[0] - v[0] * m[6],
        v[2] * m[1] - v[0] * m[7],
        v[2] * m[2] - v[0] * m[8],
        v[0] * m[3] - v[1] * m[0],
        v[0] * m[4] - v[1] * m[1],
        v[0] * m[5] - v[1] * m[2],
    )


@inner
def columns(w: float, x: float, y: float, z: float) -> tuple[Three, Three, Three]:
    """Return the columns of a unit quaternion's rotation."""
    return (
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)),
        (2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x)),
        (2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)),
    )
