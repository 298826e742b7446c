"""An organ under a hook's pull, without a bed, as a file."""

import math
from collections.abc import Iterable, Iterator
from dataclasses import KW_ONLY, dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Literal

import numpy as np

from app.export.motion import RECOIL_STEP, RUN_STEP, Motion, MotionKey, check_frames, recoil_times
from app.export.organ_export import ExportResult, OrganExport
from app.export.snapshot import Snapshot
from app.export.table import axis_table, curve_table
from app.simulation import (
    PIECES,
    SETTLED_SECONDS,
    Phase,
    Reading,
    Stresses,
    SurfaceStress,
    tear_front,
    tear_swing,
)
from organ_geometry.mesh import Surface, TornPiece, organ_skin
from physics import (
    BreakEvent,
    Theory,
    break_of,
    check_rupture,
    critical_stations,
    theory_words,
)

Table = Literal["curve", "axis"]

PAGE_KEYS = 41
"""Keys of a pull in a page: twenty a second."""
# s, length of a prescribed pull.
PULL_SECONDS = 2.0
# Stations along the span at which stress is sampled: two for each driving point.
STRESS_STATIONS = 121


@dataclass(frozen=True)
class PullExport(OrganExport):
    """An organ under a pull by a theory's beam, to be written as a file."""

    grasp: float  # mm from the first clamp
    _: KW_ONLY
    # N; None: a static mesh is at rest, motions and curves go to the break
    force: float | None = None
    torn: bool = False  # a static mesh shows the two pieces after the tear
    frames: int = 60  # keys of a pull, files of a series, rows of a curve
    table: Table = "curve"  # what a CSV lists
    seed: int = 1  # of the torn rim's raggedness

    @property
    def theory(self) -> Theory:
        """The theory that solves it."""
        return self.specimen.solved_by

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
            return self._borne_force()
        if self.break_event is None:
            raise ValueError(
                f"preset {self.dissection.preset.name} does not break; say with --force how far "
                f"to pull, N"
            )
        return self.break_event.force

    def pull(self, frames: int | None = None) -> Motion:
        """Return the motion from rest to the last force, in equilibrium all the way."""
        return Motion.of("pull", self._pull_keys(self.last_force(), frames))

    def tear(self, frames: int | None = None, *, run_step: float = RUN_STEP) -> Motion | None:
        """Return the motion from rest over the break until both pieces are at rest."""
        event, dissection = self.break_event, self.dissection
        if event is None:
            return None
        keys = self._pull_keys(event.force, frames)
        broken = self.theory.pull(dissection.beam, self.grasp).to_force(event.force)
        at_break, last = broken.sample(dissection.beam_stations), keys[-1]
        # The hook stays where it tore the duct, and what it read is the break's.
        tearing = replace(last.reading, phase=Phase.TEARING, holding=(False,))
        parted = replace(tearing, phase=Phase.TORN, force=0.0, deflection=0.0)
        for elapsed in recoil_times(run_step).tolist():
            transforms = dissection.rest_transforms()
            dissection.move(at_break, transforms, fraction=tear_swing(elapsed))
            front = tear_front(elapsed)
            reading = tearing if front < 1.0 else parted
            keys.append(MotionKey(last.time + elapsed, transforms, reading, front))
        return Motion.of("tear", keys)

    def _pull_keys(self, force: float, frames: int | None) -> list[MotionKey]:
        count = self.frames if frames is None else frames
        check_frames(count)
        dissection, grasp = self.dissection, self.grasp
        pull = self.theory.pull(dissection.beam, grasp)
        driven, critical = dissection.beam_stations, critical_stations(dissection.beam, grasp)
        stations = np.concatenate([driven, critical])
        held = driven.size + int(np.searchsorted(critical, grasp))
        x, y, z = dissection.in_frame(dissection.axis_point(grasp)).tolist()
        times = np.linspace(0.0, PULL_SECONDS, count).tolist()
        keys: list[MotionKey] = []
        for time, at in zip(times, np.linspace(0.0, force, count).tolist(), strict=True):
            pulled = pull.to_force(at).sample(stations)
            transforms = dissection.rest_transforms()
            if keys:  # the first stays the identity to the bit
                dissection.move(pulled.subset(slice(None, driven.size)), transforms)
            lifted = pulled.deflection
            reading = Reading.of_one(
                check_rupture(pulled.subset(slice(driven.size, None)), self.threshold),
                force=pulled.force,
                deflection=lifted,
                deepest=lifted,
                hook=(x + float(pulled.along[held]) - grasp, y, z + lifted),
                breaks_at=self.break_event,
            )
            keys.append(MotionKey(time, transforms, reading))
        return keys

    def motions(self) -> list[Motion]:
        """Return `pull` to the last force, and `tear` where the organ can break."""
        tear = self.tear()
        return [self.pull()] if tear is None else [self.pull(), tear]

    def pieces(self, edge_length: float) -> tuple[TornPiece, TornPiece] | None:
        """Return the two pieces that the organ tears into, or None."""
        if self.break_event is None:
            return None
        return self.dissection.torn_at(
            self.break_event.check, edge_length=edge_length, seed=self.seed
        )

    def page_motion(self) -> Motion:
        """Return the motion over the break, or to a force that was given."""
        tear = self.tear(PAGE_KEYS, run_step=RECOIL_STEP) if self.force is None else None
        return self.pull(PAGE_KEYS) if tear is None else tear

    def snapshot(self) -> Snapshot:
        """Return the organ under the force, or its two pieces."""
        return self._torn_snapshot() if self.torn else next(self._under([self._borne_force()]))

    def snapshots(self) -> Iterator[tuple[float, Snapshot]]:
        """Yield the organ under forces from none to the last, N."""
        for snapshot in self._under(np.linspace(0.0, self.last_force(), self.frames).tolist()):
            yield snapshot.force, snapshot

    def _under(self, forces: Iterable[float]) -> Iterator[Snapshot]:
        """Yield the organ under one force, N, after the other, with its stresses."""
        dissection = self.dissection
        pull = self.theory.pull(dissection.beam, self.grasp)
        skin = organ_skin(dissection.organ, edge_length=self.edge_length)
        bound, stress = skin.bound_to(dissection.driving), SurfaceStress(dissection, skin)
        driven = dissection.beam_stations
        loaded = critical_stations(dissection.beam, self.grasp, STRESS_STATIONS)
        for force in forces:
            pulled = pull.to_force(force).sample(np.concatenate([driven, loaded]))
            transforms = dissection.rest_transforms()
            dissection.move(pulled.subset(slice(None, driven.size)), transforms)
            vertices = bound.deform(transforms, np.empty_like(skin.vertices))
            stresses = stress.at(pulled.subset(slice(driven.size, None)), self.threshold)
            surface = Surface("organ", skin, vertices)
            yield Snapshot((surface,), (stresses,), pulled.force, pulled.deflection)

    def _torn_snapshot(self) -> Snapshot:
        """Return the two unstressed pieces of the torn organ, and the force at the break."""
        event, preset = self.break_event, self.dissection.preset.name
        pieces = self.pieces(self.edge_length)
        if event is None or pieces is None:
            raise ValueError(f"preset {preset} does not break; leave out --torn")
        if self.force is not None and self._finite_force() < event.force:
            raise ValueError(
                f"force of {self.force:g} N does not tear {preset}, it breaks at "
                f"{event.force:.4g} N; give that or more, or no force"
            )
        gone = tear_front(SETTLED_SECONDS)
        surfaces = tuple(
            Surface(name, piece.skin, piece.open(gone, piece.skin.vertices.copy()))
            for name, piece in zip(PIECES, pieces, strict=True)
        )
        stresses = tuple(Stresses.none(len(surface.vertices)) for surface in surfaces)
        return Snapshot(surfaces, stresses, event.force, 0.0)

    def _finite_force(self) -> float:
        """Return the force that was asked for, 0 where none was; raise if it is not a number."""
        force = self.force or 0.0
        if not math.isfinite(force):
            raise ValueError(f"force must be a finite number of N, got {force}")
        return force

    def _borne_force(self) -> float:
        """Return the force that was asked for; raise if it is past the break."""
        force, event = self._finite_force(), self.break_event
        if event is not None and abs(force) > event.force:
            raise ValueError(
                f"force of {force:g} N is past the break of {self.dissection.preset.name} at "
                f"{event.force:.4g} N; give less, or --torn for the two pieces"
            )
        return force

    def written_table(self) -> tuple[bytes, ExportResult]:
        """Return the force-deflection curve, or the axis under the force."""
        if self.table == "axis":
            force = self._borne_force()
            pull = self.theory.pull(self.dissection.beam, self.grasp).to_force(force)
            content = axis_table(self.dissection, pull, self.threshold)
            return content, ExportResult("the axis", force, pull.deflection)
        motion = self.pull()
        last = motion.readings[-1]
        kind = "the force-deflection curve"
        return curve_table(motion), ExportResult(kind, last.force, last.deflection)

    @property
    def note(self) -> str:
        """Where the organ is pulled, as what beam, and at which force it breaks."""
        event = self.break_event
        broke = "" if event is None else f", breaks at {event.force:.3g} N"
        return f", pulled {self.grasp:.1f} mm from the first, {self.theory.name} beam{broke}"

    def facts(self) -> dict[str, object]:
        """Return the theory with its options, and the force at break."""
        event = self.break_event
        return {
            "breaks_at_N": None if event is None else event.force,
            "theory": self.theory.name,
            **self.theory.options,
        }

    def summary(self, force: float | None) -> str:
        """Return the theory and the force at the end, by default a motion's."""
        force = self.last_force() if force is None else force
        if not force:
            return "at rest"
        pulled = "torn at" if self.torn else "pulled with"
        return f"theory {theory_words(self.theory)}; {pulled} {force:.4g} N"
