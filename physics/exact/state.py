"""The arrays that the kernels of the exact beam work on, and how those are compiled.

Numba compiles a function once more for each type of an argument, and leaves out what an argument
that is None rules out: `fibres`, which the linear law has none of, decides on the law, and the
nodes of the grasps, `grasp` (None for the half of a symmetric beam) and `second`, on the steps that
are compiled. It also compiles once more for each constant: `int(...)` around one spares that. Loops
are written out because assignments of whole arrays take it seconds.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from physics.exact.symbols import *

KERNEL: dict[str, Any] = {
    "cache": True,
    "error_model": "numpy",
    "no_cfunc_wrapper": True,
    "_nrt": False,
}
"""How kernels are compiled: division by zero gives infinity, nothing calls them by address, and
they make no arrays, so that none need be counted."""

Array = NDArray[np.float64]
Five = tuple[float, float, float, float, float]
Six = tuple[float, float, float, float, float, float]


State = tuple[Array, Array, Array, Array, Array, Array]
"""A beam between two Newton steps: `nodes`, `elements`, `points` and `line`, whose rows and entries
are in `symbols`; `memory`, all of these and the fibres in one row; and room for a copy of it. Not a
named tuple, which takes 2 us longer to hand over."""


def new_state(elements: int, point_rows: int, fibre_rows: int) -> tuple[State, Array | None]:
    """Return zeros for a beam of that many elements, and its fibres, None if they have no rows."""
    shapes = (
        (NODE_ROWS, elements + 1),
        (ELEMENT_ROWS, elements),
        (point_rows, 2 * elements),
        (fibre_rows, 6 * elements),
    )
    ends = np.cumsum([rows * columns for rows, columns in shapes])
    memory = np.zeros(int(ends[-1]) + LINE_SIZE)
    nodes, elements_, points, fibres = (
        memory[end - rows * columns : end].reshape(rows, columns)
        for end, (rows, columns) in zip(ends.tolist(), shapes, strict=True)
    )
    state = (nodes, elements_, points, memory[-LINE_SIZE:], memory, np.empty_like(memory))
    return state, fibres if fibre_rows else None


def gauss_points(bounds: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return where the columns of `points` are, of elements between bounds, parts of the span."""
    lengths = np.diff(bounds)
    middles = bounds[:-1] + 0.5 * lengths
    at = np.empty(2 * lengths.size)
    at[0::2] = middles - GAUSS * lengths
    at[1::2] = middles + GAUSS * lengths
    return at
