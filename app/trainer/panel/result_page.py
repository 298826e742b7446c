"""The result page: how a run has ended, its measures, its plots, and what to do next."""

import base64
import html
import threading
from collections.abc import Callable, Sequence
from datetime import datetime
from typing import TypeAlias

import msgspec
import viser

from app.classroom.photograph import kind_of
from app.simulation import (
    FEW,
    CarefulRun,
    Exercise,
    FreeLength,
    Incident,
    Metrics,
    RunFile,
    Seen,
    Series,
    Sights,
    Stay,
    careful_run,
    cause_of,
    has_careful_run,
    run_json,
)
from app.trainer.client.page_state import PageState
from app.trainer.client.picture_series import PICTURES
from app.trainer.panel.controls import note, on_click, rows_html
from app.trainer.panel.debrief import Debrief, Done, next_time
from app.trainer.panel.dialog import dialog
from app.trainer.panel.frame import LEARN
from app.trainer.panel.measures_table import measures_html, outcome_html
from app.trainer.panel.plots import add_series_plots
from app.trainer.viser_bridge.page import open_tab

Watch: TypeAlias = Callable[[RunFile, float, Sequence[Incident] | None], object]
"""Replays a run from a time, s, on; its errors are found meanwhile where they are not given. A
demonstration is given none."""
# Earlier tries shown beside a result.
TRIES_BESIDE = 2
_BESIDE = (
    "<b>Try</b>: your earlier tries of this session at the same task. <b>Expert</b>: a scripted "
    "hand, careful and steady, at the same task; it is no surgeon."
)
_REPLAYED = "The run is replayed for this, which takes a while."
PROGRESS_TICKS = 150
"""Between two words of how far that is."""
SHOW = "Show me"
SHOW_ME = "A scripted hand does it, careful and steady; it is no surgeon"
NO_SERIES = Series((), ())
"""Of an expert's run that is not compared tick by tick."""
_SLIDERS = "Sliders and keys were allowed in this exercise."


class _ClosedError(Exception):
    """The result was closed before all of it was there."""


def _expert(run: RunFile, state: PageState) -> CarefulRun | None:
    """Return a careful run of the same exercise; None for a free run."""
    exercise = run.log.exercise
    if exercise is None or not has_careful_run(exercise):
        return None
    waiting = msgspec.structs.replace(run.log, inputs=[], ticks=0, exercise_inputs="hand")
    replay = state.replay_of(msgspec.structs.replace(run, log=waiting), vertices=FEW)
    return careful_run(replay.session)


def _seeks_break(exercise: Exercise | None) -> bool:
    """Return whether coming near the break is the goal, so that neither is better."""
    goal = None if exercise is None else exercise.goal
    return isinstance(goal, Stay) and goal.quantity == "distance_to_break"


def _beside(tries: Sequence[RunFile], expert: Metrics | None) -> dict[str, Metrics]:
    """Return the runs shown beside a result: the last tries, newest first, and the expert."""
    found = {
        f"try {number}": each.metrics
        for number, each in list(enumerate(tries, 1))[: -TRIES_BESIDE - 1 : -1]
    }
    return found if expert is None else {**found, "expert": expert}


def run_title(run: RunFile) -> str:
    """Return what a run was: its exercise, or a free one."""
    if run.log.exercise is not None:
        return run.log.exercise.title
    return "Free dissection" if run.log.start.in_bed else "Free pull"


def run_name(run: RunFile) -> str:
    """Return a name for a run's files: its exercise, or what it was, and the time now."""
    exercise = run.log.exercise
    free = "dissection" if run.log.start.in_bed else "pull"
    what = free if exercise is None else exercise.title.lower().replace(" ", "-")
    return f"{what}-{datetime.now():%Y-%m-%d-%H%M%S}"


def _photographs_html(taken: Sequence[bytes]) -> str:
    """Return photographs for the record, as HTML."""
    pictures = "".join(
        f"<img alt='Triangle from the {side}' style='width:48%;border-radius:6px' "
        f"src='data:{kind_of(each)};base64,{base64.b64encode(each).decode()}'>"
        for side, each in zip(("front", "back"), taken, strict=False)
    )
    return f"<div data-testid='photographs' style='margin:8px 12px'>{pictures}</div>" * bool(taken)


def _seen_html(seen: Sequence[Seen]) -> str:
    """Return what was seen when, as HTML."""
    if not seen:
        return note("No part of the critical view was reached, and no tube was injured.", "seen")
    rows = [(f"{each.seconds:.0f} s", html.escape(each.what)) for each in seen]
    table = rows_html(rows, "padding:2px 14px 2px 0;text-align:right;white-space:nowrap", "")
    return f"<table data-testid='seen' style='margin:8px 12px;font-size:13px'>{table}</table>"


