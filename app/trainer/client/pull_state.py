"""Pull: a page that shows a duct without a bed, its choices, and the run that it replays."""

from collections.abc import Callable

import viser

from app.simulation import (
    VERTICES,
    Exercise,
    ExerciseInputs,
    Feedback,
    Phase,
    Preset,
    Replay,
    RunFile,
    Session,
    read_run,
)
from app.trainer.client.client_state import FORCE_KEY, ClientState, Workers
from app.trainer.scene.drag_proxy import Hold
from organ_geometry import Organ

__all__ = ["HAND_ONLY", "PullState"]

PAST_BREAK = 1.05
"""Target of a ramp to the tear, over the force at break."""
COUNTED: dict[ExerciseInputs, str] = {
    "hand": "your hand only: drag the duct or the hook until its upper edge is in the blue band.",
    "any": "your hand, sliders or keys: your teacher lets them count, and the run says so.",
}
HAND_ONLY = "In this exercise only your hand counts: drag the duct or the hook."


class PullState(ClientState):
    """What the parts of a page share while it shows a duct without a bed.

    `heat` and `overlay` are the client's choices: stress on the surface, the model's points.
    `exercise_inputs` says which inputs count in exercises.
    """

    first_input = "pull"

    def __init__(
        self,
        client: viser.ClientHandle,
        session: Session,
        workers: Workers,
        exercise_inputs: ExerciseInputs = "hand",
    ) -> None:
        super().__init__(client, session, workers)
        self.exercise_inputs: ExerciseInputs = exercise_inputs
        self.counted = COUNTED[exercise_inputs]
        self.heat = self.overlay = False
        self.pulls = 0  # number of changes of the pull that no slider has made
        self._held_from: float | None = None
        self._other_organ: Callable[[], None] | None = None
        self.keep_run()

    def show(
        self,
        *,
        heat: bool | None = None,
        overlay: bool | None = None,
        plain: bool | None = None,
    ) -> None:
        """Choose what is shown; None leaves a choice as it is."""
        self.heat = self.heat if heat is None else heat
        self.overlay = self.overlay if overlay is None else overlay
        super().show(plain=plain)

    def read_run(self, content: bytes) -> RunFile:
        """Return the run in a file; a `ValueError` if it is not one of this mode."""
        run = read_run(content)
        if run.log.start.in_bed:
            raise ValueError(
                "This run is a dissection. Choose Dissect at the top, and open it there."
            )
        return run

    def replay_of(self, run: RunFile, *, vertices: int = VERTICES) -> Replay:
        """Return a replay of a run, whose skin has about so many vertices."""
        return Replay(run.log, self.session.tissue.dissection.organ, vertices=vertices)

    def reset(self) -> None:
        """Make the duct whole and bring the view home; the next pull starts a run."""
        self._renew(self.session.reset)
        self.pulls += 1
        self.bring_home()

    def practise_on(self, organ: Organ) -> None:
        """Ask for another organ; the next `take_organ` starts anew on it."""
        self.require_no_exercise()
        self._other_organ = self.session.prepare_organ(organ)

    def choose_preset(self, preset: Preset) -> None:
        """Start anew with another duct."""
        self.require_no_exercise()
        self.keep_run()
        self.session.choose_preset(preset)
        self.pulls += 1

    def take_organ(self) -> None:
        """Start anew on the organ asked for, if there is one; called by the thread that draws."""
        start, self._other_organ = self._other_organ, None
        if start is None or self.in_exercise:
            return
        self.leave_replay()
        self._held_from = None
        start()
        self.last_run = None
        self.pulls += 1
        self.paused = False
        self._changed = True

    def offers_follow_from(self) -> object:
        """Return what the exercises offered depend on."""
        session = self.session
        duct = session.planar
        return duct.dissection, duct.theory, session.task_grasp, duct.threshold

    def start_again(self, run: RunFile) -> None:
        """Start the exercise of a run again."""
        if run.log.exercise is not None:
            self.start_exercise(run.log.exercise, run.log.feedback, run.log.start.grasp_mm)

    def start_exercise(
        self, exercise: Exercise, feedback: Feedback, grasp: float | None = None
    ) -> None:
        """Start anew with an exercise."""
        self.leave_replay()
        session, inputs = self.session, self.exercise_inputs
        self._renew(lambda: session.start_exercise(exercise, feedback, grasp, inputs))
        self.pulls += 1

    def grab_by_device(self) -> bool:
        """Grab the duct with the device's hand, at the hook; return whether it holds."""
        self._begin_anew(True)
        return self.session.grab(0, self.session.planar.grasp) is not None

    def set_target_force(self, force: float) -> None:
        """Pull with the slider's force; once a run is over, this starts a new one."""
        if self.playback is None and not self._refuses_mouse() and not self._refuses_force():
            renewed = self._begin_anew(force > 0.0)
            self.session.set_target_force(force)
            # Counted after the force is set: before, the slider would go back to zero.
            self.pulls += renewed

    def ramp_to_tear(self) -> None:
        """Pull at a constant rate until the duct tears."""
        if self.playback is not None or self._refuses_mouse() or self._refuses_force():
            return
        self._begin_anew(True)
        event = self.session.reading().breaks_at
        if event is not None:
            self.session.set_target_force(PAST_BREAK * event.force)
            self.paused = False
        self.pulls += 1

    def grab(self, hold: Hold) -> None:
        """Grab the duct by hand."""
        if self.playback is not None or self._refuses_mouse():
            return
        session = self.session
        if session.reading().phase is not Phase.INTACT:
            self.refuse("A torn duct holds no pull. Press Reset (R) for a new one.")
            return
        self._begin_anew(True)
        station = session.planar.grasp if hold.station is None else hold.station
        held = session.grab(0, station)
        self._held_from = None if held is None else held[2]
        self.move_hand(hold)

    def move_hand(self, hold: Hold) -> None:
        """Move the hand that has grabbed the duct."""
        if self._held_from is not None:
            self.session.move_hand(0, (0.0, 0.0, self._held_from + float(hold.moved[2])))

    def release_hand(self) -> None:
        """Release the duct, if a hand holds it."""
        if self._held_from is not None:
            self._held_from = None
            self.release()

    def release(self) -> None:
        """Release the duct from the hand or the force."""
        self.session.release()
        self.pulls += 1

    def _device_words(self, device: str, hands: int) -> tuple[str, str]:
        more = " It is the first one's; the second one waits." if hands > 1 else ""
        return "The device holds the hook", f"{device}: pull up to pull the duct.{more} {FORCE_KEY}"

    def _refuses_mouse(self) -> bool:
        """Return whether a device has the hook; then tell the client so."""
        if self.device is not None:
            self.refuse(f"The hand on the device has the hook ({self.device}).")
            return True
        return False

    def _refuses_force(self) -> bool:
        """Return whether only the hand counts now; then tell the client so."""
        if self.session.run.hand_only:
            self.refuse(HAND_ONLY)
            return True
        return False

    def _begin_anew(self, pulls: bool) -> bool:
        """Reset for a new run when the end of the last one was told and the duct is still whole."""
        session = self.session
        told = session.run.over and not self.has_end_to_tell
        renew = pulls and told and session.reading().phase is Phase.INTACT
        if renew:
            self._renew(session.reset)
        return renew
