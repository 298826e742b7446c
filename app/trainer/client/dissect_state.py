"""Dissect: a page that shows a duct in its bed, the two hands at it, and its choices."""

from collections import deque

import numpy as np
import viser
from numpy.typing import NDArray

from app.simulation import (
    HANDS,
    HOLDING,
    VERTICES,
    BedPreset,
    Exercise,
    Feedback,
    Instrument,
    Preset,
    Replay,
    RunFile,
    Session,
    Vector,
    read_run,
)
from app.trainer.client.client_state import FORCE_KEY, ClientState, Workers
from app.trainer.scene.bed_scene import Colours
from app.trainer.scene.drag_proxy import Hold

__all__ = ["COLOURS", "NUDGE", "DissectState"]

COLOURS: tuple[Colours, ...] = ("tissue", "stress", "freed")
NUDGE = 0.5
"""mm that a key moves the tip, or opens the jaws by."""
MOST_TRIES = 20
"""Judged runs kept, to stand beside later ones."""
NOWHERE = "No hand can hold the duct at a clamp, or where the other hand holds it."
TAKES = "button a takes the duct below the hook and lets go of it, as the keys X and G do"
TORN = "A torn duct holds no pull. Press Reset (R) for a new one."


class DissectState(ClientState):
    """What the parts of a page share while it shows a duct in its bed.

    `hand` is the number of the active hand, which the mouse on the duct and the keys lead;
    `colours` the client's choice of what colours the duct; `into_picture` whether drags go there.
    """

    first_input = "touch"
    counted = "both hands, by mouse, touch or keys."

    def __init__(self, client: viser.ClientHandle, session: Session, workers: Workers) -> None:
        super().__init__(client, session, workers)
        self.hand = 0
        self.colours: Colours = "tissue"
        self.into_picture = False
        self._dragged: int | None = None  # the hand that the mouse leads
        self._led_from = np.zeros(3)  # where its tip was when the drag began, mm
        self._tries = deque[RunFile](maxlen=MOST_TRIES)
        self.device_hands = 0  # how many of the first hands are devices'
        self.device_holds = [False] * HANDS  # which of those hold by a key, whatever their buttons
        self.keep_run()

    @property
    def instrument(self) -> Instrument:
        """What the active hand has."""
        return self.session.spatial.hands[self.hand].instrument

    def show(
        self,
        *,
        colours: Colours | None = None,
        into_picture: bool | None = None,
        plain: bool | None = None,
    ) -> None:
        """Choose what is shown; None leaves a choice as it is."""
        self.colours = self.colours if colours is None else colours
        self.into_picture = self.into_picture if into_picture is None else into_picture
        super().show(plain=plain)

    def show_next(self) -> None:
        """Show the next colours."""
        self.show(colours=COLOURS[(COLOURS.index(self.colours) + 1) % len(COLOURS)])

    # Runs

    def keep_run(self) -> None:
        """Keep the run so far as the last one, and among the tries if it was judged."""
        super().keep_run()
        run = self.last_run
        if run is not None and run.outcome is not None and run not in self._tries:
            self._tries.append(run)

    def earlier_tries(self, run: RunFile) -> list[RunFile]:
        """Return the earlier judged runs of the same exercise and start, oldest first."""
        task = run.log.exercise, run.log.start
        tries = [each for each in self._tries if (each.log.exercise, each.log.start) == task]
        return [each for each in tries if each != run]

    def read_run(self, content: bytes) -> RunFile:
        """Return the run in a file; a `ValueError` if it is not one of this mode."""
        run = read_run(content)
        if not run.log.start.in_bed:
            raise ValueError("This run is a pull. Choose Pull at the top, then open it.")
        return run

    def replay_of(self, run: RunFile, *, vertices: int = VERTICES) -> Replay:
        """Return a replay of a run, whose skin has about so many vertices."""
        return Replay(run.log, self.session.tissue.dissection.organ, vertices=vertices)

    def offers_follow_from(self) -> object:
        """Return what the exercises offered depend on."""
        duct = self.session.spatial
        return duct.specimen, duct.threshold

    def start_exercise(self, exercise: Exercise, feedback: Feedback) -> None:
        """Start anew with an exercise, in its bed."""
        self.leave_replay()
        self._renew(lambda: self.session.start_exercise(exercise, feedback))

    # Devices

    def give_hook(self, device: str, hands: int = 1) -> None:
        """Give the first hands' hooks to devices and say so; mouse and keys have the other."""
        super().give_hook(device, hands)
        self.device_hands = hands
        for hand in range(hands):
            self.session.release(hand)
            if self.session.spatial.hands[hand].instrument != "hook":
                self.session.choose_instrument(hand, "hook")
        self.choose_hand(min(hands, HANDS - 1))

    def take_hook_back(self, why: str | None) -> None:
        """Give the hooks back to mouse and keys."""
        self.device_hands = 0
        self.device_holds[:] = [False] * HANDS
        super().take_hook_back(why)

    def _device_words(self, device: str, hands: int) -> tuple[str, str]:
        if hands > 1:
            return "The devices hold both hooks", f"{device}: {TAKES}. {FORCE_KEY}"
        return (
            "The device holds the left hand's hook",
            f"{device}: {TAKES}. The mouse and the keys have the right hand. {FORCE_KEY}",
        )

    def _refuses(self, hand: int) -> bool:
        """Return whether a device has the hand; then tell the client so."""
        if hand < self.device_hands:
            self.refuse(f"The hand on the device has this hook ({self.device}).")
        return hand < self.device_hands

    # Choices

    def choose_hand(self, hand: int) -> None:
        """Let the mouse and the keys lead this hand."""
        self.hand = hand
        self._changed = True

    def choose_instrument(self, hand: int, instrument: Instrument) -> None:
        """Make a hand the active one, with this instrument; one that it has it keeps as it is."""
        if self.playback is not None or self._refuses(hand):
            return
        offered = self.session.instruments
        if instrument not in offered:
            self.refuse(f"This exercise is done with: {', '.join(offered)}.")
            return
        self.choose_hand(hand)
        if self.instrument != instrument:
            self.session.choose_instrument(hand, instrument)

    def next_instrument(self) -> None:
        """Give the active hand the next instrument."""
        offered = self.session.instruments
        now = offered.index(self.instrument) if self.instrument in offered else -1
        self.choose_instrument(self.hand, offered[(now + 1) % len(offered)])

    def choose_bed(self, bed: BedPreset | None, seed: int) -> None:
        """Start anew in another bed, or free."""
        self._renew(lambda: self.session.choose_bed(bed, seed))

    def choose_preset(self, preset: Preset) -> None:
        """Start anew with another duct."""
        self._renew(lambda: self.session.choose_preset(preset))

    def reset(self) -> None:
        """Make the duct and its bed whole, and bring the view home."""
        self._renew(self.session.reset)
        self.bring_home()

    # The mouse

    def grab(self, hold: Hold) -> None:
        """Take the duct with the active hand, or an instrument where it is."""
        self._dragged = None
        if self.playback is not None:
            return
        if hold.hand is not None:
            self.choose_hand(hold.hand)
        if self._refuses(self.hand):
            return
        holder = self.session.spatial.hands[self.hand]
        self._led_from = holder.place.copy()
        if hold.station is not None and holder.instrument in HOLDING:
            place = self._take(hold.station)
            if place is None:
                return
            self._led_from = np.array(place)
        self._dragged = self.hand
        self.move_hand(hold)

    def move_hand(self, hold: Hold) -> None:
        """Lead the hand that the mouse has."""
        if self._dragged is not None:
            self.session.move_hand(self._dragged, self._led_from + hold.moved)

    def release_hand(self) -> None:
        """Let the mouse go: a hook lets go of the duct, any other instrument stays."""
        hand, self._dragged = self._dragged, None
        if hand is not None and self.session.spatial.hands[hand].instrument == "hook":
            self.session.release(hand)

    # The keys

    def nudge(self, way: NDArray[np.float64]) -> None:
        """Move the active hand's tip, (3,) mm in the duct's frame."""
        if self._dragged is None and not self._refuses(self.hand):
            holder = self.session.spatial.hands[self.hand]
            self.session.move_hand(self.hand, holder.target + way)

    def open_jaws(self, opening: float) -> None:
        """Open or close the active hand's dissector, mm between its jaws."""
        if self.playback is None:
            self.session.open_jaws(self.hand, opening)

    def open_more(self, more: float) -> None:
        """Open the active hand's dissector by some mm more, or less."""
        if self.instrument == "dissector":
            self.open_jaws(self.session.spatial.hands[self.hand].target_opening + more)
        else:
            self.refuse("Only a dissector opens. Press N for the next instrument.")

    def let_go(self, hand: int) -> None:
        """Let a hand go of the duct."""
        if hand < self.device_hands:
            if not self.device_holds[hand]:
                self.refuse("Release the button of the device.")
            self.device_holds[hand] = False
            return
        if self._dragged == hand:
            self._dragged = None
        self.session.release(hand)

    def take_or_let_go(self) -> None:
        """Let the active hand take the duct below its tip, or let go of what it holds."""
        holder = self.session.spatial.hands[self.hand]
        if holder.node is not None:
            self.let_go(self.hand)
        elif self.hand < self.device_hands:
            self.device_holds[self.hand] = True
        elif holder.instrument in HOLDING:
            self._take(float(holder.place[0]))
        else:
            self.refuse("Only a hook and a grasper hold. Press N for the next instrument.")

    def _take(self, station: float) -> Vector | None:
        """Let the active hand take the duct; say why where it cannot."""
        place = self.session.grab(self.hand, station)
        if place is None:
            self.refuse(NOWHERE if self.session.spatial.torn is None else TORN)
        return place
