"""The servo: what a scripted hand feels, its energy, its limits, and that it is made again."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from app.haptics import servo as servo_module
from app.haptics.device import DeviceError, DeviceLimits, DeviceOptions, DeviceState
from app.haptics.device_run import read_device_run
from app.haptics.duct_choice import (
    DuctChoice,
    passive_coupling,
    passive_delay,
    played_again,
)
from app.haptics.hand import HandScript, SimulatedHand, SimulatedHardware, Waypoint
from app.haptics.haptic_beam import HapticBeam
from app.haptics.haptic_bed import HapticBed
from app.haptics.haptic_run import run_haptics
from app.haptics.regulator import BRAKED, LEAST, MADE, MODELLED, SAMPLED, WITHHELD, WORK
from app.haptics.servo import Servo
from app.haptics.servo_loop import CLUTCH, FRESH, LIVE, PLACE_UNIT, TAKE, LoopSettings, ServoLoop
from app.haptics.virtual_device import VirtualDevice
from app.simulation import RoundBeam, Specimen, bed_named, preset_named
from physics import Cubic, Exact, LawName, NeoHooke, Theory

DUCT = preset_named("thesis-bile-duct")
STIFFNESS = 0.1388  # N/mm of the thesis's duct at rest: 3 E I (S/(a b))^3
THERE_AND_BACK = (
    Waypoint(0.1, (0.0, 0.0, 0.0)), Waypoint(1.1, (2.0, -1.0, 10.0)),
    Waypoint(1.6, (0.0, 0.0, 10.0)), Waypoint(2.6, (0.0, 0.0, 0.0)),
)  # fmt: skip
TO_THE_TEAR = (Waypoint(0.1, (0.0, 0.0, 0.0)), Waypoint(2.1, (0.0, 0.0, 30.0)))


def choice(theory: Theory | None = None, grasp: float | None = None,
           second: float | None = None) -> DuctChoice:  # fmt: skip
    return DuctChoice.of(Specimen(DUCT, theory=theory or Cubic()), grasp, second)


def hand(path: tuple[Waypoint, ...] = THERE_AND_BACK, *, device: dict[str, Any] | None = None,
         **grip: Any) -> HandScript:  # fmt: skip
    figures: dict[str, Any] = {"stiffness_N_per_m": 700.0, "damping_N_s_per_m": 8.0, **grip}
    return HandScript(
        device=SimulatedHardware(**(device or {})), hand=SimulatedHand(**figures), path=path
    )


@dataclass
class Rendered:
    """A run of a loop with a virtual device: its course, a row a period."""

    loop: ServoLoop
    device: VirtualDevice
    hooks: np.ndarray[tuple[int], np.dtype[np.float64]]
    forces: np.ndarray[tuple[int], np.dtype[np.float64]]
    given: np.ndarray[tuple[int, int], np.dtype[np.float64]]
    energies: np.ndarray[tuple[int, int], np.dtype[np.float64]]
    left: np.ndarray[tuple[int], np.dtype[np.float64]]  # of the work on the model, by its own count


def rendered(script: HandScript, chosen: DuctChoice | None = None, *, rate: int = 1000,
         seconds: float = 3.0, coupling: float = 1.0, scale: float = 1.0, retrace: bool = False,
         stalled: Callable[[int], bool] = lambda _: False) -> Rendered:  # fmt: skip
    how = LoopSettings(rate, scale)
    device = VirtualDevice(DeviceOptions("", how.period, script))
    duct = (chosen or choice()).haptic_model(coupling, how.period, retrace=retrace)
    loop = ServoLoop(duct, how, device.limits)
    model, state, rows = loop.model, DeviceState(), round(seconds * rate)
    hooks, forces, left = np.zeros(rows), np.zeros(rows), np.zeros(rows)
    given, energies = np.zeros((rows, 3)), np.zeros((rows, 8))
    for row in range(rows):
        device.exchange(loop.given[0], state)
        units = np.rint(state.position[None, :] / PLACE_UNIT).astype(np.int64)
        if not stalled(row):  # otherwise the device goes on under the last force
            loop.step(units, [FRESH | LIVE])
        hooks[row], forces[row] = model.hooks[0, 2], model.forces[0, 2]
        given[row], energies[row] = loop.given[0], loop.regulator.energies
        left[row] = energies[row, MODELLED] - (model.stored + model.spent + model.released) / scale
    return Rendered(loop, device, hooks, forces, given, energies, left)


@pytest.mark.parametrize("theory", [Cubic(), Exact(), Exact(NeoHooke())])
def test_the_force_is_the_theorys_at_the_hooks_place(theory: Theory) -> None:
    run = rendered(hand(), choice(theory, 20.0))
    assert run.hooks.max() > 5.0
    beam = choice(theory, 20.0).specimen.beam
    for row in range(0, len(run.hooks), 50):
        if run.hooks[row] > 0.0:
            solved = theory.pull(beam, 20.0).to_deflection(float(run.hooks[row])).force
            assert run.forces[row] == pytest.approx(solved, rel=1e-6)
    # What the device gets is the force downwards, but for the little that the controller adds.
    assert np.abs(run.given[:, 2] + run.forces).max() < 0.05


def paths(most: float) -> st.SearchStrategy[tuple[Waypoint, ...]]:
    """Paths with reversals, some faster than a hand; below rest the hook is slack."""
    place = st.tuples(*[st.floats(-3.0, 3.0)] * 2, st.floats(-3.0, most))
    leg = st.tuples(st.floats(0.02, 0.4), place)

    def path(legs: list[tuple[float, tuple[float, float, float]]]) -> tuple[Waypoint, ...]:
        times = np.cumsum([0.1] + [seconds for seconds, _ in legs]).tolist()
        places = [(0.0, 0.0, 0.0), *(place for _, place in legs)]
        return tuple(Waypoint(at, to) for at, to in zip(times, places, strict=True))

    return st.lists(leg, min_size=2, max_size=4).map(path)


def hands(most: float = 25.0) -> st.SearchStrategy[HandScript]:
    """Hands of ten times the duct's stiffness, with a tremor, which react late, on late devices."""
    return st.builds(
        lambda path, tremor, reaction, latency: hand(
            path, device={"latency_ms": latency}, tremor_mm=tremor, reaction_delay_ms=reaction,
            stiffness_N_per_m=1e4 * STIFFNESS, damping_N_s_per_m=12.0,
        ),
        paths(most), st.floats(0.0, 0.3), st.sampled_from([1.0, 5.0]), st.sampled_from([0.0, 1.0]),
    )  # fmt: skip


