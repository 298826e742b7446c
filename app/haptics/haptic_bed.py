"""What a hand feels of a duct in its bed: strands that resist and part under one hook or two.

The hook hangs on its hand by a spring, the virtual coupling, and is solved with beam and strands: a
period is one real-time tick of `physics.bed.BeamOnBed`. What the duct has stored and spent is known
at the beginning of the last tick; the hands' work since then is added to it, so that energy that
the tick itself has made shows a period later.

Energy of a tick. It leads the coupling's end from z_0 to z_1 while the node stands at x_0, counts
K (z_1 - x_0) as the force at its end, and takes one Newton step to x_1. The hand feels
K (z_1 - x_1). So the beam counts more work than the hands give by the sum of
K (x_1 - x_0) . (z_1 - z_0)/2, and what relaxes in the step is in their `snap` and `lag`. The
difference is `released`:

    W = stored + spent + released,  released = snap + lag - (W_counted - W) - W of the last tick

to what the trapezoidal rule leaves `open`. Another hand that no device has, the trainer page's,
may hold the duct or part strands meanwhile: `HandContact` says how, some thirty times a second.
"""

import copy
import math
from collections.abc import Mapping
from contextlib import suppress

import numpy as np
from numpy.typing import NDArray

from app.haptics.haptic_beam import STRESS_STEPS, tear
from app.simulation import TICK_SECONDS, HandContact, near_place
from kernel_cache import njit
from physics import DEEPEST
from physics.bed import BeamOnBed
from physics.equilibrium import NoEquilibrium
from physics.quantity import positive

Array = NDArray[np.float64]


@njit(cache=True, nogil=True)
def _render(
    nodes: NDArray[np.int64],
    x: Array,
    react: Array,
    load: Array,
    coupling: float,
    hands: Array,
    hands_before: Array,
    taken: Array,
    reacts: Array,
    forces: Array,
    hooks: Array,
    tips: Array,
) -> tuple[float, float]:
    """Fill forces and places of the hooks; return the hands' work, and as the beam counts it."""
    # `nodes` are those that the hooks hold, below zero for none.
    work = counted = 0.0
    for hook in range(nodes.shape[0]):
        node = nodes[hook]
        if node < 0:
            for j in range(3):
                forces[hook, j] = hooks[hook, j] = 0.0
                tips[hook, j] = taken[hook, j] + hands[hook, j]
            continue
        for j in range(3):
            half_step = 0.5 * (hands[hook, j] - hands_before[hook, j])
            hands_before[hook, j] = hands[hook, j]
            reaction = react[node, j] + load[node, j]
            counted += half_step * (reacts[hook, j] + reaction)
            reacts[hook, j] = reaction
            tips[hook, j] = x[node, j]
            hooks[hook, j] = x[node, j] - taken[hook, j]
            force = coupling * (hands[hook, j] - hooks[hook, j])
            work += half_step * (forces[hook, j] + force)
            forces[hook, j] = force
    return work, counted


