"""A tear that grows through the section, under a constant force, a stiff grip or a further pull.

At a depth s, a part of the section's height h, a = s h is torn by a straight front and the ligament
b = h - a bears, with area A', centroid e off the axis away from the torn side, second moment I'
about its own centroid and front edge c' from it. `torn_beam` gives the beam this section over the
length `weak_length`, in which the exact beam has the compliance of a crack. The tear grows while

    sigma_N + sigma_B = N / A' + (M + N e) c' / I'

at the front's edge is above the threshold T. Equilibria are found at given depths; where the tear
stands, the depth or deflection at which the stress is T is found by false position. Under a
constant force the load stays and under a grip the deflection; under a further pull the deflection
stays while the tear runs and, where it stands, grows until the stress is T again. docs/theory.md
has the assumptions.
"""

from collections.abc import Callable
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from physics.beam import Beam
from physics.equilibrium import NoEquilibrium
from physics.exact import Exact, ExactPull
from physics.ligament_section import ligament
from physics.pull import break_of
from physics.quantity import positive
from physics.rupture import BreakEvent
from physics.section import Ring
from physics.varying_beam import VaryingBeam

START = 0.1
"""Depth with which a tear begins.

The criterion is about the outermost fibre, which on a round section is a point. The first sliver
takes less from I' than the new edge gains by lying nearer the centroid: the stress there falls by a
few percent before it rises. From about this depth the section is weaker than whole."""
DEEPEST = 0.75
"""Depth at which a tear counts as through: a fifth of a disc is left, which is then strained by
more than its own length under the loads that got so far."""
CLOSE = 1e-12
"""Stress relative to the threshold, or bracket relative to its place, at which a root is found."""
MOST_STEPS = 100
"""Steps in which a root is sought: far more than it takes."""


@dataclass(frozen=True, slots=True, eq=False)
class TearPath:
    """A growing tear, at N depths in the order in which it reaches them."""

    station: float  # mm from the first clamp
    tension_side: int  # side on which it starts: 1 that of the pull, -1 the one away from it
    threshold: float  # stress T that the tissue bears, MPa
    depths: NDArray[np.float64]  # (N,) parts of the section's height that are torn: 0 first
    deflections: NDArray[np.float64]  # (N,) of the grasp, mm
    forces: NDArray[np.float64]  # (N,) the grasper's whole force, N
    # (N,) normal plus bending stress at the front's edge of the ligament, MPa
    stresses: NDArray[np.float64]
    energies: NDArray[np.float64]  # (N,) strain energies of the beam, N mm
    # whether the tear stands at the last depth; if not, nothing bears the load beyond it
    arrested: bool

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if isinstance(value, np.ndarray):
                value.setflags(write=False)


def weak_length(height: float, depth: float) -> float:
    """Return the length of the stretch of beam that a tear weakens.

    Returns
    -------
    float
        4 a b / (3 a + b), mm, with a what is torn of the height and b what is left.

    Notes
    -----
    The length gives the step the compliance of a crack: 4 a takes up the energy that a shallow
    edge crack releases (1.12^2 pi a = 3.95 a), 4 b/3 that of a deep one in bending (1.32 b,
    [Tada, Paris and Irwin]); between them the inverses add. In a plate it is within a tenth of
    the crack's compliance in bending at every depth.

    Examples
    --------
    >>> weak_length(8.0, 0.5)
    4.0
    """
    torn, left = depth * height, (1.0 - depth) * height
    return 4.0 * torn * left / (3.0 * torn + left)


