"""A dissection session: one trainee's duct in its bed, two hands at it, stepped in time.

The same action has one name from the page down: `choose_instrument`, `grab`, `move_hand`,
`release`, `open_jaws`. An input is clamped to its range here, set on the duct, and acts with the
next tick. Places are mm in the duct's frame (`app.simulation.bed.hand`).
"""

import copy
import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from threading import RLock
from typing import Self

import msgspec
import numpy as np
from numpy.typing import NDArray

from app.simulation.bed.bedded_duct import ELEMENTS, HANDS, SUBSTEPS, BeddedDuct, BedReading, Touch
from app.simulation.bed.exercise import BedTrial
from app.simulation.bed.exercise_limits import bed_exercises
from app.simulation.bed.measures import DissectionMeasures, DissectionMeasureTaker
from app.simulation.bed_preset import BedPreset, bed_named, named_or_whole
from app.simulation.clock import TICK_SECONDS
from app.simulation.dissection import default_preset
from app.simulation.drawn_duct import DrawnDuct
from app.simulation.exercise import BedExercise, Exercise, Feedback
from app.simulation.inputs import INSTRUMENTS, Input, Instrument
from app.simulation.preset import Preset, preset_named
from app.simulation.replay import FEW, Replay
from app.simulation.run import Run
from app.simulation.run_file import (
    OrganIdentity,
    RunFile,
    RunFileError,
    RunLog,
    RunStart,
    strands_digest,
)
from app.simulation.session import VERTICES, Session
from app.simulation.specimen import Specimen
from app.simulation.tear import SETTLED_SECONDS, tear_front, tear_swing
from organ_geometry import Organ
from physics.bed import BeamOnBed

__all__ = ["BedSession", "replay_of"]

TUBE = 0  # there is one
REACH = 60.0
"""mm beyond the duct's ends and to its sides that a hand can reach."""


