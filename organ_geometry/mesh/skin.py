"""Skins: the closed surface of an organ, or of a piece of it, and how it follows its axis."""

import itertools
from dataclasses import dataclass
from typing import Literal, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from kernel_cache import njit
from organ_geometry.driving_points import DrivingPoints
from organ_geometry.organ import Organ, Wall

Side: TypeAlias = Literal["outer", "inside"]
"""The outer wall; the lumen and what closes the ends."""
Scalar = TypeVar("Scalar", bound=np.generic)

MOST_VERTICES = 600_000
"""A skin that a screen, a printer or a file has use for; more takes gigabytes."""


@dataclass(frozen=True, slots=True, eq=False)
class Skin:
    """A closed triangle mesh at rest, made of grids, whose vertices know their place on the axis.

    The vertices are the outer wall's rings, one after the other from the first end to the last,
    then the lumen's, as many and as large, or of a solid organ the centres of its two ends. The
    faces are the outer wall's, the lumen's, and those that close both ends, in this order.

    Attributes
    ----------
    vertices
        (V, 3) places at rest, mm.
    faces
        (F, 3) vertex numbers, anticlockwise seen from outside.
    stations
        (V,) arc length along the organ's axis that each vertex belongs to, mm.
    rings, sides
        Rings of a wall, and vertices of each.
    right_handed
        Whether (along a ring) x (from ring to ring) points outwards.
    """

    vertices: NDArray[np.float32]
    faces: NDArray[np.int32]
    stations: NDArray[np.float64]
    rings: int
    sides: int
    hollow: bool
    right_handed: bool

    def __post_init__(self) -> None:
        for array in (self.vertices, self.faces, self.stations):
            array.setflags(write=False)

    @property
    def wall_size(self) -> int:
        """How many vertices one wall has."""
        return self.rings * self.sides

    def grid(self, values: NDArray[Scalar], wall: Wall = "outer") -> NDArray[Scalar]:
        """Return the (rings, sides, ...) values of a wall, a view of (V, ...) of all vertices."""
        size = self.wall_size
        of_wall = values[:size] if wall == "outer" else values[size : 2 * size]
        return of_wall.reshape(self.rings, self.sides, *values.shape[1:])

    def side(self, name: Side) -> tuple[NDArray[np.intp], NDArray[np.int32]]:
        """Return a part as a mesh of its own: (W,) its vertices' numbers, (F, 3) faces of these."""
        wall = 2 * (self.rings - 1) * self.sides
        if name == "outer":
            return np.arange(self.wall_size), self.faces[:wall]
        lumen = wall if self.hollow else 0
        numbers: list[NDArray[np.intp]] = []
        faces: list[NDArray[np.int32]] = []
        before = 0
        # Where two grids meet the surface has an edge. A vertex of both would carry one normal and
        # shade it round, so each has one of its own there, at the same place to the bit.
        for grid in (self.faces[wall : wall + lumen], self.faces[wall + lumen :]):
            used, renumbered = np.unique(grid, return_inverse=True)
            numbers.append(used.astype(np.intp))
            faces.append((renumbered.reshape(grid.shape) + before).astype(np.int32))
            before += len(used)
        return np.concatenate(numbers), np.concatenate(faces)

    def bound_to(self, points: DrivingPoints) -> "BoundSkin":
        """Return the skin bound to driving points."""
        index, weight = points.binding(self.stations)
        changes = (np.diff(index) != 0) | (np.diff(weight) != 0.0)
        starts = np.concatenate([[0], 1 + np.flatnonzero(changes), [index.size]])
        return BoundSkin(self, index, weight, starts)


@dataclass(frozen=True, slots=True, eq=False)
class Surface:
    """One closed surface at one moment: its faces stay, its vertices move."""

    name: str  # Of the organ, or of the piece
    skin: Skin  # The surface at rest
    # (V, 3) where its vertices are, mm; a session overwrites them with each step.
    vertices: NDArray[np.float32]