def unexplained(run: Rendered) -> float:
    """What the energies leave of the hand's work, over all periods, in parts of its peak."""
    energies, left = run.energies, run.left
    named = energies[:, [MODELLED, SAMPLED, BRAKED, WITHHELD]].sum(axis=1)
    peak = max(float(np.abs(energies[:, WORK]).max()), 1e-2)  # mJ; less is no pull
    assert np.abs(energies[:, WORK] - named).max() < 1e-12 * max(peak, 1.0)
    return float(np.abs(left).max()) / peak


@settings(deadline=None, max_examples=12)
@given(
    script=hands(),
    theory=st.sampled_from([Cubic(), Exact(), Exact(NeoHooke())]),
    rate=st.sampled_from([1000, 4000]),
)
@example(hand(TO_THE_TEAR, tremor_mm=0.1), Exact(NeoHooke()), 1000)
@example(hand(THERE_AND_BACK, tremor_mm=0.1), Exact(), 4000)
def test_the_work_of_any_hand_is_stored_or_dissipated_to_a_millionth(
    script: HandScript, theory: Theory, rate: int
) -> None:
    seconds = min(script.path[-1].time_s + 0.1, 2.7)
    run = rendered(script, choice(theory), rate=rate, seconds=seconds)
    assert unexplained(run) < 1e-6
    if script.path is TO_THE_TEAR:
        assert run.loop.model.torn
        assert run.energies[:, WORK].max() > 3.0


@settings(deadline=None, max_examples=5)
@given(script=hands(12.0), bed=st.sampled_from(["firm", "loose"]))
def test_the_work_of_any_hand_in_a_bed_is_stored_dissipated_or_released(
    script: HandScript, bed: str
) -> None:
    """To what the trapezoidal rule of the bed's own energies leave open; without `released`."""
    seconds = script.path[-1].time_s + 0.1
    run = rendered(script, in_bed(bed), seconds=seconds)
    assert unexplained(run) < 3e-4  # 6e-5 at worst in 250, 2e-7 in the median
    again = rendered(script, in_bed(bed), seconds=seconds, retrace=True)
    assert np.array_equal(again.given, run.given)
    assert unexplained(again) < 1e-5
    model = run.loop.model
    assert isinstance(model, HapticBed)
    if not model.torn:
        # Nothing of it is ours.
        assert run.left[-1] == pytest.approx(model.beam.energy.residual, abs=1e-11)


def test_what_the_motors_did_is_what_the_loop_has_booked() -> None:
    run = rendered(hand(device={"force_rate_limit_N_per_s": 1e6}))
    by_motors = 1e3 * run.device.simulated.work[1]
    # The last force still acts when the device's work is summed.
    assert run.energies[-1, WORK] == pytest.approx(-by_motors, abs=2e-4)


@pytest.mark.parametrize("reaction", [1.0, 5.0])
@pytest.mark.parametrize("latency", [0.0, 1.0, 5.0])
def test_a_stiff_hand_with_a_delay_is_steady(reaction: float, latency: float) -> None:
    script = hand(
        device={"latency_ms": latency}, reaction_delay_ms=reaction,
        stiffness_N_per_m=1e4 * STIFFNESS, damping_N_s_per_m=12.0,
    )  # fmt: skip
    run = rendered(script, choice(Exact()))
    held = run.forces[1400:1600]
    assert held.mean() > 1.0
    assert held.std() < 2e-3
    assert np.abs(np.diff(run.given[:, 2])).max() < 0.1
    assert run.energies[:, MADE].max() < 0.02  # uJ twenty: the bound that is stated
    assert run.energies[:, LEAST].min() > -0.02


