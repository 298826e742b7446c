"""A beam in space at rest: its nodes, frames, stiffnesses and ends.

The axis through given points is a cubic spline with not-a-knot ends, walked in 64 parts a piece by
the trapezoidal rule of its speed to get arc lengths s, mm. Nodes are even in s between those that
hooks need. A node's frame R (a unit quaternion) has the columns tangent t, across and up; from node
to node it is carried by the smallest rotation from t_i to t_i+1, so that a curved beam at rest is
not twisted (parallel transport). docs/theory.md has the beam's equations [Simo 1985].
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from physics.beam import Beam
from physics.bed import kernels
from physics.exact.exact import Law
from physics.exact.fibre_laws import FibreLaw
from physics.exact.linear_law import Linear
from physics.quantity import finite, positive
from physics.section import Ring

End = Literal["clamped", "pinned", "sliding", "roller", "free"]
"""How an end is held: clamped does not move or turn, pinned turns, sliding moves along x, roller
does both, free is not held."""

HELD: dict[End, int] = {"clamped": 63, "pinned": 7, "sliding": 62, "roller": 6, "free": 0}
"""Bits of what is held: 1 2 4 along x y z, 8 16 32 turning about them."""

Floats = NDArray[np.float64]

LINEAR = Linear(shear=True)

STIFFNESSES = ("axial", "shear across", "shear up", "torsion", "bending up", "bending across")
"""Columns of `SpaceBeam.stiffness`: bending up is in the plane of the axis and up."""

# A hook that is nearer to an end than this part of an element holds the end: in an element so short
# the rounding of places would be a force.
NEAR_END = 2e-3
# A place is past the end of an axis from this part of its length on: both are written rounded.
JUST_BEYOND = 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class SpaceBeam:
    """A geometrically exact beam in space, N nodes, straight or curved at rest.

    x runs along a straight one, z away from the bed. Arrays are copied and locked.
    """

    stations: Floats  # (N,) distances of the nodes from the first end along the axis at rest, mm
    places: Floats  # (N, 3) at rest, mm
    rotations: Floats  # (N, 4) unit quaternions that turn x, y, z into the axis, across and up
    # (N - 1, 6) of the elements: axial, two shear, N; torsion, two bending, N mm^2 (`STIFFNESSES`)
    stiffness: Floats
    ends: tuple[End, End]
    radius: Floats  # (N,) outer radius, mm: where strands take hold and rods touch
    # (N, 3) area, mm^2, and section moduli I/c for bending up and across, mm^3; None: no stresses
    # are read
    wall: Floats | None = None
    # (N - 1, WALL_ROWS) of the elements and (N, WALL_ROWS) of the nodes, what `kernels.wall` needs
    # of a wall that is no linear one
    fibres: tuple[Floats, Floats] | None = None

    def __post_init__(self) -> None:
        for name in ("stations", "places", "rotations", "stiffness", "radius", "wall"):
            value = getattr(self, name)
            if value is not None:
                copy = np.array(value, dtype=np.float64)
                copy.setflags(write=False)
                object.__setattr__(self, name, copy)

    @property
    def span(self) -> float:
        """Length along the axis at rest, mm."""
        return float(self.stations[-1])

    @classmethod
    def from_axis(
        cls,
        *,
        elements: int,
        stiffness: Floats,
        span: float | None = None,
        axis: Floats | None = None,
        ends: tuple[End, End] = ("clamped", "clamped"),
        stations: Floats | None = None,
        radius: float | Floats = 1.0,
        wall: Floats | None = None,
        fibres: Floats | None = None,
        nodes_at: Sequence[float] = (),
    ) -> "SpaceBeam":
        """Return a beam of elements that are even between the nodes that are asked for.

        Parameters
        ----------
        elements
            How many, 2 to 20,000.
        stiffness
            (6,) of a constant beam, or (K, 6) at `stations`, linear between them.
        span, axis
            Length of a straight beam along x, mm; or (P, 3) points of a curved axis at rest, mm.
        ends
            How the two ends are held.
        stations, radius, wall, fibres
            (K,) places from 0 to the span, mm, and what is constant or (K, ...) there.
        nodes_at
            Stations that shall be nodes: where hooks take hold.

        Returns
        -------
        SpaceBeam
            The beam.

        Raises
        ------
        ValueError
            If a number is out of range, or hooks are on top of one another or at a clamp.
        """
        if elements < 2:
            raise ValueError(f"elements must be 2 or more, got {elements}")
        if elements > 20_000:
            raise ValueError(f"elements can be at most 20,000, got {elements:,}")
        for end in ends:
            if end not in get_args(End):
                raise ValueError(f"an end must be {', '.join(get_args(End))}, got {end!r}")
        if (span is None) == (axis is None):
            raise ValueError("give either the span of a straight beam or the axis of a curved one")
        line = None
        if axis is not None:
            line = axis_line(axis)
            span = float(line[0][-1])
        assert span is not None  # noqa: S101
        positive(span, "span", "mm")
        nodes = _node_stations(span, elements, nodes_at, ends)
        if line is None:
            places = np.zeros((nodes.size, 3))
            places[:, 0] = nodes
            rotations = np.zeros((nodes.size, 4))
            rotations[:, 0] = 1.0
        else:
            places = _columns_at(nodes, line[0], line[1])
            rotations = _frames(_columns_at(nodes, line[0], line[2]))
        rows = np.asarray(stiffness, dtype=np.float64)
        given = np.array([0.0, span]) if stations is None else np.asarray(stations, np.float64)
        if stations is not None and not (
            given.ndim == 1
            and given.size >= 2
            and np.all(np.isfinite(given))
            and np.all(np.diff(given) >= 0.0)
            and given[0] <= 1e-9
            and given[-1] >= span * (1.0 - 1e-9)
        ):
            raise ValueError(
                f"stations must run in order from 0 mm to the span of {span:g} mm, got "
                f"{given.tolist()}"
            )
        middles = 0.5 * (nodes[1:] + nodes[:-1])
        stiff = _along(rows, 6, given, middles, "stiffness")
        for column, name in enumerate(STIFFNESSES):
            unit = "N" if column < 3 else "N mm^2"
            positive(float(stiff[:, column].min()), f"the {name} stiffness", unit)
            positive(float(stiff[:, column].max()), f"the {name} stiffness", unit)
        thick = _along(np.asarray(radius, np.float64).reshape(-1, 1), 1, given, nodes, "radius")
        positive(float(thick.min()), "radius", "mm")
        positive(float(thick.max()), "radius", "mm")
        walls = None if wall is None else _along(np.asarray(wall), 3, given, nodes, "wall")
        made = None
        if fibres is not None:
            made = (
                _along(fibres, kernels.WALL_ROWS, given, middles, "fibres"),
                _along(fibres, kernels.WALL_ROWS, given, nodes, "fibres"),
            )
        return cls(nodes, places, rotations, stiff, ends, thick[:, 0], walls, made)

    @classmethod
    def of(
        cls,
        beam: Beam,
        *,
        law: Law = LINEAR,
        elements: int = 40,
        ends: tuple[End, End] = ("clamped", "clamped"),
        axis: Floats | None = None,
        nodes_at: Sequence[float] = (),
    ) -> "SpaceBeam":
        """Return a beam of the other theories in space, equally stiff all round.

        Parameters
        ----------
        beam
            Sections and material. Its span counts where no `axis` is given; along an axis of
            another length its sections are spread in proportion.
        law
            Of the wall, as in `Exact`.
        elements, ends, axis, nodes_at
            As of `from_axis`.

        Returns
        -------
        SpaceBeam
            The beam, with its wall.

        Raises
        ------
        ValueError
            If the law does not shear.
        """
        if not law.shear:
            raise ValueError("a beam in space shears: its law must too, as Linear(shear=True)")
        stations = beam.key_stations
        areas, moments, fibres, shear_areas, _ = beam.sections_at(stations)
        rows, e = None, beam.modulus
        if isinstance(law, FibreLaw):
            own = shear_areas if beam.has_shear_areas else None
            both = (moments, moments), (fibres, fibres)
            rows, shear_areas = law.fibres_in_space(e, beam.poisson_ratio, areas, *both, own)
        g = 0.5 * e / (1.0 + beam.poisson_ratio)
        stiffness = np.stack(
            [
                e * areas,
                g * shear_areas,
                g * shear_areas,
                2 * g * moments,
                e * moments,
                e * moments,
            ],
            axis=1,
        )
        return cls.from_axis(
            elements=elements,
            stiffness=stiffness,
            span=beam.span if axis is None else None,
            axis=axis,
            ends=ends,
            stations=stations if axis is None else stations * (axis_line(axis)[0][-1] / beam.span),
            radius=fibres,
            wall=np.stack([areas, moments / fibres, moments / fibres], axis=1),
            fibres=rows,
            nodes_at=nodes_at,
        )

    @classmethod
    def round_tube(
        cls,
        axis: Floats,
        *,
        radius: Floats,
        wall: float,
        modulus: float,
        poisson_ratio: float = 0.49,
        elements: int = 20,
        ends: tuple[End, End] = ("clamped", "clamped"),
        nodes_at: Sequence[float] = (),
    ) -> "SpaceBeam":
        """Return a round tube along a curved axis, of a linear wall.

        Parameters
        ----------
        axis
            (P, 3) points at rest, mm.
        radius
            (K,) outer radii, mm, evenly from end to end.
        wall, modulus, poisson_ratio
            Thickness, mm, and Young's modulus, MPa; soft tissue hardly changes its volume.
        elements, ends, nodes_at
            As of `from_axis`.

        Returns
        -------
        SpaceBeam
            The tube, with its wall.

        Raises
        ------
        ValueError
            If a number is out of range, or the wall is as thick as the tube.
        """
        outer = np.atleast_1d(np.asarray(radius, dtype=np.float64))
        outer = np.repeat(outer, 2) if outer.size == 1 else outer
        positive(wall, "wall", "mm")
        positive(modulus, "modulus", "MPa")
        if not wall < outer.min():
            raise ValueError(
                f"a wall of {wall:g} mm does not fit a tube of {outer.min():g} mm radius"
            )
        bore = outer - wall
        area = np.pi * (outer**2 - bore**2)
        moment = 0.25 * np.pi * (outer**4 - bore**4)
        shear = 0.5 * modulus / (1.0 + poisson_ratio)
        sheared = area * [
            Ring(a, i).shear_coefficient(poisson_ratio)
            for a, i in zip(area.tolist(), moment.tolist(), strict=True)
        ]
        return cls.from_axis(
            elements=elements,
            stiffness=np.stack(
                [
                    modulus * area,
                    shear * sheared,
                    shear * sheared,
                    2.0 * shear * moment,
                    modulus * moment,
                    modulus * moment,
                ],
                axis=1,
            ),
            axis=axis,
            ends=ends,
            stations=np.linspace(0.0, float(axis_line(axis)[0][-1]), outer.size),
            radius=outer,
            wall=np.stack([area, moment / outer, moment / outer], axis=1),
            nodes_at=nodes_at,
        )

    def places_at(self, stations: Floats) -> tuple[Floats, Floats]:
        """Return (S, 3) places of the axis at rest, mm, and (S, 3) its unit tangents."""
        at = np.asarray(stations, dtype=np.float64)
        x = self.stations
        e = np.clip(np.searchsorted(x, at, side="right") - 1, 0, x.size - 2)
        h = x[e + 1] - x[e]
        u = ((at - x[e]) / h)[:, None]
        tangent = tangents(self.rotations)
        h = h[:, None]
        a, b, ta, tb = self.places[e], self.places[e + 1], tangent[e] * h, tangent[e + 1] * h
        place = (
            a * (1 + 2 * u) * (1 - u) ** 2
            + ta * u * (1 - u) ** 2
            + b * u * u * (3 - 2 * u)
            - tb * u * u * (1 - u)
        )
        along = tangent[e] * (1 - u) + tangent[e + 1] * u
        along /= np.sqrt((along**2).sum(axis=1))[:, None]
        return place, along

    def frames_at(
        self, stations: Floats, up: tuple[float, float, float] = (0.0, 0.0, 1.0)
    ) -> tuple[Floats, Floats]:
        """Return (S, 3) places of the axis at rest, mm, and (S, 3, 3) frames: axis, across, up."""
        # Up is away from the bed, as far as it is across the axis.
        place, along = self.places_at(stations)
        across = np.cross(np.broadcast_to(up, along.shape), along)
        size = np.sqrt((across**2).sum(axis=1))
        if size.size and size.min() < 1e-3:
            where = np.asarray(stations)[int(np.argmin(size))]
            raise ValueError(f"the axis stands upright at {where:g} mm: no bed can lie under it")
        across /= size[:, None]
        above = np.empty_like(along)
        for k in range(3):
            i, j = (k + 1) % 3, (k + 2) % 3
            above[:, k] = along[:, i] * across[:, j] - along[:, j] * across[:, i]
        return place, np.stack([along, across, above], axis=1)


def tangents(rotations: Floats) -> Floats:
    """Return the first columns of quaternions' rotations, (N, 3)."""
    w, x = rotations[:, 0], rotations[:, 1]
    y, z = rotations[:, 2], rotations[:, 3]
    return np.stack(
        [1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)],
        axis=1,
    )


