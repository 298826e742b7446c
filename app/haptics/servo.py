"""The servo: devices, a loop and a clock. Each period sends a force and reads the next state.

It runs in a process of its own with the garbage collector off, and the arithmetic of a step is
compiled. It sleeps until just before a period and busy-waits for the rest.
"""

import contextlib
import gc
import os
import time
from collections import Counter
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from app.haptics.device import Device, DeviceError, DeviceState, WaitingDevice, driver_failure
from app.haptics.device_run import Recorder
from app.haptics.duct_choice import passive_delay
from app.haptics.haptic_beam import HapticBeam
from app.haptics.regulator import ALLOWED, BRAKED, LEAST, SAMPLED, WITHHELD, WORK
from app.haptics.servo_loop import FRESH, LIVE, PLACE_UNIT, ServoLoop
from app.haptics.servo_report import Energies, ForceCheck, ServoReport, TimeHistogram

SPIN_SECONDS = 1.5e-4
"""How long before a period it stops sleeping, s: a sleep ends late by up to as much."""
# Time left to a period, s, in which a step can be taken to warm the caches.
REHEARSAL_SECONDS = 5e-5
# Periods from one to the next that count as missed.
MISSED = 1.5
# Periods behind the clock beyond which it starts afresh instead of catching up.
BEHIND = 5
SILENT_SECONDS = 1.0
"""Time without a state after which a device counts as gone."""
REACH = 10.0
"""Farthest place of a device, m, that is believed."""
NOWHERE = "a place that is no number or out of reach"
ORDINARY = "as other processes"
# How often a force is kept to be compared with the theory's own, up to `MOST_CHECKS` times.
CHECKS_PER_SECOND = 20
MOST_CHECKS = 2000


def real_time() -> str:
    """Ask for real-time scheduling of this process, which sleeps most of the time."""
    with contextlib.suppress(AttributeError, OSError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(20))
        return "before other processes (SCHED_FIFO)"
    return ORDINARY


