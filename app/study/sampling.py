# SciPy has no types.
# pyright: reportMissingTypeStubs=false
"""Draws of a study's inputs, block by block: any block can be made without those before it.

Sobol' sequences are scrambled (Owen) by the seed and wound forward to a block's first draw. Latin
hypercubes are one a block, each with a seed of its own, so that no block needs all of them. For
Sobol indices each draw has two points, A and B (the first and the second half of the columns), and
the rows A, A with one input of B for each input, B: Saltelli's design in the order of SALib.
"""

import warnings
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from app.study.distribution import Choices, Distribution

Column = NDArray[np.float64] | NDArray[np.int64]
"""(N,) numbers, or indices of choices."""


def draws(
    inputs: int, first: int, count: int, *, sampling: str, seed: int, indices: bool
) -> NDArray[np.float64]:
    """Return (rows, inputs) draws from [0, 1]: of the samples from `first` on, with their mixes.

    Parameters
    ----------
    inputs, first, count
        Number of inputs, of the first sample and of samples; a Latin hypercube is these samples.
    sampling, seed
        `sobol` or `latin-hypercube`, and the study's seed.
    indices
        Whether each sample has the `inputs` + 2 rows of Saltelli's design, or one.

    Returns
    -------
    NDArray[np.float64]
        The rows of a sample stand together.
    """
    columns = 2 * inputs if indices else inputs
    if sampling == "sobol":
        # It warns of counts that are no powers of two, which blocks may be.
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)
            engine = qmc.Sobol(columns, scramble=True, rng=seed)
            points = (engine.fast_forward(first) if first else engine).random(count)
    else:
        points = qmc.LatinHypercube(columns, rng=np.random.default_rng([seed, first])).random(count)
    if not indices:
        return points
    a, b = points[:, :inputs], points[:, inputs:]
    rows = np.repeat(a[:, None, :], inputs + 2, axis=1)
    for k in range(inputs):
        rows[:, 1 + k, k] = b[:, k]
    rows[:, -1] = b
    return rows.reshape(-1, inputs)


def drawn_columns(
    inputs: Mapping[str, Distribution | Choices], points: NDArray[np.float64]
) -> dict[str, Column]:
    """Return the values of each input at (N, inputs) draws; of choices, their indices."""
    return {name: each.at(points[:, k]) for k, (name, each) in enumerate(inputs.items())}
