"""A hand on a device in the trainer: its servo's process, and the session that it leads."""

import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, cast
from unittest.mock import MagicMock

import numpy as np
import pytest
from program import LONGEST
from simulated import bed_session, phantom, pull_session

from app.anatomy import anatomy_named, anatomy_network
from app.haptics import servo_process
from app.haptics.device import DeviceError, DeviceOptions, DeviceState
from app.haptics.hand import HandScript, SimulatedHand, Waypoint
from app.haptics.servo_loop import FRESH, LIVE, PLACE_UNIT, LoopSettings, ServoLoop
from app.haptics.servo_process import (
    HEAD,
    ROW,
    BedSetting,
    DuctSetting,
    HapticSetting,
    HookSnapshot,
    ServoEnd,
    ServoLink,
    ServoProcess,
    Snapshot,
)
from app.haptics.virtual_device import VirtualDevice
from app.simulation import TICK_SECONDS, Phase, Replay, Session, Specimen, bed_named
from app.trainer.client.haptic_hand import HapticHand, setting_of
from app.trainer.client.page_state import PageState
from app.trainer.client.workers import Workers
from app.trainer.scope.held_scope import HeldScope
from physics import Exact, TautString


def hook(deflection: float = 0.0) -> HookSnapshot:
    return HookSnapshot(np.array([0.0, 0.0, deflection]), np.zeros(3), deflection, None, 0)


@dataclass
class Servo:
    """A servo without a process: where its hook is, is said."""

    device: str = "a spoon"
    ended: str | None = None
    not_rendered: str | None = None
    hands: int = 1
    rendered: list[HapticSetting | None] = field(default_factory=list[HapticSetting | None])
    now: Snapshot = field(default_factory=lambda: Snapshot(0, False, (hook(),)))
    stopped: bool = False

    def render(self, setting: HapticSetting | None) -> int:
        self.rendered.append(setting)
        self.now = Snapshot(len(self.rendered), False, (hook(),))
        return len(self.rendered)

    def pull(self, deflection: float, *, torn: bool = False) -> None:
        self.now = replace(self.now, hooks=(hook(deflection),), torn=torn)

    def snapshot(self) -> Snapshot:
        return self.now

    def stop(self) -> None:
        self.stopped = True


def messages(state: PageState) -> list[str]:
    """What the page was told, newest last; all of it leaves by itself."""
    calls = cast(MagicMock, state.client).add_notification.call_args_list
    assert all(call.kwargs["auto_close_seconds"] > 0.0 for call in calls)
    return [call.args[1] for call in calls]


def pulling() -> PageState:
    return PageState(MagicMock(), pull_session(phantom(), vertices=300), cast(Workers, None))


@pytest.fixture
def led() -> tuple[HapticHand, Servo, PageState]:
    servo, page = Servo(), pulling()
    hand = HapticHand(cast(ServoProcess, servo))
    hand.attend(page)
    return hand, servo, page


def go(hand: HapticHand, page: PageState, ticks: int = 30) -> None:
    for _ in range(ticks):
        hand.attend(page)
        page.session.advance()


def test_the_hand_leads_the_session_and_the_run_is_made_again(
    led: tuple[HapticHand, Servo, PageState],
) -> None:
    hand, servo, page = led
    assert page.device == "a spoon"
    assert servo.rendered == [setting_of(page.session)]
    servo.pull(0.2)
    go(hand, page)
    assert not page.session.run.started  # a touch begins no run
    for step in range(1, 41):
        servo.pull(0.2 * step)
        go(hand, page, 1)
    go(hand, page)
    reading = page.session.reading()
    assert reading.by_hand
    assert reading.deflection == pytest.approx(8.0, abs=1e-3)
    servo.pull(0.0)
    go(hand, page, 60)
    assert not page.session.reading().held
    page.session.finish()
    file = page.session.run_file()
    assert Replay(file.log, phantom(), vertices=300).run_file().metrics == file.metrics


