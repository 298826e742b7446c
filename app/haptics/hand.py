"""A scripted hand and the device it holds, as a file: they replace the hardware."""

import itertools
from pathlib import Path
from typing import Annotated, Literal

import msgspec
from msgspec import Meta, Struct

from app.bounded_file import decoded, read_bounded

MOST_BYTES = 1_000_000
Positive = Annotated[float, Meta(gt=0.0, le=1e6)]
NotNegative = Annotated[float, Meta(ge=0.0, le=1e6)]
Along = Annotated[float, Meta(ge=-1e4, le=1e4)]
Place = tuple[Along, Along, Along]


class SimulatedHardware(Struct, frozen=True, forbid_unknown_fields=True):
    """The device: a mass with a little friction, driven by the force that it is given."""

    mass_kg: Positive = 0.15  # apparent, at the cursor, the same in all directions
    damping_N_s_per_m: NotNegative = 0.5  # noqa: N815 (units are written as they are)
    # from a force's arrival to its action
    latency_ms: Annotated[float, Meta(ge=0.0, le=100.0)] = 0.0
    hold_ms: Positive = 20.0  # for which a force acts when no message follows
    force_limit_N: Positive = 10.0  # noqa: N815
    force_rate_limit_N_per_s: Positive = 200.0  # noqa: N815
    start_m: Place = (0.0, -0.12, 0.15)  # of the cursor: right, forward and up
    device_id: str = "049D"
    grip_id: str = "61576"
    protocol: Literal["3.1", "3.5"] = "3.5"  # version of Haply's messages that are served


class SimulatedHand(Struct, frozen=True, forbid_unknown_fields=True):
    """The hand: a damped spring between its target and the device, with a tremor of the target."""

    stiffness_N_per_m: NotNegative = 300.0  # noqa: N815
    damping_N_s_per_m: NotNegative = 2.0  # noqa: N815
    # how late the hand knows where the device is: its spring acts on the place then
    reaction_delay_ms: Annotated[float, Meta(ge=0.0, le=100.0)] = 0.0
    tremor_mm: NotNegative = 0.0  # amplitude
    tremor_Hz: Positive = 9.0  # noqa: N815
    seed: Annotated[int, Meta(ge=0)] = 1  # of the tremor's phases


class Waypoint(Struct, frozen=True, forbid_unknown_fields=True):
    """A target of the hand, and the buttons that it presses from then on."""

    time_s: NotNegative  # since the first command
    offset_mm: Place  # from the start: right, forward and up
    buttons: tuple[Literal["a", "b", "c"], ...] = ()

    @property
    def pressed(self) -> int:
        """The buttons as bits: 1 for a, 2 for b, 4 for c."""
        return sum(1 << "abc".index(button) for button in set(self.buttons))


class HandScript(Struct, frozen=True, forbid_unknown_fields=True):
    """A device, a hand and its path: minimum-jerk movements from target to target."""

    device: SimulatedHardware = SimulatedHardware()
    hand: SimulatedHand = SimulatedHand()
    path: tuple[Waypoint, ...] = ()  # in the order of time; the hand stays at the last place
    repeats: bool = False  # whether the path begins anew at its end

    def __post_init__(self) -> None:
        times = [point.time_s for point in self.path]
        if any(later <= earlier for earlier, later in itertools.pairwise(times)):
            raise ValueError(f"the times of a path must grow, got {times} s")


def read_hand(path: Path | None) -> HandScript:
    """Return the hand in a TOML file, or one at rest."""
    if path is None:
        return HandScript()
    content = read_bounded(path, MOST_BYTES, "hand")
    return decoded(msgspec.toml.decode, content, HandScript, f"{path} is no hand")
