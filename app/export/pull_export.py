"""An organ under a hook's pull, without a bed, as a file."""

from collections.abc import Iterator
from dataclasses import KW_ONLY, dataclass
from functools import cached_property
from pathlib import Path
from typing import Literal

import numpy as np

from app.export.motion import RUN_STEP, Motion, check_frames, pull_motion, tear_motion
from app.export.organ_export import ExportResult, OrganExport
from app.export.snapshot import PulledOrgan, Snapshot, borne_force, torn_snapshot
from app.export.table import axis_table, curve_table
from organ_geometry.mesh import TornPiece
from physics import BreakEvent, Theory, break_of

__all__ = ["PullExport"]

Table = Literal["curve", "axis"]


@dataclass(frozen=True)
class PullExport(OrganExport):
    """An organ under a pull by a theory's beam, to be written as a file."""

    theory: Theory
    grasp: float  # mm from the first clamp
    _: KW_ONLY
    # N; None: a static mesh is at rest, motions and curves go to the break
    force: float | None = None
    torn: bool = False  # a static mesh shows the two pieces after the tear
    frames: int = 60  # keys of a pull, files of a series, rows of a curve
    table: Table = "curve"  # what a CSV lists
    threshold_MPa: float | None = None  # noqa: N815 (units); None: the preset's
    seed: int = 1  # of the torn rim's raggedness

    @cached_property
    def threshold(self) -> float:
        """The threshold in use, MPa."""
        if self.threshold_MPa is not None:
            return self.threshold_MPa
        return self.dissection.preset.threshold(self.theory, self.dissection.beam)

    @cached_property
    def break_event(self) -> BreakEvent | None:
        """The load at which the organ breaks; None if it does not."""
        return break_of(self.theory.pull(self.dissection.beam, self.grasp), self.threshold)

    @property
    def moves(self) -> bool:
        """Whether a GLB of it moves."""
        return super().moves and not self.torn

    def check_kind(self, path: Path) -> None:
        """Raise if this cannot be written as a file of that name."""
        super().check_kind(path)
        check_frames(self.frames)
        if self.force is not None and self.force < 0.0:
            raise ValueError(f"the hook pulls and does not push: no force of {self.force:g} N")
        suffix = path.suffix.lower()
        if self.torn and suffix in (".pvd", ".csv"):
            raise ValueError(
                f"cannot write {path}: {suffix} goes up to the break; leave out --torn"
            )

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
            threshold=self.threshold,
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
            threshold=self.threshold,
            run_step=run_step,
        )

    def motions(self) -> list[Motion]:
        """Return `pull` to the last force, and `tear` where the organ can break."""
        tear = self.tear()
        return [self.pull()] if tear is None else [self.pull(), tear]

    def pieces(self) -> tuple[TornPiece, TornPiece] | None:
        """Return the two pieces that the organ tears into, or None."""
        if self.break_event is None:
            return None
        return self.dissection.torn_at(
            self.break_event.check, edge_length=self.edge_length, seed=self.seed
        )

    def snapshot(self) -> Snapshot:
        """Return the organ under the force, or its two pieces."""
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

    def snapshots(self) -> Iterator[tuple[float, Snapshot]]:
        """Yield the organ under forces from none to the last, N."""
        pulled = self._pulled()
        for force in np.linspace(0.0, self.last_force(), self.frames).tolist():
            snapshot = pulled.under(force)
            yield snapshot.force, snapshot

    def _pulled(self) -> PulledOrgan:
        return PulledOrgan(
            self.dissection,
            self.theory,
            grasp=self.grasp,
            edge_length=self.edge_length,
            threshold=self.threshold,
        )

    def written_table(self) -> tuple[bytes, ExportResult]:
        """Return the force-deflection curve, or the axis under the force."""
        if self.table == "axis":
            force = borne_force(self.dissection, self.break_event, self.force or 0.0)
            pull = self.theory.pull(self.dissection.beam, self.grasp).to_force(force)
            content = axis_table(self.dissection, pull, self.threshold)
            return content, ExportResult("the axis", force, pull.deflection)
        motion = self.pull()
        last = motion.readings[-1]
        kind = "the force-deflection curve"
        return curve_table(motion), ExportResult(kind, last.force, last.deflection)
