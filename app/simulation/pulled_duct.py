"""A duct under a grasper: what is asked of it, how its pull goes from tick to tick, its tear."""

import math

from app.simulation.grasped_duct import GraspedDuct
from app.simulation.model import Model
from app.simulation.pull_control import PullControl
from app.simulation.reading import Phase, Reading
from app.simulation.tear import Tear
from physics import BreakEvent, NoEquilibrium

__all__ = ["PulledDuct"]

GRASP_MARGIN = 0.1
"""Part of the span next to each clamp where the grasper finds no room."""
THRESHOLD_RANGE = (0.25, 2.0)
"""How far the threshold may be moved, in thresholds of the preset."""


class PulledDuct:
    """A duct that is pulled, and torn where the criterion is met.

    Wishes are clamped to their range; each method that takes one returns what it came to, or None
    if it changes nothing. A torn duct takes none.

    Parameters
    ----------
    model
        What is solved.
    edge_length
        Wanted length of the edges of a torn piece's triangles, mm.
    seed
        Chooses the torn rim's raggedness.

    Attributes
    ----------
    model
        As given.
    grasp_wanted, threshold_wanted
        mm and MPa, taken with the next tick.
    grasped
        The duct at the grasp and threshold that were taken.
    control
        The grasper.
    tear
        The tear, or None while the duct is whole.
    deepest
        Largest deflection of this pull, mm.
    came_from
        Where the axis at the grasp was before the last tick, mm.
    """

    def __init__(self, model: Model, *, edge_length: float, seed: int) -> None:
        self._edge_length, self._seed = edge_length, seed
        self.model = model
        self.grasp_wanted = 0.5 * model.dissection.beam.span
        self.threshold_wanted = model.threshold
        self.control = PullControl()
        self.deepest = 0.0
        self.tear: Tear | None = None
        self._stale = True
        self.grasped = GraspedDuct(model, self.grasp_wanted, self.threshold_wanted)
        self.came_from = self.grasped.hook()

    @property
    def grasp_range(self) -> tuple[float, float]:
        """Where the grasper can hold, mm from the first clamp."""
        span = self.model.dissection.beam.span
        return GRASP_MARGIN * span, (1.0 - GRASP_MARGIN) * span

    @property
    def threshold_range(self) -> tuple[float, float]:
        """How far the threshold may be moved, MPa."""
        low, high = THRESHOLD_RANGE
        return low * self.model.threshold, high * self.model.threshold

    @property
    def moving(self) -> bool:
        """Whether the next tick will change something."""
        if self.tear is not None:
            return not self.tear.settled
        return self._stale or not self.control.at_rest or self._wishes_pending

    def takes(self, figure: float) -> bool:
        """Return whether a number can be a wish now."""
        return self.tear is None and math.isfinite(figure)

    def ask_force(self, force: float) -> float | None:
        """Ask for a force; the pull grows or falls to it."""
        wanted = min(max(float(force), 0.0), self.model.force_limit)
        return wanted if self.control.pull_with(wanted) else None

    def grab(self, station: float) -> float:
        """Take the duct by hand, as far out as it is there."""
        self.grasp_wanted = _within(station, self.grasp_range)
        self.control.grab(max(0.0, self.grasped.across(self.grasp_wanted)))
        return self.grasp_wanted

    def lead_to(self, deflection: float) -> float | None:
        """Lead the hand that holds the duct."""
        wanted = _within(deflection, (0.0, self.grasped.deflection_limit))
        return wanted if self.control.lead_to(wanted) else None

    def ask_grasp(self, grasp: float) -> float | None:
        """Ask for another grasp: under the same force, or by hand as far out as the duct is there.

        Parameters
        ----------
        grasp
            Distance from the first clamp, mm.

        Returns
        -------
        float | None
            The wish, mm.
        """
        wanted = _within(grasp, self.grasp_range)
        if wanted == self.grasp_wanted:
            return None
        self.grasp_wanted = wanted
        self.control.regrasp(self.grasped.across(wanted))
        return wanted

    def ask_threshold(self, threshold: float) -> float | None:
        """Ask for another stress at which the duct tears."""
        wanted, before = _within(threshold, self.threshold_range), self.threshold_wanted
        self.threshold_wanted = wanted
        return None if wanted == before else wanted

    def solve_by(self, model: Model) -> None:
        """Go on by another theory, with its own threshold, under as much of the pull as it carries.

        Parameters
        ----------
        model
            The same dissection by the other theory.
        """
        control = self.control
        self.model, self.threshold_wanted = model, model.threshold
        control.force_wanted = min(control.force_wanted, model.force_limit)
        if control.mode == "force":
            control.force = min(control.force, model.force_limit)
        self.deepest = 0.0
        self._refresh()

    def reset(self) -> bool:
        """Let go of the duct and make it whole."""
        torn, self.tear = self.tear is not None, None
        self.control, self.deepest = PullControl(), 0.0
        self._stale = True
        return torn

    def renew(self) -> None:
        """Make a duct at rest one that has never been pulled.

        What its solver was asked for before would show in the last bits of what it finds next.
        """
        if self._wishes_pending:
            self.grasped = GraspedDuct(self.model, self.grasp_wanted, self.threshold_wanted)
        else:
            self.grasped = self.grasped.renewed()
        self._stale = True

    def touch(self) -> None:
        """Have the next tick solve and draw although nothing was asked for."""
        self._stale = True

    def tick(self) -> bool:
        """Advance by one tick."""
        if self.tear is None:
            return self._pull()
        if self.tear.settled:
            return False
        self.tear.advance()
        if self.tear.phase is Phase.TORN:
            self.control = PullControl()
        return True

    def reading(self) -> Reading:
        """Return what the instruments show now."""
        tear, control, duct = self.tear, self.control, self.grasped
        phase, shown = Phase.INTACT, 1.0
        force, breaks_at = control.grip_force, duct.breaks_at
        if tear is not None:
            phase, breaks_at = tear.phase, tear.event
            shown = 1.0 if phase is Phase.TEARING else 0.0
            force = shown * tear.event.force
        return Reading(
            phase=phase,
            force=force,
            deflection=shown * duct.pulled.deflection,
            check=duct.check,
            breaks_at=breaks_at,
            deepest=self.deepest,
            hook=duct.hook(shown),
            held=control.holds,
            by_hand=control.mode == "hand",
        )

    @property
    def _wishes_pending(self) -> bool:
        taken = self.grasped
        return self.grasp_wanted != taken.grasp or self.threshold_wanted != taken.threshold

    def _pull(self) -> bool:
        control = self.control
        if self._wishes_pending:
            if self.grasp_wanted != self.grasped.grasp:
                self.deepest = 0.0
            self._refresh()
        self.came_from = self.grasped.hook()
        if control.at_rest and not self._stale:
            return False
        self._stale = False
        deepest, before = self.deepest, (control.force, control.deflection)
        try:
            self.grasped.bear(control.advance(self.model.force_per_second))
        except NoEquilibrium:  # as far as the law carries
            control.stop_at(*before)
            return True
        self._feel()
        if self.grasped.check.broken and control.mode != "free":  # what nobody pulls tears not
            self._tear(before, deepest)
        return True

    def _refresh(self) -> None:
        """Bring what depends on the wishes up to date; where the law ends, give way."""
        self.grasped = GraspedDuct(self.model, self.grasp_wanted, self.threshold_wanted)
        self._stale = True
        load = self.control.load
        while True:
            try:
                self.grasped.bear(load)
            except NoEquilibrium:
                load = self.control.ease()
            else:
                self._feel()
                return

    def _feel(self) -> None:
        pulled = self.grasped.pulled
        self.control.felt(pulled.force, pulled.deflection)
        self.deepest = max(self.deepest, pulled.deflection)

    def _tear(self, before: tuple[float, float], deepest: float) -> None:
        """Tear the duct at the load that met the criterion, between the last tick and this."""
        control, duct, event = self.control, self.grasped, self.grasped.breaks_at
        if event is not None:
            force, deflection = before
            control.force = min(max(event.force, force), control.force)
            control.deflection = min(max(event.deflection, deflection), control.deflection)
        duct.bear(control.load)
        self.deepest = deepest
        self._feel()
        self.tear = Tear(
            self.model.dissection,
            duct.driven,
            BreakEvent(control.force, duct.pulled.deflection, duct.check),
            edge_length=self._edge_length,
            seed=self._seed,
        )


def _within(value: float, ends: tuple[float, float]) -> float:
    return min(max(float(value), ends[0]), ends[1])
