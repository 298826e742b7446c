"""A session: one trainee's tissue, the inputs to it, its settings and its runs, without a viewer.

The same action has one name from the page down: `choose_instrument`, `grab`, `move_hand`,
`open_jaws`, `release`, `lift`, `set_target_force`, `set_grasp`, `set_threshold`. An input goes to
the tissue, which clamps it to its range; it is logged as it has acted, and solved with the next
tick by `advance`. Places are mm in the duct's frame: along it from the first clamp, lateral, and
along the pull, away from a bed.
"""

import copy
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from threading import RLock
from typing import Self

import msgspec
import numpy as np
from numpy.typing import NDArray

from app.anatomy import anatomy_named
from app.bed_preset import BedPreset, bed_named
from app.simulation.exercises.attempt import Attempt
from app.simulation.exercises.errors import Incident
from app.simulation.exercises.exercise import Exercise, ExerciseInputs, Feedback
from app.simulation.exercises.goals import FreeLength
from app.simulation.exercises.metrics import Metrics
from app.simulation.exercises.metrics_recorder import MetricsRecorder
from app.simulation.inputs.inputs import (
    ALL_INSTRUMENTS,
    STRUCTURES,
    Input,
    InputKind,
    Instrument,
    Structure,
    TheoryChoice,
)
from app.simulation.runs.run import Run
from app.simulation.runs.run_file import (
    OrganIdentity,
    RunFile,
    RunFileError,
    RunLog,
    strands_digest,
)
from app.simulation.session.dissection_measures import DissectionRecorder
from app.simulation.session.holding import Holding, next_move
from app.simulation.session.measures import PullRecorder
from app.simulation.specimen.comparison import Ghost, GhostReading, SwingingChain
from app.simulation.specimen.dissection import default_preset, fits
from app.simulation.specimen.drawn_duct import DrawnDuct
from app.simulation.specimen.grasped_beam import BeamModel, GraspedBeam
from app.simulation.specimen.preset import OrganBeam, Preset, preset_named, presets
from app.simulation.specimen.specimen import Specimen
from app.simulation.tissue.instruments import HandContact
from app.simulation.tissue.planar_tissue import PlanarTissue
from app.simulation.tissue.reading import Reading, Vector
from app.simulation.tissue.spatial_tissue import SpatialTissue
from app.simulation.tissue.tissue import Tissue
from organ_geometry import Organ
from physics import Cubic, Theory
from physics.bed import BeamOnBed

VERTICES = 5000
"""Vertices of the skin, about: as many as a browser without a graphics card draws smoothly."""
MOST_TRIES = 20
"""Most finished exercises kept for comparison."""
# What an exercise that counts the hand alone does not take.
BY_SLIDER: frozenset[InputKind] = frozenset({"force", "grasp", "threshold"})
# What acts in an exercise in which no hand moves.
LOOKS: frozenset[InputKind] = frozenset({"view", "wipe", "mark", "unsafe"})
# What still acts when an exercise is over: what ends a pull, and settings of the next one.
AFTER_RESULT: frozenset[InputKind] = frozenset({"release", "grasp", "threshold"})


def free_specimen(
    organ: Organ, preset: Preset | None = None, theory: Theory | None = None
) -> Specimen:
    """Return an organ's duct in the plane of its pull, by the cubic theory if none is given."""
    return Specimen(preset or default_preset(organ), organ, theory=theory or Cubic())


def specimen_in_bed(
    organ: Organ,
    preset: Preset | None = None,
    bed: BedPreset | None = None,
    *,
    bed_seed: int = 1,
    threshold_MPa: float | None = None,  # noqa: N803
    relaxation: bool = False,
) -> Specimen:
    """Return an organ's duct in a bed, the normal one if none is given."""
    return Specimen(
        preset or default_preset(organ),
        organ,
        bed or bed_named("normal"),
        bed_seed=bed_seed,
        threshold_MPa=threshold_MPa,
        relaxation=relaxation,
    )


