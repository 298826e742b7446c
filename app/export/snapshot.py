"""Snapshots: an organ pulled or torn, as closed surfaces that stand where the organ stands."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.export.motion import Motion
from app.export.strands import StrandsSnapshot
from app.simulation import PIECES, Dissection, NickReading, Stresses, SurfaceStress
from organ_geometry.mesh import Surface, TornPiece, organ_skin

ORGAN = "organ"
"""Name of the whole organ's mesh."""
NAMES = (ORGAN, *PIECES)
"""Names of an organ's meshes: whole, and of its two pieces."""


@dataclass(frozen=True, slots=True, eq=False)
class Snapshot:
    """Closed surfaces of an organ at one moment, in the organ's coordinates."""

    surfaces: tuple[Surface, ...]  # one "organ", or two pieces
    stresses: tuple[Stresses, ...]  # at the vertices of each
    force: float  # of the grasper, N; for torn pieces, at the break
    deflection: float  # of the grasp, mm; 0 for torn pieces, which have swung back
    # share of strands that have parted about the vertices of each, and the strands, in a bed
    freed: tuple[NDArray[np.float32], ...] = ()
    strands: StrandsSnapshot | None = None
    # how deep the wall is torn at the vertices of each, mm, in a bed
    nicked: tuple[NDArray[np.float32], ...] = ()

    @classmethod
    def joined(cls, snapshots: "Sequence[Snapshot]") -> "Snapshot":
        """Return the snapshots of several tubes in beds, at one moment, as one."""
        # Second pieces come last, so that a surface keeps its number when another tube tears.
        of = [
            list(zip(each.surfaces, each.stresses, each.freed, each.nicked, strict=True))
            for each in snapshots
        ]
        shown = [first for first, *_ in of] + [second for _, *seconds in of for second in seconds]
        surfaces, stresses, freed, nicked = zip(*shown, strict=True)
        strands = StrandsSnapshot.joined([each.strands for each in snapshots if each.strands])
        first = snapshots[0]
        return cls(surfaces, stresses, first.force, first.deflection, freed, strands, nicked)


def bed_snapshots(
    dissection: Dissection,
    motion: Motion,
    pieces: tuple[TornPiece, TornPiece] | None,
    keys: Iterable[int],
    *,
    edge_length: float,
    names: tuple[str, str, str] = NAMES,
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
            surfaces.append(Surface(names[0 if whole else 1 + number], bound.skin, vertices))
        yield Snapshot(
            tuple(surfaces),
            tuple(
                stress.in_space(bed.stations[key], bed.stresses[key], reading.check.threshold)
                for stress in (stresses[:1] if whole else stresses[1:])
            ),
            reading.force,
            reading.deflection,
            tuple(
                bed.freed_at(key, each.skin.stations - dissection.clamps[0]).astype(np.float32)
                for each in surfaces
            ),
            motion.strands_at(key, dissection.driving),
            tuple(
                _nicked(reading.nicks if whole else (), each.skin.stations - dissection.clamps[0])
                for each in surfaces
            ),
        )


def _nicked(nicks: Sequence[NickReading], stations: NDArray[np.float64]) -> NDArray[np.float32]:
    """Return how deep the wall is torn at stations, mm, as far as each tear weakens it."""
    out = np.zeros(stations.size, np.float32)
    for nick in nicks:
        near = np.abs(stations - nick.station) <= nick.reach
        near[np.abs(stations - nick.station).argmin()] = True
        out[near] = np.maximum(out[near], nick.depth_mm)
    return out
