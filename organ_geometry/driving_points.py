"""Driving points: places on the organ's axis, each of which carries a rigid transform."""

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kernel_cache import njit
from organ_geometry.organ import Organ


@dataclass(frozen=True, slots=True, eq=False)
class DrivingPoints:
    """D points on an organ's axis at rest: (D,) growing stations and (D, 3) places, mm."""

    stations: NDArray[np.float64]
    positions: NDArray[np.float64]

    def __post_init__(self) -> None:
        stations = np.array(self.stations, dtype=np.float64)
        positions = np.array(self.positions, dtype=np.float64)
        if stations.ndim != 1 or stations.size < 2 or not np.all(np.diff(stations) > 0.0):
            raise ValueError("stations of driving points must be two or more growing numbers, mm")
        if positions.shape != (stations.size, 3):
            raise ValueError(
                f"positions must have shape ({stations.size}, 3), got {positions.shape}"
            )
        for name, array in (("stations", stations), ("positions", positions)):
            array.setflags(write=False)
            object.__setattr__(self, name, array)

    @classmethod
    def of(
        cls, organ: Organ, *, spacing: float, at: NDArray[np.float64] | None = None
    ) -> "DrivingPoints":
        """Place points at key sections, at stations `at`, and between them no `spacing` apart."""
        if not spacing > 0.0:
            raise ValueError(f"spacing of driving points must be above 0 mm, got {spacing} mm")
        wanted = organ.key_stations if at is None else np.concatenate([organ.key_stations, at])
        wanted = np.unique(np.clip(wanted, 0.0, organ.length))
        # Points nearer than this are one: their blend would be a division by next to nothing.
        apart = np.concatenate([[True], np.diff(wanted) > 1e-6 * organ.length])
        knots = wanted[apart]
        pieces: list[NDArray[np.float64]] = [
            np.linspace(start, end, max(1, int(np.ceil((end - start) / spacing))), endpoint=False)
            for start, end in itertools.pairwise(knots)
        ]
        stations = np.concatenate([*pieces, knots[-1:]])
        return cls(stations, organ.axis_at(stations))

    def binding(
        self, stations: NDArray[np.float64]
    ) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
        """Return for (V,) stations i and w: (1 - w) of point i and w of point i + 1 is followed."""
        index = np.searchsorted(self.stations, stations, side="right") - 1
        index = np.clip(index, 0, self.stations.size - 2)
        before, after = self.stations[index], self.stations[index + 1]
        weight = np.clip((stations - before) / (after - before), 0.0, 1.0)
        return index.astype(np.int32), weight

    def transforms(
        self,
        along: NDArray[np.float64],
        across: NDArray[np.float64],
        rotation: NDArray[np.float64],
        frame: NDArray[np.float64],
        out: NDArray[np.float64],
    ) -> NDArray[np.float64]:
        """Write and return `out`, (D, 3, 4) rigid transforms less the identity, [R - I | t], mm."""
        # `frame` has orthonormal columns: along the beam, lateral, along the pull. A point moves by
        # `along` the first and `across`, along the third, mm, and turns by `rotation` from the
        # first towards the third, rad, each (D,). Less the identity a rest pose is exactly zero,
        # and what is added to a vertex at rest leaves it as it is, to the bit.
        _rigid_transforms(self.positions, along, across, rotation, frame, out)
        return out


@njit(cache=True, nogil=True)
def _rigid_transforms(
    positions: NDArray[np.float64],
    along: NDArray[np.float64],
    across: NDArray[np.float64],
    rotation: NDArray[np.float64],
    frame: NDArray[np.float64],
    out: NDArray[np.float64],
) -> None:
    for k in range(positions.shape[0]):
        sine = np.sin(rotation[k])
        versine = -2.0 * np.sin(0.5 * rotation[k]) ** 2  # cos - 1 without its cancellation
        for i in range(3):
            a_i, p_i = frame[i, 0], frame[i, 2]
            moved = along[k] * a_i + across[k] * p_i
            for j in range(3):
                a_j, p_j = frame[j, 0], frame[j, 2]
                turn = versine * (a_i * a_j + p_i * p_j) + sine * (p_i * a_j - a_i * p_j)
                out[k, i, j] = turn
                moved -= turn * positions[k, j]
            out[k, i, 3] = moved