@dataclass(frozen=True, slots=True, eq=False)
class BoundSkin:
    """A skin and the driving points that each vertex follows."""

    skin: Skin  # The skin at rest
    index: NDArray[np.int32]  # (V,) number of the driving point before each vertex
    weight: NDArray[np.float64]  # (V,) part in which each vertex follows the point after it
    # (R+1,) the first vertex of each run of neighbours that follow the same points by the same
    # weights, a ring mostly, and V.
    starts: NDArray[np.intp]

    def deform(
        self, transforms: NDArray[np.float64], out: NDArray[np.float32]
    ) -> NDArray[np.float32]:
        """Write and return `out`, (V, 3) mm: each vertex follows its driving points' transforms."""
        # (D, 3, 4) less the identity: with zeros `skin.vertices` come back to the bit.
        _blend(self.skin.vertices, self.starts, self.index, self.weight, transforms, out)
        return out


def organ_skin(organ: Organ, *, edge_length: float) -> Skin:
    """Return the closed skin of a whole organ."""
    rim = np.zeros(1)
    return tube_skin(organ, rim, rim + organ.length, edge_length=edge_length)


def tube_skin(
    organ: Organ,
    start: NDArray[np.float64],
    end: NDArray[np.float64],
    *,
    edge_length: float,
    reach: float = 0.0,
) -> Skin:
    """Return the closed skin of the part of an organ between two rims.

    Parameters
    ----------
    organ, start, end
        (1,) for an even rim, or (`sides_of`,) station of the rim at each angle, mm.
    edge_length, reach
        Wanted length of the triangles' edges, and how far along the axis the rings adapt to an
        uneven rim, mm.

    Returns
    -------
    Skin
        Outer wall, inner wall of a hollow organ, and the faces that close both rims.

    Raises
    ------
    ValueError
        If the edge length is not above zero or asks for more than 600,000 vertices.
    """
    sides = sides_of(organ, edge_length)
    low, high = float(start.mean()), float(end.mean())
    rings = max(2, round((high - low) / edge_length) + 1)
    walls = 2 if organ.hollow else 1
    if walls * rings * sides > MOST_VERTICES:
        raise ValueError(
            f"edge_length of {edge_length:g} mm asks for {walls * rings * sides:,} vertices; "
            f"give one that needs at most {MOST_VERTICES:,}"
        )
    even = np.linspace(low, high, rings)[:, None]
    stations = even + (start - low) * _ramp(low + reach - even, reach)
    stations = stations + (end - high) * _ramp(even - (high - reach), reach)
    stations = np.broadcast_to(stations, (rings, sides))
    angles = np.broadcast_to(ring_angles(sides), (rings, sides))

    grid = np.arange(rings * sides, dtype=np.int32).reshape(rings, sides)
    outer = organ.surface(stations.ravel(), angles.ravel())
    if organ.hollow:
        inner = organ.surface(stations.ravel(), angles.ravel(), wall="lumen")
        vertices = [outer, inner]
        rows = [stations.ravel(), stations.ravel()]
        lumen = grid + grid.size
        faces = [
            _wall(grid),
            _wall(lumen)[:, ::-1],
            _strip(lumen[0], grid[0]),
            _strip(grid[-1], lumen[-1]),
        ]
    else:
        centres = np.array([stations[0].mean(), stations[-1].mean()])
        vertices = [outer, organ.axis_at(centres)]
        rows = [stations.ravel(), centres]
        first, last = np.full((2, sides), [[grid.size], [grid.size + 1]], dtype=np.int32)
        faces = [_wall(grid), _fan(grid[0], first)[:, ::-1], _fan(grid[-1], last)]
    triangles = np.concatenate(faces)
    right_handed = _right_handed(organ)
    if not right_handed:
        triangles = triangles[:, ::-1]
    # Adding 0 turns a minus zero into a plain one, which a rest pose returns to the bit.
    return Skin(
        np.concatenate(vertices).astype(np.float32) + np.float32(0.0),
        np.ascontiguousarray(triangles, dtype=np.int32),
        np.concatenate(rows),
        rings,
        sides,
        organ.hollow,
        right_handed,
    )


