"""The connective tissue between a duct and its bed: strands, and films between them.

Streamed are five numbers for each strand: where it holds the duct (3), how taut it is, and which
rod it lies against; and the rods. The page draws the rest from them (`strands.js`): threads, films,
stubs of parted strands, and the bed, which the strands' feet lie in, drawn up and pressed in.
"""

from itertools import pairwise
from pathlib import Path

import numpy as np
import viser
from numpy.typing import NDArray

from app.trainer.stage.drawn import add_mesh
from app.trainer.stage.stage import Stage
from app.trainer.viser_bridge.fast_transport import hand_over
from app.trainer.viser_bridge.page import float32_text, run_function, run_module
from kernel_cache import SameTypes, njit
from physics.bed import BeamOnBed, kernels

NODE = "/bed/strands"
SCRIPT = Path(__file__).with_suffix(".js")
PARTED = -9.0
"""In place of how taut a strand is, of one that has parted."""
NUMBERS, ROD_NUMBERS = 5, kernels.IN_USE + 1
"""Streamed for each strand, and for each rod, as the first columns of the state's."""
# mm, and of how taut: less cannot be seen.
LEAST_CHANGE = 0.01
WIDTH = 0.05
"""Half of the width of a mean strand, mm."""
# Films join neighbours between two of these angles from straight down, on both flanks, rad.
FILM_ANGLES = (0.30, 0.65, 0.95, 1.25)
# Largest distance of two neighbours that a film joins, mm.
FILM_WIDTH = 1.6


