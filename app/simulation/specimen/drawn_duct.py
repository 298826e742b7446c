"""The duct as it is drawn: surfaces that follow the beam's driving points, and the stress on them.

Each vertex follows two neighbouring driving points (organ_geometry.driving_points). The stress at a
vertex is the beam's at the vertex's place along the axis,

    sigma = sigma_N - s sign(M) sigma_B,

with sigma_N the normal stress N/A, sigma_B the bending stress at the outermost fibre, M the moment
(above zero where it stretches the side away from the pull) and s in [-1, 1] the vertex's height
along the pull over the outermost fibre's. A beam in space bends across the pull as well,

    sigma = sigma_N + s sigma_up - s' sigma_across,

with s' the vertex's place across the pull over the outermost fibre's there. All are linear between
the stations at which the beam is sampled. Well behind a clamp there is none.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.simulation.specimen.dissection import PIECES, Dissection
from app.simulation.specimen.tear import Tear
from kernel_cache import njit
from organ_geometry import Organ
from organ_geometry.mesh import BoundSkin, Skin, Surface, TornPiece, organ_skin
from physics import Equilibrium, RuptureCheck

# Part of the span, behind each clamp, over which the stress at the clamp continues.
CLAMP_DEPTH = 0.01


class DrawnDuct:
    """The surfaces of a session's duct: its whole skin, or two pieces when torn.

    `shape` changes whenever `surfaces` is another list. `edge_length` is the skin's, mm.
    `transforms`, (D, 3, 4), are those of the driving points less the identity; `draw` overwrites
    them. The skin has about `vertices` vertices, and `seed` chooses the raggedness of the torn rim.
    """

    def __init__(self, organ: Organ, vertices: int, seed: int = 1) -> None:
        walls = 2 if organ.hollow else 1
        area = walls * 2.0 * math.pi * organ.mean_radius * organ.length
        self.edge_length = min(math.sqrt(area / vertices), organ.mean_radius)
        self.skin = organ_skin(organ, edge_length=self.edge_length)
        self.shape = 0
        self.surfaces: tuple[Surface, ...] = ()
        self.transforms: NDArray[np.float64] = np.empty((0, 3, 4))
        self.at_tear = self.transforms  # as the duct tore
        self.in_pieces = False
        self._seed = seed
        self._pieces: tuple[TornPiece, ...] = ()
        self._bound: tuple[BoundSkin, ...] = ()
        self._stress: list[SurfaceStress] | None = None

    def follow(self, dissection: Dissection) -> None:
        """Show the whole organ, moved from now on by a dissection's driving points."""
        self._dissection = dissection
        self.transforms = dissection.rest_transforms()
        self.show_whole()

    def show_whole(self) -> None:
        """Show the whole organ at rest."""
        self._show((Surface("skin", self.skin, self.skin.vertices.copy()),))

    def show_pieces(self, check: RuptureCheck) -> None:
        """Show the two pieces that the organ tears into where the criterion was met."""
        dissection = self._dissection
        self.at_tear = self.transforms.copy()
        pieces = dissection.torn_at(check, edge_length=self.edge_length, seed=self._seed)
        self._show(
            tuple(
                Surface(name, piece.skin, piece.skin.vertices.copy())
                for name, piece in zip(PIECES, pieces, strict=True)
            ),
            pieces,
        )

    def draw(self, driven: Equilibrium, tear: Tear | None) -> None:
        """Write the surfaces' vertices for a displaced beam and the opening of a tear."""
        scale = 1.0 if tear is None else tear.swing
        self._dissection.move(driven, self.transforms, fraction=scale)
        for surface, bound in zip(self.surfaces, self._bound, strict=True):
            bound.deform(self.transforms, surface.vertices)
        if tear is not None:
            self.open_tear(tear.front)

    def draw_moved(self, move: Callable[[NDArray[np.float64], int | None], object]) -> None:
        """Write the surfaces' vertices, moved by the transforms that `move` writes.

        `move` is given the number of a torn duct's piece, None for a whole one.
        """
        for number, (surface, bound) in enumerate(zip(self.surfaces, self._bound, strict=True)):
            move(self.transforms, number if self._pieces else None)
            bound.deform(self.transforms, surface.vertices)

    def open_tear(self, front: float) -> None:
        """Open the drawn pieces' rims as far as a tear has run (`tear_front`)."""
        for surface, piece in zip(self.surfaces, self._pieces, strict=True):
            piece.open(front, surface.vertices)

    def write_stress(
        self,
        pulled: Equilibrium,
        tear: Tear | None,
        out: NDArray[np.float32],
        surface: int = 0,
    ) -> NDArray[np.float32]:
        """Write the stress along the organ, MPa, at each vertex of a surface."""
        scale = 1.0 if tear is None else tear.stress_left
        return self._stress_of(surface).write(pulled, out, scale=scale)

    def write_bed_stress(
        self,
        stations: NDArray[np.float64],
        stresses: NDArray[np.float64],
        out: NDArray[np.float32],
        surface: int = 0,
    ) -> NDArray[np.float32]:
        """Write the stress along the organ, MPa, at each vertex, from `BeamOnBed.stresses`."""
        return self._stress_of(surface).write_in_space(stations, stresses, out)

    def _stress_of(self, surface: int) -> "SurfaceStress":
        if self._stress is None:
            self._stress = [SurfaceStress(self._dissection, each.skin) for each in self.surfaces]
        return self._stress[surface]

    def _show(self, surfaces: tuple[Surface, ...], pieces: tuple[TornPiece, ...] = ()) -> None:
        self.surfaces, self._pieces = surfaces, pieces
        self.in_pieces = bool(pieces)
        self._bound = tuple(each.skin.bound_to(self._dissection.driving) for each in surfaces)
        self._stress = None
        self.shape += 1


