"""An order: which organ under which pull is wanted as a file, and in what kind of file."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Literal

import numpy as np

from app.export.motion import Motion, check_frames, pull_motion, tear_motion
from app.export.rigged_organ import ORGAN, rigged_organ
from app.export.stress_color import stress_colors
from app.export.table import axis_table, curve_table
from app.export.vtk_series import check_series_path, snapshot_content, write_series
from app.simulation.dissection import PIECES, Dissection
from app.simulation.snapshot import PulledOrgan, Snapshot, borne_force, torn_snapshot
from organ_geometry.mesh_file import PAINTED_SUFFIXES, ClosedSurface, write_mesh
from organ_geometry.mesh_file import SUFFIXES as MESH_SUFFIXES
from organ_geometry.skin import organ_skin
from organ_geometry.whole_file import check_target, write_whole
from physics import BreakEvent, Theory, break_event

__all__ = ["SUFFIXES", "Delivery", "Order"]

SUFFIXES = (*MESH_SUFFIXES, ".vtp", ".pvd", ".csv")
"""Kinds of file, by suffix."""

Table = Literal["curve", "axis"]


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


@dataclass(frozen=True)
class Order:
    """An organ under a pull, to be written as a file.

    Attributes
    ----------
    dissection
        The organ between its clamps.
    theory
        The theory, as it solves this organ (`Dissection.theory_for`).
    grasp
        Distance of the grasp from the first clamp, mm.
    force
        The grasper's whole force, N. When None, a still mesh is at rest, and what moves or lists
        forces goes to the break.
    torn
        Whether a still mesh shows the two pieces after the tear.
    still
        Whether a GLB shall not move.
    painted
        Whether vertices are coloured by their stress.
    frames
        Keys of a pull, files of a series, rows of a curve.
    edge_length
        Wanted length of the triangles' edges, mm.
    table
        What a CSV lists.
    threshold
        Stress at which the organ tears, MPa; the preset's own when None.
    """

    dissection: Dissection
    theory: Theory
    grasp: float
    force: float | None = None
    torn: bool = False
    still: bool = False
    painted: bool = False
    frames: int = 60
    edge_length: float = 0.5
    table: Table = "curve"
    threshold: float | None = None

    @cached_property
    def strength(self) -> float:
        """Stress at which the organ tears, MPa."""
        if self.threshold is not None:
            return self.threshold
        return self.dissection.preset.threshold(self.theory, self.dissection.beam)

    @cached_property
    def break_event(self) -> BreakEvent | None:
        """The load at which the organ breaks; None if it does not."""
        return break_event(self.theory, self.dissection.beam, self.grasp, self.strength)

    def check(self, path: Path) -> None:
        """Raise if the order cannot be written there: better before long work than after it.

        Parameters
        ----------
        path
            Where to.

        Raises
        ------
        ValueError
            If the suffix is unknown or does not go with the order, there are too few or too many
            frames, or no file can be written there.
        """
        suffix = path.suffix.lower()
        if suffix not in SUFFIXES:
            raise ValueError(
                f"cannot write {path}: its name must end in the kind of file, one of "
                f"{', '.join(SUFFIXES)}"
            )
        check_frames(self.frames)
        if self.painted and suffix not in PAINTED_SUFFIXES:
            raise ValueError(
                f"cannot write {path}: {suffix} keeps no colours of stress; take one of "
                f"{', '.join(PAINTED_SUFFIXES)}"
            )
        if self.torn and suffix in (".pvd", ".csv"):
            raise ValueError(
                f"cannot write {path}: {suffix} goes up to the break; leave out --torn"
            )
        if suffix == ".pvd":
            check_series_path(path)
        else:
            check_target(path)

    def write(self, path: Path) -> Delivery:
        """Write the order to a file, whole or not at all.

        Parameters
        ----------
        path
            The file; its suffix says which kind.

        Returns
        -------
        Delivery
            What was written.

        Raises
        ------
        ValueError
            If the order cannot be carried out, with the reason.
        """
        self.check(path)
        suffix = path.suffix.lower()
        if suffix == ".csv":
            return self._write_table(path)
        if suffix == ".pvd":
            return self._write_series(path)
        if suffix == ".glb" and not (self.still or self.torn or self.painted):
            return self._write_rigged(path)
        return self._write_still(path)

    def last_force(self) -> float:
        """Return the force that a motion, a series or a curve goes to.

        Returns
        -------
        float
            The force that is given, else the one at the break, N.

        Raises
        ------
        ValueError
            If it is past the break, or there is neither.
        """
        if self.force is not None:
            return borne_force(self.dissection, self.break_event, self.force)
        if self.break_event is None:
            raise ValueError(
                f"preset {self.dissection.preset.name} does not break; say with --force how far "
                f"to pull, N"
            )
        return self.break_event.force

    def motions(self) -> list[Motion]:
        """Return the organ's motions.

        Returns
        -------
        list[Motion]
            `pull` to the last force, and `tear` where the organ can break.

        Raises
        ------
        ValueError
            If there is no force to go to, or too few or too many frames.
        """
        dissection, theory, grasp = self.dissection, self.theory, self.grasp
        found = [
            pull_motion(
                dissection, theory, grasp=grasp, force=self.last_force(), frames=self.frames
            )
        ]
        if self.break_event is not None:
            found.append(
                tear_motion(
                    dissection, theory, grasp=grasp, event=self.break_event, frames=self.frames
                )
            )
        return found

    def _snapshot(self) -> Snapshot:
        if self.torn:
            return torn_snapshot(
                self.dissection, self.break_event, force=self.force, edge_length=self.edge_length
            )
        force = borne_force(self.dissection, self.break_event, self.force or 0.0)
        return self._pulled().under(force)

    def _pulled(self) -> PulledOrgan:
        return PulledOrgan(
            self.dissection,
            self.theory,
            grasp=self.grasp,
            edge_length=self.edge_length,
            threshold=self.strength,
        )

    def _write_still(self, path: Path) -> Delivery:
        snapshot = self._snapshot()
        if path.suffix.lower() == ".vtp":
            write_whole(path, snapshot_content(snapshot))
        else:
            parts: dict[str, ClosedSurface] = {}
            for name, surface in snapshot.surfaces.items():
                colors = stress_colors(surface.stress.distance_to_break) if self.painted else None
                parts[name] = ClosedSurface.of(surface.skin, surface.vertices, colors)
            write_mesh(parts, path)
        kind = "two closed pieces" if self.torn else "one closed surface"
        return _delivery(kind, [path], snapshot)

    def _write_series(self, path: Path) -> Delivery:
        forces = np.linspace(0.0, self.last_force(), self.frames)
        pulled = self._pulled()
        files = write_series((pulled.under(force) for force in forces.tolist()), path)
        return _delivery(
            f"a series of {self.frames} closed surfaces", files, pulled.under(float(forces[-1]))
        )

    def _write_table(self, path: Path) -> Delivery:
        if self.table == "axis":
            force = borne_force(self.dissection, self.break_event, self.force or 0.0)
            content = axis_table(
                self.dissection,
                self.theory,
                grasp=self.grasp,
                force=force,
                threshold=self.strength,
            )
        else:
            force = self.last_force()
            content = curve_table(
                self.dissection,
                self.theory,
                grasp=self.grasp,
                force=force,
                frames=self.frames,
                threshold=self.strength,
            )
        write_whole(path, content)
        kind = "the axis" if self.table == "axis" else "the force-deflection curve"
        return Delivery(kind, (path,), (), 0, 0, force, self._deflection(force))

    def _write_rigged(self, path: Path) -> Delivery:
        force = self.last_force()
        organ, event = self.dissection.organ, self.break_event
        skin = organ_skin(organ, edge_length=self.edge_length)
        motions = self.motions()
        pieces = (
            None
            if event is None
            else self.dissection.torn_at(event.check, edge_length=self.edge_length)
        )
        content = rigged_organ(
            skin, self.dissection.driving, motions, pieces, radius=organ.mean_radius
        )
        write_whole(path, content)
        names = tuple(motion.name for motion in motions)
        return Delivery(
            f"a rigged surface that can {' and '.join(names)}",
            (path,),
            (ORGAN,) if pieces is None else (ORGAN, *PIECES),
            len(skin.vertices),
            len(skin.faces),
            force,
            self._deflection(force),
            names,
        )

    def _deflection(self, force: float) -> float:
        return self.theory.under_force(
            self.dissection.beam, self.grasp, force, np.empty(0)
        ).deflection


def _delivery(kind: str, files: list[Path], snapshot: Snapshot) -> Delivery:
    surfaces = snapshot.surfaces
    return Delivery(
        kind,
        tuple(files),
        tuple(surfaces),
        sum(len(surface.vertices) for surface in surfaces.values()),
        sum(len(surface.skin.faces) for surface in surfaces.values()),
        snapshot.force,
        snapshot.deflection,
    )
