"""What a hand feels of a duct in its bed: strands that resist and part under one hook or two.

The hook hangs on its hand by a spring, the virtual coupling, and is solved with beam and strands: a
period is one real-time tick of `physics.bed.BeamOnBed`. What the duct has stored and spent is known
at the beginning of the last tick; the hands' work since then is added to it, so that energy that
the tick itself has made shows a period later.
"""

import numpy as np
from numpy.typing import NDArray

from physics.bed import BeamOnBed, Bed, SpaceBeam
from physics.equilibrium import NoEquilibrium
from physics.quantity import positive

__all__ = ["FeltBed"]

STRESS_STEPS = 10
"""Steps between two checks of the stresses in the duct's wall."""


class FeltBed:
    """A duct in its bed under hooks; a `FeltModel`.

    `grasps` are mm from the first clamp, growing; the wall tears at the stress `threshold`, MPa;
    `coupling` is the stiffness of the virtual coupling, N/mm, `period` that of the servo, s.
    """

    def __init__(
        self,
        beam: SpaceBeam,
        bed: Bed,
        grasps: tuple[float, ...],
        *,
        threshold: float,
        coupling: float,
        period: float,
    ) -> None:
        positive(coupling, "coupling", "N/mm")
        hooks = len(grasps)
        self.grasps, self.coupling = grasps, coupling
        self.threshold, self._period = threshold, period
        self._at_rest, self._strands = beam, bed.strands_under(beam)
        self._floor = bed.floor_under(beam)
        self.forces, self.elastic_forces = np.zeros((hooks, 3)), np.zeros((hooks, 3))
        self.hooks = np.zeros((hooks, 3))
        self._taken = np.zeros((hooks, 3))  # where the hooks took the duct, mm
        self._hands = np.zeros((hooks, 3))
        self.rest()
        self.step(np.full((hooks, 3), 0.1), np.ones(hooks, np.bool_))  # compiled before it is felt
        self.step(np.zeros((hooks, 3)), np.zeros(hooks, np.bool_))
        self.rest()

    def rest(self) -> None:
        """Make duct and bed whole and let go of them."""
        self.beam = BeamOnBed(self._at_rest, self._strands, floor=self._floor)
        self._nodes: list[int | None] = [None] * len(self.grasps)
        for array in (self.forces, self.elastic_forces, self.hooks, self._hands):
            array[:] = 0.0
        self.stored = self.spent = 0.0
        self._released = 0.0  # by letting go, mJ
        self.torn, self._steps = False, 0

    def step(self, hands: NDArray[np.float64], held: NDArray[np.bool_]) -> None:
        """Advance by one period; see `FeltModel`."""
        if self.torn:
            self.hooks[:] = hands
            return
        self._steps += 1
        beam, work = self.beam, 0.0
        for hook, node in enumerate(self._nodes):
            if held[hook] and node is None:
                self._nodes[hook] = node = beam.take(self.grasps[hook], stiffness=self.coupling)
                self._taken[hook] = beam.places[node]
                self._hands[hook] = 0.0
            elif node is not None and not held[hook]:
                before = beam.books.snap
                beam.let_go(node)
                self._released += beam.books.snap - before
                self._nodes[hook] = node = None
            if node is not None:
                beam.lead(node, self._taken[hook] + hands[hook])
        try:
            beam.tick(self._period)
            broken = self._steps % STRESS_STEPS == 0 and (
                beam.worst_stress().total > self.threshold
            )
        except NoEquilibrium:
            broken = True
        for hook, node in enumerate(self._nodes):
            if node is None:
                self.forces[hook] = self.elastic_forces[hook] = self.hooks[hook] = 0.0
                continue
            self.hooks[hook] = beam.places[node] - self._taken[hook]
            before = self.forces[hook].copy()
            self.forces[hook] = self.coupling * (hands[hook] - self.hooks[hook])
            self.elastic_forces[hook] = self.forces[hook]
            work += 0.5 * float((before + self.forces[hook]) @ (hands[hook] - self._hands[hook]))
            self._hands[hook] = hands[hook]
        books = beam.books
        self.stored = books.stored + work
        # Not `books.snap`: a tick moves the coupling's end before the beam follows, and books the
        # spring's energy that this frees. The hand holds its force meanwhile and has not given it.
        self.spent = books.dissipated + books.drag + self._released
        if broken:
            self.torn = True
            self.spent += self.stored
            self.stored = 0.0
            self.forces[:] = 0.0
            self.hooks[:] = hands

    @property
    def solved_by(self) -> str:
        """What solves it, in words."""
        return f"exact in space, {self.beam.strands.count} strands of a bed"

    @property
    def parted(self) -> int:
        """How many strands have parted."""
        return self.beam.parted
