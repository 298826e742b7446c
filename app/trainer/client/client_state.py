"""What one client's page is showing: its session, its choices, and the run that it replays."""

import threading
from collections.abc import Callable, Generator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field

import viser

from app.compression.build_process import BuildProcess
from app.simulation import Exercise, ExerciseInputs, Feedback, Phase, RunFile, Session
from app.trainer.client.background_worker import BackgroundWorker
from app.trainer.client.replay_playback import ReplayPlayback
from app.trainer.scene.drag_proxy import Hold
from organ_geometry import Organ

__all__ = ["HAND_ONLY", "ClientState", "Workers", "explained"]

PAST_BREAK = 1.05
"""Target of a ramp to the tear, over the force at break."""
HAND_ONLY = "In this exercise only your hand counts: drag the duct or the hook."
PATIENCE = 0.4
"""s of waiting after which the client is told what is being done."""


@dataclass(frozen=True, slots=True)
class Workers:
    """Threads and a process that do the slow work of all clients."""

    # solves what no client waits for
    background: BackgroundWorker = field(default_factory=BackgroundWorker)
    # builds organs, which takes seconds, one client's after the other's
    builder: BackgroundWorker = field(default_factory=BackgroundWorker)
    # runs the builder's work, so that it can be cancelled
    build_process: BuildProcess = field(default_factory=BuildProcess)

    def stop(self) -> None:
        """End them."""
        self.background.stop()
        self.build_process.stop()
        self.builder.stop()


