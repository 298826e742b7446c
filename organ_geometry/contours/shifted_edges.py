"""Edges moved in or out, where images are known to show the organ too large or too small."""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from organ_geometry.contours.edge_curve import enclosed_area, outward_normals
from organ_geometry.contours.traced_organ import TracedSection

_REACH = 3
_LEAST_LEFT = 0.5


class NothingLeft(ValueError):  # noqa: N818
    """An edge that would be moved in, or a lumen's that would be moved shut, too far."""


def shifted_section(
    section: TracedSection, shift: float, pixel_size: NDArray[np.float64]
) -> TracedSection:
    """Return a section whose edges are moved away from the organ's tissue."""
    if shift == 0.0:
        return section
    outer = _moved(section.outer * pixel_size, shift) / pixel_size
    lumen = section.lumen
    if lumen is not None:
        lumen = _moved(lumen * pixel_size, -shift) / pixel_size
    return replace(section, outer=outer, lumen=lumen)


def _moved(points: NDArray[np.float64], shift: float) -> NDArray[np.float64]:
    """Return a closed curve moved along its normals, outwards."""
    radius = math.sqrt(enclosed_area(points) / math.pi)
    if radius + shift < _LEAST_LEFT * radius:
        raise NothingLeft(
            f"an edge of {radius:.4g} mm radius cannot be moved in by {-shift:.4g} mm: little of "
            f"it would be left"
        )
    # Chords over some points, so that noise of single points hardly turns the normals.
    return points + shift * outward_normals(points, min(_REACH, len(points) // 4))
