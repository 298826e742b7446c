"""How stiff an artery is where it leaves another: a solid model beside beams.

Run from the root of the repository: ``python -m benchmarks.artery_joint``, after
``pip install gmsh scikit-fem[all] pypardiso``; some two minutes.

An artery leaves another at a right angle. Both are tubes of one linear material, in quadratic
tetrahedra: a quarter, as a force across the branch's end loads both planes of symmetry evenly or
oddly. Its sections turn further than a beam's that begins at the other's axis, by as much as k mm
more of it would at the root's moment,

    k = (theta - theta_beam) E I / (F L)

    theta       rotation of sections, mean of u_z x over that of x^2
    theta_beam  of a Timoshenko beam, on one of the other artery between its clamped ends
    F, L        force, and its distance from the other's axis

so that an element of length h there has h / (h + k) of its stiffness. Lengths are in mm; E = 1.
"""

import math
import tempfile
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

RUN, BRANCH = (1.45, 0.29), (0.85, 0.17)
"""Outer radius and wall of both: means of drawn cases (docs/anatomy-method.md)."""
RUN_MM, BRANCH_MM = 24.0, 10.0  # length between clamps, and from axis to end
POISSON, SHEAR = 0.45, 0.5  # shear coefficient of a thin tube
ELEMENT_MM = 1.1  # of the beam that stands for it
SIZES = (1.0, 0.7)  # of tetrahedra, in walls
PLANES = {"in the plane of both": 0, "across it": 1}


def section(outer: float, wall: float) -> tuple[float, float]:
    """Return a tube's area, mm^2, and second moment, mm^4."""
    inner = outer - wall
    return math.pi * (outer**2 - inner**2), 0.25 * math.pi * (outer**4 - inner**4)


def quarter(size: float) -> Any:
    """Return a mesh of the quarter at positive x, along the run, and y; z is along the branch."""
    gmsh, skfem = import_module("gmsh"), import_module("skfem")
    (ro, rw), (bo, bw) = RUN, BRANCH
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    for option in ("ExtendFromBoundary", "FromPoints"):
        gmsh.option.setNumber(f"Mesh.MeshSize{option}", 0)
    occ = gmsh.model.occ

    def tube(outer: float, wall: float, *line: float) -> list[tuple[int, int]]:
        solid = occ.addCylinder(*line, outer), occ.addCylinder(*line, outer - wall)
        return occ.cut([(3, solid[0])], [(3, solid[1])])[0]

    def cut_quarter(parts: list[tuple[int, int]]) -> list[tuple[int, int]]:
        return occ.intersect(parts, [(3, occ.addBox(0.0, 0.0, -99.0, 99.0, 99.0, 198.0))])[0]

    along = (-0.5 * RUN_MM, 0.0, 0.0, RUN_MM, 0.0, 0.0)
    branch = occ.cut(tube(bo, bw, 0, 0, 0, 0, 0, BRANCH_MM), [(3, occ.addCylinder(*along, ro))])[0]
    run = occ.cut(tube(ro, rw, *along), [(3, occ.addCylinder(0, 0, 0, 0, 0, BRANCH_MM, bo - bw))])
    occ.fragment(cut_quarter(run[0]), cut_quarter(branch))
    occ.synchronize()

    def length(_dim: int, _tag: int, x: float, y: float, z: float, _now: float) -> float:
        off = math.hypot(math.hypot(x, y) - bo, z - math.sqrt(max(ro**2 - y**2, 0.0)))
        on_branch = z > ro and math.hypot(x, y) < 1.01 * bo
        return min(0.1 * size * bw + 0.25 * off, size * (bw if on_branch else rw))

    gmsh.model.mesh.setSizeCallback(length)
    gmsh.model.mesh.generate(3)
    gmsh.model.mesh.setOrder(2)
    gmsh.model.mesh.optimize("HighOrder")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "joint.msh"
        gmsh.write(str(path))
        gmsh.finalize()
        return skfem.MeshTet2.load(str(path))


