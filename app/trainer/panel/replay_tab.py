"""Replay: a run replayed in the picture, with a slider over its time."""

import html
from collections.abc import Callable, Sequence

import viser

from app.simulation import ERROR_CLASSES, Incident, RunFile, Session, read_run, run_json
from app.trainer.client.page_state import PageState
from app.trainer.panel.caption import Caption, reached_words
from app.trainer.panel.controls import note, number, on_click, on_input, set_if_changed
from app.trainer.panel.debrief import where
from app.trainer.panel.export_box import add_export
from app.trainer.panel.frame import LEARN, REPLAY
from app.trainer.panel.result_page import run_name
from app.trainer.viser_bridge.page import open_tab

_TELLING = (
    "A run is kept as its inputs and made again from them, to the digit. It starts with the first "
    "input after a reset; <code>bluntdissect replay run.json</code> prints its measures."
)
NO_RUN = "There is no run yet. One begins with the first pull, or as jaws or a swab are led."
AFTER_EXERCISE = "A run can be replayed and downloaded once its exercise is over."
ON_ITS_WAY = "The run is made again up to there: the picture follows in a moment."
STEP = 0.01
"""Step of the time slider, s."""
ERROR_PX = 84
"""Height of an error of four lines, pixels."""
SPEEDS = {"1×": 1, "4×": 4, "16×": 16}