def test_a_tear_to_the_hand_is_one_in_the_session_and_a_new_duct_is_felt_anew(
    led: tuple[HapticHand, Servo, PageState],
) -> None:
    hand, servo, page = led
    servo.pull(6.0)
    go(hand, page)
    servo.pull(30.0, torn=True)
    go(hand, page, 60)
    reading = page.session.reading()
    assert reading.phase is not Phase.INTACT
    assert reading.breaks_at is not None
    assert reading.breaks_at.force == pytest.approx(3.5586, rel=1e-3)
    assert len(servo.rendered) == 1
    page.session.reset()
    go(hand, page, 2)
    assert len(servo.rendered) == 2
    assert page.session.reading().phase is Phase.INTACT


def test_what_the_session_solves_is_what_is_felt(led: tuple[HapticHand, Servo, PageState]) -> None:
    hand, servo, page = led
    old = servo.now
    page.session.choose_theory(Exact())
    page.session.set_grasp(18.0)
    page.session.advance()
    go(hand, page, 1)
    newest = servo.rendered[-1]
    assert isinstance(newest, DuctSetting)
    assert (newest.theory, newest.grasp) == (Exact(), 18.0)
    servo.now = replace(old, hooks=(hook(9.0),))  # of the duct that was felt before
    go(hand, page)
    assert not page.session.run.started
    page.set_paused(True)
    go(hand, page, 1)
    assert servo.rendered[-1] is None  # no force while time stands still
    page.set_paused(False)
    servo.not_rendered = "theory string cannot be felt"
    page.session.choose_theory(TautString())
    go(hand, page, 3)
    assert messages(page).count("The device has no force: theory string cannot be felt.") == 1


def test_a_device_that_ends_gives_the_hook_back(led: tuple[HapticHand, Servo, PageState]) -> None:
    hand, servo, page = led
    servo.pull(5.0)
    go(hand, page)
    servo.ended = "the service has gone"
    go(hand, page, 3)
    assert page.device is None
    assert messages(page)[-1] == "The service has gone. The mouse has the hook again."
    other = pulling()
    hand.attend(other)
    assert other.device is None
    hand.stop()
    assert servo.stopped


class Mailbox(deque[Any]):
    """A pipe with room for all."""

    send, recv = deque[Any].append, deque[Any].popleft

    def poll(self) -> bool:
        return len(self) > 0


class StepwiseServo(ServoLink):
    """A servo without a process or a clock: `run` steps it by a tick of the trainer."""

    device, ended = "a virtual device", None

    def __init__(self, *scripts: HandScript) -> None:
        settings = LoopSettings(hold=False)
        self.devices = [VirtualDevice(DeviceOptions("", settings.period, each)) for each in scripts]
        pipe = cast(Any, Mailbox())
        row = np.zeros(HEAD + ROW * len(scripts))
        super().__init__(row, pipe)
        setting = setting_of(pull_session(phantom(), vertices=300))
        model = setting.model(1.0, settings.period, len(scripts))
        self.loop = ServoLoop(model, settings, self.devices[0].limits, len(scripts))
        self.end = ServoEnd(row, pipe, self.devices)
        self.states = [DeviceState() for _ in scripts]
        self.largest_change = 0.0

    def run(self) -> None:
        for _ in range(round(TICK_SECONDS / self.loop.settings.period)):
            before = self.loop.given.copy()
            for hand, device in enumerate(self.devices):
                device.exchange(self.loop.given[hand], self.states[hand])
            units = np.array([np.rint(state.position / PLACE_UNIT) for state in self.states])
            assert self.end.stopped() is None
            bits = [state.buttons | FRESH | LIVE for state in self.states]
            self.loop.step(units.astype(np.int64), bits)
            change = np.linalg.norm(self.loop.given - before, axis=1).max()
            self.largest_change = max(self.largest_change, float(change))
            self.end.watch(self.loop)

    def stop(self) -> None: ...


def dissecting(*scripts: HandScript) -> tuple[HapticHand, StepwiseServo, PageState]:
    servo = StepwiseServo(*scripts)
    state = PageState(MagicMock(), bed_session(phantom(), vertices=300), cast(Workers, None))
    return HapticHand(cast(ServoProcess, servo)), servo, state


