"""One browser client: the mode of its page, and the scene and panel of that mode."""

from collections.abc import Callable
from threading import Lock

import viser

from app.simulation import ExerciseInputs, Preset, Session
from app.trainer.client.client_state import EXERCISE_GOES_ON, Mode, Workers, explained
from app.trainer.client.dissect_state import DissectState
from app.trainer.client.practice import Practice
from app.trainer.client.pull_state import PullState
from app.trainer.stage.lighting import LookChoice
from app.trainer.view.dissect_view import DissectView
from app.trainer.view.pull_view import PullView
from organ_geometry import Organ

__all__ = ["ClientView"]


class ClientView:
    """What one client sees of its practice: one of its sessions at a time.

    `ready` waits until what another mode needs is compiled: the first one is ready;
    `furnish` adds to the page of a mode, each time that it is shown. The look "plain" is for slow
    machines; "auto" changes to it where the page draws too slowly.
    """

    def __init__(
        self,
        client: viser.ClientHandle,
        practice: Practice,
        workers: Workers,
        look: LookChoice,
        *,
        exercise_inputs: ExerciseInputs = "hand",
        ready: Callable[[Mode], object] = lambda _: None,
        furnish: Callable[["ClientView"], object] = lambda _: None,
    ) -> None:
        self.client, self._practice, self._workers = client, practice, workers
        self._look: LookChoice = look
        self._exercise_inputs: ExerciseInputs = exercise_inputs
        self._ready = ready
        self._plain = look == "plain"
        self._lock = Lock()  # while one mode is replaced by the other, nothing ticks
        self._closed = False
        self._furnish = furnish
        self.view = self._open(practice.mode or "dissect")
        furnish(self)

    @property
    def state(self) -> PullState | DissectState:
        """What the parts of the page share."""
        return self.view.state

    @property
    def mode(self) -> Mode:
        """What is shown."""
        return "pull" if isinstance(self.view, PullView) else "dissect"

    @property
    def session(self) -> Session:
        """The session that is shown."""
        return self.view.session

    @property
    def frames(self) -> int:
        """How often the duct was drawn in this mode."""
        return self.view.frames

    def tick(self, seconds: float, *, draws: bool = True) -> None:
        """Advance what is shown by real time, s, and send what has changed."""
        if self._lock.acquire(blocking=False):
            try:
                self.view.tick(seconds, draws=draws)
            finally:
                self._lock.release()

    def close(self) -> None:
        """Release the duct and remove what was sent, when the client has gone."""
        with self._lock:
            self._closed = True
            self.view.close()

    def _choose_mode(self, mode: Mode) -> None:
        """Show the other duct."""
        state = self.view.state
        if mode == self.mode:
            return
        if state.in_exercise:
            state.refuse(EXERCISE_GOES_ON)
            return
        self._show(mode)

    def show_duct(self, organ: Organ, preset: Preset | None, mode: Mode) -> None:
        """Show a new duct, whatever goes on."""
        self._show(mode, lambda: self._practice.renew(organ, preset))

    def _show(self, mode: Mode, prepare: Callable[[], object] | None = None) -> None:
        """Show a mode, if it is not shown yet or there is something to prepare for it."""
        with explained(self.client, "Preparing your duct."):
            self._ready(mode)
            with self._lock:
                if self._closed or (prepare is None and mode == self.mode):
                    return
                self._plain = self.view.state.plain
                self.view.leave()
                self.client.gui.reset()
                if prepare is not None:
                    prepare()
                self.view = self._open(mode)
            self._furnish(self)

    def _open(self, mode: Mode) -> PullView | DissectView:
        """Return a new view of a mode, whose page goes to the client; the mode is ready."""
        self._practice.mode = mode
        if mode == "pull":
            state = PullState(
                self.client, self._practice.pull, self._workers, self._exercise_inputs
            )
        else:
            state = DissectState(self.client, self._practice.dissect, self._workers)
        state.plain = self._plain
        state.choose_mode = self._choose_mode
        return (
            PullView(state, self._look)
            if isinstance(state, PullState)
            else DissectView(state, self._look)
        )