def beyond(place: float, length: float) -> bool:
    """Return whether a place is past an axis's end by more than rounding, both in mm."""
    return place > length * (1.0 + JUST_BEYOND)


def axis_line(points: Floats) -> tuple[Floats, Floats, Floats]:
    """Return (Q,) arc lengths, mm, places and unit tangents of a smooth curve through points."""
    # Cubic between the (P, 3) points, with the slopes of the cubic spline through them whose ends
    # take the third derivative of their neighbours (not-a-knot; fewer than four: a parabola, a
    # line).
    p = np.asarray(points, dtype=np.float64)
    if p.ndim != 2 or p.shape[0] < 2 or p.shape[1] != 3 or not np.all(np.isfinite(p)):
        raise ValueError(f"an axis must be 2 or more points of 3 finite mm, got shape {p.shape}")
    t = np.concatenate([[0.0], np.cumsum(np.sqrt((np.diff(p, axis=0) ** 2).sum(axis=1)))])
    if np.diff(t).min() <= 1e-9 * t[-1]:
        where = int(np.argmin(np.diff(t)))
        raise ValueError(
            f"points {where + 1} and {where + 2} of the axis are on top of one another"
        )
    slopes = _spline_slopes(t, p)
    fraction = np.arange(64) / 64.0
    fine = np.append((t[:-1, None] + np.diff(t)[:, None] * fraction).ravel(), t[-1])
    e = np.clip(np.searchsorted(t, fine, side="right") - 1, 0, t.size - 2)
    h = (t[e + 1] - t[e])[:, None]
    u = ((fine - t[e]) / h[:, 0])[:, None]
    a, b, ta, tb = p[e], p[e + 1], slopes[e] * h, slopes[e + 1] * h
    place = (
        a * (1 + 2 * u) * (1 - u) ** 2
        + ta * u * (1 - u) ** 2
        + b * u * u * (3 - 2 * u)
        - tb * u * u * (1 - u)
    )
    slope = (6 * (b - a) * u * (1 - u) + ta * (1 - u) * (1 - 3 * u) - tb * u * (2 - 3 * u)) / h
    speed = np.sqrt((slope**2).sum(axis=1))
    length = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(fine) * (speed[1:] + speed[:-1]))])
    return length, place, slope / speed[:, None]


