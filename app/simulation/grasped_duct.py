"""A duct grasped at one place: its equilibria under one load after the other."""

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from app.simulation.model import BOUNDLESS_DEFLECTION, Model
from physics import (
    BreakEvent,
    NoEquilibrium,
    break_of,
    check_rupture,
    critical_stations,
)

__all__ = ["GraspedDuct", "Load"]

PAST_BREAK = 1.15
"""How far a hand or a curve goes, in deflections at break."""


@dataclass(frozen=True, slots=True)
class Load:
    """What the grasper imposes on the duct.

    Attributes
    ----------
    kind
        "force" in N, or "deflection" of the grasp in mm.
    amount
        How much of it.
    """

    kind: Literal["force", "deflection"]
    amount: float


class GraspedDuct:
    """A model's beam grasped at one place, in its last equilibrium.

    What it comes to is a function of its parameters and of the loads borne so far, to the bit.

    Parameters
    ----------
    model
        What is solved.
    grasp
        Distance of the grasp from the first clamp, mm.
    threshold
        Stress at which the duct tears, MPa.

    Attributes
    ----------
    model, grasp, threshold
        As given.
    stations
        (N,) where the beam is sampled, mm: at the driving points and wherever the stress can be
        highest, in this order.
    pulled
        The last equilibrium, sampled there.
    driven
        The same at the driving points.
    check
        The same, held against the threshold.
    """

    def __init__(self, model: Model, grasp: float, threshold: float) -> None:
        self.model, self.grasp, self.threshold = model, grasp, threshold
        dissection = model.dissection
        driving = dissection.beam_stations
        critical = critical_stations(dissection.beam, grasp)
        self._driving, self._critical = slice(0, driving.size), slice(driving.size, None)
        self.stations = np.concatenate([driving, critical])
        self._grasped = driving.size + int(np.searchsorted(critical, grasp))
        place = dissection.axis_point(grasp) - dissection.axis_point(0.0)
        along, sideways, up = (dissection.frame.T @ place).tolist()
        self._rest = float(along), float(sideways), float(up)
        self._pull = model.theory.pull(dissection.beam, grasp)
        self.bear(Load("force", 0.0))

    def renewed(self) -> "GraspedDuct":
        """Return the same duct at rest, as if it had never been pulled."""
        duct = GraspedDuct(self.model, self.grasp, self.threshold)
        if "breaks_at" in self.__dict__:
            duct.__dict__["breaks_at"] = self.breaks_at
        return duct

    def bear(self, load: Load) -> None:
        """Find the equilibrium under a load."""
        if load.kind == "force":
            pulled = self._pull.to_force(load.amount).sample(self.stations)
        else:
            pulled = self._pull.to_deflection(load.amount).sample(self.stations)
        self.pulled = pulled
        self.driven = pulled.part(self._driving)
        self.check = check_rupture(pulled.part(self._critical), self.threshold)

    @cached_property
    def breaks_at(self) -> BreakEvent | None:
        """Load at which the duct would break; None if it cannot."""
        return self.loaded_to(1.0)

    def loaded_to(self, part: float) -> BreakEvent | None:
        """Return the load under which the highest stress is a part of the threshold."""
        beam = self.model.dissection.beam
        return break_of(self.model.theory.pull(beam, self.grasp), part * self.threshold)

    @property
    def deflection_limit(self) -> float:
        """Largest deflection that a hand can ask for, mm."""
        event = self.breaks_at
        if event is None:
            return BOUNDLESS_DEFLECTION * self.model.dissection.beam.span
        return PAST_BREAK * event.deflection

    def hook(self, part: float = 1.0) -> tuple[float, float, float]:
        """Return where the axis at the grasp is."""
        x, y, z = self._rest
        slide = float(self.pulled.along[self._grasped]) - self.grasp
        return x + part * slide, y, z + part * self.pulled.deflection

    def across(self, station: float) -> float:
        """Return how far the axis is pulled at a station."""
        if station == self.grasp:
            return self.pulled.deflection
        return float(np.interp(station, self.driven.stations, self.driven.across))

    def station_at(self, place: NDArray[np.float64]) -> float:
        """Return where along the duct a place in space is."""
        dissection, driven = self.model.dissection, self.driven
        positions = dissection.driving.positions
        axis = (positions - dissection.axis_point(0.0)) @ dissection.frame
        axis[:, 0] += driven.along - driven.stations
        axis[:, 2] += driven.across
        way = np.diff(axis, axis=0)
        away = place - axis[:-1]
        part = np.clip(np.einsum("ni,ni->n", away, way) / np.einsum("ni,ni->n", way, way), 0.0, 1.0)
        off = np.linalg.norm(away - part[:, None] * way, axis=1)
        nearest = int(np.argmin(off))
        before, after = driven.stations[nearest : nearest + 2].tolist()
        return float(before + part[nearest] * (after - before))

    def curve(
        self, count: int, *, deepest: float = 0.0
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the theory's force-deflection curve, past the break and past a deflection."""
        last = max(self.deflection_limit, PAST_BREAK * deepest)
        deflections = np.linspace(0.0, last, count)
        pull = self.model.theory.pull(self.model.dissection.beam, self.grasp)
        forces: list[float] = []
        try:
            forces.extend(pull.to_deflection(each).force for each in deflections.tolist())
        except NoEquilibrium:
            deflections = deflections[: len(forces)]
        return deflections, np.array(forces)
