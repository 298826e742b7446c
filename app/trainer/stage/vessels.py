"""Blood vessels on the duct: ribbons bound to the wall's grid, which they follow as it moves."""

from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

from app.trainer.stage.solids import grid_faces
from app.trainer.stage.wall import Wall
from organ_geometry.mesh.skin import ring_angles

__all__ = ["Vessels", "pose_vessels"]

_STEP = 0.55  # mm along a vessel
_ACROSS = 3  # points: both edges and the crest between
_TRUNKS = 7
_TWIGS_PER_TRUNK = 4


@dataclass(frozen=True, slots=True, eq=False)
class Vessels:
    """The vessels of one wall.

    Attributes
    ----------
    ring, side
        (N,) the wall's grid point before each point.
    between
        (N, 2) place between that ring and side and the next, 0 to 1.
    lift
        (N,) height over the wall, mm.
    faces
        (F, 3) numbers of their points, seen from outside.
    """

    ring: NDArray[np.int32]
    side: NDArray[np.int32]
    between: NDArray[np.float32]
    lift: NDArray[np.float32]
    faces: NDArray[np.int64]

    @classmethod
    def of(cls, wall: Wall, length: float, radius: float, *, seed: int = 8) -> "Vessels":
        """Return the vessels of a wall.

        Parameters
        ----------
        wall
            The wall.
        length
            Of the whole organ, mm: a piece of it has its part of the same vessels.
        radius
            Of the duct, mm.
        seed
            Chooses the paths.

        Returns
        -------
        Vessels
            Those between the wall's ends.
        """
        stations: list[NDArray[np.float64]] = []
        angles: list[NDArray[np.float64]] = []
        lifts: list[NDArray[np.float64]] = []
        faces: list[NDArray[np.int64]] = []
        count = 0
        first, last = wall.stations[0].max(), wall.stations[-1].min()
        for path_stations, path_angles, width in _paths(length, radius, seed):
            inside = (path_stations > first + 0.2) & (path_stations < last - 0.2)
            for run in _runs(inside):
                station, angle = path_stations[run], path_angles[run]
                half = 0.5 * width * np.linspace(1.0, 0.6, len(station))[:, None]
                across = np.linspace(-1.0, 1.0, _ACROSS)[None]
                along = np.stack([np.gradient(station), radius * np.gradient(angle)], axis=-1)
                along /= np.linalg.norm(along, axis=1, keepdims=True)
                stations.append((station[:, None] - across * half * along[:, 1:]).ravel())
                angles.append((angle[:, None] + across * half * along[:, :1] / radius).ravel())
                lifts.append((0.03 + 0.55 * half * (1.0 - across**2) - 0.05 * across**2).ravel())
                faces.append(grid_faces(len(station), _ACROSS) + count)
                count += lifts[-1].size
        if not count:
            nothing = np.empty(0, np.int32)
            return cls(
                nothing, nothing, np.empty((0, 2), np.float32), np.empty(0, np.float32),
                np.empty((0, 3), np.int64),
            )  # fmt: skip
        triangles = np.concatenate(faces)
        ring, side, between = _bound(wall, np.concatenate(stations), np.concatenate(angles))
        return cls(
            ring,
            side,
            between,
            np.concatenate(lifts).astype(np.float32),
            # Rows run along the vessel and columns with the angle: as a ring and its neighbour do.
            triangles if wall.right_handed else triangles[:, ::-1],
        )