def beam_rotation(stations: Floats, across: int) -> Floats:
    """Return how beams turn under a unit force at the branch's end, at stations along that."""
    area, moment = section(*RUN)
    modulus, half = 0.5 / (1.0 + POISSON), 0.5 * RUN_MM
    if across:  # the run is twisted
        root = BRANCH_MM * half / (2.0 * modulus * 2.0 * moment)
    else:  # it is bent by half of the moment on either side
        couple = 0.5 * BRANCH_MM
        stiff = SHEAR * modulus * area
        push = couple * half**2 / 2.0 / moment / (half**3 / 3.0 / moment + half / stiff)
        root = (couple * half - 0.5 * push * half**2) / moment
    return root + (BRANCH_MM * stations - 0.5 * stations**2) / section(*BRANCH)[1]


def further(mesh: Any, across: int) -> float:
    """Return k, mm, of a force in the plane of both tubes or across it."""
    skfem, pardiso = import_module("skfem"), import_module("pypardiso")
    elasticity = import_module("skfem.models.elasticity")
    basis = skfem.Basis(mesh, skfem.ElementVector(skfem.ElementTetP2()))
    stiffness = skfem.asm(
        elasticity.linear_elasticity(*elasticity.lame_parameters(1.0, POISSON)), basis
    )
    end = mesh.facets_satisfying(lambda x: np.abs(x[2] - BRANCH_MM) < 1e-6, boundaries_only=True)
    traction = 1.0 / section(*BRANCH)[0]
    load = skfem.asm(skfem.LinearForm(lambda v, _: traction * v[across]), basis.boundary(end))
    held: list[Any] = []
    for axis, odd in ((0, across == 0), (1, across == 1)):
        # Across a plane of symmetry nothing moves; where the load is odd, nothing along it.
        names = [f"u^{each + 1}" for each in range(3) if (each != axis) == odd]
        held.append(basis.get_dofs(lambda x, a=axis: np.abs(x[a]) < 1e-6).all(names))
    held.append(basis.get_dofs(lambda x: np.abs(x[0] - 0.5 * RUN_MM) < 1e-6).all())
    fixed = np.unique(np.concatenate(held))
    moved = skfem.solve(*skfem.condense(stiffness, load, D=fixed), solver=pardiso.spsolve)
    # Sections between the joint's disturbance and the loaded end's.
    x, u, volume = basis.global_coordinates(), basis.interpolate(moved), basis.dx
    slices = np.linspace(RUN[0] + 1.5 * BRANCH[0], BRANCH_MM - 0.3, 17)
    at = np.digitize(x[2], slices) - 1
    branch = (np.hypot(x[0], x[1]) < 1.02 * BRANCH[0]) & (at >= 0) & (at < slices.size - 1)

    def summed(values: Any) -> Any:
        return np.bincount(at[branch], (np.asarray(values) * volume)[branch], slices.size - 1)

    turned = -summed(u[2] * x[across]) / summed(x[across] ** 2)
    stations = summed(x[2]) / summed(np.ones_like(volume))
    more = float(np.mean(turned - beam_rotation(stations, across)))
    return more * section(*BRANCH)[1] / BRANCH_MM


def main() -> None:
    """Print how stiff the first element is, in both planes and in their mean."""
    for size in SIZES:
        mesh = quarter(size)
        found = {name: further(mesh, across) for name, across in PLANES.items()}
        found["mean"] = float(np.mean(list(found.values())))
        count = 3 * mesh.doflocs.shape[1]
        print(f"tetrahedra of {size:g} walls, {count:,} unknowns")
        for name, more in found.items():
            factor = ELEMENT_MM / (ELEMENT_MM + more)
            print(f"  {name}: k = {more:.3f} mm, factor {factor:.2f}")


if __name__ == "__main__":
    main()
