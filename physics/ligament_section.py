"""What a tear with a straight front leaves of a round section."""

import math
from dataclasses import dataclass

from physics.quantity import finite
from physics.section import Ring

__all__ = ["LigamentSection", "ligament"]


@dataclass(frozen=True, slots=True)
class LigamentSection:
    """The part of a section that still bears, beyond the straight front of a tear."""

    depth: float  # of the tear, as a part of the section's height, 0 to below 1
    area: float  # mm^2
    shift: float  # of its centroid away from the torn side, mm
    second_moment: float  # of area about its own centroid, mm^4
    front_distance: float  # of the front's edge from its centroid, mm
    back_distance: float  # of the fibre opposite from its centroid, mm


def ligament(ring: Ring, depth: float) -> LigamentSection:
    """Return what a tear of a depth, a part of the height, leaves of a ring or a solid ellipse.

    Returns
    -------
    LigamentSection
        Its area and second moment are good to 1e-6 of themselves up to a depth of 0.99; beyond it
        the digits that the differences of the formulas cost begin to show.

    Raises
    ------
    ValueError
        If the depth is not from 0 to below 1.

    Notes
    -----
    Of a circle of radius R about the origin, the part below y = u R is the segment of half angle
    b = arccos(-u), with the moments

        A = R^2 (b - sin b cos b),   int y dA = -(2/3) R^3 sin^3 b,
        int y^2 dA = (R^4/4) (b - sin b cos b + 2 sin^3 b cos b).

    A ring's are those of its outer circle less those of its lumen, cut by the same line; an
    ellipse's are a circle's, scaled across.

    Examples
    --------
    >>> half = ligament(Ring(area=math.pi, second_moment=math.pi / 4), 0.5)
    >>> round(half.shift, 4), round(half.second_moment, 4)
    (0.4244, 0.1098)
    """
    if not 0.0 <= finite(depth, "depth", "(part of the height)") < 1.0:
        raise ValueError(f"depth must be from 0 to below 1 of the section's height, got {depth}")
    radius = 0.5 * ring.height
    front = radius * (1.0 - 2.0 * depth)
    lumen = radius * math.sqrt(ring.hole)
    outer, inner = _segment(radius, front), _segment(lumen, front)
    # Of an ellipse the width is not the circle's.
    width = ring.area / (math.pi * (radius**2 - lumen**2))
    area, first, second = (width * (o - i) for o, i in zip(outer, inner, strict=True))
    centroid = first / area
    return LigamentSection(
        depth=float(depth),
        area=area,
        shift=-centroid,
        second_moment=second - first * centroid,
        front_distance=front - centroid,
        back_distance=radius + centroid,
    )


def _segment(radius: float, front: float) -> tuple[float, float, float]:
    """Return area, first and second moment about the middle of a circle's part below a line."""
    if front <= -radius:
        return 0.0, 0.0, 0.0
    angle = math.acos(-front / radius) if front < radius else math.pi
    sin, cos = math.sin(angle), math.cos(angle)
    swept, cube = angle - sin * cos, sin**3
    return (
        radius**2 * swept,
        -2.0 / 3.0 * radius**3 * cube,
        0.25 * radius**4 * (swept + 2.0 * cube * cos),
    )
