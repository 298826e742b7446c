"""*Who is who*: pictures of anatomies whose structures are named, or left unnamed."""

import msgspec
import numpy as np
import pytest

from app.anatomy import drawn_anatomy
from app.simulation import (
    FEW,
    STRUCTURES,
    Exercise,
    Outcome,
    Replay,
    Safety,
    Session,
    Specimen,
    exercise_at,
    read_run,
    run_json,
)
from app.simulation.exercises.exercise import Opening
from app.trainer.client.picture_series import PICTURES, PictureSeries

SHORT, TRAP, PARALLEL, DOUBLE, COVERED = 20, 41, 14, 32, 12


def picture(seed: int) -> tuple[Session, Exercise]:
    """A session that shows a picture."""
    anatomy = drawn_anatomy(seed)
    session = Session(Specimen.of_anatomy(anatomy), vertices=FEW)
    exercise = exercise_at(anatomy, "who_is_who")
    assert exercise is not None
    session.start_exercise(exercise)
    return session, exercise


def answered(session: Session, *tubes: str) -> str:
    """Name the cystic duct, the artery and the common duct, or nothing; why it ended so."""
    if not tubes:
        session.call_unsafe()
    names = session.spatial.tubes.names
    for structure, tube in zip(STRUCTURES, tubes, strict=False):
        assert session.mark(structure, names.index(tube), 5.0)
    session.advance()
    outcome = session.run.outcome
    assert outcome is not None
    return f"{'right' if outcome.passed else 'wrong'}: {outcome.reason}"


def test_the_pictures_have_three_stages_and_the_traps() -> None:
    points: dict[int, int] = {}
    for seed in PICTURES:
        session, exercise = picture(seed)
        safety = Safety(session.spatial)
        view = safety.critical_view()
        points[seed] = view.total
        assert view.torn == ()
        assert session.spatial.stress_ratio < 0.9
        opening = exercise.opening
        assert opening is not None
        assert (view.total >= 5) == (opening.exposed == 1.0)
        if seed == SHORT:
            assert session.spatial.tubes.network.tubes[safety.cystic].span < 8.0
        if seed == TRAP:
            assert safety.tenting().diameters > 0.5
        if seed == PARALLEL:
            assert safety.tenting().cystic_deg < 30.0
        if seed == DOUBLE:
            assert safety.tubes_of["cystic artery"] == {"artery", "artery2"}
    assert sum(each >= 5 for each in points.values()) == 5
    assert sum(each <= 1 for each in points.values()) == 2


def test_what_was_taken_for_what_is_told_and_replayed() -> None:
    session, exercise = picture(SHORT)
    assert session.grab(0, 5.0) is None
    session.move_hand(1, np.zeros(3))
    assert not session.run.started, "no hand moves in it"
    assert answered(session, "cystic", "artery", "common").startswith(
        "right: All three named as what they are, which is safe with 6 of 6 points"
    )
    session.start_exercise(exercise)
    reason = answered(session, "common", "artery", "common")
    assert reason.startswith("wrong: At 0.0 s you took the common duct for the cystic duct.")
    kept = read_run(run_json(session.run_file()))
    again = Replay(kept.log, session.spatial.dissection.organ)
    assert kept.agrees_with(again.run_file())
    assert again.incidents() == session.run.incidents()
    assert [each.error for each in again.incidents()] == ["mistaken"]
    session.start_exercise(exercise)
    assert "you called it not yet safe with 6 of 6 points" in answered(session)


def test_either_of_two_arteries_is_the_artery() -> None:
    for artery in ("artery", "artery2"):
        session, _ = picture(DOUBLE)
        assert answered(session, "cystic", artery, "common").startswith("right")


def test_what_is_covered_is_not_to_be_named() -> None:
    session, exercise = picture(COVERED)
    assert answered(session).startswith("right: Not yet safe to tell, with 0 of 6 points")
    session.start_exercise(exercise)
    reason = answered(session, "cystic", "artery", "common")
    assert reason.startswith("wrong: ")
    assert "with 0 of 6 points of the critical view" in reason
    assert {each.error for each in session.run.incidents()} == {"named_unsafe"}


def test_a_series_counts_what_was_right() -> None:
    series = PictureSeries()
    first, other = exercise_at(drawn_anatomy(SHORT), "who_is_who"), None
    series.exercise = first
    series.take(other, Outcome(True, ""))  # of another exercise
    assert series.answers == []
    for number in range(len(PICTURES)):
        assert not series.over
        assert series.seed == PICTURES[number]
        series.exercise = first
        series.take(first, Outcome(number < 7, ""))
    assert series.over
    assert series.score == "7 of 10 pictures right."


def test_an_opening_that_cannot_be_is_refused() -> None:
    for fields in ({"exposed": 1.2}, {"lifted_mm": -1.0}, {"lifted_mm": 99.0}):
        content = msgspec.json.encode({"anatomy": "normal", **fields})
        with pytest.raises(msgspec.ValidationError, match=next(iter(fields))):
            msgspec.json.decode(content, type=Opening)
