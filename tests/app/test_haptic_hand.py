"""A hand on a device in the trainer: its servo's process, and the session that it leads."""

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, cast

import pytest
from simulated import phantom

from app.haptics.device import DeviceError, DeviceOptions
from app.haptics.hand import HandScript, SimulatedHand, Waypoint
from app.haptics.servo_loop import LoopSettings
from app.haptics.servo_process import FeltSetting, HookSnapshot, ServoProcess
from app.simulation import Phase, Replay, Session
from app.trainer.client.haptic_hand import HapticHand, felt_in
from app.trainer.client.pull_state import PullState
from physics import Exact, TautString

REST = HookSnapshot(0, 0.0, 0.0, 0.0, False)


@dataclass
class Servo:
    """A servo without a process: where its hook is, is said."""

    device: str = "a spoon"
    ended: str | None = None
    unfelt: str | None = None
    felt: list[FeltSetting | None] = field(default_factory=list[FeltSetting | None])
    hook: HookSnapshot = REST
    stopped: bool = False

    def feel(self, setting: FeltSetting | None) -> int:
        self.felt.append(setting)
        self.hook = HookSnapshot(len(self.felt), 0.0, 0.0, 0.0, False)
        return len(self.felt)

    def pull(self, deflection: float, *, torn: bool = False) -> None:
        self.hook = replace(self.hook, deflection=deflection, peak=deflection, torn=torn)

    def snapshot(self) -> HookSnapshot:
        return self.hook

    def stop(self) -> None:
        self.stopped = True


@dataclass
class Page:
    """What a hand needs of a state, without a client."""

    session: Session
    playback: object | None = None
    paused: bool = False
    device: str | None = None
    said: list[str] = field(default_factory=list[str])

    def give_hook(self, device: str) -> None:
        self.device = device

    def take_hook_back(self, why: str | None) -> None:
        self.device = None
        if why:
            self.said.append(why)

    def refuse(self, reason: str) -> None:
        self.said.append(reason)

    def grab_by_device(self) -> bool:
        return self.session.grab(self.session.duct.grasp) is not None

    def release(self) -> None:
        self.session.release()


@pytest.fixture
def led() -> tuple[HapticHand, Servo, Page]:
    servo, page = Servo(), Page(Session(phantom(), vertices=300))
    hand = HapticHand(cast(ServoProcess, servo))
    hand.attend(cast(PullState, page))
    return hand, servo, page


def go(hand: HapticHand, page: Page, ticks: int = 30) -> None:
    for _ in range(ticks):
        hand.attend(cast(PullState, page))
        page.session.advance()


def test_the_hand_leads_the_session_and_the_run_is_made_again(
    led: tuple[HapticHand, Servo, Page],
) -> None:
    hand, servo, page = led
    assert page.device == "a spoon"
    assert servo.felt == [felt_in(page.session)]
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
    assert Replay(file.log, phantom(), vertices=300).run_file().measures == file.measures


def test_a_tear_to_the_hand_is_one_in_the_session_and_a_new_duct_is_felt_anew(
    led: tuple[HapticHand, Servo, Page],
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
    assert len(servo.felt) == 1
    page.session.reset()
    go(hand, page, 2)
    assert len(servo.felt) == 2
    assert page.session.reading().phase is Phase.INTACT


def test_what_the_session_solves_is_what_is_felt(led: tuple[HapticHand, Servo, Page]) -> None:
    hand, servo, page = led
    old = servo.hook
    page.session.choose_theory(Exact())
    page.session.set_grasp(18.0)
    page.session.advance()
    go(hand, page, 1)
    newest = servo.felt[-1]
    assert newest is not None
    assert (newest.theory, newest.grasp) == (Exact(), 18.0)
    servo.hook = replace(old, peak=9.0)  # of the duct that was felt before
    go(hand, page)
    assert not page.session.run.started
    page.playback = object()
    go(hand, page, 1)
    assert servo.felt[-1] is None  # no force while a replay is seen
    page.playback = None
    servo.unfelt = "theory string cannot be felt"
    page.session.choose_theory(TautString())
    go(hand, page, 3)
    assert page.said == ["The device has no force: theory string cannot be felt."]


def test_a_device_that_ends_gives_the_hook_back(led: tuple[HapticHand, Servo, Page]) -> None:
    hand, servo, page = led
    servo.pull(5.0)
    go(hand, page)
    servo.ended = "the service has gone"
    go(hand, page, 3)
    assert page.device is None
    assert page.said == ["The service has gone. The mouse has the hook again."]
    other = Page(Session(phantom(), vertices=300))
    hand.attend(cast(PullState, other))
    assert other.device is None
    hand.stop()
    assert servo.stopped


def until(true: Callable[[], Any], seconds: float = 60.0) -> None:
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end, "it did not come"
        time.sleep(0.02)


def test_a_servo_in_its_own_process_feels_what_it_is_told() -> None:
    session = Session(phantom(), vertices=300)
    path = (Waypoint(0.3, (0.0, 0.0, 0.0)), Waypoint(1.3, (0.0, 0.0, 9.0)))
    script = HandScript(path=path, hand=SimulatedHand(stiffness_N_per_m=900.0))
    setting = felt_in(session)
    servo = ServoProcess("virtual", DeviceOptions("", 0.001, script), LoopSettings(), setting)
    try:
        assert servo.device == "virtual device"
        until(lambda: servo.snapshot().deflection > 4.0)
        hook = servo.snapshot()
        assert hook.force == pytest.approx(
            session.duct.theory.pull(setting.beam, setting.grasp)
            .to_deflection(hook.deflection)
            .force,
            rel=1e-6,
        )
        assert hook.peak >= hook.deflection
        # Felt anew, the duct is at rest where the hand is now.
        generation = servo.feel(replace(setting, theory=Exact()))
        until(lambda: servo.snapshot().generation == generation)
        assert servo.snapshot().deflection < 1.0
        servo.feel(replace(setting, theory=TautString()))
        until(lambda: servo.ended or servo.unfelt)
        assert servo.unfelt is not None
        assert "cannot be felt" in servo.unfelt
        assert servo.ended is None
    finally:
        servo.stop()


def test_a_device_that_cannot_be_opened_is_said_in_the_trainers_words() -> None:
    setting = felt_in(Session(phantom(), vertices=300))
    with pytest.raises(DeviceError, match="unknown device 'spoon'"):
        ServoProcess("spoon", DeviceOptions("", 0.001), LoopSettings(), setting)
