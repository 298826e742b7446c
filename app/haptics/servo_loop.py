"""One period of the servo, without a clock or a device: the same to the bit for the same inputs.

The inputs are the places of the devices (in whole steps of 0.1 um), the buttons and whether the
states are fresh: all else follows, so that a recorded run is these alone and is computed anew.

Work of the hands on the model, from step to step of it. With the ways r_1 and r_2 of two steps and
the forces F_0, F_1, F_2 at their ends, the trapezoidal rule (F_1 + F_2)/2 . r_2 leaves out
F'' |r_2|^3/12, which is 1e-5 of the work of fast hands. It is taken off with the second difference
of the forces, the rule being exact then for forces that change by a parabola along a straight way:

    a = r_1 . r_2 / |r_2|,  b = |r_2|
    W_2 = (F_1 + F_2)/2 . r_2 - b^2/[6 a (a + b)] [r_1 . (F_2 - F_1) - r_2 . (F_1 - F_0)]

Where two hands turn, r_1 and r_2 are not parallel; the last bracket is the change of the stiffness
K, r_1 . dK r_2, all the same, because K is symmetric. This is left out where the hands turned by
more than 60 degrees, where their steps are short, a hook came to the duct or off it, or the duct
tore. A hook that the duct lies above begins where that is.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.haptics.device import DeviceLimits
from app.haptics.haptic_beam import UP, HapticModel
from app.haptics.regulator import MODELLED, Regulator, regulate
from kernel_cache import njit

Array = NDArray[np.float64]

PLACE_UNIT = 1e-7
"""m; the grid on which places are taken and kept."""
TAKE, CLUTCH, LIVE, FRESH = 1, 2, 64, 128
"""Bits of a hand's input: the button that takes the duct, the one that moves the device without the
hook; whether a state came lately, and whether one came in this period."""
# Longest movement of a hand, mm, that the model takes in one step, and most steps of a period: a
# hand without states for some periods is caught up with in such steps.
STRIDE, MOST_STRIDES = 0.05, 64
# The same of the first period, in which a hook without a device goes where it is left.
FIRST_STRIDE, FIRST_STRIDES = 0.0125, 2000


# Rows of a loop's `motion`, each (K, 3): where devices are and where their paths began, m; targets
# of the hooks, mm: where those paths began, now, a period ago, and between the two; then of the
# model's last step: how far the hands moved, mm, forces at its beginning and a step before, N, and
# where the hooks were, mm; and the forces now along the devices' axes, N.
(
    PLACE, ORIGIN, TARGET_START, TARGET, TARGET_BEFORE, TARGET_BETWEEN, MOVED, FORCE, FORCE_BEFORE,
    HOOK_PLACE, PULLED, ROWS,
) = range(12)  # fmt: skip
ALONG = 0.5
"""Cosine between two steps of the hands up to which the second goes on from the first."""


@njit(cache=True, nogil=True)
def _lead(
    units: NDArray[np.int64],
    bits: NDArray[np.int64],
    before: NDArray[np.int64],
    motion: Array,
    turns: Array,
    held: NDArray[np.bool_],
    to_mm: float,
    free: bool,
    longest_stride: float,
    most_strides: int,
) -> tuple[int, bool]:
    """Move the hooks with their hands: the clutch, taking and releasing the duct."""
    # Returned are in how many steps the model goes there, the first of which is filled in, and
    # whether there may be a force.
    places, origins, led = motion[PLACE], motion[ORIGIN], motion[TARGET]
    live = True
    for hand in range(units.shape[0]):
        now = bits[hand]
        live &= now & (LIVE | CLUTCH) == LIVE
        if now & FRESH:
            for j in range(3):
                places[hand, j] = units[hand, j] * PLACE_UNIT
        if (now | before[hand]) & CLUTCH:
            # The hook stays where it is, without a force; from where the device is now it goes on.
            for j in range(3):
                origins[hand, j] = places[hand, j]
                motion[TARGET_START, hand, j] = led[hand, j]
        taken = now & TAKE != 0
        if taken and not held[hand]:
            for j in range(3):
                origins[hand, j] = places[hand, j]
                motion[TARGET_START, hand, j] = motion[TARGET_BEFORE, hand, j] = 0.0
        held[hand] = taken
        before[hand] = now
        for j in range(3):
            displacement = 0.0
            for i in range(3):
                displacement += turns[hand, j, i] * (places[hand, i] - origins[hand, i])
            led[hand, j] = motion[TARGET_START, hand, j] + to_mm * displacement
    longest = 0.0
    for h in range(led.shape[0]):
        if held[h] or not free:  # a hook that is free goes as fast as it likes
            for j in range(3):
                longest = max(longest, abs(led[h, j] - motion[TARGET_BEFORE, h, j]))
    strides = min(max(math.ceil(longest / longest_stride), 1), most_strides)
    _stride(motion, 1.0 / strides)
    return strides, live


@njit(cache=True, nogil=True)
def _stride(motion: Array, fraction: float) -> None:
    """Fill an interpolated place, at the end the target itself to the bit."""
    for h in range(motion.shape[1]):
        for j in range(3):
            before, led = motion[TARGET_BEFORE, h, j], motion[TARGET, h, j]
            now = led if fraction == 1.0 else before + fraction * (led - before)
            motion[TARGET_BETWEEN, h, j] = now


@njit(cache=True, nogil=True)
def _book(
    motion: Array,
    forces: Array,
    elastic: Array,
    hooks: Array,
    held: NDArray[np.bool_],
    stride: int,
    strides: int,
    hands: int,
    pushes: bool,
    works: Array,
) -> None:
    """Add the work of one step of the model to `works`: of the hands, of hooks without one.

    See the module's docstring for the rule. `elastic` are the forces at the step's end before what
    tore in it.
    """
    ahead = behind = along = 0.0
    for h in range(motion.shape[1]):
        for j in range(3):
            was = motion[TARGET_BEFORE, h, j]
            now = was + stride / strides * (motion[TARGET, h, j] - was)
            was += (stride - 1) / strides * (motion[TARGET, h, j] - was)
            if not pushes:  # aside, and below where the duct is by itself, there is no force
                was = max(was, motion[HOOK_PLACE, h, j]) if j == UP else 0.0
                now = max(now, hooks[h, j]) if j == UP else 0.0
            displacement, before = now - was if held[h] else 0.0, motion[MOVED, h, j]
            ahead += displacement * displacement
            behind += before * before
            along += displacement * before
            motion[TARGET_BETWEEN, h, j] = displacement
    if ahead == 0.0 and not pushes and np.array_equal(motion[FORCE], forces):
        return  # nobody draws: the next step goes on from the one before
    ahead, behind = math.sqrt(ahead), math.sqrt(behind)
    goes_on = not pushes and along > ALONG * ahead * behind
    for h in range(motion.shape[1]):  # a hook that comes or goes changes all forces
        first, last = motion[FORCE, h, UP], elastic[h, UP]
        goes_on &= (first > 0.0) == (last > 0.0) == (motion[FORCE_BEFORE, h, UP] > 0.0)
    bent = 0.0
    if goes_on:
        back = along / ahead
        bent = ahead * ahead / (6.0 * back * (ahead + back))
    for h in range(motion.shape[1]):
        for j in range(3):
            first, last, displacement = (
                motion[FORCE, h, j],
                elastic[h, j],
                motion[TARGET_BETWEEN, h, j],
            )
            work = 0.5 * (first + last) * displacement
            if goes_on:
                before = displacement * (first - motion[FORCE_BEFORE, h, j])
                work -= bent * (motion[MOVED, h, j] * (last - first) - before)
            works[0 if h < hands else 1] += work
            # What tore is another course of the force, on which nothing goes on.
            motion[MOVED, h, j] = displacement if forces[h, j] == elastic[h, j] else 0.0
            motion[FORCE_BEFORE, h, j] = first
            motion[FORCE, h, j] = forces[h, j]
            motion[HOOK_PLACE, h, j] = hooks[h, j]


@njit(cache=True, nogil=True)
def _settle(
    motion: Array,
    forces: Array,
    elastic: Array,
    hooks: Array,
    held: NDArray[np.bool_],
    strides: int,
    hands: int,
    pushes: bool,
    works: Array,
    energy: float,
    scale: float,
    turns: Array,
    live: bool,
    memory: Array,
    given: Array,
    energies: Array,
    figures: Array,
) -> None:
    """Book the model's last step and find the forces of the next period."""
    _book(motion, forces, elastic, hooks, held, strides, strides, hands, pushes, works)
    motion[TARGET_BEFORE] = motion[TARGET]
    pulled = motion[PULLED]
    for hand in range(hands):
        for j in range(3):
            pulled[hand, j] = 0.0
            for i in range(3):
                pulled[hand, j] += turns[hand, i, j] * forces[hand, i]
    regulate(
        motion[PLACE], pulled, works[0] / scale, (energy - works[1]) / scale, live,
        memory, given, energies, figures,
    )  # fmt: skip
    works[0] = 0.0


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
    for the devices, N, `hook_targets` the (K, 3) targets of the hooks, mm from rest, `holds` which
    hands have the duct without a button.
    """

    def __init__(
        self,
        model: HapticModel,
        settings: LoopSettings,
        limits: DeviceLimits,
        hands: int = 1,
        twin: HapticModel | None = None,
    ) -> None:
        self.settings, self.hands = settings, hands
        self.limits = limits
        self._to_mm = 1e3 * settings.scale
        self.ended = False
        self.holds = [settings.hold] * hands
        self._turns = np.zeros((hands, 3, 3))
        self.leaving: Callable[[], None] = lambda: None  # called before another model is felt
        self.render(model, twin)

    def render(self, model: HapticModel, twin: HapticModel | None = None) -> None:
        """Restart on a model at rest; the next places of the hands become their hooks' rest.

        A `twin` of the model is for `warm_caches`.
        """
        self.leaving()
        hands, hooks, limits = self.hands, len(model.forces), self.limits
        self.model = model
        self.regulator = Regulator(hands, self.settings.period, limits)
        self.given = self.regulator.given
        self._motion = np.zeros((ROWS, hooks, 3))
        self.hook_targets, self._led_now = self._motion[TARGET], self._motion[TARGET_BETWEEN]
        self._works = np.zeros(2)
        self._held = np.zeros(hooks, np.bool_)
        self._bits, self._bits_before = np.zeros((2, hands), np.int64)
        self._begun = False
        self._turns[:] = np.eye(3)
        self.step(np.zeros((hands, 3), np.int64), [FRESH] * hands)  # compiled before it is felt
        self._begun = False
        self._last = np.zeros((hands, 3), np.int64), [0] * hands
        self._twin = None
        if twin is not None:
            self._twin = ServoLoop(twin, self.settings, limits, hands)
            self._twin.holds = self.holds

    def turn(self, hand: int, axes: Array) -> None:
        """Lead a hand's hook along other axes: columns of (3, 3), the device's among the duct's.

        The hook stays where it is and goes on from there. So its steps are those of the device
        turned, its force is turned back, and both have the same power: however the axes turn, they
        do no work.
        """
        motion = self._motion
        motion[ORIGIN, hand] = motion[PLACE, hand]
        motion[TARGET_START, hand] = motion[TARGET, hand]
        self._turns[hand] = axes

    def warm_caches(self) -> None:
        """Take the last step again with the twin, for nothing but a processor that has it at hand.

        Other processes run between two periods, and what a step needs is no longer in the caches:
        it took two to three times as long (docs/haptic-forces.md).
        """
        if self._twin is not None:
            self._twin.step(*self._last)

    @property
    def assist_work(self) -> float:
        """Work of hooks without a device, N mm."""
        return float(self._works[1])

    @property
    def open_work(self) -> float:
        """Work of the hands on the model that it has not stored, spent or released, N mm."""
        model = self.model
        held = model.stored + model.spent + model.released - self.assist_work
        return float(self.regulator.energies[MODELLED]) - held / self.settings.scale

    def assist(self, hook: int, height: float) -> None:
        """Set the target of a hook without a device: mm along the pull; 0 lets go."""
        if self._twin is not None:
            self._twin.assist(hook, height)
        self.hook_targets[hook, 2] = height
        self._held[hook] = height > 0.0

    def step(self, units: NDArray[np.int64], inputs: Sequence[int]) -> None:
        """Advance by one period: `units` (H, 3) in `PLACE_UNIT`, `inputs` (H,) bits."""
        motion, bits, hands = self._motion, self._bits, self.hands
        self._last = units, inputs
        for hand in range(hands):
            bits[hand] = inputs[hand] | TAKE if self.holds[hand] else inputs[hand]
        bounds = (STRIDE, MOST_STRIDES) if self._begun else (FIRST_STRIDE, FIRST_STRIDES)
        if not self._begun:
            if not all(each & FRESH for each in inputs):
                return  # where the hands are is not known yet
            motion[PLACE, :hands] = motion[ORIGIN, :hands] = units * PLACE_UNIT
            self.regulator.start(motion[PLACE, :hands])
            self._begun = True
        model, held, regulator = self.model, self._held, self.regulator
        strides, live = _lead(
            units, bits, self._bits_before, motion, self._turns, held, self._to_mm, model.free,
            *bounds,
        )  # fmt: skip
        # A hand that was lost for some periods is followed along its way.
        for stride in range(1, strides):
            model.step(self._led_now, held)
            _book(motion, model.forces, model.elastic_forces, model.hooks, held, stride, strides,
                  hands, model.pushes, self._works)  # fmt: skip
            _stride(motion, (stride + 1) / strides)
        model.step(self._led_now, held)
        _settle(
            motion, model.forces, model.elastic_forces, model.hooks, held, strides, hands,
            model.pushes, self._works, model.stored + model.spent, self.settings.scale,
            self._turns, live and not self.ended, *regulator.state,
        )  # fmt: skip

    def end(self) -> None:
        """Give no force from now on."""
        self.ended = True
        self.given[:] = 0.0
