"""One client's page: a session of its practice, drawn and told about as often as there is time."""

from collections.abc import Callable
from threading import Lock, Thread
from typing import TypeAlias

import viser

from app.anatomy import Anatomy, anatomy_named, anatomy_network, drawn_anatomy
from app.simulation import (
    Clock,
    Exercise,
    ExerciseInputs,
    Feedback,
    Phase,
    Preset,
    Reading,
    Run,
    RunFile,
    Session,
    cause_of,
    exercise_at,
)
from app.trainer.client.beside import StartCompanion
from app.trainer.client.page_state import EXERCISE_GOES_ON, NOTICE_SECONDS, PageState
from app.trainer.client.practice import Practice, SceneName
from app.trainer.client.scope_lead import ScopeLead
from app.trainer.client.workers import Workers, explained
from app.trainer.panel.frame import LEARN, style_panel
from app.trainer.panel.model_tab import SIMPLE_PICTURE
from app.trainer.panel.page_panel import PagePanel, offers
from app.trainer.panel.scope_panel import ScopePanel
from app.trainer.scene.tissue_scene import TissueScene
from app.trainer.scope.held_scope import HeldScope
from app.trainer.stage.lighting import Look, LookChoice
from app.trainer.view.scope_scene import ScopeScene
from app.trainer.viser_bridge.page import open_tab, watch_pace
from organ_geometry import Organ

# s, shortest time between updates of the panel: faster changes of a figure cannot be read.
PANEL_SECONDS = 0.2
LEAST_PICTURES = 5.0
"""Frames per second below which a page gets the simple picture."""


Scene: TypeAlias = TissueScene | ScopeScene
"""What draws a session's tissue for a client."""


