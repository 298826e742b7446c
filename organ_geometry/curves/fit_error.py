"""How far a section's edge points are from the half-curves fitted to them, by two measures.

A point's *normal distance* is its distance to the curve, along the curve's normal where it is
nearest. Its *algebraic distance* is y - p(x), what is left when it is put into the equation of its
half-curve y = p(x) = a0 + a1 x + ... + a6 x^6. The thesis's least squares (chapter 7) make the
algebraic ones small, which are cheap, but say nothing where a boundary is steep: near the two ends
of a section they grow beyond all bounds while the curve is near. The fit made here is for the
normal ones (`fit_half_curves`).
"""

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from organ_geometry.curves.half_curves import HalfCurves

__all__ = ["algebraic_distances", "normal_distances"]


def normal_distances(curves: HalfCurves, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return how far points are from a boundary, along its normal.

    Parameters
    ----------
    curves
        The boundary, with the short upright segments that close it.
    points
        (N, 2) points x, y, mm.

    Returns
    -------
    NDArray[np.float64]
        (N,) distances, mm, not signed.
    """
    return curves.distances(points)


def algebraic_distances(curves: HalfCurves, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return how far points are from a boundary in y, where their x is put into its equations.

    A point belongs to the half-curve that is nearer in y. Points beyond the curves' range in x, by
    a four-hundredth of its width at most where the curves were fitted to them, are put into the
    same polynomials.

    Parameters
    ----------
    curves
        The boundary.
    points
        (N, 2) points x, y, mm.

    Returns
    -------
    NDArray[np.float64]
        (N,) distances |y - p(x)|, mm.
    """
    u = (points[:, 0] - curves.middle) / curves.half_width
    halves = chebyshev.chebval(u, np.stack([curves.top, curves.bottom], axis=1))
    return np.abs(points[:, 1] - halves).min(axis=0)