def torn_beam(beam: Beam, station: float, tension_side: int, depth: float) -> Beam:
    """Return a beam with a tear across part of its section."""
    # The ligament is the section over `weak_length`, half of it to each side of the tear as far as
    # there is beam; its `fibre_distances` are those of the front's edge. `tension_side` is 1 for a
    # tear from the side of the pull, -1 from the side away from it; `depth` a part of the height.
    if not 0.0 <= station <= beam.span:
        raise ValueError(f"station must be from 0 to the span of {beam.span} mm, got {station} mm")
    if tension_side not in (1, -1):
        raise ValueError(f"tension_side must be 1 or -1, got {tension_side}")
    ring = Ring(beam.area, beam.second_moment)
    left = ligament(ring, depth)
    if depth == 0.0:
        return beam
    half = 0.5 * weak_length(ring.height, depth)
    first, last = max(station - half, 0.0), min(station + half, beam.span)
    # Whole, weak, whole: a pair of stations at each step, none where the beam ends.
    stations, weak = [first, last], [True, True]
    if first > 0.0:
        stations, weak = [0.0, first, *stations], [False, False, *weak]
    if last < beam.span:
        stations, weak = [*stations, last, beam.span], [*weak, False, False]
    torn = np.array(weak)
    edge = left.front_distance * 2.0 * beam.fibre_distance / ring.height
    return VaryingBeam(
        stations=np.array(stations),
        areas=np.where(torn, left.area, beam.area),
        second_moments=np.where(torn, left.second_moment, beam.second_moment),
        fibre_distances=np.where(torn, edge, beam.fibre_distance),
        modulus=beam.modulus,
        poisson_ratio=beam.poisson_ratio,
        offsets=np.where(torn, -tension_side * left.shift, 0.0),
    )


def tear_under_force(
    theory: Exact,
    beam: Beam,
    grasp: float,
    threshold: float,
    *,
    force: float | None = None,
    start: float = START,
    steps: int = 60,
) -> TearPath | None:
    """Return how a beam tears under a force that does not give way."""
    # `force` is the grasper's whole one, N, that at which the beam begins to tear when None, and
    # `steps` the number of depths from `start` to `DEEPEST`. The path ends where the tear stands,
    # is through, or the law finds no equilibrium; None if the beam does not tear. So for all three.
    tear = _tear(theory, beam, grasp, threshold, start, steps)
    if tear is None:
        return None
    load = tear.event.force if force is None else positive(force, "force", "N")
    return tear.grown(tear.under_force, load, begun=load >= tear.event.force)


def tear_under_grip(
    theory: Exact,
    beam: Beam,
    grasp: float,
    threshold: float,
    *,
    deflection: float | None = None,
    start: float = START,
    steps: int = 60,
) -> TearPath | None:
    """Return how a beam tears while a stiff grip holds it where it is."""
    tear = _tear(theory, beam, grasp, threshold, start, steps)
    if tear is None:
        return None
    event = tear.event
    held = event.deflection if deflection is None else positive(deflection, "deflection", "mm")
    return tear.grown(tear.at_deflection, held, begun=held >= event.deflection)


def tear_by_pull(
    theory: Exact,
    beam: Beam,
    grasp: float,
    threshold: float,
    *,
    start: float = START,
    steps: int = 60,
) -> TearPath | None:
    """Return how a beam tears while a stiff grip pulls it slowly further."""
    tear = _tear(theory, beam, grasp, threshold, start, steps)
    return None if tear is None else tear.pulled_through()


def _tear(
    theory: Exact, beam: Beam, grasp: float, threshold: float, start: float, steps: int
) -> "_Tear | None":
    if not 0.0 < start < DEEPEST:
        raise ValueError(f"start must be above 0 and below {DEEPEST} of the height, got {start}")
    if steps < 2:
        raise ValueError(f"steps must be 2 or more, got {steps}")
    event = break_of(theory.pull(beam, grasp), threshold)
    if event is None:
        return None
    return _Tear(theory, beam, grasp, event, np.linspace(start, DEEPEST, steps))


@dataclass(frozen=True, slots=True)
class _Torn:
    """A torn beam in equilibrium: a row of `TearPath`."""

    depth: float
    deflection: float
    force: float
    stress: float
    energy: float


