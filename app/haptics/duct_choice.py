"""The duct that is felt: chosen by names, recorded in a run, and built for the servo."""

from dataclasses import dataclass

from app.haptics.device import DeviceLimits
from app.haptics.device_run import DeviceRun, Recorder
from app.haptics.felt_bed import FeltBed
from app.haptics.felt_duct import FeltDuct, FeltModel
from app.haptics.regulator import WORK
from app.haptics.servo_loop import LoopSettings, ServoLoop
from app.simulation import Dissection, OrganIdentity, Preset, RoundBeam, TheoryChoice
from app.simulation.bed import BED_THEORY, ELEMENTS, BedPreset, beam_in_space
from organ_geometry import Organ
from physics import Beam, Theory
from physics.bed import BeamOnBed, SpaceBeam

__all__ = ["STIFFEST", "DuctChoice", "passive_coupling", "played_again"]

# N/mm: above the stiffness of any duct here.
STIFFEST = 5.0


def passive_coupling(damping: float, rate: int) -> float:
    """Return the stiffest coupling that a device can show at a rate without giving energy."""
    # A spring K sampled with the period T is passive on a device with the friction b while
    # b > K T / 2 (Colgate and Schenkel 1997, J. Robotic Systems 14:37). 2 b/T, from N s/m and Hz,
    # is N/mm by the factor 1e-3.
    return min(2e-3 * damping * rate, STIFFEST)


@dataclass(frozen=True, slots=True)
class DuctChoice:
    """A duct, the theory that solves it and where it is hooked."""

    preset: Preset
    beam: Beam
    organ: Organ | None  # where its sections are the beam's
    theory: Theory
    grasps: tuple[float, ...]  # one hook or two, mm from the first clamp
    threshold: float  # stress at which it tears, MPa
    bed: BedPreset | None = None  # the tissue that holds it, if any
    bed_seed: int = 1  # of the bed's scatter

    @classmethod
    def of(
        cls,
        preset: Preset,
        organ: Organ | None,
        theory: Theory,
        grasp: float | None = None,
        second: float | None = None,
        *,
        bed: BedPreset | None = None,
        bed_seed: int = 1,
    ) -> "DuctChoice":
        """Return a choice; in a bed the theory is `BED_THEORY`."""
        if isinstance(preset.beam, RoundBeam):
            if organ is not None:
                raise ValueError(f"preset {preset.name} brings its own beam; leave out --organ")
            beam = preset.round_beam()
        elif organ is None:
            raise ValueError(f"preset {preset.name} takes the organ's own sections: give --organ")
        else:
            beam = Dissection.of(organ, preset).beam
        first = 0.5 * beam.span if grasp is None else grasp
        grasps = (first,) if second is None else tuple(sorted((first, second)))
        for each in grasps:
            beam.grasped_at(each)
        solved = theory if bed is None else BED_THEORY
        threshold = preset.threshold(solved, beam)
        return cls(preset, beam, organ, solved, grasps, threshold, bed, bed_seed)

    def felt(self, coupling: float, period: float = 1e-3, *, retrace: bool = False) -> FeltModel:
        """Return the duct at rest behind a coupling, N/mm, for a servo's period, s."""
        # With `retrace` its energy in a bed closes better, and a step takes longer (`BeamOnBed`).
        if self.bed is None:
            return FeltDuct(
                self.theory, self.beam, self.grasps, threshold=self.threshold, coupling=coupling
            )
        if self.organ is None:
            beam = SpaceBeam.of(self.beam, elements=ELEMENTS, nodes_at=self.grasps)
        else:
            dissection = Dissection.of(self.organ, self.preset)
            beam = beam_in_space(dissection, elements=ELEMENTS, nodes_at=self.grasps)
        layer = self.bed.bed(beam, seed=self.bed_seed)
        return FeltBed(
            BeamOnBed(
                beam, layer.strands_under(beam), floor=layer.floor_under(beam), retrace=retrace
            ),
            self.grasps,
            threshold=self.threshold,
            coupling=coupling,
            period=period,
        )

    def run(
        self,
        recorder: Recorder,
        settings: LoopSettings,
        limits: DeviceLimits,
        *,
        coupling: float,
        assist: float,
    ) -> DeviceRun:
        """Return a recorded run for a file."""
        return DeviceRun(
            preset=self.preset.name,
            organ_sha256=None if self.organ is None else OrganIdentity.of(self.organ).sha256,
            theory=TheoryChoice.of(self.theory),
            grasps_mm=self.grasps,
            threshold_MPa=self.threshold,
            coupling_N_per_mm=coupling,
            rate=settings.rate,
            scale=settings.scale,
            hold=settings.hold,
            stale_seconds=settings.stale_seconds,
            force_N=limits.force,
            force_rate_N_per_s=limits.force_rate,
            added_damping_N_s_per_m=limits.added_damping,
            assist_mm=assist,
            periods=recorder.periods,
            inputs=recorder.packed(),
            forces_sha256=recorder.forces_sha256,
            bed=None if self.bed is None else self.bed.name,
            bed_seed=self.bed_seed,
        )


def played_again(run: DeviceRun, choice: DuctChoice) -> tuple[ServoLoop, Recorder, float]:
    """Compute a recorded run again, period by period; to what part of its peak its work closes."""
    # There is time for `retrace` now; what moves is the same.
    places, bits = run.unpacked()
    hands = places.shape[1]
    model = choice.felt(run.coupling_N_per_mm, run.settings.period, retrace=True)
    open_work = peak = 0.0
    loop = ServoLoop(model, run.settings, run.limits, hands)
    recorder = Recorder(hands)
    if run.assist_mm:
        loop.assist(hands, run.assist_mm)
    for units, inputs in zip(places, bits.tolist(), strict=True):
        loop.step(units, inputs)
        recorder.keep(units, inputs, loop.given)
        open_work = max(open_work, abs(loop.open_work))
        peak = max(peak, abs(float(loop.regulator.books[WORK])))
    return loop, recorder, open_work / peak if peak else 0.0