def _spline_slopes(t: Floats, p: Floats) -> Floats:
    n = t.size
    h = np.diff(t)
    chords = np.diff(p, axis=0) / h[:, None]
    if n == 2:
        return np.concatenate([chords, chords])
    if n == 3:
        bend = (chords[1] - chords[0]) / (t[2] - t[0])
        middle = chords[0] + bend * h[0]
        return np.stack([chords[0] - bend * h[0], middle, chords[1] + bend * h[1]])
    # Rows (below, middle, above) of a tridiagonal matrix. LAPACK's last digits differ between
    # processors, and a run must not: here they are those of one without fused operations.
    ends = t[2] - t[0], t[-1] - t[-3]
    below = np.concatenate([[0.0], h[1:], ends[1:]])
    middle = np.concatenate([h[1:2], 2.0 * (h[:-1] + h[1:]), h[-2:-1]])
    above = np.concatenate([ends[:1], h[:-1]])
    right = np.empty((n, 3))
    right[0] = ((h[0] + 2 * ends[0]) * h[1] * chords[0] + h[0] ** 2 * chords[1]) / ends[0]
    right[1:-1] = 3 * (h[1:, None] * chords[:-1] + h[:-1, None] * chords[1:])
    right[-1] = (h[-1] ** 2 * chords[-2] + (2 * ends[1] + h[-1]) * h[-2] * chords[-1]) / ends[1]
    for i in range(1, n):
        factor = below[i] * (1.0 / middle[i - 1])
        middle[i] -= factor * above[i - 1]
        right[i] -= factor * right[i - 1]
    right[-1] *= 1.0 / middle[-1]
    for i in range(n - 2, -1, -1):
        right[i] = (right[i] - above[i] * right[i + 1]) * (1.0 / middle[i])
    return right


