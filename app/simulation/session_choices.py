"""What a trainee chooses: duct, organ, theory, what is set beside the duct, and exercises."""

from collections.abc import Callable

from app.simulation.dissection import Dissection, default_preset, fits
from app.simulation.drawn_duct import DrawnDuct
from app.simulation.exercise import Exercise, ExerciseInputs
from app.simulation.exercise_course import exercises_for
from app.simulation.feedback import Feedback
from app.simulation.ghost import Ghost
from app.simulation.grasped_duct import GraspedDuct
from app.simulation.model import Model
from app.simulation.preset import OrganBeam, Preset, preset_named, presets
from app.simulation.session_hand import HandledSession
from organ_geometry import Organ
from physics import Theory

__all__ = ["ChosenSession"]


class ChosenSession(HandledSession):
    """A session whose duct, theory and exercise can be chosen; each choice starts anew.

    Made with the parameters of a `SessionState`.
    """

    def presets_offered(self) -> list[Preset]:
        """Return the presets that this organ can be clamped for, and one of one's own in use."""
        shipped = [preset for preset in presets().values() if fits(self._organ, preset)]
        own = self.dissection.preset
        return shipped if own.ships else [*shipped, own]

    def exercises_offered(self) -> tuple[Exercise, ...]:
        """Return the exercises for this duct, with `task_grasp` and the present threshold."""
        with self._lock:
            pulled = self._pulled
            duct = GraspedDuct(pulled.model, self.task_grasp, pulled.threshold_wanted)
        return exercises_for(duct)

    def choose_preset(self, preset: Preset | str) -> None:
        """Start anew with another preset; a torn duct is reset first, by `reset`."""
        chosen = preset_named(preset) if isinstance(preset, str) else preset
        dissection = Dissection.of(self._organ, chosen)
        model = Model.of(dissection, self.theory)
        with self._lock:
            if self._pulled.tear is None:
                self._start(model)

    def prepare_organ(self, organ: Organ) -> Callable[[], None]:
        """Prepare another organ, solved by its own sections."""
        drawn = DrawnDuct(organ, self._vertices)
        preset = self.dissection.preset
        if preset.beam != OrganBeam():  # a bar, or a wall and clamps of the organ before
            preset = default_preset(organ)
        dissection = Dissection.of(organ, preset)
        model = Model.of(dissection, self.theory)

        def start() -> None:
            with self._lock:
                drawn.shape = self._drawn.shape
                self._organ, self._drawn = organ, drawn
                # The theory may have been changed meanwhile.
                same = model.theory == self.theory
                self._start(model if same else Model.of(dissection, self.theory))
                self._last_run = None
                self._tries.clear()

        return start

    def choose_theory(self, theory: Theory) -> None:
        """Solve the duct by another theory, with that theory's own threshold."""
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
                    self._new_run(self._run.exercise, self._run.feedback, self._run.exercise_inputs)

    def choose_ghost(self, theory: Theory | None) -> None:
        """Lay the duct by another theory over this one, under the same load."""
        model = None if theory is None else Model.of(self.dissection, theory)
        with self._lock:
            if model is not None and model.dissection is not self.dissection:
                model = Model.of(self.dissection, model.theory)
            self._ghost = None if model is None else Ghost(model, self._drawn.skin)
            self._pulled.touch()

    def show_chain(self, shown: bool) -> None:
        """Set the mass-spring chain beside the beam, or take it away."""
        with self._lock:
            if shown != (self._chain is not None):
                self._chain = self._new_chain() if shown else None
                self._pulled.touch()

    def start_exercise(
        self,
        exercise: Exercise,
        feedback: Feedback = Feedback.CONTINUOUS,
        grasp: float | None = None,
        inputs: ExerciseInputs = "hand",
    ) -> None:
        """Start anew with an exercise; its time runs from the first pull."""
        with self._lock:
            self.reset()
            if grasp is not None:
                self.set_grasp(grasp)
            self._new_run(exercise, feedback, inputs)
            self._task_grasp = self.grasp

    def finish(self) -> None:
        """End the run as it stands; the duct stays as it is."""
        with self._lock:
            self._run.finish()

    def reset(self) -> None:
        """Let go of the duct and make it whole: the next pull starts a run without an exercise.

        The grasp of an exercise goes back to where the exercise was started.
        """
        with self._lock:
            if self._pulled.reset():
                self._drawn.show_whole()
            if self._task_grasp is not None:
                self._pulled.ask_grasp(self._task_grasp)
                self._task_grasp = None
            self._new_run()
