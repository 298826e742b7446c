"""Exercises in a bed: offered with limits from the duct and the bed, passed by good hands only."""

import re
from typing import Any

import msgspec
import numpy as np
import pytest
from simulated import bed_exercises, bed_session, phantom

from app.simulation import (
    MANNERS,
    Exercise,
    FreeLength,
    Limit,
    Opening,
    Replay,
    Session,
    bed_named,
    not_offered,
    perform,
    preset_named,
    read_run,
    renamed_exercise,
    run_json,
)

WHY = {
    ("window", "hasty"): "is enough here",
    ("window", "clumsy"): "is enough here",
    ("follow_front", "hasty"): "Lift at half that speed",
    ("follow_front", "clumsy"): "5 mm behind the front",
    ("follow_front", "sideways"): "degrees off straight up",
    ("free_scar", "hasty"): "the jaws opened at",
    ("free_scar", "clumsy"): "Lift less",
}


def session_in(bed: str, seed: int) -> Session:
    """A session on the shipped duct."""
    return bed_session(phantom(), bed=bed_named(bed), bed_seed=seed, vertices=300)


def offered(session: Session) -> dict[str, Exercise]:
    """The exercises of a session, by name."""
    return {each.name: each for each in bed_exercises(session)}


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, pytest.param(12, marks=pytest.mark.long)])
@pytest.mark.parametrize("bed", ["normal", pytest.param("firm", marks=pytest.mark.long)])
def test_good_hands_pass_and_others_are_told_why_they_fail(bed: str, seed: int) -> None:
    session = session_in(bed, seed)
    assert not_offered(session) == {}
    for name, exercise in offered(session).items():
        for label, technique in MANNERS[exercise.name].items():
            session.start_exercise(exercise)
            perform(session, technique)
            outcome = session.run.outcome
            assert outcome is not None, (name, label)
            if label == "good":
                assert outcome.passed, outcome
                assert session.run.incidents() == []
                assert session.run.progress == 1.0
                measures = session.metrics()
                assert measures["longest_freed_stretch_mm"] <= measures["freed_mm"] + 2.0
            else:
                assert not outcome.passed
                assert WHY[name, label] in outcome.reason
                assert outcome.reason.count(". ") == 1, "what happened, and what to do instead"
                # What fails it is an error that the run has, too.
                assert session.run.incidents()


def test_a_window_is_one_opening() -> None:
    window, front = (
        offered(session_in("firm", 1))[name].goal for name in ("window", "follow_front")
    )
    assert isinstance(window, FreeLength)
    assert isinstance(front, FreeLength)
    assert "in one stretch" in window.words
    two = [(5.0, 13.0), (30.0, 39.0)]
    assert window.freed(two) == pytest.approx(9.0)
    assert front.freed(two) == pytest.approx(17.0)
    assert window.freed([]) == front.freed([(-4.0, -2.0)]) == 0.0


BEFORE = {
    "exercise": "free_stretch", "name": "window", "bed": "firm", "bed_seed": 4,
    "free_mm": 12.7, "from_mm": 0.0, "to_mm": 50.8, "instruments": ["hook", "dissector"],
    "stress_ratio_limit": 0.2, "time_to_break_limit_s": 0.25, "out_of_sight_limit": 15,
    "instrument_force_limit_N": None, "opened_mm": None, "divided": False, "time_limit_s": 120.0,
    "errors": {"stirring": 1},
}  # fmt: skip


def test_an_exercise_in_a_bed_that_was_recorded_before_is_the_same_one() -> None:
    found = msgspec.convert(renamed_exercise(BEFORE), Exercise)
    assert found.goal == FreeLength(12.7, 0.0, 50.8)  # judged by all that is free, as it was
    assert found.opening == Opening("firm", 4)
    assert found.instruments == ("hook", "dissector")
    assert (found.title, found.time_limit_s) == ("Open a window", 120.0)
    assert found.limit_of == {
        "tear": 0, "stirring": 1, "peak_stress_ratio": 0.2, "shortest_time_to_break_s": 0.25,
        "strands_broken_out_of_sight": 15,
    }  # fmt: skip
    older = {key: each for key, each in BEFORE.items() if key != "exercise"}
    older |= {"share_limit": older.pop("stress_ratio_limit"), "name": "follow-front"}
    again = msgspec.convert(renamed_exercise(older), Exercise)
    assert (set(again.limits), again.name) == (set(found.limits), "follow_front")
    assert renamed_exercise(msgspec.to_builtins(found)) == msgspec.to_builtins(found)


def test_an_exercise_made_again_ends_with_the_same_words() -> None:
    session = session_in("firm", 3)
    exercise = offered(session)["follow_front"]
    session.start_exercise(exercise)
    session.choose_instrument(0, "dissector")
    assert not session.run.started, "the exercise is for hooks and graspers"
    perform(session, MANNERS["follow_front"]["clumsy"])
    content = run_json(session.run_file())
    read = read_run(content)
    again = Replay(read.log, phantom(), vertices=300)
    assert run_json(again.run_file()) == content
    found = session.run.incidents()
    assert found[0].error == "behind_front"
    assert again.incidents() == found, "a replay has the errors of its run"
    session.reset()
    assert session.run.exercise is None
    assert session.reading().broken == 0


