"""Measures of a run, by their published names, taken while it runs (docs/measures.md)."""

import math

import msgspec

from app.simulation.exercises.critical_view import Closing, CriticalView
from app.simulation.exercises.errors import Incidents
from app.simulation.exercises.errors.pace import PullErrorFinder
from app.simulation.exercises.exercise import Exercise
from app.simulation.inputs.clock import TICK_SECONDS
from app.simulation.inputs.inputs import Structure
from app.simulation.tissue.planar_tissue import PlanarTissue
from physics import BreakEvent

# Force above which a run's time is counted, over the force at break at mid-span.
TASK_THRESHOLD = 0.5
Place = tuple[float, float, float]

RATE_TICKS = 3
RATE_SECONDS = RATE_TICKS * TICK_SECONDS
"""s over which a loading rate is taken: a mouse moves too unevenly from one tick to the next."""
# A movement has ended when its speed falls below this part of its peak speed.
SLOW = 0.1
# Fewest steps of a movement whose third differences give a useful jerk: half a second.
LEAST_STEPS = round(0.5 / TICK_SECONDS)
# Smoothness of a reach of minimum jerk, -ln(204.8): no complete movement is smoother.
SMOOTHEST = -math.log(204.8)
# Third differences miss some jerk at both ends of a movement; a result this far above `SMOOTHEST`
# is taken for that and cut to it, one farther above is none.
TICKS_SMOOTH_AWAY = 0.05


