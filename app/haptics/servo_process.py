"""The servo in a process of its own: the trainer sends a duct and reads the state of the hooks.

The trainer cannot delay a force: the two share an array that the servo writes each period, and a
pipe through which the trainer sends the duct, and what the hand without a device does to it. When
the trainer ends, the pipe closes and the force ends.
"""

import multiprocessing
import signal
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from multiprocessing.connection import Connection
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.haptics.device import Device, DeviceError, DeviceOptions, DeviceState
from app.haptics.duct_choice import passive_coupling
from app.haptics.haptic_beam import HapticBeam
from app.haptics.haptic_bed import HapticBed
from app.haptics.haptic_run import least_limits, opened_devices
from app.haptics.servo import Servo, real_time
from app.haptics.servo_loop import LoopSettings, ServoLoop
from app.haptics.servo_report import ServoReport
from app.simulation import HandContact
from physics import Beam, Theory
from physics.bed import BeamOnBed

NUMBER, GENERATION, TORN, FRESH_PEAK, HEAD = range(5)
"""Entries of the shared array; then come those of each hand."""
TIP, FORCE, PEAK, STATION, TUBE, ROW = 0, 3, 6, 7, 8, 9
# Periods between two reads of the pipe.
POLL_PERIODS = 8
STOP_SECONDS = 5.0
"""Time in which a servo reports when it is stopped."""
OPEN_SECONDS = 30.0
"""Time in which a device must be open, s; compilation takes most of it."""


@dataclass(frozen=True, slots=True)
class DuctSetting:
    """A duct without a bed under one hook, as it is sent to the servo; the hook has it at once."""

    theory: Theory
    beam: Beam
    grasp: float
    threshold: float
    hold: bool = True

    def model(self, coupling: float, period: float, hands: int) -> HapticBeam:
        """Return it behind couplings, N/mm, for hands; a `ValueError` if it has no force."""
        del period
        return HapticBeam(
            self.theory, self.beam, (self.grasp,),
            threshold=self.threshold, coupling=coupling, hands=hands,
        )  # fmt: skip


@dataclass(frozen=True, slots=True)
class BedSetting:
    """A duct in its bed as it is now; hooks take it where they are, by a button."""

    beam: BeamOnBed
    tips: NDArray[np.float64]  # (H, 3) of the hooks, mm from the first clamp
    threshold: float
    touch: HandContact | None  # what the hand without a device does to the beam
    hold: bool = False
    # How fast a tear crosses the wall, of all tubes or by name; at once when None.
    tear_mm_per_s: float | Mapping[str, float] | None = None
    strengths: Mapping[str, float] | None = None  # MPa, of several tubes

    def model(self, coupling: float, period: float, hands: int) -> HapticBed:
        """Return it; see `DuctSetting`."""
        return HapticBed(
            self.beam, tuple(self.tips[:hands, 0].tolist()), tips=self.tips[:hands],
            threshold=self.threshold, coupling=coupling, period=period, touch=self.touch,
            tear_mm_per_s=self.tear_mm_per_s, strengths=self.strengths,
        )  # fmt: skip


HapticSetting = DuctSetting | BedSetting
"""A duct that is to be felt; `hold` says whether hooks have it without a button."""


@dataclass(frozen=True, slots=True)
class HookSnapshot:
    """The state of one device's hook."""

    # (3,) where it is, mm: from the first clamp for a duct in its bed, otherwise from rest
    tip: NDArray[np.float64]
    force: NDArray[np.float64]  # (3,) on the duct, N
    peak: float  # highest place since the last snapshot, mm
    station: float | None  # that it holds, mm along a beam in its bed
    tube: int  # of the bed, that it holds or held last


@dataclass(frozen=True, slots=True)
class Snapshot:
    """The state of what is felt."""

    generation: int  # counts settings: an older one is of another duct
    torn: bool
    hooks: tuple[HookSnapshot, ...]


