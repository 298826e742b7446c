"""The servo in a process of its own: the trainer sends a duct and reads the state of the hook.

The trainer cannot delay a force: the two share an array that the servo writes each period, and a
pipe through which the trainer sends the duct. When the trainer ends, the pipe closes and the
force ends.
"""

import multiprocessing
import signal
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection
from multiprocessing.sharedctypes import SynchronizedArray
from typing import Any

from app.haptics.device import Device, DeviceError, DeviceOptions, DeviceState, open_device
from app.haptics.duct_choice import passive_coupling
from app.haptics.felt_duct import FeltDuct
from app.haptics.servo import Servo, real_time
from app.haptics.servo_loop import LoopSettings, ServoLoop
from physics import Beam, Theory

__all__ = ["FeltSetting", "HookSnapshot", "ServoProcess"]

NUMBER, GENERATION, DEFLECTION, PEAK, FORCE, TORN, FRESH_PEAK = range(7)
POLL_PERIODS = 8
"""Periods between two reads of the pipe."""
OPEN_SECONDS = 30.0
"""Time in which a device must be open, s; compilation takes most of it."""


@dataclass(frozen=True, slots=True)
class FeltSetting:
    """A duct that is felt under one hook: the arguments of a `FeltDuct`."""

    theory: Theory
    beam: Beam
    grasp: float
    threshold: float


@dataclass(frozen=True, slots=True)
class HookSnapshot:
    """The state of the device's hook."""

    generation: int  # counts settings: an older one is of another duct
    deflection: float  # mm
    force: float  # N
    peak: float  # largest deflection since the last snapshot, mm
    torn: bool


class ServoProcess:
    """A device in a process of its own that renders the setting it is told to; for one thread.

    `device` is the open device's name, `unfelt` why the last setting is not felt, or None. A device
    that cannot be opened is a `DeviceError`.
    """

    def __init__(
        self, device: str, options: DeviceOptions, settings: LoopSettings, setting: FeltSetting
    ) -> None:
        context = multiprocessing.get_context("spawn")
        self._row: Any = context.Array("d", 8, lock=False)
        self._pipe, theirs = context.Pipe()
        self._process = context.Process(
            target=_serve,
            args=(theirs, self._row, device, options, settings, setting),
            daemon=True,
        )
        self._process.start()
        theirs.close()
        self._generation = 0
        self._ended: str | None = None
        self.unfelt: str | None = None
        said: tuple[str, str] | None = None
        with suppress(EOFError, OSError):
            if self._pipe.poll(OPEN_SECONDS):
                said = self._pipe.recv()
        if said is None or said[0] != "open":
            self.stop()
            raise DeviceError(f"device {device} did not open" if said is None else said[1])
        self.device = said[1]

    def feel(self, setting: FeltSetting | None) -> int:
        """Change to another duct, at rest; the hand's place then becomes its hook's rest."""
        self._generation, self.unfelt = self._generation + 1, None
        with suppress(OSError):
            self._pipe.send((self._generation, setting))
        return self._generation

    def snapshot(self) -> HookSnapshot:
        """Return where the hook is now."""
        row = self._row
        while True:
            before = row[NUMBER]
            values = row[:]
            if before == row[NUMBER] and before % 2.0 == 0.0:
                break
        row[FRESH_PEAK] = values[NUMBER] + 1.0
        return HookSnapshot(
            int(values[GENERATION]), values[DEFLECTION], values[FORCE],
            max(values[PEAK], values[DEFLECTION]), values[TORN] != 0.0,
        )  # fmt: skip

    @property
    def ended(self) -> str | None:
        """Why the servo has ended, or None while it runs, even with a duct that cannot be felt."""
        if self._ended is None:
            with suppress(EOFError, OSError):
                while self._pipe.poll():
                    kind, words = self._pipe.recv()
                    if kind == "ended":
                        self._ended = words
                    else:
                        self.unfelt = words
            if self._ended is None and not self._process.is_alive():
                self._ended = "its process has ended"
        return self._ended

    def stop(self) -> None:
        """Stop the force and end the process."""
        self._pipe.close()
        self._process.join(timeout=3.0)
        if self._process.is_alive():
            self._process.kill()
            self._process.join()


class _Felt:
    """What the servo's process feels."""

    def __init__(self, pipe: Connection, row: "SynchronizedArray[float]") -> None:
        self._pipe, self._row = pipe, row
        self._generation = 0.0
        self._wanted: tuple[int, FeltSetting | None] | None = None
        self._periods = 0
        self._peak = self._asked = 0.0
        self._state = DeviceState()

    def stopped(self) -> str | None:
        """Read the pipe every `POLL_PERIODS`; return why to end, or None."""
        self._periods += 1
        if self._periods % POLL_PERIODS:
            return None
        try:
            while self._pipe.poll():
                self._wanted = self._pipe.recv()
        except (EOFError, OSError):
            return "the trainer has ended"
        return None

    def watch(self, loop: ServoLoop, device: Device) -> None:
        """Write the state of the hook; read the next setting."""
        wanted, self._wanted = self._wanted, None
        if wanted is not None:
            self._change(loop, device, *wanted)
        row, model = self._row, loop.model
        place = float(model.hooks[0, 2])
        if row[FRESH_PEAK] > self._asked:
            self._asked, self._peak = row[FRESH_PEAK], 0.0
        self._peak = max(self._peak, place)
        row[NUMBER] += 1.0
        row[GENERATION], row[DEFLECTION], row[PEAK] = self._generation, place, self._peak
        row[FORCE], row[TORN] = float(model.forces[0, 2]), float(model.torn)
        row[NUMBER] += 1.0

    def _change(
        self, loop: ServoLoop, device: Device, generation: int, setting: FeltSetting | None
    ) -> None:
        loop.given[:] = 0.0
        device.exchange(loop.given[0], self._state)  # no force while the model is made
        loop.ended = setting is None
        if setting is not None:
            try:
                loop.feel(_duct(setting, device, loop.settings))
            except ValueError as error:
                loop.ended = True
                with suppress(OSError):
                    self._pipe.send(("unfelt", str(error)))
        self._generation, self._peak = float(generation), 0.0


def _duct(setting: FeltSetting, device: Device, settings: LoopSettings) -> FeltDuct:
    return FeltDuct(
        setting.theory,
        setting.beam,
        (setting.grasp,),
        threshold=setting.threshold,
        coupling=passive_coupling(device.limits.damping, settings.rate),
    )


def _serve(
    pipe: Connection,
    row: "SynchronizedArray[float]",
    name: str,
    options: DeviceOptions,
    settings: LoopSettings,
    setting: FeltSetting,
) -> None:
    """Open the device, render the settings and report why it ended: the process."""
    for number in (signal.SIGINT, signal.SIGTERM):  # the trainer ends it by its pipe
        signal.signal(number, signal.SIG_IGN)
    try:
        device = open_device(name, options)
        loop = ServoLoop(_duct(setting, device, settings), settings, device.limits)
    except ValueError as error:
        with suppress(OSError):
            pipe.send(("failed", str(error)))
        return
    felt = _Felt(pipe, row)
    with suppress(OSError):
        pipe.send(("open", device.name))
    servo = Servo([device], loop, real_time(), keeps=False)
    report = servo.run(None, felt.stopped, lambda: felt.watch(loop, device))
    with suppress(OSError):
        pipe.send(("ended", report.ended_by))
    pipe.close()