class Session:
    """One specimen under a pair of hands, stepped in time. Safe to call from several threads.

    Inputs come from a browser: out of range they are clamped, and those that are not numbers are
    ignored. Time advances in ticks of `TICK_SECONDS`; to the bit, the course of a session is a
    function of the inputs and of the ticks at which they come.

    The skin has about `vertices` vertices, and `seed` chooses the raggedness of the torn rim;
    `broken_by_touch` and `grip_N` are those of a run's start: without a grip nothing slips. The
    surfaces of a session that is not `watched` stay as they were at first, and it keeps no earlier
    tries. `tissue`, `drawn` and `run` are public for reading; `tissue` is another object after a
    choice of organ, preset, bed or exercise's bed, `run` after a reset. A run starts with the first
    input, and is over when its exercise is or when nothing is left whole to act on.
    """

    def __init__(
        self,
        specimen: Specimen,
        *,
        vertices: int = VERTICES,
        seed: int = 1,
        broken_by_touch: bool = True,
        grip_N: float | None = None,  # noqa: N803 (a unit)
        watched: bool = True,
    ) -> None:
        if specimen.organ is None:
            raise ValueError("a session needs an organ, whose surface it draws")
        self.seed, self._watched = seed, watched
        self._broken_by_touch, self._grip = broken_by_touch, grip_N
        self.lock = RLock()  # to be held while what belongs together is read piece by piece
        self._organ, self._vertices = specimen.organ, vertices
        self._tries: deque[tuple[RunFile, list[Incident]]] = deque(maxlen=MOST_TRIES)
        self.tissue = self._tissue_of(specimen)
        self._drawn = self._surfaces() if watched else None
        self._start_run()

    @property
    def drawn(self) -> DrawnDuct:
        """Its surfaces, made when first asked for where nobody watches."""
        with self.lock:
            if self._drawn is None:
                self._drawn = self._surfaces()
            return self._drawn

    def _surfaces(self) -> DrawnDuct:
        drawn = DrawnDuct(self._organ, self._vertices, self.seed)
        drawn.follow(self.tissue.dissection)
        return drawn

    @property
    def specimen(self) -> Specimen:
        """What is in hand."""
        return self.tissue.specimen

    @property
    def planar(self) -> PlanarTissue:
        """The duct in the plane of its pull; a `ValueError` if it is one in space."""
        if (duct := self.tissue.in_plane) is None:
            raise ValueError("this duct is a beam in space: no theory of the plane solves it")
        return duct

    @property
    def spatial(self) -> SpatialTissue:
        """The duct in space, in its bed or free; a `ValueError` if it is one in a plane."""
        if (tissue := self.tissue.in_space) is None:
            raise ValueError("this duct is solved in the plane of its pull, not in space")
        return tissue

    @property
    def holding(self) -> Holding | None:
        """What holds next to what is free, while an exercise asks for that, else None."""
        if self.run.exercise is None or self.run.over:
            return None
        goal = self.run.exercise.goal
        if not isinstance(goal, FreeLength):
            return None
        begun, pulled = self.run.started, "no_traction" in self.run.exercise.limit_of
        found = self._recorder.holding_beside(goal.from_mm, goal.to_mm) if begun else None
        strands, station = (0, None) if found is None else found
        return Holding(strands, station or 0.0, next_move(self.spatial, goal, pulled, station))

    # What the trainee does.

    def choose_instrument(self, hand: int, instrument: Instrument) -> None:
        """Give a hand another instrument; what it held it lets go."""
        with self.lock:
            # An exercise that waits or goes on may allow only some.
            if instrument in self.instruments:
                self._act(hand, "instrument", ALL_INSTRUMENTS.index(instrument))

    def grab(self, hand: int, station: float, tube: int = 0) -> Vector | None:
        """Take hold at a station, mm from a tube's first end; return the place, or None."""
        # None where a hand cannot hold: at a clamp, on the other hand's hook, once the duct is
        # torn, and with an instrument that does not hold.
        with self.lock:
            if self._act(hand, "grab", tube, station) is None:
                return None
            return self.tissue.held_place(hand)

    def move_hand(self, hand: int, place: Sequence[float] | NDArray[np.float64]) -> None:
        """Lead a hand's tip to a place, (3,) mm; in a plane its height above the clamps counts."""
        x, y, z = place
        self._act(hand, "move", float(x), float(y), float(z))

    def lead_hands(self, steps: Mapping[int, Sequence[float]]) -> None:
        """Lead hands on by steps, (4,) mm: of the tip along the axes, and of the jaws' opening."""
        with self.lock:
            if not self._takes("move"):
                return
            tissue = self.spatial
            for hand, step in steps.items():
                place, opened = tissue.lead(hand, step, self._begin_run)
                if place is not None:
                    self.run.note(hand, "move", place)
                if opened is not None:
                    self.run.note(hand, *opened)

    def lift(self, deflection: float, hand: int = 0) -> None:
        """Lead the hand that holds a duct in a plane to a deflection of the grasp, mm.

        A hook pulls and does not push: below zero the duct lies where it is at rest.
        """
        self._act(hand, "lift", deflection)

    def release(self, hand: int = 0) -> None:
        """Let go of the duct."""
        self._act(hand, "release")

    def open_jaws(self, hand: int, opening: float) -> None:
        """Open or close jaws, mm between them; an instrument without any does not open."""
        self._act(hand, "open", opening)

    def aim(self, hand: int, shaft: Sequence[float]) -> None:
        """Turn an instrument that holds nothing: (3,) direction from its tip back to the hand."""
        self._act(hand, "aim", *shaft)

    def spread(self, hand: int, direction: Sequence[float]) -> None:
        """Set the (3,) direction in which jaws part."""
        self._act(hand, "spread", *direction)

    def clip(self, hand: int) -> bool:
        """Clip the tubes between a clip applier's jaws; return whether there was one."""
        return self._act(hand, "clip") is not None

    def cut(self, hand: int) -> bool:
        """Cut what is between scissors' blades; return whether anything was."""
        return self._act(hand, "cut") is not None

    def mark(self, structure: Structure, tube: int, station: float) -> bool:
        """Take a tube for a structure, mm from its first end; return whether there is one."""
        return self._act(0, "mark", STRUCTURES.index(structure), tube, station) is not None

    def call_unsafe(self) -> None:
        """Say that it is not yet safe to tell which structure is which."""
        self._act(0, "unsafe")

    def look_from(self, view: Sequence[float] | NDArray[np.float64]) -> None:
        """See a duct in space from elsewhere: the (3,), (6,) or (13,) numbers of an `Input`."""
        # Strands that part out of sight, and stabs behind a duct, are judged by it.
        self._act(0, "view", *map(float, view))

    def wipe_lens(self) -> None:
        """Wipe the scope's lens clean."""
        self._act(0, "wipe")

    def suck(self, hand: int, rate: float) -> None:
        """Take up what has been lost, ml/s; 0 stops it."""
        self._act(hand, "suck", rate)

    def set_target_force(self, force: float, hand: int = 0) -> None:
        """Pull a duct in a plane with a force, N, reached over the next ticks."""
        self._act(hand, "force", force)

    def set_grasp(self, grasp: float, hand: int = 0) -> None:
        """Hold a duct in a plane elsewhere, mm from the first clamp; keep force or deflection."""
        with self.lock:
            if self.run.over and self.tissue.torn is None:
                self.planar.forget_task()
            self._act(hand, "grasp", grasp)

    def set_threshold(self, threshold: float) -> None:
        """Let the wall tear at another stress, MPa."""
        self._act(0, "threshold", threshold)

    def reset(self) -> None:
        """Let go and make all whole; the next input starts a run without an exercise."""
        with self.lock:
            self.tissue.prepare(None)
            self._new_run()
            self._draw()

    def _act(self, hand: int, kind: InputKind, *values: float) -> Sequence[float] | None:
        """Apply an input and log it as it has acted; return that, or None if it did nothing."""
        with self.lock:
            if not self._takes(kind):
                return None
            applied = self.tissue.apply(hand, kind, values, self._begin_run)
            if applied is None:
                return None
            self.run.note(hand, *applied)
            return applied[1]

    def _takes(self, kind: InputKind) -> bool:
        """Return whether the run and its exercise take inputs of a kind now."""
        run = self.run
        if kind in BY_SLIDER and run.hand_only:
            return False
        if run.over:
            return not run.closed or kind in AFTER_RESULT
        return run.exercise is None or not run.exercise.looks_only or kind in LOOKS

    # Time and readings.

    def advance(self, ticks: int = 1) -> bool:
        """Advance by some ticks and draw; return whether anything has moved or is going to."""
        with self.lock:
            tissue, changed = self.tissue, False
            for _ in range(ticks):
                moved = tissue.advance()
                changed |= moved
                if self.run.going:
                    self._recorder.take(moved=moved)
                    self.run.end_tick(over=tissue.over)
                    if self.run.closed:
                        tissue.stop()
            if changed:
                self._draw()
            return changed or tissue.moving

    def _draw(self) -> None:
        if not self._watched:
            return
        torn = self.tissue.tear_of(0)
        if torn is not None and not self.drawn.in_pieces:
            self.drawn.show_pieces(torn)
        elif torn is None and self.drawn.in_pieces:
            self.drawn.show_whole()
        self.tissue.draw(self.drawn)

    def reading(self) -> Reading:
        """Return what the instruments show now."""
        with self.lock:
            return self.tissue.reading()

    def stress(self, out: NDArray[np.float32], surface: int = 0) -> NDArray[np.float32]:
        """Write the stress along the organ, MPa, at each vertex of a drawn surface."""
        with self.lock:
            return self.tissue.write_stress(self.drawn, out, surface)

    def beam_touched_by(self, hand: int) -> tuple[BeamOnBed, HandContact]:
        """Return a copy of the beam in space, and what a hand does to it."""
        with self.lock:
            return copy.deepcopy(self.spatial.beam), self.spatial.touch(hand)

    def touch(self, hand: int) -> HandContact:
        """Return what a hand does to the beam in space now."""
        with self.lock:
            return self.spatial.touch(hand)

    # Comparisons beside a duct in a plane.

    def curve(self, count: int = 80) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return (count,) deflections, mm, and forces, N, past the break and past this pull."""
        # Fewer than `count` where the theory ends.
        with self.lock:
            beam, deepest = self.planar.grasped, self.planar.deepest
        return beam.curve(count, deepest=deepest)

    @property
    def ghost(self) -> Ghost | None:
        """The other theory's duct, while this one is whole."""
        return None if (duct := self.tissue.in_plane) is None else duct.ghost

    @property
    def ghost_theory(self) -> Theory | None:
        """The theory that was chosen for the ghost, or None."""
        return None if (duct := self.tissue.in_plane) is None else duct.ghost_theory

    @property
    def chain(self) -> SwingingChain | None:
        """The chain of masses and springs beside the duct, while this one is whole."""
        return None if (duct := self.tissue.in_plane) is None else duct.chain

    def ghost_reading(self) -> GhostReading | None:
        """Return the ghost's reading; None without a ghost or an equilibrium of it."""
        with self.lock:
            return None if (duct := self.tissue.in_plane) is None else duct.ghost_reading()

    def choose_ghost(self, theory: Theory | None) -> None:
        """Show a ghost by another theory under the same load, or none.

        A `ValueError` if the theory ends before the preset's break; then nothing changes.
        """
        dissection = self.planar.dissection
        model = None if theory is None else BeamModel.of(dissection, theory)
        with self.lock:
            if model is not None and model.dissection is not self.planar.dissection:
                model = BeamModel.of(self.planar.dissection, model.theory)
            self.planar.show_ghost(model, self.drawn.skin)

    def show_chain(self, shown: bool) -> None:
        """Show or hide the mass-spring chain."""
        with self.lock:
            self.planar.show_chain(shown)

    # What is in hand; each choice but a theory in the plane starts anew.

    def choose(self, specimen: Specimen, exercise: Exercise | None = None) -> None:
        """Start anew with another specimen of the same organ, as an exercise begins if one does."""
        tissue = self._tissue_of(specimen, exercise)
        with self.lock:
            self._set(tissue)

    def presets_offered(self) -> list[Preset]:
        """Return the presets that fit this organ, with the user's own one in use."""
        shipped = [preset for preset in presets().values() if fits(self._organ, preset)]
        own = self.tissue.dissection.preset
        return shipped if own.ships else [*shipped, own]

    def choose_preset(self, preset: Preset | str) -> None:
        """Start anew with a preset, or a shipped one's name; a torn free duct stays as it is."""
        chosen = preset_named(preset)
        tissue = self._tissue_of(replace(self.specimen, preset=chosen, threshold_MPa=None))
        with self.lock:
            if self.tissue.torn is None or self.specimen.theory is None:
                self._set(tissue)

    def choose_bed(self, bed: BedPreset | str | None, seed: int = 1) -> None:
        """Start anew in another bed, or as a free duct in space."""
        chosen = None if bed is None else bed_named(bed)
        self.choose(
            replace(self.specimen, bed=chosen, bed_seed=seed, theory=None, threshold_MPa=None)
        )

    def prepare_organ(self, organ: Organ) -> Callable[[], None]:
        """Prepare another organ, solved by its own sections; return what starts anew with it."""
        # To be called by the thread that draws, since the surfaces change. The material stays where
        # this preset already takes the organ's own sections as drawn; else it is
        # `default_preset`'s.
        drawn = DrawnDuct(organ, self._vertices, self.seed)
        preset = self.tissue.dissection.preset
        if preset.beam != OrganBeam():  # a bar, or a wall and clamps of the organ before
            preset = default_preset(organ)
        specimen = replace(self.specimen, organ=organ, preset=preset, threshold_MPa=None)
        tissue = self._tissue_of(specimen)

        def start() -> None:
            with self.lock:
                drawn.shape = self.drawn.shape
                self._organ, self._drawn = organ, drawn
                # The theory may have been changed meanwhile.
                theory = self.specimen.theory
                self._set(
                    tissue
                    if theory == specimen.theory
                    else self._tissue_of(replace(specimen, theory=theory))
                )
                self._tries.clear()

        return start

    def choose_theory(self, theory: Theory) -> None:
        """Solve a duct in a plane by another theory, with that theory's own threshold.

        A `ValueError` if the theory ends before the preset's break; then nothing changes.
        """
        # Outside the lock: a theory's first solution may have to be compiled.
        model = BeamModel.of(self.planar.dissection, theory)
        with self.lock:
            duct = self.planar
            if model.dissection is not duct.dissection:  # another was chosen meanwhile
                model = BeamModel.of(duct.dissection, theory)
            if duct.tear is None:
                duct.solve_by(model)
                if self.run.started:
                    self.run.note(0, "theory", (theory,))
                else:
                    self._new_run(self.run.exercise, self.run.feedback, self.run.exercise_inputs)

    # Exercises and runs.

    @property
    def instruments(self) -> tuple[Instrument, ...]:
        """The instruments that may be taken now."""
        exercise = None if self.run.over else self.run.exercise
        return self.tissue.instruments if exercise is None else exercise.instruments

    @property
    def task_grasp(self) -> float:
        """Grasp that exercises of a duct in a plane are scaled for, mm from the first clamp."""
        return self.planar.task_grasp

    @property
    def goal(self) -> tuple[float, float] | None:
        """Deflections between which the exercise's goal lies with the present grasp, mm.

        None without an exercise that waits or goes on, and for one that has no such goal.
        """
        with self.lock:
            exercise = None if self.run.over else self.run.exercise
            return None if exercise is None else self.tissue.goal_of(exercise)

    def task_beam(self) -> GraspedBeam:
        """Return the beam that exercises of a duct in a plane are scaled for."""
        with self.lock:
            return self.planar.task_beam()

    def start_exercise(
        self,
        exercise: Exercise,
        feedback: Feedback = Feedback.CONTINUOUS,
        grasp: float | None = None,
        inputs: ExerciseInputs = "hand",
    ) -> None:
        """Start anew with an exercise, in its bed, or at `task_grasp` if no grasp is given.

        Its time runs from the first input. With inputs "hand", a force, another grasp or another
        threshold is ignored until it is over. Then the hands stay where they are, and may only let
        go, until a reset or another exercise.
        """
        with self.lock:
            before = self.tissue
            self._take_bed_of(exercise)
            if grasp is not None:
                self.reset()
                self.set_grasp(grasp)
            if self.tissue is before:
                self.tissue.prepare(exercise)
            self._new_run(exercise, feedback, inputs)
            self._draw()

    def _take_bed_of(self, exercise: Exercise) -> None:
        """Put the duct into an exercise's bed, as that begins, if it is in another."""
        specimen, opening = self.specimen, exercise.opening
        if opening is not None and opening.anatomy is not None:
            whole = anatomy_named(opening.anatomy)
            if specimen.anatomy != whole:
                raise ValueError(f"{exercise.title} is done at the anatomy {whole.name!r}: open it")
        elif opening is not None:
            bed = None if opening.bed is None else bed_named(opening.bed)
            if (specimen.bed, specimen.bed_seed) != (bed, opening.bed_seed):
                threshold = self.tissue.threshold if specimen.theory is None else None
                self.choose(
                    replace(
                        specimen,
                        bed=bed,
                        bed_seed=opening.bed_seed,
                        theory=None,
                        threshold_MPa=threshold,
                    ),
                    exercise,
                )
        elif specimen.theory is None:
            raise ValueError(f"{exercise.title} is done on a duct in a plane, without a bed")

    def finish(self) -> None:
        """End the run as it stands; the duct stays as it is, and so do the hands of an exercise."""
        with self.lock:
            going = self.run.going
            self.run.finish()
            if going and self.run.closed:
                self.tissue.stop()

    def metrics(self) -> Metrics:
        """Return the measures of this run so far, by key; in space a `ValueError` before it."""
        with self.lock:
            return self.run.metrics()

    def run_file(self) -> RunFile:
        """Return this run so far, to keep, download and replay."""
        with self.lock:
            return self.run.file(OrganIdentity.of(self._organ), self.seed)

    def earlier_tries(self, run: RunFile) -> list[RunFile]:
        """Return the earlier judged runs of the same exercise and start, oldest first."""
        with self.lock:
            tries = [each for each, _ in self._tries]
        task = run.log.exercise, run.log.start
        return [
            each for each in tries if (each.log.exercise, each.log.start) == task and each != run
        ]

    def earlier_incidents(self, name: str, count: int) -> list[list[Incident]]:
        """Return the errors of the last so many judged runs of an exercise, of any bed."""
        with self.lock:
            found = [
                errors
                for run, errors in self._tries
                if run.log.exercise is not None and run.log.exercise.name == name
            ]
        return found[-count:]

    # Replays.

    @classmethod
    def of_log(cls, log: RunLog, organ: Organ, vertices: int = VERTICES) -> Self:
        """Return a session for a run; a `RunFileError` where it cannot be replayed here."""
        # A run at an anatomy brings its own tubes instead of the organ.
        start = log.start
        try:
            theory = None if start.theory is None else start.theory.theory()
        except ValueError as error:
            raise RunFileError(f"the run's theory: {error}") from None
        preset, bed = start.preset, start.bed
        try:
            preset = preset_named(preset)
            if theory is None:
                preset = msgspec.structs.replace(
                    preset,
                    law=start.law,
                    stiffening=start.stiffening,
                    tear_mm_per_s=start.tear_mm_per_s,
                )
            anatomy = start.anatomy
            each = start.strand_relaxation, start.wall_relaxation
            strands, wall = (None if prony is None else prony.made() for prony in each)
            relaxation = strands, wall
            if anatomy is not None:
                whole = anatomy_named(anatomy)
                specimen = replace(
                    Specimen.of_anatomy(whole),
                    relaxation=relaxation,
                    tubes_touch=start.tubes_touch,
                    clear_strands=start.clear_strands,
                )
            else:
                specimen = Specimen(
                    preset,
                    organ,
                    None if bed is None else bed_named(bed),
                    bed_seed=1 if start.bed_seed is None else start.bed_seed,
                    theory=theory,
                    threshold_MPa=start.threshold_MPa if theory is None else None,
                    relaxation=relaxation,
                )
            log.organ.check(specimen.organ or organ)
            session = cls(
                specimen,
                vertices=vertices,
                seed=log.seed,
                broken_by_touch=start.broken_by_touch,
                grip_N=start.grip_N,
            )
        except RunFileError:
            raise
        except ValueError as error:
            what = "preset, bed or theory" if start.anatomy is None else "anatomy"
            raise RunFileError(f"the run's {what}: {error}") from None
        if start.strands_sha256 is not None:
            if strands_digest(session.spatial.beam.strands) != start.strands_sha256:
                raise RunFileError(
                    f"seed {start.bed_seed} gives other strands here than where the run was made"
                )
            opening = None if log.exercise is None else log.exercise.opening
            if (
                opening is not None
                and opening.bed is not None
                and ((opening.bed, opening.bed_seed) != (bed, start.bed_seed))
            ):
                raise RunFileError("the run's exercise is of another bed than the run")
        return session

    def restart(self, log: RunLog) -> None:
        """Go to where a run starts."""
        start = log.start
        self.reset()
        theory = self.specimen.theory if start.theory is None else start.theory.theory()
        if theory is not None and self.specimen.theory != theory:
            self.choose_theory(theory)
        if start.grasp_mm is not None:
            self.set_grasp(start.grasp_mm)
            if self.planar.grasp != start.grasp_mm:
                raise RunFileError(
                    f"the run's grasp of {start.grasp_mm:g} mm is out of this duct's range"
                )
        self.set_threshold(start.threshold_MPa)
        if self.tissue.threshold != start.threshold_MPa:
            raise RunFileError(
                f"the run's threshold of {start.threshold_MPa:g} MPa is out of this duct's range"
            )
        if log.exercise is not None:
            self.start_exercise(log.exercise, log.feedback, inputs=log.exercise_inputs)
        if start.tips_mm is not None:
            self.spatial.put_hands(start.tips_mm)
        self.advance()  # settle first: the run starts from a duct at rest, already drawn

    def apply(self, each: Input) -> None:
        """Apply a logged input; one that this tissue does not take is ignored."""
        value = each.value
        if isinstance(value, TheoryChoice):
            if self.specimen.theory is not None:
                self.choose_theory(value.theory())
        elif isinstance(value, str):
            self.choose_instrument(each.hand, value)  # pyright: ignore[reportArgumentType]
        elif isinstance(value, tuple):
            self._act(each.hand, each.kind, *value)
        elif value is None:
            self._act(each.hand, each.kind)
        elif each.kind == "grasp" and self.specimen.theory is not None:
            self.set_grasp(value, each.hand)
        else:
            self._act(each.hand, each.kind, value)

    # Inside.

    def _tissue_of(self, specimen: Specimen, exercise: Exercise | None = None) -> Tissue:
        if specimen.theory is None:
            return SpatialTissue(
                specimen,
                broken_by_touch=self._broken_by_touch,
                grip_N=self._grip,
                exercise=exercise,
            )
        return PlanarTissue(specimen)

    def _recorder_of(self, exercise: Exercise | None) -> MetricsRecorder:
        """Return what records the metrics of a run at the tissue in hand."""
        if (plane := self.tissue.in_plane) is not None:
            return PullRecorder(plane, exercise)
        return DissectionRecorder(self.spatial, exercise)

    def _set(self, tissue: Tissue) -> None:
        """Start anew with a tissue; a ghost and a chain beside the one before go on beside it."""
        before, self.tissue = self.tissue, tissue
        if self._drawn is not None:
            self._drawn.follow(tissue.dissection)
        if tissue.in_plane is not None and before.in_plane is not None:
            tissue.in_plane.compare_as(before.in_plane, self.drawn.skin)
        self._new_run()

    def _new_run(
        self,
        exercise: Exercise | None = None,
        feedback: Feedback = Feedback.CONTINUOUS,
        inputs: ExerciseInputs = "any",
    ) -> None:
        if self.run.started:
            self.run.finish()
            if self._watched and self.run.outcome is not None:
                kept = self.run.file(OrganIdentity.of(self._organ), self.seed)
                self._tries.append((kept, self.run.incidents()))
        self._start_run(exercise, feedback, inputs)

    def _start_run(
        self,
        exercise: Exercise | None = None,
        feedback: Feedback = Feedback.CONTINUOUS,
        inputs: ExerciseInputs = "any",
    ) -> None:
        self._recorder = self._recorder_of(exercise)
        attempt = None if exercise is None else Attempt(exercise, self._recorder)
        self.run = Run(self._recorder, exercise, feedback, inputs, attempt)

    def _begin_run(self) -> bool:
        """Start the run with the first input, on a tissue that nothing has touched before."""
        if self.run.started or self.run.over:
            return False
        in_progress = self.tissue.renew()
        self.run.start(self.tissue.start())
        self._recorder.start()
        for hand, applied in in_progress:
            self.run.note(hand, *applied)
        return True
