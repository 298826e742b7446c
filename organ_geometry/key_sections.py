"""Key sections: the sections that are kept, because the others follow from them."""

import math

import numpy as np
from numpy.typing import NDArray

from organ_geometry.half_curves import closed_outlines

_CORNERS = 128


def key_sections(
    outer: NDArray[np.float64],
    lumen: NDArray[np.float64] | None,
    tolerance: float,
) -> NDArray[np.intp]:
    """Return which sections are key sections, by the thesis's rule.

    The first section is a key section. Every section after it is compared with the last key
    section, each about its own centroid, and becomes the next key section when the RMS distance
    between their curves is above the tolerance. The last section is always kept.

    Parameters
    ----------
    outer
        (S, 16) half-curves of the outer boundaries, mm, from each section's own axis point.
    lumen
        (S, 16) half-curves of the lumen, mm, or None if the organ is solid. Its distances count
        along with the outer ones.
    tolerance
        RMS distance up to which a section counts as unchanged, mm.

    Returns
    -------
    NDArray[np.intp]
        (K,) indices of the key sections, increasing; the first is 0 and the last S-1.

    Raises
    ------
    ValueError
        If there are fewer than two sections or the tolerance is negative or not finite.
    """
    check_tolerance(tolerance)
    if len(outer) < 2:
        raise ValueError(f"an organ needs two or more sections, not {len(outer)}")
    boundaries = [closed_outlines(outer, _CORNERS)]
    if lumen is not None:
        boundaries.append(closed_outlines(lumen, _CORNERS))
    last = len(outer) - 1
    keys = [0]
    while keys[-1] < last:
        distances = _rms_distances(boundaries, keys[-1])
        changed = np.flatnonzero(distances > tolerance)
        keys.append(keys[-1] + 1 + int(changed[0]) if len(changed) else last)
    return np.array(keys, dtype=np.intp)


def check_tolerance(tolerance: float) -> None:
    """Check an RMS tolerance.

    Parameters
    ----------
    tolerance
        RMS distance, mm.

    Raises
    ------
    ValueError
        If it is negative or not finite.
    """
    if not (math.isfinite(tolerance) and tolerance >= 0.0):
        raise ValueError(f"tolerance must be 0 mm or more and finite, not {tolerance:g} mm")


def _rms_distances(boundaries: list[NDArray[np.float64]], key: int) -> NDArray[np.float64]:
    """Return the RMS distance of every section after the key section to it, mm."""
    # Distances run along the key section's normal between points of the same u, each weighted by
    # the length of boundary around it.
    squares = np.zeros(len(boundaries[0]) - key - 1)
    length = 0.0
    for outlines in boundaries:
        outline = outlines[key]
        along = np.roll(outline, -1, axis=0) - np.roll(outline, 1, axis=0)
        steps = np.linalg.norm(along, axis=1)
        safe = np.maximum(steps, np.finfo(np.float64).tiny)
        normal = np.stack([along[:, 1], -along[:, 0]], axis=1) / safe[:, np.newaxis]
        away = np.einsum("snd,nd->sn", outlines[key + 1 :] - outline, normal)
        squares += (away * away) @ steps
        length += float(steps.sum())
    return np.sqrt(squares / length)
