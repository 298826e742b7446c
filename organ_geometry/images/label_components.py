# SciPy has no types.
# pyright: reportMissingTypeStubs=false, reportUnknownMemberType=false, reportUnknownVariableType=false, reportUnknownArgumentType=false
"""The connected parts of a label's voxels."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

DOUBTED_FRACTION = 0.02
"""A second part with more than this share of a label is a doubt."""


@dataclass(frozen=True, slots=True, eq=False)
class LabelComponents:
    """A label's largest connected part, and what is known of the second."""

    largest: NDArray[np.bool_]  # (K, J, I)
    count: int
    second: int  # voxels
    fraction: float  # of all voxels
    gap: float  # between the two, mm


def label_components(mask: NDArray[np.bool_], sizes: NDArray[np.float64]) -> LabelComponents:
    """Return the parts of a mask that is not empty, connected by faces, edges and corners.

    Parameters
    ----------
    mask, sizes
        (K, J, I) voxels and (3,) their sizes along I, J and K, mm.

    Returns
    -------
    LabelComponents
        Of parts of one size the first is the largest.
    """
    labelled: Any = ndimage.label(mask, np.ones((3, 3, 3)))
    labels, count = labelled
    voxels = np.bincount(labels.ravel())[1:]
    order = np.argsort(-voxels, kind="stable")
    largest = labels == int(order[0]) + 1
    if count < 2:
        return LabelComponents(largest, count, 0, 0.0, 0.0)
    away: Any = ndimage.distance_transform_edt(~largest, sampling=sizes[::-1])
    second = int(voxels[order[1]])
    gap = float(away[labels == int(order[1]) + 1].min())
    return LabelComponents(largest, count, second, second / int(voxels.sum()), gap)