def moved(seed: int, settings: LoopSettings, millimetres: float) -> np.ndarray:
    """Places, m, of 2 s of a motion up to 6 Hz that begins at rest."""
    random = np.random.default_rng(seed)
    time = np.arange(2 * settings.rate) * settings.period
    place = np.zeros((time.size, 3))
    for j in range(3):
        for f in random.uniform(0.2, 6.0, 6).tolist():
            wave = random.normal() * np.sin(2.0 * np.pi * f * time) / max(f, 1.0) ** 0.7
            place[:, j] += millimetres / 3.0 * wave
    return 1e-3 * place * np.minimum(time / 0.3, 1.0)[:, None]


def given_and_taken(
    loop: ServoLoop, held: list[np.ndarray], before: np.ndarray, place: np.ndarray, friction: float
) -> tuple[float, float]:
    """Step a loop whose device holds late forces; the work it is given and takes, mJ."""
    loop.step(np.rint(before[None] / PLACE_UNIT).astype(np.int64), [FRESH | LIVE])
    held.append(loop.given[0].copy())
    displacement = place - before
    given = -1e3 * float(held.pop(0) @ displacement)
    return given, 1e3 * friction * float(displacement @ displacement) / loop.settings.period


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("bed", ["firm", None])
@pytest.mark.parametrize(("late", "scale"), [(1, 1.0), (5, 1.0), (5, 0.5), (0, 1.0)])
def test_no_motion_gets_energy_out_of_a_device_that_is_late(
    late: int, scale: float, bed: str | None, seed: int
) -> None:
    """Whatever moves it, the device's friction takes at any time what its delay has made."""
    settings, friction = LoopSettings(scale=scale), 0.5
    limits = DeviceLimits(20.0, 1e6, friction, delay=1e-3 * late)
    chosen = choice(Exact()) if bed is None else in_bed(bed)
    coupling = passive_coupling(limits, settings)
    assert passive_delay(coupling, limits, settings) == pytest.approx(1e-3 * late, abs=1e-12)
    loop = ServoLoop(chosen.haptic_model(coupling, settings.period), settings, limits)
    places = moved(seed, settings, 12.0)
    held = [np.zeros(3)] * late
    taken = work = 0.0
    for before, place in pairwise(places):
        more_work, more_taken = given_and_taken(loop, held, before, place, friction)
        work, taken = work + more_work, taken + more_taken
        assert work + taken > -1e-3
    assert taken > 1.0


def test_a_coupling_that_is_too_stiff_for_a_late_device_gives_energy() -> None:
    """The bound is near: with twelve times the stiffness a hand that moves it is given energy."""
    late = hand(
        (Waypoint(0.1, (0.0, 0.0, 0.0)), Waypoint(0.2, (0.0, 0.0, 12.0)),
         Waypoint(0.3, (0.0, 0.0, 0.5))), device={"latency_ms": 5.0}, stiffness_N_per_m=3000.0,
        damping_N_s_per_m=12.0,
    )  # fmt: skip
    late = msgspec.structs.replace(late, repeats=True)
    limits = VirtualDevice(DeviceOptions("", 1e-3, late)).limits
    assert limits.delay == 5e-3
    bound = passive_coupling(limits, LoopSettings())
    given = []
    for coupling in (bound, 12.0 * bound):
        run = rendered(late, in_bed(), coupling=coupling)
        by_motors, by_friction = run.device.simulated.work[1:]
        given.append(1e3 * (by_motors + by_friction) + run.loop.model.stored)
    assert given[0] < 0.0 < given[1]


@pytest.mark.parametrize("stall", [3, 15])
@pytest.mark.parametrize("reaction", [1.0, 5.0])
def test_a_process_that_stalls_gives_the_hand_nothing(reaction: float, stall: int) -> None:
    script = hand(
        reaction_delay_ms=reaction, stiffness_N_per_m=1e4 * STIFFNESS, damping_N_s_per_m=12.0,
        tremor_mm=0.1,
    )  # fmt: skip
    run = rendered(script, stalled=lambda row: row % 50 < stall)
    assert run.forces.max() > 1.0
    assert run.energies[:, LEAST].min() > -0.02
    assert 1e3 * run.device.simulated.work[1] < 0.02  # by the motors, in all
    assert np.linalg.norm(np.diff(run.given, axis=0), axis=1).max() < 0.2


def test_a_hand_is_where_its_first_state_says_however_late_that_comes() -> None:
    loop = ServoLoop(choice().haptic_model(1.0), LoopSettings(), DeviceLimits(8.0, 200.0, 0.5))
    for _ in range(5):
        loop.step(np.zeros((1, 3), np.int64), [LIVE])
    far = np.array([[0, -1_200_000, 1_500_000]])
    for _ in range(50):
        loop.step(far, [FRESH | LIVE])
    assert not loop.model.torn
    assert not loop.given.any()


def test_the_controller_takes_out_what_sampling_makes() -> None:
    # A coupling far beyond 2 b/T, on a device with next to no friction.
    script = hand(
        (Waypoint(0.1, (0.0, 0.0, 0.0)), Waypoint(0.6, (0.0, 0.0, 9.0)),
         Waypoint(0.9, (0.0, 0.0, 0.5)), Waypoint(1.2, (0.0, 0.0, 9.0))),
        device={"damping_N_s_per_m": 0.0}, damping_N_s_per_m=1.0,
    )  # fmt: skip
    run = rendered(script, coupling=5.0, seconds=2.0)
    assert run.energies[-1, SAMPLED] < -0.02  # energy that was made
    assert run.energies[-1, BRAKED] > 0.5 * -run.energies[-1, SAMPLED]
    assert run.energies[:, MADE].max() < 0.02


