"""Snapshots: an organ pulled or torn, as closed surfaces that stand where the organ stands."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.simulation import tear_course
from app.simulation.dissection import PIECES, Dissection
from organ_geometry.skin import organ_skin
from physics import BreakEvent, Theory, break_event

__all__ = ["Snapshot", "pulled_snapshot", "torn_snapshot"]


@dataclass(frozen=True, slots=True, eq=False)
class Snapshot:
    """Closed surfaces of an organ at one moment.

    Attributes
    ----------
    parts
        (V, 3) vertices, mm, and (F, 3) faces, by name: one "organ" or two pieces.
    force
        The grasper's whole force, N; of torn pieces, the one that tore them.
    deflection
        Displacement of the grasp, mm; 0 for torn pieces, which have swung back.
    """

    parts: dict[str, tuple[NDArray[np.float32], NDArray[np.int32]]]
    force: float
    deflection: float


def pulled_snapshot(
    dissection: Dissection,
    theory: Theory,
    *,
    grasp: float,
    force: float | None,
    edge_length: float,
) -> Snapshot:
    """Return an organ under a pull that it bears.

    Parameters
    ----------
    dissection
        The organ between its clamps.
    theory
        The theory that bends it.
    grasp
        Distance of the grasp from the first clamp, mm.
    force
        The grasper's whole force, N; none when None.
    edge_length
        Wanted length of the triangles' edges, mm.

    Returns
    -------
    Snapshot
        The organ, whole.

    Raises
    ------
    ValueError
        If the force is past the break.
    """
    pulled = theory.under_force(
        dissection.beam, grasp, 0.0 if force is None else force, dissection.beam_stations
    )
    event = _event(dissection, theory, grasp)
    if event is not None and abs(pulled.force) > event.force:
        raise ValueError(
            f"force of {pulled.force:g} N is past the break of {dissection.preset.name} at "
            f"{event.force:.4g} N; give less, or --torn for the two pieces"
        )
    skin = organ_skin(dissection.organ, edge_length=edge_length)
    vertices = np.empty_like(skin.vertices)
    transforms = dissection.move(pulled, dissection.rest_transforms())
    skin.bound_to(dissection.driving).deform(transforms, vertices)
    return Snapshot({"organ": (vertices, skin.faces)}, pulled.force, pulled.deflection)


def torn_snapshot(
    dissection: Dissection,
    theory: Theory,
    *,
    grasp: float,
    force: float | None,
    edge_length: float,
) -> Snapshot:
    """Return the two pieces of an organ that has torn and swung back.

    Parameters
    ----------
    dissection
        The organ between its clamps.
    theory
        The theory that says where it tears.
    grasp
        Distance of the grasp from the first clamp, mm.
    force
        A force that tears it, N, or None.
    edge_length
        Wanted length of the triangles' edges, mm.

    Returns
    -------
    Snapshot
        The pieces and the force at the break.

    Raises
    ------
    ValueError
        If the force does not tear it, or none does.
    """
    event = _event(dissection, theory, grasp)
    if event is None:
        raise ValueError(f"preset {dissection.preset.name} does not break; leave out --torn")
    if force is not None and not math.isfinite(force):
        raise ValueError(f"force must be a finite number of N, got {force}")
    if force is not None and force < event.force:
        raise ValueError(
            f"force of {force:g} N does not tear {dissection.preset.name}, it breaks at "
            f"{event.force:.4g} N; give that or more, or no force"
        )
    gone = tear_course.front(tear_course.SETTLED_SECONDS)
    pieces = dissection.torn_at(event.check, edge_length=edge_length)
    parts = {
        name: (piece.open(gone, piece.skin.vertices.copy()), piece.skin.faces)
        for name, piece in zip(PIECES, pieces, strict=True)
    }
    return Snapshot(parts, event.force, 0.0)


def _event(dissection: Dissection, theory: Theory, grasp: float) -> BreakEvent | None:
    """Return the load at which the preset's duct breaks."""
    threshold = dissection.preset.threshold(theory, dissection.beam)
    return break_event(theory, dissection.beam, grasp, threshold)
