"""A session: one trainee's duct, its inputs, its state and its steps in time. No viewer in it."""

import math
from threading import RLock

import numpy as np
from numpy.typing import NDArray

from app.simulation.clock import Clock
from app.simulation.dissection import Dissection, default_preset, fits
from app.simulation.exercise import Exercise, Feedback, HoldStretch, Outcome
from app.simulation.exercise_course import exercises_for
from app.simulation.ghost import Ghost, GhostReading
from app.simulation.grasped_duct import GraspedDuct, Load
from app.simulation.measures import Measures
from app.simulation.model import Model
from app.simulation.preset import Preset, preset_named, presets
from app.simulation.pull_control import PullControl
from app.simulation.reading import Phase, Reading, Surface
from app.simulation.run import Run, StartingPoint
from app.simulation.run_log import OrganIdentity, RunFile
from app.simulation.surface_stress import SurfaceStress
from app.simulation.swinging_chain import SwingingChain
from app.simulation.tear import Tear
from organ_geometry.organ import Organ
from organ_geometry.skin import organ_skin
from physics import BreakEvent, Cubic, NoEquilibrium, Theory

__all__ = ["VERTICES", "Phase", "Reading", "Session", "Surface"]

VERTICES = 5000
"""Vertices of the skin, about: what a browser without a graphics card still draws smoothly."""
GRASP_MARGIN = 0.1
"""Part of the span next to each clamp where the grasper finds no room."""
THRESHOLD_RANGE = (0.25, 2.0)
"""How far the threshold may be moved, in thresholds of the preset."""
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
        self._organ, self._seed = organ, seed
        walls = 2 if organ.hollow else 1
        area = walls * 2.0 * math.pi * organ.mean_radius * organ.length
        self._edge_length = min(math.sqrt(area / vertices), organ.mean_radius)
        self._skin = organ_skin(organ, edge_length=self._edge_length)
        self._shape = 0
        self._ghost: Ghost | None = None
        self._chain: SwingingChain | None = None
        dissection = Dissection.of(organ, preset or default_preset(organ))
        self._start(Model.of(dissection, Cubic()))

    @property
    def dissection(self) -> Dissection:
        """The dissection of the chosen preset."""
        return self._model.dissection

    @property
    def theory(self) -> Theory:
        """The chosen theory."""
        return self._model.theory

    @property
    def grasp(self) -> float:
        """Distance of the grasp from the first clamp that was asked for, mm."""
        return self._grasp_wanted

    @property
    def grasp_range(self) -> tuple[float, float]:
        """Where the grasper can hold, mm from the first clamp."""
        span = self._model.dissection.beam.span
        return GRASP_MARGIN * span, (1.0 - GRASP_MARGIN) * span

    @property
    def force_wanted(self) -> float:
        """Force that the pull grows or falls to, N."""
        return self._control.force_wanted

    @property
    def force_limit(self) -> float:
        """Largest force the grasper gives, N."""
        return self._model.force_limit

    @property
    def deflection_limit(self) -> float:
        """Largest deflection that a hand can ask for, mm."""
        with self._lock:
            return self._duct.deflection_limit

    @property
    def threshold(self) -> float:
        """Stress at which the duct tears that was asked for, MPa."""
        return self._threshold_wanted

    @property
    def threshold_range(self) -> tuple[float, float]:
        """How far the threshold may be moved, MPa."""
        low, high = THRESHOLD_RANGE
        return low * self._model.threshold, high * self._model.threshold

    @property
    def stress_range(self) -> tuple[float, float]:
        """Ends of the scale of stress on the surface, MPa: none, and the threshold."""
        return 0.0, self._threshold_wanted

    @property
    def shape(self) -> int:
        """Number that changes whenever `surfaces` are others than before."""
        return self._shape

    @property
    def surfaces(self) -> tuple[Surface, ...]:
        """The closed surfaces to draw."""
        return self._surfaces

    @property
    def ghost(self) -> Ghost | None:
        """The other theory's duct, while this one is whole."""
        return self._ghost if self._tear is None else None

    @property
    def chain(self) -> SwingingChain | None:
        """The chain of masses and springs beside the duct, while this one is whole."""
        return self._chain if self._tear is None else None

    @property
    def time(self) -> float:
        """Time since the first pull of this run, s; it stands still once the run is over."""
        return self._run.seconds

    @property
    def ticks(self) -> int:
        """The same in ticks."""
        return self._run.ticks

    @property
    def run_over(self) -> bool:
        """Whether the run is over: by a tear, by its exercise or by `finish`."""
        return self._run.over

    @property
    def exercise(self) -> Exercise | None:
        """The exercise of this run."""
        return self._run.exercise

    @property
    def progress(self) -> float:
        """How far the exercise has come, 0 to 1."""
        return self._run.progress

    @property
    def outcome(self) -> Outcome | None:
        """How the exercise has ended; None while it goes and without one."""
        return self._run.outcome

    @property
    def feedback_visible(self) -> bool:
        """Whether the trainee is to see the figures now."""
        return self._run.feedback_visible

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
            duct = GraspedDuct(self._model, self._grasp_wanted, self._threshold_wanted)
        return exercises_for(duct)

    def set_force(self, force: float) -> None:
        """Ask for a force; the pull grows or falls to it in the next steps.

        Parameters
        ----------
        force
            The grasper's whole force, N.
        """
        with self._lock:
            if self._tear is None and math.isfinite(force):
                wanted = min(max(float(force), 0.0), self._model.force_limit)
                self._begin_run(wanted > 0.0)
                if self._control.pull_with(wanted):
                    self._run.note("force", wanted)

    def grab(self, station: float) -> None:
        """Take the duct by hand, at a place and as far out as it is there.

        Parameters
        ----------
        station
            Distance from the first clamp, mm; the nearest in `grasp_range` is taken.
        """
        with self._lock:
            if self._tear is None and math.isfinite(station):
                self._begin_run(True)
                low, high = self.grasp_range
                self._grasp_wanted = min(max(float(station), low), high)
                self._control.grab(max(0.0, self._duct.across(self._grasp_wanted)))
                self._run.note("grab", self._grasp_wanted)

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
            if self._tear is None and math.isfinite(deflection):
                wanted = min(max(float(deflection), 0.0), self._duct.deflection_limit)
                if self._control.lead_to(wanted):
                    self._run.note("hand", wanted)

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
            self.hand_to(float(place[2]) - self._duct.hook_at_rest[2])

    def let_go(self) -> None:
        """Let the duct spring back."""
        with self._lock:
            if self._tear is None and self._control.let_go():
                self._run.note("let-go")

    def set_grasp(self, grasp: float) -> None:
        """Ask for another grasp, taken with the next step.

        Parameters
        ----------
        grasp
            Distance from the first clamp, mm.
        """
        with self._lock:
            if self._tear is None and math.isfinite(grasp):
                low, high = self.grasp_range
                wanted = min(max(float(grasp), low), high)
                if wanted != self._grasp_wanted:
                    self._grasp_wanted = wanted
                    self._run.note("grasp", wanted)

    def set_threshold(self, threshold: float) -> None:
        """Ask for another stress at which the duct tears, taken with the next step.

        Parameters
        ----------
        threshold
            Normal plus bending stress, MPa.
        """
        with self._lock:
            if self._tear is None and math.isfinite(threshold):
                low, high = self.threshold_range
                wanted = min(max(float(threshold), low), high)
                if wanted != self._threshold_wanted:
                    self._threshold_wanted = wanted
                    self._run.note("threshold", wanted)

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
        model = Model.of(dissection, self._model.theory)
        with self._lock:
            if self._tear is None:
                self._start(model)

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
        model = Model.of(self._model.dissection, theory)
        with self._lock:
            if self._tear is None:
                self._model = model
                self._threshold_wanted = model.threshold
                control = self._control
                control.force_wanted = min(control.force_wanted, model.force_limit)
                if control.mode == "force":
                    control.force = min(control.force, model.force_limit)
                self._deepest = 0.0
                self._refresh()
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
        model = None if theory is None else Model.of(self._model.dissection, theory)
        with self._lock:
            self._ghost = None if model is None else Ghost(model, self._skin)
            self._stale = True

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
                self._stale = True

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
            self._control = PullControl()
            self._deepest = 0.0
            if self._tear is not None:
                self._tear = None
                self._show_whole()
            self._stale = True
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
            return self.advance(self._clock.ticks(seconds)) or self._moving

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
                self._draw()
            return changed

    def reading(self) -> Reading:
        """Return what the instruments show now.

        Returns
        -------
        Reading
            The reading.
        """
        with self._lock:
            tear, control, duct = self._tear, self._control, self._duct
            phase, shown = Phase.INTACT, 1.0
            force, breaks_at = control.grip_force, duct.breaks_at
            if tear is not None:
                phase, breaks_at = tear.phase, tear.event
                shown = 1.0 if phase is Phase.TEARING else 0.0
                force = tear.event.force if phase is Phase.TEARING else 0.0
            return Reading(
                phase=phase,
                force=force,
                deflection=shown * duct.pulled.deflection,
                check=duct.check,
                breaks_at=breaks_at,
                deepest=self._deepest,
                hook=duct.hook(shown),
                held=phase is not Phase.TORN and control.holds,
                by_hand=phase is not Phase.TORN and control.mode == "hand",
            )

    def ghost_reading(self) -> GhostReading | None:
        """Return what the ghost's theory says beside this one.

        Returns
        -------
        GhostReading | None
            The reading; None without a ghost, and where its theory ends before the load.
        """
        with self._lock:
            if self._ghost is None or self._tear is not None:
                return None
            return self._ghost.reading(self._control.grip_force, self._duct.pulled.deflection)

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
            if self._stress is None:
                self._stress = tuple(
                    SurfaceStress(self._model.dissection, each.skin) for each in self._surfaces
                )
            part = 1.0 if self._tear is None else self._tear.carried
            return self._stress[surface].write(self._duct.pulled, out, part=part)

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
            duct, deepest = self._duct, self._deepest
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
            log = self._run.log(OrganIdentity.of(self._organ), self._seed)
            return RunFile.of(log, self._run.measures(), self._run.outcome)

    def _start(self, model: Model) -> None:
        """Start anew with a model that has been found."""
        self._model = model
        self._bound = self._skin.bound_to(model.dissection.driving)
        self._transforms = model.dissection.rest_transforms()
        self._grasp_wanted = 0.5 * model.dissection.beam.span
        self._threshold_wanted = model.threshold
        self._control = PullControl()
        self._deepest = 0.0
        self._tear: Tear | None = None
        self._show_whole()
        if self._ghost is not None:
            theory, self._ghost = self._ghost.model.theory, None
            try:
                self._ghost = Ghost(Model.of(model.dissection, theory), self._skin)
            except NoEquilibrium:  # a theory that ends before this duct's break has no ghost
                pass
        self._refresh()
        if self._chain is not None:
            self._chain = self._new_chain()
        self._new_run()

    def _new_run(
        self, exercise: Exercise | None = None, feedback: Feedback = Feedback.CONTINUOUS
    ) -> None:
        task_threshold = TASK_THRESHOLD * self._model.break_force
        if isinstance(exercise, HoldStretch):
            task_threshold = exercise.force_limit_N
        self._run = Run(task_threshold, exercise, feedback)

    def _begin_run(self, pulls: bool) -> None:
        """Start the run's clock with the first pull, on a duct that nothing was done to before."""
        if pulls and not self._run.started and not self._run.over:
            name = self._model.dissection.preset.name
            self._run.start(
                StartingPoint(name, self._model.theory, self._grasp_wanted, self._threshold_wanted)
            )
            # A fresh duct: what its solver was last asked for must not show in the run's last bits.
            if self._wishes_pending:
                self._duct = GraspedDuct(self._model, self._grasp_wanted, self._threshold_wanted)
            else:
                self._duct = self._duct.renewed()
            self._stale = True

    def _new_chain(self) -> SwingingChain:
        chain = SwingingChain(self._model.dissection.beam, self._duct.grasp)
        chain.start_from(self._duct.pulled.deflection)
        return chain

    def _refresh(self) -> None:
        """Bring what depends on the inputs up to date; where the law ends, give way."""
        self._duct = GraspedDuct(self._model, self._grasp_wanted, self._threshold_wanted)
        self._hold_where_it_carries()

    def _hold_where_it_carries(self) -> None:
        self._stale = True
        load = self._control.load
        while True:
            try:
                self._duct.bear(load)
            except NoEquilibrium:
                load = self._control.ease()
            else:
                self._felt()
                return

    def _felt(self) -> None:
        pulled = self._duct.pulled
        self._control.felt(pulled.force, pulled.deflection)
        self._deepest = max(self._deepest, pulled.deflection)

    @property
    def _moving(self) -> bool:
        """Whether the next tick will change something."""
        if self._tear is not None:
            return not self._tear.settled
        return self._stale or not self._control.at_rest or self._wishes_pending

    @property
    def _wishes_pending(self) -> bool:
        duct = self._duct
        return (self._grasp_wanted, self._threshold_wanted) != (duct.grasp, duct.threshold)

    def _tick(self) -> bool:
        """Advance by one tick without drawing."""
        if self._tear is not None:
            changed = not self._tear.settled
            if changed:
                self._tear.advance()
                if self._tear.phase is Phase.TORN:
                    self._control = PullControl()
            return changed
        changed, event = self._pull()
        if self._chain is not None:
            if self._chain.grasp != self._duct.grasp:
                self._chain = self._new_chain()
            free = self._control.mode == "free"
            changed |= self._chain.advance(Load("force", 0.0) if free else self._control.load)
        if self._run.going:
            control, duct = self._control, self._duct
            self._run.take(
                control.grip_force,
                duct.pulled.deflection,
                duct.hook(),
                duct.check.distance_to_break,
                held=control.holds,
                torn=event,
            )
        return changed

    def _pull(self) -> tuple[bool, BreakEvent | None]:
        """Advance the pull by one tick; return whether it moved and what broke."""
        control = self._control
        if self._wishes_pending:
            if self._grasp_wanted != self._duct.grasp:
                self._deepest = 0.0
                self._run.regrasp()
            self._refresh()
        if control.at_rest and not self._stale:
            return False, None
        self._stale = False
        duct, deepest = self._duct, self._deepest
        before = control.force, control.deflection
        try:
            duct.bear(control.advance(self._model.force_per_second))
        except NoEquilibrium:  # as far as the law carries
            control.stop_at(*before)
            return True, None
        self._felt()
        event = self._tear_duct(before, deepest) if duct.check.broken else None
        if self._ghost is not None:
            self._ghost.follow(duct.grasp, control.load)
        return True, event

    def _tear_duct(self, before: tuple[float, float], deepest: float) -> BreakEvent:
        """Tear the duct at the load that met the criterion, between the last tick and this."""
        control, duct, event = self._control, self._duct, self._duct.breaks_at
        if event is not None:
            force, deflection = before
            control.force = min(max(event.force, force), control.force)
            control.deflection = min(max(event.deflection, deflection), control.deflection)
        duct.bear(control.load)
        self._deepest = deepest
        self._felt()
        broken = BreakEvent(control.force, duct.pulled.deflection, duct.check)
        self._tear = Tear(
            self._model.dissection,
            duct.driven,
            broken,
            edge_length=self._edge_length,
            seed=self._seed,
        )
        self._surfaces = self._tear.surfaces
        self._stress = None
        self._shape += 1
        return broken

    def _draw(self) -> None:
        """Write the vertices of what is to be seen."""
        if self._tear is not None:
            self._tear.draw(self._transforms)
            return
        self._bound.deform(
            self._model.dissection.move(self._duct.driven, self._transforms),
            self._surfaces[0].vertices,
        )
        if self._ghost is not None:
            self._ghost.draw()

    def _show_whole(self) -> None:
        self._surfaces = (Surface("skin", self._skin, self._skin.vertices.copy()),)
        self._stress: tuple[SurfaceStress, ...] | None = None
        self._shape += 1
        self._stale = True