def test_a_tear_is_felt_and_bounded() -> None:
    run = rendered(hand(TO_THE_TEAR), seconds=2.6)
    torn = int(np.flatnonzero(np.diff((run.forces > 0.0).astype(int)) < 0)[-1])
    assert run.forces[torn] == pytest.approx(3.5586, rel=1e-3)
    changes = np.linalg.norm(np.diff(run.given, axis=0), axis=1)
    assert changes.max() <= 0.2 * (1.0 + 1e-9)  # 200 N/s at 1 kHz
    assert run.forces[torn + 1 :].max() == 0.0
    assert np.abs(run.given[torn + 40 :]).max() < 0.05  # gone within 40 ms


def test_limits_scale_and_start() -> None:
    weak = rendered(hand(device={"force_limit_N": 0.7}))
    assert np.linalg.norm(weak.given, axis=1).max() <= 0.7 * (1.0 + 1e-12)
    assert weak.forces.max() > 1.0
    half = rendered(hand(), scale=0.5)
    assert half.hooks.max() < 5.2
    assert half.energies[-1, MODELLED] == pytest.approx(half.loop.model.stored / 0.5, abs=1e-5)
    assert passive_coupling(DeviceLimits(8.0, 200.0, 0.5), LoopSettings()) == 1.0  # 2 b/T


def units(z: float) -> np.ndarray[tuple[int, int], np.dtype[np.int64]]:
    return np.array([[0, 0, round(1e-3 * z / PLACE_UNIT)]], np.int64)


def stepped(loop: ServoLoop, z: float, bits: int, periods: int = 1) -> float:
    for _ in range(periods):
        loop.step(units(z), [bits])
    return float(loop.given[0, 2])


LIMITS = DeviceLimits(10.0, 200.0, 0.5)


def test_there_is_no_force_while_states_are_missing_and_it_comes_back_softly() -> None:
    loop = ServoLoop(choice().haptic_model(1.0), LoopSettings(), LIMITS)
    stepped(loop, 0.0, FRESH | LIVE)
    pulled = stepped(loop, 6.0, FRESH | LIVE, 500)
    assert pulled < -0.5
    assert stepped(loop, 6.0, LIVE) == pytest.approx(pulled, rel=1e-6)  # one is missing
    assert stepped(loop, 6.0, 0) == 0.0  # too old
    soft = [stepped(loop, 6.0, FRESH | LIVE) for _ in range(400)]
    assert soft[0] == pytest.approx(pulled / 300.0, rel=1e-2)  # of 0.3 s
    assert soft[150] == pytest.approx(0.5 * pulled, rel=0.02)
    assert soft[-1] == pytest.approx(pulled, rel=1e-6)
    loop.end()
    assert stepped(loop, 6.0, FRESH | LIVE) == 0.0


def test_the_energies_close_for_a_service_that_misses_states() -> None:
    loop = ServoLoop(choice().haptic_model(1.0), LoopSettings(), LIMITS)
    for period in range(2000):
        stepped(loop, 4e-3 * period, LIVE if period % 50 < 10 else FRESH | LIVE)
    assert loop.model.stored > 2.0
    assert loop.regulator.energies[MODELLED] == pytest.approx(loop.model.stored, rel=2e-8)


def test_the_clutch_moves_the_device_without_the_hook_and_makes_no_energy() -> None:
    loop = ServoLoop(choice().haptic_model(1.0), LoopSettings(), LIMITS)
    stepped(loop, 0.0, FRESH | LIVE)
    for z in np.linspace(0.0, 6.0, 300).tolist():
        stepped(loop, z, FRESH | LIVE)
    hook = float(loop.model.hooks[0, 2])
    for z in np.linspace(6.0, -20.0, 300).tolist():
        assert stepped(loop, z, FRESH | LIVE | CLUTCH) == 0.0
    assert loop.model.hooks[0, 2] == hook
    stepped(loop, -20.0, FRESH | LIVE, 400)
    assert loop.model.hooks[0, 2] == hook
    for z in np.linspace(-20.0, -26.0, 300).tolist():
        stepped(loop, z, FRESH | LIVE)
    assert loop.model.hooks[0, 2] == pytest.approx(0.0, abs=1e-9)
    assert loop.regulator.energies[WORK] > -0.02


def rotation(angle: float) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    """About (1, 2, 2)/3, by Rodrigues's formula."""
    x, y, z = 1.0 / 3.0, 2.0 / 3.0, 2.0 / 3.0
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + math.sin(angle) * cross + (1.0 - math.cos(angle)) * cross @ cross


