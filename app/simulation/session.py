"""A session: one trainee's duct, its inputs, its state and its steps in time. No viewer in it."""

import math
from dataclasses import dataclass
from enum import StrEnum
from threading import RLock

import numpy as np
from numpy.typing import NDArray

from app.simulation import tear_course
from app.simulation.dissection import PIECES, Dissection, default_preset, fits
from app.simulation.preset import Preset, preset_named, presets
from organ_geometry.organ import Organ
from organ_geometry.skin import BoundSkin, Skin, organ_skin
from organ_geometry.tear import TornPiece
from physics import (
    Beam,
    BreakEvent,
    Cubic,
    Equilibrium,
    NoEquilibrium,
    Pull,
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


@dataclass(frozen=True, slots=True, eq=False)
class _Model:
    """What is solved: found in full before a session takes it, so that a refusal changes nothing.

    Attributes
    ----------
    dissection
        The organ between its clamps.
    theory
        The theory that was chosen.
    solved
        The theory as it solves this organ.
    threshold
        The preset's threshold for it, MPa.
    force_limit
        Largest force the grasper gives, N.
    force_per_second
        How fast the pull grows, N/s.
    """

    dissection: Dissection
    theory: Theory
    solved: Theory
    threshold: float
    force_limit: float
    force_per_second: float

    @classmethod
    def of(cls, dissection: Dissection, theory: Theory) -> "_Model":
        solved, beam = dissection.theory_for(theory), dissection.beam
        threshold = dissection.preset.threshold(solved, beam)
        middle = 0.5 * beam.span
        event = break_event(solved, beam, middle, threshold)
        if event is None:
            limit = _farthest_force(solved, beam, middle)
        else:
            limit = FORCE_RANGE * event.force
        return cls(
            dissection,
            theory,
            solved,
            threshold,
            _rounded_up(limit),
            limit / FORCE_RANGE / RAMP_SECONDS,
        )


def _farthest_force(theory: Theory, beam: Beam, grasp: float) -> float:
    """Return the force at a deflection that no duct needs, or where the theory ends, N."""
    deflection = BOUNDLESS_DEFLECTION * beam.span
    while True:
        try:
            return theory.under_deflection(beam, grasp, deflection, np.empty(0)).force
        except NoEquilibrium:
            deflection *= 0.8


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
        self._edge_length = min(math.sqrt(area / vertices), organ.mean_radius)
        self._skin = organ_skin(organ, edge_length=self._edge_length)
        self._tear: _Tear | None = None
        self._shape = 0
        self._force: float = 0.0
        self._force_wanted: float = 0.0
        self._deepest: float = 0.0
        dissection = Dissection.of(organ, preset or default_preset(organ))
        self._start(_Model.of(dissection, Cubic()))

    @property
    def dissection(self) -> Dissection:
        """The dissection of the chosen preset."""
        return self._model.dissection

    @property
    def theory(self) -> Theory:
        """The chosen theory."""
        return self._model.theory

    @property
    def grasp(self) -> float:
        """Distance of the grasp from the first clamp that was asked for, mm."""
        return self._grasp_wanted

    @property
    def grasp_range(self) -> tuple[float, float]:
        """Where the grasper can hold, mm from the first clamp."""
        span = self._model.dissection.beam.span
        return GRASP_MARGIN * span, (1.0 - GRASP_MARGIN) * span

    @property
    def force_wanted(self) -> float:
        """Force that the pull grows or falls to, N."""
        return self._force_wanted

    @property
    def force_limit(self) -> float:
        """Largest force the grasper gives, N."""
        return self._model.force_limit

    @property
    def threshold(self) -> float:
        """Stress at which the duct tears that was asked for, MPa."""
        return self._threshold_wanted

    @property
    def threshold_range(self) -> tuple[float, float]:
        """How far the threshold may be moved, MPa."""
        low, high = THRESHOLD_RANGE
        return low * self._model.threshold, high * self._model.threshold

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
        return [preset for preset in presets().values() if fits(self._organ, preset)]

    def set_force(self, force: float) -> None:
        """Ask for a force; the pull grows or falls to it in the next steps.

        Parameters
        ----------
        force
            The grasper's whole force, N.
        """
        if self._tear is None and math.isfinite(force):
            self._force_wanted = min(max(float(force), 0.0), self._model.force_limit)

    def set_grasp(self, grasp: float) -> None:
        """Ask for another grasp, taken with the next step.

        Parameters
        ----------
        grasp
            Distance from the first clamp, mm.
        """
        if self._tear is None and math.isfinite(grasp):
            low, high = self.grasp_range
            self._grasp_wanted = min(max(float(grasp), low), high)

    def set_threshold(self, threshold: float) -> None:
        """Ask for another stress at which the duct tears, taken with the next step.

        Parameters
        ----------
        threshold
            Normal plus bending stress, MPa.
        """
        if self._tear is None and math.isfinite(threshold):
            low, high = self.threshold_range
            self._threshold_wanted = min(max(float(threshold), low), high)

    def choose_preset(self, name: str) -> None:
        """Start anew with another preset; a torn duct is reset first, by `reset`.

        Parameters
        ----------
        name
            Name of the preset.

        Raises
        ------
        ValueError
            If there is none of that name, the organ is too short for it, or the theory ends before
            its break; nothing changes.
        """
        dissection = Dissection.of(self._organ, preset_named(name))
        model = _Model.of(dissection, self._model.theory)
        with self._lock:
            if self._tear is None:
                self._start(model)

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
        model = _Model.of(self._model.dissection, theory)
        with self._lock:
            if self._tear is None:
                self._model = model
                self._threshold_wanted = model.threshold
                self._force_wanted = min(self._force_wanted, model.force_limit)
                self._force = min(self._force, model.force_limit)
                self._deepest = 0.0
                self._refresh()

    def reset(self) -> None:
        """Let go of the duct and make it whole."""
        with self._lock:
            self._force = self._force_wanted = 0.0
            self._deepest = 0.0
            if self._tear is not None:
                self._tear = None
                self._show_whole()
            self._stale = True

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
            moved = self._grasp != self._grasp_wanted
            if moved or self._threshold != self._threshold_wanted:
                self._deepest = 0.0 if moved else self._deepest
                self._refresh()
            if self._force == self._force_wanted and not self._stale:
                return False
            self._stale = False
            before = self._force, self._deepest
            most = self._model.force_per_second * seconds
            self._force += min(max(self._force_wanted - self._force, -most), most)
            try:
                self._solve()
            except NoEquilibrium:  # as far as the law carries
                self._force = self._force_wanted = before[0]
                return True
            if self._check.broken:
                self._start_tear(*before)
            else:
                self._bound.deform(
                    self._model.dissection.move(self._pulled, self._transforms),
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
            deflection = shown * self._pulled.deflection
            slide = shown * self._slide
            rest = self._grasp_at_rest
            return Reading(
                phase=phase,
                force=force,
                deflection=deflection,
                check=self._check,
                breaks_at=tear.event if tear else self._breaks_at,
                deepest=self._deepest,
                hook=(float(rest[0]) + slide, float(rest[1]), float(rest[2]) + deflection),
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
            beam = self._model.dissection.beam
            last = (
                self._breaks_at.deflection if self._breaks_at else BOUNDLESS_DEFLECTION * beam.span
            )
            deflections = np.linspace(0.0, 1.15 * max(last, self._deepest), count)
            pull = Pull(self._model.solved, beam, self._grasp)
        nowhere = np.empty(0)
        forces: list[float] = []
        try:
            forces.extend(pull.to_deflection(each, nowhere).force for each in deflections.tolist())
        except NoEquilibrium:
            deflections = deflections[: len(forces)]
        return deflections, np.array(forces)

    def _start(self, model: "_Model") -> None:
        """Start anew with a model that has been found."""
        self._model = model
        self._bound = self._skin.bound_to(model.dissection.driving)
        self._transforms = model.dissection.rest_transforms()
        self._grasp_wanted = 0.5 * model.dissection.beam.span
        self._threshold_wanted = model.threshold
        self._force = self._force_wanted = 0.0
        self._deepest = 0.0
        self._tear = None
        self._show_whole()
        self._refresh()

    def _refresh(self) -> None:
        """Bring what depends on the inputs up to date; where the law ends, give way."""
        self._grasp, self._threshold = self._grasp_wanted, self._threshold_wanted
        dissection, solved = self._model.dissection, self._model.solved
        beam = dissection.beam
        self._grasp_at_rest = dissection.frame.T @ (
            dissection.axis_point(self._grasp) - dissection.axis_point(0.0)
        )
        self._breaks_at = break_event(solved, beam, self._grasp, self._threshold)
        stations = dissection.beam_stations
        critical = critical_stations(beam, self._grasp, theory=solved)
        self._driven = slice(0, stations.size)
        self._loaded = slice(stations.size, None)
        self._stations = np.concatenate([stations, critical])
        self._grasped = stations.size + int(np.searchsorted(critical, self._grasp))
        self._pull = Pull(solved, beam, self._grasp)
        self._stale = True
        while True:
            try:
                self._solve()
            except NoEquilibrium:
                self._force *= 0.9
                self._force_wanted = self._force
            else:
                return

    def _solve(self) -> None:
        """Find the equilibrium under the present force and hold it against the threshold."""
        pulled = self._pull.to_force(self._force, self._stations)
        self._pulled = pulled.part(self._driven)
        self._slide = float(pulled.along[self._grasped]) - self._grasp
        self._check = check_rupture(pulled.part(self._loaded), self._threshold)
        self._deepest = max(self._deepest, pulled.deflection)

    def _show_whole(self) -> None:
        self._surfaces = (Surface("skin", self._skin, self._skin.vertices.copy()),)
        self._shape += 1
        self._stale = True

    def _start_tear(self, force_before: float, deepest_before: float) -> None:
        """Tear the duct at the load that met the criterion, between the last step and this."""
        at_break = self._force
        if self._breaks_at is not None:
            at_break = min(max(self._breaks_at.force, force_before), self._force)
        self._force, self._deepest = at_break, deepest_before
        self._solve()
        pieces = self._model.dissection.torn_at(self._check, edge_length=self._edge_length)
        driving = self._model.dissection.driving
        self._tear = _Tear(
            pulled=self._pulled,
            event=BreakEvent(at_break, self._pulled.deflection, self._check),
            pieces=pieces,
            bound=(pieces[0].skin.bound_to(driving), pieces[1].skin.bound_to(driving)),
        )
        self._surfaces = tuple(
            Surface(name, piece.skin, piece.skin.vertices.copy())
            for name, piece in zip(PIECES, pieces, strict=True)
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
        self._model.dissection.move(tear.pulled, self._transforms, part=part)
        for surface, piece, bound in zip(self._surfaces, tear.pieces, tear.bound, strict=True):
            bound.deform(self._transforms, surface.vertices)
            piece.open(front, surface.vertices)


def _rounded_up(value: float) -> float:
    """Return the value rounded up to two digits, for the end of a scale."""
    unit = 10.0 ** (math.floor(math.log10(value)) - 1)
    return math.ceil(value / unit) * unit