class Servo:
    """Runs a loop with its devices, one for each hand.

    `scheduling` says how the process is scheduled, for the report. With `keeps` the loop's inputs
    go to `recorder`, from which the run can be computed again.
    """

    def __init__(
        self,
        devices: Sequence[Device],
        loop: ServoLoop,
        scheduling: str = ORDINARY,
        *,
        keeps: bool = True,
    ) -> None:
        self.devices, self.loop = devices, loop
        for device in devices:
            if isinstance(device, WaitingDevice):
                device.meanwhile = loop.warm_caches
        self.recorder = Recorder(len(devices)) if keeps else None
        self._states = [DeviceState() for _ in devices]
        self._received, self._alive = [0.0] * len(devices), [0.0] * len(devices)
        self._periods = 0
        self._period, self._step = TimeHistogram(), TimeHistogram()
        self._whole, self._exchange = TimeHistogram(), TimeHistogram()
        self._answer = TimeHistogram()
        self._missed = self._stale = 0
        self._largest = self._jump = self._peak = 0.0
        self._seconds = 0.0
        self._scheduling = scheduling
        self._failed = False
        self._checks: list[tuple[HapticBeam, float, float]] = []
        self._ducts, self._torn = 0, False  # of those that are not felt any more
        self._energies: Energies | None = None
        self._theories: list[str] = []
        loop.leaving = self._leave
        self._device_errors: Counter[str] = Counter()

    def run(
        self,
        seconds: float | None,
        stopped: Callable[[], str | None],
        watched: Callable[[], None] | None = None,
    ) -> ServoReport:
        """Run until the time is over or it is stopped, then send no force."""
        collected = gc.isenabled()
        gc.collect()
        gc.freeze()
        gc.disable()
        try:
            with contextlib.ExitStack() as closing:  # each of them, whatever another one raises
                for device in self.devices:
                    closing.callback(device.close)
                closing.callback(self.loop.end)
                ended = self._run(seconds, stopped, watched)
        finally:
            gc.unfreeze()
            if collected:
                gc.enable()
        return self.report(ended)

    def _run(
        self,
        seconds: float | None,
        stopped: Callable[[], str | None],
        watched: Callable[[], None] | None,
    ) -> str:
        clock, loop = time.perf_counter, self.loop
        period, hands = loop.settings.period, len(self.devices)
        units, inputs = np.zeros((hands, 3), np.int64), [0] * hands
        before = loop.given.copy()
        every = max(1, loop.settings.rate // CHECKS_PER_SECOND)
        start = due = last = clock()
        self._received, self._alive = [start] * hands, [start] * hands
        while True:
            while (wait := due - clock()) > SPIN_SECONDS:
                time.sleep(wait - SPIN_SECONDS)
            if wait > REHEARSAL_SECONDS:
                loop.warm_caches()
            while (now := clock()) < due:
                pass
            if self._periods:
                self._period.add(now - last)
                self._missed += now - last > MISSED * period
            last = now
            if (why := stopped()) is not None:
                break
            if seconds is not None and now - start >= seconds:
                why = "its time is over"
                break
            hand = 0
            try:
                for hand in range(hands):
                    inputs[hand] = self._exchange_with(hand, units)
            except Exception as error:  # a driver may be somebody else's
                why, self._failed = driver_failure(self.devices[hand].name, error), True
                break
            stepping = clock()
            loop.step(units, inputs)
            stepped = clock()
            loop.model.assemble_ahead()
            self._step.add(stepped - stepping)
            self._whole.add(clock() - stepping)
            if self.recorder is not None:
                self.recorder.keep(units, inputs, loop.given)
            self._watch(before, every)
            if watched is not None:
                watched()
            self._periods += 1
            due += period
            if clock() - due > BEHIND * period:
                due = clock()
        self._seconds = clock() - start
        return why

    def _exchange_with(self, hand: int, units: NDArray[np.int64]) -> int:
        """Give a device its force and fill in where it is; return its hand's bits."""
        clock, device, state = time.perf_counter, self.devices[hand], self._states[hand]
        sent = clock()
        if self._periods:
            self._answer.add(sent - self._received[hand])
        fresh = device.exchange(self.loop.given[hand], state)
        got = self._received[hand] = clock()
        self._exchange.add(got - sent)
        nowhere = fresh and not (np.abs(state.position) <= REACH).all()
        bits = state.buttons & (LIVE - 1)
        if fresh and not nowhere:
            units[hand] = np.rint(state.position * (1.0 / PLACE_UNIT))
            self._alive[hand] = got
            return bits | FRESH | LIVE
        self._stale += 1
        trouble = NOWHERE if nowhere else device.trouble() or "no state"
        self._device_errors[trouble] += 1
        silent = got - self._alive[hand]
        if silent > SILENT_SECONDS:
            raise DeviceError(f"no state of {device.name} for {SILENT_SECONDS:g} s: {trouble}")
        return bits | LIVE if silent <= self.loop.settings.stale_seconds else bits

    def _watch(self, before: NDArray[np.float64], every: int) -> None:
        """Record the largest force, its largest change, and forces to compare afterwards."""
        loop = self.loop
        for hand in range(len(self.devices)):
            given, old = loop.given[hand], before[hand]
            self._largest = max(self._largest, float(given @ given))
            change = given - old
            self._jump = max(self._jump, float(change @ change))
            old[:] = given
        self._peak = max(self._peak, abs(float(loop.regulator.energies[WORK])))
        if self._periods % every == 0 and len(self._checks) < MOST_CHECKS:
            model = loop.model
            # Forces in a bed depend on the whole way to them: none can be solved from rest.
            if isinstance(model, HapticBeam) and len(model.grasps) == 1 and not model.torn:
                place, force = float(model.hooks[0, 2]), float(model.forces[0, 2])
                if place > 0.0:
                    self._checks.append((model, place, force))

    def _leave(self) -> None:
        """Keep the figures of a duct before another one is felt."""
        if self._peak == 0.0:
            return  # nobody has pulled it
        model = self.loop.model
        self._energies, self._ducts = self._balance(), self._ducts + 1
        self._torn |= model.torn
        if model.solved_by not in self._theories:
            self._theories.append(model.solved_by)
        self._peak = 0.0

    def _balance(self) -> Energies:
        """Return the energies of all ducts so far."""
        loop, energies, model = self.loop, self.loop.regulator.energies, self.loop.model
        scale = loop.settings.scale
        now = Energies(
            float(energies[WORK]),
            model.stored / scale, model.spent / scale, model.released / scale,
            float(energies[SAMPLED]),
            float(energies[BRAKED]), float(energies[WITHHELD]), loop.assist_work / scale,
            abs(loop.open_work) / self._peak if self._peak else 0.0, float(energies[LEAST]),
            float(energies[ALLOWED]),
        )  # fmt: skip
        return now if self._energies is None else self._energies.followed_by(now)

    def report(self, ended: str) -> ServoReport:
        """Return the report of the run."""
        loop, model = self.loop, self.loop.model
        pulled = self._peak > 0.0
        theories = [*self._theories, *([model.solved_by] if pulled or not self._ducts else [])]
        periods, seconds = self._periods, max(self._seconds, 1e-9)
        return ServoReport(
            device=", ".join(device.name for device in self.devices),
            theory=", then ".join(dict.fromkeys(theories)),
            ducts=self._ducts + pulled,
            grasps_mm=model.grasps,
            coupling_N_per_mm=model.coupling,
            passive_to_delay_ms=1e3 * passive_delay(model.coupling, loop.limits, loop.settings),
            scheduling=self._scheduling,
            wanted_rate_Hz=loop.settings.rate,
            rate_Hz=periods / seconds,
            seconds=self._seconds,
            periods=periods,
            missed_periods=self._missed,
            missed_fraction=self._missed / max(periods, 1),
            stale_periods=self._stale,
            period_us=self._period.percentiles(),
            step_us=self._step.percentiles(),
            whole_step_us=self._whole.percentiles(),
            exchange_us=self._exchange.percentiles(),
            state_to_force_us=self._answer.percentiles(),
            largest_force_N=self._largest**0.5,
            largest_force_step_N=self._jump**0.5,
            energy_mJ=self._balance(),
            force_check=self._force_check(),
            torn=self._torn or model.torn,
            ended_by=ended,
            device_failed=self._failed,
            device_errors=dict(self._device_errors),
            forces_sha256="" if self.recorder is None else self.recorder.forces_sha256,
        )

    def _force_check(self) -> ForceCheck | None:
        if not self._checks:
            return None
        worst = 0.0
        for model, place, force in self._checks:
            solved = model.solved_force(place)
            worst = max(worst, abs(force - solved) / abs(solved))
        _, place, force = max(self._checks, key=lambda check: check[1])
        return ForceCheck(
            "the model's force with the theory's, solved from rest, both at the hook's place",
            len(self._checks), worst, place, force,
        )  # fmt: skip