def test_a_device_with_axes_of_its_own_gets_the_force_turned_back() -> None:
    # Without a damper, which would set in a period earlier or later for places on another grid.
    settings, axes = LoopSettings(), rotation(0.8)
    limits = DeviceLimits(10.0, 200.0, 0.5, added_damping=0.0)
    plain, turned = (
        ServoLoop(in_bed().haptic_model(0.2, settings.period), settings, limits) for _ in range(2)
    )
    turned.turn(0, axes)
    largest = 0.0
    for place in moved(4, settings, 2.0)[:1200]:
        for loop, at in ((plain, place), (turned, place @ axes)):
            loop.step(np.rint(at[None] / PLACE_UNIT).astype(np.int64), [FRESH | LIVE])
        largest = max(largest, float(np.abs(plain.given).max()))
        assert turned.model.forces[0] == pytest.approx(plain.model.forces[0], abs=5e-4)
        assert turned.given[0] @ axes.T == pytest.approx(plain.given[0], abs=5e-4)
    assert largest > 0.05
    for loop in (plain, turned):
        assert isinstance(loop.model, HapticBed)
        assert loop.model.parted == 0


def test_axes_that_turn_move_no_hook_and_give_no_energy() -> None:
    """At thirty times a second, as a scope that an assistant leads."""
    settings, friction = LoopSettings(), 0.5
    limits = DeviceLimits(20.0, 1e6, friction, delay=1e-3)
    coupling = passive_coupling(limits, settings)
    loop = ServoLoop(in_bed().haptic_model(coupling, settings.period), settings, limits)
    places = moved(5, settings, 12.0)
    held, taken, work = [np.zeros(3)], 0.0, 0.0
    for row, (before, place) in enumerate(pairwise(places)):
        if row % 33 == 0:
            target = loop.hook_targets[0].copy()
            loop.turn(0, rotation(1e-3 * row))
            units = np.rint(before[None] / PLACE_UNIT).astype(np.int64)
            loop.step(units, [LIVE])  # without a new state: the device stands
            assert np.array_equal(loop.hook_targets[0], target)
        more_work, more_taken = given_and_taken(loop, held, before, place, friction)
        work, taken = work + more_work, taken + more_taken
        assert work + taken > -1e-3
    assert taken > 1.0
    assert np.abs(loop.given).max() > 0.01


def test_a_button_takes_the_duct_and_lets_go() -> None:
    loop = ServoLoop(choice().haptic_model(1.0), LoopSettings(hold=False), LIMITS)
    stepped(loop, 0.0, FRESH | LIVE)
    assert stepped(loop, 5.0, FRESH | LIVE, 400) == 0.0
    for z in np.linspace(5.0, 9.0, 200).tolist():
        stepped(loop, z, FRESH | LIVE | TAKE)
    assert loop.hook_targets[0, 2] == pytest.approx(4.0)
    assert loop.model.forces[0, 2] > 0.3
    stored = loop.model.stored
    stepped(loop, 9.0, FRESH | LIVE, 50)
    assert loop.model.forces[0, 2] == 0.0
    assert loop.model.spent == pytest.approx(stored)


def test_a_lost_hand_is_followed_along_its_way() -> None:
    near, far = (HapticBeam(Exact(), choice().specimen.beam, (25.4,), threshold=9.0, coupling=1.0)
                 for _ in range(2))  # fmt: skip
    steps = ServoLoop(near, LoopSettings(), LIMITS)
    jump = ServoLoop(far, LoopSettings(), LIMITS)
    for z in np.linspace(0.0, 3.0, 601).tolist():
        stepped(steps, z, FRESH | LIVE)
    stepped(jump, 0.0, FRESH | LIVE)
    stepped(jump, 3.0, FRESH | LIVE)
    works = [loop.regulator.energies[MODELLED] for loop in (steps, jump)]
    assert works[1] == pytest.approx(works[0], rel=1e-6)
    assert works[1] == pytest.approx(far.stored, rel=1e-6)


def test_a_second_hook_helps() -> None:
    alone, helped = choice(Exact(), 20.0), choice(Exact(), 20.0, 34.0)
    one, two = (each.haptic_model(1.0) for each in (alone, helped))
    loops = [ServoLoop(model, LoopSettings(), LIMITS) for model in (one, two)]
    loops[1].assist(1, 0.0)
    for loop in loops:
        for z in np.linspace(0.0, 5.0, 300).tolist():
            stepped(loop, z, FRESH | LIVE)
    assert two.forces[0, 2] == pytest.approx(one.forces[0, 2], rel=1e-5)  # slack, it is none
    before = float(two.forces[0, 2])
    for height in np.linspace(0.0, 6.0, 300).tolist():
        loops[1].assist(1, height)
        stepped(loops[1], 5.0, FRESH | LIVE)
    assert two.forces[1, 2] > 0.3
    assert two.forces[0, 2] < before  # the assistant takes over what the first had to bear
    total = loops[1].regulator.energies[MODELLED] + loops[1].assist_work
    assert total == pytest.approx(two.stored, rel=1e-6)


def test_the_work_of_a_second_hook_that_is_left_somewhere_is_stored() -> None:
    model = choice(Exact(), 15.4, 35.4).haptic_model(1.0)
    loop = ServoLoop(model, LoopSettings(), LIMITS)
    loop.assist(1, 5.0)
    stepped(loop, 0.0, FRESH | LIVE)
    assert model.hooks[1, 2] == pytest.approx(5.0 - model.forces[1, 2])  # behind 1 N/mm
    assert loop.assist_work == pytest.approx(model.stored, rel=1e-7)


