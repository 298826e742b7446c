"""A session: one trainee's duct, its inputs, its state and its steps in time. No viewer in it."""

import contextlib
from collections.abc import Callable
from threading import RLock

import numpy as np
from numpy.typing import NDArray

from app.simulation.clock import Clock
from app.simulation.dissection import Dissection, default_preset, fits
from app.simulation.drawn_duct import DrawnDuct
from app.simulation.exercise import Exercise, HoldStretch
from app.simulation.exercise_course import exercises_for
from app.simulation.feedback import Feedback
from app.simulation.ghost import Ghost, GhostReading
from app.simulation.grasped_duct import GraspedDuct, Load
from app.simulation.measures import Measures
from app.simulation.model import Model
from app.simulation.preset import Preset, preset_named, presets
from app.simulation.pulled_duct import PulledDuct
from app.simulation.reading import Phase, Reading, Surface
from app.simulation.run import Run, StartingPoint
from app.simulation.run_log import InputKind, OrganIdentity, RunFile
from app.simulation.swinging_chain import SwingingChain
from organ_geometry.organ import Organ
from physics import Cubic, NoEquilibrium, Theory

__all__ = ["VERTICES", "Phase", "Reading", "Session", "Surface"]

VERTICES = 5000
"""Vertices of the skin, about: what a browser without a graphics card still draws smoothly."""
TASK_THRESHOLD = 0.5
"""Force above which a run's time is counted, in forces at break with a grasp in the middle."""


