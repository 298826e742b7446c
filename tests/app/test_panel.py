"""Parts of the panel without a page: a plot that goes on, exercises, errors and limits."""

import asyncio
import re
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from queue import Queue
from typing import Any
from unittest.mock import MagicMock

import numpy as np
import pytest
import viser
from simulated import bed_session, phantom, pull_session

from app.simulation import ERROR_CLASSES, Incident, Series, Session
from app.trainer.panel.controls import on_work
from app.trainer.panel.debrief import DIGIT, LEFT, MOST_ALIKE, WIDTH, Debrief, Done
from app.trainer.panel.exercise_tab import AWAITED, NONE, ExerciseTab
from app.trainer.panel.force_box import ForceBox
from app.trainer.panel.last_seconds import IDLE_SECONDS, SECONDS, LastSeconds
from app.trainer.panel.measures_table import measures_html


@pytest.fixture
def gui() -> Iterator[viser.GuiApi]:
    server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    yield server.gui
    server.stop()


def stand(session: Session, seconds: float) -> None:
    """Let time go by."""
    for _ in range(round(30 * seconds)):
        session.advance()


def test_slow_work_gets_what_was_chosen_though_the_panel_shows_the_present_value_again(
    gui: viser.GuiApi,
) -> None:
    choice, taken = gui.add_dropdown("Ghost", ("None", "Exact")), Queue[str]()
    on_work(choice, taken.put)
    called: Any = choice._impl.update_cb[0]  # pyright: ignore[reportPrivateUsage]

    async def choose() -> None:
        choice.value = "Exact"
        await called(viser.GuiEvent(MagicMock(), 0, choice))
        choice.value = "None"  # by the panel, before a thread was free

    with ThreadPoolExecutor(1) as thread:  # a browser of other tests has a loop in this one
        thread.submit(lambda: asyncio.run(choose())).result()
    assert taken.get(timeout=60.0) == "Exact"


def test_the_plot_of_a_dissection_goes_on_while_nothing_moves(gui: viser.GuiApi) -> None:
    session = bed_session(phantom(), vertices=300)
    plot = LastSeconds(gui)
    plot.show(session, session.reading(), figures=True)
    assert not plot.needs_redraw(session)  # time has not begun
    place = session.grab(0, 25.4)
    assert place is not None
    session.move_hand(0, place + np.array([0.0, 0.0, 2.0]))
    for _ in range(60):
        session.advance()
        plot.show(session, session.reading(), figures=True)
    stand(session, 1.5 * IDLE_SECONDS)
    assert plot.needs_redraw(session)
    plot.show(session, session.reading(), figures=True)
    assert not plot.needs_redraw(session)
    # What stood still is drawn level until now, not as a slope to what comes next.
    stand(session, 5.0)
    session.move_hand(0, place)
    stand(session, 1.0)
    plot.show(session, session.reading(), figures=True)
    ago, left = plot._chart.data[:2]
    assert ago[-1] == 0.0
    assert left[ago < -0.05][-1] == left[ago < -5.0][-1] > 0.1
    # Lines that are level from edge to edge need no more points.
    stand(session, SECONDS + 5.0)
    for _ in range(2):
        plot.show(session, session.reading(), figures=True)
        stand(session, SECONDS + 5.0)
    assert not plot.needs_redraw(session)


def test_no_duct_is_called_unbreakable_before_its_exercises_are_known() -> None:
    gui, state = MagicMock(), MagicMock(in_exercise=False)
    choice, start = gui.add_dropdown.return_value, gui.add_button.return_value
    ExerciseTab(gui, state, MagicMock())
    assert gui.add_dropdown.call_args_list[0].args[1] == [AWAITED]
    assert gui.add_button.call_args_list[0].kwargs["disabled"] is True
    specimen = state.session.specimen
    specimen.anatomy = specimen.bed = specimen.theory = None
    find = state.when_free.call_args.args[2]
    find()
    assert choice.options == (NONE,)
    assert start.disabled is True


def test_a_limit_of_what_is_counted_is_told_as_a_count() -> None:
    session = bed_session(phantom(), vertices=300)
    session.grab(0, 25.4)
    stand(session, 0.1)
    session.finish()
    measures: Any = session.run_file().metrics
    table = measures_html(measures, {}, {"strands_broken_out_of_sight": 15.0})
    assert "'>15</td>" in table


