"""A servo's report: times, energies and the difference of its force from the theory's."""

import numpy as np
from msgspec import Struct
from numpy.typing import NDArray

# Of 1 us.
BINS = 100_000


class Percentiles(Struct, frozen=True):
    """Times, us: percentiles, to 1 us, and the largest."""

    median: float
    p99: float
    p99_9: float
    largest: float


class TimeHistogram:
    """Times counted in bins of 1 us, so that memory does not grow with the run."""

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
        bounds: list[float] = np.searchsorted(total, wanted).tolist()
        return Percentiles(bounds[0], bounds[1], bounds[2], round(self._largest, 1))


class Energies(Struct, frozen=True):
    """The energy balance of a run, N mm (mJ): the sum of the ducts', at each one's end."""

    work_of_hands: float  # what they put in, less what they got
    stored: float  # in the duct and its couplings
    torn: float  # what tears and parted strands took
    released: float  # what steps in a bed released to nobody
    sampling: float  # what holding a force for a period takes (below zero: generates)
    controller: float  # what the passivity controller took
    limits: float  # what the bounds of the force took
    assist: float  # what hooks without a device put in
    # part of the hands' work, of its peak, that is none of these; of several ducts the largest
    residual_of_peak: float
    least_margin: float  # least lead of the hands; below zero they got more than they gave
    allowed: float  # for the force's start under tension

    def followed_by(self, after: "Energies") -> "Energies":
        """Return the balance of this duct and of those that were felt after it."""
        sums = {name: getattr(self, name) + getattr(after, name) for name in self.__struct_fields__}
        sums["residual_of_peak"] = max(self.residual_of_peak, after.residual_of_peak)
        sums["least_margin"] = min(self.least_margin, after.least_margin)
        return Energies(**sums)


class ForceCheck(Struct, frozen=True):
    """The model's force beside the theory's own."""

    compared: str  # which two
    places: int  # how many
    largest_error: float  # relative to the theory's force
    at_mm: float  # the farthest place that was compared, and `at_N` the force there
    at_N: float  # noqa: N815


class ServoReport(Struct, frozen=True):
    """The report of a servo's run, with all ducts that were felt in it."""

    device: str
    theory: str  # of each duct, if they differ
    ducts: int  # pulled one after the other; in a bed a new one begins when the device lets go
    grasps_mm: tuple[float, ...]  # of the last
    coupling_N_per_mm: float  # noqa: N815
    # how late devices may answer for their friction still to take what the delay makes
    passive_to_delay_ms: float
    scheduling: str  # whether other processes wait for it
    wanted_rate_Hz: int  # noqa: N815
    rate_Hz: float  # noqa: N815
    seconds: float
    periods: int
    missed_periods: int  # longer than one and a half
    missed_fraction: float  # of all periods
    stale_periods: int  # without a state
    period_us: Percentiles  # from period to period
    step_us: Percentiles  # of model, coupling and passivity, from a state to its force
    # with what is then done for the next step already, whatever its state will be
    whole_step_us: Percentiles
    exchange_us: Percentiles  # of the device's exchange
    state_to_force_us: Percentiles  # from a state's arrival to when its force has left
    # this and the next: of those given to the device
    largest_force_N: float  # noqa: N815
    largest_force_step_N: float  # noqa: N815
    energy_mJ: Energies  # noqa: N815
    force_check: ForceCheck | None
    torn: bool  # whether any did
    ended_by: str
    device_failed: bool  # whether that was the device's doing
    device_errors: dict[str, int]  # the device's errors, with counts
    forces_sha256: str  # of all forces given

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
            ("passive", f"for any motion with a delay of up to {self.passive_to_delay_ms:.3g} ms"
             if self.passive_to_delay_ms >= 0.0 else "not for every motion: the coupling is too "
             "stiff for the device's friction"),
            ("ended by", self.ended_by),
            ("scheduled", self.scheduling),
            ("rate", f"{self.rate_Hz:.1f} of {self.wanted_rate_Hz} Hz for {self.seconds:.1f} s"),
            ("period", times(self.period_us)),
            ("missed periods", f"{self.missed_periods} ({100.0 * self.missed_fraction:.3f} %), "
             f"{self.stale_periods} without a state"),
            ("step", times(self.step_us)),
            ("with work ahead", times(self.whole_step_us)),
            ("exchange", times(self.exchange_us)),
            ("state to force", times(self.state_to_force_us)),
            ("largest force", f"{self.largest_force_N:.3f} N, "
             f"{self.largest_force_step_N:.3f} N from one period to the next"),
            ("work of the hands", f"{energy.work_of_hands:.6g} mJ"),
            ("stored", f"{energy.stored:.6g} mJ, taken by tears {energy.torn:.6g}, "
             f"released {energy.released:.6g} mJ"),
            ("sampling", f"{energy.sampling:.6g} mJ; controller {energy.controller:.6g}, "
             f"limits {energy.limits:.6g} mJ"),
            ("energy balance", f"closes to {energy.residual_of_peak:.1e} of the peak; the hands "
             f"got at most {0.0 - energy.least_margin:.6g} mJ more than they had given"),
        ]  # fmt: skip
        check = self.force_check
        if check is not None:
            lines.append(("force check", f"within {check.largest_error:.1e} at {check.places} "
                          f"places up to {check.at_mm:.6g} mm, {check.at_N:.6g} N"))  # fmt: skip
            lines.append(("compared", check.compared))
        lines.append(("duct", "torn" if self.torn else "whole"))
        if self.ducts > 1:
            lines[-1] = "ducts", f"{self.ducts}, {'with' if self.torn else 'without'} a tear"
        lines += [
            ("device error", f"{what} ({count} times)")
            for what, count in self.device_errors.items()
        ]
        return lines
