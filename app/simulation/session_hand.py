"""What a trainee does to the duct: every wish goes into the run's log as what it came to."""

import numpy as np

from app.simulation.run import StartingPoint
from app.simulation.run_log import InputKind
from app.simulation.session_state import SessionState

__all__ = ["HandledSession"]


class HandledSession(SessionState):
    """A session whose duct is pulled, by force or by hand. Wishes are taken with the next step.

    Made with the parameters of a `SessionState`.
    """

    def set_force(self, force: float) -> None:
        """Ask for a force; the pull grows or falls to it in the next steps."""
        with self._lock:
            if self._slider_takes(force):
                if force > 0.0:
                    self._begin_run()
                self._note("force", self._pulled.ask_force(force))

    def station_at(self, place: tuple[float, float, float]) -> float:
        """Return where along the duct a place in space is, for a hand to take hold there."""
        with self._lock:
            return self._pulled.grasped.station_at(np.array(place, dtype=np.float64))

    def grab(self, station: float) -> float | None:
        """Take the duct by hand, at a place and as far out as it is there."""
        with self._lock:
            if not self._pulled.takes(station):
                return None
            self._begin_run()
            self._note("grab", self._pulled.grab(station))
            return self._pulled.control.deflection

    def hand_to(self, deflection: float) -> None:
        """Lead the hand that holds the duct; the grasp follows in the next steps."""
        with self._lock:
            if self._pulled.takes(deflection):
                self._note("hand", self._pulled.lead_to(deflection))

    def hand_to_place(self, place: tuple[float, float, float]) -> None:
        """Lead the hand to a place in space."""
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
        """Ask for another grasp, taken with the next step."""
        with self._lock:
            if self._slider_takes(grasp):
                if self._run.over:
                    self._task_grasp = None
                self._note("grasp", self._pulled.ask_grasp(grasp))

    def set_threshold(self, threshold: float) -> None:
        """Ask for another stress at which the duct tears, taken with the next step."""
        with self._lock:
            if self._slider_takes(threshold):
                self._note("threshold", self._pulled.ask_threshold(threshold))

    def _slider_takes(self, figure: float) -> bool:
        """Return whether a wish that no hand has made is one now."""
        return not self._run.hand_only and self._pulled.takes(figure)

    def _begin_run(self) -> None:
        """Start the run's clock with the first pull, on a duct that nothing was done to before."""
        if self._run.started or self._run.over:
            return
        model, pulled = self._pulled.model, self._pulled
        self._run.start(
            StartingPoint(
                model.dissection.preset,
                model.theory,
                pulled.grasp_wanted,
                pulled.threshold_wanted,
            )
        )
        pulled.renew()

    def _note(self, kind: InputKind, wish: float | None) -> None:
        if wish is not None:
            self._run.note(kind, wish)
