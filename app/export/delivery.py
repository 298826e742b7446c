"""Deliveries: what an order was written as."""

from dataclasses import dataclass
from pathlib import Path

from app.export.snapshot import Snapshot

__all__ = ["Delivery"]


@dataclass(frozen=True, slots=True)
class Delivery:
    """What was written."""

    kind: str  # in words
    files: tuple[Path, ...]  # the one that was asked for first
    surfaces: tuple[str, ...]  # names of the closed surfaces; none in a table
    vertices: int
    faces: int
    force: float  # of the grasper at the end, N; for torn pieces, at the break
    deflection: float  # of the grasp at that force, mm; 0 for torn pieces, which have swung back
    animations: tuple[str, ...] = ()  # names of the motions

    @classmethod
    def of(cls, kind: str, snapshot: Snapshot, files: tuple[Path, ...] = ()) -> "Delivery":
        """Return the description of a snapshot's file."""
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
