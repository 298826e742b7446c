"""The thesis's reference (chapter 3): finite elements that follow large rotations."""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from physics.beam import Beam
from physics.corotational import LAST_OF_HALF, LAST_OF_SPAN, element_state, pull_from_rest
from physics.equilibrium import Equilibrium, NoEquilibrium
from physics.quantity import finite, stations_on

__all__ = ["Fem"]


@dataclass(frozen=True, slots=True)
class Fem:
    """Corotational Euler-Bernoulli beam elements, solved by Newton's method from rest.

    A central grasp is solved as the thesis models it: one half, clamped at one end and guided
    along the pull at the other. A grasp elsewhere is solved on the whole span, with as many
    elements on each side of it. The grasp slides freely along the line between the clamps.

    Attributes
    ----------
    elements
        Number of elements on each side of the grasp, 1 or more; the thesis has 40.
    energetic
        False for the shear force (M1 + M2) / L0 of ANSYS's beam, which reproduces the thesis's
        reference but does not derive from an energy once elements stretch. True for (M1 + M2) / l,
        which does, and which comes to the geometrically exact beam without shear as the elements
        become small.

    Raises
    ------
    ValueError
        If the number of elements is not a whole number above zero.
    """

    elements: int = 40
    energetic: bool = False
    name: ClassVar[str] = "fem"

    def __post_init__(self) -> None:
        if int(self.elements) != self.elements or self.elements < 1:
            raise ValueError(f"elements must be a whole number above 0, got {self.elements}")

    def deflection(self, beam: Beam, grasp: float, force: float) -> float:
        """Return the deflection under a force."""
        return self._pulled(beam, grasp, finite(force, "force", "N"), by_force=True).deflection

    def force(self, beam: Beam, grasp: float, deflection: float) -> float:
        """Return the grasper's whole force at a deflection."""
        deflection = finite(deflection, "deflection", "mm")
        return self._pulled(beam, grasp, deflection, by_force=False).force

    def under_force(
        self, beam: Beam, grasp: float, force: float, stations: NDArray[np.float64]
    ) -> Equilibrium:
        """Return the equilibrium under a force; see `Theory`."""
        at = stations_on(beam.span, stations)
        pulled = self._pulled(beam, grasp, finite(force, "force", "N"), by_force=True)
        return self._sampled(beam, pulled, at)

    def under_deflection(
        self, beam: Beam, grasp: float, deflection: float, stations: NDArray[np.float64]
    ) -> Equilibrium:
        """Return the equilibrium at a deflection of the grasp; see `Theory`."""
        at = stations_on(beam.span, stations)
        deflection = finite(deflection, "deflection", "mm")
        pulled = self._pulled(beam, grasp, deflection, by_force=False)
        return self._sampled(beam, pulled, at)

    def _pulled(self, beam: Beam, grasp: float, load: float, *, by_force: bool) -> "_PulledNodes":
        a, b = beam.grasped_at(grasp)
        count = int(self.elements)
        # A symmetric beam is solved by halves, each with half the force.
        parts = 2.0 if a == b else 1.0
        rest = np.repeat([a / count], count) if a == b else np.repeat([a / count, b / count], count)
        moved = np.empty((rest.size + 1, 3))
        goal = abs(load) / parts if by_force else abs(load)
        share = pull_from_rest(
            rest,
            beam.modulus * beam.area,
            beam.modulus * beam.second_moment,
            self.energetic,
            LAST_OF_HALF if a == b else LAST_OF_SPAN,
            count,
            goal,
            by_force,
            moved,
        )
        if math.isnan(share):
            kind, unit = ("force", "N") if by_force else ("deflection", "mm")
            raise NoEquilibrium(
                f"{kind} must be one at which the elements can balance, got {load:g} {unit}: "
                f"the beam of {beam.span:g} mm grasped at {a:g} mm crushes an element before it"
            )
        # Pulled the other way the beam does the same in the mirror, to the last digit.
        moved[:, 1:] = np.copysign(1.0, load) * moved[:, 1:]
        return _PulledNodes(
            grasp=a,
            force=load if by_force else math.copysign(parts * share, load),
            deflection=float(moved[count, 1]) if by_force else load,
            rest=rest,
            moved=moved,
        )

    def _sampled(self, beam: Beam, pulled: "_PulledNodes", at: NDArray[np.float64]) -> Equilibrium:
        a, span, count = pulled.grasp, beam.span, int(self.elements)
        ei = beam.modulus * beam.second_moment
        state = element_state(
            pulled.rest, pulled.moved, beam.modulus * beam.area, ei, self.energetic
        )
        halved = pulled.rest.size == count
        mirrored = at > (a if halved else span)
        sign = 1.0 - 2.0 * mirrored
        x = mirrored * span + sign * at
        nodes = np.linspace(0.0, a, count + 1)
        if not halved:
            nodes = np.concatenate([nodes, np.linspace(a, span, count + 1)[1:]])
        # A node belongs to the element that ends there.
        e = np.maximum(np.searchsorted(nodes, x) - 1, 0)
        part = (x - nodes[e]) / (nodes[e + 1] - nodes[e])
        chord, t1, t2, shear = state[e, 1], state[e, 2], state[e, 3], state[e, 5]
        places = np.column_stack([nodes, np.zeros_like(nodes)]) + pulled.moved[:, :2]
        straight = (1.0 - part)[:, None] * places[e] + part[:, None] * places[e + 1]
        bulge = pulled.rest[e] * part * (1.0 - part) * (t1 * (1.0 - part) - t2 * part)
        rotation = chord + (t1 * (1.0 - part) * (1.0 - 3.0 * part) + t2 * part * (3.0 * part - 2.0))
        moment = ei / pulled.rest[e] * (t1 * (6.0 * part - 4.0) + t2 * (6.0 * part - 2.0))
        normal_force = _tension(state, e, rotation)
        if not halved:
            # The pull has a part along a section that is turned where it is grasped: half counts.
            grasped = at == a
            other = _tension(state, np.minimum(e + 1, state.shape[0] - 1), rotation)
            normal_force = np.where(grasped, 0.5 * (normal_force + other), normal_force)
        along = straight[:, 0] - bulge * np.sin(chord)
        rotation[(at == 0.0) | (at == span)] = 0.0
        return Equilibrium(
            theory=self.name,
            grasp=a,
            force=pulled.force,
            deflection=pulled.deflection,
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


@dataclass(frozen=True, slots=True, eq=False)
class _PulledNodes:
    """The nodes of a pulled beam, or of its first half where it is symmetric.

    Attributes
    ----------
    grasp
        Distance of the grasp from the first clamp, mm.
    force
        The grasper's whole force, N.
    deflection
        Displacement of the grasp along the pull, mm.
    rest
        (elements,) rest lengths, mm.
    moved
        (elements + 1, 3) displacements along and across, mm, and rotations, rad.
    """

    grasp: float
    force: float
    deflection: float
    rest: NDArray[np.float64]
    moved: NDArray[np.float64]


def _tension(
    state: NDArray[np.float64], e: NDArray[np.intp], rotation: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the part of the force in element e, N, that is normal to a section so turned."""
    # Along an unloaded side all elements pass on the same force, so that this part runs smoothly
    # from one to the next, as the tension of the chords does not.
    chord, tension, shear = state[e, 1], state[e, 4], state[e, 5]
    turned = rotation - chord
    return tension * np.cos(turned) - shear * np.sin(turned)
