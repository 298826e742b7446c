"""A session: one trainee's duct, its inputs, its state and its steps in time. No viewer in it."""

import math
from dataclasses import dataclass
from enum import StrEnum
from threading import RLock

import numpy as np
from numpy.typing import NDArray

from app.simulation import tear_course
from app.simulation.dissection import Dissection, default_preset
from app.simulation.preset import Preset, preset_named, presets
from organ_geometry.organ import Organ
from organ_geometry.skin import BoundSkin, Skin, organ_skin
from organ_geometry.tear import TornPiece
from physics import (
    BreakEvent,
    Cubic,
    Equilibrium,
    NoEquilibrium,
    RuptureCheck,
    Theory,
    break_event,
    check_rupture,
    critical_stations,
)

__all__ = ["Phase", "Reading", "Session", "Surface"]

VERTICES = 5000
"""Vertices of the skin, about: what a browser without a graphics card still draws smoothly."""
GRASP_MARGIN = 0.1
"""Part of the span next to each clamp where the grasper finds no room."""
THRESHOLD_RANGE = (0.25, 2.0)
"""How far the threshold may be moved, in thresholds of the preset."""
FORCE_RANGE = 1.5
"""Largest force, in forces at break with a grasp in the middle."""
RAMP_SECONDS = 0.75
"""Time in which the pull can grow from nothing to the force at break."""
BOUNDLESS_DEFLECTION = 1.0
"""Deflection, in spans, that sets the range of forces for a duct that cannot be broken."""


class Phase(StrEnum):
    """What the duct is going through."""

    INTACT = "intact"
    TEARING = "tearing"
    TORN = "torn"


@dataclass(frozen=True, slots=True, eq=False)
class Surface:
    """One closed surface to draw: its faces stay, its vertices move.

    Attributes
    ----------
    name
        "skin" while the duct is whole, else "first_piece" or "second_piece".
    skin
        The surface at rest.
    vertices
        (V, 3) places, mm; overwritten by each step.
    """

    name: str
    skin: Skin
    vertices: NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class Reading:
    """What the instruments show after a step.

    Attributes
    ----------
    phase
        What the duct is going through.
    force
        The grasper's whole force, N.
    deflection
        Displacement of the grasp, mm; 0 once the duct is in two.
    check
        Highest stress held against the threshold; at the break once it is torn.
    breaks_at
        Load at which the duct would break, or broke; None if it cannot.
    deepest
        Largest deflection of this pull, mm.
    hook
        The duct's axis at the grasp, mm from the first clamp along the clamps, sideways and
        along the pull.
    """

    phase: Phase
    force: float
    deflection: float
    check: RuptureCheck
    breaks_at: BreakEvent | None
    deepest: float
    hook: tuple[float, float, float]


@dataclass(slots=True)
class _Tear:
    pulled: Equilibrium
    event: BreakEvent
    pieces: tuple[TornPiece, TornPiece]
    bound: tuple[BoundSkin, BoundSkin]
    elapsed: float = 0.0