@dataclass(frozen=True, slots=True, eq=False)
class Stresses:
    """Stresses at V vertices."""

    normal: NDArray[np.float32]  # (V,) N / A, tension over the section, MPa
    bending: NDArray[np.float32]  # (V,) MPa, positive where bending stretches
    total: NDArray[np.float32]  # (V,) their sum, MPa
    # (V,) 1 - total / threshold: 1 unstressed, 0 at the break
    distance_to_break: NDArray[np.float32]

    @classmethod
    def none(cls, count: int) -> "Stresses":
        """Return the zero stresses of a surface that bears no load."""
        nothing = np.zeros(count, dtype=np.float32)
        return cls(nothing, nothing, nothing, np.ones(count, dtype=np.float32))


class SurfaceStress:
    """Normal plus bending stress, MPa, at the vertices of a dissection's skin."""

    def __init__(self, dissection: Dissection, skin: Skin) -> None:
        first, last = dissection.clamps
        self._places = skin.stations - first
        self._fraction = fibre_fractions(dissection.organ, skin, dissection.frame[:, 2])
        self._organ, self._skin, self._lateral = dissection.organ, skin, dissection.frame[:, 1]
        self._across: NDArray[np.float64] | None = None  # as `_fraction`, across the pull
        depth = CLAMP_DEPTH * (last - first)
        self._free = (skin.stations >= first - depth) & (skin.stations <= last + depth)
        self._stations: NDArray[np.float64] | None = None
        self._before = np.zeros(skin.stations.size, dtype=np.int32)
        self._after = np.zeros(skin.stations.size, dtype=np.int32)
        self._weight = np.zeros(skin.stations.size)

    def write_in_space(
        self,
        stations: NDArray[np.float64],
        stresses: NDArray[np.float64],
        out: NDArray[np.float32],
    ) -> NDArray[np.float32]:
        """Write the stress at each vertex of a beam in space, in mm from the first clamp."""
        if self._across is None:
            self._across = fibre_fractions(self._organ, self._skin, self._lateral)
        self._bind(stations)
        _write_in_space(
            stresses, self._before, self._weight, self._fraction, self._across, self._free, out
        )
        return out

    def write(
        self, pulled: Equilibrium, out: NDArray[np.float32], *, scale: float = 1.0
    ) -> NDArray[np.float32]:
        """Write the stress at each vertex, times `scale`."""
        self._write_stresses(pulled, pulled.normal_stress, pulled.bending_stress, scale, out)
        return out

    def at(self, pulled: Equilibrium, threshold: float) -> Stresses:
        """Return normal and bending stress at each vertex, for a beam sampled in any order."""
        normal, bending = (np.empty(self._fraction.size, dtype=np.float32) for _ in range(2))
        nothing = np.zeros(pulled.stations.size)
        self._write_stresses(pulled, pulled.normal_stress, nothing, 1.0, normal)
        self._write_stresses(pulled, nothing, pulled.bending_stress, 1.0, bending)
        total = normal + bending
        return Stresses(normal, bending, total, 1.0 - total / np.float32(threshold))

    def in_space(
        self, stations: NDArray[np.float64], stresses: NDArray[np.float64], threshold: float
    ) -> Stresses:
        """Return normal and bending stress at each vertex of a beam in space."""
        normal, bending = (
            self.write_in_space(
                stations, stresses * each, np.empty(self._fraction.size, np.float32)
            )
            for each in np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 1.0]])
        )
        total = normal + bending
        return Stresses(normal, bending, total, 1.0 - total / np.float32(threshold))

    def _write_stresses(
        self,
        pulled: Equilibrium,
        normal: NDArray[np.float64],
        bending: NDArray[np.float64],
        scale: float,
        out: NDArray[np.float32],
    ) -> None:
        self._bind(pulled.stations)
        _write(
            normal,
            bending,
            pulled.moment,
            self._before,
            self._after,
            self._weight,
            self._fraction,
            self._free,
            scale,
            out,
        )

    def _bind(self, stations: NDArray[np.float64]) -> None:
        """Find the two beam stations on both sides of each vertex, and its weight, once for all."""
        if self._stations is not None and np.array_equal(self._stations, stations):
            return
        self._stations = stations.copy()
        places, numbers = np.unique(stations, return_index=True)
        index = np.searchsorted(places, self._places, side="right") - 1
        index = np.clip(index, 0, places.size - 2)
        self._before[:] = numbers[index]
        self._after[:] = numbers[index + 1]
        low, high = places[index], places[index + 1]
        self._weight[:] = np.clip((self._places - low) / (high - low), 0.0, 1.0)