def test_through_a_scope_right_is_right_in_the_picture_and_the_nearest_tube_is_taken() -> None:
    servo = StepwiseServo(
        script(
            (0.1, (0.0, 0.0, 0.0), ""), (0.5, (5.0, 0.0, 0.0), ""), (0.7, (5.0, 0.0, 0.0), ""),
            (0.8, (5.0, 0.0, 0.0), "a"), (1.4, (5.0, -3.0, 0.0), "a"),
        )
    )  # fmt: skip
    specimen = Specimen.of_anatomy(anatomy_named("normal"))
    session = Session(specimen, vertices=300)
    state = PageState(MagicMock(), session, cast(Workers, None))
    hand = HapticHand(cast(ServoProcess, servo))
    held = HeldScope(anatomy_network(anatomy_named("normal")))
    held.move(pan=0.1, tilt=-0.1, cable=0.3)
    right, up, back = held.camera.axes.T
    tissue = session.spatial
    session.choose_instrument(0, "hook")  # as the device has it
    session.look_from(held.view)
    # Left of the cystic duct, so that it comes to lie at it.
    at = tissue.beam.places_at(np.array([12.0]), "cystic")[0]
    session.move_hand(0, at - 5.0 * right)
    for _ in range(60):
        session.advance()
    start = np.array(tissue.hands[0].target)
    dissect(hand, servo, state, 0.65)
    assert tissue.hands[0].target - start == pytest.approx(5.0 * right, abs=0.3)
    dissect(hand, servo, state, 0.85)
    (led,) = servo.snapshot().hooks
    assert tissue.tubes.names[led.tube] == tissue.tubes.names[tissue.hands[0].tube] == "cystic"
    assert led.station is not None
    assert session.reading().holding == (True, False)
    # Drawn towards the scope, the duct draws back: away from it, which is forward for the device.
    given = servo.loop.given[0]
    assert given[1] > 0.05
    assert given == pytest.approx(-np.stack([right, -back, up]) @ led.force, abs=0.05)


def dissect(hand: HapticHand, servo: StepwiseServo, state: PageState, seconds: float) -> None:
    for _ in range(round(seconds / TICK_SECONDS)):
        hand.attend(state)
        state.session.advance()
        servo.run()


def script(*path: tuple[float, tuple[float, float, float], str]) -> HandScript:
    points = tuple(Waypoint(at, to, cast(Any, tuple(buttons))) for at, to, buttons in path)
    return HandScript(path=points, hand=SimulatedHand(stiffness_N_per_m=900.0, tremor_mm=0.05))


LIFT = script(
    (0.1, (0.0, 0.0, 0.0), ""),
    (0.3, (0.0, 0.0, 0.0), "a"),
    (2.3, (0.0, 0.0, 12.0), "a"),
    (2.8, (0.0, 0.0, 12.0), ""),
    (3.6, (0.0, 0.0, 0.0), ""),
)


def test_a_device_frees_a_duct_from_its_bed_and_the_run_is_made_again() -> None:
    hand, servo, state = dissecting(LIFT)
    session = state.session
    dissect(hand, servo, state, 0.25)
    assert state.device == "a virtual device"
    assert state.hand == 1  # the mouse has the other hand
    assert not session.run.started
    dissect(hand, servo, state, 2.25)
    reading, (chosen_settings,) = session.reading(), servo.snapshot().hooks
    assert reading.holding == (True, False)
    assert reading.broken > 100
    # What is felt is what is shown, which follows two ticks later.
    assert servo.loop.model.torn is False
    model = cast(Any, servo.loop.model)
    assert model.parted == pytest.approx(reading.broken, rel=0.02)
    assert np.linalg.norm(chosen_settings.force) == pytest.approx(
        np.linalg.norm(reading.forces[0]), rel=0.05
    )
    assert np.linalg.norm(chosen_settings.tip - session.spatial.hands[0].place) < 0.1
    assert servo.largest_change < 0.05  # N in a millisecond
    dissect(hand, servo, state, 1.5)
    assert session.reading().holding == (False, False)
    assert not servo.loop.given.any()
    # Let go: what is felt next begins with what the session has, to the strand.
    assert cast(Any, servo.loop.model).parted == session.reading().broken
    session.finish()
    file = session.run_file()
    again = Replay(file.log, phantom(), vertices=300)
    assert again.run_file().metrics == file.metrics