class TearMeasures(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What broke, when and under which load."""

    criterion: str
    station_mm: float  # from the first clamp
    side: str  # where it started: "pull", "away" from it, or "even" where nothing bends
    time_s: float  # from the start of the run
    force_N: float  # noqa: N815
    deflection_mm: float
    normal_stress_MPa: float  # noqa: N815
    bending_stress_MPa: float  # noqa: N815
    threshold_MPa: float  # noqa: N815


class Measures(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The measures of a run (docs/measures.md); None where a run gives none."""

    time_s: float
    time_in_tissue_s: float  # in which the duct was held
    maximum_force_N: float  # noqa: N815
    mean_absolute_nonzero_force_N: float | None  # |F| over the ticks with force  # noqa: N815
    force_sd_N: float | None  # of the same |F|, over the whole population  # noqa: N815
    force_time_product_N_s: float  # sum of |F| times the tick: the impulse  # noqa: N815
    task_threshold_N: float  # of `time_over_threshold_s`  # noqa: N815
    time_over_threshold_s: float
    path_length_mm: float  # of the hook while it holds the duct
    # farthest distance from the grasp over the path: 1 for one straight pull
    economy_of_motion: float | None
    # log dimensionless jerk of the hook's path; nearer to zero is smoother
    smoothness: float | None
    smallest_distance_to_break: float  # least of 1 - stress / threshold
    tear: TearMeasures | None
    # over `RATE_SECONDS`; None in version 1
    maximum_loading_rate_N_per_s: float | None = None  # noqa: N815
    # past the goal's band over its middle deflection; None without a band
    overshoot: float | None = None


class PullMetrics:
    """Takes the measures tick by tick, with the same few operations at each tick.

    `task_threshold` is the force, N, above which time is counted. `band` is the goal's deflections,
    mm, or None. So far: `ticks`, `holds`, `maximum_force` (N), `maximum_loading_rate` (N/s) and
    `overshoot` (over the band's middle deflection; None without a band). In the last tick: `force`
    (N), `deflection_mm`, `distance_to_break` and `held`; no strands hold it: `stretches` is empty.

    The smoothness is -ln(T^3 / v^2 * integral of |x'''|^2 dt) of the hook's path, with T the time
    that it moves and v its peak speed. The third derivative is the third difference of its last
    four places, within one hold; the length of a tick cancels.
    """

    def __init__(self, task_threshold: float, band: tuple[float, float] | None = None) -> None:
        self._threshold, self._band = task_threshold, band
        self._finder = PullErrorFinder()
        self.ticks = self.holds = self._ticks_held = 0
        self.maximum_force = self.maximum_loading_rate = self._force_sum = 0.0
        self.overshoot = None if band is None else 0.0
        self._forces = (0.0,) * RATE_TICKS  # of the last ticks of the present hold, newest first
        self._loaded, self._mean, self._spread = 0, 0.0, 0.0
        self._over = 0
        self._path = self._farthest = 0.0
        self._start: Place | None = None
        self._held = 0  # ticks of the present hold
        self._moving = 0  # steps of the hook's way, of all holds
        self._last: tuple[Place, Place, Place] | None = None
        self._jerk = self._peak = 0.0
        self._slowed = False  # whether it has slowed down again after its peak speed
        self._distance = 1.0
        self._tear: TearMeasures | None = None
        self.force = self.deflection_mm = 0.0
        self.stretches: list[tuple[float, float]] = []
        self.distance_to_break = 1.0
        self.held = False

    @property
    def errors(self) -> Incidents:
        """The errors so far."""
        return self._finder.incidents

    @property
    def torn(self) -> bool:
        """Whether the duct has torn."""
        return self._tear is not None

    @property
    def seconds(self) -> float:
        """Time so far, s."""
        return self.ticks * TICK_SECONDS

    @property
    def force_time_product(self) -> float:
        """Force-time product so far, N s."""
        return self._force_sum * TICK_SECONDS

    @property
    def mean_absolute_nonzero_force(self) -> float:
        """Mean of |F| over the ticks with force so far, N; 0 without any."""
        return self._force_sum / self._loaded if self._loaded else 0.0

    def add(
        self,
        force: float,
        hook: Place,
        distance_to_break: float,
        *,
        held: bool,
        deflection: float = 0.0,
        came_from: Place | None = None,
    ) -> None:
        """Take one tick (N, mm); `came_from` is where a hold that starts in it took the duct."""
        self.ticks += 1
        self.force, self.deflection_mm, self.held = force, deflection, held
        self.distance_to_break = distance_to_break
        size = abs(force)
        if size > 0.0:
            self.maximum_force = max(self.maximum_force, size)
            self._force_sum += size
            self._loaded += 1
            off = size - self._mean
            self._mean += off / self._loaded
            self._spread += off * (size - self._mean)  # Welford's sum of squares
            if size > self._threshold:
                self._over += 1
        self._distance = min(self._distance, distance_to_break)
        self._finder.take(1.0 - distance_to_break, deflection, held=held)
        self._ticks_held += held
        if held:
            if self._held == 0:
                self.holds += 1
                self._forces = (size,) * RATE_TICKS
            grown = (size - self._forces[-1]) / RATE_SECONDS
            self.maximum_loading_rate = max(self.maximum_loading_rate, grown)
            self._forces = (size, *self._forces[:-1])
            if self._band is not None and self.overshoot is not None:
                past = (deflection - self._band[1]) / (0.5 * sum(self._band))
                self.overshoot = max(self.overshoot, past)
            if self._held == 0 and came_from is not None:
                self._move_to(came_from)
            self._move_to(hook)
        else:
            self._held = 0

    def regrasp(self) -> None:
        """Start a new hold: the path from one grasp to the next is not part of a pull."""
        self._held = 0

    def tear(self, event: BreakEvent) -> None:
        """Note what broke, at the present tick."""
        check = event.check
        self._finder.tear(check.station)
        self._tear = TearMeasures(
            criterion="normal stress + bending stress > threshold",
            station_mm=check.station,
            side={1: "pull", -1: "away"}.get(check.tension_side, "even"),
            time_s=self.seconds,
            force_N=event.force,
            deflection_mm=event.deflection,
            normal_stress_MPa=check.normal_stress,
            bending_stress_MPa=check.bending_stress,
            threshold_MPa=check.threshold,
        )

    def holding_beside(self, low: float, high: float) -> None:
        """None: no strands hold a free duct."""

    @property
    def bleeds(self) -> bool:
        """False: a duct in a plane has no blood."""
        return False

    def critical_view(self) -> CriticalView:
        """Raise a `ValueError`: a free duct alone has none."""
        raise ValueError("a critical view of safety needs an anatomy, not a single duct")

    @property
    def named(self) -> frozenset[Structure]:
        """Nothing: there is one duct."""
        return frozenset()

    @property
    def called_unsafe(self) -> bool:
        """False: there is nothing to tell apart."""
        return False

    def closings(self) -> list[Closing]:
        """Return nothing: there is no gallbladder."""
        return []

    def measure(self, key: str) -> float | None:
        """Return one of the measures so far; None of a key that there is not."""
        return getattr(self.measures(), key, None)

    def measures(self) -> Measures:
        """Return the measures so far."""
        loaded = self._loaded > 0
        return Measures(
            time_s=self.seconds,
            time_in_tissue_s=self._ticks_held * TICK_SECONDS,
            maximum_force_N=self.maximum_force,
            mean_absolute_nonzero_force_N=self.mean_absolute_nonzero_force if loaded else None,
            force_sd_N=math.sqrt(self._spread / self._loaded) if loaded else None,
            force_time_product_N_s=self.force_time_product,
            task_threshold_N=self._threshold,
            time_over_threshold_s=self._over * TICK_SECONDS,
            path_length_mm=self._path,
            economy_of_motion=self._farthest / self._path if self._path > 0.0 else None,
            smoothness=self._smoothness(),
            smallest_distance_to_break=self._distance,
            tear=self._tear,
            maximum_loading_rate_N_per_s=self.maximum_loading_rate,
            overshoot=self.overshoot,
        )

    def _move_to(self, hook: Place) -> None:
        """Add a place of the hook to the path and to this hold's third differences."""
        if self._held == 0:
            self._start, self._last = hook, (hook, hook, hook)
        assert self._start is not None and self._last is not None  # noqa: S101, PT018
        one, two, three = self._last
        if self._held >= 1:
            step = math.dist(hook, one)
            self._path += step
            self._moving += 1
            if step > self._peak:
                self._peak, self._slowed = step, False
            elif step <= SLOW * self._peak:
                self._slowed = True
            self._farthest = max(self._farthest, math.dist(hook, self._start))
        # Third difference: jerk times the tick's length cubed.
        if self._held >= 3:
            for x, a, b, c in zip(hook, one, two, three, strict=True):
                self._jerk += (x - 3.0 * a + 3.0 * b - c) ** 2
        self._last = (hook, one, two)
        self._held += 1

    def _smoothness(self) -> float | None:
        """Return -ln(T^3 / v^2 * integral of jerk^2); the tick's length cancels."""
        if self._peak**2 == 0.0 or self._jerk == 0.0:  # squares of tiny numbers underflow
            return None
        # An incomplete movement can come out smoother than any complete one can be.
        if not self._slowed or self._moving < LEAST_STEPS:
            return None
        found = -math.log(self._moving**3 * self._jerk / self._peak**2)
        return min(found, SMOOTHEST) if found <= SMOOTHEST + TICKS_SMOOTH_AWAY else None


class PullRecorder(PullMetrics):
    """Records the metrics of a pull in the plane, of an exercise or without one."""

    def __init__(self, tissue: PlanarTissue, exercise: Exercise | None) -> None:
        task_threshold, band = TASK_THRESHOLD * tissue.model.break_force, None
        if exercise is not None:
            task_threshold = exercise.limit_of.get("maximum_force_N", task_threshold)
            band = exercise.goal.band
        super().__init__(task_threshold, band)
        self._tissue = tissue

    def start(self) -> None:
        """Start with the first input: there is nothing to remember."""

    def take(self, *, moved: bool) -> None:
        """Take one tick."""
        tissue = self._tissue
        grasper, beam, tear = tissue.grasper, tissue.grasped, tissue.tear
        if tissue.regrasped:
            self.regrasp()
        self.add(
            grasper.grip_force if tear is None else tear.event.force,
            beam.hook(),
            beam.check.distance_to_break,
            held=grasper.holds,
            deflection=beam.pulled.deflection,
            came_from=tissue.came_from,
        )
        if tear is not None and not self.torn:
            self.tear(tear.event)
