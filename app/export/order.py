"""An order: which organ under which pull is wanted as a file, and in what kind of file."""

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Literal

import numpy as np

from app.export.delivery import Delivery
from app.export.motion import RUN_STEP, Motion, check_frames, pull_motion, tear_motion
from app.export.rigged_organ import ORGAN, rigged_organ
from app.export.snapshot import PulledOrgan, Snapshot, borne_force, torn_snapshot
from app.export.table import axis_table, curve_table
from app.export.vtk_series import check_series_path, snapshot_content, write_series
from app.simulation import PIECES, Dissection
from organ_geometry import check_target, write_atomic
from organ_geometry.mesh import COLORED_SUFFIXES, TornPiece, mesh_content, organ_skin, stress_colors
from organ_geometry.mesh import SUFFIXES as MESH_SUFFIXES
from physics import BreakEvent, Theory, break_of

__all__ = ["SUFFIXES", "Order"]

SUFFIXES = (*MESH_SUFFIXES, ".vtp", ".pvd", ".csv")
"""Suffixes of the files that can be written."""

Table = Literal["curve", "axis"]


@dataclass(frozen=True)
class Order:
    """An organ under a pull, to be written as a file."""

    dissection: Dissection
    theory: Theory
    grasp: float  # mm from the first clamp
    # N; None: a static mesh is at rest, motions and curves go to the break
    force: float | None = None
    torn: bool = False  # a static mesh shows the two pieces after the tear
    still: bool = False  # write a GLB without motion
    painted: bool = False  # colour vertices by stress
    frames: int = 60  # keys of a pull, files of a series, rows of a curve
    edge_length: float = 0.5  # wanted, of the triangles, mm
    table: Table = "curve"  # what a CSV lists
    threshold: float | None = None  # MPa; None: the preset's
    seed: int = 1  # of the torn rim's raggedness

    @cached_property
    def strength(self) -> float:
        """The threshold in use, MPa."""
        if self.threshold is not None:
            return self.threshold
        return self.dissection.preset.threshold(self.theory, self.dissection.beam)

    @cached_property
    def break_event(self) -> BreakEvent | None:
        """The load at which the organ breaks; None if it does not."""
        return break_of(self.theory.pull(self.dissection.beam, self.grasp), self.strength)

    def check(self, path: Path) -> None:
        """Raise if the order cannot be written to this path, before any long work."""
        self._check_kind(path)
        if path.suffix.lower() == ".pvd":
            check_series_path(path)
        else:
            check_target(path)

    def _check_kind(self, path: Path) -> None:
        suffix = path.suffix.lower()
        if suffix not in SUFFIXES:
            raise ValueError(
                f"cannot write {path}: its name must end in the kind of file, one of "
                f"{', '.join(SUFFIXES)}"
            )
        check_frames(self.frames)
        if self.force is not None and self.force < 0.0:
            raise ValueError(f"the hook pulls and does not push: no force of {self.force:g} N")
        if self.painted and suffix not in COLORED_SUFFIXES:
            raise ValueError(
                f"cannot write {path}: {suffix} keeps no colours of stress; take one of "
                f"{', '.join(COLORED_SUFFIXES)}"
            )
        if self.torn and suffix in (".pvd", ".csv"):
            raise ValueError(
                f"cannot write {path}: {suffix} goes up to the break; leave out --torn"
            )

    def write(self, path: Path) -> Delivery:
        """Write the order to a file, whole or not at all."""
        self.check(path)
        suffix = path.suffix.lower()
        if suffix == ".pvd":
            return self._write_series(path)
        content, delivery = self._made(suffix)
        write_atomic(path, content)
        return replace(delivery, files=(path,))

    def content(self, suffix: str) -> bytes:
        """Return what a file of the order would hold."""
        self._check_kind(Path(f"organ{suffix}"))
        if suffix.lower() == ".pvd":
            raise ValueError("a .pvd is a series of files; write it to a folder")
        return self._made(suffix.lower())[0]

    def _made(self, suffix: str) -> tuple[bytes, Delivery]:
        """Return a file's content and its description, without a path."""
        if suffix == ".csv":
            return self._table()
        if suffix == ".glb" and not (self.still or self.torn or self.painted):
            return self._rigged()
        return self._still(suffix)

    def last_force(self) -> float:
        """Return the force that a motion, a series or a curve goes to."""
        if self.force is not None:
            return borne_force(self.dissection, self.break_event, self.force)
        if self.break_event is None:
            raise ValueError(
                f"preset {self.dissection.preset.name} does not break; say with --force how far "
                f"to pull, N"
            )
        return self.break_event.force

    def pull(self, frames: int | None = None) -> Motion:
        """Return the motion from rest to the last force."""
        return pull_motion(
            self.dissection,
            self.theory,
            grasp=self.grasp,
            force=self.last_force(),
            frames=self.frames if frames is None else frames,
            threshold=self.strength,
            breaks_at=self.break_event,
        )

    def tear(self, frames: int | None = None, *, run_step: float = RUN_STEP) -> Motion | None:
        """Return the motion from rest over the break until both pieces are at rest."""
        if self.break_event is None:
            return None
        return tear_motion(
            self.dissection,
            self.theory,
            grasp=self.grasp,
            event=self.break_event,
            frames=self.frames if frames is None else frames,
            threshold=self.strength,
            run_step=run_step,
        )

    def motions(self) -> list[Motion]:
        """Return `pull` to the last force, and `tear` where the organ can break."""
        tear = self.tear()
        return [self.pull()] if tear is None else [self.pull(), tear]

    def _snapshot(self) -> Snapshot:
        if self.torn:
            return torn_snapshot(
                self.dissection,
                self.break_event,
                force=self.force,
                edge_length=self.edge_length,
                seed=self.seed,
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

    def pieces(self) -> tuple[TornPiece, TornPiece] | None:
        """Return the two pieces that the organ tears into, or None."""
        if self.break_event is None:
            return None
        return self.dissection.torn_at(
            self.break_event.check, edge_length=self.edge_length, seed=self.seed
        )

    def _still(self, suffix: str) -> tuple[bytes, Delivery]:
        snapshot = self._snapshot()
        if suffix == ".vtp":
            content = snapshot_content(snapshot)
        else:
            shown = snapshot.stresses if self.painted else ()
            colors = [stress_colors(stress.distance_to_break) for stress in shown]
            content = mesh_content(snapshot.surfaces, suffix, colors)
        kind = "two closed pieces" if self.torn else "one closed surface"
        return content, Delivery.of(kind, snapshot)

    def _write_series(self, path: Path) -> Delivery:
        pulled = self._pulled()
        shown: deque[Snapshot] = deque(maxlen=1)  # the last one, when all are written

        def snapshots() -> Iterator[Snapshot]:
            for force in np.linspace(0.0, self.last_force(), self.frames).tolist():
                shown.append(pulled.under(force))
                yield shown[-1]

        files = write_series(snapshots(), path)
        return Delivery.of(f"a series of {self.frames} closed surfaces", shown[-1], tuple(files))

    def _table(self) -> tuple[bytes, Delivery]:
        if self.table == "axis":
            force = borne_force(self.dissection, self.break_event, self.force or 0.0)
            pull = self.theory.pull(self.dissection.beam, self.grasp).to_force(force)
            content = axis_table(self.dissection, pull, self.strength)
            return content, Delivery("the axis", (), (), 0, 0, force, pull.deflection)
        motion = self.pull()
        last = motion.readings[-1]
        kind = "the force-deflection curve"
        return curve_table(motion), Delivery(kind, (), (), 0, 0, last.force, last.deflection)

    def _rigged(self) -> tuple[bytes, Delivery]:
        organ = self.dissection.organ
        skin = organ_skin(organ, edge_length=self.edge_length)
        motions, pieces = self.motions(), self.pieces()
        content = rigged_organ(
            skin, self.dissection.driving, motions, pieces, radius=organ.mean_radius
        )
        names = tuple(motion.name for motion in motions)
        pulled = motions[0].readings[-1]
        return content, Delivery(
            f"a rigged surface that can {' and '.join(names)}",
            (),
            (ORGAN,) if pieces is None else (ORGAN, *PIECES),
            len(skin.vertices),
            len(skin.faces),
            pulled.force,
            pulled.deflection,
            names,
        )
