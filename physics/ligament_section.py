"""What a tear with a straight front leaves of a round section: the same bits on every processor."""

import math
from dataclasses import dataclass

from physics.quantity import finite
from physics.section import Ring


@dataclass(frozen=True, slots=True)
class LigamentSection:
    """The part of a section that still bears, beyond the straight front of a tear."""

    depth: float  # of the tear, as a part of the section's height, 0 to below 1
    area: float  # mm^2
    shift: float  # of its centroid away from the torn side, mm
    second_moment: float  # of area about its own centroid, mm^4
    front_distance: float  # of the front's edge from its centroid, mm
    back_distance: float  # of the fibre opposite from its centroid, mm
    across: float  # second moment of area about its axis of symmetry, mm^4
    half_width: float  # where it is widest, mm


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
        int y^2 dA = (R^4/4) (b - sin b cos b + 2 sin^3 b cos b),
        int x^2 dA = (R^4/4) (b - sin b cos b - (2/3) sin^3 b cos b).

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
    width = ring.area / (math.pi * (radius * radius - lumen * lumen))
    area, first, second, across = (width * (o - i) for o, i in zip(outer, inner, strict=True))
    centroid = first / area
    return LigamentSection(
        depth=float(depth),
        area=area,
        shift=-centroid,
        second_moment=second - first * centroid,
        front_distance=front - centroid,
        back_distance=radius + centroid,
        across=width * width * across,
        half_width=width * math.sqrt(radius * radius - min(front, 0.0) * min(front, 0.0)),
    )


def _segment(radius: float, front: float) -> tuple[float, float, float, float]:
    """Return area, first moment and both second moments of a circle's part below a line."""
    # About the middle: along the line's normal, and last about that.
    if front <= -radius:
        return 0.0, 0.0, 0.0, 0.0
    cos = -front / radius if front < radius else -1.0
    sin = math.sqrt((1.0 - cos) * (1.0 + cos))
    cube = sin * sin * sin * cos
    swept, square = _angle(cos, sin) - sin * cos, radius * radius
    return (
        square * swept,
        -2.0 / 3.0 * radius * square * sin * sin * sin,
        0.25 * square * square * (swept + 2.0 * cube),
        0.25 * square * square * (swept - 2.0 / 3.0 * cube),
    )


def _angle(cos: float, sin: float) -> float:
    """Return the angle from 0 to pi of a cosine and a sine, to 1e-15; no library's acos."""
    if cos < 0.0:
        return math.pi - _angle(-cos, sin)
    for _ in range(3):
        half = math.sqrt(0.5 * (1.0 + cos))
        cos, sin = half, 0.5 * sin / half
    tangent = sin / cos
    square, series = tangent * tangent, 0.0
    for n in range(27, 0, -2):  # the arc tangent's, below 0.2
        series = 1.0 / n - square * series
    return 8.0 * tangent * series
