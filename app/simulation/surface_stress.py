"""Stress on the surface: what the beam says at each vertex of the skin."""

from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

from app.simulation.dissection import Dissection
from organ_geometry import Organ
from organ_geometry.mesh import Skin
from physics import Equilibrium

__all__ = ["Stresses", "SurfaceStress", "fibre_shares"]

CLAMP_DEPTH = 0.01
"""Part of the span by which the stress at a clamp goes on behind it."""


@dataclass(frozen=True, slots=True, eq=False)
class Stresses:
    """Stresses at V vertices.

    Attributes
    ----------
    normal
        (V,) tension over the section, MPa.
    bending
        (V,) bending stress, MPa; above zero where bending stretches.
    total
        (V,) their sum, MPa.
    distance_to_break
        (V,) 1 without stress, 0 at the threshold, below zero past it.
    """

    normal: NDArray[np.float32]
    bending: NDArray[np.float32]
    total: NDArray[np.float32]
    distance_to_break: NDArray[np.float32]

    @classmethod
    def none(cls, count: int) -> "Stresses":
        """Return those of a surface that bears nothing."""
        nothing = np.zeros(count, dtype=np.float32)
        return cls(nothing, nothing, nothing, np.ones(count, dtype=np.float32))


class SurfaceStress:
    """Normal plus bending stress at the vertices of a skin, along the organ's axis.

    A vertex at the share s of its section's fibre distance, above zero towards the pull, has
    sigma_N - s sign(M) sigma_B, both linear between the stations at which the beam is sampled.
    Well behind a clamp there is none.

    Parameters
    ----------
    dissection
        The organ between its clamps.
    skin
        The skin.
    """

    def __init__(self, dissection: Dissection, skin: Skin) -> None:
        first, last = dissection.clamps
        self._places = skin.stations - first
        self._share = fibre_shares(dissection.organ, skin, dissection.frame[:, 2])
        depth = CLAMP_DEPTH * (last - first)
        self._free = (skin.stations >= first - depth) & (skin.stations <= last + depth)
        self._stations: NDArray[np.float64] | None = None
        self._before = np.zeros(skin.stations.size, dtype=np.int32)
        self._after = np.zeros(skin.stations.size, dtype=np.int32)
        self._weight = np.zeros(skin.stations.size)

    def write(
        self, pulled: Equilibrium, out: NDArray[np.float32], *, part: float = 1.0
    ) -> NDArray[np.float32]:
        """Write the stress at each vertex."""
        self._write_parts(pulled, pulled.normal_stress, pulled.bending_stress, part, out)
        return out

    def at(self, pulled: Equilibrium, threshold: float) -> Stresses:
        """Return the stresses at each vertex, apart."""
        normal, bending = (np.empty(self._share.size, dtype=np.float32) for _ in range(2))
        nothing = np.zeros(pulled.stations.size)
        self._write_parts(pulled, pulled.normal_stress, nothing, 1.0, normal)
        self._write_parts(pulled, nothing, pulled.bending_stress, 1.0, bending)
        total = normal + bending
        return Stresses(normal, bending, total, 1.0 - total / np.float32(threshold))

    def _write_parts(
        self,
        pulled: Equilibrium,
        normal: NDArray[np.float64],
        bending: NDArray[np.float64],
        part: float,
        out: NDArray[np.float32],
    ) -> None:
        if self._stations is None or not np.array_equal(self._stations, pulled.stations):
            self._bind(pulled.stations)
        _write(
            normal,
            bending,
            pulled.moment,
            self._before,
            self._after,
            self._weight,
            self._share,
            self._free,
            part,
            out,
        )

    def _bind(self, stations: NDArray[np.float64]) -> None:
        """Find the two stations that each vertex lies between."""
        self._stations = stations.copy()
        places, numbers = np.unique(stations, return_index=True)
        index = np.searchsorted(places, self._places, side="right") - 1
        index = np.clip(index, 0, places.size - 2)
        self._before[:] = numbers[index]
        self._after[:] = numbers[index + 1]
        low, high = places[index], places[index + 1]
        self._weight[:] = np.clip((self._places - low) / (high - low), 0.0, 1.0)


def fibre_shares(organ: Organ, skin: Skin, direction: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return how far out in its section each vertex lies along a direction."""
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


@numba.njit(cache=True)
def _write(
    normal: NDArray[np.float64],
    bending: NDArray[np.float64],
    moment: NDArray[np.float64],
    before: NDArray[np.int32],
    after: NDArray[np.int32],
    weight: NDArray[np.float64],
    share: NDArray[np.float64],
    free: NDArray[np.bool_],
    part: float,
    out: NDArray[np.float32],
) -> None:
    for v in range(out.shape[0]):
        if not free[v]:
            out[v] = 0.0
            continue
        i, j, w = before[v], after[v], weight[v]
        # A moment above zero stretches the side away from the pull.
        low = normal[i] - share[v] * np.sign(moment[i]) * bending[i]
        high = normal[j] - share[v] * np.sign(moment[j]) * bending[j]
        out[v] = part * (low + w * (high - low))