def _frames(directions: Floats) -> Floats:
    """Return quaternions that turn x into the tangents, without twist from node to node."""
    along = directions[0]
    up = np.array([0.0, 0.0, 1.0]) - along[2] * along
    if np.sqrt((up**2).sum()) < 1e-3:
        up = np.array([1.0, 0.0, 0.0]) - along[0] * along
    up /= np.sqrt((up**2).sum())
    columns = np.stack([along, np.cross(up, along), up], axis=1)
    out = np.empty((directions.shape[0], 4))
    out[0] = _quaternion(columns)
    for i in range(1, directions.shape[0]):
        a, b = directions[i - 1], directions[i]
        # The smallest rotation from one tangent to the next.
        turn = np.concatenate([[1.0 + (a * b).sum()], np.cross(a, b)])
        turn /= np.sqrt((turn**2).sum())
        w, x, y, z = turn
        p, q, r, s = out[i - 1]
        out[i] = (
            w * p - x * q - y * r - z * s,
            w * q + x * p + y * s - z * r,
            w * r + y * p + z * q - x * s,
            w * s + z * p + x * r - y * q,
        )
        out[i] /= np.sqrt((out[i] ** 2).sum())
    return out


def _quaternion(m: Floats) -> Floats:
    q = np.array(
        [
            1 + m[0, 0] + m[1, 1] + m[2, 2],
            1 + m[0, 0] - m[1, 1] - m[2, 2],
            1 - m[0, 0] + m[1, 1] - m[2, 2],
            1 - m[0, 0] - m[1, 1] + m[2, 2],
        ]
    )
    q = 0.5 * np.sqrt(np.maximum(q, 0.0))
    largest = int(np.argmax(q))
    pairs = {
        0: (m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]),
        1: (m[2, 1] - m[1, 2], m[0, 1] + m[1, 0], m[0, 2] + m[2, 0]),
        2: (m[0, 2] - m[2, 0], m[0, 1] + m[1, 0], m[1, 2] + m[2, 1]),
        3: (m[1, 0] - m[0, 1], m[0, 2] + m[2, 0], m[1, 2] + m[2, 1]),
    }[largest]
    out = np.empty(4)
    out[largest] = q[largest]
    others = [i for i in range(4) if i != largest]
    for i, value in zip(others, pairs, strict=True):
        out[i] = value / (4 * q[largest])
    return out