def _runs(inside: NDArray[np.bool_]) -> list[slice]:
    """Return the stretches of three points and more that are inside."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], inside.astype(np.int8), [0]])))
    pairs = zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True)
    return [slice(start, stop) for start, stop in pairs if stop - start >= 3]


def _paths(
    length: float, radius: float, seed: int
) -> list[tuple[NDArray[np.float64], NDArray[np.float64], float]]:
    """Return stations, mm, angles, rad, and width, mm, of each vessel."""
    random = np.random.default_rng(seed)
    paths: list[tuple[NDArray[np.float64], NDArray[np.float64], float]] = []
    turn = _STEP / radius
    for number in range(_TRUNKS):
        count = int(random.uniform(0.35, 0.75) * length / _STEP)
        start = random.uniform(0.0, 0.6) * length
        heading = np.cumsum(random.normal(0.0, 0.13, count)) + random.normal(0.0, 0.2)
        heading -= 0.6 * np.linspace(0.0, 1.0, count) * heading[-1]
        station = start + np.cumsum(_STEP * np.cos(heading))
        angle = 2.0 * np.pi * (number + random.uniform(-0.3, 0.3)) / _TRUNKS + np.cumsum(
            turn * np.sin(heading)
        )
        width = random.uniform(0.2, 0.36)
        paths.append((station, angle, width))
        for _ in range(_TWIGS_PER_TRUNK):
            joint = int(random.uniform(0.1, 0.9) * count)
            twig = int(random.uniform(6, 16))
            side = random.choice([-1.0, 1.0])
            bend = heading[joint] + side * (0.75 - np.linspace(0.0, 0.4, twig))
            bend += np.cumsum(random.normal(0.0, 0.12, twig))
            paths.append(
                (
                    station[joint] + np.cumsum(_STEP * np.cos(bend)),
                    angle[joint] + np.cumsum(turn * np.sin(bend)),
                    0.5 * width,
                )
            )
    return paths


def _bound(
    wall: Wall, stations: NDArray[np.float64], angles: NDArray[np.float64]
) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.float32]]:
    """Return grid points and places between them of points on the wall."""
    start = ring_angles(wall.sides)[0]
    place = np.mod((angles - start) / (2.0 * np.pi) * wall.sides, wall.sides)
    side = np.minimum(place.astype(np.int32), wall.sides - 1)
    part = place - side
    grid = wall.stations
    columns = grid[:, side] * (1.0 - part) + grid[:, (side + 1) % wall.sides] * part
    ring = np.clip((columns <= stations).sum(axis=0) - 1, 0, wall.rings - 2)
    points = np.arange(stations.size)
    before, after = columns[ring, points], columns[ring + 1, points]
    forth = np.clip((stations - before) / (after - before), 0.0, 1.0)
    return ring.astype(np.int32), side, np.stack([forth, part], axis=-1).astype(np.float32)


@numba.njit(cache=True)
def pose_vessels(
    wall: NDArray[np.float32],
    normals: NDArray[np.float32],
    shade: NDArray[np.float32],
    sides: int,
    ring: NDArray[np.int32],
    side: NDArray[np.int32],
    between: NDArray[np.float32],
    lift: NDArray[np.float32],
    places: NDArray[np.float32],
    shades: NDArray[np.float32],
) -> None:
    """Write places and shade of the vessels' points on a deformed wall.

    Parameters
    ----------
    wall, normals, shade
        (V, 3) places, mm, (V, 3) unit normals and (V,) shade of the wall's vertices.
    sides
        Vertices of each ring.
    ring, side, between, lift
        Those of `Vessels`.
    places
        (N, 3) receives the places, mm.
    shades
        (N,) receives the shade.
    """  # fmt: skip
    for n in range(ring.shape[0]):
        u, w = between[n, 0], between[n, 1]
        a = ring[n] * sides + side[n]
        b = ring[n] * sides + (side[n] + 1) % sides
        c, d = a + sides, b + sides
        wa, wb, wc, wd = (1.0 - u) * (1.0 - w), (1.0 - u) * w, u * (1.0 - w), u * w
        for i in range(3):
            places[n, i] = (
                wa * wall[a, i] + wb * wall[b, i] + wc * wall[c, i] + wd * wall[d, i]
                + lift[n] * (wa * normals[a, i] + wb * normals[b, i]
                             + wc * normals[c, i] + wd * normals[d, i])
            )  # fmt: skip
        shades[n] = wa * shade[a] + wb * shade[b] + wc * shade[c] + wd * shade[d]
