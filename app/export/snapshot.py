"""Snapshots: an organ pulled or torn, as closed surfaces that stand where the organ stands."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.export.motion import Motion
from app.export.strands import StrandsSnapshot
from app.simulation import PIECES, Dissection, Stresses, SurfaceStress
from organ_geometry.mesh import Surface, TornPiece, organ_skin

__all__ = ["DissectedOrgan", "Snapshot"]


@dataclass(frozen=True, slots=True, eq=False)
class Snapshot:
    """Closed surfaces of an organ at one moment, in the organ's coordinates."""

    surfaces: tuple[Surface, ...]  # one "organ", or two pieces
    stresses: tuple[Stresses, ...]  # at the vertices of each
    force: float  # of the grasper, N; for torn pieces, at the break
    deflection: float  # of the grasp, mm; 0 for torn pieces, which have swung back
    # (V,) share of strands that have parted about each vertex, and the strands; None without a bed
    freed: NDArray[np.float32] | None = None
    strands: StrandsSnapshot | None = None


class DissectedOrgan:
    """An organ's skin on its bed at the keys of a motion, with its stresses and its strands."""

    def __init__(
        self,
        dissection: Dissection,
        motion: Motion,
        pieces: tuple[TornPiece, TornPiece] | None = None,
        *,
        edge_length: float,
    ) -> None:
        self._dissection, self._motion, self._pieces = dissection, motion, pieces or ()
        skin = organ_skin(dissection.organ, edge_length=edge_length)
        skins = [skin, *(piece.skin for piece in self._pieces)]
        self._bound = [each.bound_to(dissection.driving) for each in skins]
        self._stress = [SurfaceStress(dissection, each) for each in skins]

    def at(self, key: int) -> Snapshot:
        """Return the organ, or its two pieces, at a key of the motion."""
        motion, dissection = self._motion, self._dissection
        bed, reading = motion.bed, motion.readings[key]
        assert bed is not None  # noqa: S101 (a motion on a bed has it)
        whole = bool(motion.whole[key])
        surfaces: list[Surface] = []
        for number, bound in [(0, self._bound[0])] if whole else enumerate(self._bound[1:]):
            pose = motion.of_piece(number).transforms[key]
            vertices = bound.deform(pose, np.empty_like(bound.skin.vertices))
            if not whole:
                self._pieces[number].open(float(motion.fronts[key]), vertices)
            surfaces.append(Surface("organ" if whole else PIECES[number], bound.skin, vertices))
        stations = np.concatenate([surface.skin.stations for surface in surfaces])
        return Snapshot(
            tuple(surfaces),
            tuple(
                stress.in_space(bed.stations[key], bed.stresses[key], reading.check.threshold)
                for stress in (self._stress[:1] if whole else self._stress[1:])
            ),
            reading.force,
            reading.deflection,
            bed.freed_at(key, stations - dissection.clamps[0]).astype(np.float32),
            motion.strands_at(key, dissection.driving),
        )