def test_two_hands_on_two_hooks_share_a_symmetric_duct() -> None:
    model = choice(Exact(), 15.0, 50.8 - 15.0).haptic_model(1.0)
    loop = ServoLoop(model, LoopSettings(), LIMITS, hands=2)
    for z in np.linspace(0.0, 5.0, 400).tolist():
        loop.step(np.vstack([units(z), units(z)]), [FRESH | LIVE] * 2)
    assert loop.given[0, 2] == pytest.approx(loop.given[1, 2], rel=1e-9)
    assert loop.given[0, 2] < -0.5
    for z in np.linspace(5.0, 30.0, 800).tolist():
        loop.step(np.vstack([units(z), units(z)]), [FRESH | LIVE] * 2)
    assert model.torn


@pytest.mark.parametrize(
    ("second", "later", "oldest"),
    [(29.0, 0.2, 0.0), (37.0, 0.3, 0.0), (31.0, -0.2, 0.0), (37.0, 0.3, 3e-3)],
)
def test_the_work_of_two_hands_is_stored_to_a_millionth(
    second: float, later: float, oldest: float
) -> None:
    """With states up to `oldest` seconds late as well, so that the hands move by turns."""
    late = np.random.default_rng(1).uniform(0.0, oldest, (1200, 2))
    loop = ServoLoop(choice(Exact(), 15.0, second).haptic_model(1.0), LoopSettings(), LIMITS, 2)
    worst = peak = 0.0
    for period in range(
        1200
    ):  # each of them comes to the duct and off it while the other one moves
        times = 1e-3 * period - np.array([max(-later, 0.0), max(later, 0.0)])
        times = np.maximum(times - late[period], 0.0)
        heights = np.array([6.0, 4.0]) * np.sin(np.pi * times * np.array([1.1, 0.9]))
        places = np.rint(1e-3 / PLACE_UNIT * heights).astype(np.int64)
        loop.step(np.array([[0, 0, place] for place in places]), [FRESH | LIVE] * 2)
        work = float(loop.regulator.energies[MODELLED])
        peak = max(peak, work)
        worst = max(worst, abs(work - loop.model.stored))
    assert peak > 1.0
    assert worst < 1e-6 * peak


def in_bed(bed: str = "firm", second: float | None = None) -> DuctChoice:
    return DuctChoice.of(Specimen(DUCT, bed=bed_named(bed)), None, second)


UP_AND_DOWN = (
    Waypoint(0.1, (0.0, 0.0, 0.0)), Waypoint(2.1, (0.0, 0.0, 13.0)),
    Waypoint(2.4, (0.0, 0.0, 13.0)), Waypoint(3.6, (0.0, 0.0, 0.0)),
)  # fmt: skip


def test_strands_that_part_take_what_the_hand_puts_in_and_never_knock() -> None:
    """The hand's work is what the law has dissipated; the force changes in small steps."""
    run = rendered(hand(UP_AND_DOWN, tremor_mm=0.1), in_bed(), seconds=3.9)
    model = run.loop.model
    assert isinstance(model, HapticBed)
    assert model.parted > 200
    assert not model.torn
    assert model.stored < 0.01
    peak = run.energies[:, WORK].max()
    assert unexplained(run) < 1e-5
    assert abs(model.released) < 0.01 * peak  # by one Newton step a period
    assert model.spent > 0.3 * peak
    assert run.energies[:, MADE].max() < 0.02
    assert run.energies[:, LEAST].min() > -0.02
    changes = np.linalg.norm(np.diff(run.given, axis=0), axis=1)
    assert changes.max() < 0.05


@pytest.mark.parametrize(("bed", "grasp"), [("firm", 25.4), ("loose", 13.0), ("inflamed", 38.0)])
def test_a_hand_at_rest_in_a_bed_feels_the_force_of_the_equilibrium(bed: str, grasp: float) -> None:
    chosen = DuctChoice.of(Specimen(DUCT, bed=bed_named(bed)), grasp)
    loop = ServoLoop(chosen.haptic_model(1.0), LoopSettings(), LIMITS)
    for z in np.linspace(0.0, 3.0, 300).tolist():
        stepped(loop, z, FRESH | LIVE)
    stepped(loop, 3.0, FRESH | LIVE, 700)
    chosen_settings, still = loop.model, chosen.haptic_model(1.0)
    assert isinstance(chosen_settings, HapticBed)
    assert isinstance(still, HapticBed)
    node = still.beam.take(grasp)
    still.beam.lead(node, still.beam.places[node] + chosen_settings.hooks[0])
    still.beam.advance()
    assert chosen_settings.forces[0, 2] > 0.5
    assert chosen_settings.forces[0] == pytest.approx(
        still.beam.hand_force(node), rel=1e-6, abs=1e-7
    )


def test_a_duct_that_is_freed_is_softer_than_in_its_bed() -> None:
    """Down and up again along a duct whose strands have parted: a hand feels what it has done."""
    run = rendered(hand(UP_AND_DOWN), in_bed(), seconds=3.9)
    high = int(np.argmax(run.hooks))
    halfway = float(run.hooks[high]) * 0.5
    up = run.forces[int(np.flatnonzero(run.hooks >= halfway)[0])]
    down = run.forces[high + int(np.flatnonzero(run.hooks[high:] <= halfway)[0])]
    assert down < 0.8 * up