def test_the_mouse_helps_with_the_other_hand_and_the_device_feels_it() -> None:
    still = script((0.1, (0.0, 0.0, 0.0), ""), (0.3, (0.0, 0.0, 0.0), "a"))
    hand, servo, state = dissecting(still)
    session = state.session
    dissect(hand, servo, state, 0.5)
    assert session.reading().holding == (True, False)
    # The left hand is the device's, whatever mouse and keys ask for.
    for asked in (
        lambda: state.choose_instrument(0, "swab"),
        lambda: state.let_go(0),
    ):
        asked()
        assert session.reading().holding == (True, False)
    assert messages(state)[-2:] == [
        "The hand on the device has this hook (a virtual device).",
        "Release the button of the device.",
    ]
    # A grasper 12 mm aside lifts the duct: the hand that stays is drawn up.
    place = session.grab(1, 37.0)
    assert place is not None
    for _ in range(8):
        state.nudge(np.array([0.0, 0.0, 0.5]))
        dissect(hand, servo, state, 0.1)
    dissect(hand, servo, state, 0.3)
    reading, (chosen_settings,) = session.reading(), servo.snapshot().hooks
    assert reading.holding == (True, True)
    assert reading.forces[0][2] < -0.05  # it holds the duct down
    assert chosen_settings.force == pytest.approx(
        reading.forces[0], abs=0.1 * abs(reading.forces[0][2])
    )
    assert cast(Any, servo.loop.model).parted == pytest.approx(reading.broken, rel=0.05)
    assert servo.largest_change < 0.05
    # A dissector parts strands in what is felt as in what is shown.
    parted = reading.broken
    state.choose_instrument(1, "dissector")
    session.move_hand(1, np.array([12.0, 0.0, session.spatial.parking(1, "dissector")[2]]))
    dissect(hand, servo, state, 0.8)
    state.open_jaws(12.0)
    dissect(hand, servo, state, 1.0)
    assert session.reading().broken > parted + 30
    assert cast(Any, servo.loop.model).parted == pytest.approx(session.reading().broken, rel=0.05)


def test_two_devices_have_both_hands_and_keys_take_the_duct_where_there_is_no_button() -> None:
    left = script(
        (0.4, (-8.0, 0.0, 0.0), ""), (1.0, (-8.0, 0.0, 0.0), ""), (2.0, (-8.0, 0.0, 5.0), "")
    )
    right = script(
        (0.4, (12.0, 0.0, 0.0), "a"), (1.0, (12.0, 0.0, 0.0), "a"), (2.0, (12.0, 0.0, 5.0), "a")
    )
    hand, servo, state = dissecting(left, right)
    session = state.session
    dissect(hand, servo, state, 0.8)
    assert session.reading().holding == (False, True)
    state.choose_hand(0)
    state.take_or_let_go()
    dissect(hand, servo, state, 1.4)
    reading = session.reading()
    assert reading.holding == (True, True)
    assert min(z for _, _, z in reading.forces) > 0.1
    for chosen_settings, shown in zip(servo.snapshot().hooks, reading.forces, strict=True):
        assert chosen_settings.force == pytest.approx(
            shown, abs=0.05 * float(np.linalg.norm(shown))
        )
    state.take_or_let_go()
    dissect(hand, servo, state, 0.2)
    assert session.reading().holding == (False, True)


