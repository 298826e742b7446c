"""One dissection under a policy: actions in, observations and rewards out, over a session."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from app.rl.state_row import StateRow
from app.rl.task import PIXELS, VERTICES, Task
from app.simulation import (
    HOLDING,
    MOST_SUCTION,
    TICK_SECONDS,
    Safety,
    Session,
    SpatialTissue,
)
from kernel_cache import SameTypes, kernel
from physics import NoEquilibrium
from physics.bed import BeamOnBed

REACH_MM = 4.0
"""How far from the duct's axis a tip may be that takes hold: about the duct's radius."""

GRIP = 5
"""Numbers of an action for a hand up to the one by which it takes hold."""

Floats = NDArray[np.float64]
Observation = dict[str, NDArray[Any]]


class Episode:
    """A session that a policy works on: one of its own, or one that others work on too.

    `bounds` are those of its observations, `bed_seed` is its bed's, `terms` are the weighted terms
    of the last step's reward, `terminated` and `truncated` as Gymnasium means them.
    """

    def __init__(self, task: Task, session: Session | None = None) -> None:
        self.task = task
        self._view: Safety | None = None
        # of which `_parted` and `_freed` are known
        self._broken: tuple[BeamOnBed, int] | None = None
        if session is None:
            self.session = Session(task.duct, vertices=VERTICES, watched=False)
            self.reset(int(task.seeds[0]))
        else:
            self.session, self.bed_seed = session, session.specimen.bed_seed
            self._begin()
        self.bounds = task.bounds(self._tissue)
        # Of each instrument, which of those that are known it is.
        self._one_of = dict(zip(task.known, np.eye(len(task.known)).tolist(), strict=True))
        self._camera = task.view(*task.picture) if PIXELS in self.bounds else None
        seen = {key: each for key, each in self.bounds.items() if key != PIXELS}
        self._state = StateRow(seen) if seen else None

    @property
    def _tissue(self) -> SpatialTissue:
        return self.session.spatial

    def reset(self, bed_seed: int) -> None:
        """Start anew in the bed of a seed."""
        self.bed_seed = bed_seed
        session, task = self.session, self.task
        session.start_exercise(task.seeded(bed_seed))
        # The choice of an instrument starts the run, so that its clock is the episode's.
        for hand, instrument in enumerate(task.first_instruments):
            session.choose_instrument(hand, instrument)
        self._begin()

    def _begin(self) -> None:
        tissue = self._tissue
        if self.task.several and self._view is None:
            self._view = Safety(tissue)
        self._used = [False] * self.task.hands
        self._rates: dict[int, list[float]] = {}  # mm a tick, of acting hands and their jaws
        self.terminated = self.truncated = self.lost = False
        self._totals = self._counted()
        self.terms = dict.fromkeys(self.task.weights, 0.0)

    @property
    def space(self) -> spaces.Dict:
        """The space of its observations."""
        return spaces.Dict(
            {
                key: spaces.Box(low, high, dtype=low.dtype.type)
                for key, (low, high) in self.bounds.items()
            }
        )

    def room(self, *count: int) -> Observation:
        """Return arrays for one observation, or for so many."""
        return {
            key: np.zeros((*count, *low.shape), low.dtype) for key, (low, _) in self.bounds.items()
        }

    def act(self, action: Floats) -> float:
        """Do one step with an action of finite numbers from -1 to 1; return the reward."""
        self.decide(action)
        for _ in range(self.task.ticks_per_step):
            self.lead()
            if self.advance():
                break
        return self.judge()

    def decide(self, action: Floats, hands: Sequence[int] | None = None) -> None:
        """Take hold, let go and set rates by an action, of some of its hands or of all."""
        task = self.task
        rows: list[list[float]] = action.reshape(task.hands, task.actions).tolist()
        pace = task.speed * TICK_SECONDS
        self._rates = {}
        for hand in range(task.hands) if hands is None else hands:
            *moves, grip = rows[hand][:GRIP]
            self._rates[hand] = [pace * each for each in moves]
            self._grip(hand, grip, rows[hand][-1] if task.free_choice else None)
            if task.several:
                self._use(hand, used=rows[hand][GRIP] > 0.0)

    def lead(self) -> None:
        """Lead the acting hands for a tick at their rates."""
        self.session.lead_hands(self._rates)

    def advance(self) -> bool:
        """Advance by a tick; return whether the episode is over."""
        try:
            self.session.advance()
        except NoEquilibrium:  # the duct is lost: nothing is known of it any more
            self.lost = True
        return self.lost or self.session.run.over or self._late

    @property
    def _late(self) -> bool:
        return self.session.run.ticks >= self.task.limit_ticks

    def _grip(self, hand: int, grip: float, instrument: float | None = None) -> None:
        """Choose an instrument, where that is free, and take hold or let go."""
        session, holder = self.session, self._tissue.hands[hand]
        if instrument is not None:
            known = self.task.known
            chosen = known[min(int(0.5 * (instrument + 1.0) * len(known)), len(known) - 1)]
            if chosen != holder.instrument:
                session.choose_instrument(hand, chosen)
        held = holder.node is not None
        if held and grip <= 0.0:
            session.release(hand)
        elif not held and grip > 0.0 and holder.instrument in HOLDING:
            found = self._within_reach(holder.place)
            if found is not None:
                session.grab(hand, *found)

    def _within_reach(self, place: Floats) -> tuple[float, int] | None:
        """Return the station and the tube of the node next to a place, if one is near enough."""
        beam, tubes = self._tissue.beam, self._tissue.tubes
        nearest, square = _NEAREST(beam.places, place)
        if square > REACH_MM**2 and not self.task.several:
            return None
        for tube, (name, rest) in enumerate(tubes.network.tubes.items()):
            at = np.flatnonzero(beam.nodes_of(name) == nearest)
            if not at.size:
                continue
            station = float(beam.stations_of(name)[at[0]])
            reach = REACH_MM
            if self.task.several:  # a gallbladder's wall is far from its axis
                reach = max(reach, float(np.interp(station, rest.stations, rest.radius)))
            near = square <= reach**2
            return (station / tubes.surfaces[tube].scale, tube) if near else None
        return None

    def _use(self, hand: int, *, used: bool) -> None:
        """Clip or cut as a hand begins to use its instrument, and suck while it does."""
        session, before = self.session, self._used[hand]
        if used == before:
            return
        self._used[hand] = used
        session.suck(hand, MOST_SUCTION if used else 0.0)
        if used:
            session.clip(hand)
            session.cut(hand)

    def judge(self) -> float:
        """Set whether the episode is over, and the terms of the step's reward; return their sum."""
        passed, over = self._passed, self.session.run.over or self.lost
        # The end of its time fails an exercise; of an episode it says nothing.
        late = self._late and not (passed or self._torn or self.lost)
        self.truncated, self.terminated = late, over and not late
        before, self._totals = self._totals, self._counted()
        self.terms = {
            name: weight * (self._totals[name] - before[name])
            for name, weight in self.task.weights.items()
        }
        return sum(self.terms.values())

    def _counted(self) -> dict[str, float]:
        """Return what the reward's terms are the growth of."""
        run = self.session.run
        return {
            "progress": run.progress,
            "parted": self._fraction_parted(),
            "time": run.seconds,
            "errors": run.errors,
            "stress": self._tissue.peak_stress_ratio,
            "passed": self._passed,
            "failed": self.terminated and not self._passed,
        }

    def _fraction_parted(self) -> float:
        """Return the share of strands that the goal asks for that have parted, 0 to 1."""
        tissue, task, goal = self._tissue, self.task, self.task.goal
        now = tissue.beam, tissue.broken
        if now != self._broken:  # none has parted since else
            self._broken, damage = now, tissue.beam.damage
            self._parted = np.concatenate(
                [
                    surface.freed_at(damage[mine], bins)
                    for surface, mine, bins in zip(
                        tissue.tubes.surfaces, tissue.tubes.strands_of, task.bins, strict=True
                    )
                ]
            )
            if goal is not None:
                asked = goal.length_mm / (goal.to_mm - goal.from_mm)
                self._freed = min(float(self._parted[task.within].mean()) / asked, 1.0)
        if self._view is None:
            return self._freed
        self._seen = view = self._view.critical_view()
        return (view.neck + view.triangle + view.plate) / 3.0

    @property
    def _passed(self) -> bool:
        outcome = self.session.run.outcome
        return outcome is not None and outcome.passed

    @property
    def _torn(self) -> bool:
        return self._tissue.torn is not None

    def info(self) -> dict[str, Any]:
        """Return what is known beside the observation."""
        return {
            "bed_seed": self.bed_seed,
            "seconds": self._totals["time"],
            "progress": self._totals["progress"],
            "errors": int(self._totals["errors"]),
            "peak_stress_ratio": self._totals["stress"],
            "passed": self._passed,
            "torn": self._torn,
            "reward_terms": dict(self.terms),
        }

    def observe(self, out: Observation) -> None:
        """Write what is observed to arrays of the observation space."""
        if self._camera is not None:
            self._camera.take(self._tissue, out[PIXELS])
        if self._state is None:
            return
        tissue, hands = self._tissue, list[float]()
        for holder, force in zip(tissue.hands[: self.task.hands], tissue.forces, strict=False):
            hands += holder.place.tolist()
            hands += force
            hands += holder.node is not None, holder.opening, *self._one_of[holder.instrument]
        self._state.write(
            out, hands, tissue.beam, self._parted, self._seen_of_all(), lost=self.lost
        )

    def _seen_of_all(self) -> list[float]:
        """Return what is observed besides hands, nodes and strands."""
        tissue, task, goal = self._tissue, self.task, self.task.goal
        wall = tissue.stress_ratio, tissue.station, tissue.peak_stress_ratio
        left = (task.limit_ticks - self.session.run.ticks) * TICK_SECONDS
        end = self._totals["progress"], left
        if goal is not None:
            return [*wall, goal.from_mm, goal.to_mm, goal.length_mm, *end]
        tubes = zip(tissue.stress_ratios, tissue.tears, strict=True)
        fluids, view = tissue.fluids.values(), self._seen
        return [
            *wall,
            *(number for ratio, tear in tubes for number in (ratio, tear is not None)),
            *(1e-3 * number for flow in fluids for number in (flow.lost, flow.rate)),
            view.two_structures, view.triangle_cleared, view.plate_freed,
            min(view.structures.values(), default=1.0), view.neck, view.triangle, view.plate, *end,
        ]  # fmt: skip

    def picture(self, height: int = 240, width: int = 320) -> NDArray[np.uint8]:
        """Return a picture, (height, width, 3)."""
        pixels = np.zeros((height, width, 3), np.uint8)
        return self.task.view(height, width).take(self._tissue, pixels)


@kernel()
def _nearest(places: Floats, place: Floats) -> tuple[int, float]:
    """Return the node next to a place, and the square of its distance, mm^2."""
    found, least = -1, np.inf
    for n in range(places.shape[0]):
        x, y, z = places[n, 0] - place[0], places[n, 1] - place[1], places[n, 2] - place[2]
        square = x * x + y * y + z * z
        if square < least:
            found, least = n, square
    return found, least


_NEAREST = SameTypes(_nearest)