class _Tear:
    """A beam that tears at one place, and the depths that are looked at."""

    def __init__(
        self,
        theory: Exact,
        beam: Beam,
        grasp: float,
        event: BreakEvent,
        depths: NDArray[np.float64],
    ) -> None:
        self.event = event
        self._theory = theory
        self._beam = beam
        self._grasp = grasp
        self._depths = [float(depth) for depth in depths]
        self._station = event.check.station
        self._side = event.check.tension_side or 1
        self._threshold = event.check.threshold
        self._pull: tuple[float, ExactPull] | None = None

    def under_force(self, depth: float, load: float) -> _Torn:
        return self._sampled(depth, self._at(depth).to_force(load))

    def at_deflection(self, depth: float, load: float) -> _Torn:
        return self._sampled(depth, self._at(depth).to_deflection(load))

    def grown(
        self, solve: Callable[[float, float], _Torn], load: float, *, begun: bool
    ) -> TearPath:
        """Return the path under a load that stays, a force or a deflection."""
        path = [solve(0.0, load)]
        for depth in self._depths if begun else []:
            try:
                torn = solve(depth, load)
                if torn.stress <= self._threshold and path[-1].depth > 0.0:
                    torn = self._root(lambda depth: solve(depth, load), path[-1].depth, depth)
            except NoEquilibrium:
                break
            path.append(torn)
            if torn.stress <= self._threshold * (1.0 + CLOSE):
                return self._path(path, arrested=True)
        return self._path(path, arrested=not begun)

    def pulled_through(self) -> TearPath:
        """Return the path under a growing deflection."""
        path = [self.at_deflection(0.0, self.event.deflection)]
        for depth in self._depths:
            held = path[-1].deflection
            try:
                torn = self.at_deflection(depth, held)
                if torn.stress <= self._threshold:
                    path.extend(self._stopped(path[-1], torn))
                    torn = self._pulled_on(torn)
            except NoEquilibrium:
                break
            path.append(torn)
        return self._path(path, arrested=False)

    def _stopped(self, last: _Torn, torn: _Torn) -> list[_Torn]:
        """Return where a tear stops that ran from `last`, and would be at rest in `torn`."""
        if last.depth == 0.0:
            return [torn]
        if last.stress <= self._threshold * (1.0 + CLOSE):
            return []
        held = last.deflection
        return [self._root(lambda depth: self.at_deflection(depth, held), last.depth, torn.depth)]

    def _pulled_on(self, torn: _Torn) -> _Torn:
        """Return the equilibrium at the same depth that reaches the threshold."""
        low, high = torn.deflection, 1.02 * torn.deflection
        while self.at_deflection(torn.depth, high).stress < self._threshold:
            low, high = high, high + 2.0 * (high - low)
        return self._root(lambda held: self.at_deflection(torn.depth, held), low, high)

    def _root(self, solve: Callable[[float], _Torn], low: float, high: float) -> _Torn:
        """Return the equilibrium between two at which the stress is the threshold."""
        # False position that halves the weight of an end that stays: the Illinois rule.
        torn = solve(high)
        at_low, at_high = solve(low).stress - self._threshold, torn.stress - self._threshold
        for _ in range(MOST_STEPS):
            if abs(high - low) <= CLOSE * abs(high) or at_low == at_high:
                break
            middle = (low * at_high - high * at_low) / (at_high - at_low)
            torn = solve(middle)
            at_middle = torn.stress - self._threshold
            if abs(at_middle) <= CLOSE * self._threshold:
                break
            if (at_middle > 0.0) == (at_high > 0.0):
                at_low *= 0.5
            else:
                low, at_low = high, at_high
            high, at_high = middle, at_middle
        return torn

    def _at(self, depth: float) -> ExactPull:
        if self._pull is None or self._pull[0] != depth:
            torn = torn_beam(self._beam, self._station, self._side, depth)
            self._pull = (depth, self._theory.pull(torn, self._grasp))
        return self._pull[1]

    def _sampled(self, depth: float, pull: ExactPull) -> _Torn:
        torn = pull.sample(np.array([self._station]))
        left = ligament(Ring(self._beam.area, self._beam.second_moment), depth)
        # Above zero where the side that is away from the pull is stretched.
        moment = torn.moment[0] - self._side * left.shift * torn.normal_force[0]
        opens = self._side * moment <= 0.0
        bending = float(torn.bending_stress[0])
        return _Torn(
            depth=depth,
            deflection=torn.deflection,
            force=torn.force,
            stress=float(torn.normal_stress[0]) + (bending if opens else -bending),
            energy=torn.strain_energy,
        )

    def _path(self, path: list[_Torn], *, arrested: bool) -> TearPath:
        return TearPath(
            station=self._station,
            tension_side=self._side,
            threshold=self._threshold,
            depths=np.array([torn.depth for torn in path]),
            deflections=np.array([torn.deflection for torn in path]),
            forces=np.array([torn.force for torn in path]),
            stresses=np.array([torn.stress for torn in path]),
            energies=np.array([torn.energy for torn in path]),
            arrested=arrested,
        )
