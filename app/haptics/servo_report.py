"""What a servo has done: its times, its energies and how near its force is to the theory's."""

import numpy as np
from msgspec import Struct
from numpy.typing import NDArray

__all__ = ["Percentiles", "ServoReport", "TimeHistogram"]

BINS = 100_000
"""Of 1 us."""


class Percentiles(Struct, frozen=True):
    """Times, us.

    Attributes
    ----------
    median, p99, p99_9, largest
        Percentiles, to 1 us, and the largest.
    """

    median: float
    p99: float
    p99_9: float
    largest: float


class TimeHistogram:
    """Times counted in bins of 1 us, so that a day takes no more room than a second."""

    def __init__(self) -> None:
        self._counts: NDArray[np.int64] = np.zeros(BINS, np.int64)
        self._largest = 0.0

    def add(self, seconds: float) -> None:
        """Count a time."""
        place = int(1e6 * seconds)
        self._counts[min(max(place, 0), BINS - 1)] += 1
        self._largest = max(self._largest, 1e6 * seconds)

    def percentiles(self) -> Percentiles:
        """Return the percentiles so far."""
        total: NDArray[np.int64] = np.cumsum(self._counts)
        count = int(total[-1])
        if not count:
            return Percentiles(0.0, 0.0, 0.0, 0.0)
        wanted: NDArray[np.float64] = count * np.array([0.5, 0.99, 0.999])
        parts: list[float] = np.searchsorted(total, wanted).tolist()
        return Percentiles(parts[0], parts[1], parts[2], round(self._largest, 1))


class Energies(Struct, frozen=True):
    """Books of a run, N mm (mJ) of the hands.

    Attributes
    ----------
    work_of_hands
        What the hands put in, less what they got.
    stored, torn
        What the duct and its couplings hold, and what tears took.
    sampling
        What holding a force for a period takes (below zero: makes).
    controller, limits
        What the passivity controller and the bounds of the force took.
    assist
        What hooks without a device put in.
    residual_of_peak
        What of the hands' work is none of these, as a part of its peak.
    least_margin
        The least that the hands were ahead by; below zero they got more than they gave.
    allowed
        What the force's start under tension allowed for.
    """

    work_of_hands: float
    stored: float
    torn: float
    sampling: float
    controller: float
    limits: float
    assist: float
    residual_of_peak: float
    least_margin: float
    allowed: float


class ForceCheck(Struct, frozen=True):
    """The model's force beside the theory's own.

    Attributes
    ----------
    compared
        Which two.
    places
        At how many.
    largest_error
        Largest difference, relative to the theory's force.
    at_mm, at_N
        The farthest place that was compared, and the force there.
    """

    compared: str
    places: int
    largest_error: float
    at_mm: float
    at_N: float  # noqa: N815


class ServoReport(Struct, frozen=True):
    """A servo's run.

    Attributes
    ----------
    device
        Which.
    theory, grasps_mm, coupling_N_per_mm
        What was felt.
    scheduling
        Whether other processes wait for it.
    wanted_rate_Hz, rate_Hz, seconds, periods
        How fast, how long.
    missed_periods, missed_part
        Periods longer than one and a half, and their part.
    stale_periods
        Periods without a state.
    period_us, step_us, exchange_us, state_to_force_us
        Times: from period to period; of model, coupling and passivity; of the device's exchange;
        from a state's arrival to when the force that it gives has left.
    largest_force_N, largest_force_step_N
        Of those given to the device.
    energy_mJ, force_check
        See there.
    torn
        Whether the duct tore.
    ended_by
        Why it ended.
    troubles
        What the device said was wrong, with counts.
    forces_sha256
        Digest of all forces given.
    """

    device: str
    theory: str
    grasps_mm: tuple[float, ...]
    coupling_N_per_mm: float  # noqa: N815
    scheduling: str
    wanted_rate_Hz: int  # noqa: N815
    rate_Hz: float  # noqa: N815
    seconds: float
    periods: int
    missed_periods: int
    missed_part: float
    stale_periods: int
    period_us: Percentiles
    step_us: Percentiles
    exchange_us: Percentiles
    state_to_force_us: Percentiles
    largest_force_N: float  # noqa: N815
    largest_force_step_N: float  # noqa: N815
    energy_mJ: Energies  # noqa: N815
    force_check: ForceCheck | None
    torn: bool
    ended_by: str
    troubles: dict[str, int]
    forces_sha256: str

    def lines(self) -> list[tuple[str, str]]:
        """Return the report in words."""

        def times(of: Percentiles) -> str:
            return (
                f"median {of.median:.0f}, 99 % {of.p99:.0f}, 99.9 % {of.p99_9:.0f}, "
                f"largest {of.largest:.0f} us"
            )

        energy = self.energy_mJ
        lines = [
            ("device", self.device),
            ("theory", f"{self.theory}, coupling {self.coupling_N_per_mm:g} N/mm"),
            ("ended by", self.ended_by),
            ("scheduled", self.scheduling),
            ("rate", f"{self.rate_Hz:.1f} of {self.wanted_rate_Hz} Hz for {self.seconds:.1f} s"),
            ("period", times(self.period_us)),
            ("missed periods", f"{self.missed_periods} ({100.0 * self.missed_part:.3f} %), "
             f"{self.stale_periods} without a state"),
            ("step", times(self.step_us)),
            ("exchange", times(self.exchange_us)),
            ("state to force", times(self.state_to_force_us)),
            ("largest force", f"{self.largest_force_N:.3f} N, "
             f"{self.largest_force_step_N:.3f} N from one period to the next"),
            ("work of the hands", f"{energy.work_of_hands:.6g} mJ"),
            ("stored", f"{energy.stored:.6g} mJ, taken by a tear {energy.torn:.6g} mJ"),
            ("sampling", f"{energy.sampling:.6g} mJ; controller {energy.controller:.6g}, "
             f"limits {energy.limits:.6g} mJ"),
            ("books", f"close to {energy.residual_of_peak:.1e} of the peak; least margin "
             f"{energy.least_margin:.6g} mJ"),
        ]  # fmt: skip
        check = self.force_check
        if check is not None:
            lines.append(("force check", f"within {check.largest_error:.1e} at {check.places} "
                          f"places up to {check.at_mm:.6g} mm, {check.at_N:.6g} N"))  # fmt: skip
            lines.append(("compared", check.compared))
        lines.append(("duct", "torn" if self.torn else "whole"))
        lines += [("trouble", f"{what} ({count} times)") for what, count in self.troubles.items()]
        return lines