class HapticBed:
    """A duct in its bed under hooks; a `HapticModel`.

    `grasps` are where they take the duct, mm from the first clamp, growing; hooks that are at
    `tips`, (H, 3) mm, take it there. The wall tears at the stress `threshold`, MPa, and a tear
    crosses it at `tear_mm_per_s`, or at once; `coupling` is
    the stiffness of the virtual coupling, N/mm, `period` that of the servo, s. `touch` is what
    another hand does to the beam already. Of several tubes `tube` is taken, and each tears at its
    own of the `strengths`, MPa, and of the speeds in `tear_mm_per_s`.
    """

    def __init__(
        self,
        beam: BeamOnBed,
        grasps: tuple[float, ...],
        *,
        threshold: float,
        coupling: float,
        period: float,
        tips: NDArray[np.float64] | None = None,
        touch: HandContact | None = None,
        tube: str | None = None,
        strengths: Mapping[str, float] | None = None,
        tear_mm_per_s: float | Mapping[str, float] | None = None,
    ) -> None:
        positive(coupling, "coupling", "N/mm")
        hooks = len(grasps)
        self.grasps, self.coupling = grasps, coupling
        self.threshold, self._period = threshold, period
        self._at_first, self._touch_at_first = beam, touch
        if beam.beam.wall is None:
            raise ValueError("a beam without a wall tears nowhere and cannot be felt")
        self._strengths = dict(strengths or {})
        names = list(beam.network.tubes)
        self._names = names
        self._tubes = [0 if tube is None else names.index(tube)] * hooks  # that hooks take
        speeds = tear_mm_per_s or {}
        if not isinstance(speeds, Mapping):
            speeds = dict.fromkeys(names, speeds)
        # Of each tube, how far a tear goes on between two looks, mm.
        self._tear_mm = {name: speeds.get(name, math.inf) * STRESS_STEPS * period for name in names}
        self.pushes, self.free = True, tips is not None
        self._tips_at_first = np.zeros((hooks, 3)) if tips is None else np.array(tips)
        self.forces, self.elastic_forces = np.zeros((hooks, 3)), np.zeros((hooks, 3))
        self.hooks, self.tips = np.zeros((hooks, 3)), np.zeros((hooks, 3))
        self._taken = np.zeros((hooks, 3))  # where the hooks took the duct, mm
        self._hands = np.zeros((hooks, 3))
        self._reacts = np.zeros((hooks, 3))  # the couplings' forces as the beam has counted them
        self.rest()
        self.step(np.full((hooks, 3), 0.1), np.ones(hooks, np.bool_))  # compiled before it is felt
        self.assemble_ahead()
        self.step(np.zeros((hooks, 3)), np.zeros(hooks, np.bool_))
        self.rest()

    def rest(self) -> None:
        """Go back to the first state, with no hook on the duct."""
        self.beam = copy.deepcopy(self._at_first)
        self._nodes: list[int | None] = [None] * len(self.grasps)
        self._held_nodes = np.full(len(self.grasps), -1)
        self._slipped = [False] * len(self.grasps)  # hooks that found nothing to take
        for array in (self.forces, self.elastic_forces, self.hooks, self._hands, self._reacts):
            array[:] = 0.0
        self.tips[:] = self._taken[:] = self._tips_at_first
        self._touch, self._touched, self._touch_steps = self._touch_at_first, None, 0
        if self._touch is not None and self._touch.station is not None:
            at = np.abs(self.beam.stations_of(self._touch.tube) - self._touch.station).argmin()
            self._touched = int(self.beam.nodes_of(self._touch.tube)[at])
        energies = self.beam.energy
        self._spent_at_first = energies.stored + energies.dissipated + energies.drag
        self._snap_at_first = energies.snap + energies.lag
        self._counted = self._counted_at_first = energies.work  # by the couplings, and before
        self._work = 0.0  # work of the hands by the forces that they feel, mJ
        self.stored = self.spent = self.released = 0.0
        self._let_go = 0.0  # energy lost by letting go, mJ
        self.torn, self._steps = False, 0

    def touch(self, touch: HandContact) -> None:
        """Let the hand that no device has go on with what it does, over a tick of the trainer."""
        before, beam = self._touch, self.beam
        if self.torn:
            return
        if before is None or (touch.station, touch.tube) != (before.station, before.tube):
            if self._touched is not None:
                beam.let_go(self._touched)
                self._touched = None
            if touch.station is not None:
                with suppress(ValueError):  # a hook has the node
                    self._touched = beam.take(touch.station, touch.tube)
        rods = {} if before is None else {rod.number: rod for rod in before.rods}
        for rod in touch.rods:
            old = rods.pop(rod.number, None)
            # Its tip is led, and all else of it is set.
            if old is None or old[2:] != rod[2:]:
                beam.set_rod(*rod)
        for number in rods:
            beam.withdraw_rod(number)
        self._touch, self._touch_steps = touch, max(1, round(TICK_SECONDS / self._period))

    def step(self, hands: NDArray[np.float64], held: NDArray[np.bool_]) -> None:
        """Advance by one period; see `HapticModel`."""
        if self.torn:
            self.elastic_forces[:] = 0.0
            self.hooks[:] = hands
            np.add(self._taken, hands, self.tips)
            return
        self._steps += 1
        beam = self.beam
        for hook in range(len(self._nodes)):
            node = self._change_hold(hook, bool(held[hook]))
            self._held_nodes[hook] = -1 if node is None else node
            if node is not None:
                beam.lead(node, self._taken[hook] + hands[hook])
        if self._touch_steps:
            self._lead_touch()
        try:
            beam.tick(self._period)
            broken = self._steps % STRESS_STEPS == 0 and self._stress() > self.threshold
            if broken:  # wholly, or part of the way
                broken = self._torn_through()
        except NoEquilibrium:
            broken = True
        state = beam.state
        work, counted = _render(
            self._held_nodes, state.x, state.react, state.load, self.coupling, hands, self._hands,
            self._taken, self._reacts, self.forces, self.hooks, self.tips,
        )  # fmt: skip
        self._counted += counted
        self.elastic_forces[:] = self.forces
        energies = beam.energy
        self.stored = energies.stored + work
        self._work += work
        # Not `snap` nor `lag`: a tick moves the coupling's end before the beam follows, and
        # counts the spring's energy that this frees. The hand holds its force meanwhile and has not
        # given it. What the other hand has put in is no work of these.
        others = 0.0 if self._touch is None else energies.work - self._counted
        spent = energies.dissipated + energies.drag + self._let_go
        self.spent = spent - others - self._spent_at_first
        staggered = self._counted - self._counted_at_first - self._work
        self.released = (
            energies.snap + energies.lag - self._snap_at_first - self._let_go - staggered - work
        )
        if broken:
            tear(self, hands)

    def assemble_ahead(self) -> None:
        """Do what the next step does wherever the hands go; see `HapticModel`."""
        if not self.torn:
            self.beam.assemble_ahead(self._period)

    def station_of(self, hook: int) -> float | None:
        """Return where a hook holds the beam, mm from its first end, or None."""
        node = self._nodes[hook]
        if node is None or self.torn:
            return None
        tube = self._names[self._tubes[hook]]
        at = np.flatnonzero(self.beam.nodes_of(tube) == node)[0]
        return float(self.beam.stations_of(tube)[at])

    def tube_of(self, hook: int) -> int:
        """Return the number of the tube that a hook holds or held last; see `HapticModel`."""
        return self._tubes[hook]

    def _stress(self) -> float:
        """Return the largest stress in the wall, MPa; of several, as a part of the threshold."""
        worsts = self.beam.worst_stresses()
        if not self._strengths:
            return worsts[0].total
        strengths = self._strengths.values()
        return self.threshold * max(
            worst.total / strength for worst, strength in zip(worsts, strengths, strict=True)
        )

    def _torn_through(self) -> bool:
        """Let walls that are past their strengths tear; return whether one is torn through."""
        beam = self.beam
        strengths = self._strengths or dict.fromkeys(beam.network.tubes, self.threshold)
        for worst, (tube, strength) in zip(beam.worst_stresses(), strengths.items(), strict=True):
            if worst.total > strength and beam.nick(worst, self._tear_mm[tube], tube) >= DEEPEST:
                return True
        return False

    @property
    def solved_by(self) -> str:
        """What solves it, in words."""
        tubes, strands = len(self.beam.network.tubes), self.beam.strands.count
        if tubes > 1:
            return f"exact in space, {tubes} tubes, {strands} strands"
        return f"exact in space, {strands} strands of a bed"

    @property
    def parted(self) -> int:
        """How many strands have parted."""
        return self.beam.broken

    def _change_hold(self, hook: int, holds: bool) -> int | None:
        """Take the duct or let go of it; return the node that is held."""
        beam, node = self.beam, self._nodes[hook]
        if node is not None and not holds:
            before = beam.energy.snap
            beam.let_go(node)
            self._let_go += beam.energy.snap - before
            self._nodes[hook] = None
        elif node is None and holds and not self._slipped[hook]:
            tip = self.tips[hook]
            found: tuple[int, float] | None = self._tubes[hook], self.grasps[hook]
            if self.free and self._strengths:
                found = near_place(beam, tip)
            elif self.free:
                found = 0, min(max(float(tip[0]), 0.0), beam.beam.span)
            if found is not None:
                self._tubes[hook], station = found
                name = self._names[self._tubes[hook]]
                try:
                    node = self._nodes[hook] = beam.take(station, name, stiffness=self.coupling)
                except ValueError:
                    if not self.free:
                        raise
            self._slipped[hook] = node is None  # until it tries again
            # The hand's way counts from here.
            self._taken[hook] = tip if node is None else beam.places[node]
            self._hands[hook] = self._reacts[hook] = 0.0
        if not holds:
            self._slipped[hook] = False
        return self._nodes[hook]

    def _lead_touch(self) -> None:
        """Move the other hand's hook and rods a step towards where they go."""
        touch, beam, fraction = self._touch, self.beam, 1.0 / self._touch_steps
        self._touch_steps -= 1
        if touch is None:
            return
        if self._touched is not None:
            now = beam.state.goal[self._touched]
            beam.lead(self._touched, now + fraction * (touch.place - now))
        for rod in touch.rods:
            now = beam.state.rods[rod.number, :3]
            beam.lead_rod(rod.number, now + fraction * (rod.tip - now))