class Session:
    """One duct under one grasper, stepped in time. Safe to call from several threads.

    Inputs out of range are clamped to it and inputs that are no number are ignored: they come
    from a browser. Steps and readings happen whether or not anybody looks.

    Parameters
    ----------
    organ
        The organ.
    preset
        The preset to start with; `default_preset` when None.
    vertices
        About how many vertices the skin shall have.
    """

    def __init__(
        self, organ: Organ, preset: Preset | None = None, *, vertices: int = VERTICES
    ) -> None:
        self._lock = RLock()
        self._organ = organ
        walls = 2 if organ.hollow else 1
        area = walls * 2.0 * math.pi * organ.mean_radius * organ.length
        self._edge_length = math.sqrt(area / vertices)
        self._theory: Theory = Cubic()
        self._tear: _Tear | None = None
        self._shape = 0
        self._take(preset or default_preset(organ))

    @property
    def dissection(self) -> Dissection:
        """The dissection of the chosen preset."""
        return self._dissection

    @property
    def theory(self) -> Theory:
        """The chosen theory."""
        return self._theory

    @property
    def grasp(self) -> float:
        """Distance of the grasp from the first clamp, mm."""
        return self._grasp

    @property
    def grasp_range(self) -> tuple[float, float]:
        """Where the grasper can hold, mm from the first clamp."""
        span = self._dissection.beam.span
        return GRASP_MARGIN * span, (1.0 - GRASP_MARGIN) * span

    @property
    def force_wanted(self) -> float:
        """Force that the pull grows or falls to, N."""
        return self._force_wanted

    @property
    def force_limit(self) -> float:
        """Largest force the grasper gives, N."""
        return self._force_limit

    @property
    def threshold(self) -> float:
        """Stress at which the duct tears, MPa."""
        return self._threshold

    @property
    def threshold_range(self) -> tuple[float, float]:
        """How far the threshold may be moved, MPa."""
        low, high = THRESHOLD_RANGE
        return low * self._preset_threshold, high * self._preset_threshold

    @property
    def shape(self) -> int:
        """Number that changes whenever `surfaces` are others than before."""
        return self._shape

    @property
    def surfaces(self) -> tuple[Surface, ...]:
        """The closed surfaces to draw."""
        return self._surfaces

    def presets_offered(self) -> list[Preset]:
        """Return the presets that this organ can be clamped for.

        Returns
        -------
        list[Preset]
            The presets.
        """
        offered: list[Preset] = []
        for preset in presets().values():
            try:
                Dissection.of(self._organ, preset)
            except ValueError:
                continue
            offered.append(preset)
        return offered

    def set_force(self, force: float) -> None:
        """Ask for a force; the pull grows or falls to it in the next steps.

        Parameters
        ----------
        force
            The grasper's whole force, N.
        """
        with self._lock:
            if self._tear is None and math.isfinite(force):
                self._force_wanted = min(max(float(force), 0.0), self._force_limit)

    def set_grasp(self, grasp: float) -> None:
        """Move the grasp.

        Parameters
        ----------
        grasp
            Distance from the first clamp, mm.
        """
        with self._lock:
            if self._tear is None and math.isfinite(grasp):
                low, high = self.grasp_range
                self._grasp = min(max(float(grasp), low), high)
                self._deepest = 0.0
                self._refresh()

    def set_threshold(self, threshold: float) -> None:
        """Set the stress at which the duct tears.

        Parameters
        ----------
        threshold
            Normal plus bending stress, MPa.
        """
        with self._lock:
            if self._tear is None and math.isfinite(threshold):
                low, high = self.threshold_range
                self._threshold = min(max(float(threshold), low), high)
                self._refresh()

    def choose_preset(self, name: str) -> None:
        """Start anew with another preset.

        Parameters
        ----------
        name
            Name of the preset.

        Raises
        ------
        ValueError
            If there is none of that name or the organ is too short for it; nothing changes.
        """
        with self._lock:
            self._take(preset_named(name))

    def choose_theory(self, theory: Theory) -> None:
        """Solve the duct by another theory, with that theory's own threshold.

        Parameters
        ----------
        theory
            The theory.

        Raises
        ------
        ValueError
            If the theory ends before the preset's break; nothing changes.
        """
        # Outside the lock: a theory's first solution may have to be compiled.
        theory.under_deflection(self._dissection.beam, self._grasp, 0.0, np.empty(0))
        with self._lock:
            if self._tear is not None:
                return
            before = self._theory
            try:
                self._theory = theory
                self._calibrate()
            except ValueError:
                self._theory = before
                self._calibrate()
                raise
            self._deepest = self._pulled.deflection

    def reset(self) -> None:
        """Let go of the duct and make it whole."""
        with self._lock:
            self._force = self._force_wanted = 0.0
            self._deepest = 0.0
            if self._tear is not None:
                self._tear = None
                self._show_whole()
            self._refresh()

    def step(self, seconds: float) -> bool:
        """Advance the duct in time.

        Parameters
        ----------
        seconds
            Length of the step, s.

        Returns
        -------
        bool
            Whether anything has changed since the last step.
        """
        with self._lock:
            if self._tear is not None:
                return self._step_tear(self._tear, seconds)
            if self._force == self._force_wanted and not self._stale:
                return False
            self._stale = False
            before = self._force
            most = self._force_per_second * seconds
            self._force += min(max(self._force_wanted - before, -most), most)
            try:
                self._solve()
            except NoEquilibrium:  # as far as the law carries
                self._force = self._force_wanted = before
                return True
            if self._check.broken:
                self._start_tear(before)
            else:
                self._skin.deform(
                    self._dissection.move(self._pulled, self._transforms),
                    self._surfaces[0].vertices,
                )
            return True

    def reading(self) -> Reading:
        """Return what the instruments show now.

        Returns
        -------
        Reading
            The reading.
        """
        with self._lock:
            tear = self._tear
            if tear is None:
                phase, force, shown = Phase.INTACT, self._force, 1.0
            elif tear.elapsed < tear_course.RUN_SECONDS:
                phase, force, shown = Phase.TEARING, tear.event.force, 1.0
            else:
                phase, force, shown = Phase.TORN, 0.0, 0.0
            rest = self._dissection.frame.T @ (
                self._dissection.axis_point(self._grasp) - self._dissection.axis_point(0.0)
            )
            deflection = shown * self._pulled.deflection
            return Reading(
                phase=phase,
                force=force,
                deflection=deflection,
                check=self._check,
                breaks_at=tear.event if tear else self._breaks_at,
                deepest=self._deepest,
                hook=(float(rest[0]), float(rest[1]), float(rest[2]) + deflection),
            )

    def curve(self, count: int = 80) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the chosen theory's force-deflection curve, past the break and past this pull.

        Parameters
        ----------
        count
            Number of points.

        Returns
        -------
        tuple[NDArray[np.float64], NDArray[np.float64]]
            (count,) deflections, mm, and (count,) forces, N; fewer where the theory ends.
        """
        with self._lock:
            beam, grasp, theory = self._dissection.beam, self._grasp, self._solved
            last = (
                self._breaks_at.deflection if self._breaks_at else BOUNDLESS_DEFLECTION * beam.span
            )
            deflections = np.linspace(0.0, 1.15 * max(last, self._deepest), count)
            nowhere = np.empty(0)
            forces: list[float] = []
            try:
                forces.extend(
                    theory.under_deflection(beam, grasp, deflection, nowhere).force
                    for deflection in deflections.tolist()
                )
            except NoEquilibrium:
                deflections = deflections[: len(forces)]
            return deflections, np.array(forces)

    def _take(self, preset: Preset) -> None:
        """Start anew with a preset; raises before anything has changed."""
        dissection = Dissection.of(self._organ, preset)
        self._dissection = dissection
        self._skin = organ_skin(self._organ, edge_length=self._edge_length).bound_to(
            dissection.driving
        )
        self._transforms = dissection.rest_transforms()
        self._grasp = 0.5 * dissection.beam.span
        self._force = self._force_wanted = 0.0
        self._deepest = 0.0
        self._tear = None
        self._show_whole()
        self._calibrate()

    def _calibrate(self) -> None:
        """Take the preset's threshold for the theory, and the range of forces it calls for."""
        dissection = self._dissection
        self._solved = dissection.theory_for(self._theory)
        beam, middle = dissection.beam, 0.5 * dissection.beam.span
        self._preset_threshold = dissection.preset.threshold(self._solved, beam)
        self._threshold = self._preset_threshold
        event = break_event(self._solved, beam, middle, self._threshold)
        limit = self._farthest_force(middle) if event is None else FORCE_RANGE * event.force
        self._force_limit = _rounded_up(limit)
        self._force_per_second = limit / FORCE_RANGE / RAMP_SECONDS
        self._force = min(self._force, self._force_limit)
        self._force_wanted = min(self._force_wanted, self._force_limit)
        self._refresh()

    def _farthest_force(self, grasp: float) -> float:
        """Return the force at a deflection that no duct needs, or where the theory ends, N."""
        deflection = BOUNDLESS_DEFLECTION * self._dissection.beam.span
        while True:
            try:
                return self._solved.under_deflection(
                    self._dissection.beam, grasp, deflection, np.empty(0)
                ).force
            except NoEquilibrium:
                deflection *= 0.8

    def _refresh(self) -> None:
        """Bring what depends on the inputs up to date."""
        beam = self._dissection.beam
        self._breaks_at = break_event(self._solved, beam, self._grasp, self._threshold)
        self._critical = critical_stations(beam, self._grasp)
        self._stale = True
        self._solve()

    def _solve(self) -> None:
        """Find the equilibrium under the present force and hold it against the threshold."""
        beam, grasp = self._dissection.beam, self._grasp
        stations = self._dissection.beam_stations
        self._pulled = self._solved.under_force(beam, grasp, self._force, stations)
        loaded = self._solved.under_force(beam, grasp, self._force, self._critical)
        self._check = check_rupture(loaded, self._threshold)
        self._deepest = max(self._deepest, self._pulled.deflection)

    def _show_whole(self) -> None:
        rest = self._skin.skin
        self._surfaces = (Surface("skin", rest, rest.vertices.copy()),)
        self._shape += 1
        self._stale = True

    def _start_tear(self, force_before: float) -> None:
        """Tear the duct at the load that met the criterion, between the last step and this."""
        at_break = self._force
        if self._breaks_at is not None:
            at_break = min(max(self._breaks_at.force, force_before), self._force)
        self._force = at_break
        self._solve()
        pieces = self._dissection.torn_at(self._check, edge_length=self._edge_length)
        driving = self._dissection.driving
        self._tear = _Tear(
            pulled=self._pulled,
            event=BreakEvent(at_break, self._pulled.deflection, self._check),
            pieces=pieces,
            bound=(pieces[0].skin.bound_to(driving), pieces[1].skin.bound_to(driving)),
        )
        self._surfaces = tuple(
            Surface(name, piece.skin, piece.skin.vertices.copy())
            for name, piece in zip(("first_piece", "second_piece"), pieces, strict=True)
        )
        self._shape += 1
        self._draw_tear(self._tear)

    def _step_tear(self, tear: _Tear, seconds: float) -> bool:
        if tear.elapsed >= tear_course.SETTLED_SECONDS:
            return False
        tear.elapsed += seconds
        if tear.elapsed >= tear_course.RUN_SECONDS:
            self._force = self._force_wanted = 0.0
        self._draw_tear(tear)
        return True

    def _draw_tear(self, tear: _Tear) -> None:
        front, part = tear_course.front(tear.elapsed), tear_course.swing(tear.elapsed)
        self._dissection.move(tear.pulled, self._transforms, part=part)
        for surface, piece, bound in zip(self._surfaces, tear.pieces, tear.bound, strict=True):
            bound.deform(self._transforms, surface.vertices)
            piece.open(front, surface.vertices)


def _rounded_up(value: float) -> float:
    """Return the value rounded up to two digits, for the end of a scale."""
    unit = 10.0 ** (math.floor(math.log10(value)) - 1)
    return math.ceil(value / unit) * unit
