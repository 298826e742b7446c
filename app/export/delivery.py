"""Deliveries: what an order was written as."""

from dataclasses import dataclass
from pathlib import Path

from app.export.snapshot import Snapshot

__all__ = ["Delivery"]


@dataclass(frozen=True, slots=True)
class Delivery:
    """What was written.

    Attributes
    ----------
    kind
        What it is, in words.
    files
        The files, the one that was asked for first.
    surfaces
        Names of the closed surfaces; none of a table.
    vertices, faces
        How many there are.
    force
        The grasper's whole force at the end, N; of torn pieces, the one that tore them.
    deflection
        Displacement of the grasp at that force, mm; 0 for torn pieces, which have swung back.
    animations
        Names of the motions in it.
    """

    kind: str
    files: tuple[Path, ...]
    surfaces: tuple[str, ...]
    vertices: int
    faces: int
    force: float
    deflection: float
    animations: tuple[str, ...] = ()

    @classmethod
    def of(cls, kind: str, snapshot: Snapshot, files: tuple[Path, ...] = ()) -> "Delivery":
        """Return what a snapshot's file is."""
        surfaces = snapshot.surfaces
        return cls(
            kind,
            files,
            tuple(surface.name for surface in surfaces),
            sum(len(surface.vertices) for surface in surfaces),
            sum(len(surface.skin.faces) for surface in surfaces),
            snapshot.force,
            snapshot.deflection,
        )
