"""A dissection session: one trainee's duct in its bed, two hands at it, stepped in time.

The same action has one name from the page down: `choose_instrument`, `grab`, `move_hand`,
`release`, `open_jaws`. An input is clamped to its range here, set on the duct, and acts with the
next tick. Places are mm in the duct's frame (`app.simulation.bed.hand`).
"""

import copy
import math
from collections.abc import Sequence
from dataclasses import replace
from threading import RLock

import numpy as np
from numpy.typing import NDArray

from app.simulation.bed.bedded_duct import HANDS, BeddedDuct, BedReading, Touch
from app.simulation.bed.exercise import BedExercise
from app.simulation.bed.exercise_limits import bed_exercises
from app.simulation.bed.hand import INSTRUMENTS, Instrument
from app.simulation.bed.measures import DissectionMeasures
from app.simulation.bed.run import DissectionRun
from app.simulation.bed.run_log import DissectionFile
from app.simulation.bed_preset import BedPreset, bed_named
from app.simulation.clock import TICK_SECONDS
from app.simulation.dissection import default_preset
from app.simulation.drawn_duct import DrawnDuct
from app.simulation.exercise import Feedback
from app.simulation.preset import Preset
from app.simulation.run_log import OrganIdentity
from app.simulation.session import VERTICES
from app.simulation.specimen import Specimen
from app.simulation.tear import SETTLED_SECONDS, tear_front, tear_swing
from organ_geometry import Organ
from physics.bed import BeamOnBed

__all__ = ["BedSession"]

REACH = 60.0
"""mm beyond the duct's ends and to its sides that a hand can reach."""


