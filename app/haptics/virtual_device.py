"""The simulated device as a driver of this process: one period passes with each exchange."""

import numpy as np
from numpy.typing import NDArray

from app.haptics.device import DeviceLimits, DeviceOptions, DeviceState
from app.haptics.simulated_device import STEP, SimulatedDevice


class VirtualDevice:
    """A simulated device in a scripted hand, the same to the bit each time."""

    def __init__(self, options: DeviceOptions) -> None:
        self.name = "virtual device"
        self.simulated = SimulatedDevice(options.script)
        hardware = options.script.device
        self.limits = DeviceLimits(
            hardware.force_limit_N,
            hardware.force_rate_limit_N_per_s,
            hardware.damping_N_s_per_m,
            delay=1e-3 * hardware.latency_ms,
        )
        self._periods = options.period / STEP
        self._due = 0.0

    def exchange(self, force: NDArray[np.float64], state: DeviceState) -> bool:
        """Let one period pass under a force; see `Device`."""
        self._due += self._periods
        steps = round(self._due)
        self._due -= steps
        self.simulated.advance(steps, force)
        state.position[:] = self.simulated.position
        state.velocity[:] = self.simulated.velocity
        state.buttons = self.simulated.pressed
        return True

    def trouble(self) -> str | None:
        """Nothing is ever wrong; see `Device`."""
        return None

    def close(self) -> None:
        """Nothing is open; see `Device`."""


def open_virtual(options: DeviceOptions) -> VirtualDevice:
    """Return a simulated device."""
    return VirtualDevice(options)
