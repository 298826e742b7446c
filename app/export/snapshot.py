"""Snapshots: an organ pulled or torn, as closed surfaces that stand where the organ stands."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.export.motion import Motion
from app.export.strands import StrandsSnapshot
from app.simulation import PIECES, SETTLED_SECONDS, Dissection, Stresses, SurfaceStress, tear_front
from organ_geometry.mesh import Surface, TornPiece, organ_skin
from physics import BreakEvent, Theory, critical_stations

__all__ = [
    "DissectedOrgan",
    "PulledOrgan",
    "Snapshot",
    "borne_force",
    "torn_snapshot",
]

# Stations along the span at which stress is sampled: two for each driving point.
STRESS_STATIONS = 121


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


class PulledOrgan:
    """An organ's skin under a pull, force by force, with its stresses.

    `grasp` is in mm from the first clamp, `threshold` in MPa, and `edge_length`, mm, is the wanted
    length of the triangles' edges. A `ValueError` if the grasp is not between the clamps, or the
    skin cannot be made with such edges.
    """

    def __init__(
        self,
        dissection: Dissection,
        theory: Theory,
        *,
        grasp: float,
        edge_length: float,
        threshold: float,
    ) -> None:
        beam = dissection.beam
        self._dissection = dissection
        self._pull = theory.pull(beam, grasp)
        self.skin = organ_skin(dissection.organ, edge_length=edge_length)
        self._bound = self.skin.bound_to(dissection.driving)
        self._threshold = threshold
        self._stress = SurfaceStress(dissection, self.skin)
        driven = dissection.beam_stations
        loaded = critical_stations(beam, grasp, STRESS_STATIONS)
        self._stations = np.concatenate([driven, loaded])
        self._driven, self._loaded = slice(0, driven.size), slice(driven.size, None)

    def under(self, force: float) -> Snapshot:
        """Return the organ under a force, N, even past the break (see `borne_force`)."""
        dissection = self._dissection
        pulled = self._pull.to_force(force).sample(self._stations)
        vertices = np.empty_like(self.skin.vertices)
        moved = dissection.move(pulled.part(self._driven), dissection.rest_transforms())
        self._bound.deform(moved, vertices)
        stress = self._stress.at(pulled.part(self._loaded), self._threshold)
        surface = Surface("organ", self.skin, vertices)
        return Snapshot((surface,), (stress,), pulled.force, pulled.deflection)


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


def borne_force(dissection: Dissection, event: BreakEvent | None, force: float) -> float:
    """Return the force; raise if it is not a number or is past the break."""
    if not math.isfinite(force):
        raise ValueError(f"force must be a finite number of N, got {force}")
    if event is not None and abs(force) > event.force:
        raise ValueError(
            f"force of {force:g} N is past the break of {dissection.preset.name} at "
            f"{event.force:.4g} N; give less, or --torn for the two pieces"
        )
    return force


def torn_snapshot(
    dissection: Dissection,
    event: BreakEvent | None,
    *,
    force: float | None,
    edge_length: float,
    seed: int = 1,
) -> Snapshot:
    """Return the two unstressed pieces of a torn organ, and the force at the break."""
    if event is None:
        raise ValueError(f"preset {dissection.preset.name} does not break; leave out --torn")
    if force is not None and not math.isfinite(force):
        raise ValueError(f"force must be a finite number of N, got {force}")
    if force is not None and force < event.force:
        raise ValueError(
            f"force of {force:g} N does not tear {dissection.preset.name}, it breaks at "
            f"{event.force:.4g} N; give that or more, or no force"
        )
    gone = tear_front(SETTLED_SECONDS)
    pieces = dissection.torn_at(event.check, edge_length=edge_length, seed=seed)
    surfaces = tuple(
        Surface(name, piece.skin, piece.open(gone, piece.skin.vertices.copy()))
        for name, piece in zip(PIECES, pieces, strict=True)
    )
    stresses = tuple(Stresses.none(len(surface.vertices)) for surface in surfaces)
    return Snapshot(surfaces, stresses, event.force, 0.0)