def test_too_firm_a_pull_tears_a_duct_in_its_bed_and_ends_the_force() -> None:
    run = rendered(hand(TO_THE_TEAR), in_bed("inflamed"), seconds=2.6)
    model = run.loop.model
    assert isinstance(model, HapticBed)
    assert model.torn
    # It looks every ten steps, and saw the stress soon after it was past the threshold.
    assert 1.0 < model.beam.worst_stress().total / model.threshold < 1.05
    assert np.abs(run.given[-1]).max() < 0.02
    assert unexplained(run) < 1e-5  # the hand goes on, and does no work on what is torn
    changes = np.linalg.norm(np.diff(run.given, axis=0), axis=1)
    assert changes.max() <= 0.2 * (1.0 + 1e-9)


def test_a_run_in_a_bed_is_made_again_to_the_bit() -> None:
    periods = iter(range(1200))
    chosen = in_bed("loose", 34.0)
    _, run = run_haptics(
        chosen, options(hand(UP_AND_DOWN)), LoopSettings(),
        lambda: None if next(periods, None) is not None else "enough", assist=2.0,
    )  # fmt: skip
    again = read_device_run(msgspec.json.encode(run))
    assert (again.bed, again.bed_seed) == ("loose", 1)
    _, recorder, closes_to = played_again(again, chosen)
    assert recorder.forces_sha256 == run.forces_sha256
    assert 0.0 < closes_to < 1e-6
    assert played_again(again, in_bed("normal", 34.0))[1].forces_sha256 != run.forces_sha256


def options(script: HandScript) -> list[tuple[str, DeviceOptions]]:
    return [("virtual", DeviceOptions("", 0.001, script))]


def test_a_run_is_a_small_file_and_is_made_again_to_the_bit(tmp_path: Path) -> None:
    periods = iter(range(1500))
    chosen = choice(Exact())
    report, run = run_haptics(
        chosen, options(hand(tremor_mm=0.05)), LoopSettings(),
        lambda: None if next(periods, None) is not None else "enough",
    )  # fmt: skip
    assert report.ended_by == "enough"
    assert report.periods == run.periods == 1499 or report.periods == 1500
    content = msgspec.json.encode(run)
    assert len(content) < 6 * run.periods
    again = read_device_run(content)
    loop, recorder, closes_to = played_again(again, chosen)
    assert recorder.forces_sha256 == run.forces_sha256 == report.forces_sha256
    assert float(loop.regulator.energies[WORK]) == report.energy_mJ.work_of_hands
    check = report.force_check
    assert check is not None
    assert check.largest_error < 1e-6
    assert report.energy_mJ.residual_of_peak <= closes_to < 1e-6
    other = DuctChoice.of(Specimen(DUCT, theory=Exact()), 24.0)
    assert played_again(again, other)[1].forces_sha256 != run.forces_sha256
    for wrong, says in (
        (b"{", "no device run"),
        (msgspec.json.encode(msgspec.structs.replace(run, version=9)), "version 9"),
    ):
        with pytest.raises(ValueError, match=says):
            read_device_run(wrong)
    with pytest.raises(ValueError, match="cannot be unpacked"):
        msgspec.structs.replace(run, inputs="////").unpacked()
    with pytest.raises(ValueError, match="not those of"):
        msgspec.structs.replace(run, periods=run.periods + 1).unpacked()


class Silent(VirtualDevice):
    """A device whose states end, or that goes away."""

    closed = False

    def __init__(self, script: HandScript, after: int, *, goes: bool = False) -> None:
        super().__init__(DeviceOptions("", 0.001, script))
        self.left, self.goes = after, goes
        self.forces: list[float] = []

    def exchange(self, force: Any, state: DeviceState) -> bool:
        self.forces.append(float(np.linalg.norm(force)))
        self.left -= 1
        if self.left < 0 and self.goes:
            raise DeviceError("it has gone")
        return super().exchange(force, state) and self.left >= 0

    def trouble(self) -> str | None:
        return "nothing comes"

    def close(self) -> None:
        self.closed = True


@pytest.mark.parametrize("goes", [False, True])
def test_a_device_that_falls_silent_ends_the_servo(goes: bool) -> None:
    path = (Waypoint(0.0, (0.0, 0.0, 0.0)), Waypoint(0.2, (0.0, 0.0, 9.0)))
    device = Silent(hand(path), 400, goes=goes)
    loop = ServoLoop(choice().haptic_model(1.0), LoopSettings(), device.limits)
    report = Servo([device], loop).run(20.0, lambda: None)
    assert device.closed
    assert not loop.given.any()
    assert max(device.forces[:401]) > 0.3
    if goes:
        assert report.ended_by == "it has gone"
    else:
        assert report.ended_by.endswith("nothing comes")
        assert not any(device.forces[450:])  # no force for most of the silent second
        assert report.stale_periods == report.device_errors["nothing comes"]