class ClientState:
    """What the parts of one client's page share. Its methods may be called by any thread.

    `heat`, `overlay` and `plain` are the client's choices: stress on the surface, the model's
    points, the simple picture. `exercise_inputs` says which inputs count in exercises.
    """

    def __init__(
        self,
        client: viser.ClientHandle,
        session: Session,
        workers: Workers,
        exercise_inputs: ExerciseInputs = "hand",
    ) -> None:
        self.exercise_inputs: ExerciseInputs = exercise_inputs
        self.client, self.session = client, session
        self.workers = workers
        self.heat = self.overlay = self.plain = False
        self.pulls = 0  # number of changes of the pull that no slider has made
        # the last run that ended or was given up, to be judged and replayed
        self.last_run: RunFile | None = None
        self.device: str | None = None  # the haptic device that holds the hook, or None
        self._device_notice: viser.NotificationHandle | None = None
        self._playback: ReplayPlayback | None = None
        self._paused = False
        self._held_from: float | None = None
        self._other_organ: Callable[[], None] | None = None
        self._changed = True
        self._home = False
        self._refusal: viser.NotificationHandle | None = None
        self.keep_run()

    @property
    def playback(self) -> ReplayPlayback | None:
        """The replay that is shown in place of the session, or None."""
        return self._playback

    @property
    def shown(self) -> Session:
        """The session that is shown: the client's own, or the replay's."""
        playback = self._playback
        return self.session if playback is None else playback.session

    @property
    def figures_visible(self) -> bool:
        """Whether the trainee may see the figures now."""
        return self._playback is not None or self.session.run.feedback_visible

    @property
    def in_exercise(self) -> bool:
        """Whether an exercise waits for its first pull or goes on."""
        run = self.session.run
        return run.exercise is not None and not run.over

    @property
    def paused(self) -> bool:
        """Whether the session's time stands still."""
        return self._paused

    def take_change(self) -> bool:
        """Return whether the client's choices have changed since the last call."""
        changed, self._changed = self._changed, False
        return changed

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
        self.plain = self.plain if plain is None else plain
        self._changed = True

    def set_paused(self, paused: bool) -> None:
        """Stop or continue the session's time; an exercise cannot be paused."""
        if paused and self.in_exercise:
            self.refuse("An exercise goes on until it is over. Stop it first.")
            return
        self._paused = paused
        self._changed = True

    def keep_run(self) -> None:
        """Keep the run so far as the last one, if anything was pulled."""
        with suppress(ValueError):  # nothing was pulled
            self.last_run = self.session.run_file()

    def bring_home(self) -> None:
        """Ask for the camera to show the whole duct again."""
        self._home = True

    def take_home(self) -> bool:
        """Return whether `bring_home` was called since the last call."""
        wanted, self._home = self._home, False
        return wanted

    def reset(self) -> None:
        """Make the duct whole and bring the view home; the next pull starts a run."""
        self._renew()
        self.pulls += 1
        self.bring_home()

    def practise_on(self, organ: Organ) -> None:
        """Ask for another organ; the next `take_organ` starts anew on it."""
        if self.in_exercise:
            raise ValueError("An exercise goes on until it is over. Stop it first.")
        self._other_organ = self.session.prepare_organ(organ)

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
        self._paused = False
        self._changed = True

    def start_exercise(
        self, exercise: Exercise, feedback: Feedback, grasp: float | None = None
    ) -> None:
        """Start anew with an exercise."""
        self.keep_run()
        self.leave_replay()
        self.session.start_exercise(exercise, feedback, grasp, self.exercise_inputs)
        self.pulls += 1
        self._paused = False
        self._changed = True

    def finish(self) -> None:
        """End the run as it stands."""
        self.session.finish()
        self._changed = True

    def give_hook(self, device: str) -> None:
        """Give the hook to a device and say so; mouse and sliders cannot pull then."""
        self.release_hand()
        self.device = device
        self._device_notice = self.client.add_notification(
            "The device holds the hook", f"{device}: pull up to pull the duct.", color="green"
        )

    def take_hook_back(self, why: str | None) -> None:
        """Give the hook back to mouse and sliders."""
        self.device = None
        if self._device_notice is not None:
            self._device_notice.remove()
            self._device_notice = None
        if why is not None:
            self.client.add_notification("The device has let go", why, color="yellow")

    def grab_by_device(self) -> bool:
        """Grab the duct with the device's hand, at the hook; return whether it holds."""
        self._begin_anew(True)
        return self.session.grab(self.session.duct.grasp) is not None

    def set_target_force(self, force: float) -> None:
        """Pull with the slider's force; once a run is over, this starts a new one."""
        if self._playback is None and not self._refuses_mouse() and not self._refuses_force():
            renewed = self._begin_anew(force > 0.0)
            self.session.set_target_force(force)
            # Counted after the force is set: before, the slider would go back to zero.
            self.pulls += renewed

    def ramp_to_tear(self) -> None:
        """Pull at a constant rate until the duct tears."""
        if self._playback is not None or self._refuses_mouse() or self._refuses_force():
            return
        self._begin_anew(True)
        event = self.session.reading().breaks_at
        if event is not None:
            self.session.set_target_force(PAST_BREAK * event.force)
            self._paused = False
        self.pulls += 1

    def grab(self, hold: Hold) -> None:
        """Grab the duct by hand."""
        if self._playback is not None or self._refuses_mouse():
            return
        session = self.session
        if session.reading().phase is not Phase.INTACT:
            self.refuse("A torn duct holds no pull. Press Reset (R) for a new one.")
            return
        self._begin_anew(True)
        first = session.duct.dissection.clamps[0]
        station = session.duct.grasp if hold.station is None else hold.station - first
        self._held_from = session.grab(station)
        self.move_hand(hold)

    def move_hand(self, hold: Hold) -> None:
        """Move the hand that has grabbed the duct."""
        if self._held_from is not None:
            along_pull = float(hold.moved @ self.session.duct.dissection.frame[:, 2])
            self.session.move_hand(self._held_from + along_pull)

    def release_hand(self) -> None:
        """Release the duct, if a hand holds it."""
        if self._held_from is not None:
            self._held_from = None
            self.release()

    def release(self) -> None:
        """Release the duct from the hand or the force."""
        self.session.release()
        self.pulls += 1

    def start_replay(self, run: RunFile) -> ReplayPlayback:
        """Replay a run in place of the session, which is stopped meanwhile."""
        playback = ReplayPlayback(run, self.session.duct.dissection.organ)
        self.release_hand()
        playback.play()
        self._playback = playback
        self._changed = True
        return playback

    def leave_replay(self) -> None:
        """Show the session again, unchanged."""
        self._playback = None
        self._changed = True

    def refuse(self, reason: str) -> None:
        """Tell the client why something is not possible."""
        if self._refusal is not None:
            self._refusal.remove()
        self._refusal = self.client.add_notification(
            "Not possible", reason, color="yellow", auto_close_seconds=8.0
        )

    @contextmanager
    def preparing(self, what: str) -> Generator[None]:
        """Tell the client what is being done, if it takes longer than `PATIENCE`."""
        with explained(self.client, what):
            yield

    def attempt(self, what: str, action: Callable[[], object]) -> bool:
        """Do what the client has asked for; on an error tell it why and return False."""
        try:
            with self.preparing(what):
                action()
        except ValueError as error:
            self.refuse(str(error))
            return False
        finally:
            self._changed = True
        return True

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

    def _renew(self) -> None:
        self.keep_run()
        self.session.reset()
        self._paused = False
        self._changed = True

    def _begin_anew(self, pulls: bool) -> bool:
        """Reset for a new run when the last one is over and the duct is still whole."""
        session = self.session
        renew = pulls and session.run.over and session.reading().phase is Phase.INTACT
        if renew:
            self._renew()
        return renew


@contextmanager
def explained(client: viser.ClientHandle, what: str) -> Generator[None]:
    """Tell a client what is being done, if it takes longer than `PATIENCE`."""
    shown: list[viser.NotificationHandle] = []
    over = threading.Event()
    lock = threading.Lock()

    def show() -> None:
        with lock:
            if not over.is_set():
                shown.append(
                    client.add_notification(
                        "One moment", what, loading=True, with_close_button=False
                    )
                )

    timer = threading.Timer(PATIENCE, show)
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
        with lock:
            over.set()
        for notice in shown:
            notice.remove()
