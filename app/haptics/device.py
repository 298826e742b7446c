"""Haptic devices: what each must be able to do, and how they are found. SI units throughout.

A driver is a class with a `name`, its `limits` and three methods. It is found by the entry point
group `bluntdissect.haptics`: the entry's name is that of the device on the command line, its value
a function of one `DeviceOptions` that returns an open device or raises `DeviceError`.
"""

import importlib.metadata
import traceback
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol, cast, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from app.haptics.hand import HandScript

GROUP = "bluntdissect.haptics"


class DeviceError(ValueError):
    """A device that is not there, or no longer."""


@dataclass(frozen=True, slots=True)
class DeviceLimits:
    """What a device can do, and what it is safe to ask of it."""

    force: float  # largest that it is given, N
    force_rate: float  # largest change of that, N/s
    # its own viscous friction, N s/m, which bounds the stiffness that it can render at a rate
    damping: float
    added_damping: float = 20.0  # most that the passivity controller adds, N s/m
    speed: float = 5.0  # above which a state is taken for an error, m/s
    # from when a state is measured to when the force that answers it acts, s, without the period
    # for which that force is held
    delay: float = 0.0


@dataclass(slots=True)
class DeviceState:
    """Where a device is; one object, filled anew by each exchange."""

    # (3,) right, forward and up, m
    position: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))
    velocity: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))  # (3,) m/s
    buttons: int = 0  # as bits, the first one 1


@dataclass(frozen=True, slots=True)
class DeviceOptions:
    """What a device is opened with."""

    address: str  # of its service, for those that have one
    period: float  # between two exchanges, s
    script: HandScript = field(default_factory=HandScript)  # the hand of a virtual device
    number: int = 0  # which of the devices of a service that has several


class Device(Protocol):
    """An open device."""

    name: str  # for the report
    limits: DeviceLimits

    def exchange(self, force: NDArray[np.float64], state: DeviceState) -> bool:
        """Give a force and fill in the state that the device is in."""
        ...

    def trouble(self) -> str | None:
        """Return the errors since the last call, in one line; None if there were none.

        It is asked for after an exchange that had no state.
        """
        ...

    def close(self) -> None:
        """Send no force and close the device, in whatever state it is."""
        ...


@runtime_checkable
class WaitingDevice(Device, Protocol):
    """A device whose exchange waits for an answer."""

    meanwhile: Callable[[], None]  # what is done until it comes


def device_names() -> list[str]:
    """Return the devices that are installed."""
    return sorted({entry.name for entry in importlib.metadata.entry_points(group=GROUP)})


def open_device(name: str, options: DeviceOptions) -> Device:
    """Return an open device."""
    for entry in importlib.metadata.entry_points(group=GROUP):
        if entry.name == name:
            try:
                opener = cast("Callable[[DeviceOptions], Device]", entry.load())
            except (ImportError, AttributeError) as error:
                raise DeviceError(
                    f"the driver of {name}, {entry.value}, cannot be loaded: {error}"
                ) from error
            try:
                device = cast("Device | None", opener(options))
            except Exception as error:
                raise DeviceError(driver_failure(name, error)) from error
            if device is None:
                raise DeviceError(f"the driver of {name}, {entry.value}, returned no device")
            return device
    raise DeviceError(f"unknown device {name!r}; there are: {', '.join(device_names())}")


def driver_failure(name: str, error: Exception) -> str:
    """Return in words what a device's driver raised: a fault of its own with file and line."""
    if isinstance(error, DeviceError | OSError):
        return str(error)
    *_, last = traceback.extract_tb(error.__traceback__)
    at = f"{Path(last.filename).name}, line {last.lineno}"
    return f"the driver of {name} failed: {type(error).__name__}: {error} ({at})"
