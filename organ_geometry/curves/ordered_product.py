"""Products of matrices with the same bits on every processor.

BLAS sums as the processor at hand does fastest: what is read from an organ's file would differ in
its last digits from one machine to the next, and a run with it. Powers above the square are written
as products for the same reason.
"""

import numpy as np
from numpy.typing import NDArray


def ordered_product(
    a: NDArray[np.float64], b: NDArray[np.float64] | NDArray[np.int64]
) -> NDArray[np.float64]:
    """Return a @ b of (N, K) and (K, M), each sum taken term after term."""
    total = np.zeros((a.shape[0], b.shape[1]))
    for column, row in zip(a.T, b, strict=True):
        total += column[:, np.newaxis] * row
    return total