class BedSession:
    """One duct in its bed, stepped in time. Safe to call from several threads.

    Inputs come from a browser: out of range they are clamped, and those that are not numbers are
    ignored. To the bit, the course of a session is a function of its inputs and of the ticks at
    which they come. `seed` chooses the raggedness of a torn rim, `bed_seed` the bed's scatter;
    `broken_by_touch` is that of a run's start.
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
        broken_by_touch: bool = True,
    ) -> None:
        self._lock = RLock()
        self.seed, self._broken_by_touch = seed, broken_by_touch
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
            wanted = None if self.run.over else self.exercise
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
                self.run.note(hand, "grab", TUBE, at)
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
                self.run.note(hand, "release")

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
                self.run.note(hand, "open", holder.target_opening)

    def reset(self) -> None:
        """Make the duct and its bed whole; the next input starts a run without an exercise."""
        with self._lock:
            self._new_run()
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
                if self.run.going:
                    self._taker.take(moved=moved)
                    self.run.end_tick(torn=duct.torn is not None)
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

    def start_exercise(self, exercise: Exercise, feedback: Feedback = Feedback.CONTINUOUS) -> None:
        """Start anew with an exercise, in its bed; its time runs from the first input."""
        if not isinstance(exercise, BedExercise):
            raise ValueError(f"{exercise.title} is done without a bed")
        with self._lock:
            bed = bed_named(exercise.bed) if isinstance(exercise.bed, str) else exercise.bed
            duct = self.duct
            if (duct.bed, duct.seed) != (bed, exercise.bed_seed):
                self._start(duct.dissection.preset, bed, exercise.bed_seed, duct.threshold)
            self._new_run(exercise, feedback)
            self._renew()

    def finish(self) -> None:
        """End the run as it stands; the duct stays as it is."""
        with self._lock:
            self.run.finish()

    def measures(self) -> DissectionMeasures:
        """Return the measures of this run so far; a `ValueError` before its start."""
        with self._lock:
            if not self.run.started:
                raise ValueError("a run starts with the first input; there has been none")
            return self._taker.measures()

    def run_file(self) -> RunFile:
        """Return this run so far, to keep, download and replay."""
        with self._lock:
            return self.run.file(OrganIdentity.of(self._organ), self.seed)

    @property
    def torn(self) -> bool:
        """Whether the duct is torn."""
        return self.duct.torn is not None

    # Replays

    @classmethod
    def of_log(cls, log: RunLog, organ: Organ, vertices: int) -> Self:
        """Return a session for a run; a `RunFileError` where it cannot be replayed here."""
        log.organ.check(organ)
        start = log.start
        preset, bed, seed = start.preset, start.bed, start.bed_seed
        if bed is None or seed is None:
            raise RunFileError("a run of a free duct has no bed")
        try:
            preset = preset_named(preset) if isinstance(preset, str) else preset
            session = cls(
                organ,
                msgspec.structs.replace(preset, law=start.law, stiffening=start.stiffening),
                bed_named(bed) if isinstance(bed, str) else bed,
                bed_seed=seed,
                threshold=start.threshold_MPa,
                vertices=vertices,
                seed=log.seed,
                broken_by_touch=start.broken_by_touch,
            )
        except ValueError as error:
            raise RunFileError(f"the run's preset or bed: {error}") from None
        if strands_digest(session.duct.beam.strands) != start.strands_sha256:
            raise RunFileError(f"seed {seed} gives other strands here than where the run was made")
        if isinstance(log.exercise, BedExercise) and (
            (log.exercise.bed, log.exercise.bed_seed) != (bed, seed)
        ):
            raise RunFileError("the run's exercise is of another bed than the run")
        return session

    def restart(self, log: RunLog) -> None:
        """Go to where a run starts."""
        if log.exercise is None:
            self.reset()
        else:
            self.start_exercise(log.exercise, log.feedback)
        if log.start.tips_mm is not None:
            self.put_hands(log.start.tips_mm)

    def apply(self, each: Input) -> None:
        """Apply an input; one that a duct in a bed does not take is ignored."""
        hand, value = each.hand, each.value
        if each.kind == "release":
            self.release(hand)
        elif each.kind == "instrument" and isinstance(value, str):
            self.choose_instrument(hand, value)  # pyright: ignore[reportArgumentType]
        elif isinstance(value, tuple):
            if each.kind == "grab":
                self.grab(hand, value[1])
            elif each.kind == "move":
                self.move_hand(hand, np.array(value))
        elif each.kind == "open" and isinstance(value, float | int):
            self.open_jaws(hand, value)

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the figures of `row`."""
        by_hand = (
            "x_mm", "y_mm", "z_mm", "opening_mm", "force_x_N", "force_y_N", "force_z_N", "held",
        )  # fmt: skip
        return (
            *(f"hand_{hand + 1}_{name}" for hand in range(HANDS) for name in by_hand),
            "freed_mm", "strands_broken", "stress_ratio",
            "work_mJ", "stored_mJ", "dissipated_mJ", "torn",
        )  # fmt: skip

    def row(self) -> tuple[float, ...]:
        """Return what the instruments show now."""
        reading = self.reading()
        energy = reading.books
        forces: list[list[float]] = reading.forces.tolist()
        hands = zip(self.duct.hands, forces, reading.held, strict=True)
        return (
            *(
                number
                for hand, force, held in hands
                for number in (*map(float, hand.place), hand.opening, *force, int(held))
            ),
            reading.freed,
            int(reading.parted),
            reading.stress_share,
            energy.work,
            energy.stored,
            energy.dissipated,
            int(self.torn),
        )

    def _new_run(
        self, exercise: Exercise | None = None, feedback: Feedback = Feedback.CONTINUOUS
    ) -> None:
        self._taker = DissectionMeasureTaker()
        if exercise is not None and not isinstance(exercise, BedExercise):
            raise ValueError(f"{exercise.title} is done without a bed")
        trial = None if exercise is None else BedTrial(exercise, self._taker)
        self.run = Run(self._taker, exercise, feedback, trial=trial)

    def _run_start(self) -> Callable[[], RunStart]:
        """Return what makes the start of the run that begins now."""
        duct, preset = self.duct, self.duct.dissection.preset
        threshold = duct.threshold
        tips = tuple((x, y, z) for x, y, z in (hand.place.tolist() for hand in duct.hands))
        return lambda: RunStart(
            preset.name if preset.ships else preset,
            threshold,
            bed=named_or_whole(duct.bed),
            bed_seed=duct.seed,
            strands_sha256=strands_digest(duct.beam.strands),
            law=preset.law,
            stiffening=preset.stiffening,
            elements=ELEMENTS,
            substeps=SUBSTEPS,
            broken_by_touch=self._broken_by_touch,
            tips_mm=tips,
        )

    @property
    def exercise(self) -> BedExercise | None:
        """The exercise of the present run."""
        found = self.run.exercise
        return found if isinstance(found, BedExercise) else None

    def _begin_run(self) -> bool:
        """Start the run with the first input, on a duct that nothing has touched."""
        if self.run.started or self.run.over:
            return False
        hands = self.duct.hands
        self._renew()
        for hand, (before, after) in enumerate(zip(hands, self.duct.hands, strict=True)):
            self.duct.put_hand(hand, before.place)
            after.target[:] = before.target
        self.run.start(self._run_start())
        self._taker.start(self.duct, broken_by_touch=self._broken_by_touch)
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
        exercise = self.exercise
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
        self._new_run()
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


def replay_of(
    log: RunLog, organ: Organ, *, vertices: int = FEW
) -> Replay[Session] | Replay[BedSession]:
    """Return a replay of a run, on a free duct or one in a bed."""
    if log.start.in_bed:
        return Replay(BedSession, log, organ, vertices=vertices)
    return Replay(Session, log, organ, vertices=vertices)
