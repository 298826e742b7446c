"""A duct felt with devices, from their opening to the report."""

from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import astuple, replace

from app.haptics.device import Device, DeviceError, DeviceLimits, DeviceOptions, open_device
from app.haptics.device_run import DeviceRun
from app.haptics.duct_choice import DuctChoice, passive_coupling
from app.haptics.servo import ORDINARY, Servo
from app.haptics.servo_loop import LoopSettings, ServoLoop
from app.haptics.servo_report import ServoReport


@contextmanager
def opened_devices(named: Sequence[tuple[str, DeviceOptions]]) -> Generator[list[Device]]:
    """Open devices, of one service one after the other; after an error they are closed again."""
    devices: list[Device] = []
    services: list[tuple[str, str]] = []
    try:
        for name, options in named:
            service = name, options.address
            number = services.count(service)
            devices.append(open_device(name, replace(options, number=number)))
            services.append(service)
        yield devices
    except BaseException:
        for device in devices:
            with suppress(DeviceError):
                device.close()
        raise


def least_limits(devices: Sequence[Device]) -> DeviceLimits:
    """Return the bounds that keep every device within its own."""
    limits = (astuple(device.limits) for device in devices)
    least = DeviceLimits(*map(min, zip(*limits, strict=True)))
    return replace(least, delay=max(device.limits.delay for device in devices))


def run_haptics(
    choice: DuctChoice,
    opened: Sequence[tuple[str, DeviceOptions]],
    settings: LoopSettings,
    stopped: Callable[[], str | None],
    *,
    coupling: float | None = None,
    delay: float | None = None,
    assist: float = 0.0,
    seconds: float | None = None,
    scheduling: str = ORDINARY,
) -> tuple[ServoReport, DeviceRun]:
    """Open devices and let them feel a duct until the time is over or somebody stops it."""
    # `coupling` in N/mm; `delay`, s, in the place of the devices' own.
    with opened_devices(opened) as devices:
        limits = least_limits(devices)
        if delay is not None:
            limits = replace(limits, delay=delay)
        stiffness = coupling
        if stiffness is None:
            stiffness = passive_coupling(limits, settings)
        model, twin = (choice.haptic_model(stiffness, settings.period) for _ in range(2))
        loop = ServoLoop(model, settings, limits, len(devices), twin)
    alone = len(choice.grasps) > len(devices)
    if alone:
        loop.assist(len(devices), assist)
    servo = Servo(devices, loop, scheduling)
    report = servo.run(seconds, stopped)
    assert servo.recorder is not None  # noqa: S101
    run = choice.run(
        servo.recorder, settings, limits, coupling=stiffness, assist=assist if alone else 0.0
    )
    return report, run
