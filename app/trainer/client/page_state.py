"""What the parts of one client's page share: its session, its choices, and what it replays."""

from collections.abc import Callable, Hashable, Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np
import viser
from numpy.typing import NDArray

from app.anatomy import Anatomy, tube_title
from app.simulation import (
    FEW,
    GRIP_N,
    HANDS,
    HOLDING,
    VERTICES,
    BedPreset,
    Exercise,
    ExerciseInputs,
    Feedback,
    Hand,
    Incident,
    Instrument,
    Phase,
    Preset,
    Replay,
    RunFile,
    Session,
    Spread,
    Vector,
    anatomy_or_name,
)
from app.trainer.client.background_worker import BackgroundWorker
from app.trainer.client.beside import Beside, Role, StartCompanion
from app.trainer.client.picture_series import PictureSeries
from app.trainer.client.replay_playback import LivePlayback, ReplayPlayback
from app.trainer.client.workers import Workers, explained
from app.trainer.scene.drag_proxy import Hold
from app.trainer.scene.tissue_scene import Colours
from organ_geometry import Organ
from physics import Theory

BRIEF_SECONDS, NOTICE_SECONDS = 8.0, 20.0
"""s after which a note leaves by itself, a short one and a long one: on a phone it covers the
picture."""
NUDGE = 0.5
"""mm that a key moves the tip, or opens the jaws by."""
PAST_BREAK = 1.05
"""Target of a ramp to the tear, over the force at break."""
FORCE_KEY = "F takes its force away, and gives it back."
EXERCISE_GOES_ON = "An exercise goes on until it is over. Stop it first."
GIVES_UP = "That ends the try, and makes all whole. Reset once more if you mean it."
EXERCISE_OVER = "The exercise is over. Reset (R) makes all whole, to try again or to go on."
SLIPPED = (
    "The {} slid out of the grasper, which holds {:g} N. Take hold again, and pull more gently."
)
HAND_ONLY = "In this exercise only your hand counts: drag the duct or the hook."
BOTH_HANDS = "both hands, by mouse, touch or keys."
COUNTED: dict[ExerciseInputs, str] = {
    "hand": "your hand only: drag the duct or the hook until its upper edge is in the blue band.",
    "any": "your hand, sliders or keys: your teacher lets them count, and the run says so.",
}
NOWHERE = "No hand can hold the duct at a clamp, or where the other hand holds it."
TORN = "A torn duct holds no pull. Press Reset (R) for a new one."
OTHER_OPENS = "The other hand has one: press X to lead it."
NEXT_OPENS = "Press N for the next instrument."
BY_POLICY = "The policy has this hand until the exercise is over."
TAKES = "button a takes the duct below the hook and lets go of it, as the keys X and G do"


def _named(anatomy: Anatomy | str) -> str:
    name = anatomy if isinstance(anatomy, str) else anatomy.name
    return f"the anatomy {name!r}"


