"""A duct that a hook frees from its bed, as a file."""

from collections.abc import Iterator
from dataclasses import KW_ONLY, dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from app.export.motion import MOST_FRAMES, Motion, MotionKey
from app.export.organ_export import ExportResult, OrganExport
from app.export.snapshot import DissectedOrgan, Snapshot
from app.export.strands import BedRecorder
from app.simulation import Phase, Reading
from app.simulation.bed import BED_THEORY, BeddedSurface, BedPreset, beam_in_space
from physics.bed import BeamOnBed, Hand, History, pull, step_places

__all__ = ["BedExport"]

FREE = "free"
"""Name of the motion."""
HAND_SPEED = 3.0
"""mm/s at which the motion is played; it is quasi-static, and the same at any."""
SHORTEST = 1.0
"""s, of a motion along a short path."""


@dataclass(frozen=True)
class BedExport(OrganExport):
    """A duct in its bed, pulled by a hook along a path, to be written as a file."""

    bed: BedPreset
    hook: float  # mm from the first clamp
    path: tuple[tuple[float, float, float], ...]  # displacements of the hook, mm (`Hand`)
    _: KW_ONLY
    seed: int = 1  # of the bed's scatter
    steps: int = 60  # along the path; one key after each
    elements: int = 80  # of the beam
    strands: int | None = None  # the bed's own number when None

    @property
    def threshold(self) -> float:
        """Stress at which the wall tears, MPa."""
        return self.dissection.preset.threshold(BED_THEORY, self.dissection.beam)

    def check_kind(self, path: Path) -> None:
        """Raise if this cannot be written as a file of that name."""
        super().check_kind(path)
        if not 1 <= self.steps < MOST_FRAMES:
            raise ValueError(f"steps must be 1 to {MOST_FRAMES - 1:,}, got {self.steps:,}")

    @cached_property
    def dissected(self) -> tuple[Motion, History]:
        """The motion along the path, and its history in numbers."""
        dissection, threshold = self.dissection, self.threshold
        rest = beam_in_space(dissection, elements=self.elements, nodes_at=[self.hook])
        bed = self.bed.bed(rest, seed=self.seed, strands=self.strands)
        hand = Hand(at=self.hook, path=self.path, steps=self.steps)
        displaced = np.vstack([np.zeros(3), step_places(hand.path, hand.steps, "a hand's path")])
        surface = BeddedSurface(dissection, rest, bed.strands_under(rest))
        recorder = BedRecorder(surface)
        node = int(np.argmin(np.abs(rest.stations - self.hook)))
        axis = (dissection.axis_point(self.hook) - dissection.axis_point(0.0)) @ dissection.frame
        seconds = np.sqrt((np.diff(displaced, axis=0) ** 2).sum(axis=1)).sum() / HAND_SPEED
        times = np.linspace(0.0, max(SHORTEST, float(seconds)), self.steps + 1).tolist()
        keys: list[MotionKey] = []

        def watch(beam: BeamOnBed) -> None:
            step = len(keys)
            check = recorder.check(beam, threshold)
            if check.broken:
                words = ", ".join(f"{each:.4g}" for each in displaced[step])
                raise ValueError(
                    f"the duct tears {check.station:.4g} mm from the first clamp in step {step} "
                    f"of {self.steps}, its hook moved by {words} mm; give a shorter path"
                )
            recorder.add(beam)
            deflection = float(np.sqrt(displaced[step] @ displaced[step]))
            force = beam.hand_force(node) if step else np.zeros(3)
            place = axis + displaced[step]
            reading = Reading(
                phase=Phase.INTACT,
                force=float(np.sqrt(force @ force)),
                deflection=deflection,
                check=check,
                breaks_at=None,
                deepest=max([deflection, *(key.reading.deepest for key in keys[-1:])]),
                hook=(float(place[0]), float(place[1]), float(place[2])),
                held=True,
            )
            transforms = dissection.rest_transforms()
            if step:  # the first stays the identity to the bit
                surface.move(beam, transforms)
            keys.append(MotionKey(times[step], transforms, reading))

        history = pull(rest, bed, [hand], watch=watch)
        return Motion.of(FREE, keys, recorder.track()), history

    @property
    def motion(self) -> Motion:
        """The motion along the path."""
        return self.dissected[0]

    def motions(self) -> list[Motion]:
        """Return the motion along the path."""
        return [self.motion]

    def snapshot(self) -> Snapshot:
        """Return the duct at the end of the path."""
        return self._organ().at(self.steps)

    def snapshots(self) -> Iterator[tuple[float, Snapshot]]:
        """Yield the duct at rest and after each step, with the time in the motion, s."""
        organ = self._organ()
        for key, time in enumerate(self.motion.times.tolist()):
            yield time, organ.at(key)

    def _organ(self) -> DissectedOrgan:
        return DissectedOrgan(self.dissection, self.motion, edge_length=self.edge_length)

    def written_table(self) -> tuple[bytes, ExportResult]:
        """Return the history of the path, as `solve --bed -o` writes it."""
        motion, history = self.dissected
        last = motion.readings[-1]
        content = history.csv(self.threshold).encode()
        return content, ExportResult("the history of the path", last.force, last.deflection)