def sides_of(organ: Organ, edge_length: float) -> int:
    """Return how many vertices a ring of the skin has."""
    radius = organ.mean_radius
    if not 0.0 < edge_length <= radius:
        raise ValueError(
            f"edge_length must be above 0 mm and at most the organ's mean radius, "
            f"{radius:.3g} mm, got {edge_length:g} mm"
        )
    return max(12, round(2.0 * np.pi * radius / edge_length))


def ring_angles(sides: int) -> NDArray[np.float64]:
    """Return the angles of a ring's vertices: even, and none where the two half-curves meet."""
    # (sides,) in rad.
    return (np.arange(sides, dtype=np.float64) + 0.5) * (2.0 * np.pi / sides)


def _ramp(distance: NDArray[np.float64], reach: float) -> NDArray[np.float64]:
    """Return 0 to 1 while the distance grows from 0 to the reach; all 1 without a reach."""
    if reach == 0.0:
        return np.ones_like(distance)
    fraction: NDArray[np.float64] = np.clip(distance / reach, 0.0, 1.0)
    return fraction * fraction * (3.0 - 2.0 * fraction)


def _right_handed(organ: Organ) -> bool:
    """Return whether x_dir, y_dir and the axis's direction are a right-handed frame."""
    frames = organ.frames
    tangents = np.gradient(organ.axis, axis=0)
    turns = np.cross(frames[:, :, 0], frames[:, :, 1])
    return float(np.sum(turns * tangents)) > 0.0


def _wall(grid: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return the triangles of a tube of rings, seen from outside."""
    strips = [_strip(near, far) for near, far in itertools.pairwise(grid)]
    return np.concatenate(strips)


def _strip(near: NDArray[np.int32], far: NDArray[np.int32]) -> NDArray[np.int32]:
    near_next, far_next = np.roll(near, -1), np.roll(far, -1)
    return np.concatenate(
        [np.stack([near, near_next, far_next], 1), np.stack([near, far_next, far], 1)]
    )


def _fan(ring: NDArray[np.int32], centre: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return the triangles between a ring and its centre, seen from the organ's far end."""
    return np.stack([ring, np.roll(ring, -1), centre], 1)


@njit(cache=True, nogil=True)
def _blend(
    rest: NDArray[np.float32],
    starts: NDArray[np.intp],
    index: NDArray[np.int32],
    weight: NDArray[np.float64],
    transforms: NDArray[np.float64],
    out: NDArray[np.float32],
) -> None:
    blended = np.empty((3, 4))
    # As plain rows of numbers the compiler loads and stores several vertices at once.
    all_places, all_moved = rest.reshape(-1), out.reshape(-1)
    for run in range(starts.size - 1):
        first, last = starts[run], starts[run + 1]
        before = transforms[index[first]]
        after = transforms[index[first] + 1]
        fraction = weight[first]
        for i in range(3):
            for j in range(4):
                blended[i, j] = before[i, j] + fraction * (after[i, j] - before[i, j])
        # In names of their own the figures stay in registers for the whole run.
        xx, xy, xz, x_shift = blended[0, 0], blended[0, 1], blended[0, 2], blended[0, 3]
        yx, yy, yz, y_shift = blended[1, 0], blended[1, 1], blended[1, 2], blended[1, 3]
        zx, zy, zz, z_shift = blended[2, 0], blended[2, 1], blended[2, 2], blended[2, 3]
        places, moved = all_places[3 * first : 3 * last], all_moved[3 * first : 3 * last]
        for v in range(last - first):
            x = np.float64(places[3 * v])
            y = np.float64(places[3 * v + 1])
            z = np.float64(places[3 * v + 2])
            moved[3 * v] = x + (xx * x + xy * y + xz * z + x_shift)
            moved[3 * v + 1] = y + (yx * x + yy * y + yz * z + y_shift)
            moved[3 * v + 2] = z + (zx * x + zy * y + zz * z + z_shift)
