"""The duct that is felt: chosen by names, recorded in a run, and built for the servo."""

from dataclasses import dataclass

from app.haptics.device import DeviceLimits
from app.haptics.device_run import DeviceRun, Recorder
from app.haptics.haptic_beam import HapticBeam, HapticModel
from app.haptics.haptic_bed import HapticBed
from app.haptics.regulator import WORK
from app.haptics.servo_loop import LoopSettings, ServoLoop
from app.simulation import ELEMENTS, OrganIdentity, Specimen, TheoryChoice, anatomy_or_name
from physics.bed import BeamOnBed

# N/mm: above the stiffness of any duct here.
STIFFEST = 5.0


def passive_coupling(limits: DeviceLimits, settings: LoopSettings) -> float:
    """Return the stiffest coupling, N/mm, that a device can show without giving energy."""
    # A spring K that is sampled with the period T and answered late by tau is passive on a device
    # with the friction b while b > K (T/2 + tau), for any motion: the force that is given differs
    # from the one that is due by K times the way since, at most, and by Cauchy and Schwarz the
    # integral of |x'(t) x'(t - s)| is no more than that of x'^2 [tau = 0: Colgate and Schenkel
    # 1997, J. Robotic Systems 14:37]. To the hand the scale makes the spring stiffer.
    if limits.damping <= 0.0:
        raise ValueError(
            "a device without friction can show no spring and give no energy: give it damping, or "
            "a coupling, N/mm"
        )
    late = 0.5 * settings.period + limits.delay
    return min(1e-3 * limits.damping / (settings.scale * late), STIFFEST)


def passive_delay(coupling: float, limits: DeviceLimits, settings: LoopSettings) -> float:
    """Return the delay, s, up to which a coupling, N/mm, gives no energy; below zero for none."""
    return 1e-3 * limits.damping / (settings.scale * coupling) - 0.5 * settings.period


@dataclass(frozen=True, slots=True)
class DuctChoice:
    """A specimen and where it is hooked: at one or two stations, mm from the first clamp.

    Of an anatomy, on which `tube`.
    """

    specimen: Specimen
    grasps: tuple[float, ...]
    tube: str | None = None

    @classmethod
    def of(
        cls,
        specimen: Specimen,
        grasp: float | None = None,
        second: float | None = None,
        tube: str | None = None,
    ) -> "DuctChoice":
        """Return a choice; the first hook is in the middle if `grasp` is None."""
        if specimen.anatomy is not None:
            tubes = specimen.tubes(elements=ELEMENTS)
            if tube not in tubes.names:
                given = "none is named" if tube is None else f"there is no {tube!r}"
                raise ValueError(f"which tube is felt? {given}: {', '.join(tubes.names)}")
            span = tubes.network.tubes[tube].span
            grasps = (
                0.5 * span if grasp is None else grasp,
                *(() if second is None else (second,)),
            )
            for each in grasps:
                if not 0.0 <= each <= span:
                    raise ValueError(
                        f"a hook at {each:g} mm is not on {tube}, of 0 to {span:.4g} mm"
                    )
            return cls(specimen, tuple(sorted(grasps)), tube)
        beam = specimen.beam
        first = 0.5 * beam.span if grasp is None else grasp
        grasps = (first,) if second is None else tuple(sorted((first, second)))
        for each in grasps:
            beam.grasped_at(each)
        return cls(specimen, grasps)

    def haptic_model(
        self, coupling: float, period: float = 1e-3, *, retrace: bool = False
    ) -> HapticModel:
        """Return the duct at rest behind a coupling, N/mm, for a servo's period, s."""
        # With `retrace` its energy in a bed closes better, and a step takes longer (`BeamOnBed`).
        specimen = self.specimen
        if specimen.theory is not None:
            return HapticBeam(
                specimen.theory,
                specimen.beam,
                self.grasps,
                threshold=specimen.threshold,
                coupling=coupling,
            )
        if self.tube is not None:
            tubes = specimen.tubes(elements=ELEMENTS)
            strengths = dict(zip(tubes.names, tubes.strengths, strict=True))
            return HapticBed(
                BeamOnBed(tubes.network, tubes.strands, floor=tubes.floor, retrace=retrace),
                self.grasps,
                threshold=strengths[self.tube],
                coupling=coupling,
                period=period,
                tube=self.tube,
                strengths=strengths,
                tear_mm_per_s=tubes.tear_speeds,
            )
        beam = specimen.space_beam(elements=ELEMENTS, nodes_at=self.grasps)
        return HapticBed(
            specimen.on_bed(beam, retrace=retrace),
            self.grasps,
            threshold=specimen.threshold,
            coupling=coupling,
            period=period,
            tear_mm_per_s=specimen.preset.tear_mm_per_s,
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
        specimen = self.specimen
        organ, bed, anatomy = specimen.organ, specimen.bed, specimen.anatomy
        return DeviceRun(
            preset=specimen.preset.name,
            organ_sha256=None
            if organ is None or anatomy is not None
            else OrganIdentity.of(organ).sha256,
            theory=TheoryChoice.of(specimen.solved_by),
            grasps_mm=self.grasps,
            threshold_MPa=specimen.threshold,
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
            bed=None if bed is None else bed.name,
            bed_seed=specimen.bed_seed,
            anatomy=None if anatomy is None else anatomy_or_name(anatomy),
            tube=self.tube,
            tear_mm_per_s=specimen.preset.tear_mm_per_s,
            clear_strands=anatomy is not None and specimen.clear_strands,
            joint_faces=anatomy is not None,
        )


def played_again(run: DeviceRun, choice: DuctChoice) -> tuple[ServoLoop, Recorder, float]:
    """Compute a recorded run again, period by period; to what part of its peak its work closes."""
    # There is time for `retrace` now; what moves is the same.
    places, bits = run.unpacked()
    hands = places.shape[1]
    model = choice.haptic_model(run.coupling_N_per_mm, run.settings.period, retrace=True)
    open_work = peak = 0.0
    loop = ServoLoop(model, run.settings, run.limits, hands)
    recorder = Recorder(hands)
    if run.assist_mm:
        loop.assist(hands, run.assist_mm)
    for units, inputs in zip(places, bits.tolist(), strict=True):
        loop.step(units, inputs)
        recorder.keep(units, inputs, loop.given)
        open_work = max(open_work, abs(loop.open_work))
        peak = max(peak, abs(float(loop.regulator.energies[WORK])))
    return loop, recorder, open_work / peak if peak else 0.0
