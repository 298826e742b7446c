"""What one client's page shares, whatever it is showing: a duct in its bed or one without."""

import threading
from abc import ABC, abstractmethod
from collections.abc import Callable, Generator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from typing import Any, Literal

import viser

from app.compression.build_process import BuildProcess
from app.simulation import FEW, VERTICES, Feedback, Replay, RunFile, Session, Spread
from app.trainer.client.background_worker import BackgroundWorker
from app.trainer.client.replay_playback import LivePlayback, ReplayPlayback
from app.trainer.scene.drag_proxy import Hold

__all__ = [
    "EXERCISE_GOES_ON",
    "FEW",
    "FORCE_KEY",
    "MODES",
    "ClientState",
    "Mode",
    "Workers",
    "explained",
]

Mode = Literal["dissect", "pull"]
"""A duct freed from its bed, or one pulled without a bed."""
MODES: tuple[Mode, ...] = ("dissect", "pull")
FORCE_KEY = "F takes its force away, and gives it back."
PATIENCE = 0.4
"""s of waiting after which the client is told what is being done."""
EXERCISE_GOES_ON = "An exercise goes on until it is over. Stop it first."

EXPORT_VERTICES = 20_000
"""Of a surface that is downloaded, about: edges of half a millimetre on the shipped duct."""


@dataclass(frozen=True, slots=True)
class Workers:
    """Threads and a process that do the slow work of all clients, and how much they may make."""

    # finds in a moment what a client waits for: a result, or what typed numbers mean
    awaited: BackgroundWorker = field(default_factory=BackgroundWorker)
    # solves what takes long, or no client waits for; seconds, and minutes where it compiles first
    background: BackgroundWorker = field(default_factory=BackgroundWorker)
    # builds organs, which takes seconds, one client's after the other's
    builder: BackgroundWorker = field(default_factory=BackgroundWorker)
    # runs the builder's work, so that it can be cancelled
    build_process: BuildProcess = field(default_factory=BuildProcess)
    export_vertices: int = EXPORT_VERTICES

    def stop(self) -> None:
        """End them."""
        for each in (self.awaited, self.background, self.build_process, self.builder):
            each.stop()


