"""The connective tissue between a duct and its bed: strands, and films between them.

Streamed are five numbers for each strand: where it holds the duct (3), how taut it is, and which
rod it lies against; and the rods. The page draws the rest from them (`strands.js`): threads, films,
stubs of parted strands, and the bed, which the strands' feet lie in, drawn up and pressed in.
"""

import base64
import json
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import viser
from numpy.typing import NDArray

from app.trainer.viser_bridge import run_in_page
from kernel_cache import njit
from physics.bed import BeamOnBed, kernels

__all__ = ["PARTED", "StrandsInBed", "write_strands"]

PARTED = -9.0
"""In place of how taut a strand is, of one that has parted."""
NUMBERS = 5
"""Streamed for each strand."""
LEAST_CHANGE = 0.01
"""mm, and of how taut: less cannot be seen."""
WIDTH = 0.05
"""Half of the width of a mean strand, mm."""
FILM_ANGLES = (0.30, 0.65, 0.95, 1.25)
"""Films join neighbours between two of these angles from straight down, on both flanks, rad."""
FILM_WIDTH = 1.6
"""Largest distance of two neighbours that a film joins, mm."""


@cache
def _script() -> str:
    return Path(__file__).with_suffix(".js").read_text(encoding="utf-8")


class StrandsInBed:
    """The strands of one client's duct, the scene node `name`, in the stage's coordinates.

    `aside`, (S, 3) mm in the order of `beam.strands`, is how far off its place each is drawn, where
    the duct's skin is not the beam's. `floor` and `scale` are the place and the scale of the
    stage's bed, `bed_columns` how many points a row of it has, 0 for a hard one, and `fibres` how
    many threads a strand is drawn with.
    """

    def __init__(
        self,
        scene: viser.SceneApi,
        name: str,
        beam: BeamOnBed,
        *,
        aside: NDArray[np.float64],
        floor: tuple[float, float, float],
        scale: float,
        bed_columns: int,
        fibres: int,
    ) -> None:
        self._scene, self._name = scene, name
        strand, order = beam.state.strand, beam.order
        self._aside = aside[order]
        count, rods = beam.strands.count, beam.state.rods.shape[0]
        self._header = beam.state.rods.size
        size = self._header + NUMBERS * count
        self._sent = np.zeros((-(-size // 3), 3), np.float32)
        self._new = self._sent.copy()
        write_strands(beam, self._aside, self._new.reshape(-1))
        self._sent[:] = self._new
        self._mesh = scene.add_mesh_simple(
            name,
            self._sent,
            np.zeros((1, 3), np.uint32),  # nothing to be seen without the script
            color=(255, 255, 255),
            cast_shadow=False,
            receive_shadow=False,
        )
        tough = strand[kernels.STIFF] * strand[kernels.YIELD] * strand[kernels.PART]
        widths = WIDTH * np.clip((tough / np.median(tough)) ** 0.6, 0.45, 2.2)
        wear = {
            "count": count,
            "rods": rods,
            "header": self._header,
            "fibres": fibres,
            "feet": _text(strand[kernels.FOOT_X : kernels.FOOT_Z + 1].T + self._aside),
            "widths": _text(widths),
            "pairs": _text(film_pairs(beam)),
            "floor": list(floor),
            "scale": scale,
            "columns": bed_columns,
        }
        run_in_page(
            scene, f"{_script()}\nbluntdissectStrands.show({json.dumps(name)}, {json.dumps(wear)});"
        )

    @property
    def whole(self) -> int:
        """How many are drawn whole."""
        return int((self._sent.reshape(-1)[self._header + 3 :: NUMBERS] > PARTED).sum())

    def show(self, beam: BeamOnBed) -> None:
        """Draw the strands as they are now, if that can be seen to differ."""
        write_strands(beam, self._aside, self._new.reshape(-1))
        if np.abs(self._new - self._sent).max() > LEAST_CHANGE:
            self._sent[:] = self._new
            self._mesh.vertices = self._sent

    def remove(self) -> None:
        """Remove them from the scene."""
        self._mesh.remove()
        run_in_page(self._scene, f"bluntdissectStrands.remove({json.dumps(self._name)});")


def write_strands(
    beam: BeamOnBed,
    aside: NDArray[np.float64] | None = None,
    out: NDArray[np.float32] | None = None,
) -> NDArray[np.float32]:
    """Write the numbers that are streamed: all rods, then all strands in the beam's own order."""
    s = beam.state
    if aside is None:
        aside = np.zeros((beam.strands.count, 3))
    if out is None:
        out = np.zeros(s.rods.size + NUMBERS * beam.strands.count, np.float32)
    out[: s.rods.size] = s.rods.reshape(-1)
    _write(s, aside, out[s.rods.size :])
    return out


def film_pairs(beam: BeamOnBed) -> NDArray[np.int64]:
    """Return (P, 2) strands, in the order of the beam's state, that films join."""
    arm = beam.state.strand[kernels.ARM_X : kernels.ARM_Z + 1]
    angle = np.arctan2(arm[1], -arm[2])
    nodes = np.repeat(np.arange(beam.stations.size), np.diff(beam.state.first))
    along = beam.stations[nodes] + arm[0]
    pairs = [np.empty((0, 2), np.int64)]
    for flank in (-1.0, 1.0):
        for low, high in pairwise(FILM_ANGLES):
            band = np.flatnonzero((flank * angle >= low) & (flank * angle < high))
            band = band[np.argsort(along[band], kind="stable")]
            near = np.diff(along[band]) <= FILM_WIDTH
            pairs.append(np.stack([band[:-1], band[1:]], axis=1)[near])
    return np.concatenate(pairs)


@njit(cache=True)
def _write(s: kernels.State, aside: NDArray[np.float64], out: NDArray[np.float32]) -> None:
    for n in range(s.x.shape[0]):
        for i in range(s.first[n], s.first[n + 1]):
            at = NUMBERS * i
            end, foot = kernels.strand_ends(s, n, i)
            for k in range(3):
                out[at + k] = end[k] + aside[i, k]
            out[at + 4] = 0.0
            if s.damage[i] >= 1.0:
                out[at + 3] = PARTED
                continue
            length = np.sqrt(
                (end[0] - foot[0]) ** 2 + (end[1] - foot[1]) ** 2 + (end[2] - foot[2]) ** 2
            )
            for m in range(s.rods.shape[0]):
                if s.rods[m, kernels.IN_USE] == 0.0 or s.side[m, i] & 1 == 0:
                    continue
                side, way, _, _, _ = kernels.way_round(end, foot, s.rods[m], s.side[m, i], False)
                if side & 1 == 1:
                    length = way
                    out[at + 4] = 1 + 2 * m + (1 if side > 0 else 0)
                    break
            # Elongation over that at which it parts; below zero how slack it is, over its length.
            elongation = length - s.strand[kernels.LENGTH, i]
            row = kernels.PART if elongation > 0.0 else kernels.LENGTH
            out[at + 3] = elongation / s.strand[row, i]


def _text(numbers: NDArray[np.generic]) -> str:
    return base64.b64encode(numbers.astype("<f4").tobytes()).decode()
