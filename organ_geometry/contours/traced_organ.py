"""The edges of an organ in a stack of images, as they are found.

A hole is a lumen where a section nearby shows it too. Edges may be moved in or out, where images
are known to show the organ too large or too small: each point along the edge's normal there, of a
chord over some points, so that noise of single points hardly turns it.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from organ_geometry.contours.edge_curve import enclosed_area, outward_normals
from organ_geometry.contours.trace_options import FoundPolarity

# A lumen is one only if another section, at most this many away, shows it too.
LUMEN_REACH = 2
# Points to either side of which the chord is taken, for an edge's normal.
_NORMAL_REACH = 3
# An edge moved in keeps this share of its radius, or is refused.
_LEAST_LEFT = 0.5


class NothingLeft(ValueError):  # noqa: N818
    """An edge that would be moved in, or a lumen's that would be moved shut, too far."""


@dataclass(frozen=True, slots=True, eq=False)
class TracedSection:
    """The edges of the organ in one slice."""

    index: int  # Number of the slice, from 0
    # (N, 2) points x = column, y = row of the outer boundary, px; pixel centres are integers and
    # the last point joins the first.
    outer: NDArray[np.float64]
    lumen: NDArray[np.float64] | None  # (M, 2) points of the lumen's boundary, px, or None
    # Whether the image shows another part of at least a twentieth of the organ's area that stands
    # out as clearly. With a seed, other things are expected in view, and this is False.
    other_component: bool
    threshold: float  # Grey level of the outer boundary
    # Whether the edge is carried on from the slice before, because no grey level closes it.
    carried: bool = False

    def moved(self, x: float, y: float) -> "TracedSection":
        """Return the section as it is in an image that begins earlier."""
        shift = np.array([x, y], np.float64)
        lumen = None if self.lumen is None else self.lumen + shift
        return replace(self, outer=self.outer + shift, lumen=lumen)

    def grown(self, shift_mm: float, pixel_size: NDArray[np.float64]) -> "TracedSection":
        """Return the section with its edges moved away from the organ's tissue."""
        outer = _moved(self.outer * pixel_size, shift_mm) / pixel_size
        lumen = self.lumen
        if lumen is not None:
            lumen = _moved(lumen * pixel_size, -shift_mm) / pixel_size
        return replace(self, outer=outer, lumen=lumen)


@dataclass(frozen=True, slots=True)
class TracedOrgan:
    """The edges of an organ in a stack of images.

    Attributes
    ----------
    sections
        The sections found, in order.
    problems
        For each other slice, why nothing was found.
    notes
        How it was found: sentences for whoever wants to know.
    """

    sections: tuple[TracedSection, ...]
    problems: dict[int, str]
    polarity: FoundPolarity
    notes: tuple[str, ...]


def with_persistent_lumens(
    sections: Sequence[TracedSection],
) -> tuple[tuple[TracedSection, ...], list[int]]:
    """Return sections without the lumens that no section near them shows, and which those are."""
    boxes = [
        None if lumen is None else (lumen.min(axis=0), lumen.max(axis=0))
        for lumen in (section.lumen for section in sections)
    ]
    dropped: list[int] = []
    result: list[TracedSection] = []
    for place, section in enumerate(sections):
        box = boxes[place]
        near = boxes[max(0, place - LUMEN_REACH) : place] + boxes[place + 1 :][:LUMEN_REACH]
        persistent = box is None or any(
            other is not None and bool((box[0] <= other[1]).all() and (other[0] <= box[1]).all())
            for other in near
        )
        if not persistent and len(sections) > 1:
            dropped.append(section.index)
            result.append(replace(section, lumen=None))
        else:
            result.append(section)
    return tuple(result), dropped


def slice_ranges(indices: Sequence[int]) -> str:
    """Return ascending numbers of slices with neighbours put together, as "3, 5-8"."""
    runs: list[list[int]] = []
    for index in indices:
        if runs and index == runs[-1][-1] + 1:
            runs[-1].append(index)
        else:
            runs.append([index])
    return ", ".join(str(run[0]) if len(run) == 1 else f"{run[0]}-{run[-1]}" for run in runs)


def _moved(points: NDArray[np.float64], shift: float) -> NDArray[np.float64]:
    """Return a closed curve moved along its normals, outwards."""
    radius = math.sqrt(enclosed_area(points) / math.pi)
    if radius + shift < _LEAST_LEFT * radius:
        raise NothingLeft(
            f"an edge of {radius:.4g} mm radius cannot be moved in by {-shift:.4g} mm: little of "
            f"it would be left"
        )
    return points + shift * outward_normals(points, min(_NORMAL_REACH, len(points) // 4))