def show_result(
    state: PageState,
    run: RunFile,
    incidents: Sequence[Incident],
    watch: Watch,
    after: tuple[str, Callable[[], object]] | None,
) -> None:
    """Open a run's result over the trainer: how it ended, its errors, measures, and what is next.

    `after` is what comes after it: what its button says and does, if there is something.
    What the run's end has told is there at once. Its plots, what was seen and the expert's run
    follow: for them a worker replays it, until the result is closed.
    """
    gui, exercise, name = state.client.gui, run.log.exercise, run_name(run)
    experts: list[CarefulRun] = []
    computed: list[Series] = []

    def measures(expert: Metrics | None) -> str:
        return measures_html(
            run.metrics,
            _beside(state.session.earlier_tries(run), expert),
            {} if exercise is None else exercise.limit_of,
            sought_break=_seeks_break(exercise),
            torn=next((str(each.values["name"]) for each in tears), "") if several else "",
        )

    several = run.log.start.anatomy is not None
    tears = [each for each in incidents if each.error == "tear"]
    cause = cause_of(incidents, run.metrics["time_s"])
    # A time that is over is put down to no error.
    failed = run.outcome is not None and cause is not None and cause.instead in run.outcome.reason
    decided = cause if failed else None
    by_sliders = exercise is not None and run.log.exercise_inputs == "any"
    tries = [incidents]
    if exercise is not None:
        earlier = state.session.earlier_incidents(exercise.name, TRIES_BESIDE)
        tries = [*earlier, incidents]
    advice = (
        "Choose an exercise: it says what to do instead."
        if exercise is None
        else next_time(exercise, run.outcome, run.metrics, tries, decided)
    )
    forget: list[Callable[[], None]] = []
    closed = threading.Event()
    state.close_result()  # of two dialogs the lower one could not be reached
    with dialog(
        gui, "Result", closed=lambda: [closed.set(), *(each() for each in forget)]
    ) as close:
        state.close_result = close

        def closing(action: Callable[[], object]) -> Callable[[], None]:
            def press() -> None:
                close()
                action()

            return press

        def play(at: float) -> None:
            close()
            watch(run, at, incidents)

        def play_expert(at: float) -> None:
            close()
            for each in experts:
                watch(each.run, at, ())

        def again() -> None:
            state.start_again(run)
            open_tab(state.client, LEARN)

        gui.add_html(
            outcome_html(
                run.outcome,
                run_title(run),
                _SLIDERS if by_sliders else "",
                "" if run.outcome is not None and run.outcome.passed else state.last_standing,
                asked=exercise is not None,
            )
        )
        pictures = state.series
        if exercise is not None and exercise.looks_only and pictures.answers:
            gui.add_html(note(pictures.score, "score"))
            if not pictures.over:
                label = f"Picture {len(pictures.answers) + 1} of {PICTURES}"
                onward = gui.add_button(label, icon=viser.Icon.PLAYER_PLAY, color="teal")
                on_click(onward, closing(state.next_picture))
        elif exercise is not None:
            if after is not None:
                label, start = after
                onward = gui.add_button(label, icon=viser.Icon.PLAYER_PLAY, color="teal")
                on_click(onward, closing(start))
            retry = gui.add_button(
                "Try again", icon=viser.Icon.REFRESH, color="teal" if after is None else "gray"
            )
            on_click(retry, closing(again))
        tabs = gui.add_tab_group()
        with tabs.add_tab("Errors"):
            debrief = Debrief(
                gui, exercise, advice, state.marks_of(exercise), play, play_expert,
                decided=decided, in_space=run.log.start.theory is None,
            )  # fmt: skip
            forget.append(debrief.forget)
            debrief.show(Done(run.metrics, incidents, NO_SERIES))
        with tabs.add_tab("Measures"):
            compared = gui.add_html(measures(None))
            if exercise is not None:
                gui.add_html(note(_BESIDE))
            csv = gui.add_button(
                "Download CSV", icon=viser.Icon.TABLE_EXPORT, color="gray", disabled=True
            )
            json = gui.add_button("Download JSON", icon=viser.Icon.DOWNLOAD, color="gray")
        with tabs.add_tab("Over time") as over_time:
            waiting = gui.add_html(note(_REPLAYED))
        seen: viser.GuiHtmlHandle | None = None
        if exercise is not None and run.log.start.anatomy is not None:
            with tabs.add_tab("What was seen"):
                seen = gui.add_html(_photographs_html(state.photographs) + note(_REPLAYED))
        show_me = gui.add_button(
            f"{SHOW}, once this run is replayed", icon=viser.Icon.SCHOOL, color="gray",
            hint=SHOW_ME, disabled=True,
            visible=exercise is not None and has_careful_run(exercise),
        )  # fmt: skip
        whole = gui.add_button("Watch it again", icon=viser.Icon.PLAYER_PLAY, color="gray")
    on_click(whole, lambda: play(0.0))
    on_click(show_me, lambda: play_expert(0.0))
    on_click(csv, lambda: state.send_file(f"{name}.csv", computed[0].csv().encode()))
    on_click(json, lambda: state.send_file(f"{name}.json", run_json(run)))

    def follow() -> None:
        replay = state.replay_of(run, vertices=FEW)
        sights = None if seen is None else Sights(replay.session, run.log.ticks)

        def look(tick: int) -> None:
            if closed.is_set():
                raise _ClosedError
            if sights is not None:
                sights.look(tick)
            if tick % PROGRESS_TICKS == 0:
                waiting.content = note(f"{_REPLAYED} {100 * tick // run.log.ticks} %.")

        computed.append(series := replay.series(look))
        done = Done(run.metrics, incidents, series)
        debrief.show(done)
        csv.disabled = False
        waiting.remove()
        with over_time:
            add_series_plots(gui, series, exercise)
        if seen is not None and sights is not None:
            seen.content = _photographs_html(state.photographs) + _seen_html(sights.seen)
        expert = _expert(run, state)
        if expert is None:
            return
        best = Done(expert.run.metrics, expert.incidents, NO_SERIES)
        if exercise is not None and isinstance(exercise.goal, FreeLength):
            beside = state.replay_of(expert.run, vertices=FEW).series()
            best = best._replace(series=beside)
        experts.append(expert)
        debrief.show(done, best)
        compared.content = measures(best.metrics)
        show_me.label, show_me.disabled = SHOW, False

    def follow_until_closed() -> None:
        try:
            follow()
        except _ClosedError:
            pass
        except RuntimeError:  # viser changes no widget that was removed meanwhile
            if not closed.is_set():
                raise

    state.when_free(state.workers.results, (id(state), "result"), follow_until_closed)
