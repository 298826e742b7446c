"""A scripted hand and the device it holds, as a file: what moves when there is no hardware."""

import itertools
from pathlib import Path
from typing import Annotated, Literal

import msgspec
from msgspec import Meta, Struct

__all__ = ["HandScript", "SimulatedHand", "SimulatedHardware", "Waypoint", "read_hand"]

Positive = Annotated[float, Meta(gt=0.0, le=1e6)]
NotNegative = Annotated[float, Meta(ge=0.0, le=1e6)]
Place = tuple[float, float, float]


class SimulatedHardware(Struct, frozen=True, forbid_unknown_fields=True):
    """The device: a mass with a little friction, driven by the force that it is given.

    Attributes
    ----------
    mass_kg, damping_N_s_per_m
        Apparent mass and viscous friction at the cursor, the same in all directions.
    latency_ms
        Time from a force's arrival to its action.
    hold_ms
        Time for which a force acts when no message follows.
    force_limit_N, force_rate_limit_N_per_s
        What its motors give, and how fast that may change.
    start_m
        Where the cursor is at first, m: right, forward and up.
    device_id, grip_id
        Names under which the two are reported.
    protocol
        Version of Haply's messages that are served.
    """

    mass_kg: Positive = 0.15
    damping_N_s_per_m: NotNegative = 0.5  # noqa: N815 (units are written as they are)
    latency_ms: Annotated[float, Meta(ge=0.0, le=100.0)] = 0.0
    hold_ms: Positive = 20.0
    force_limit_N: Positive = 10.0  # noqa: N815
    force_rate_limit_N_per_s: Positive = 200.0  # noqa: N815
    start_m: Place = (0.0, -0.12, 0.15)
    device_id: str = "049D"
    grip_id: str = "61576"
    protocol: Literal["3.1", "3.5"] = "3.5"


class SimulatedHand(Struct, frozen=True, forbid_unknown_fields=True):
    """The hand: a damped spring between where it wants to be and the device.

    Attributes
    ----------
    stiffness_N_per_m, damping_N_s_per_m
        Of the grip.
    reaction_delay_ms
        How late the hand knows where the device is: its spring acts on the place then.
    tremor_mm, tremor_Hz
        Amplitude and frequency of a tremor of the place where it wants to be.
    seed
        Chooses the tremor's phases.
    """

    stiffness_N_per_m: NotNegative = 300.0  # noqa: N815
    damping_N_s_per_m: NotNegative = 2.0  # noqa: N815
    reaction_delay_ms: Annotated[float, Meta(ge=0.0, le=100.0)] = 0.0
    tremor_mm: NotNegative = 0.0
    tremor_Hz: Positive = 9.0  # noqa: N815
    seed: Annotated[int, Meta(ge=0)] = 1


class Waypoint(Struct, frozen=True, forbid_unknown_fields=True):
    """A place that the hand wants to be at, and the buttons that it presses from then on.

    Attributes
    ----------
    time_s
        Time since the first command.
    offset_mm
        From the start: right, forward and up.
    buttons
        Of `a`, `b` and `c`.
    """

    time_s: NotNegative
    offset_mm: Place
    buttons: tuple[Literal["a", "b", "c"], ...] = ()

    @property
    def pressed(self) -> int:
        """The buttons as bits: 1 for a, 2 for b, 4 for c."""
        return sum(1 << "abc".index(button) for button in set(self.buttons))


class HandScript(Struct, frozen=True, forbid_unknown_fields=True):
    """A device, a hand and its path: from place to place with the least jerk.

    Attributes
    ----------
    device, hand
        What moves.
    path
        Where the hand wants to be, in the order of time; it stays at the last place.
    repeats
        Whether the path begins anew at its end.
    """

    device: SimulatedHardware = SimulatedHardware()
    hand: SimulatedHand = SimulatedHand()
    path: tuple[Waypoint, ...] = ()
    repeats: bool = False

    def __post_init__(self) -> None:
        times = [point.time_s for point in self.path]
        if any(later <= earlier for earlier, later in itertools.pairwise(times)):
            raise ValueError(f"the times of a path must grow, got {times} s")


def read_hand(path: Path) -> HandScript:
    """Return the hand in a TOML file."""
    try:
        return msgspec.toml.decode(path.read_bytes(), type=HandScript)
    except OSError as error:
        raise ValueError(f"cannot read {path}: {(error.strerror or str(error)).lower()}") from error
    except msgspec.MsgspecError as error:
        raise ValueError(f"{path} is no hand: {error}") from error
