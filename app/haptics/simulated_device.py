"""A simulated device in a simulated hand: a mass between a held force and a delayed spring.

m x'' = f(t - latency) + k (p(t) - x(t - delay)) + b_h (p' - x') - b_d x', with the minimum-jerk
path p from waypoint to waypoint (Flash and Hogan 1985, J Neurosci 5:1688). Steps of `STEP`: the
speed by Euler, the place by the mean of the speeds before and after, so that the works add up to
the change of kinetic energy to rounding. Time is counted in whole steps: a run is the same to the
bit whenever the same forces act for the same numbers of steps.
"""

import math

import numpy as np
from numpy.typing import NDArray

from app.haptics.hand import HandScript
from kernel_cache import njit

Array = NDArray[np.float64]

STEP = 1e-4
"""s"""

# Rows of `motion`: place and speed; the force that acts; then work done on the device, J, by hand,
# motors and friction (in the first column).
PLACE, SPEED, ACTING, WORK = range(4)
BY_HAND, BY_MOTORS, BY_FRICTION = range(3)


@njit(cache=True, nogil=True)
def _plan(times: Array, places: Array, period: float, time: float, at: Array, speed: Array) -> int:
    """Fill the hand's target and its velocity; return the last waypoint."""
    count = times.size
    if period > 0.0 and time > period:
        time -= math.floor(time / period) * period
    i = 0
    while i < count and times[i] <= time:
        i += 1
    if i == 0:
        at[:], speed[:] = places[0], 0.0
        return 0
    if i == count:
        at[:], speed[:] = places[count - 1], 0.0
        return count - 1
    seconds = times[i] - times[i - 1]
    u = (time - times[i - 1]) / seconds
    fraction = u * u * u * (10.0 + u * (6.0 * u - 15.0))
    rate = 30.0 * u * u * (1.0 - u) * (1.0 - u) / seconds
    for j in range(3):
        displacement = places[i, j] - places[i - 1, j]
        at[j] = places[i - 1, j] + fraction * displacement
        speed[j] = rate * displacement
    return i - 1


@njit(cache=True, nogil=True)
def _advance(
    first: int,
    count: int,
    motion: Array,
    past: Array,
    queued: Array,
    force: Array,
    figures: Array,
    times: Array,
    places: Array,
    phases: Array,
) -> int:
    """Advance by `count` steps under a force; return the waypoint that was passed last."""
    mass, friction, stiffness, damping, amplitude, turn, period, slew = figures
    at, speed = np.empty(3), np.empty(3)
    passed = 0
    for n in range(first, first + count):
        time = n * STEP
        passed = _plan(times, places, period, time, at, speed)
        seen, came = past[n % past.shape[0]], queued[n % queued.shape[0]]
        for j in range(3):
            # What was put in one round of the ring ago is as old as the ring is long.
            known, arrived = seen[j], came[j]
            seen[j], came[j] = motion[PLACE, j], force[j]
            if past.shape[0] == 1:
                known = motion[PLACE, j]
            if queued.shape[0] == 1:
                arrived = force[j]
            change = arrived - motion[ACTING, j]
            motion[ACTING, j] += min(max(change, -slew), slew)
            wanted = at[j] + amplitude * math.sin(turn * time + phases[j])
            v = motion[SPEED, j]
            grip = stiffness * (wanted - known) + damping * (speed[j] - v)
            v_next = v + STEP * (motion[ACTING, j] + grip - friction * v) / mass
            displacement = 0.5 * STEP * (v + v_next)
            motion[SPEED, j] = v_next
            motion[PLACE, j] += displacement
            motion[WORK, BY_HAND] += grip * displacement
            motion[WORK, BY_MOTORS] += motion[ACTING, j] * displacement
            motion[WORK, BY_FRICTION] -= friction * v * displacement
    return passed


class SimulatedDevice:
    """A device in a scripted hand, in SI units; right, forward and up."""

    def __init__(self, script: HandScript) -> None:
        self.script = script
        device, hand = script.device, script.hand
        self._steps = 0
        self._motion = np.zeros((4, 3))
        self._motion[PLACE] = device.start_m
        path = script.path
        start = np.array(device.start_m)
        offsets = np.array([point.offset_mm for point in path], np.float64).reshape(-1, 3)
        self._places = start + 1e-3 * offsets if path else start[None, :]
        self._times = np.array([point.time_s for point in path] or [0.0])
        self._pressed = [point.pressed for point in path] or [0]
        self._past = np.tile(start, (_ring(hand.reaction_delay_ms), 1))
        self._queued = np.zeros((_ring(device.latency_ms), 3))
        self._phases = np.random.default_rng(hand.seed).uniform(0.0, 2.0 * math.pi, 3)
        self._figures = np.array(
            [
                device.mass_kg,
                device.damping_N_s_per_m,
                hand.stiffness_N_per_m,
                hand.damping_N_s_per_m,
                1e-3 * hand.tremor_mm,
                2.0 * math.pi * hand.tremor_Hz,
                float(self._times[-1]) if script.repeats else 0.0,
                device.force_rate_limit_N_per_s * STEP,
            ]
        )
        self._passed = 0
        self._force = np.zeros(3)
        self._run(0)  # compiled before it is felt

    def advance(self, steps: int, force: NDArray[np.float64]) -> None:
        """Let time pass."""
        limit = self.script.device.force_limit_N
        size = math.hypot(*force)
        self._force[:] = force if size <= limit else force * (limit / size)
        if steps <= 0:
            return
        self._run(steps)

    def _run(self, steps: int) -> None:
        self._passed = _advance(
            self._steps, steps, self._motion, self._past, self._queued, self._force,
            self._figures, self._times, self._places, self._phases,
        )  # fmt: skip
        self._steps += steps

    @property
    def position(self) -> NDArray[np.float64]:
        """(3,) where the cursor is, m; its own array."""
        return self._motion[PLACE]

    @property
    def velocity(self) -> NDArray[np.float64]:
        """(3,) how fast it goes, m/s; its own array."""
        return self._motion[SPEED]

    @property
    def acting(self) -> NDArray[np.float64]:
        """(3,) force of the motors, N; its own array."""
        return self._motion[ACTING]

    @property
    def pressed(self) -> int:
        """Buttons that the hand presses, as bits."""
        return self._pressed[self._passed]

    @property
    def work(self) -> tuple[float, float, float]:
        """Work done on the device by hand, motors and friction, J."""
        by_hand, by_motors, by_friction = self._motion[WORK].tolist()
        return by_hand, by_motors, by_friction


def _ring(milliseconds: float) -> int:
    return max(1, round(1e-3 * milliseconds / STEP))
