"""A pulled beam at rest: where its axis is and what it carries."""

from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

__all__ = ["Equilibrium", "NoEquilibrium"]


class NoEquilibrium(ValueError):  # noqa: N818 - named for what happened, not as a fault
    """A load under which a theory finds no equilibrium: it ends before the beam does."""


@dataclass(frozen=True, slots=True, eq=False)
class Equilibrium:
    """A beam in equilibrium under a pull, sampled at N stations.

    Attributes
    ----------
    theory
        Name of the theory that found it.
    grasp
        Distance of the grasp from the first clamp, mm.
    force
        The grasper's whole force, F = 2P of the thesis, N.
    deflection
        Displacement of the grasp along the pull, mm.
    stations
        (N,) distances from the first clamp at rest, mm.
    along
        (N,) positions of the axis along the line between the clamps, mm.
    across
        (N,) positions of the axis along the pull, mm.
    rotation
        (N,) rotations of the sections, from the clamp line towards the pull, rad.
    normal_force
        (N,) tension, N.
    moment
        (N,) bending moments, N mm; above zero where the side away from the pull is stretched.
    normal_stress
        (N,) tension over the section, MPa.
    bending_stress
        (N,) largest bending stress of the section, at its outermost fibre, MPa, never below zero.
    shear_force
        (N,) internal transverse force, N, of the sign that makes it the derivative of `moment`.
    strain_energy
        Energy stored in the whole beam, N mm.
    """

    theory: str
    grasp: float
    force: float
    deflection: float
    stations: NDArray[np.float64]
    along: NDArray[np.float64]
    across: NDArray[np.float64]
    rotation: NDArray[np.float64]
    normal_force: NDArray[np.float64]
    moment: NDArray[np.float64]
    normal_stress: NDArray[np.float64]
    bending_stress: NDArray[np.float64]
    shear_force: NDArray[np.float64]
    strain_energy: float

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if isinstance(value, np.ndarray):
                value.setflags(write=False)

    def part(self, where: slice) -> "Equilibrium":
        """Return the same equilibrium at some of its stations."""
        arrays: dict[str, NDArray[np.float64]] = {
            field.name: getattr(self, field.name)[where]
            for field in fields(self)
            if isinstance(getattr(self, field.name), np.ndarray)
        }
        return replace(self, **arrays)

    @property
    def total_stress(self) -> NDArray[np.float64]:
        """(N,) normal plus bending stress at the outermost fibre, MPa."""
        return self.normal_stress + self.bending_stress
