"""The thesis's reference (chapter 3): finite elements that follow large rotations."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from physics.beam import Beam
from physics.corotational import LAST_OF_HALF, LAST_OF_SPAN, element_state, pull_from_rest
from physics.equilibrium import Equilibrium, NoEquilibrium
from physics.pull import Pull
from physics.quantity import finite, stations_on


@dataclass(frozen=True, slots=True)
class Fem:
    """Corotational Euler-Bernoulli beam elements, solved by Newton's method from rest.

    A central grasp is solved as the thesis models it: one half, clamped at one end and guided
    along the pull at the other. A grasp elsewhere is solved on the whole span, with as many
    elements on each side of it. The grasp slides freely along the line between the clamps.
    """

    elements: int = 40  # on each side of the grasp, 1 or more; the thesis has 40
    # True: shear (M1 + M2) / l, which derives from an energy and converges to the geometrically
    # exact beam without shear. False: (M1 + M2) / L0 of ANSYS's beam, the thesis's reference, which
    # derives from none once elements stretch
    energetic: bool = False
    name: ClassVar[str] = "fem"
    takes_all_sections: ClassVar[bool] = False

    def __post_init__(self) -> None:
        if int(self.elements) != self.elements or self.elements < 1:
            raise ValueError(f"elements must be a whole number above 0, got {self.elements}")

    @property
    def options(self) -> Mapping[str, object]:
        """Nothing: `theory_named` takes it by its name alone."""
        return {}

    def pull(self, beam: Beam, grasp: float) -> "FemPull":
        """Return a beam at rest, grasped at a distance from the first clamp, mm."""
        return FemPull(self, beam, grasp)


class FemPull(Pull):
    """Elements that are pulled, each time from rest; see `Fem`."""

    def __init__(self, theory: Fem, beam: Beam, grasp: float) -> None:
        super().__init__(beam, grasp)
        self._theory = theory
        a, b = beam.grasped_at(grasp)
        count = int(theory.elements)
        # A symmetric beam is solved by halves, each with half the force.
        self._halved = a == b
        lengths = [a / count] if self._halved else [a / count, b / count]
        self._rest = np.repeat(lengths, count)  # (elements,) rest lengths, mm
        # (elements + 1, 3) displacements along and across, mm, and rotations, rad.
        self._moved = np.zeros((self._rest.size + 1, 3))

    def to_force(self, force: float) -> Self:
        """Find the equilibrium under a whole force, N."""
        force = finite(force, "force", "N")
        self._solve(force, by_force=True)
        self.force, self.deflection = force, float(self._moved[int(self._theory.elements), 1])
        return self

    def to_deflection(self, deflection: float) -> Self:
        """Find the equilibrium at a displacement of the grasp, mm."""
        deflection = finite(deflection, "deflection", "mm")
        half_force = self._solve(deflection, by_force=False)
        halves = 2.0 if self._halved else 1.0
        self.force, self.deflection = math.copysign(halves * half_force, deflection), deflection
        return self

    def _solve(self, load: float, *, by_force: bool) -> float:
        """Move the nodes and return the force on them, N, of one half where it is solved by it."""
        beam, theory = self.beam, self._theory
        moved = np.empty_like(self._moved)
        half_force = pull_from_rest(
            self._rest,
            beam.modulus * beam.area,
            beam.modulus * beam.second_moment,
            theory.energetic,
            LAST_OF_HALF if self._halved else LAST_OF_SPAN,
            int(theory.elements),
            abs(load) / (2.0 if by_force and self._halved else 1.0),
            by_force,
            moved,
        )
        if math.isnan(half_force):
            kind, unit = ("force", "N") if by_force else ("deflection", "mm")
            raise NoEquilibrium(
                f"{kind} must be one at which the elements can balance, got {load:g} {unit}: the "
                f"beam of {beam.span:g} mm grasped at {self.grasp:g} mm crushes an element before "
                f"it"
            )
        # Pulled the other way the beam does the same in the mirror, to the last digit.
        moved[:, 1:] = np.copysign(1.0, load) * moved[:, 1:]
        self._moved = moved
        return half_force

    def sample(self, stations: NDArray[np.float64]) -> Equilibrium:
        """Return the present equilibrium at stations, mm from the first clamp."""
        at = stations_on(self.beam.span, stations)
        beam, theory, halved = self.beam, self._theory, self._halved
        a, span, count = self.grasp, beam.span, int(theory.elements)
        ei = beam.modulus * beam.second_moment
        state = element_state(
            self._rest, self._moved, beam.modulus * beam.area, ei, theory.energetic
        )
        mirrored = at > (a if halved else span)
        sign = 1.0 - 2.0 * mirrored
        x = mirrored * span + sign * at
        nodes = np.linspace(0.0, a, count + 1)
        if not halved:
            nodes = np.concatenate([nodes, np.linspace(a, span, count + 1)[1:]])
        # A node belongs to the element that ends there.
        e = np.maximum(np.searchsorted(nodes, x) - 1, 0)
        u = (x - nodes[e]) / (nodes[e + 1] - nodes[e])
        chord, t1, t2, shear = state[e, 1], state[e, 2], state[e, 3], state[e, 5]
        places = np.column_stack([nodes, np.zeros_like(nodes)]) + self._moved[:, :2]
        straight = (1.0 - u)[:, None] * places[e] + u[:, None] * places[e + 1]
        bulge = self._rest[e] * u * (1.0 - u) * (t1 * (1.0 - u) - t2 * u)
        rotation = chord + (t1 * (1.0 - u) * (1.0 - 3.0 * u) + t2 * u * (3.0 * u - 2.0))
        moment = ei / self._rest[e] * (t1 * (6.0 * u - 4.0) + t2 * (6.0 * u - 2.0))
        normal_force = _tension(state, e, rotation)
        if not halved:
            # The pull has a part along a section that is turned where it is grasped: half counts.
            grasped = at == a
            other = _tension(state, np.minimum(e + 1, state.shape[0] - 1), rotation)
            normal_force = np.where(grasped, 0.5 * (normal_force + other), normal_force)
        along = straight[:, 0] - bulge * np.sin(chord)
        rotation[(at == 0.0) | (at == span)] = 0.0
        return Equilibrium(
            theory=theory.name,
            grasp=a,
            force=self.force,
            deflection=self.deflection,
            stations=at.copy(),
            along=mirrored * span + sign * along,
            across=straight[:, 1] + bulge * np.cos(chord),
            rotation=sign * rotation,
            normal_force=normal_force,
            moment=moment,
            normal_stress=normal_force / beam.area,
            bending_stress=np.abs(moment) * beam.fibre_distance / beam.second_moment,
            shear_force=sign * shear,
            strain_energy=(2.0 if halved else 1.0) * float(state[:, 6].sum()),
        )


def _tension(
    state: NDArray[np.float64], e: NDArray[np.intp], rotation: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the part of the force in element e, N, that is normal to a section so turned."""
    # Along an unloaded side all elements pass on the same force, so that this part runs smoothly
    # from one to the next, as the tension of the chords does not.
    chord, tension, shear = state[e, 1], state[e, 4], state[e, 5]
    turned = rotation - chord
    return tension * np.cos(turned) - shear * np.sin(turned)