def _along(rows: Floats, width: int, given: Floats, at: Floats, name: str) -> Floats:
    """Return rows at stations, linear between those given; a single row is constant."""
    table = np.atleast_2d(np.asarray(rows, dtype=np.float64))
    if table.shape[1] != width or table.shape[0] not in (1, given.size):
        raise ValueError(
            f"{name} must be {width} numbers, or as many for each of the {given.size} stations, "
            f"got shape {np.asarray(rows).shape}"
        )
    if table.shape[0] == 1:
        return np.repeat(table, at.size, axis=0)
    return _columns_at(at, given, table)


def _columns_at(at: Floats, given: Floats, table: Floats) -> Floats:
    """Return a table's rows at places between those given, linear."""
    return np.stack([np.interp(at, given, table[:, c]) for c in range(table.shape[1])], axis=1)


def _node_stations(
    span: float, elements: int, nodes_at: Sequence[float], ends: tuple[End, End]
) -> Floats:
    """Return the stations of the nodes, even between those asked for."""
    anchors = [0.0, span]
    seen: list[float] = []
    for at in nodes_at:
        s = finite(at, "a hook's place", "mm")
        if not 0.0 <= s <= span:
            raise ValueError(
                f"a hook at {s:g} mm is not on the beam, which runs from 0 to {span:g} mm"
            )
        for end, place in zip(ends, (0.0, span), strict=True):
            if end == "clamped" and abs(s - place) <= 1e-6 * span:
                raise ValueError(f"a hook at {s:g} mm is behind a clamp: {place:g} mm is clamped")
        if any(abs(s - other) <= 1e-6 * span for other in seen):
            raise ValueError(f"two hooks are on top of one another at {s:g} mm")
        seen.append(s)
        if min(s, span - s) > NEAR_END * span / elements:
            anchors.append(s)
    anchors.sort()
    lengths = np.diff(anchors)
    if elements < lengths.size:
        raise ValueError(
            f"{elements} elements cannot have nodes at {len(seen)} hooks; give more elements"
        )
    # As many elements to each part as keeps them most even: the longest is halved next.
    counts = np.ones(lengths.size, dtype=np.int64)
    for _ in range(elements - lengths.size):
        counts[int(np.argmax(lengths / counts))] += 1
    pieces = [
        np.linspace(a, b, count + 1)[:-1]
        for a, b, count in zip(anchors, anchors[1:], counts.tolist(), strict=False)
    ]
    return np.concatenate([*pieces, [span]])