def test_no_hand_moves_the_duct_in_its_bed_after_the_result() -> None:
    session = session_in("normal", 1)
    session.start_exercise(offered(session)["window"])
    session.move_hand(1, session.spatial.hands[1].place + np.array([0.0, 24.0, 0.0]))
    session.advance(5)
    session.open_jaws(1, 40.0)
    session.finish()  # while the hand and its jaws are under way
    session.advance(30)
    before = session.spatial.beam.places.copy(), session.spatial.hands[1].place.copy()
    broken = session.spatial.broken
    session.move_hand(1, session.spatial.hands[1].place + 10.0)
    session.open_jaws(1, 40.0)
    session.choose_instrument(1, "swab")
    assert session.grab(0, 25.4) is None
    session.advance(60)
    hand = session.spatial.hands[1]
    assert (hand.instrument, hand.opening < 40.0) == ("dissector", True)
    assert hand.place == pytest.approx(before[1], abs=0.0)
    assert session.spatial.beam.places == pytest.approx(before[0], abs=1e-3)
    assert session.spatial.broken == broken
    session.reset()
    assert session.grab(0, 25.4) is not None


def test_an_exercise_begins_with_the_right_instruments_and_says_what_still_holds() -> None:
    session = session_in("normal", 1)
    exercise = offered(session)["window"]
    session.start_exercise(exercise)
    hands = session.spatial.hands
    assert [hand.instrument for hand in hands] == ["hook", "dissector"]
    session.advance(30)
    assert not session.run.started
    # Its jaws part strands without a hold: time runs from the first way of theirs.
    session.move_hand(1, hands[1].place + np.array([0.0, 0.1, 0.0]))
    assert session.run.started
    found: set[str] = set()
    for _ in MANNERS["window"]["good"].inputs(session, exercise):
        session.advance()
        found.add(session.run.standing)
        if session.run.over:
            break
    assert session.run.outcome is not None
    assert session.run.outcome.passed
    words = r"\d+ of 13 mm free in one stretch; \d+ strands hold at \d+ mm"
    assert any(re.fullmatch(words, each) for each in found), found
    run = session.run_file()
    assert Replay(run.log, phantom(), vertices=300).run_file() == run
    with pytest.raises(ValueError, match="in_hand has 'swab', which is none of instruments"):
        msgspec.structs.replace(exercise, instruments=("hook",), in_hand=("swab",))


def test_limits_follow_the_bed_and_not_its_seed() -> None:
    loose, firm, again = (
        offered(session_in(*each)) for each in (("loose", 1), ("firm", 1), ("firm", 9))
    )
    assert (
        loose["window"].limit_of["peak_stress_ratio"] < firm["window"].limit_of["peak_stress_ratio"]
    )
    for name in ("window", "follow_front"):
        assert firm[name].limits == again[name].limits
    scar = loose["free_scar"].opening
    assert scar is not None
    assert scar.bed == "scar"
    # Tougher than the duct: no hook frees it, so none is asked to.
    tough = msgspec.structs.replace(bed_named("inflamed"), name="own", toughness_J_per_m2=200.0)
    session = bed_session(phantom(), bed=tough, vertices=300)
    assert "follow_front" not in offered(session)
    why = not_offered(session)["follow_front"]
    assert "of the break" in why or "good hands do not pass" in why


@pytest.mark.slow
@pytest.mark.parametrize(
    "preset", ["porcine-bile-duct", pytest.param("thesis-rubber", marks=pytest.mark.long)]
)
def test_another_duct_has_exercises_of_its_own(preset: str) -> None:
    session = bed_session(phantom(), preset_named(preset), vertices=300)
    found = offered(session)
    assert "window" in found
    for exercise in found.values():
        session.start_exercise(exercise)
        perform(session, MANNERS[exercise.name]["good"])
        outcome = session.run.outcome
        assert outcome is not None
        assert outcome.passed, (exercise.name, outcome)


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"goal": {"from_mm": 40.0}}, "from_mm and to_mm must rise"),
        ({"goal": {"length_mm": 60.0}}, "length_mm must be above 0"),
        ({"limits": [{"of": "peak_stress_ratio", "value": 1.5}]}, "above 0 and below 1"),
        ({"limits": [{"of": "shortest_time_to_break_s", "value": -1.0}]}, "0 or more and finite"),
        ({"limits": [{"of": "maximum_instrument_force_N", "value": 0.0}]}, "above 0 N"),
        ({"limits": [{"of": "haste", "value": 0}]}, "'haste' is no metric and no class of errors"),
        ({"limits": [{"of": "stirring", "value": -1}]}, "stirring must be 0 or more incidents"),
        ({"limits": [{"of": "stirring", "value": 0.5}]}, "stirring must be 0 or more incidents"),
        ({"opening": {"opened_mm": [9.0, 3.0]}}, "opened_mm must rise"),
        ({"time_limit_s": 1e9}, "time_limit_s must be at most"),
    ],
)
def test_an_exercise_that_makes_no_sense_is_refused(changed: dict[str, Any], words: str) -> None:
    exercise = Exercise(
        "window", "Open a window", FreeLength(12.0, 10.0, 40.0),
        limits=(Limit("peak_stress_ratio", 0.2),), opening=Opening("normal", 1),
    )  # fmt: skip
    plain = msgspec.to_builtins(exercise)
    for key, each in changed.items():
        plain[key] = plain[key] | each if isinstance(each, dict) else each
    with pytest.raises(msgspec.ValidationError, match=words):
        msgspec.convert(plain, Exercise)
