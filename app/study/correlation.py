# SciPy has no types.
# pyright: reportMissingTypeStubs=false
"""Inputs of a study that go together: a Gaussian copula with given rank correlations.

Even draws u become normal ones, z = Phi^-1(u), are mixed by the factor L of a correlation matrix
R = L L^T, and become even again, Phi(L z): each input keeps its own distribution. Spearman's
rank correlation rho_s of two of them follows from that of the normal numbers by
r = 2 sin(pi rho_s / 6).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Correlation:
    """Spearman's rank correlation of two inputs."""

    one: str
    other: str
    rank: float  # between -1 and 1


def copula_factor(names: Sequence[str], correlations: Sequence[Correlation]) -> Floats:
    """Return the (D, D) lower triangular factor L for inputs in this order.

    Parameters
    ----------
    names, correlations
        Of the D inputs; those of pairs that are not given are 0.

    Returns
    -------
    Floats

    Raises
    ------
    ValueError
        If no inputs can have these correlations.
    """
    size = len(names)
    matrix = np.eye(size)
    for each in correlations:
        i, j = names.index(each.one), names.index(each.other)
        matrix[i, j] = matrix[j, i] = 2.0 * math.sin(math.pi * each.rank / 6.0)
    # Cholesky in plain order, so that no library's blocks give other last digits elsewhere.
    low = np.zeros_like(matrix)
    for i in range(size):
        for j in range(i + 1):
            left = float(matrix[i, j]) - math.fsum(low[i, :j] * low[j, :j])
            if i != j:
                low[i, j] = left / low[j, j]
            elif left <= 1e-12:
                raise ValueError(
                    f"no inputs can have these correlations: with those before it, {names[i]} "
                    "would be known more than wholly; make one of them weaker"
                )
            else:
                low[i, i] = math.sqrt(left)
    return low


def correlated(points: Floats, factor: Floats) -> Floats:
    """Return (N, D) draws from [0, 1] that go together, from (N, D) independent ones."""
    from scipy.special import ndtr, ndtri

    edge = 2.0**-53
    normal = ndtri(np.clip(points, edge, 1.0 - edge))
    out = points.copy()
    for i in range(factor.shape[0]):
        if not factor[i, :i].any():
            continue
        mixed = factor[i, i] * normal[:, i]
        for j in range(i):
            mixed += factor[i, j] * normal[:, j]
        out[:, i] = ndtr(mixed)
    return out