def test_a_device_tears_a_duct_in_its_bed_and_has_no_force_until_there_is_a_new_one() -> None:
    hand, servo, state = dissecting(
        script(
            (0.1, (0.0, 0.0, 0.0), ""), (0.2, (0.0, 0.0, 0.0), "a"), (1.2, (0.0, 0.0, 45.0), "a")
        )
    )
    session = state.session
    state.choose_bed(bed_named("inflamed"), 1)
    dissect(hand, servo, state, 1.5)
    assert session.reading().torn_at is not None
    assert not servo.loop.given.any()
    assert servo.largest_change <= 0.2 + 1e-9  # N in a millisecond: the device's bound
    state.reset()
    dissect(hand, servo, state, 0.2)
    assert session.reading().torn_at is None
    assert servo.snapshot().torn is False
    # P and F take the force away, and the hook off.
    for switch in (lambda: state.set_paused(not state.paused), state.switch_force):
        for off in (True, False):
            switch()
            dissect(hand, servo, state, 0.1)
            assert servo.loop.ended is off
            assert session.reading().holding[0] is not off


def test_a_duct_that_tears_to_the_hand_alone_is_felt_again_as_the_page_has_it() -> None:
    hand, servo, state = dissecting(LIFT)
    dissect(hand, servo, state, 0.5)
    torn = cast(Any, servo.loop.model)
    torn.threshold = 1e-3
    dissect(hand, servo, state, 0.3)
    assert torn.torn
    dissect(hand, servo, state, 0.6)
    assert servo.loop.model is not torn
    assert not servo.loop.model.torn
    assert state.session.reading().torn_at is None


def until(true: Callable[[], Any], seconds: float = LONGEST) -> None:
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end, "it did not come"
        time.sleep(0.02)


def test_a_servo_in_its_own_process_feels_what_it_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("OPEN_SECONDS", "STOP_SECONDS"):  # it may compile, and the machine be busy
        monkeypatch.setattr(servo_process, name, LONGEST)
    session = pull_session(phantom(), vertices=300)
    path = (Waypoint(0.3, (0.0, 0.0, 0.0)), Waypoint(1.3, (0.0, 0.0, 9.0)))
    script = HandScript(path=path, hand=SimulatedHand(stiffness_N_per_m=900.0))
    setting = setting_of(session)
    servo = ServoProcess([("virtual", DeviceOptions("", 0.001, script))], LoopSettings(), setting)
    try:
        assert servo.device == "virtual device"
        until(lambda: servo.snapshot().hooks[0].tip[2] > 6.4)  # it comes to rest at 6.56
        (hook,) = servo.snapshot().hooks
        pulled = setting.theory.pull(setting.beam, setting.grasp).to_deflection(hook.tip[2])
        assert hook.force[2] == pytest.approx(pulled.force, rel=1e-6)
        assert hook.peak >= hook.tip[2]
        # Felt anew, the duct is at rest where the hand is now.
        generation = servo.render(replace(setting, theory=Exact()))
        until(lambda: servo.snapshot().generation == generation)
        assert servo.snapshot().hooks[0].tip[2] < 2.7  # what the hand, freed of it, goes on
        # And a duct in its bed, whose hook is free until a button takes it.
        bed = bed_session(phantom(), vertices=300)
        beam, touch = bed.beam_touched_by(1)
        tips = np.array([bed.spatial.hands[0].place])
        generation = servo.render(BedSetting(beam, tips, bed.spatial.threshold, touch))
        until(lambda: servo.snapshot().generation == generation)
        assert servo.snapshot().hooks[0].station is None
        servo.lead(touch, [True])
        until(lambda: servo.snapshot().hooks[0].station == pytest.approx(tips[0, 0], abs=2.0))
        servo.render(replace(setting, theory=TautString()))
        until(lambda: servo.ended or servo.not_rendered)
        assert servo.not_rendered is not None
        assert "cannot be felt" in servo.not_rendered
        assert servo.ended is None
    finally:
        servo.stop()
    assert servo.report is not None
    assert servo.report.ended_by == servo.ended == "the trainer has ended"
    assert servo.report.periods > 500
    assert servo.report.step_us.median > 0.0


def test_a_device_that_cannot_be_opened_is_said_in_the_trainers_words() -> None:
    setting = setting_of(pull_session(phantom(), vertices=300))
    with pytest.raises(DeviceError, match="unknown device 'spoon'"):
        ServoProcess([("spoon", DeviceOptions("", 0.001))], LoopSettings(), setting)
