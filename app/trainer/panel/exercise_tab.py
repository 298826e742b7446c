"""Exercises: choose one, read its goal and limit, do it, and see the result."""

import html
import math
from collections.abc import Callable, Sequence

import viser

from app.simulation import (
    ERROR_CLASSES,
    FEW,
    FIRST_INSTRUMENTS,
    Exercise,
    Feedback,
    Incident,
    Instrument,
    Phase,
    RunFile,
    Session,
    careful_run,
    exercises_offered,
    has_careful_run,
)
from app.trainer.client.beside import Role
from app.trainer.client.page_state import PageState
from app.trainer.panel.controls import Choice, note, on_click, on_input, set_if_changed
from app.trainer.panel.frame import LEARN, START_TRY
from app.trainer.panel.result_page import SHOW, SHOW_ME, Watch, show_result
from app.trainer.viser_bridge.page import open_tab

FEEDBACK = {
    "Continuous": Feedback.CONTINUOUS,
    "Fading, gone after 30 s": Feedback.FADING,
    "Only in the result": Feedback.SUMMARY,
}
ROLES: dict[Role, tuple[str, str]] = {
    "none": ("None", "You alone"),
    "hand": ("Second hand", "A policy leads the right hand; you have the left one"),
    "ghost": ("Ghost", "A policy does the same exercise beside you, drawn as lines"),
}
"""What the policy that the trainer was started with may do."""
HOW: dict[Instrument, str] = {
    "hook": "press the duct with the hook, drag up to lift; it lets go with the button",
    "grasper": "press the duct with the grasper, drag up to lift; it stays until you press G",
    "dissector": "drag the dissector to the ring; the right button leads it into the picture, "
    "behind the duct; hold O to open its jaws, C to close them",
    "clip applier": "G or the right button clips; B wipes the lens",
}
"""How an instrument is used at a bed, and a clip applier at an anatomy."""
MARKS = (
    "<b>Marks</b> Press on the ring, or the key I, and the tip goes there by itself; a tip that "
    "holds tissue goes only while you press. <i>To the ring</i> says 'in it' once it is there. J "
    "and L turn jaws along the bar. Bright dots are strands to part.<br>"
)
"""What the marks of an exercise at an anatomy mean."""
LEANS_DEG, LEANS_N = 8.0, 0.2
"""A pull that is off straight up by more is told so, if it is stronger."""
NONE, AWAITED = "None for this duct", "Working out its limits"


