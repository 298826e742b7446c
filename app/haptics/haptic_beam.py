"""What a hand feels: a model of the duct behind a virtual coupling, stepped by the servo.

A model takes the place of each hand and returns the force of each hook, in mm and N. The hook
hangs on its hand by a spring, the virtual coupling (Colgate, Stanley and Brown 1995), which is
solved with the beam: K (z - w) = F(w), with z the place of the hand, w that of the hook, K the
coupling's stiffness and F the theory's force. So the force is the theory's own at w, and the
stiffness that the hand meets, K F' / (K + F'), is never above K.
"""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from physics import (
    Beam,
    Cubic,
    Exact,
    ExactPull,
    Hold,
    NoEquilibrium,
    Theory,
    break_of,
    check_rupture,
    critical_stations,
)
from physics.cubic_kernels import cubic_deflection
from physics.quantity import positive

UP = 2
"""Axis of the pull among right, forward and up."""
STRESS_STEPS = 10
"""Steps between two checks of the stresses of a duct with two hooks, or in a bed."""


class HapticModel(Protocol):
    """What the servo asks of a model; its energies are in N mm."""

    forces: NDArray[np.float64]  # (H, 3) pull of each hook on the duct, N
    elastic_forces: NDArray[np.float64]  # (H, 3) the same before what tore in this step
    hooks: NDArray[np.float64]  # (H, 3) places of the hooks relative to rest, mm
    tips: NDArray[np.float64]  # (H, 3) the same from the first clamp, of a duct in space
    stored: float  # energy of the duct and of the couplings
    spent: float  # energy that tears and parted strands have taken
    released: float  # energy that its steps have released to nobody
    torn: bool
    grasps: tuple[float, ...]  # of the hooks, mm from the first clamp
    pushes: bool  # whether they push as well as pull
    free: bool  # whether hooks move about before they take the duct
    coupling: float  # stiffness of the virtual coupling, N/mm

    @property
    def solved_by(self) -> str:
        """What solves it, in words."""
        ...

    def station_of(self, hook: int) -> float | None:
        """Return where a hook holds a duct in space, mm from the first end, or None."""
        ...

    def tube_of(self, hook: int) -> int:
        """Return the number of the tube that a hook holds or held last."""
        ...

    def step(self, hands: NDArray[np.float64], held: NDArray[np.bool_]) -> None:
        """Advance by one period."""
        # `hands` are (H, 3) places, mm, less those at which their hooks are at rest; `held` (H,)
        # says which of them hold the duct.
        ...

    def assemble_ahead(self) -> None:
        """Do what the next step does wherever the hands go; what follows is the same to the bit."""
        ...


def tear(model: HapticModel, hands: NDArray[np.float64]) -> None:
    """Let a model tear: it has spent what it had stored, and its hooks follow the hands."""
    model.torn = True
    model.spent += model.stored
    model.stored = 0.0
    model.forces[:] = 0.0
    model.hooks[:] = hands