class Unsure(VirtualDevice):
    """A device whose states are no numbers for some periods, and which does not close."""

    periods = 0

    def exchange(self, force: Any, state: DeviceState) -> bool:
        fresh = super().exchange(force, state)
        self.periods += 1
        if 500 <= self.periods < 510:
            state.position[2] = math.nan
        return fresh

    def close(self) -> None:
        raise OSError("it is stuck")


def test_places_that_are_no_numbers_move_nothing_and_all_devices_are_closed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(servo_module, "SILENT_SECONDS", 60.0)  # a busy machine may stand still
    path = (Waypoint(0.0, (0.0, 0.0, 0.0)), Waypoint(0.3, (0.0, 0.0, 6.0)))
    unsure = Unsure(DeviceOptions("", 0.001, hand(path)))
    other = Silent(hand(path), 10_000)
    loop = ServoLoop(choice(Exact(), 15.0, 35.0).haptic_model(1.0), LoopSettings(), other.limits, 2)
    servo = Servo([unsure, other], loop)
    with pytest.raises(OSError, match="stuck"):
        servo.run(None, lambda: "enough" if unsure.periods == 700 else None)
    assert other.closed
    assert not loop.given.any()
    report = servo.report("enough")
    assert not report.torn
    assert report.device_errors["a place that is no number or out of reach"] == 10


def test_a_report_has_all_ducts_that_were_felt() -> None:
    heights = {0.05: 0.0, 0.2: 30.0, 0.26: 10.0, 0.4: 18.0, 0.5: 24.0}
    path = tuple(Waypoint(at, (0.0, 0.0, up)) for at, up in heights.items())
    device = VirtualDevice(DeviceOptions("", 0.001, hand(path)))
    ducts = [choice(theory, 20.0).haptic_model(1.0) for theory in (Cubic(), Exact(), Exact())]
    tearing, *others = ducts
    loop = ServoLoop(tearing, LoopSettings(), device.limits)
    servo = Servo([device], loop)
    balances: list[tuple[float, float]] = []
    periods = 0

    def balance() -> None:
        spent = loop.model.spent + loop.model.stored
        balances.append((float(loop.regulator.energies[WORK]), spent))

    def changed() -> None:
        nonlocal periods
        periods += 1
        if periods in (260, 400):
            balance()
            loop.render(others.pop(0))
        elif periods == 402:  # a duct that nobody has pulled counts for nothing
            loop.render(choice().haptic_model(1.0))
            loop.render(ducts[-1])

    report = servo.run(None, lambda: "enough" if periods == 500 else None, changed)
    balance()
    energy, check = report.energy_mJ, report.force_check
    works, stored = np.array(balances).T
    assert min(np.abs(works)) > 1e-3
    assert energy.work_of_hands == pytest.approx(works.sum(), rel=1e-12)
    assert energy.stored + energy.torn == pytest.approx(stored.sum(), rel=1e-12)
    assert energy.residual_of_peak < 1e-6
    assert [duct.torn for duct in ducts] == [True, False, False]
    assert report.torn
    assert report.ducts == 3
    assert report.theory == "cubic, then exact"
    assert ("ducts", "3, with a tear") in report.lines()
    assert check is not None
    assert check.largest_error < 1e-6
    assert check.places >= 3


def test_what_cannot_be_felt_is_refused() -> None:
    with pytest.raises(ValueError, match="take --theory exact"):
        choice(Cubic(), 20.0, 30.0).haptic_model(1.0)
    with pytest.raises(ValueError, match="take --theory exact"):
        choice(Cubic(q="fitted")).haptic_model(1.0)
    with pytest.raises(ValueError, match="coupling"):
        choice().haptic_model(0.0)
    with pytest.raises(ValueError, match="own sections"):
        Specimen.of_sections(preset_named("porcine-bile-duct"), None)
    with pytest.raises(ValueError, match="grasp"):
        choice(grasp=90.0)
    whole = choice().haptic_model(1.0)
    assert isinstance(whole, HapticBeam)
    assert math.isfinite(whole.breaks_at)


TUBE = RoundBeam(span_mm=50.8, diameter_mm=8.89, wall_mm=1.0)


@pytest.mark.parametrize(
    ("law", "stiffening"), [("neo-hooke", None), ("exponential", 0.0), ("exponential", 6.0)]
)
def test_a_duct_of_fibres_is_felt_to_its_break_without_a_knock(
    law: LawName, stiffening: float | None
) -> None:
    """One Newton iteration a period is enough for what stiffens and for what softens."""
    duct = msgspec.structs.replace(
        preset_named("assumed-duct"), law=law, stiffening=stiffening, beam=TUBE
    )
    chosen = DuctChoice.of(Specimen(duct, bed=bed_named("loose")), None, None)
    up = (Waypoint(0.1, (0.0, 0.0, 0.0)), Waypoint(3.1, (0.0, 0.0, 75.0)))
    run = rendered(hand(up, tremor_mm=0.1), chosen, seconds=3.2)
    model = run.loop.model
    assert model.torn
    torn = int(np.flatnonzero((run.forces == 0.0) & (run.hooks > 1.0))[0])
    changes = np.linalg.norm(np.diff(run.given[:torn], axis=0), axis=1)
    assert changes.max() < 0.05
    assert unexplained(run) < 1e-4
    assert run.energies[:, LEAST].min() > -0.02
