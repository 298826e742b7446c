"""The edges of an organ in a stack of images, as they are found."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from organ_geometry.contours.edges import FoundPolarity


@dataclass(frozen=True, slots=True, eq=False)
class TracedSection:
    """The edges of the organ in one slice.

    Attributes
    ----------
    index
        Number of the slice, from 0.
    outer
        (N, 2) points x = column, y = row of the outer boundary, px; pixel centres are integers and
        the last point joins the first.
    lumen
        (M, 2) points of the lumen's boundary, px, or None.
    other_part
        Whether the image shows another part of at least a twentieth of the organ's area that stands
        out as clearly. With a seed, other things are expected in view, and this is False.
    threshold
        Grey level of the outer boundary.
    carried
        Whether the edge is carried on from the slice before, because no grey level closes it.
    """

    index: int
    outer: NDArray[np.float64]
    lumen: NDArray[np.float64] | None
    other_part: bool
    threshold: float
    carried: bool = False

    def moved(self, x: float, y: float) -> "TracedSection":
        """Return the section as it is in an image that begins earlier."""
        shift = np.array([x, y], np.float64)
        lumen = None if self.lumen is None else self.lumen + shift
        return replace(self, outer=self.outer + shift, lumen=lumen)


@dataclass(frozen=True, slots=True)
class TracedOrgan:
    """The edges of an organ in a stack of images.

    Attributes
    ----------
    sections
        The sections found, in order.
    problems
        For each other slice, why nothing was found.
    polarity
        Whether the organ is brighter or darker than its surroundings.
    notes
        How it was found: sentences for whoever wants to know.
    """

    sections: tuple[TracedSection, ...]
    problems: dict[int, str]
    polarity: FoundPolarity
    notes: tuple[str, ...]
