"""Key sections by the thesis's rule: those that the others can be interpolated from.

Every section is compared with the last key section, each about its own centroid, and becomes the
next one when the RMS distance between their curves is above the tolerance; the first and the last
are key sections. Since curves are interpolated between key sections, a sudden change would spread
over all sections before it. Where that takes one of them further away than the tolerance, the last
section before the change is a key section too: then no section differs from the organ by more than
twice the tolerance, and seldom by more than once.
"""

import numpy as np
from numpy.typing import NDArray

from organ_geometry.curves.half_curves import closed_outlines

_CORNERS = 128
_ROUNDING = 1e-12


def key_sections(
    outer: NDArray[np.float64], lumen: NDArray[np.float64] | None, tolerance: float
) -> NDArray[np.intp]:
    """Return which sections, at equal distances, are key sections by the thesis's rule."""
    boundaries = [closed_outlines(outer, _CORNERS)]
    if lumen is not None:
        boundaries.append(closed_outlines(lumen, _CORNERS))
    # Equal curves may differ in the last digit of their outlines.
    allowed = tolerance + _ROUNDING * float(np.abs(boundaries[0]).max())
    last = len(outer) - 1
    keys = [0]
    while keys[-1] < last:
        key = keys[-1]
        unlike = _rms_distances(
            [outlines[key] for outlines in boundaries],
            [outlines[key + 1 :] for outlines in boundaries],
        )
        changed = np.flatnonzero(unlike > allowed)
        following = key + 1 + int(changed[0]) if len(changed) else last
        if following > key + 1 and _largest_error(boundaries, key, following) > allowed:
            keys.append(following - 1)
        keys.append(following)
    return np.array(keys, dtype=np.intp)


def _largest_error(boundaries: list[NDArray[np.float64]], key: int, following: int) -> float:
    """Return the largest RMS distance, mm, of a section between two keys to its interpolation."""
    between = slice(key + 1, following)
    fraction = np.arange(1.0, following - key) / (following - key)
    fraction = fraction[:, np.newaxis, np.newaxis]
    mixed = [
        outlines[key] * (1.0 - fraction) + outlines[following] * fraction for outlines in boundaries
    ]
    return float(_rms_distances(mixed, [outlines[between] for outlines in boundaries]).max())


def _rms_distances(
    references: list[NDArray[np.float64]], others: list[NDArray[np.float64]]
) -> NDArray[np.float64]:
    """Return the (N,) RMS distances, mm, of outlines (N, C, 2) to references of like corners."""
    # Distances run along the reference's normal between points of the same u, each weighted by the
    # length of boundary around it. A hollow section has two boundaries and one distance.
    squares, length = np.zeros(len(others[0])), np.zeros(1)
    for reference, outlines in zip(references, others, strict=True):
        along = np.roll(reference, -1, axis=-2) - np.roll(reference, 1, axis=-2)
        steps = np.linalg.norm(along, axis=-1)
        safe = np.maximum(steps, np.finfo(np.float64).tiny)
        away = outlines - reference
        crossed = (away[..., 0] * along[..., 1] - away[..., 1] * along[..., 0]) / safe
        squares = squares + (crossed * crossed * steps).sum(axis=-1)
        length = length + steps.sum(axis=-1)
    return np.sqrt(squares / length)