class ExerciseTab:
    """The tab of exercises."""

    def __init__(self, gui: viser.GuiApi, state: PageState, replay: Watch) -> None:
        self._state, self._replay = state, replay
        self._offered: dict[str, Exercise] = {}
        self._key: object = None
        self._choice: viser.GuiDropdownHandle[str] = gui.add_dropdown("Exercise", [AWAITED])
        # First: it is looked at while one works.
        self._status = gui.add_html("", visible=False)
        self._progress = gui.add_progress_bar(0.0, visible=False)
        self._feedback = gui.add_dropdown(
            "Feedback",
            tuple(FEEDBACK),
            hint="When you see the figures. Who always sees them comes to depend on them; less "
            "feedback is harder, and teaches more",
        )
        beside = state.beside.offered and not state.in_plane
        self._beside = (
            Choice(gui, "Policy", ROLES, state.choose_policy, slow=True) if beside else None
        )
        self._start = gui.add_button("Start", icon=viser.Icon.PLAYER_PLAY, disabled=True)
        self._show_me = gui.add_button(
            SHOW, icon=viser.Icon.SCHOOL, color="gray", visible=False, hint=SHOW_ME
        )
        self._stop = gui.add_button(
            "Stop", icon=viser.Icon.PLAYER_STOP, color="gray", visible=False,
            hint="End the exercise as it stands",
        )  # fmt: skip
        self._result = gui.add_button(
            "Result of the last run", icon=viser.Icon.REPORT_ANALYTICS, color="gray", visible=False
        )
        # Below the buttons, which stay where they are, however long it is.
        self._task = gui.add_html("")
        gui.add_html(
            note(
                "Measures say how tissue was handled in this model. They certify no skill.",
            )
        )
        on_input(self._choice, lambda _: self._choose())
        on_click(self._start, self.start)
        on_click(self._show_me, self._perform)
        on_click(self._stop, self._end)
        on_click(self._result, self._show_last)
        self.take_offers()

    def _choose(self) -> None:
        self._describe()
        self._state.show()

    def start(self) -> None:
        """Start the chosen exercise with the chosen feedback."""
        exercise = self._offered.get(str(self._choice.value))
        feedback = FEEDBACK.get(str(self._feedback.value), Feedback.CONTINUOUS)
        if exercise is not None and exercise.looks_only:
            self._state.attempt("Making the picture.", self._state.next_picture)
        elif exercise is not None and not self._state.leave_pictures(exercise, feedback):
            self._state.start_exercise(exercise, feedback)

    def take_offers(self) -> None:
        """Offer the exercises of the present duct."""
        session = self._state.session
        key = self._state.offers_follow_from()
        if key == self._key:
            return
        self._key = key

        def find() -> None:
            offered = {each.title: each for each in exercises_offered(session)}
            if key != self._key:
                return
            self._offered = offered
            # In a panel that is made anew, the exercise that was done last.
            done = session.run.exercise
            before = "" if done is None else done.title
            titles = tuple(offered) or (NONE,)
            if self._choice.options != titles:
                known = [each for each in (self._choice.value, before) if each in offered]
                self._choice.options = titles
                self._choice.value = (known or titles)[0]
            self._start.disabled = not offered
            self._describe()
            self._state.show()  # what depends on the choice is shown by the next tick

        self._state.when_free(self._state.workers.background, (id(self), "offers"), find)

    def show(self) -> None:
        """Show the state of the exercise."""
        state = self._state
        run, busy = state.session.run, state.in_exercise
        if self._beside is not None:
            self._beside.show(state.beside.role, active=not busy)
        if not busy:
            self.take_offers()
        for handle, visible in (
            (self._show_me, self._has_hands),
            (self._choice, not busy),
            (self._feedback, not busy),
            (self._start, not busy),
            (self._stop, busy),
            (self._status, busy),
            (self._progress, busy and state.figures_visible),
            (self._result, not busy and state.last_run is not None),
        ):
            if handle.visible != visible:
                handle.visible = visible
                if handle is self._stop:
                    self._describe()
        tries = busy and run.started
        set_if_changed(
            self._show_me, disabled=tries, label=f"{SHOW}, once this try is over" if tries else SHOW
        )
        if busy:
            set_if_changed(self._progress, value=round(100.0 * run.progress, 1))
            limit = run.exercise.time_limit_s if run.exercise else 0.0
            ghost = state.beside.ghost
            its = "" if ghost is None else f"<br>The ghost is at {100.0 * ghost.run.progress:.0f} %"
            text = (
                f"{run.seconds:.0f} s of {limit:.0f} s"
                if run.started
                else "Ready. Time runs from your first touch."
            )
            visible = state.figures_visible
            standing = [*run.standings, *self._figures()] if visible else []
            lines = "".join(f"<br>{html.escape(each[:1].upper() + each[1:])}" for each in standing)
            content = note(f"<b>{text}</b>{lines}{its}", "exercise-state")
            set_if_changed(self._status, content=content)

    @property
    def _exercise(self) -> Exercise | None:
        """The exercise that waits or goes on, else the one that is chosen."""
        running = self._state.session.run.exercise if self._state.in_exercise else None
        return running or self._offered.get(str(self._choice.value))

    @property
    def _has_hands(self) -> bool:
        """Whether scripted hands can do it."""
        return self._exercise is not None and has_careful_run(self._exercise)

    def _figures(self) -> list[str]:
        """Return what to do next, and figures that the panel shows above, perhaps out of sight."""
        session = self._state.session
        reading, exercise, holding = session.reading(), session.run.exercise, session.holding
        limits = {} if exercise is None else exercise.limit_of
        # What is pointed at is judged once all is told.
        shown = [] if exercise is None or exercise.looks_only else session.run.failing
        fails = [
            f"Fails it: {ERROR_CLASSES[each].title.lower()}. Stop, and try again" for each in shown
        ]
        if "blood_lost_ml" in limits:
            lost = sum(each.lost_ml for each in reading.fluids if each.name == "blood")
            rate = sum(each.rate_ml_s for each in reading.fluids if each.name == "blood")
            most = limits["blood_lost_ml"]
            left = f", {max(0.0, most - lost) / rate:.0f} s left at this rate" if rate > 0.1 else ""
            return [*fails, f"{lost:.0f} of {most:.0f} ml of blood lost{left}"]
        if session.specimen.anatomy is not None or reading.phase is not Phase.INTACT:
            return []
        lifted = f", pulled out {reading.deflection:.1f} mm" if reading.held else ""
        if (most := limits.get("peak_stress_ratio")) is None:
            wall = f"{100.0 * max(0.0, reading.distance_to_break):.0f} % left to the break"
        else:  # as the limit is written
            at = 100.0 * reading.stress_ratio
            wall = f"Wall at {at:.0f} % of its break, {100.0 * most:.0f} % allowed"
        lines = [f"{wall}{lifted}"]
        if holding is not None and holding.move.words:
            lines.insert(0, f"Next: {holding.move.words[0].lower()}{holding.move.words[1:]}")
        if "leaning" in limits:
            lines += [
                _leaning(*force)
                for force, holds in zip(reading.forces, reading.holding, strict=True)
                if holds
            ]
        return [line for line in (*fails, *lines) if line]

    def _perform(self) -> None:
        """Play a careful performance of the exercise, by scripted hands."""
        state, exercise = self._state, self._exercise
        if exercise is None:
            return

        def perform_it() -> None:
            session = Session(state.session.specimen, vertices=FEW)
            session.set_threshold(state.session.tissue.threshold)
            session.start_exercise(exercise)
            done = careful_run(session)
            self._replay(done.run, 0.0, ())

        state.attempt("Scripted hands do it.", perform_it)

    def _end(self) -> None:
        if self._state.session.run.started:
            self._state.finish()
        else:
            self._state.reset()

    def _show_last(self) -> None:
        state, run = self._state, self._state.last_run
        if run is not None:
            self.show_result(run, state.last_errors)

    def show_result(self, run: RunFile, incidents: Sequence[Incident]) -> None:
        """Open the result page of a run, which leads on to what comes after it."""
        show_result(self._state, run, incidents, self._replay, self._after(run))

    def _after(self, run: RunFile) -> tuple[str, Callable[[], object]] | None:
        """Return a name of what comes after a run, and what starts it."""
        if self._state.next_try is not None:
            return START_TRY, self._state.next_try
        titles = list(self._offered)
        done = run.log.exercise
        passed = run.outcome is not None and run.outcome.passed
        if done is None or not passed or done.title not in titles[:-1]:
            return None
        title = titles[titles.index(done.title) + 1]

        def start() -> None:
            self._choice.value = title
            self.start()
            open_tab(self._state.client, LEARN)

        return f"Next: {title}", start

    def _describe(self) -> None:
        exercise = self._exercise
        set_if_changed(
            self._show_me, visible=self._has_hands
        )  # nothing may move when one is chosen
        if exercise is None:
            self._task.content = ""
            return
        title = (
            f"<b style='font-size:14px'>{html.escape(exercise.title)}</b><br>"
            if self._state.in_exercise
            else ""
        )
        in_hand = exercise.in_hand or FIRST_INSTRUMENTS
        # The instrument that is led first; the other one where it is needed.
        first = exercise.first_hand
        tools = in_hand[first:] + in_hand[:first]
        if exercise.in_hand and "no_traction" not in exercise.limit_of:
            tools = tools[:1]
        at_bed = self._state.session.specimen.bed is not None
        how = "; ".join(
            HOW[each]
            for each in dict.fromkeys(tools)
            if each in HOW and at_bed != (each == "clip applier")
        )
        if exercise.in_hand and len(tools) > 1 and how:
            how += "; X leads the other hand"
        at_anatomy = self._state.session.specimen.anatomy is not None
        marks = MARKS if at_anatomy and not exercise.looks_only else ""
        how = f"<b>How</b> {how[0].upper()}{how[1:]}.<br>" if how else ""
        self._task.content = (
            "<div data-testid='task' style='margin:0 12px 10px;padding:8px 10px;border-radius:6px;"
            "background:rgba(255,255,255,.06);font-size:13px;line-height:1.45'>"
            f"{title}<b>Goal</b> {html.escape(exercise.task)}<br>{how}{marks}"
            f"<b>Limit</b> {html.escape(exercise.caution)}{_folded(exercise.failing)}<br>"
            f"<b>Time</b> {exercise.time_limit_s:.0f} s from the first touch.<br>"
            f"<b>With</b> {self._state.counted}</div>"
        )


def _folded(failing: list[str]) -> str:
    """Return the errors that fail an exercise, to unfold."""
    if not failing:
        return ""
    count = len(failing)
    any_of = (
        f"Any of {count} kinds of error fails it" if count > 1 else "One kind of error fails it"
    )
    return (
        f"<details><summary style='cursor:pointer'>{any_of}</summary>"
        f"{html.escape('; '.join(failing))}.</details>"
    )


def _leaning(along: float, across: float, up: float) -> str:
    """Return how far a pull, N, is off straight up across the duct; empty of little."""
    angle = math.degrees(math.atan2(abs(across), up))
    if angle < LEANS_DEG or math.hypot(along, across, up) < LEANS_N:
        return ""
    side = "far" if across > 0.0 else "near"
    return f"Pulls {angle:.0f} degrees off straight up, to the {side} side"
