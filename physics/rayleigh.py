"""The thesis's general method (chapter 4): Rayleigh's energies of a polynomial curve.

The deflection is v(x) = sum a_i x^i (4.1), of a given degree. With E I the bending stiffness, N an
axial force, q(x), P and M the loads,

    U_B = (E I / 2) int v''^2 dx                      bending energy (4.5)
    W   = int q v dx + sum P v + sum M v'             work of the loads, held (4.2) to (4.4)
    W_CN = (N / 2) int v'^2 dx                        work of N along the shortening (4.8), (4.9)

and the curve makes U_B + W_CN - W stationary among those that the supports allow. In the code the
unknowns are coefficients of Legendre polynomials, not of powers of x, which are nearly dependent
at high degrees. The supports' conditions are C c = 0 (a row each); an orthonormal basis Z of their
null space, from the singular value decomposition of C, leaves Z^T K Z y = Z^T w with c = Z y and
K = E I int v_i'' v_j'' + N int v_i' v_j', integrated by Gauss's rule. The axial force at which that
matrix is singular first is the buckling force.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import Legendre, Polynomial
from numpy.typing import NDArray

from physics.quantity import finite, positive

Load = Callable[[NDArray[np.float64]], NDArray[np.float64]]

# Gauss points per degree of the curve: n points are exact to the degree 2 n - 1, so that loads up
# to 6 times the curve's degree are integrated exactly.
POINTS_PER_DEGREE = 4

# Singular value, of rows of length 1, below which conditions of supports depend on one another.
DEPENDENT = 1e-12


@dataclass(frozen=True, slots=True)
class Support:
    """A place where a beam is held.

    Examples
    --------
    A clamp holds both, a pin the deflection, a guide the slope.

    >>> Support(0.0), Support(50.0, slope=False), Support(100.0, deflection=False)
    ... # doctest: +ELLIPSIS
    (Support(place=0.0, deflection=True, slope=True), ...)
    """

    place: float  # mm from the beam's first end
    deflection: bool = True  # whether it holds the deflection at zero
    slope: bool = True  # whether it holds the slope at zero


@dataclass(frozen=True, slots=True)
class RayleighBeam:
    """A beam whose curve is a polynomial v(x) = sum a_i x^i (4.1) that its supports allow.

    The coefficients make the energy stationary (see the module). At them half the work of the loads
    (4.2) to (4.4) equals bending plus coupling energy, which is the thesis's (4.6) with (4.7); for
    a curve with one free coefficient, as in chapter 5, the two say the same.

    Raises
    ------
    ValueError
        If a number is not above zero, a support is off the beam, the degree leaves no free
        coefficient, or the supports let the beam move without bending.
    """

    length: float  # mm
    bending_stiffness: float  # E I, N mm^2
    supports: tuple[Support, ...]
    degree: int = 3  # of the polynomial

    def __post_init__(self) -> None:
        positive(self.length, "length", "mm")
        positive(self.bending_stiffness, "bending_stiffness", "N mm^2")
        if int(self.degree) != self.degree or self.degree < 2:
            raise ValueError(f"degree must be a whole number from 2, got {self.degree}")
        for support in self.supports:
            self._on_beam(support.place, "support")
        if self._shapes().shape[1] == 0:
            raise ValueError(
                f"degree must leave the supports a free coefficient: above {self.degree}"
            )
        if self._moves_rigidly():
            raise ValueError(
                "supports must hold the beam: two deflections, or a deflection and a slope"
            )

    def bend(
        self,
        *,
        distributed: Load | float = 0.0,
        forces: Sequence[tuple[float, float]] = (),
        moments: Sequence[tuple[float, float]] = (),
        axial_force: float = 0.0,
    ) -> "BentBeam":
        """Return the beam under loads.

        Parameters
        ----------
        distributed
            Load per length q(x), N/mm: one number, or a function of (N,) places in mm, such as a
            `numpy.polynomial.Polynomial`.
        forces, moments
            Point loads as (place in mm, force in N or moment in N mm); moments turn with the slope.
        axial_force
            Axial force N, tension above zero, N.

        Returns
        -------
        BentBeam
            The bent beam.

        Raises
        ------
        ValueError
            If a load is off the beam or no finite number, or the axial force is compression at
            which the beam buckles, or more.
        """
        shapes = self._shapes()
        work = self._work_of(distributed) if callable(distributed) or distributed else 0.0
        load = np.zeros(int(self.degree) + 1) + work
        for place, force in forces:
            load = load + finite(force, "force", "N") * self._row(place, 0, "force")
        for place, moment in moments:
            load = load + finite(moment, "moment", "N mm") * self._row(place, 1, "moment")
        stiffness = self.bending_stiffness * self._energy(2)
        stiffness = stiffness + finite(axial_force, "axial_force", "N") * self._energy(1)
        free = shapes.T @ stiffness @ shapes
        if axial_force < 0.0 and np.linalg.eigvalsh(free)[0] <= 0.0:
            raise ValueError(
                f"axial_force must be above the buckling load of {self.buckling_force():g} N, "
                f"got {axial_force:g} N"
            )
        curve = shapes @ np.linalg.solve(free, shapes.T @ load)
        return BentBeam(
            curve=Legendre(curve, domain=[0.0, self.length]),
            bending_stiffness=self.bending_stiffness,
            axial_force=float(axial_force),
            work=0.5 * float(load @ curve),
        )

    def buckling_force(self) -> float:
        """Return the axial force at which the straight beam buckles."""
        shapes = self._shapes()
        bending = self.bending_stiffness * (shapes.T @ self._energy(2) @ shapes)
        coupling = shapes.T @ self._energy(1) @ shapes
        root = np.linalg.inv(np.linalg.cholesky(bending))
        return -1.0 / float(np.linalg.eigvalsh(root @ coupling @ root.T)[-1])

    def _on_beam(self, place: float, name: str) -> float:
        if not 0.0 <= finite(place, f"place of a {name}", "mm") <= self.length:
            raise ValueError(
                f"place of a {name} must be on the beam, from 0 to {self.length:g} mm, "
                f"got {place:g} mm"
            )
        return float(place)

    def _basis(self, order: int) -> list[Legendre]:
        """Return the order-th derivatives of the curves that Legendre's coefficients weigh."""
        return [
            Legendre.basis(i, domain=[0.0, self.length]).deriv(order)
            for i in range(int(self.degree) + 1)
        ]

    def _row(self, place: float, order: int, name: str) -> NDArray[np.float64]:
        """Return how deflection or slope at a place depends on the coefficients."""
        at = self._on_beam(place, name)
        return np.array([float(curve(at)) for curve in self._basis(order)])

    def _conditions(self) -> NDArray[np.float64]:
        """Return the supports' conditions, one a row, slopes as deflections over the length."""
        rows = [
            self.length**order * self._row(support.place, order, "support")
            for support in self.supports
            for order, held in ((0, support.deflection), (1, support.slope))
            if held
        ]
        return np.array(rows).reshape(-1, int(self.degree) + 1)

    def _shapes(self) -> NDArray[np.float64]:
        """Return the (degree + 1, free) orthonormal coefficients that the supports allow."""
        conditions = self._conditions()
        conditions = conditions / np.linalg.norm(conditions, axis=1, keepdims=True)
        _, sizes, directions = np.linalg.svd(conditions)
        rank = int(np.count_nonzero(sizes > DEPENDENT))
        return np.asarray(directions[rank:].T, dtype=np.float64)

    def _moves_rigidly(self) -> bool:
        """Return whether some straight line, v = a_0 + a_1 x, meets all conditions."""
        conditions = self._conditions()[:, :2]
        return bool(np.linalg.matrix_rank(conditions) < 2)

    def _quadrature(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        nodes, weights = np.polynomial.legendre.leggauss(POINTS_PER_DEGREE * int(self.degree))
        return 0.5 * self.length * (nodes + 1.0), 0.5 * self.length * weights

    def _energy(self, order: int) -> NDArray[np.float64]:
        """Return the matrix of the integral of the squared order-th derivative."""
        x, weights = self._quadrature()
        values = np.array([curve(x) for curve in self._basis(order)])
        return (values * weights) @ values.T

    def _work_of(self, distributed: Load | float) -> NDArray[np.float64]:
        """Return the work of the distributed load on each of the basis curves (4.2)."""
        x, weights = self._quadrature()
        load = distributed(x) if callable(distributed) else np.full_like(x, distributed)
        load = np.broadcast_to(np.asarray(load, dtype=np.float64), x.shape)
        if not np.isfinite(load).all():
            raise ValueError("distributed must be finite all along the beam, N/mm")
        return np.array([curve(x) for curve in self._basis(0)]) @ (weights * load)


@dataclass(frozen=True, slots=True, eq=False)
class BentBeam:
    """A beam bent by loads, as `RayleighBeam` finds it."""

    curve: Legendre  # deflection, mm, over the place, mm: a Legendre series on the beam
    bending_stiffness: float  # E I, N mm^2
    axial_force: float  # N
    work: float  # W_q + W_P + W_M of the loads (4.2) to (4.4), N mm

    @property
    def coefficients(self) -> NDArray[np.float64]:
        """(degree + 1,) a_i of v = sum a_i x^i (4.1), mm^(1 - i)."""
        series = self.curve.convert(kind=Polynomial, domain=[-1.0, 1.0], window=[-1.0, 1.0])
        powers = np.zeros(len(self.curve))
        powers[: len(series)] = series.coef
        return powers

    @property
    def bending_energy(self) -> float:
        """U_B (4.5), N mm."""
        return 0.5 * self.bending_stiffness * self._squared(2)

    @property
    def shortening(self) -> float:
        """How far bending draws the ends together (4.9), to second order in the slope, mm."""
        return 0.5 * self._squared(1)

    def deflection(self, places: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the (N,) deflections, mm, at places along the beam, mm."""
        return self._derivative(0, places)

    def slope(self, places: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the (N,) slopes, no unit, at places along the beam, mm."""
        return self._derivative(1, places)

    def moment(self, places: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the (N,) bending moments E I v'', N mm, at places along the beam, mm."""
        # Above zero where the curve is hollow towards the deflection.
        return self.bending_stiffness * self._derivative(2, places)

    def shear_force(self, places: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the (N,) E I v''', N, the moment's derivatives, at places along the beam, mm."""
        return self.bending_stiffness * self._derivative(3, places)

    def _derivative(self, order: int, places: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(self.curve.deriv(order)(np.asarray(places)), dtype=np.float64)

    def _squared(self, order: int) -> float:
        """Return the integral of the squared order-th derivative over the beam."""
        derivative = self.curve.deriv(order)
        primitive = (derivative * derivative).integ()
        low, high = self.curve.domain
        return float(primitive(high) - primitive(low))
