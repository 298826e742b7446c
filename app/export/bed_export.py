"""A duct that a hook frees from its bed, as a file."""

from collections.abc import Iterable, Iterator
from dataclasses import KW_ONLY, dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from app.export.bed_recorder import BedRecorder
from app.export.motion import MOST_FRAMES, Motion
from app.export.organ_export import ExportResult, OrganExport
from app.export.snapshot import Snapshot, bed_snapshots
from app.simulation import SETTLED_SECONDS, BedPreset, Phase, Reading, SurfaceMapping
from organ_geometry.mesh import TornPiece
from physics import RuptureCheck
from physics.bed import BeamOnBed, Hand, History, pull, step_places

# Facts of the last step, as `solve --bed` names them.
BED_FACTS = ("freed_mm", "strands_broken", "work_mJ", "distance_to_break_percent")
# Name of the motion.
FREE = "free"
HAND_SPEED = 3.0
"""mm/s at which the motion is played; it is quasi-static, and the same at any."""
SHORTEST = 1.0
"""s, of a motion along a short path."""
# s, of the beam in real time.
SUBSTEP = 1.0 / 240.0


@dataclass(frozen=True)
class BedExport(OrganExport):
    """A duct in its bed, pulled by a hook along a path, to be written as a file."""

    hook: float  # mm from the first clamp
    path: tuple[tuple[float, float, float], ...]  # displacements of the hook, mm (`Hand`)
    _: KW_ONLY
    steps: int = 60  # along the path; one key after each
    elements: int = 80  # of the beam
    strands: int | None = None  # the bed's own number when None

    def check_kind(self, path: Path) -> None:
        """Raise if this cannot be written as a file of that name."""
        super().check_kind(path)
        if not 1 <= self.steps < MOST_FRAMES:
            raise ValueError(f"steps must be 1 to {MOST_FRAMES - 1:,}, got {self.steps:,}")

    @cached_property
    def dissected(self) -> tuple[Motion, History]:
        """The motion along the path, or up to where the duct tears on it, and its history."""
        dissection, threshold = self.dissection, self.threshold
        rest = self.specimen.space_beam(elements=self.elements, nodes_at=[self.hook])
        bed = self.specimen.layer(rest, self.strands)
        assert bed is not None  # noqa: S101 (a specimen in a bed)
        hand = Hand(at=self.hook, path=self.path, steps=self.steps)
        displaced = np.vstack([np.zeros(3), step_places(hand.path, hand.steps, "a hand's path")])
        surface = SurfaceMapping(dissection, rest, bed.strands_under(rest))
        recorder = BedRecorder(dissection, surface)
        node = int(np.argmin(np.abs(rest.stations - self.hook)))
        axis = dissection.in_frame(dissection.axis_point(self.hook))
        seconds = np.sqrt((np.diff(displaced, axis=0) ** 2).sum(axis=1)).sum() / HAND_SPEED
        times = np.linspace(0.0, max(SHORTEST, float(seconds)), self.steps + 1).tolist()
        deepest = [0.0]
        torn: BeamOnBed | None = None

        def watch(beam: BeamOnBed) -> bool:
            nonlocal torn
            step = len(deepest) - 1
            check = surface.check(beam, threshold)
            deflection = float(np.sqrt(displaced[step] @ displaced[step]))
            deepest.append(max(deepest[-1], deflection))
            force = beam.hand_force(node) if step else np.zeros(3)
            place = axis + displaced[step]
            reading = Reading.of_one(
                check,
                force=float(np.sqrt(force @ force)),
                deflection=deflection,
                deepest=deepest[-1],
                hook=(float(place[0]), float(place[1]), float(place[2])),
            )
            recorder.add(times[step], beam, reading)
            torn = beam if check.broken else None
            return check.broken

        history = pull(rest, bed, [hand], watch=watch)
        if torn is not None:
            check = surface.check(torn, threshold)
            element = torn.tear(torn.worst_stress().station)
            torn.let_go(node)
            # In real time as in the trainer, whose drag keeps the fall of the pieces steady.
            torn.tick(SETTLED_SECONDS, ticks=round(SETTLED_SECONDS / SUBSTEP))
            recorder.add_tear(torn, element, check)
        return recorder.motion(FREE), history

    @property
    def motion(self) -> Motion:
        """The motion along the path."""
        return self.dissected[0]

    @property
    def tear(self) -> RuptureCheck | None:
        """Where the duct tears on the path, and under which stresses."""
        last = self.motion.readings[-1]
        return None if last.phase is Phase.INTACT else last.check

    def pieces(self, edge_length: float) -> tuple[TornPiece, TornPiece] | None:
        """Return the two pieces that the duct tears into on the path."""
        if self.tear is None:
            return None
        return self.dissection.torn_at(self.tear, edge_length=edge_length)

    def page_motion(self) -> Motion:
        """Return the motion along the path."""
        return self.motion

    def motions(self) -> list[Motion]:
        """Return the motion along the path."""
        return [self.motion]

    def snapshot(self) -> Snapshot:
        """Return the duct at the end of the path, or its two pieces."""
        return next(self._at([len(self.motion.times) - 1]))

    def snapshots(self) -> Iterator[tuple[float, Snapshot]]:
        """Yield the duct at rest and after each step, with the time in the motion, s."""
        motion = self.motion
        # The tear that has not begun to run is the whole organ.
        keys = np.flatnonzero(motion.fronts != 0.0).tolist()
        yield from zip(motion.times[keys].tolist(), self._at(keys), strict=True)

    def _at(self, keys: Iterable[int]) -> Iterator[Snapshot]:
        return bed_snapshots(
            self.dissection,
            self.motion,
            self.pieces(self.edge_length),
            keys,
            edge_length=self.edge_length,
        )

    def written_table(self) -> tuple[bytes, ExportResult]:
        """Return the history of the path, as `solve --bed -o` writes it."""
        motion, history = self.dissected
        last = motion.readings[-1]
        content = history.csv(self.threshold).encode()
        return content, ExportResult("the history of the path", last.force, last.deflection)

    @property
    def _bed(self) -> BedPreset:
        bed = self.specimen.bed
        assert bed is not None  # noqa: S101 (a specimen in a bed)
        return bed

    @property
    def note(self) -> str:
        """Which bed the hook frees the duct from, where, and where it tears."""
        note = (
            f" in a bed, {self._bed.title.lower()}; a hook frees it {self.hook:.1f} mm from the "
            "first"
        )
        return note if self.tear is None else f"{note}, and tears it at {self.tear.station:.1f} mm"

    def facts(self) -> dict[str, object]:
        """Return the bed, the hook, and what the last step came to."""
        last = self.dissected[1].rows(self.threshold)[-1]
        return {
            "bed": self._bed.name,
            "seed": self.specimen.bed_seed,
            "hook_mm": self.hook,
            "torn_at_mm": None if self.tear is None else self.tear.station,
            **{name: last[name] for name in BED_FACTS},
        }

    def summary(self, force: float | None) -> str:
        """Return what is free at the end of the path, or where it tore."""
        facts, tear = self.facts(), self.tear
        ended = "at the end of the path"
        if tear is not None:
            ended = f"torn {tear.station:.4g} mm from the first clamp:"
        return (
            f"bed {self._bed.name}, {ended} {facts['freed_mm']:.4g} mm are free, "
            f"{facts['strands_broken']} strands broken, distance to break "
            f"{facts['distance_to_break_percent']:.4g} %"
        )
