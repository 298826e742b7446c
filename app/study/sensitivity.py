# SALib has no types.
# pyright: reportMissingTypeStubs=false, reportUnknownMemberType=false
# pyright: reportUnknownVariableType=false, reportUnknownArgumentType=false
"""Sobol indices: the part of an output's variance that each input explains."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

RESAMPLES = 200


@dataclass(frozen=True, slots=True)
class Index:
    """The indices of one input, with half widths of their 95 % bands by resampling."""

    name: str
    first: float  # part of the variance that falls away on average once the input is known
    first_half: float
    total: float  # part that is left, on average, once all others are known
    total_half: float


def sobol_indices(names: list[str], values: NDArray[np.float64], *, seed: int = 1) -> list[Index]:
    """Return the indices of inputs from the rows of `draws` with `indices`, by SALib.

    Parameters
    ----------
    names
        Of the D inputs.
    values
        (N (D + 2),) an output in all rows, in order. Samples with a value that is not finite are
        left out.
    seed
        Of the resampling.

    Returns
    -------
    list[Index]
        One for each input; all nan where the output does not vary.
    """
    from SALib.analyze import sobol

    mixes = len(names) + 2
    rows = values.reshape(-1, mixes)
    rows = rows[np.isfinite(rows).all(axis=1)]
    if len(rows) < 2 or np.ptp(rows) == 0.0:
        return [Index(name, np.nan, np.nan, np.nan, np.nan) for name in names]
    problem = {"num_vars": len(names), "names": names}
    found = sobol.analyze(
        problem,
        rows.ravel(),
        calc_second_order=False,
        num_resamples=RESAMPLES,
        seed=seed,
    )
    columns = (found[key] for key in ("S1", "S1_conf", "ST", "ST_conf"))
    return [
        Index(name, *(float(each) for each in row))
        for name, *row in zip(names, *columns, strict=True)
    ]
