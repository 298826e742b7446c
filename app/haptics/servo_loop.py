"""One period of the servo, without a clock or a device: the same to the bit for the same inputs.

The inputs are the places of the devices (in whole steps of 0.1 um), the buttons and whether the
states are fresh: all else follows, so that a recorded run is these alone and is computed anew.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.haptics.device import DeviceLimits
from app.haptics.felt_duct import UP, FeltModel
from app.haptics.regulator import Regulator
from kernel_cache import njit

__all__ = ["CLUTCH", "FRESH", "LIVE", "PLACE_UNIT", "TAKE", "LoopSettings", "ServoLoop"]

Array = NDArray[np.float64]

PLACE_UNIT = 1e-7
"""m; the grid on which places are taken and kept."""
TAKE, CLUTCH, LIVE, FRESH = 1, 2, 64, 128
"""Bits of a hand's input: the button that takes the duct, the one that moves the device without the
hook; whether a state came lately, and whether one came in this period."""
STRIDE, MOST_STRIDES = 0.05, 64
"""Longest movement of a hand, mm, that the model takes in one step, and most steps of a period: a
hand without states for some periods is caught up with in such steps."""


@njit(cache=True, nogil=True)
def _lead(
    hand: int,
    bits: int,
    before: int,
    to_mm: float,
    units: NDArray[np.int64],
    places: Array,
    origins: Array,
    led_from: Array,
    led: Array,
    led_before: Array,
    held: NDArray[np.bool_],
) -> None:
    """Move a hook with its hand: the clutch, and taking and releasing the duct."""
    if bits & FRESH:
        for j in range(3):
            places[hand, j] = units[hand, j] * PLACE_UNIT
    if (bits | before) & CLUTCH:
        # The hook stays where it is, without a force; from where the device is now it goes on.
        for j in range(3):
            origins[hand, j] = places[hand, j]
            led_from[hand, j] = led[hand, j]
    taken = bits & TAKE != 0
    if taken and not held[hand]:
        for j in range(3):
            origins[hand, j] = places[hand, j]
            led_from[hand, j] = led_before[hand, j] = 0.0
    held[hand] = taken
    for j in range(3):
        way = places[hand, j] - origins[hand, j]
        led[hand, j] = led_from[hand, j] + to_mm * way


@njit(cache=True, nogil=True)
def _strides(before: Array, led: Array, counted: NDArray[np.bool_]) -> int:
    """Return in how many steps the model goes from one place to the other."""
    longest = 0.0
    for h in range(led.shape[0]):
        for j in range(3 * counted[h]):
            longest = max(longest, abs(led[h, j] - before[h, j]))
    return min(max(math.ceil(longest / STRIDE), 1), MOST_STRIDES)


@njit(cache=True, nogil=True)
def _go(before: Array, led: Array, part: float, now: Array) -> None:
    """Fill an interpolated place; at the end the target itself, to the bit."""
    for h in range(led.shape[0]):
        for j in range(3):
            way = led[h, j] - before[h, j]
            now[h, j] = led[h, j] if part == 1.0 else before[h, j] + part * way


@njit(cache=True, nogil=True)
def _work(
    pulled: Array, elastic: Array, before: Array, led: Array, stride: int, strides: int,
    hands: int, pushes: bool,
) -> tuple[float, float]:  # fmt: skip
    """Return the work of one step of the model: of the hands, and of hooks without one."""
    by_hands = by_assist = 0.0
    for h in range(led.shape[0]):
        for j in range(3):
            force, way = 0.5 * (pulled[h, j] + elastic[h, j]), led[h, j] - before[h, j]
            if h >= hands:
                by_assist += force * way / strides
            elif j < UP or pushes:
                by_hands += force * way / strides
            else:  # what a hook that only pulls goes below rest is no work
                was = before[h, j] + (stride - 1) / strides * way
                now = before[h, j] + stride / strides * way
                by_hands += force * (max(now, 0.0) - max(was, 0.0))
    return by_hands, by_assist


@dataclass(frozen=True, slots=True)
class LoopSettings:
    """How a servo runs."""

    rate: int = 1000  # periods a second
    scale: float = 1.0  # movement of the hook over that of the device
    hold: bool = True  # whether the hook has the duct at once; with a button otherwise
    stale_seconds: float = 0.02  # age of a state beyond which there is no force

    @property
    def period(self) -> float:
        """Time between two steps, s."""
        return 1.0 / self.rate


class ServoLoop:
    """Hands on a model, with a `regulator` that bounds their forces by the devices' least limits.

    Hooks of the model beyond the devices' are where `assist` says. `given` are the (H, 3) forces
    for the devices, N, `hooks_led` the (K, 3) targets of the hooks, mm from rest, `holds` which
    hands have the duct without a button.
    """

    def __init__(
        self, model: FeltModel, settings: LoopSettings, limits: DeviceLimits, hands: int = 1
    ) -> None:
        self.settings, self.hands = settings, hands
        self._limits = limits
        self._to_mm = 1e3 * settings.scale
        self.ended = False
        self.holds = [settings.hold] * hands
        self.feel(model)

    def feel(self, model: FeltModel) -> None:
        """Restart on a model at rest; the next places of the hands become their hooks' rest."""
        hands, hooks, limits = self.hands, len(model.forces), self._limits
        self.model = model
        self.regulator = Regulator(
            hands,
            self.settings.period,
            force=limits.force,
            force_rate=limits.force_rate,
            added_damping=limits.added_damping,
        )
        self.given = self.regulator.given
        self.hooks_led = np.zeros((hooks, 3))
        self.assist_work = 0.0
        self._held, self._all = np.zeros(hooks, np.bool_), np.ones(hooks, np.bool_)
        self._origins, self._led_from = np.zeros((hands, 3)), np.zeros((hands, 3))
        self._places = np.zeros((hands, 3))
        self._inputs = [0] * hands
        self._outward = np.zeros((hands, 3))
        self._led_before, self._led_now = np.zeros((hooks, 3)), np.zeros((hooks, 3))
        self._pulled = np.zeros((hooks, 3))
        self._begun = False
        self.step(np.zeros((hands, 3), np.int64), [FRESH] * hands)  # compiled before it is felt
        self._begun = False

    def assist(self, hook: int, height: float) -> None:
        """Set the target of a hook without a device: mm along the pull; 0 lets go."""
        self.hooks_led[hook, 2] = height
        self._held[hook] = height > 0.0

    def step(self, units: NDArray[np.int64], inputs: list[int]) -> None:
        """Advance by one period: `units` (H, 3) in `PLACE_UNIT`, `inputs` (H,) bits."""
        places = self._places
        if not self._begun:
            if not all(bits & FRESH for bits in inputs):
                return  # where the hands are is not known yet
            places[:] = units * PLACE_UNIT
            self.regulator.start(places)
            self._origins[:] = places
            self._begun = True
        live = not self.ended
        for hand, bits in enumerate(inputs):
            live &= bits & (LIVE | CLUTCH) == LIVE
            _lead(
                hand, bits | TAKE if self.holds[hand] else bits, self._inputs[hand], self._to_mm,
                units, places, self._origins, self._led_from, self.hooks_led, self._led_before,
                self._held,
            )  # fmt: skip
            self._inputs[hand] = bits
        modelled = self._walk()
        model, scale = self.model, self.settings.scale
        np.negative(model.forces[: self.hands], self._outward)
        energy = (model.stored + model.spent - self.assist_work) / scale
        self.regulator.regulate(places, self._outward, modelled / scale, energy, live)

    def _walk(self) -> float:
        """Step the model after the hands; return their work on it, N mm of the model."""
        model, before, led, now = self.model, self._led_before, self.hooks_led, self._led_now
        # A hook that is free goes as fast as it likes.
        counted = self._held if model.free else self._all
        strides, work = _strides(before, led, counted), 0.0
        for stride in range(1, strides + 1):
            self._pulled[:] = model.forces
            _go(before, led, stride / strides, now)
            model.step(now, self._held)
            by_hands, by_assist = _work(
                self._pulled, model.elastic_forces, before, led, stride, strides,
                self.hands, model.pushes,
            )  # fmt: skip
            work += by_hands
            self.assist_work += by_assist
        before[:] = led
        return work

    def end(self) -> None:
        """Give no force from now on."""
        self.ended = True
        self.given[:] = 0.0