class PageView:
    """What one client sees of its practice: one of its sessions at a time.

    Parameters
    ----------
    client, practice, workers
        Whose page it is, what is in hand there, and who does its slow work.
    look
        "plain" for slow machines; "auto" changes to it where the page draws too slowly.
    exercise_inputs
        Which inputs count in exercises.
    policy
        Starts a policy beside an exercise, if there is one.
    ready
        Waits until what a scene needs is compiled: the first one is ready.
    on_page_ready
        Adds to the page, each time that its panel is made anew.
    scene, panel
        Make what draws the session's tissue, and the panel beside it.

    Attributes
    ----------
    state
        What the parts of the page share.
    frames
        How often the tissue was drawn.
    """

    def __init__(
        self,
        client: viser.ClientHandle,
        practice: Practice,
        workers: Workers,
        look: LookChoice,
        *,
        exercise_inputs: ExerciseInputs = "hand",
        policy: StartCompanion | None = None,
        ready: Callable[[SceneName], object] = lambda _: None,
        on_page_ready: Callable[["PageView"], object] = lambda _: None,
        scene: Callable[[viser.ClientHandle, Session, Look], Scene] = TissueScene,
        panel: Callable[[PageState, SceneName, Callable[[SceneName], None]], PagePanel] = PagePanel,
    ) -> None:
        self.client, self._practice, self._workers = client, practice, workers
        self._look: LookChoice = look
        self._exercise_inputs: ExerciseInputs = exercise_inputs
        self._policy = policy
        self._ready, self._on_page_ready = ready, on_page_ready
        self._make_scene, self._make_panel = scene, panel
        self.frames = 0
        self._lock = Lock()  # while the page is made anew nothing ticks
        self._closed = self._renewing = False
        self._clock = Clock()
        self._undrawn = False
        self._panel_due = 0.0
        self._panel_stale = self._figures = True
        self._notice: viser.NotificationHandle | None = None
        self._scene: Scene
        self._panel: PagePanel | ScopePanel
        self._lead: ScopeLead | None = None  # of what mouse and keys lead at an anatomy
        self._open(practice.scene or "bed", plain=practice.plain or look == "plain")
        if self.state.in_exercise:  # which the page that was left had begun
            self.state.choose_hand(practice.hand)
        on_page_ready(self)

    @property
    def scene(self) -> SceneName:
        """What the page began with."""
        return self._practice.scene or "bed"

    @property
    def session(self) -> Session:
        """The client's session."""
        return self.state.session

    def tick(self, seconds: float, *, draws: bool = True) -> None:
        """Advance what is shown by real time, s, and send what has changed."""
        if self._lock.acquire(blocking=False):
            try:
                self._tick(seconds, draws=draws)
            finally:
                self._lock.release()

    def close(self) -> None:
        """Release the duct and remove what was sent, when the client has gone."""
        self.state.close_result()  # nobody waits for what is computed for it
        with self._lock:
            self._closed = True
            self._practice.hand, self._practice.plain = self.state.hand, self.state.plain
            self._let_go()

    def show_duct(self, organ: Organ, preset: Preset | None, scene: SceneName) -> None:
        """Show a new duct, whatever goes on."""
        self._show(scene, lambda: self._practice.renew(organ, preset))

    def choose_scene(self, scene: SceneName) -> None:
        """Show another scene."""
        if scene == self.scene:
            return
        if self.state.in_exercise:
            self.state.refuse(EXERCISE_GOES_ON)
            return
        self._show(scene)

    def replay(self, run: RunFile) -> None:
        """Replay a run in place of the session."""
        start = run.log.start
        if (anatomy := start.anatomy) is not None:
            self.show_anatomy(anatomy_named(anatomy) if isinstance(anatomy, str) else anatomy)
        elif self._lead is not None:
            self._show("bed" if start.in_bed else "free")
        self._panel.replays.watch(run)

    def show_picture(self) -> None:
        """Show the next picture of *Who is who*; after the last one those of another round."""
        if self.state.in_exercise:
            self.state.refuse(EXERCISE_GOES_ON)
            return
        series = self._practice.series
        if series.over:
            series.begin_anew()
        anatomy = drawn_anatomy(series.seed)
        exercise = exercise_at(anatomy, "who_is_who")
        if exercise is None:
            raise ValueError("this anatomy has no gallbladder to be told from ducts")
        now = self.session.specimen.anatomy
        if now is not None and now != series.anatomy:
            series.before = now
        series.anatomy = anatomy
        self.show_anatomy(anatomy)
        series.exercise = exercise
        self.state.start_exercise(exercise, Feedback.CONTINUOUS)
        open_tab(self.client, LEARN)

    def leave_pictures(
        self, exercise: Exercise | None = None, feedback: Feedback = Feedback.CONTINUOUS
    ) -> bool:
        """Show the anatomy of before the pictures again, and start an exercise there, if any.

        Returns
        -------
        bool
            Whether a picture was shown.
        """
        series, now = self._practice.series, self.session.specimen.anatomy
        before = series.before
        if before is None or now != series.anatomy or self.state.in_exercise:
            return False
        found = None if exercise is None else exercise_at(before, exercise.name)
        self.state.attempt("Making the anatomy.", lambda: self.show_anatomy(before))
        if found is not None:
            self.state.start_exercise(found, feedback)
            open_tab(self.client, LEARN)
        return True

    def show_anatomy(self, anatomy: Anatomy) -> None:
        """Show an anatomy, if it is not shown yet."""
        if self.scene != "calot" or self.session.specimen.anatomy != anatomy:
            self._show("calot", lambda: self._practice.choose_anatomy(anatomy))

    # Making the page

    def _show(self, scene: SceneName, prepare: Callable[[], object] | None = None) -> None:
        """Show a scene, if it is not shown yet or there is something to prepare for it."""
        with explained(self.client, "Preparing your duct."):
            self._ready(scene)
            with self._lock:
                if self._closed or (prepare is None and scene == self.scene):
                    return
                self.state.leave_replay()
                self._let_go()
                self._forget_tear()
                self._scene.remove()
                self.state.remove_panel()
                if prepare is not None:
                    prepare()
                self._open(scene, plain=self.state.plain)
            self._on_page_ready(self)

    def _open(self, scene: SceneName, *, plain: bool) -> None:
        """Send the client a scene, which is ready, and its panel."""
        session = self._practice.session(scene)
        self.state = state = PageState(
            self.client, session, self._workers, self._exercise_inputs, self._policy
        )
        state.plain = plain
        state.series, state.next_picture = self._practice.series, self.show_picture
        state.leave_pictures = self.leave_pictures
        look: Look = "plain" if plain else "full"
        # Before the scene, which else would be drawn once for the whole window.
        style_panel(self.client.gui)
        anatomy = session.specimen.anatomy
        if anatomy is None:
            self._lead = None
            self._scene = self._make_scene(self.client, session, look)
        else:
            self._lead = ScopeLead(state, HeldScope(anatomy_network(anatomy)))
            self._scene = ScopeScene(self.client, session, look, self._lead)
        # Before the panel is sent, so that all that can be seen can be dragged.
        self._scene.let_drag(state.grab, state.move_hand, state.release_hand)
        self._add_panel(scene)
        self._practice.scene = scene

    def _add_panel(self, scene: SceneName) -> None:
        self._offered = offers(self.session)
        if self._lead is None:
            self._panel = self._make_panel(self.state, scene, self.choose_scene)
        else:
            self._panel = ScopePanel(
                self.state,
                self._lead,
                scene,
                self.choose_scene,
                self.show_anatomy,
                self._practice.own_anatomy,
                self._practice.case,
            )
        self._panel_stale = True
        self._watch_pace()

    def _renew_panel(self) -> None:
        """Make the panel anew, as what is in hand offers something else."""
        with explained(self.client, "Preparing your duct."):
            self._ready("free" if self.state.in_plane else "bed")
            with self._lock:
                if not self._closed:
                    self._panel.close()
                    self.state.remove_panel()
                    self._add_panel(self.scene)
                self._renewing = False
            if not self._closed:
                self._on_page_ready(self)

    def _let_go(self) -> None:
        self.state.release_hand()
        self._panel.close()

    # A tick

    def _tick(self, seconds: float, *, draws: bool) -> None:
        state = self.state
        changed = self._advance(self._clock.ticks(seconds))
        if self._renewing:
            return
        if offers(self.session) != self._offered:
            self._renewing = self._undrawn = True
            Thread(target=self._renew_panel, name="panel", daemon=True).start()
            return
        visible = state.figures_visible
        changed |= state.take_change() | (visible != self._figures)
        self._figures = visible
        self._panel_due -= seconds
        self._panel_stale |= changed | self._has_news()
        # A change is kept until there is time to draw it.
        self._undrawn |= changed
        if not draws:
            return
        tells = self._panel_stale and self._panel_due <= 0.0
        if not (self._undrawn or tells):
            return
        with self.client.atomic():  # one frame of the socket, and the server's loop wakes once
            try:
                if self._undrawn:
                    self._undrawn = False
                    self.frames += 1
                    self._draw()
                if tells:
                    self._panel_due = PANEL_SECONDS
                    self._panel_stale = False
                    self._tell()
            except ValueError:
                # Another thread has put something else in hand: the next tick makes the panel anew.
                if offers(self.session) == self._offered:
                    raise

    def _advance(self, ticks: int) -> bool:
        """Advance what is shown by some ticks; return whether anything has moved."""
        state = self.state
        state.take_organ()
        self._scene.watch(state.shown)
        if homes := state.take_home():
            self._scene.frame_camera()
        scene_moved = self._scene.advance(ticks) or homes
        if (playback := state.playback) is not None:
            return playback.tick(ticks) or scene_moved
        if not state.paused:
            self.session.look_from(self._scene.view)
        return state.advance(ticks) or scene_moved

    def _has_news(self) -> bool:
        """Return whether the panel has something to tell although nothing has moved."""
        run = self.session.run
        # While all stands still the time shown runs on.
        timed = run.going and run.exercise is not None
        return timed or self._panel.needs_redraw or self.state.end_is_news

    def _draw(self) -> None:
        state, scene = self.state, self._scene
        scene.set_look("plain" if state.plain else "full")
        scene.lead_into_picture(state.into_picture)
        scene.draw(
            state.shown.reading(),
            state.colours if state.figures_visible else "tissue",
            figures=state.figures_visible,
            overlay=state.overlay,
            lit=_culprit(state),
        )
        if isinstance(scene, TissueScene):
            scene.show_ghost(None if state.playback is not None else state.beside.ghost)

    def _tell(self) -> None:
        """Bring the panel up to date, announce a tear, and show the result of an exercise."""
        state = self.state
        self._scene.say_standing(figures=state.figures_visible)
        self._panel.show(state.shown.reading())
        run, reading = self.session.run, self.session.reading()
        # A duct is not called torn before the picture shows it in two.
        if state.end_is_news and reading.phase is not Phase.TEARING:
            state.keep_run()
            kept = state.last_run
            judged = run.exercise is not None
            if judged:
                state.release()
                state.series.take(run.exercise, run.outcome)
            state.announced = run  # from now on another pull may begin anew
            if judged and kept is not None:
                exercises, errors = self._panel.exercises, state.last_errors
                state.when_free(
                    state.workers.awaited,
                    (id(self), "result"),
                    lambda: exercises.show_result(kept, errors),
                )
            self._panel_stale = True
        self._tell_tear(run, reading)

    def _tell_tear(self, run: Run, reading: Reading) -> None:
        """Say that a single duct is torn, once, until another run or an exercise's result."""
        torn = self.session.specimen.anatomy is None and reading.phase is Phase.TORN
        if not torn or run.exercise is not None:
            self._forget_tear()
        elif self._notice is None:
            self._notice = self.client.add_notification(
                "The duct is torn",
                f"{_torn_words(reading)} {_why(run)}Press Reset (R) for a new one.",
                color="red",
            )

    def _forget_tear(self) -> None:
        if self._notice is not None:
            self._notice.remove()
            self._notice = None

    def _watch_pace(self) -> None:
        """Suggest the simple picture to a page that draws in software; "auto" switches to it."""
        if self._look == "plain":
            return
        where = f"{SIMPLE_PICTURE!r} in the {'Model' if self._lead is None else 'Train'} tab"
        remedy = f"A simpler picture helps: {where}."
        command: viser.CommandHandle | None = None
        if self._look == "auto":
            command = self.client.gui.add_command(
                SIMPLE_PICTURE, description="For a page that draws slowly"
            )

            @command.on_trigger
            async def _(_: object) -> None:  # pyright: ignore[reportUnusedFunction]
                self.state.show(plain=True)
                self.client.add_notification(
                    "A simpler picture",
                    f"This page draws fewer than {LEAST_PICTURES:g} pictures a second. The full "
                    f"one comes back with {where}.",
                    color="blue",
                    auto_close_seconds=NOTICE_SECONDS,
                )

        watch_pace(self.client, least=LEAST_PICTURES, command=command, remedy=remedy)


def _culprit(state: PageState) -> int | None:
    """Return the hand that makes the error which a replay shows now, if one does."""
    playback = state.playback
    incident = None if playback is None else playback.incident
    return None if incident is None else incident.hand


def _why(run: Run) -> str:
    """Return the error that a run's tear is put down to, in a sentence; empty without one."""
    tore: float = run.metrics()["tear"]["time_s"]
    cause = cause_of((each for each in run.incidents() if each.start_s <= tore), tore)
    return "" if cause is None else f"{cause.sentence} "


def _torn_words(reading: Reading) -> str:
    """Return where a duct has torn, and what is known of it, in a sentence."""
    event = reading.breaks_at
    force = f" at F = {event.force:.2f} N" if event else ""
    freed = f", with {reading.freed:.0f} mm freed" if reading.strands else ""
    return f"It tore {reading.check.station:.1f} mm from the left clamp{force}{freed}."
