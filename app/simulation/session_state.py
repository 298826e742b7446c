"""What a session holds: its duct, what is set beside it and its runs; and how each begins anew."""

import contextlib
from collections import deque
from threading import RLock

import numpy as np
from numpy.typing import NDArray

from app.simulation.clock import Clock
from app.simulation.dissection import Dissection, default_preset
from app.simulation.drawn_duct import DrawnDuct
from app.simulation.exercise import Exercise, ExerciseInputs
from app.simulation.exercise_course import goal_band
from app.simulation.feedback import Feedback
from app.simulation.ghost import Ghost
from app.simulation.grasped_duct import GraspedDuct
from app.simulation.model import Model
from app.simulation.preset import Preset
from app.simulation.pulled_duct import PulledDuct
from app.simulation.reading import Surface
from app.simulation.run import Run
from app.simulation.swinging_chain import SwingingChain
from organ_geometry import Organ
from physics import Cubic, NoEquilibrium, Theory

__all__ = ["VERTICES", "SessionState"]

VERTICES = 5000
"""Vertices of the skin, about: what a browser without a graphics card still draws smoothly."""
TASK_THRESHOLD = 0.5
"""Force above which a run's time is counted, in forces at break with a grasp in the middle."""
MOST_TRIES = 20
"""Exercises that are kept beside the last run, to be compared with."""


class SessionState:
    """A session's duct and runs, to look at.

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
        self._tries: deque[Run] = deque(maxlen=MOST_TRIES)
        self._task_grasp: float | None = None
        self._goal: tuple[Exercise, GraspedDuct, tuple[float, float] | None] | None = None
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
    def task_grasp(self) -> float:
        """Where the grasp is that exercises are set for, mm from the first clamp.

        An exercise that was started keeps the one it was started with, wherever the hand takes
        hold, until the duct is reset or, once the exercise is over, another grasp is asked for.
        """
        return self.grasp if self._task_grasp is None else self._task_grasp

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
    def given_threshold(self) -> float:
        """Stress at which the duct tears by its preset, in the chosen theory, MPa."""
        return self._pulled.model.threshold

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
    def goal(self) -> tuple[float, float] | None:
        """Deflections between which the goal of the exercise lies, with the present grasp, mm.

        None without an exercise that waits or goes on, and for one without such a goal.
        """
        with self._lock:
            run, duct = self._run, self._pulled.grasped
            if run.exercise is None or run.over:
                return None
            if self._goal is None or self._goal[:2] != (run.exercise, duct):
                self._goal = run.exercise, duct, goal_band(run.exercise, duct)
            return self._goal[2]

    @property
    def seed(self) -> int:
        """What chooses the raggedness of the torn rim."""
        return self._seed

    @property
    def tear_front(self) -> float | None:
        """How far the tear has run (`tear_course.front`); None while the duct is whole."""
        tear = self._pulled.tear
        return None if tear is None else tear.front

    def _start(self, model: Model) -> None:
        """Start anew with a model that has been found."""
        dissection, self._task_grasp = model.dissection, None
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
        self,
        exercise: Exercise | None = None,
        feedback: Feedback = Feedback.CONTINUOUS,
        inputs: ExerciseInputs = "any",
    ) -> None:
        task_threshold = TASK_THRESHOLD * self._pulled.model.break_force
        if exercise is not None:
            task_threshold = exercise.limits.get("maximum_force_N", task_threshold)
        if self._run.started:
            self._run.finish()
            self._last_run = self._run
            if self._run.outcome is not None:
                self._tries.append(self._run)
        self._run = Run(task_threshold, exercise, feedback, inputs)

    def _new_chain(self) -> SwingingChain:
        grasped = self._pulled.grasped
        chain = SwingingChain(self.dissection.beam, grasped.grasp)
        chain.start_from(grasped.pulled.deflection)
        return chain
