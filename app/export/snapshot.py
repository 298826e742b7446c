"""Snapshots: an organ pulled or torn, as closed surfaces that stand where the organ stands."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.export.motion import Motion
from app.export.strands import StrandsSnapshot
from app.simulation import PIECES, Dissection, Stresses, SurfaceStress
from organ_geometry.mesh import Surface, TornPiece, organ_skin

__all__ = ["Snapshot", "bed_snapshots"]


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


def bed_snapshots(
    dissection: Dissection,
    motion: Motion,
    pieces: tuple[TornPiece, TornPiece] | None,
    keys: Iterable[int],
    *,
    edge_length: float,
) -> Iterator[Snapshot]:
    """Yield an organ on its bed, or its two pieces, at some keys of a motion."""
    bed, torn = motion.bed, pieces or ()
    assert bed is not None  # noqa: S101 (a motion on a bed has it)
    skins = [organ_skin(dissection.organ, edge_length=edge_length)]
    skins += [piece.skin for piece in torn]
    bounds = [each.bound_to(dissection.driving) for each in skins]
    stresses = [SurfaceStress(dissection, each) for each in skins]
    for key in keys:
        whole, reading = bool(motion.whole[key]), motion.readings[key]
        surfaces: list[Surface] = []
        for number, bound in [(0, bounds[0])] if whole else enumerate(bounds[1:]):
            pose = motion.of_piece(number).transforms[key]
            vertices = bound.deform(pose, np.empty_like(bound.skin.vertices))
            if not whole:
                torn[number].open(float(motion.fronts[key]), vertices)
            surfaces.append(Surface("organ" if whole else PIECES[number], bound.skin, vertices))
        stations = np.concatenate([surface.skin.stations for surface in surfaces])
        yield Snapshot(
            tuple(surfaces),
            tuple(
                stress.in_space(bed.stations[key], bed.stresses[key], reading.check.threshold)
                for stress in (stresses[:1] if whole else stresses[1:])
            ),
            reading.force,
            reading.deflection,
            bed.freed_at(key, stations - dissection.clamps[0]).astype(np.float32),
            motion.strands_at(key, dissection.driving),
        )
