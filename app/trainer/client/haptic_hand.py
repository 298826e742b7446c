"""Haptic devices in the trainer: they hold the hooks of the first page, which says so.

Through a scope a device leads along the picture: right is right in it, forward is into it.

The servo computes the force at its own rate, in a process of its own. At each tick of the trainer's
clock the session's hand is moved to where the device's hook is, as a mouse would move it, so that
exercises, measures, tear and replay work the same. The servo is given the session's duct again
whenever it becomes another one; in a bed also when the device has let go, so that what is felt is
what is shown, to the strand. Each such setting has a generation number, and what the servo reports
of an older one is ignored. In a bed the servo is also told, at each tick, what the hand of mouse
and keys does to the duct.
"""

import pickle

import numpy as np
from numpy.typing import NDArray

from app.anatomy import anatomy_network
from app.haptics.servo_process import BedSetting, DuctSetting, HapticSetting, ServoProcess, Snapshot
from app.simulation import HANDS, Phase, Session
from app.trainer.client.page_state import PageState
from app.trainer.scope.held_scope import HeldScope

# Deflections, mm, at which the hand takes the duct and below which it leaves it again. They are
# apart so that a hand resting at the duct does not grab and release it at every tick.
TAKEN, LEFT = 0.3, 0.05
# Ticks that a session has to tear after its duct has torn to the hand.
TORN_TICKS = 15
# mm that a free hook has moved before the picture follows: a hand's tremor is less.
TOUCHED = 0.01


def setting_of(session: Session) -> DuctSetting:
    """Return the setting that the servo needs for a session's duct."""
    return DuctSetting(
        session.planar.theory,
        session.tissue.dissection.beam,
        session.planar.grasp,
        session.tissue.threshold,
    )