class BedSession:
    """One duct in its bed, stepped in time. Safe to call from several threads.

    Inputs come from a browser: out of range they are clamped, and those that are not numbers are
    ignored. To the bit, the course of a session is a function of its inputs and of the ticks at
    which they come. `seed` chooses the raggedness of a torn rim, `bed_seed` the bed's scatter;
    `by_touch` is that of a run's start.
    A run starts with the first hold or instrument and is over with the tear or its exercise.
    `duct`, `drawn` and `run` are public for reading; `duct` is another object after a choice of
    organ, preset or bed, `run` after a reset as well.
    """

    def __init__(
        self,
        organ: Organ,
        preset: Preset | None = None,
        bed: BedPreset | None = None,
        *,
        bed_seed: int = 1,
        threshold: float | None = None,
        vertices: int = VERTICES,
        seed: int = 1,
        by_touch: bool = True,
    ) -> None:
        self._lock = RLock()
        self.seed, self._by_touch = seed, by_touch
        self.drawn = DrawnDuct(organ, vertices, seed)
        self._organ = organ
        self._torn_ticks, self._when_torn = 0, np.empty((0, 3, 4))
        self._start(
            preset or default_preset(organ), bed or bed_named("normal"), bed_seed, threshold
        )

    # What the trainee does.

    def choose_instrument(self, hand: int, instrument: Instrument) -> None:
        """Give a hand another instrument; what it held it lets go."""
        # An exercise that waits or goes on may allow only some.
        with self._lock:
            wanted = None if self.run.over else self.run.exercise
            allowed = INSTRUMENTS if wanted is None else wanted.instruments
            if 0 <= hand < HANDS and instrument in allowed:
                self._begin_run()
                self.duct.choose_instrument(hand, instrument)
                self.run.note(hand, "instrument", INSTRUMENTS.index(instrument))

    def grab(self, hand: int, station: float) -> NDArray[np.float64] | None:
        """Take hold at a station, mm from the first clamp; return the place, or None."""
        # None where a hand cannot hold: at a clamp, on the other hand's hook, once the duct is
        # torn, and with an instrument that does not hold.
        with self._lock:
            if not (0 <= hand < HANDS and np.isfinite(station)):
                return None
            at = min(max(float(station), 0.0), self._span)
            held = self.duct.hands[hand].node is not None
            place = self.duct.grab(hand, at)
            if place is not None and self._begin_run():
                place = self.duct.grab(hand, at)
            if held or place is not None:
                self.run.note(hand, "grab", at)
            return place

    def move_hand(self, hand: int, place: NDArray[np.float64]) -> None:
        """Lead a hand's tip to a place, (3,) mm."""
        with self._lock:
            wanted = np.asarray(place, dtype=np.float64)
            if not (0 <= hand < HANDS and wanted.shape == (3,)):
                return
            x, y, z = wanted.tolist()
            if not all(map(math.isfinite, (x, y, z))):
                return
            x = min(max(x, -REACH), self._span + REACH)
            y, z = min(max(y, -REACH), REACH), min(max(z, -REACH), REACH)
            if [x, y, z] != self.duct.hands[hand].target.tolist():
                self.duct.move_hand(hand, np.array([x, y, z]))
                self.run.note(hand, "move", x, y, z)

    def release(self, hand: int) -> None:
        """Let go of the duct."""
        with self._lock:
            if 0 <= hand < HANDS and self.duct.release(hand):
                self.run.note(hand, "let-go")

    def open_jaws(self, hand: int, opening: float) -> None:
        """Open or close a dissector, mm between its jaws; no other instrument opens."""
        with self._lock:
            if not (0 <= hand < HANDS and np.isfinite(opening)):
                return
            holder = self.duct.hands[hand]
            if holder.instrument != "dissector":
                return
            before = holder.target_opening
            self.duct.open_jaws(hand, float(opening))
            if holder.target_opening != before:
                self.run.note(hand, "jaws", holder.target_opening)

    def reset(self) -> None:
        """Make the duct and its bed whole; the next input starts a run without an exercise."""
        with self._lock:
            self.run = DissectionRun()
            self._renew()

    def choose_bed(self, bed: BedPreset | str, seed: int = 1) -> None:
        """Start anew in another bed."""
        chosen = bed_named(bed) if isinstance(bed, str) else bed
        with self._lock:
            self._start(self.duct.dissection.preset, chosen, seed)

    def choose_preset(self, preset: Preset) -> None:
        """Start anew with another duct in the same bed."""
        with self._lock:
            self._start(preset, self.duct.bed, self.duct.seed)

    # Time and readings.

    def advance(self, ticks: int = 1) -> bool:
        """Advance by some ticks and draw; return whether anything has moved."""
        with self._lock:
            duct, changed = self.duct, False
            for _ in range(ticks):
                whole = duct.torn is None
                moved = duct.advance()
                changed |= moved
                self.run.take(moved=moved)
                if duct.torn is not None:
                    if whole:
                        self._when_torn = self.drawn.transforms.copy()
                        self.drawn.show_pieces(duct.torn)
                    if self._torn_ticks * TICK_SECONDS < SETTLED_SECONDS:
                        self._torn_ticks += 1
                        changed = True
            if changed:
                self._draw()
            return changed

    def reading(self) -> BedReading:
        """Return what the instruments show now."""
        with self._lock:
            return self.duct.reading()

    def beam_touched_by(self, hand: int) -> tuple[BeamOnBed, Touch]:
        """Return a copy of the beam on its bed, and what a hand does to it."""
        with self._lock:
            return copy.deepcopy(self.duct.beam), self.duct.touch(hand)

    def touch(self, hand: int) -> Touch:
        """Return what a hand does to the beam now."""
        with self._lock:
            return self.duct.touch(hand)

    def stress(self, out: NDArray[np.float32], surface: int = 0) -> NDArray[np.float32]:
        """Write the stress along the organ at each vertex of a drawn surface, MPa."""
        with self._lock:
            duct = self.duct
            at = duct.beam.stations / duct.surface.scale
            return self.drawn.write_bed_stress(at, duct.beam.stresses(), out, surface)

    # Exercises and runs.

    def exercises_offered(self) -> tuple[BedExercise, ...]:
        """Return the exercises for this duct: a second's work the first time."""
        duct = self.duct
        return bed_exercises(replace(duct.specimen, threshold_MPa=duct.threshold))

    def start_exercise(
        self, exercise: BedExercise, feedback: Feedback = Feedback.CONTINUOUS
    ) -> None:
        """Start anew with an exercise, in its bed; its time runs from the first input."""
        with self._lock:
            bed = bed_named(exercise.bed) if isinstance(exercise.bed, str) else exercise.bed
            duct = self.duct
            if (duct.bed, duct.seed) != (bed, exercise.bed_seed):
                self._start(duct.dissection.preset, bed, exercise.bed_seed, duct.threshold)
            self.run = DissectionRun(exercise, feedback)
            self._renew()

    def finish(self) -> None:
        """End the run as it stands; the duct stays as it is."""
        with self._lock:
            self.run.finish()

    def measures(self) -> DissectionMeasures:
        """Return the measures of this run so far."""
        with self._lock:
            return self.run.measures()

    def run_file(self) -> DissectionFile:
        """Return this run so far, to keep, download and replay."""
        with self._lock:
            log = self.run.log(OrganIdentity.of(self._organ), self.seed)
            return DissectionFile.of(log, self.run.measures(), self.run.outcome)

    def _begin_run(self) -> bool:
        """Start the run with the first input, on a duct that nothing has touched."""
        if self.run.started or self.run.over:
            return False
        hands = self.duct.hands
        self._renew()
        for hand, (before, after) in enumerate(zip(hands, self.duct.hands, strict=True)):
            self.duct.put_hand(hand, before.place)
            after.target[:] = before.target
        self.run.start(self.duct, by_touch=self._by_touch)
        for hand, holder in enumerate(self.duct.hands):
            if not holder.arrived:
                self.run.note(hand, "move", *holder.target.tolist())
        return True

    def put_hands(self, tips: Sequence[Sequence[float]]) -> None:
        """Put the hands' tips somewhere at once, (HANDS, 3) mm, before a run begins."""
        with self._lock:
            for hand, tip in enumerate(tips):
                self.duct.put_hand(hand, np.array(tip))

    def _renew(self) -> None:
        """Make the duct and its bed whole, but for what the exercise has opened."""
        torn = self.duct.torn is not None
        exercise = self.run.exercise
        if exercise is None:
            self.duct.reset()
        else:
            self.duct.reset(exercise.opened_mm, divided=exercise.divided)
        self._torn_ticks = 0
        if torn:
            self.drawn.show_whole()
        self._draw()

    @property
    def _span(self) -> float:
        return self.duct.dissection.beam.span

    def _start(
        self, preset: Preset, bed: BedPreset, bed_seed: int, threshold: float | None = None
    ) -> None:
        self.duct = BeddedDuct(
            Specimen(preset, self._organ, bed, bed_seed=bed_seed, threshold_MPa=threshold)
        )
        self.run = DissectionRun()
        self._torn_ticks = 0
        self.drawn.follow(self.duct.dissection)

    def _draw(self) -> None:
        if self.duct.torn is None:
            self.drawn.draw_moved(self.duct.move)
            return
        # The beam is in its new equilibrium at once; the pieces are drawn swinging to it.
        elapsed = self._torn_ticks * TICK_SECONDS
        swing = tear_swing(elapsed)

        def move(out: NDArray[np.float64], piece: int | None) -> None:
            self.duct.move(out, piece)
            out += swing * (self._when_torn - out)

        self.drawn.draw_moved(move)
        self.drawn.open_tear(tear_front(elapsed))