class DrawnStrands:
    """S strands, the scene node `NODE`, in the stage's coordinates.

    `numbers` are those that are streamed: `ROD_NUMBERS` of each of `rods`, then `NUMBERS` of each
    strand. `feet`, (S, 3), are in mm, `toughness`, (S,), in any unit, and `pairs`, (P, 2), are
    strands that films join. Their feet lie in the bed of `stage`; a strand is drawn with so many
    `fibres`.
    """

    def __init__(
        self,
        scene: viser.SceneApi,
        numbers: NDArray[np.float32],
        *,
        feet: NDArray[np.float64],
        toughness: NDArray[np.float64],
        pairs: NDArray[np.int64],
        rods: int,
        stage: Stage,
        fibres: int,
    ) -> None:
        self._scene = scene
        self._sent = np.zeros((-(-numbers.size // 3), 3), np.float32)
        self._sent.reshape(-1)[: numbers.size] = numbers
        nothing = np.zeros((1, 3), np.uint32)  # to be seen without the script
        self._mesh = add_mesh(scene, NODE, self._sent, nothing, color=(255, 255, 255))
        widths = WIDTH * np.clip((toughness / np.median(toughness)) ** 0.6, 0.45, 2.2)
        wear = {
            "count": len(feet),
            "rods": rods,
            "rodNumbers": ROD_NUMBERS,
            "fibres": fibres,
            "feet": float32_text(feet),
            "widths": float32_text(widths),
            "pairs": float32_text(pairs),
            "floor": list(stage.floor),
            "scale": stage.scale,
            "columns": stage.bed_columns,
        }
        run_module(scene, SCRIPT, "bluntdissectStrands.show", NODE, wear)

    def send(self, numbers: NDArray[np.float32]) -> None:
        """Draw the strands by new numbers, if that can be seen to differ."""
        if differ(numbers, self._sent.reshape(-1), LEAST_CHANGE):
            self._sent = np.zeros(self._sent.shape, np.float32)
            self._sent.reshape(-1)[: numbers.size] = numbers
            hand_over(self._mesh, "vertices", self._sent)

    def remove(self) -> None:
        """Remove them from the scene."""
        self._mesh.remove()
        run_function(self._scene, "bluntdissectStrands.remove", NODE)


class StrandsInBed(DrawnStrands):
    """The strands of one client's duct, as its beam has them.

    `aside`, (S, 3) mm in the order of `beam.strands`, is how far off its place each is drawn, where
    the duct's skin is not the beam's.
    """

    def __init__(
        self,
        scene: viser.SceneApi,
        beam: BeamOnBed,
        *,
        aside: NDArray[np.float64],
        stage: Stage,
        fibres: int,
    ) -> None:
        strand, rods = beam.state.strand, beam.state.rods
        self._aside = aside[beam.order]
        self._new = write_strands(beam, self._aside)
        arm = strand[kernels.ARM_X : kernels.ARM_Z + 1]
        nodes = np.repeat(np.arange(beam.stations.size), np.diff(beam.state.first))
        super().__init__(
            scene,
            self._new,
            feet=strand[kernels.FOOT_X : kernels.FOOT_Z + 1].T + self._aside,
            toughness=strand[kernels.STIFF] * strand[kernels.YIELD] * strand[kernels.FAILURE],
            pairs=film_pairs(beam.stations[nodes] + arm[0], np.arctan2(arm[1], -arm[2])),
            rods=rods.shape[0],
            stage=stage,
            fibres=fibres,
        )

    def show(self, beam: BeamOnBed) -> None:
        """Draw the strands as they are now."""
        self.send(write_strands(beam, self._aside, self._new))


def write_strands(
    beam: BeamOnBed,
    aside: NDArray[np.float64] | None = None,
    out: NDArray[np.float32] | None = None,
) -> NDArray[np.float32]:
    """Write the numbers that are streamed: all rods, then all strands in the beam's own order."""
    s = beam.state
    header = ROD_NUMBERS * len(s.rods)
    if aside is None:
        aside = np.zeros((beam.strands.count, 3))
    if out is None:
        out = np.zeros(header + NUMBERS * beam.strands.count, np.float32)
    out[:header].reshape(-1, ROD_NUMBERS)[:] = s.rods[:, :ROD_NUMBERS]
    _WRITE(s, aside, out[header:])
    return out


def film_pairs(along: NDArray[np.float64], angle: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return (P, 2) strands that films join, by their stations, mm, and rad from straight down."""
    pairs = [np.empty((0, 2), np.int64)]
    for flank in (-1.0, 1.0):
        for low, high in pairwise(FILM_ANGLES):
            band = np.flatnonzero((flank * angle >= low) & (flank * angle < high))
            band = band[np.argsort(along[band], kind="stable")]
            near = np.diff(along[band]) <= FILM_WIDTH
            pairs.append(np.stack([band[:-1], band[1:]], axis=1)[near])
    return np.concatenate(pairs)


@njit(cache=True, nogil=True)
def differ(numbers: NDArray[np.float32], sent: NDArray[np.float32], least: float) -> bool:
    """Return whether numbers differ by more than the least from those sent, which may be more."""
    largest = np.float32(0.0)
    for i in range(numbers.shape[0]):
        largest = max(largest, abs(numbers[i] - sent[i]))
    return bool(largest > least)


@njit(cache=True, nogil=True)
def _write(s: kernels.State, aside: NDArray[np.float64], out: NDArray[np.float32]) -> None:
    for group in range(s.first.size - 1):
        n, other = kernels.group_nodes(s.pair, group, s.x.shape[0])
        for i in range(s.first[group], s.first[group + 1]):
            at = NUMBERS * i
            end, foot = kernels.strand_ends(s.x, s.q, s.strand, n, other, i)
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
                side, clear, _, _, _ = kernels.path_round(end, foot, s.rods[m], s.side[m, i], False)
                if side & 1 == 1 and clear >= length:  # of two the longer one, as it is solved
                    length = clear
                    out[at + 4] = 1 + 2 * m + (1 if side > 0 else 0)
            # Elongation over that at which it parts; below zero how slack it is, over its length.
            elongation = length - s.strand[kernels.LENGTH, i]
            row = kernels.FAILURE if elongation > 0.0 else kernels.LENGTH
            out[at + 3] = elongation / s.strand[row, i]


_WRITE = SameTypes(_write)