class Session:
    """One duct under one grasper, stepped in time. Safe to call from several threads.

    Inputs out of range are clamped to it and inputs that are no number are ignored: they come
    from a browser. Steps and readings happen whether or not anybody looks. Time goes in ticks of
    `TICK_SECONDS`; what happens is a function of the inputs and the ticks they come at, to the bit.

    Parameters
    ----------
    organ
        The organ.
    preset
        The preset to start with; `default_preset` when None.
    vertices
        About how many vertices the skin shall have.
    seed
        Chooses the raggedness of the torn rim.
    """

    def __init__(
        self,
        organ: Organ,
        preset: Preset | None = None,
        *,
        vertices: int = VERTICES,
        seed: int = 1,
    ) -> None:
        self._lock = RLock()
        self._clock = Clock()
        self._organ, self._seed, self._vertices = organ, seed, vertices
        self._drawn = DrawnDuct(organ, vertices)
        self._ghost: Ghost | None = None
        self._chain: SwingingChain | None = None
        self._run = Run(0.0)
        self._last_run: Run | None = None
        dissection = Dissection.of(organ, preset or default_preset(organ))
        self._start(Model.of(dissection, Cubic()))

    @property
    def dissection(self) -> Dissection:
        """The dissection of the chosen preset."""
        return self._pulled.model.dissection

    @property
    def theory(self) -> Theory:
        """The chosen theory."""
        return self._pulled.model.theory

    @property
    def grasp(self) -> float:
        """Distance of the grasp from the first clamp that was asked for, mm."""
        return self._pulled.grasp_wanted

    @property
    def grasp_range(self) -> tuple[float, float]:
        """Where the grasper can hold, mm from the first clamp."""
        return self._pulled.grasp_range

    @property
    def force_wanted(self) -> float:
        """Force that the pull grows or falls to, N; by hand the one that the beam answers with."""
        control = self._pulled.control
        return control.force if control.mode == "hand" else control.force_wanted

    @property
    def force_limit(self) -> float:
        """Largest force the grasper gives, N."""
        return self._pulled.model.force_limit

    @property
    def deflection_limit(self) -> float:
        """Largest deflection that a hand can ask for, mm."""
        with self._lock:
            return self._pulled.grasped.deflection_limit

    @property
    def threshold(self) -> float:
        """Stress at which the duct tears that was asked for, MPa."""
        return self._pulled.threshold_wanted

    @property
    def threshold_range(self) -> tuple[float, float]:
        """How far the threshold may be moved, MPa."""
        return self._pulled.threshold_range

    @property
    def stress_range(self) -> tuple[float, float]:
        """Ends of the scale of stress on the surface, MPa: none, and the threshold."""
        return 0.0, self._pulled.threshold_wanted

    @property
    def shape(self) -> int:
        """Number that changes whenever `surfaces` are others than before."""
        return self._drawn.shape

    @property
    def surfaces(self) -> tuple[Surface, ...]:
        """The closed surfaces to draw."""
        return self._drawn.surfaces

    @property
    def transforms(self) -> NDArray[np.float64]:
        """(D, 3, 4) how the driving points were moved by the last step, less the identity."""
        return self._drawn.transforms

    @property
    def ghost(self) -> Ghost | None:
        """The other theory's duct, while this one is whole."""
        return self._ghost if self._pulled.tear is None else None

    @property
    def ghost_theory(self) -> Theory | None:
        """The theory that was chosen for the ghost, or None."""
        return None if self._ghost is None else self._ghost.model.theory

    @property
    def chain(self) -> SwingingChain | None:
        """The chain of masses and springs beside the duct, while this one is whole."""
        return self._chain if self._pulled.tear is None else None

    @property
    def run(self) -> Run:
        """The run that goes: its time, its exercise and how that stands; for looking at."""
        return self._run

    @property
    def seed(self) -> int:
        """What chooses the raggedness of the torn rim."""
        return self._seed

    @property
    def tear_front(self) -> float | None:
        """How far the tear has run (`tear_course.front`); None while the duct is whole."""
        tear = self._pulled.tear
        return None if tear is None else tear.front

    def presets_offered(self) -> list[Preset]:
        """Return the presets that this organ can be clamped for.

        Returns
        -------
        list[Preset]
            The presets.
        """
        return [preset for preset in presets().values() if fits(self._organ, preset)]

    def exercises_offered(self) -> tuple[Exercise, ...]:
        """Return the exercises for this duct, with the present grasp and threshold.

        Returns
        -------
        tuple[Exercise, ...]
            The exercises; their numbers follow from the duct's own break.
        """
        with self._lock:
            pulled = self._pulled
            duct = GraspedDuct(pulled.model, pulled.grasp_wanted, pulled.threshold_wanted)
        return exercises_for(duct)

    def set_force(self, force: float) -> None:
        """Ask for a force; the pull grows or falls to it in the next steps.

        Parameters
        ----------
        force
            The grasper's whole force, N.
        """
        with self._lock:
            if self._pulled.takes(force):
                if force > 0.0:
                    self._begin_run()
                self._note("force", self._pulled.ask_force(force))

    def station_at(self, place: tuple[float, float, float]) -> float:
        """Return where along the duct a place in space is, for a hand to take hold there.

        Parameters
        ----------
        place
            mm from the first clamp along the clamps, sideways and along the pull, as
            `Reading.hook`.

        Returns
        -------
        float
            Station of the nearest point of the axis as it lies now, mm from the first clamp.
        """
        with self._lock:
            return self._pulled.grasped.station_at(np.array(place, dtype=np.float64))

    def grab(self, station: float) -> float | None:
        """Take the duct by hand, at a place and as far out as it is there.

        Parameters
        ----------
        station
            Distance from the first clamp, mm; the nearest in `grasp_range` is taken.

        Returns
        -------
        float | None
            Displacement of the duct there, mm, from which the hand goes on; None if nothing was
            taken hold of.
        """
        with self._lock:
            if not self._pulled.takes(station):
                return None
            self._begin_run()
            self._note("grab", self._pulled.grab(station))
            return self._pulled.control.deflection

    def hand_to(self, deflection: float) -> None:
        """Lead the hand that holds the duct; the grasp follows in the next steps.

        The hand sets the displacement, the beam answers with the force. A hook pulls and does not
        push: below zero the duct lies where it is at rest.

        Parameters
        ----------
        deflection
            Wanted displacement of the grasp along the pull, mm.
        """
        with self._lock:
            if self._pulled.takes(deflection):
                self._note("hand", self._pulled.lead_to(deflection))

    def hand_to_place(self, place: tuple[float, float, float]) -> None:
        """Lead the hand to a place in space.

        The beam bends in one plane, so of the hand's way only the part along the pull counts: what
        it moves along the clamps or sideways slides over the duct.

        Parameters
        ----------
        place
            mm from the first clamp along the clamps, sideways and along the pull, as
            `Reading.hook`.
        """
        with self._lock:
            dissection = self.dissection
            rest = dissection.axis_point(self.grasp) - dissection.axis_point(0.0)
            self.hand_to(float(place[2]) - float(rest @ dissection.frame[:, 2]))

    def let_go(self) -> None:
        """Let the duct spring back."""
        with self._lock:
            if self._pulled.tear is None and self._pulled.control.let_go():
                self._run.note("let-go")

    def set_grasp(self, grasp: float) -> None:
        """Ask for another grasp, taken with the next step.

        Parameters
        ----------
        grasp
            Distance from the first clamp, mm.
        """
        with self._lock:
            if self._pulled.takes(grasp):
                self._note("grasp", self._pulled.ask_grasp(grasp))

    def set_threshold(self, threshold: float) -> None:
        """Ask for another stress at which the duct tears, taken with the next step.

        Parameters
        ----------
        threshold
            Normal plus bending stress, MPa.
        """
        with self._lock:
            if self._pulled.takes(threshold):
                self._note("threshold", self._pulled.ask_threshold(threshold))

    def choose_preset(self, name: str) -> None:
        """Start anew with another preset; a torn duct is reset first, by `reset`.

        Parameters
        ----------
        name
            Name of the preset.

        Raises
        ------
        ValueError
            If there is none of that name, the organ is too short for it, or the theory ends before
            its break; nothing changes.
        """
        dissection = Dissection.of(self._organ, preset_named(name))
        model = Model.of(dissection, self.theory)
        with self._lock:
            if self._pulled.tear is None:
                self._start(model)

    def prepare_organ(self, organ: Organ) -> Callable[[], None]:
        """Prepare another organ, with this preset where the organ is long enough for it.

        Parameters
        ----------
        organ
            The organ.

        Returns
        -------
        Callable[[], None]
            Starts anew with the organ, at once; runs made before are gone, as they cannot be made
            again on it. To be called by whoever draws the session: the surfaces are others then.

        Raises
        ------
        ValueError
            If the organ cannot be clamped, or the theory ends before its break.
        """
        drawn = DrawnDuct(organ, self._vertices)
        preset = self.dissection.preset
        dissection = Dissection.of(organ, preset if fits(organ, preset) else default_preset(organ))
        model = Model.of(dissection, self.theory)

        def start() -> None:
            with self._lock:
                drawn.shape = self._drawn.shape
                self._organ, self._drawn = organ, drawn
                # The theory may have been changed meanwhile.
                same = model.theory == self.theory
                self._start(model if same else Model.of(dissection, self.theory))
                self._last_run = None

        return start

    def choose_theory(self, theory: Theory) -> None:
        """Solve the duct by another theory, with that theory's own threshold.

        Parameters
        ----------
        theory
            The theory.

        Raises
        ------
        ValueError
            If the theory ends before the preset's break; nothing changes.
        """
        # Outside the lock: a theory's first solution may have to be compiled.
        model = Model.of(self.dissection, theory)
        with self._lock:
            if model.dissection is not self.dissection:  # another duct was chosen meanwhile
                model = Model.of(self.dissection, theory)
            if self._pulled.tear is None:
                self._pulled.solve_by(model)
                if self._run.started:
                    self._run.note("theory", theory)
                else:
                    self._new_run(self._run.exercise, self._run.feedback)

    def choose_ghost(self, theory: Theory | None) -> None:
        """Lay the duct by another theory over this one, under the same load.

        Parameters
        ----------
        theory
            The other theory; None takes the ghost away.

        Raises
        ------
        ValueError
            If the theory ends before the preset's break; nothing changes.
        """
        model = None if theory is None else Model.of(self.dissection, theory)
        with self._lock:
            if model is not None and model.dissection is not self.dissection:
                model = Model.of(self.dissection, model.theory)
            self._ghost = None if model is None else Ghost(model, self._drawn.skin)
            self._pulled.touch()

    def show_chain(self, shown: bool) -> None:
        """Set the mass-spring chain beside the beam, or take it away.

        Parameters
        ----------
        shown
            Whether it shall be there.
        """
        with self._lock:
            if shown != (self._chain is not None):
                self._chain = self._new_chain() if shown else None
                self._pulled.touch()

    def start_exercise(self, exercise: Exercise, feedback: Feedback = Feedback.CONTINUOUS) -> None:
        """Start anew with an exercise; its time runs from the first pull.

        Parameters
        ----------
        exercise
            The exercise.
        feedback
            When the trainee sees the figures.
        """
        with self._lock:
            self.reset()
            self._new_run(exercise, feedback)

    def finish(self) -> None:
        """End the run as it stands; the duct stays as it is."""
        with self._lock:
            self._run.finish()

    def reset(self) -> None:
        """Let go of the duct and make it whole: the next pull starts a run without an exercise."""
        with self._lock:
            if self._pulled.reset():
                self._drawn.show_whole()
            self._new_run()

    def step(self, seconds: float) -> bool:
        """Advance the duct by as many ticks as real time asks for, and draw it.

        Parameters
        ----------
        seconds
            Real time since the last step, s.

        Returns
        -------
        bool
            Whether anything has changed since the last step, or is about to.
        """
        with self._lock:
            return self.advance(self._clock.ticks(seconds)) or self._pulled.moving

    def advance(self, ticks: int = 1) -> bool:
        """Advance the duct by a number of ticks, and draw it as it is then.

        Parameters
        ----------
        ticks
            How many.

        Returns
        -------
        bool
            Whether anything has changed.
        """
        with self._lock:
            changed = False
            for _ in range(ticks):
                changed |= self._tick()
            if changed:
                self._drawn.draw(self._pulled)
                if self.ghost is not None:
                    self.ghost.draw()
            return changed

    def reading(self) -> Reading:
        """Return what the instruments show now.

        Returns
        -------
        Reading
            The reading.
        """
        with self._lock:
            return self._pulled.reading()

    def ghost_reading(self) -> GhostReading | None:
        """Return what the ghost's theory says beside this one.

        Returns
        -------
        GhostReading | None
            The reading; None without a ghost, and where its theory ends before the load.
        """
        with self._lock:
            if self.ghost is None:
                return None
            control, grasped = self._pulled.control, self._pulled.grasped
            return self.ghost.reading(control.grip_force, grasped.pulled.deflection)

    def stress(self, out: NDArray[np.float32], surface: int = 0) -> NDArray[np.float32]:
        """Write the stress along the organ at each vertex of a surface.

        Normal plus bending stress by the beam; on the pieces of a tear what they carry until the
        front has crossed.

        Parameters
        ----------
        out
            (V,) receives the stress, MPa.
        surface
            Which of `surfaces`.

        Returns
        -------
        NDArray[np.float32]
            `out`.
        """
        with self._lock:
            return self._drawn.write_stress(self._pulled, surface, out)

    def curve(self, count: int = 80) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the chosen theory's force-deflection curve, past the break and past this pull.

        Parameters
        ----------
        count
            Number of points.

        Returns
        -------
        tuple[NDArray[np.float64], NDArray[np.float64]]
            (count,) deflections, mm, and (count,) forces, N; fewer where the theory ends.
        """
        with self._lock:
            duct, deepest = self._pulled.grasped, self._pulled.deepest
        return duct.curve(count, deepest=deepest)

    def measures(self) -> Measures:
        """Return the measures of this run so far.

        Returns
        -------
        Measures
            The measures.
        """
        with self._lock:
            return self._run.measures()

    def run_file(self) -> RunFile:
        """Return this run so far, to keep, download and replay.

        Returns
        -------
        RunFile
            The run, its measures and its outcome; a `ValueError` says if nothing was pulled yet.
        """
        with self._lock:
            return self._file(self._run)

    def last_run_file(self) -> RunFile | None:
        """Return the run before this one: a reset does not take its result away.

        Returns
        -------
        RunFile | None
            The run; None if there was none.
        """
        with self._lock:
            return None if self._last_run is None else self._file(self._last_run)

    def _start(self, model: Model) -> None:
        """Start anew with a model that has been found."""
        dissection = model.dissection
        self._pulled = PulledDuct(model, edge_length=self._drawn.edge_length, seed=self._seed)
        self._drawn.follow(dissection)
        if self._ghost is not None:
            theory, self._ghost = self._ghost.model.theory, None
            # A theory that ends before this duct's break has no ghost of it.
            with contextlib.suppress(NoEquilibrium):
                self._ghost = Ghost(Model.of(dissection, theory), self._drawn.skin)
        if self._chain is not None:
            self._chain = self._new_chain()
        self._new_run()

    def _new_run(
        self, exercise: Exercise | None = None, feedback: Feedback = Feedback.CONTINUOUS
    ) -> None:
        task_threshold = TASK_THRESHOLD * self._pulled.model.break_force
        if isinstance(exercise, HoldStretch):
            task_threshold = exercise.force_limit_N
        if self._run.started:
            self._run.finish()
            self._last_run = self._run
        self._run = Run(task_threshold, exercise, feedback)

    def _file(self, run: Run) -> RunFile:
        log = run.log(OrganIdentity.of(self._organ), self._seed)
        return RunFile.of(log, run.measures(), run.outcome)

    def _begin_run(self) -> None:
        """Start the run's clock with the first pull, on a duct that nothing was done to before."""
        if self._run.started or self._run.over:
            return
        model, pulled = self._pulled.model, self._pulled
        self._run.start(
            StartingPoint(
                model.dissection.preset.name,
                model.theory,
                pulled.grasp_wanted,
                pulled.threshold_wanted,
            )
        )
        pulled.renew()

    def _note(self, kind: InputKind, wish: float | None) -> None:
        if wish is not None:
            self._run.note(kind, wish)

    def _new_chain(self) -> SwingingChain:
        grasped = self._pulled.grasped
        chain = SwingingChain(self.dissection.beam, grasped.grasp)
        chain.start_from(grasped.pulled.deflection)
        return chain

    def _tick(self) -> bool:
        """Advance by one tick without drawing."""
        pulled, was_whole = self._pulled, self._pulled.tear is None
        place = pulled.grasped.grasp
        changed = pulled.tick()
        if not was_whole:
            return changed
        control, grasped, tear = pulled.control, pulled.grasped, pulled.tear
        if grasped.grasp != place:
            self._run.regrasp()
        if self._ghost is not None and changed:
            self._ghost.follow(grasped.grasp, control.load)
        if self._chain is not None:
            if self._chain.grasp != grasped.grasp:
                self._chain = self._new_chain()
            free = control.mode == "free"
            changed |= self._chain.advance(Load("force", 0.0) if free else control.load)
        if self._run.going:
            self._run.take(
                control.grip_force if tear is None else tear.event.force,
                grasped.pulled.deflection,
                grasped.hook(),
                grasped.check.distance_to_break,
                came_from=pulled.came_from,
                held=control.holds,
                torn=None if tear is None else tear.event,
            )
        if tear is not None:
            self._drawn.show(tear.surfaces)
        return changed