def fibre_fractions(
    organ: Organ, skin: Skin, direction: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return (V,) s in [-1, 1]: height along the pull over the section's outermost fibre."""
    stations, ring = np.unique(skin.stations, return_inverse=True)
    normals = organ.frames_at(stations)[:, :, 2]
    up = direction - normals * (normals @ direction)[:, None]
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    heights = np.einsum("vi,vi->v", skin.vertices - organ.axis_at(stations)[ring], up[ring])
    outline = np.linspace(0.0, 2.0 * np.pi, 96, endpoint=False)
    # The vertices' rings may be too coarse to have the outermost fibre among them.
    surface = organ.surface(np.repeat(stations, outline.size), np.tile(outline, stations.size))
    surface = surface.reshape(stations.size, outline.size, 3) - organ.axis_at(stations)[:, None]
    farthest = np.abs(np.einsum("npi,ni->np", surface, up)).max(axis=1)
    return np.clip(heights / farthest[ring], -1.0, 1.0)


@njit(cache=True, nogil=True)
def _write(
    normal: NDArray[np.float64],
    bending: NDArray[np.float64],
    moment: NDArray[np.float64],
    before: NDArray[np.int32],
    after: NDArray[np.int32],
    weight: NDArray[np.float64],
    fraction: NDArray[np.float64],
    free: NDArray[np.bool_],
    scale: float,
    out: NDArray[np.float32],
) -> None:
    for v in range(out.shape[0]):
        if not free[v]:
            out[v] = 0.0
            continue
        i, j, w = before[v], after[v], weight[v]
        # A moment above zero stretches the side away from the pull.
        low = normal[i] - fraction[v] * np.sign(moment[i]) * bending[i]
        high = normal[j] - fraction[v] * np.sign(moment[j]) * bending[j]
        out[v] = scale * (low + w * (high - low))


@njit(cache=True, nogil=True)
def _write_in_space(
    stresses: NDArray[np.float64],
    element: NDArray[np.int32],
    weight: NDArray[np.float64],
    up: NDArray[np.float64],
    across: NDArray[np.float64],
    free: NDArray[np.bool_],
    out: NDArray[np.float32],
) -> None:
    for v in range(out.shape[0]):
        if not free[v]:
            out[v] = 0.0
            continue
        e, w = element[v], weight[v]
        total = 0.0
        for end in range(2):
            scale = w if end else 1.0 - w
            bending = up[v] * stresses[e, end, 1] - across[v] * stresses[e, end, 2]
            total += scale * (stresses[e, end, 0] + bending)
        out[v] = total