class ServoLink:
    """The trainer's end of a servo, for one thread: an array that is shared, and a pipe."""

    def __init__(self, row: NDArray[np.float64], pipe: "Connection[Any, Any]") -> None:
        self._row, self._pipe = row, pipe
        self._generation = 0
        self.hands = (row.size - HEAD) // ROW
        self.not_rendered: str | None = None  # why the last setting is not felt

    def render(self, setting: HapticSetting | None) -> int:
        """Change to another duct; the hands' places then become those of their hooks."""
        self._generation, self.not_rendered = self._generation + 1, None
        self._send((self._generation, setting))
        return self._generation

    def lead(
        self,
        touch: HandContact | None,
        holds: Sequence[bool],
        axes: NDArray[np.float64] | None = None,
    ) -> None:
        """Say what the hand without a device does, and which hooks hold without a button.

        `axes`, (3, 3), are the devices' right, forward and up among the duct's axes, in columns.
        """
        self._send((self._generation, touch, tuple(holds), axes))

    def snapshot(self) -> Snapshot:
        """Return where the hooks are now."""
        row = self._row
        while True:
            before = row[NUMBER]
            values = row.copy()
            if before == row[NUMBER] and before % 2.0 == 0.0:
                break
        row[FRESH_PEAK] = values[NUMBER] + 1.0
        hooks = values[HEAD:].reshape(-1, ROW)
        return Snapshot(
            int(values[GENERATION]),
            bool(values[TORN]),
            tuple(
                HookSnapshot(
                    hook[TIP : TIP + 3],
                    hook[FORCE : FORCE + 3],
                    max(float(hook[PEAK]), float(hook[TIP + 2])),
                    None if np.isnan(hook[STATION]) else float(hook[STATION]),
                    int(hook[TUBE]),
                )
                for hook in hooks
            ),
        )

    def _send(self, message: object) -> None:
        with suppress(OSError):
            self._pipe.send(message)


class ServoProcess(ServoLink):
    """Devices in a process of their own that render the setting they are told; for one thread.

    `device` names the open devices. One that cannot be opened is a `DeviceError`.
    """

    def __init__(
        self,
        devices: Sequence[tuple[str, DeviceOptions]],
        settings: LoopSettings,
        setting: HapticSetting,
    ) -> None:
        context = multiprocessing.get_context("spawn")
        shared: Any = context.Array("d", HEAD + ROW * len(devices), lock=False)
        ours, theirs = context.Pipe()
        super().__init__(np.frombuffer(shared), ours)
        self._process = context.Process(
            target=_serve, args=(theirs, shared, tuple(devices), settings, setting), daemon=True
        )
        self._process.start()
        theirs.close()
        self._ended: str | None = None
        self.report: ServoReport | None = None
        answer: tuple[str, str] | None = None
        with suppress(EOFError, OSError):
            if self._pipe.poll(OPEN_SECONDS):
                answer = self._pipe.recv()
        if answer is None or answer[0] != "open":
            self.stop()
            names = ", ".join(name for name, _ in devices)
            raise DeviceError(f"device {names} did not open" if answer is None else answer[1])
        self.device = answer[1]

    @property
    def ended(self) -> str | None:
        """Why the servo has ended, or None while it runs, even with a duct that cannot be felt."""
        if self._ended is None:
            with suppress(EOFError, OSError):
                while self._pipe.poll():
                    kind, answer = self._pipe.recv()
                    if kind == "ended":
                        self.report = answer
                        self._ended = answer.ended_by
                    else:
                        self.not_rendered = answer
            if self._ended is None and not self._process.is_alive():
                self._ended = "its process has ended"
        return self._ended

    def stop(self) -> None:
        """Stop the force and end the process; then there is a `report`, if it had opened."""
        self._send(None)
        end = time.monotonic() + STOP_SECONDS
        while self.ended is None and time.monotonic() < end:
            with suppress(OSError):
                self._pipe.poll(0.05)
        self._pipe.close()
        self._process.join(timeout=3.0)
        if self._process.is_alive():
            self._process.kill()
            self._process.join()


