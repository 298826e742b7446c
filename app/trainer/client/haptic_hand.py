"""A haptic device in the trainer: it holds the hook of the first page, which says so.

The servo computes the force at its own rate, in a process of its own. At each tick of the trainer's
clock the session's hand is moved to where the device's hook has been pulled, as a mouse would move
it, so that exercises, measures, tear and replay work the same. The servo is given the session's
beam, theory, grasp and threshold again whenever one of them changes. Each such setting has a
generation number, and what the servo reports of an older one is ignored.
"""

from app.haptics.servo_process import FeltSetting, ServoProcess
from app.simulation import Phase, Session
from app.trainer.client.pull_state import PullState

__all__ = ["HapticHand", "felt_in"]

TAKEN, LEFT = 0.3, 0.05
"""Deflections, mm, at which the hand takes the duct and below which it leaves it again. They are
apart so that a hand resting at the duct does not grab and release it at every tick."""


def felt_in(session: Session) -> FeltSetting:
    """Return the setting that the servo needs for a session's duct."""
    return FeltSetting(
        session.duct.theory,
        session.duct.dissection.beam,
        session.duct.grasp,
        session.duct.threshold,
    )


class HapticHand:
    """Leads the session of one page by a servo's device. Called by the trainer's clock only."""

    def __init__(self, servo: ServoProcess) -> None:
        self._servo = servo
        self._state: PullState | None = None
        self._setting: FeltSetting | None = None
        self._generation = 0
        self._holds = self._torn = False
        self._told: str | None = None

    def attend(self, state: PullState | None) -> None:
        """Advance by one tick, for the page that has the device, or for none."""
        servo = self._servo
        if state is not self._state:
            self._leave()
            self._state = state
            if state is not None and servo.ended is None:
                state.give_hook(servo.device)
        if state is None:
            self._feel(None)
            return
        if (why := servo.ended) is not None:
            if state.device is not None:
                state.take_hook_back(f"{why[0].upper()}{why[1:]}. The mouse has the hook again.")
                self._holds = False
            return
        session, whole = state.session, state.session.reading().phase is Phase.INTACT
        if not whole:
            self._holds, self._torn = False, True
            return
        renewed, self._torn = self._torn, False
        watching = state.playback is not None or state.paused
        self._feel(None if watching else felt_in(session), again=renewed)
        if servo.unfelt not in (None, self._told):
            state.refuse(f"The device has no force: {servo.unfelt}.")
        self._told = servo.unfelt
        self._lead(state)

    def stop(self) -> None:
        """Release the duct and end the servo: the device's force is zero from then on."""
        self._leave()
        self._servo.stop()

    def _feel(self, setting: FeltSetting | None, *, again: bool = False) -> None:
        if again or not _same(setting, self._setting):
            self._setting = setting
            self._generation = self._servo.feel(setting)

    def _lead(self, state: PullState) -> None:
        hook = self._servo.snapshot()
        if hook.generation != self._generation or self._setting is None:
            return
        session = state.session
        if not self._holds and (hook.torn or hook.peak > TAKEN):
            self._holds = state.grab_by_device()
        if not self._holds:
            return
        # Torn already in the servo: move on until the session tears too, at the same stress.
        session.move_hand(session.duct.deflection_limit if hook.torn else hook.peak)
        if hook.peak <= LEFT and not hook.torn:
            self._holds = False
            state.release()

    def _leave(self) -> None:
        if self._state is not None:
            if self._holds:
                self._state.release()
            self._state.take_hook_back(None)
        self._state, self._holds, self._torn = None, False, False


def _same(one: FeltSetting | None, other: FeltSetting | None) -> bool:
    if one is None or other is None:
        return one is other
    return one.beam is other.beam and (one.theory, one.grasp, one.threshold) == (
        other.theory, other.grasp, other.threshold,
    )  # fmt: skip