class ClientState(ABC):
    """What the parts of one client's page share. Its methods may be called by any thread.

    `plain` is the client's choice of the simple picture; `last_run` the last run that ended or was
    given up, to be judged and replayed. `kept` is called when there is one. `first_input` starts a
    run's time, in a word, and `counted` says what counts in exercises, in a sentence.
    """

    first_input: str
    counted: str

    def __init__(self, client: viser.ClientHandle, session: Session, workers: Workers) -> None:
        self.client, self.session, self.workers = client, session, workers
        self.last_run: RunFile | None = None
        self.told: object = session.run if session.run.over else None  # the run whose end was told
        # the replay that is shown in place of the session
        self.playback: ReplayPlayback | None = None
        self._replayed: RunFile | None = None
        self.plain = False
        self.spread: Spread | None = None  # of the ducts of a band beside the distance to break
        self.choose_mode: Callable[[Mode], None] = lambda _: None
        self.kept: Callable[[], None] = lambda: None
        self.paused = False  # whether the session's time stands still
        self._changed = True
        self._home = False
        self._refusal: viser.NotificationHandle | None = None
        self.device: str | None = None  # the haptic device that holds a hook, or None
        self.force_off = False  # whether the device shall have no force
        self._device_notice: viser.NotificationHandle | None = None
        self._force_key: viser.CommandHandle | None = None

    @property
    def watching(self) -> bool:
        """Whether the session that is shown is another page's."""
        return isinstance(self.playback, LivePlayback)

    @property
    def shown(self) -> Session:
        """The session that is shown: the client's own, or the replay's."""
        playback = self.playback  # once: another thread may leave it
        return self.session if playback is None else playback.session

    @property
    def figures_visible(self) -> bool:
        """Whether the trainee may see the figures now."""
        return self.playback is not None or self.session.run.feedback_visible

    @property
    def in_exercise(self) -> bool:
        """Whether an exercise waits for its first input or goes on."""
        run = self.session.run
        return run.exercise is not None and not run.over

    @property
    def has_end_to_tell(self) -> bool:
        """Whether a run is over, and the page has not yet told how."""
        run = self.session.run
        return run.over and run is not self.told

    def give_hook(self, device: str, hands: int = 1) -> None:
        """Give the hook to a device and say so; two devices have two `hands`."""
        self.release_hand()
        self.device = device
        if self._force_key is None:
            self._force_key = self.client.gui.add_command(
                "Device's force off or on", description="of the haptic device", hotkey="F"
            )
            self._force_key.on_trigger(lambda _: self.switch_force())
        self._device_notice = self.client.add_notification(
            *self._device_words(device, hands), color="green"
        )
        self._changed = True

    def switch_force(self) -> None:
        """Give the device no force, in an exercise too, or give it back."""
        self.force_off = self.device is not None and not self.force_off
        if self.device is not None:
            self.client.add_notification(
                "The device has no force" if self.force_off else "The device has its force again",
                "F gives it back." if self.force_off else "F takes it away.",
                color="yellow" if self.force_off else "green",
                auto_close_seconds=8.0,
            )

    def take_hook_back(self, why: str | None) -> None:
        """Give the hook back to the mouse."""
        self.device = None
        if self._device_notice is not None:
            self._device_notice.remove()
            self._device_notice = None
        if why is not None:
            self.client.add_notification("The device has let go", why, color="yellow")
        self._changed = True

    @abstractmethod
    def _device_words(self, device: str, hands: int) -> tuple[str, str]:
        """Return what a page is told that a device now leads: a title and a sentence."""

    @abstractmethod
    def grab(self, hold: Hold) -> None:
        """Take with the mouse what it has pressed."""

    @abstractmethod
    def move_hand(self, hold: Hold) -> None:
        """Lead what the mouse holds, if it holds something."""

    @abstractmethod
    def release_hand(self) -> None:
        """Let go what the mouse holds, if it holds something."""

    def release(self) -> None:
        """Let go of the duct when a run is over."""
        self.release_hand()

    @abstractmethod
    def reset(self) -> None:
        """Make the duct whole and bring the view home; the next input starts a run."""

    @abstractmethod
    def offers_follow_from(self) -> object:
        """Return what the exercises offered depend on."""

    @abstractmethod
    def start_exercise(self, exercise: Any, feedback: Feedback) -> None:
        """Start anew with an exercise."""

    def start_again(self, run: RunFile) -> None:
        """Start the exercise of a run again."""
        if run.log.exercise is not None:
            self.start_exercise(run.log.exercise, run.log.feedback)

    def _renew(self, start: Callable[[], object]) -> None:
        """Keep the run so far, and start anew."""
        self.release_hand()
        self.keep_run()
        start()
        self.paused = False
        self._changed = True

    def run_so_far(self) -> RunFile:
        """Return the run in progress; a `ValueError` before its start."""
        return self.session.run_file()

    @abstractmethod
    def read_run(self, content: bytes) -> RunFile:
        """Return the run in a file; a `ValueError` if it is not one of this mode."""

    @abstractmethod
    def replay_of(self, run: RunFile, *, vertices: int = VERTICES) -> Replay:
        """Return a replay of a run, whose skin has about so many vertices."""

    def run_csv(self, run: RunFile) -> bytes:
        """Return a run tick by tick, as comma-separated values."""
        return self.replay_of(run, vertices=FEW).series().csv().encode()

    def keep_run(self) -> None:
        """Keep the run so far as the last one, if there was any input."""
        with suppress(ValueError):  # there was none
            self.last_run = self.run_so_far()
            self.kept()

    def run_at_hand(self) -> RunFile | None:
        """Return the run that is replayed, else the one in progress, else the last one."""
        if self.playback is not None:
            return self._replayed
        return self.run_so_far() if self.session.run.started else self.last_run

    def finish(self) -> None:
        """End the run as it stands."""
        self.session.finish()
        self._changed = True

    def start_replay(self, run: RunFile) -> None:
        """Replay a run in place of the session, which is stopped meanwhile."""
        playback = ReplayPlayback(self.replay_of(run))
        self.release_hand()
        playback.play()
        self._replayed, self.playback = run, playback
        self._changed = True

    def watch(self, session: Session, find: Callable[[], Session | None]) -> None:
        """Show another page's session in place of this one's, which is stopped meanwhile."""
        self.release_hand()
        self.playback = LivePlayback(session, find)
        self._changed = True

    def leave_replay(self) -> None:
        """Show the session again, unchanged."""
        self.playback = None
        self._changed = True

    def show(self, *, plain: bool | None = None) -> None:
        """Choose what is shown; None leaves a choice as it is."""
        self.plain = self.plain if plain is None else plain
        self._changed = True

    def show_spread(self, spread: Spread | None) -> None:
        """Choose the ducts of the band of the distance to break, or none."""
        self.spread = spread
        self._changed = True

    def take_change(self) -> bool:
        """Return whether the client's choices have changed since the last call."""
        changed, self._changed = self._changed, False
        return changed

    def set_paused(self, paused: bool) -> None:
        """Stop or continue the session's time; an exercise cannot be paused."""
        if paused and self.in_exercise:
            self.refuse(EXERCISE_GOES_ON)
            return
        self.paused = paused
        self._changed = True

    def bring_home(self) -> None:
        """Ask for the camera to show the whole duct again."""
        self._home = True

    def take_home(self) -> bool:
        """Return whether `bring_home` was called since the last call."""
        wanted, self._home = self._home, False
        return wanted

    def refuse(self, reason: str) -> None:
        """Tell the client why something is not possible."""
        if self._refusal is not None:
            self._refusal.remove()
        self._refusal = self.client.add_notification(
            "Not possible", reason, color="yellow", auto_close_seconds=8.0
        )

    def require_no_exercise(self) -> None:
        """Raise a `ValueError` while an exercise goes on."""
        if self.in_exercise:
            raise ValueError(EXERCISE_GOES_ON)

    def send_file(self, name: str, content: bytes) -> None:
        """Have the browser save a file."""
        self.client.send_file_download(name, content, save_immediately=True)

    def attempt(self, what: str, action: Callable[[], object]) -> bool:
        """Do what the client has asked for; on an error tell it why and return False."""
        try:
            with explained(self.client, what):
                action()
        except ValueError as error:
            self.refuse(str(error))
            return False
        finally:
            self._changed = True
        return True


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
