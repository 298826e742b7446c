"""A beam in equilibrium under a pull: its axis, forces and stresses."""

from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray


class NoEquilibrium(ValueError):  # noqa: N818 - named for what happened, not as a fault
    """A load under which a theory finds no equilibrium: it ends before the beam does."""


@dataclass(frozen=True, slots=True, eq=False)
class Equilibrium:
    """A beam in equilibrium under a pull, sampled at N stations."""

    theory: str  # name of the theory that found it
    grasp: float  # distance from the first clamp, mm
    force: float  # the grasper's whole force, F = 2P of the thesis, N
    deflection: float  # of the grasp along the pull, mm
    stations: NDArray[np.float64]  # (N,) distances from the first clamp at rest, mm
    along: NDArray[np.float64]  # (N,) the axis along the line between the clamps, mm
    across: NDArray[np.float64]  # (N,) the axis along the pull, mm
    rotation: NDArray[np.float64]  # (N,) of the sections, from the clamp line towards the pull, rad
    normal_force: NDArray[np.float64]  # (N,) tension, N
    # (N,) N mm; positive where the side away from the pull is stretched
    moment: NDArray[np.float64]
    normal_stress: NDArray[np.float64]  # (N,) tension over the section, MPa
    # (N,) largest of the section, at its outermost fibre, MPa, never negative
    bending_stress: NDArray[np.float64]
    shear_force: NDArray[np.float64]  # (N,) N, of the sign that makes it the derivative of `moment`
    strain_energy: float  # of the whole beam, N mm

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if isinstance(value, np.ndarray):
                value.setflags(write=False)

    def subset(self, where: slice) -> "Equilibrium":
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
