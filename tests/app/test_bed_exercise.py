"""Exercises in a bed: offered with limits from the duct and the bed, passed by good hands only."""

import msgspec
import pytest
from simulated import bed_exercises, bed_session, phantom

from app.simulation import (
    MANNERS,
    BedExercise,
    BedManner,
    Replay,
    Session,
    bed_named,
    preset_named,
    read_run,
    run_json,
    script,
)

WHY = {
    ("window", "hasty"): "is enough here",
    ("window", "clumsy"): "is enough here",
    ("follow_front", "hasty"): "Lift at half that speed",
    ("follow_front", "clumsy"): "5 mm behind the front",
    ("follow_front", "sideways"): "degrees off straight up",
    ("free_scar", "hasty"): "while nothing held the duct up",
    ("free_scar", "clumsy"): "Lift less",
}


def session_in(bed: str, seed: int) -> Session:
    """A session on the shipped duct."""
    return bed_session(phantom(), bed=bed_named(bed), bed_seed=seed, vertices=300)


def offered(session: Session) -> dict[str, BedExercise]:
    """The exercises of a session, by name."""
    return {each.name: each for each in bed_exercises(session)}


def do(session: Session, manner: BedManner) -> None:
    """Do the exercise that was started with scripted hands."""
    exercise = session.bed_exercise
    assert exercise is not None
    for _ in script(session, session.spatial, exercise, manner):
        session.advance()
        if session.run.over:
            return


@pytest.mark.parametrize("seed", [1, 12])
@pytest.mark.parametrize("bed", ["normal", "firm"])
def test_good_hands_pass_and_others_are_told_why_they_fail(bed: str, seed: int) -> None:
    session = session_in(bed, seed)
    for name, exercise in offered(session).items():
        for label, manner in MANNERS[exercise.name].items():
            session.start_exercise(exercise)
            do(session, manner)
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
    window, front = (offered(session_in("firm", 1))[name] for name in ("window", "follow_front"))
    assert "in one stretch" in window.goal
    two = [(5.0, 13.0), (30.0, 39.0)]
    assert window.freed(two) == pytest.approx(9.0)
    assert front.freed(two) == pytest.approx(17.0)
    assert window.freed([]) == front.freed([(-4.0, -2.0)]) == 0.0
    # Runs recorded before were judged by all that was free, and still are.
    before = msgspec.to_builtins(window)
    del before["one_stretch"]
    assert msgspec.convert(before, BedExercise).freed(two) == pytest.approx(17.0)


def test_an_exercise_made_again_ends_with_the_same_words() -> None:
    session = session_in("firm", 3)
    exercise = offered(session)["follow_front"]
    session.start_exercise(exercise)
    session.choose_instrument(0, "dissector")
    assert not session.run.started, "the exercise is for hooks and graspers"
    do(session, MANNERS["follow_front"]["clumsy"])
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


def test_limits_follow_the_bed_and_not_its_seed() -> None:
    loose, firm, again = (
        offered(session_in(*each)) for each in (("loose", 1), ("firm", 1), ("firm", 9))
    )
    assert loose["window"].stress_ratio_limit < firm["window"].stress_ratio_limit
    for name in ("window", "follow_front"):
        assert firm[name].limits == again[name].limits
    assert loose["free_scar"].bed == "scar"
    # Tougher than the duct: no hook frees it, so none is asked to.
    tough = msgspec.structs.replace(bed_named("inflamed"), name="own", toughness_J_m2=200.0)
    session = bed_session(phantom(), bed=tough, vertices=300)
    assert "follow_front" not in offered(session)


@pytest.mark.parametrize("preset", ["porcine-bile-duct", "thesis-rubber"])
def test_another_duct_has_exercises_of_its_own(preset: str) -> None:
    session = bed_session(phantom(), preset_named(preset), vertices=300)
    found = offered(session)
    assert "window" in found
    for exercise in found.values():
        session.start_exercise(exercise)
        do(session, MANNERS[exercise.name]["good"])
        outcome = session.run.outcome
        assert outcome is not None
        assert outcome.passed, (exercise.name, outcome)


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"from_mm": 40.0}, "must rise"),
        ({"free_mm": 60.0}, "free_mm must be above 0"),
        ({"stress_ratio_limit": 1.5}, "stress_ratio_limit must be above 0 and below 1"),
        ({"time_to_break_limit_s": -1.0}, "time_to_break_limit_s must be 0 or more"),
        ({"instrument_force_limit_N": 0.0}, "instrument_force_limit_N must be above 0"),
        ({"errors": {"haste": 0}}, "errors has 'haste', which is no class of errors; there are: "),
        ({"errors": {"stirring": -1}}, "errors.stirring must be 0 or more incidents"),
        ({"out_of_sight_limit": -1}, "out_of_sight_limit must be 0 or more"),
        ({"opened_mm": (9.0, 3.0)}, "opened_mm must rise"),
        ({"time_limit_s": 1e9}, "time_limit_s must be above 0 and at most"),
    ],
)
def test_an_exercise_that_makes_no_sense_is_refused(changed: dict[str, object], words: str) -> None:
    exercise = BedExercise(
        name="window",
        bed="normal",
        bed_seed=1,
        free_mm=12.0,
        from_mm=10.0,
        to_mm=40.0,
        instruments=("hook",),
        stress_ratio_limit=0.2,
        time_to_break_limit_s=0.25,
        out_of_sight_limit=5,
    )
    with pytest.raises(ValueError, match=words):
        msgspec.structs.replace(exercise, **changed)