class HapticHand:
    """Leads the session of one page by a servo's devices. Called by the trainer's clock only."""

    def __init__(self, servo: ServoProcess) -> None:
        self._servo = servo
        self._hands = min(servo.hands, HANDS)
        self._state: PageState | None = None
        self._rendered: object = None  # what the last setting followed from; None for none
        self._generation = 0
        self._holds = [False] * self._hands
        self._torn, self._torn_ticks = False, 0
        self._refused: str | None = None
        self._led: bytes | None = None  # what was said last of the other hand
        self._scope: HeldScope | None = None  # through which an anatomy is seen

    def attend(self, state: PageState | None) -> None:
        """Advance by one tick, for the page that has the device, or for none."""
        servo = self._servo
        if state is not self._state:
            self._leave()
            self._state = state
            if state is not None and servo.ended is None:
                state.give_hook(servo.device, self._hands)
        if state is None:
            self._render(None, None)
            return
        if (why := servo.ended) is not None:
            if state.device is not None:
                self._let_go(state)
                state.take_hook_back(f"{why[0].upper()}{why[1:]}. The mouse has the hook again.")
            return
        if state.in_plane:
            self._lead_in_plane(state)
        else:
            self._lead_in_space(state)
        if servo.not_rendered not in (None, self._refused):
            state.refuse(f"The device has no force: {servo.not_rendered}.")
        self._refused = servo.not_rendered

    def stop(self) -> None:
        """Release the duct and end the servo: the device's force is zero from then on."""
        self._leave()
        self._servo.stop()

    def _render(self, source: object, setting: HapticSetting | None) -> None:
        # One duct at a time: the pipe has no room for two, and the clock is not to wait.
        taken = setting is None or self._servo.snapshot().generation == self._generation
        if source != self._rendered and taken:
            self._rendered = source
            self._generation = self._servo.render(setting)

    def _end_force(self) -> None:
        """Feel nothing; the force of what has torn in the servo as well goes off softly there."""
        if not self._servo.snapshot().torn:
            self._render(None, None)

    def _snapshot(self) -> Snapshot | None:
        """Return the state of what is felt, if it is the last setting."""
        snapshot = self._servo.snapshot()
        fresh = snapshot.generation == self._generation and self._rendered is not None
        return snapshot if fresh else None

    # In the plane of the pull

    def _lead_in_plane(self, state: PageState) -> None:
        session, whole = state.session, state.session.reading().phase is Phase.INTACT
        if not whole:
            self._holds[0], self._torn = False, True
            self._end_force()
            return
        if self._torn:  # a new duct, which may be equal to the old one
            self._torn, self._rendered = False, "torn"
        ended = session.run.closed and state.end_is_news  # the next pull may begin anew
        watching = state.playback is not None or state.paused or state.force_off or ended
        if watching:
            self._let_go(state)
        setting = None if watching else setting_of(session)
        self._render(
            setting
            and (session.tissue.dissection, setting.theory, setting.grasp, setting.threshold),
            setting,
        )
        snapshot = self._snapshot()
        if snapshot is None:
            return
        peak, torn = snapshot.hooks[0].peak, snapshot.torn
        if not self._holds[0] and (torn or peak > TAKEN):
            self._holds[0] = state.grab_by_device()
        if not self._holds[0]:
            return
        # Torn already in the servo: move on until the session tears too, at the same stress.
        session.lift(session.planar.deflection_limit if torn else peak)
        if peak <= LEFT and not torn:
            self._holds[0] = False
            state.release()

    # In space

    def _lead_in_space(self, state: PageState) -> None:
        session = state.session
        duct, run = session.spatial, session.run
        watching = state.playback is not None or state.paused or state.force_off or run.closed
        if watching or duct.torn is not None:
            if self._rendered is not None and duct.torn is None:
                self._let_go(state)
            self._end_force()
            self._holds = [False] * self._hands
            return
        if self._rendered != (duct, run):
            self._let_go(state)
            self._render((duct, run), self._in_space(session))
        self._lead_other(state)
        snapshot = self._snapshot()
        if snapshot is None:
            return
        # Torn already in the servo: the session's hook goes on with the hand, and tears it too.
        self._torn_ticks = self._torn_ticks + 1 if snapshot.torn else 0
        if self._torn_ticks > TORN_TICKS:  # or not: then the page is right
            self._let_go(state)
            self._rendered, self._torn_ticks = "let go", 0
            return
        for hand, hook in enumerate(snapshot.hooks[: self._hands]):
            held = self._holds[hand]
            if hook.station is not None and not held:
                scale = duct.tubes.surfaces[hook.tube].scale
                held = session.grab(hand, hook.station / scale, hook.tube) is not None
            elif hook.station is None and held and not snapshot.torn:
                session.release(hand)
                held = False
                if not any(self._holds[:hand] + self._holds[hand + 1 :]):
                    self._rendered = "let go"  # the next tick begins with what the session has
            self._holds[hand] = held
            target = session.spatial.hands[hand].target
            if held or np.abs(hook.tip - target).max() > TOUCHED:
                session.move_hand(hand, hook.tip)

    def _in_space(self, session: Session) -> BedSetting:
        beam, touch = session.beam_touched_by(HANDS - 1)
        tips = np.array([hand.target for hand in session.spatial.hands[: self._hands]])
        other = None if self._hands == HANDS else touch
        self._led = self._scope = None
        threshold, anatomy = session.tissue.threshold, session.specimen.anatomy
        if anatomy is None:
            speed = session.tissue.dissection.preset.tear_mm_per_s
            return BedSetting(beam, tips, threshold, other, tear_mm_per_s=speed)
        self._scope = HeldScope(anatomy_network(anatomy))
        tubes = session.spatial.tubes
        strengths = dict(zip(tubes.names, tubes.strengths, strict=True))
        speeds = tubes.tear_speeds
        return BedSetting(beam, tips, threshold, other, tear_mm_per_s=speeds, strengths=strengths)

    def _axes(self, session: Session) -> NDArray[np.float64]:
        """Return right, forward and up of the devices among the duct's axes, (3, 3) columns."""
        scope = self._scope
        if scope is None or not scope.show(session.spatial.pose):
            return np.eye(3)
        right, up, back = scope.camera.axes.T
        return np.stack([right, -back, up], axis=1)

    def _lead_other(self, state: PageState) -> None:
        """Tell the servo what the other hand does, what the keys hold, and how the scope looks."""
        other = None if self._hands == HANDS else state.session.touch(HANDS - 1)
        axes = self._axes(state.session)
        message = pickle.dumps((other, state.device_holds, axes))
        if message != self._led:
            self._led = message
            self._servo.lead(other, state.device_holds[: self._hands], axes)

    def _let_go(self, state: PageState) -> None:
        """Release what the devices hold in the session."""
        for hand, holds in enumerate(self._holds):
            if holds:
                state.session.release(hand)
                state.pulls += 1
        self._holds = [False] * self._hands

    def _leave(self) -> None:
        if self._state is not None:
            self._let_go(self._state)
            self._state.take_hook_back(None)
        self._state, self._torn = None, False