def test_errors_are_numbered_where_there_is_room_beside_their_marks(gui: viser.GuiApi) -> None:
    """No number lies on a mark or on another, or is cut off at the picture's edge."""
    play = MagicMock()
    debrief = Debrief(gui, None, "", {}, play, play, decided=None, in_space=True)
    found = [
        Incident("repeated_holds", start, end, hand, 0, 20.0, "none", {"holds": 3.0, "at_mm": 20.0})
        for start, end, hand in (
            (10.0, 10.0, 0), (10.2, 10.2, 0), (10.4, 10.4, 1), (500.0, 520.0, 0), (560.0, 640.0, 0),
            (1160.0, 1167.0, 0),
        )
    ]  # fmt: skip
    metrics: Any = {"time_s": 1167.2, "smallest_distance_to_break": 0.5}
    debrief.show(Done(metrics, found, Series((), ())))
    drawn = str(debrief._html.content)
    pattern = (
        r"<rect x='([\d.]+)' y='([\d.]+)' width='([\d.]+)'[^>]*/>"
        r"(?:<text x='([\d.]+)'[^>]*>(\d+)</text>)?</g>"
    )
    marks = re.findall(pattern, drawn)
    # The other hand has a row of its own.
    assert [number for *_, number in marks] == ["1", "", "3", "4", "5", "6"]
    bars = [(row, float(x), float(x) + float(wide)) for x, row, wide, *_ in marks]
    numbers = [(row, float(at), float(at) + DIGIT) for _, row, _, at, number in marks if number]
    for row, low, high in numbers:
        assert LEFT <= low < high <= WIDTH
        assert all(high <= x or low >= end for other, x, end in bars if other == row)
    for (row, _, high), (other, low, _) in pairwise(sorted(numbers)):
        assert row != other or high <= low
    assert ">1,167</text>" in drawn


def test_an_error_of_no_hand_stands_across_the_rows_of_both(gui: viser.GuiApi) -> None:
    """Its number lies on no mark of a hand."""
    play = MagicMock()
    values: Any = {"holds": 3.0, "at_mm": 20.0}
    debrief = Debrief(gui, None, "", {}, play, play, decided=None, in_space=True)
    metrics: Any = {"time_s": 10.0, "smallest_distance_to_break": 0.5}
    found = [
        Incident("repeated_holds", at, at, hand, 0, 20.0, "none", values)
        for at, hand in ((2.0, 0), (4.0, 1), (6.0, None))
    ]
    debrief.show(Done(metrics, found, Series((), ())))
    drawn = str(debrief._html.content)
    marks = re.findall(r"<rect x='[\d.]+' y='([\d.]+)' width='[\d.]+' height='([\d.]+)'", drawn)
    (left, tall), (right, same), (top, both) = [(float(y), float(high)) for y, high in marks]
    assert tall == same
    assert (top, top + both) == (left, right + tall)
    assert "Across both: what no hand alone has made." in drawn


def test_a_hundred_errors_of_one_class_hide_no_others(gui: viser.GuiApi) -> None:
    """A few of each class are listed, and how many more there are of which."""
    play = MagicMock()
    debrief = Debrief(gui, None, "", {}, play, play, decided=None, in_space=True)

    def made(error: str, at: float) -> Incident:
        values: Any = {"holds": 3.0, "at_mm": 20.0, "name": "cystic duct", "by": ""}
        return Incident(error, at, at, 0, 0, 20.0, "none", values)

    found = [made("repeated_holds", float(each)) for each in range(100)]
    found += [made("tear", 40.0), made("tear", 50.0)]
    metrics: Any = {"time_s": 120.0, "smallest_distance_to_break": 0.5}
    debrief.show(Done(metrics, found, Series((), ())))
    drawn = str(debrief._html.content)
    title = ERROR_CLASSES["repeated_holds"].title
    assert drawn.count("data-testid='error'") == MOST_ALIKE + 2
    assert drawn.count(f". {title}, ") == MOST_ALIKE
    assert f"And 97 more, which a replay shows: {title}, 97." in drawn
    assert f". {ERROR_CLASSES['tear'].title}, 40.0 s" in drawn


def test_a_force_that_a_page_has_set_is_not_set_back_before_it_is_taken(gui: viser.GuiApi) -> None:
    session, state = pull_session(phantom()), MagicMock()
    state.session, state.playback, state.pulls = session, None, 0
    box = ForceBox(gui, state)
    slider = box._force
    box.show(session.reading())
    slider._impl.value = 2.0  # by viser, which calls back next
    state.pulls += 1  # and something else gives reason to set the sliders
    box.show(session.reading())
    assert slider.value == 2.0
    box._take_force(2.0)
    state.set_target_force.assert_called_once_with(2.0)
    session.set_target_force(2.0)
    box.show(session.reading())
    assert slider.value == 2.0
    grasp = box._grasp
    grasp._impl.value = 30.0
    state.pulls += 1
    box.show(session.reading())
    assert grasp.value == 30.0
    box._take_grasp(30.0)
    assert session.planar.grasp == 30.0
    # What is not taken, as of a slider that is disabled, is set back.
    slider._impl.value = 3.0
    state.pulls += 1
    box.show(session.reading())
    box.show(session.reading())
    assert slider.value == 2.0