class HapticBeam:
    """A beam in the plane of its pull, under one hook or two that pull and do not push.

    A `HapticModel` of `Cubic` with a number for q, or of `Exact`, which two hooks need. `grasps`
    are mm from the first clamp, growing; it tears at the stress `threshold`, MPa, which one hook
    meets at the deflection `breaks_at`, mm (infinite if it never does); `coupling` is the stiffness
    of the virtual coupling, N/mm. Of `hands`, those beyond the hooks feel nothing.
    """

    def __init__(
        self,
        theory: Theory,
        beam: Beam,
        grasps: tuple[float, ...],
        *,
        threshold: float,
        coupling: float,
        hands: int = 1,
    ) -> None:
        hooks = len(grasps)
        hands = max(hooks, hands)
        if isinstance(theory, Cubic):
            if isinstance(theory.q, str) or hooks > 1:
                raise ValueError(
                    "the cubic is felt with a number for q and under one hook; take --theory exact"
                )
        elif not isinstance(theory, Exact):
            raise ValueError(f"theory {theory.name} cannot be felt; there are: cubic, exact")
        positive(coupling, "coupling", "N/mm")
        self.theory: Cubic | Exact = theory
        self.beam, self.grasps = beam, grasps
        self.threshold, self.coupling = threshold, coupling
        self.forces, self.elastic_forces = np.zeros((hands, 3)), np.zeros((hands, 3))
        self.hooks = self.tips = np.zeros((hands, 3))
        self.stored = self.spent = self.released = 0.0
        self.torn = False
        self.pushes = self.free = False
        self._steps = 0
        self._held = [False] * hooks
        self._heights = [0.0] * hooks
        self._compliance = 1.0 / coupling
        self._solver: ExactPull | None = None
        self._bending = self._stretching = 0.0
        self.breaks_at = float("inf")
        if isinstance(theory, Exact):
            self._solver = theory.pull(beam, *grasps)
        else:
            self._bending, self._stretching = theory.stiffness(beam, grasps[0])
        self._critical = critical_stations(beam, grasps[0], count=2)
        if hooks == 1:
            event = break_of(theory.pull(beam, grasps[0]), threshold)
            if event is not None:
                self.breaks_at = event.deflection
        else:
            self._critical = np.union1d(self._critical, [grasps[1]])
        self.step(np.full((hands, 3), 1.0), np.ones(hands, np.bool_))  # compiled before it is felt
        self.rest()

    @property
    def solved_by(self) -> str:
        """The theory's name."""
        return self.theory.name

    def rest(self) -> None:
        """Make the duct whole and let go of it."""
        for array in (self.forces, self.elastic_forces, self.hooks):
            array[:] = 0.0
        self.stored = self.spent = self.released = 0.0
        self.torn, self._steps = False, 0
        self._held[:] = [False] * len(self._held)
        if self._solver is not None:
            self._solver.rest()

    def step(self, hands: NDArray[np.float64], held: NDArray[np.bool_]) -> None:
        """Find the equilibrium with the hands where they are; see `HapticModel`."""
        self._steps += 1
        heights = self._heights
        for hook in range(len(heights)):
            holds = bool(held[hook])
            if self._held[hook] and not holds:  # the duct springs back; nobody gets that energy
                self.spent += self.stored
                self.stored = 0.0
            self._held[hook] = holds
            # A hook that is not pulled is not there: it neither pushes nor holds.
            heights[hook] = max(float(hands[hook, UP]), 0.0) if holds else 0.0
        if self.torn:
            self.forces[:] = self.elastic_forces[:] = 0.0
            self.hooks[:] = hands
            return
        try:
            broken = self._solve(heights)
        except NoEquilibrium:  # further than the law carries; until then the force stayed
            for hook, height in enumerate(heights):
                force = float(self.forces[hook, UP])
                before = float(self.hooks[hook, UP]) + self._compliance * force
                self.stored += force * (height - before)
            broken = True
        self.elastic_forces[:] = self.forces
        if broken:
            tear(self, hands)

    def _solve(self, heights: list[float]) -> bool:
        """Solve, fill forces and hooks and return whether the duct breaks."""
        forces, hooks = self.forces[:, UP], self.hooks[:, UP]
        solver, give = self._solver, self._compliance
        if len(heights) == 2 and solver is not None:
            return self._solve_both(solver, heights)
        height = heights[0]
        if height == 0.0:
            forces[0] = hooks[0] = self.stored = 0.0
            return False
        if solver is None:
            k1, k3 = self._bending, self._stretching
            # (K + k1) w + k3 w^3 = K z: the spring only stiffens the cubic's bending.
            place = cubic_deflection(k1 + self.coupling, k3, self.coupling * height)
            force = (k1 + k3 * place * place) * place
            bent = (0.5 * k1 + 0.25 * k3 * place * place) * place * place
        else:
            force, place, bent = solver.lift(height, give)
        forces[0], hooks[0] = force, place
        self.stored = bent + 0.5 * give * force * force
        return place >= self.breaks_at

    def _solve_both(self, solver: ExactPull, heights: list[float]) -> bool:
        forces, hooks, give = self.forces[:, UP], self.hooks[:, UP], self._compliance
        loose = Hold("force", 0.0)
        holds = [Hold("deflection", height, give) if height > 0.0 else loose
                 for height in heights]  # fmt: skip
        if holds[0] is loose and holds[1] is loose:
            forces[:] = hooks[:] = self.stored = 0.0
            return False
        solver.hold(*holds)
        # A hook that the other one lifts the duct away from has come off.
        off = [i for i, force in enumerate((solver.force, solver.second_force)) if force < 0.0]
        if off:
            holds[off[0]] = loose
            solver.hold(*holds)
        forces[0], forces[1] = max(solver.force, 0.0), max(solver.second_force, 0.0)
        hooks[0], hooks[1] = solver.deflection, solver.second_deflection
        self.stored = solver.strain_energy + 0.5 * give * float(forces @ forces)
        if self._steps % STRESS_STEPS:
            return False
        return check_rupture(solver.sample(self._critical), self.threshold).broken

    def assemble_ahead(self) -> None:
        """Nothing: all of a step follows from the hands; see `HapticModel`."""

    def station_of(self, hook: int) -> float | None:
        """Nothing: a hook stays at its grasp; see `HapticModel`."""
        del hook

    def tube_of(self, hook: int) -> int:
        """Return 0, as there is one; see `HapticModel`."""
        del hook
        return 0

    def solved_force(self, deflection: float) -> float:
        """Return the theory's force at a place, solved from rest and without the coupling."""
        return self.theory.pull(self.beam, self.grasps[0]).to_deflection(deflection).force