class PageState:
    """What the parts of one client's page share. Its methods may be called by any thread.

    `hand` is the number of the active hand, which the mouse on the duct and the keys lead.
    `colours`, `overlay` (the model's points), `plain` (the simple picture), `into_picture` (whether
    drags go there) and `marks_next` (whether what is to be parted next is marked) are the client's
    choices; `last_run` the last run that ended or was given up, to be judged and replayed,
    `last_errors` its errors, `last_standing` how far it had come; `kept` is called then.
    `exercise_inputs` says which inputs count in exercises, and `policy` starts one beside them.
    """

    def __init__(
        self,
        client: viser.ClientHandle,
        session: Session,
        workers: Workers,
        exercise_inputs: ExerciseInputs = "hand",
        policy: StartCompanion | None = None,
    ) -> None:
        self.beside = Beside(policy, self.refuse)
        self.client, self.session, self.workers = client, session, workers
        self.exercise_inputs: ExerciseInputs = exercise_inputs
        self._panels = 0  # that have been removed
        self.last_run: RunFile | None = None
        self.last_errors: Sequence[Incident] = ()
        self.last_standing = ""
        self.close_result: Callable[[], object] = lambda: None
        # the run whose end the page has shown
        self.announced: object = session.run if session.run.over else None
        # the replay that is shown in place of the session
        self.playback: ReplayPlayback | LivePlayback | None = None
        self._replayed: RunFile | None = None
        self.plain = self.overlay = self.into_picture = False
        self.marks_next = True
        self._colours: Colours = "tissue"
        self.spread: Spread | None = None  # of the ducts of a band beside the distance to break
        self.kept: Callable[[], None] = lambda: None
        self.paused = False  # whether the session's time stands still
        self.marks: tuple[Exercise, dict[str, float]] | None = None
        """Benchmarks of a course by metric, and the exercise that they are of."""
        self.next_try: Callable[[], object] | None = None
        """Starts the next try of a course; None without one."""
        self.series = PictureSeries()
        self.next_picture: Callable[[], object] = lambda: None
        """Shows the next picture of the series, in another anatomy."""
        self.leave_pictures: Callable[..., bool] = lambda *_: False
        """Goes on, with an exercise or without, at the anatomy of before the pictures, if any."""
        self.photographs: list[bytes] = []
        """Of this run, for the record: the last two that were taken, front and back."""
        self.pulls = 0  # number of changes of the pull that no slider has made
        self.hand = 0
        self._dragged: int | None = None  # the hand that the mouse leads
        self._dragged_from = np.zeros(3)  # where its tip was when the drag began, mm
        self._changed = True
        self._home = False
        self._slips = [0] * HANDS  # how often tissue has slipped out of each hand
        self._refusal: viser.NotificationHandle | None = None
        self._given_up: object = None  # the try that was asked about when it was to be given up
        self._other_organ: Callable[[], None] | None = None
        self.device: str | None = None  # the haptic device that holds a hook, or None
        self.device_hands = 0  # how many of the first hands are devices'
        self.device_holds: list[bool] = []  # of those, which hold by a key, whatever their buttons
        self.force_off = False  # whether the device shall have no force
        self._device_notice: viser.NotificationHandle | None = None
        self._force_key: viser.CommandHandle | None = None
        self.keep_run()

    # What is in hand and what is shown

    @property
    def in_plane(self) -> bool:
        """Whether a theory solves the duct in the plane of its pull, where a force can be set."""
        return self.session.specimen.theory is not None

    @property
    def hands(self) -> tuple[Hand, ...]:
        """The session's hands."""
        return self.session.tissue.hands

    @property
    def watching(self) -> bool:
        """Whether the session that is shown is another page's."""
        return self.playback is not None and self.playback.live

    @property
    def shown(self) -> Session:
        """The session that is shown: the client's own, or the replay's."""
        playback = self.playback  # once: another thread may leave it
        return self.session if playback is None else playback.session

    @property
    def figures_visible(self) -> bool:
        """Whether the trainee may see the figures now."""
        return self.playback is not None or self.session.run.feedback_visible

    @property
    def in_exercise(self) -> bool:
        """Whether an exercise waits for its first input or goes on."""
        run = self.session.run
        return run.exercise is not None and not run.over

    @property
    def end_is_news(self) -> bool:
        """Whether a run is over, and the page has not yet shown how."""
        run = self.session.run
        return run.over and run is not self.announced

    @property
    def counted(self) -> str:
        """What counts in exercises, in words."""
        return COUNTED[self.exercise_inputs] if self.in_plane else BOTH_HANDS

    @property
    def colours_offered(self) -> tuple[Colours, ...]:
        """What the duct that is shown can be coloured by."""
        in_bed = self.shown.specimen.bed is not None
        return ("tissue", "stress", "freed") if in_bed else ("tissue", "stress")

    @property
    def colours(self) -> Colours:
        """What the duct is coloured by."""
        return self._colours if self._colours in self.colours_offered else "tissue"

    def show(
        self,
        *,
        colours: Colours | None = None,
        overlay: bool | None = None,
        plain: bool | None = None,
        into_picture: bool | None = None,
        marks_next: bool | None = None,
    ) -> None:
        """Choose what is shown; None leaves a choice as it is."""
        self._colours = self._colours if colours is None else colours
        self.overlay = self.overlay if overlay is None else overlay
        self.plain = self.plain if plain is None else plain
        self.into_picture = self.into_picture if into_picture is None else into_picture
        self.marks_next = self.marks_next if marks_next is None else marks_next
        self._changed = True

    def show_next(self) -> None:
        """Show the next colours."""
        offered = self.colours_offered
        self.show(colours=offered[(offered.index(self.colours) + 1) % len(offered)])

    def show_spread(self, spread: Spread | None) -> None:
        """Choose the ducts of the band of the distance to break, or none."""
        self.spread = spread
        self._changed = True

    def take_change(self) -> bool:
        """Return whether the client's choices have changed since the last call."""
        changed, self._changed = self._changed, False
        return changed

    def bring_home(self) -> None:
        """Ask for the camera to show the whole duct again."""
        self._home = True

    def take_home(self) -> bool:
        """Return whether `bring_home` was called since the last call."""
        wanted, self._home = self._home, False
        return wanted

    # What is said to the client

    def refuse(self, reason: str, title: str = "Not possible") -> None:
        """Tell the client why something is not possible, or was stopped."""
        self.forget_refusal()
        self._refusal = self.client.add_notification(
            title, reason, color="yellow", auto_close_seconds=BRIEF_SECONDS
        )

    def forget_refusal(self) -> None:
        """Take back what was said last of something that was not possible."""
        if self._refusal is not None:
            self._refusal.remove()
            self._refusal = None

    def require_no_exercise(self) -> None:
        """Raise a `ValueError` while an exercise goes on."""
        if self.in_exercise:
            raise ValueError(EXERCISE_GOES_ON)

    def send_file(self, name: str, content: bytes) -> None:
        """Have the browser save a file."""
        self.client.send_file_download(name, content, save_immediately=True)

    def attempt(self, what: str, action: Callable[[], object]) -> bool:
        """Do what the client has asked for; on an error tell it why and return False."""
        try:
            with explained(self.client, what):
                action()
        except ValueError as error:
            self.refuse(str(error))
            return False
        finally:
            self._changed = True
        return True

    def when_free(
        self, worker: BackgroundWorker, kind: Hashable, task: Callable[[], object]
    ) -> None:
        """Have a worker do a task for the panel that is shown now; once removed, it needs none."""
        panels = self._panels

        def do() -> None:
            if panels != self._panels:
                return
            try:
                task()
            except RuntimeError:  # viser changes no widget that was removed meanwhile
                if panels == self._panels:
                    raise

        worker.submit(kind, do)

    def remove_panel(self) -> None:
        """Remove the panel; what workers still do for it is dropped."""
        self.close_result()
        self._panels += 1
        self.client.gui.reset()

    # Runs

    def marks_of(self, exercise: Exercise | None) -> dict[str, float]:
        """Return the benchmarks that a course has for an exercise, by metric."""
        return self.marks[1] if self.marks is not None and self.marks[0] == exercise else {}

    def run_so_far(self) -> RunFile:
        """Return the run in progress; a `ValueError` before its start."""
        return self.session.run_file()

    def keep_run(self) -> None:
        """Keep the run so far as the last one, if there was any input."""
        with suppress(ValueError):  # there was none
            self.last_run, self.last_errors = self.run_so_far(), self.session.run.incidents()
            self.last_standing = self.session.run.standing
            self.kept()

    def run_at_hand(self) -> RunFile | None:
        """Return the run that is replayed, else the one in progress, else the last one."""
        if self.playback is not None:
            return self._replayed
        return self.run_so_far() if self.session.run.started else self.last_run

    def replay_of(self, run: RunFile, *, vertices: int = VERTICES) -> Replay:
        """Return a replay of a run, whose skin has about so many vertices."""
        organ, tore = self.session.tissue.dissection.organ, run.metrics.get("tear") is not None
        return Replay(run.log, organ, vertices=vertices, tore=tore)

    def run_csv(self, run: RunFile) -> bytes:
        """Return a run tick by tick, as comma-separated values."""
        return self.replay_of(run, vertices=FEW).series().csv().encode()

    def start_replay(
        self, run: RunFile, at: float = 0.0, incidents: Sequence[Incident] | None = None
    ) -> None:
        """Replay a run from a time, s, on, in place of the session, which is stopped meanwhile.

        `incidents` are the run's errors, where they are known.

        Raises
        ------
        ValueError
            If the run is of another duct or anatomy.
        """
        anatomy = run.log.start.anatomy
        shown = self.session.specimen.anatomy
        if anatomy != (None if shown is None else anatomy_or_name(shown)):
            raise ValueError(
                "this run is of a duct: choose one at the top"
                if anatomy is None
                else f"this run is at {_named(anatomy)}: choose Calot's triangle, and that anatomy"
            )
        playback = ReplayPlayback(self.replay_of(run), incidents)
        self.release_hand()
        playback.seek(at)
        playback.play()
        self._replayed, self.playback = run, playback
        self._changed = True

    def watch(self, session: Session, find: Callable[[], Session | None]) -> None:
        """Show another page's session in place of this one's, which is stopped meanwhile."""
        self.release_hand()
        self.playback = LivePlayback(session, find)
        self._changed = True

    def leave_replay(self) -> None:
        """Show the session again, unchanged."""
        self.playback = None
        self._changed = True

    def finish(self) -> None:
        """End the run as it stands."""
        self.session.finish()
        self._changed = True

    def set_paused(self, paused: bool) -> None:
        """Stop or continue the session's time; an exercise cannot be paused."""
        if paused and self.in_exercise:
            self.refuse(EXERCISE_GOES_ON)
            return
        self.paused = paused
        self._changed = True

    def reset(self) -> None:
        """Make all whole and bring the view home; the next input starts a run.

        A try that has begun is given up only when it is asked for twice.
        """
        run = self.session.run
        if self.in_exercise and run.started and run is not self._given_up:
            self._given_up = run
            self.refuse(GIVES_UP, "An exercise goes on")
            return
        self.forget_refusal()
        self._renew(self.session.reset)
        self.bring_home()

    def offers_follow_from(self) -> object:
        """Return what the exercises offered depend on."""
        session = self.session
        grasp = session.task_grasp if self.in_plane else None
        return session.specimen, session.tissue.threshold, grasp

    def start_exercise(
        self, exercise: Exercise, feedback: Feedback, grasp: float | None = None
    ) -> None:
        """Start anew with an exercise, at a grasp in a plane or in its bed."""
        self.leave_replay()
        self.hand = min(max(exercise.first_hand, self.device_hands), len(self.hands) - 1)
        session, inputs = self.session, self.exercise_inputs
        self._renew(lambda: session.start_exercise(exercise, feedback, grasp, inputs))
        self.bring_home()  # each try begins with the same view

    def choose_policy(self, role: Role) -> None:
        """Choose what a policy does beside exercises: from the next one on if one goes on."""
        self.beside.role = role
        if role == "none" or not self.session.run.going:
            self.beside.begin(self.session)
        self._changed = True

    def advance(self, ticks: int) -> bool:
        """Advance the session and what acts beside it; return whether anything has moved."""
        moved = not self.paused and not self._rests and self.beside.advance(self.session, ticks)
        if not self.in_plane:
            self._tell_slips()
        return moved

    def _tell_slips(self) -> None:
        """Say which tube has slipped out of a grasper."""
        tissue = self.session.spatial
        for number, hand in enumerate(tissue.hands):
            if hand.slips > self._slips[number]:
                tube = tube_title(tissue.tubes.names[hand.tube])
                self.refuse(SLIPPED.format(tube, GRIP_N), "The hold is lost")
            self._slips[number] = hand.slips

    @property
    def _rests(self) -> bool:
        """Whether an exercise at an anatomy is over: what is judged breaks and bleeds no more."""
        session = self.session
        at_anatomy = session.run.closed and session.specimen.anatomy is not None
        return at_anatomy and session.reading().phase is not Phase.TEARING

    def start_again(self, run: RunFile) -> None:
        """Start the exercise of a run again."""
        if run.log.exercise is not None:
            self.start_exercise(run.log.exercise, run.log.feedback, run.log.start.grasp_mm)

    def _renew(self, start: Callable[[], object]) -> None:
        """Keep the run so far, and start anew."""
        self.release_hand()
        self.keep_run()
        start()
        self.photographs = []
        self.beside.begin(self.session)
        self.hand = min(self.hand, len(self.hands) - 1)
        if self.beside.leads(self.hand):
            self.hand = 0
        self.paused = False
        self.pulls += 1
        self._changed = True

    def _begin_anew(self, pulls: bool) -> bool:
        """Reset for a new run when the end of the last one was shown and the duct is as new."""
        # A free duct that is whole is as new; a bed is not, whose strands have parted.
        session = self.session
        as_new = session.specimen.bed is None and session.reading().phase is Phase.INTACT
        renew = pulls and session.run.over and not self.end_is_news and as_new
        if renew:
            self._renew(session.reset)
        return renew

    # What is in hand

    def choose_preset(self, preset: Preset) -> None:
        """Start anew with another duct."""
        self.require_no_exercise()
        self._renew(lambda: self.session.choose_preset(preset))

    def choose_bed(self, bed: BedPreset | None, seed: int) -> None:
        """Start anew in another bed, or free in space."""
        self.require_no_exercise()
        self._renew(lambda: self.session.choose_bed(bed, seed))

    def choose_theory(self, theory: Theory | None) -> None:
        """Solve a free duct by another theory of the plane, or by none: in space."""
        session = self.session
        self.require_no_exercise()
        if theory == session.specimen.theory:
            return
        if theory is None or not self.in_plane:
            specimen = replace(session.specimen, theory=theory, threshold_MPa=None)
            self._renew(lambda: session.choose(specimen))
        else:
            session.choose_theory(theory)

    def practise_on(self, organ: Organ) -> None:
        """Ask for another organ; the next `take_organ` starts anew on it."""
        self.require_no_exercise()
        self._other_organ = self.session.prepare_organ(organ)

    def take_organ(self) -> None:
        """Start anew on the organ asked for, if there is one; called by the thread that draws."""
        start, self._other_organ = self._other_organ, None
        if start is None or self.in_exercise:
            return
        self.leave_replay()
        self._dragged = None
        start()
        self.last_run = None
        self.pulls += 1
        self.paused = False
        self._changed = True

    # The force of a duct in a plane

    def set_target_force(self, force: float) -> None:
        """Pull with the slider's force; once a run is over, this starts a new one."""
        if self.playback is None and not self.refuses(0) and not self._refuses_force():
            renewed = self._begin_anew(force > 0.0)
            self.session.set_target_force(force)
            # Counted after the force is set: before, the slider would go back to zero.
            self.pulls += renewed

    def ramp_to_tear(self) -> None:
        """Pull at a constant rate until the duct tears."""
        if self.playback is not None or self.refuses(0) or self._refuses_force():
            return
        self._begin_anew(True)
        event = self.session.reading().breaks_at
        if event is not None:
            self.session.set_target_force(PAST_BREAK * event.force)
            self.paused = False
        self.pulls += 1

    def _refuses_force(self) -> bool:
        """Return whether only the hand counts now; then tell the client so."""
        if self.session.run.hand_only:
            self.refuse(HAND_ONLY)
            return True
        return False

    # The mouse

    def grab(self, hold: Hold) -> None:
        """Take the duct with the active hand, or an instrument where it is."""
        self._dragged = None
        if self.playback is not None:
            return
        if hold.hand is not None:
            self.choose_hand(hold.hand)
        if self.refuses(self.hand):
            return
        holder, station = self.hands[self.hand], hold.station
        if station is None and self.in_plane:  # whose hook is around the duct
            station = self.session.planar.grasp
        takes = station is not None and holder.instrument in HOLDING
        self._begin_anew(takes)
        if self.is_closed():
            return
        self._dragged_from = holder.place.copy()
        if takes and station is not None:
            place = self._take(station)
            if place is None:
                return
            self._dragged_from = np.array(place)
        self._dragged = self.hand
        self.move_hand(hold)

    def move_hand(self, hold: Hold) -> None:
        """Lead the hand that the mouse has."""
        if self._dragged is not None:
            self.session.move_hand(self._dragged, self._dragged_from + hold.moved)

    def release_hand(self) -> None:
        """Let the mouse go: a hook lets go of the duct, any other instrument stays."""
        hand, self._dragged = self._dragged, None
        if hand is not None and self.hands[hand].instrument == "hook":
            self.session.release(hand)
            self.pulls += 1

    def release(self) -> None:
        """Let go what the mouse holds, and of a duct in a plane that a force pulls."""
        self.release_hand()
        if self.in_plane:
            self.session.release()
            self.pulls += 1

    # The hands

    @property
    def instrument(self) -> Instrument:
        """What the active hand has."""
        return self.hands[self.hand].instrument

    @property
    def instruments(self) -> tuple[Instrument, ...]:
        """What a hand may have now: an exercise that waits or goes on may allow only some."""
        return self.session.instruments

    def choose_hand(self, hand: int) -> None:
        """Let the mouse and the keys lead this hand."""
        self.hand = hand
        self._changed = True

    def next_hand(self) -> None:
        """Let the mouse and the keys lead the next hand."""
        self.choose_hand((self.hand + 1) % len(self.hands))

    def choose_instrument(self, hand: int, instrument: Instrument) -> None:
        """Make a hand the active one, with this instrument; one that it has it keeps as it is."""
        if not self.may_act(hand):
            return
        if instrument not in self.instruments:
            self.refuse(f"This exercise is done with: {', '.join(self.instruments)}.")
            return
        self.choose_hand(hand)
        if self.instrument != instrument:
            self.session.choose_instrument(hand, instrument)

    def next_instrument(self) -> None:
        """Give the active hand the next instrument."""
        offered = self.instruments
        now = offered.index(self.instrument) if self.instrument in offered else -1
        self.choose_instrument(self.hand, offered[(now + 1) % len(offered)])

    def nudge(self, displacement: NDArray[np.float64]) -> None:
        """Move the active hand's tip, (3,) mm in the duct's frame."""
        if self._dragged is None and not self.refuses(self.hand) and not self.is_closed():
            self.session.move_hand(self.hand, self.hands[self.hand].target + displacement)

    def open_jaws(self, opening: float) -> None:
        """Open or close the active hand's dissector, mm between its jaws."""
        if self.may_act(self.hand):
            self.session.open_jaws(self.hand, opening)

    def open_more(self, more: float) -> None:
        """Open the active hand's dissector by some mm more, or less."""
        if self.instrument == "dissector":
            self.open_jaws(self.hands[self.hand].target_opening + more)
        else:
            other = any(each.instrument == "dissector" for each in self.hands)
            self.refuse(f"Only a dissector opens. {OTHER_OPENS if other else NEXT_OPENS}")

    def let_go(self, hand: int) -> None:
        """Let a hand go of the duct."""
        if self.beside.leads(hand):
            self.refuse(BY_POLICY)
            return
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
        holder = self.hands[self.hand]
        # In a plane the hook is always at a node, and holds the duct or does not.
        holds = self.session.reading().held if self.in_plane else holder.node is not None
        if holds or self.beside.leads(self.hand):
            self.let_go(self.hand)
        elif self.hand < self.device_hands:
            self.device_holds[self.hand] = True
        elif holder.instrument in HOLDING:
            self._begin_anew(True)
            if not self.is_closed():
                self._take(float(holder.place[0]))
        else:
            self.refuse("Only a hook and a grasper hold. Press N for the next instrument.")

    def _take(self, station: float) -> Vector | None:
        """Let the active hand take the duct; say why where it cannot."""
        place = self.session.grab(self.hand, station)
        if place is None:
            self.refuse(NOWHERE if self.session.tissue.torn is None else TORN)
        return place

    # Devices

    def give_hook(self, device: str, hands: int = 1) -> None:
        """Give the first hands' hooks to devices and say so; mouse and keys have the other."""
        self.release_hand()
        there = self.hands
        self.device, self.device_hands = device, min(hands, len(there))
        self.device_holds = [False] * self.device_hands
        for hand in range(self.device_hands):
            self.session.release(hand)
            if there[hand].instrument != "hook":
                self.session.choose_instrument(hand, "hook")
        self.choose_hand(min(self.device_hands, len(there) - 1))
        if self._force_key is None:
            self._force_key = self.client.gui.add_command(
                "Device's force off or on", description="of the haptic device", hotkey="F"
            )
            self._force_key.on_trigger(lambda _: self.switch_force())
        self._device_notice = self.client.add_notification(
            *self._device_words(device, hands),
            color="green",
            auto_close_seconds=NOTICE_SECONDS,
        )
        self._changed = True

    def take_hook_back(self, why: str | None) -> None:
        """Give the hooks back to mouse and keys."""
        self.device, self.device_hands, self.device_holds = None, 0, []
        if self._device_notice is not None:
            self._device_notice.remove()
            self._device_notice = None
        if why is not None:
            self.client.add_notification(
                "The device has let go", why, color="yellow", auto_close_seconds=NOTICE_SECONDS
            )
        self._changed = True

    def switch_force(self) -> None:
        """Give the device no force, in an exercise too, or give it back."""
        self.force_off = self.device is not None and not self.force_off
        if self.device is not None:
            self.client.add_notification(
                "The device has no force" if self.force_off else "The device has its force again",
                "F gives it back." if self.force_off else "F takes it away.",
                color="yellow" if self.force_off else "green",
                auto_close_seconds=BRIEF_SECONDS,
            )

    def grab_by_device(self) -> bool:
        """Grab a duct in a plane with the device's hand, at the hook; return whether it holds."""
        self._begin_anew(True)
        return self.session.grab(0, self.session.planar.grasp) is not None

    def _device_words(self, device: str, hands: int) -> tuple[str, str]:
        """Return what a page is told that a device now leads: a title and a sentence."""
        if len(self.hands) == 1:
            more = " It is the first one's; the second one waits." if hands > 1 else ""
            says = f"{device}: pull up to pull the duct.{more} {FORCE_KEY}"
            return "The device holds the hook", says
        if hands > 1:
            return "The devices hold both hooks", f"{device}: {TAKES}. {FORCE_KEY}"
        return (
            "The device holds the left hand's hook",
            f"{device}: {TAKES}. The mouse and the keys have the right hand. {FORCE_KEY}",
        )

    def may_act(self, hand: int) -> bool:
        """Return whether a hand can do something now; tell the client why not."""
        return self.playback is None and not self.refuses(hand) and not self.is_closed()

    def is_closed(self) -> bool:
        """Return whether an exercise is over, whose result stands; then tell the client so."""
        closed = self.session.run.closed
        if closed and not self.end_is_news:  # else the result is about to be shown
            self.refuse(EXERCISE_OVER)
        return closed

    def refuses(self, hand: int) -> bool:
        """Return whether a device or a policy has the hand; then tell the client so."""
        if self.beside.leads(hand):
            self.refuse(BY_POLICY)
            return True
        if hand < self.device_hands:
            self.refuse(f"The hand on the device has this hook ({self.device}).")
        return hand < self.device_hands
