"""Force Dimension's devices through the package `forcedimension-core` and their maker's SDK."""

import importlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.haptics.device import DeviceError, DeviceLimits, DeviceOptions, DeviceState

LIMITS = DeviceLimits(force=8.0, force_rate=200.0, damping=1.0, delay=1e-3)
"""An omega.3 gives 12 N; its friction is not published, 1 N s/m is assumed. The force that answers
a state is given a period later; the device's own delay is not known."""


class ForceDimensionDevice:
    """The first device that the SDK finds; its axes are x towards the operator, y right, z up."""

    def __init__(self, dhd: Any) -> None:
        self._dhd = dhd
        if dhd.open() < 0:
            raise DeviceError(f"no device of Force Dimension answers: {dhd.errorGetLastStr()}")
        self.name = f"Force Dimension {dhd.getSystemName() or 'device'}"
        self.limits = LIMITS
        self._place, self._speed = [0.0] * 3, [0.0] * 3
        self._trouble: str | None = None
        dhd.enableForce(True)

    def exchange(self, force: NDArray[np.float64], state: DeviceState) -> bool:
        """Give a force and read the state; see `Device`."""
        dhd = self._dhd
        right, forward, up = force.tolist()
        given = dhd.setForce([-forward, right, up])
        if min(given, dhd.getPosition(self._place), dhd.getLinearVelocity(self._speed)) < 0:
            self._trouble = str(dhd.errorGetLastStr())
            return False
        for out, came in ((state.position, self._place), (state.velocity, self._speed)):
            out[0], out[1], out[2] = came[1], -came[0], came[2]
        state.buttons = max(0, int(dhd.getButtonMask()))
        return True

    def trouble(self) -> str | None:
        """Return what the SDK said last; see `Device`."""
        line, self._trouble = self._trouble, None
        return line

    def close(self) -> None:
        """Send no force and close; see `Device`."""
        self._dhd.setForce([0.0, 0.0, 0.0])
        self._dhd.close()


def open_force_dimension(options: DeviceOptions) -> ForceDimensionDevice:
    """Return the first device that Force Dimension's SDK finds."""
    if options.number:
        raise DeviceError("two devices of Force Dimension cannot be felt at once")
    try:
        dhd = importlib.import_module("forcedimension_core.dhd")
    except ModuleNotFoundError as error:
        raise DeviceError(
            "the bindings of Force Dimension's SDK are missing: "
            "pip install 'bluntdissect[force-dimension]' (Python up to 3.12)"
        ) from error
    except (ImportError, OSError) as error:
        raise DeviceError(
            f"Force Dimension's SDK is missing: install it from forcedimension.com "
            f"(version 3.16 or later) and set FORCEDIM_SDK to its folder ({error})"
        ) from error
    return ForceDimensionDevice(dhd)