class ReplayTab:
    """The tab of replays."""

    def __init__(self, gui: viser.GuiApi, state: PageState) -> None:
        self._state = state
        self._time = gui.add_slider(
            "Time (s)", min=0.0, max=1.0, step=STEP, initial_value=0.0, visible=False
        )
        self._play = gui.add_button("Play", icon=viser.Icon.PLAYER_PLAY, visible=False)
        self._speed = gui.add_dropdown(
            "Speed", tuple(SPEEDS), visible=False, hint="Times as fast as the run was done"
        )
        self._error = gui.add_html("", visible=False)
        self._leave = gui.add_button(
            "Leave the replay", icon=viser.Icon.ARROW_BACK_UP, color="gray", visible=False
        )
        self._why_not = gui.add_html("", visible=False)
        self._this = gui.add_button("Replay this run", icon=viser.Icon.PLAYER_PLAY)
        # In a folder: viser shows an upload button whether it is visible or not.
        self._upload = gui.add_folder(None)
        with self._upload:
            self._open = gui.add_upload_button(
                "Open a run file",
                icon=viser.Icon.UPLOAD,
                color="gray",
                mime_type="application/json",
                hint="A run that was downloaded here as JSON, of the same organ",
            )
        self._json = gui.add_button("Download JSON", icon=viser.Icon.DOWNLOAD, color="gray")
        self._csv = gui.add_button("Download CSV", icon=viser.Icon.TABLE_EXPORT, color="gray")
        add_export(gui, state)
        gui.add_html(note(_TELLING))
        self._back, self._caption = "", Caption()
        self._playing = False
        self._put = 0.0
        self._of: object = None
        self._was_playing = False
        on_click(self._this, self._replay_this)
        on_click(self._leave, self._leave_it)
        on_click(self._play, self._play_or_pause)
        on_click(self._json, lambda: self._download("json"))
        on_click(self._csv, lambda: self._download("csv"))
        on_input(self._time, self._seek)
        on_input(self._speed, lambda _: state.show())

        @self._open.on_upload
        def _(_: object) -> None:
            content = self._open.value.content
            self.replay(lambda: read_run(content), back="")

    def watch(
        self, run: RunFile, at: float = 0.0, incidents: Sequence[Incident] | None = None
    ) -> None:
        """Open this tab, and replay a run there from a time, s, on."""
        self.replay(lambda: run, at, incidents)
        open_tab(self._state.client, REPLAY)

    def replay(
        self,
        read: Callable[[], RunFile],
        at: float = 0.0,
        incidents: Sequence[Incident] | None = None,
        back: str = LEARN,
    ) -> None:
        """Replay a run from a time, s, on, or say why that is not possible; then go `back`."""
        start = self._state.start_replay
        self._back, self._caption = back, Caption()
        self._state.attempt("Making the run again.", lambda: start(read(), at, incidents))

    def show(self) -> None:
        """Show the time of the replay."""
        state, playback = self._state, self._state.playback
        there = playback is not None
        timed = playback is not None and playback.duration > 0.0  # not what is live
        for handle, visible in (
            (self._time, timed),
            (self._play, timed),
            (self._speed, timed),
            (self._error, timed),
            (self._leave, timed),
            (self._this, not there),
            (self._upload, not there and not state.in_exercise),
            (self._json, not there),
            (self._csv, not there),
        ):
            set_if_changed(handle, visible=visible)
        there_now = None if playback is None else playback.incident
        text = "" if there_now is None else _error_html(there_now, hands=not state.in_plane)
        if playback is not None and not playback.incidents:
            text = self._caption_html(playback.session)
        if playback is not None and playback.on_its_way:
            text = note(ON_ITS_WAY, "on-its-way")
        # Its room is kept: a button below it stays where it is.
        set_if_changed(self._error, content=f"<div style='min-height:{ERROR_PX}px'>{text}</div>")
        some = state.session.run.started or state.last_run is not None
        why_not = AFTER_EXERCISE if state.in_exercise else "" if some else NO_RUN
        set_if_changed(self._why_not, content=note(why_not), visible=not there and bool(why_not))
        for button in (self._this, self._json, self._csv):
            set_if_changed(button, disabled=not some or state.in_exercise)
        if playback is None:
            self._of = None
            return
        playback.speed = SPEEDS.get(str(self._speed.value), 1)
        if fresh := self._of is not playback:
            self._of = playback
            self._time.max = max(round(playback.duration, 2), STEP)
            self._was_playing = True  # it may be paused already, at a time that is to be shown
        if self._playing != playback.playing:  # viser cannot say which icon a button has
            self._playing = playback.playing
            self._play.label = "Pause" if playback.playing else "Play"
            self._play.icon = (
                viser.Icon.PLAYER_PAUSE if playback.playing else viser.Icon.PLAYER_PLAY
            )
        time = min(round(playback.time, 2), self._time.max)
        went_on = playback.playing and time != self._put
        if fresh or went_on or (not playback.playing and self._was_playing):
            self._put = time
            self._time.value = time
        self._was_playing = playback.playing

    def _caption_html(self, session: Session) -> str:
        """Return what hands do now, and what they have reached."""
        if (tissue := session.tissue.in_space) is not None:
            self._caption.look(tissue)
        does, reached = self._caption.words, reached_words(session.run.standings)
        return note(f"<b>{html.escape(does)}</b><br>{html.escape(reached)}", "caption")

    def _leave_it(self) -> None:
        self._state.leave_replay()
        if self._back:
            open_tab(self._state.client, self._back)

    def _replay_this(self) -> None:
        run = self._state.run_at_hand()
        if run is not None:
            self.replay(lambda: run, back="")

    def _download(self, kind: str) -> None:
        run = self._state.run_at_hand()
        if run is None:
            return
        content = run_json(run) if kind == "json" else self._state.run_csv(run)
        self._state.send_file(f"{run_name(run)}.{kind}", content)

    def _play_or_pause(self) -> None:
        playback = self._state.playback
        if playback is not None:
            (playback.pause if playback.playing else playback.play)()

    def _seek(self, seconds: object) -> None:
        playback = self._state.playback
        if playback is not None:
            playback.seek(number(seconds))
            playback.pause()
            self._state.show()


def _error_html(each: Incident, *, hands: bool) -> str:
    title = html.escape(ERROR_CLASSES[each.error].title)
    small = html.escape(where(each, hands=hands))
    return note(f"<b>{title}</b> ({small})<br>{html.escape(each.sentence)}", "replayed-error")