class ServoEnd:
    """The servo's end: what it is told to feel, and how it says where the hooks are."""

    def __init__(
        self, row: NDArray[np.float64], pipe: "Connection[Any, Any]", devices: Sequence[Device]
    ) -> None:
        self._row, self._pipe = row, pipe
        self._hooks = self._row[HEAD:].reshape(-1, ROW)
        self._devices = devices
        self._generation = 0
        self._messages: list[Any] = []
        self._periods = 0
        self._asked = 0.0
        self._state = DeviceState()

    def stopped(self) -> str | None:
        """Read the pipe every `POLL_PERIODS`; return why to end, or None."""
        self._periods += 1
        if self._periods % POLL_PERIODS:
            return None
        try:
            while self._pipe.poll():
                if (message := self._pipe.recv()) is None:
                    return "the trainer has ended"
                self._messages.append(message)
        except (EOFError, OSError):
            return "the trainer has ended"
        return None

    def watch(self, loop: ServoLoop) -> None:
        """Write the state of the hooks; do what the trainer has sent."""
        for message in self._messages:
            if len(message) == 2:
                self._change(loop, *message)
            elif message[0] == self._generation:
                _, touch, holds, axes = message
                loop.holds[:] = holds
                if axes is not None:
                    for hand in range(loop.hands):
                        loop.turn(hand, axes)
                if touch is not None and isinstance(loop.model, HapticBed):
                    loop.model.touch(touch)
        self._messages.clear()
        row, hooks, model = self._row, self._hooks, loop.model
        fresh = row[FRESH_PEAK] > self._asked
        if fresh:
            self._asked = row[FRESH_PEAK]
        row[NUMBER] += 1.0
        row[GENERATION], row[TORN] = self._generation, model.torn
        for number, hook in enumerate(hooks):
            hook[TIP : TIP + 3] = tip = model.tips[number]
            hook[FORCE : FORCE + 3] = model.forces[number]
            hook[PEAK] = tip[2] if fresh else max(hook[PEAK], tip[2])
            station = model.station_of(number)
            hook[STATION] = np.nan if station is None else station
            hook[TUBE] = model.tube_of(number)
        row[NUMBER] += 1.0

    def _change(self, loop: ServoLoop, generation: int, setting: HapticSetting | None) -> None:
        loop.given[:] = 0.0
        for hand, device in enumerate(self._devices):
            with suppress(DeviceError):  # the next exchange says so again
                device.exchange(loop.given[hand], self._state)  # no force while the model is made
        loop.ended = setting is None
        if setting is not None:
            try:
                loop.holds[:] = [setting.hold] * loop.hands
                period = loop.settings.period
                loop.render(
                    *(setting.model(loop.model.coupling, period, loop.hands) for _ in range(2))
                )
            except ValueError as error:
                loop.ended = True
                with suppress(OSError):
                    self._pipe.send(("not_rendered", str(error)))
        self._generation = generation
        self._hooks[:, PEAK] = -np.inf


def _serve(
    pipe: "Connection[Any, Any]",
    shared: Any,
    named: Sequence[tuple[str, DeviceOptions]],
    settings: LoopSettings,
    setting: HapticSetting,
) -> None:
    """Open the devices, render the settings and report why it ended: the process."""
    for number in (signal.SIGINT, signal.SIGTERM):  # the trainer ends it by its pipe
        signal.signal(number, signal.SIG_IGN)
    try:
        with opened_devices(named) as devices:
            limits = least_limits(devices)
            coupling = passive_coupling(limits, settings)
            model, twin = (setting.model(coupling, settings.period, len(devices)) for _ in range(2))
            loop = ServoLoop(
                model, replace(settings, hold=setting.hold), limits, len(devices), twin
            )
    except ValueError as error:
        with suppress(OSError):
            pipe.send(("failed", str(error)))
        return
    servo_end = ServoEnd(np.frombuffer(shared), pipe, devices)
    with suppress(OSError):
        pipe.send(("open", ", ".join(device.name for device in devices)))
    servo = Servo(devices, loop, real_time(), keeps=False)
    report = servo.run(None, servo_end.stopped, lambda: servo_end.watch(loop))
    with suppress(OSError):
        pipe.send(("ended", report))
    pipe.close()
