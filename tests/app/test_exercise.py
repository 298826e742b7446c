"""Exercises: what passes, what does not and why; numbers that scale with the duct's break."""

import msgspec
import pytest
from simulated import SECONDS, phantom, settle

from app.simulation.clock import TICK_SECONDS
from app.simulation.exercise import ApproachBreak, Exercise, GentleDissection, HoldStretch
from app.simulation.feedback import Feedback, feedback_visible
from app.simulation.preset import preset_named, presets
from app.simulation.session import Session
from app.simulation.trial import Figures, Trial, trial_of

HOLD = HoldStretch(deflection_mm=5.0, tolerance_mm=0.5, seconds=0.2, force_limit_N=1.0)
APPROACH = ApproachBreak(margin=0.2, seconds=0.1)
GENTLE = GentleDissection(product_limit_N_s=2.0)


def figures(
    *,
    force: float = 0.5,
    deflection: float = 5.0,
    distance: float = 0.5,
    product: float = 1.0,
    held: bool = True,
    torn: bool = False,
) -> Figures:
    return Figures(force, deflection, distance, product, held, torn)


def taken(exercise: Exercise, *series: Figures) -> Trial:
    trial = trial_of(exercise)
    for each in series:
        trial.take(each)
    return trial


def test_a_hold_counts_only_unbroken_time_in_the_band() -> None:
    there, off = figures(), figures(deflection=5.51)
    assert taken(HOLD, *[there] * 5).outcome is None
    assert taken(HOLD, *[there] * 3).progress == pytest.approx(0.5)
    outcome = taken(HOLD, *[there] * 6).outcome
    assert outcome is not None
    assert outcome.passed
    assert "5.0 mm" in outcome.reason
    assert taken(HOLD, *[there] * 5, off, *[there] * 5).outcome is None
    assert taken(HOLD, *[there] * 5, figures(held=False), *[there] * 5).outcome is None
    assert taken(HOLD, *[figures(deflection=4.5)] * 6).outcome is not None


def test_a_hold_fails_by_force_by_a_tear_and_by_time() -> None:
    forced = taken(HOLD, figures(force=1.0), figures(force=1.001)).outcome
    assert forced is not None
    assert not forced.passed
    assert "past 1 N" in forced.reason
    torn = taken(HOLD, figures(force=3.0, torn=True)).outcome
    assert torn is not None
    assert "tore at 3 N" in torn.reason
    late = taken(HOLD, *[figures(deflection=0.0)] * round(60.0 / TICK_SECONDS)).outcome
    assert late is not None
    assert not late.passed
    assert "60 s" in late.reason


def test_an_approach_passes_at_the_margin_and_fails_with_a_tear() -> None:
    assert taken(APPROACH, *[figures(distance=0.21)] * 30).outcome is None
    near = taken(APPROACH, *[figures(distance=0.2)] * 3)
    assert near.outcome is not None
    assert near.outcome.passed
    assert "20.0 %" in near.outcome.reason
    assert taken(APPROACH, figures(distance=0.6)).progress == pytest.approx(0.25)
    torn = taken(APPROACH, *[figures(distance=0.1)] * 2, figures(distance=0.0, torn=True)).outcome
    assert torn is not None
    assert not torn.passed


def test_a_gentle_dissection_is_judged_by_its_force_time_product() -> None:
    passed = taken(GENTLE, figures(), figures(product=1.999, torn=True)).outcome
    assert passed is not None
    assert passed.passed
    assert "2 N s" in passed.reason
    for late in (figures(product=2.001), figures(product=2.001, torn=True)):
        failed = taken(GENTLE, late).outcome
        assert failed is not None
        assert not failed.passed


def test_what_comes_after_the_outcome_changes_nothing() -> None:
    trial = taken(GENTLE, figures(torn=True))
    before = trial.outcome
    trial.take(figures(product=100.0))
    assert trial.outcome is before


def test_every_reason_is_one_sentence_and_every_exercise_says_what_to_do() -> None:
    for exercise in (HOLD, APPROACH, GENTLE):
        for text in (exercise.goal, exercise.limit):
            assert text.endswith(".")
            assert text.count(". ") == 0
        assert exercise.title


def test_continuous_feedback_is_always_there_and_a_summary_only_at_the_end() -> None:
    for seconds in (0.0, 10.0, 1e4):
        assert feedback_visible(Feedback.CONTINUOUS, seconds, over=False)
        assert not feedback_visible(Feedback.SUMMARY, seconds, over=False)
        assert feedback_visible(Feedback.SUMMARY, seconds, over=True)


def test_fading_feedback_is_seen_for_ever_less_of_the_time() -> None:
    def share(start: int) -> float:
        ticks = range(start * 30, (start + 3) * 30)
        return sum(feedback_visible(Feedback.FADING, t / 30.0, over=False) for t in ticks) / 90

    shares = [share(start) for start in range(0, 33, 3)]
    assert shares == pytest.approx([1.0 - 0.1 * n for n in range(11)], abs=0.02)
    assert feedback_visible(Feedback.FADING, 100.0, over=True)


# With the whole session under them: every preset's exercises can be passed, and failed.


def exercises(session: Session) -> tuple[HoldStretch, ApproachBreak, GentleDissection]:
    hold, approach, gentle = session.exercises_offered()
    assert isinstance(hold, HoldStretch)
    assert isinstance(approach, ApproachBreak)
    assert isinstance(gentle, GentleDissection)
    return hold, approach, gentle


def go(session: Session, *, most_seconds: float = 70.0) -> None:
    for _ in range(round(most_seconds / SECONDS)):
        if session.run.over:
            return
        session.advance()
    raise AssertionError("the exercise does not end")


@pytest.mark.parametrize("name", list(presets()))
def test_every_preset_s_exercises_can_be_passed(name: str) -> None:
    session = Session(phantom(), preset_named(name), vertices=300)
    hold, approach, gentle = exercises(session)
    event = session.reading().breaks_at
    assert event is not None
    assert hold.deflection_mm == pytest.approx(0.6 * event.deflection)
    assert hold.force_limit_N < event.force

    session.start_exercise(hold)
    session.grab(session.grasp)
    session.hand_to(hold.deflection_mm)
    go(session)
    assert session.run.outcome is not None
    assert session.run.outcome.passed, session.run.outcome.reason
    assert session.run.progress == 1.0
    assert session.measures().maximum_force_N <= hold.force_limit_N
    assert session.measures().task_threshold_N == hold.force_limit_N

    session.start_exercise(approach)
    session.set_force(0.97 * event.force)
    go(session)
    assert session.run.outcome is not None
    assert session.run.outcome.passed, session.run.outcome.reason
    assert 0.0 < session.measures().smallest_distance_to_break <= approach.margin

    session.start_exercise(gentle)
    session.set_force(session.force_limit)
    go(session)
    assert session.run.outcome is not None
    assert session.run.outcome.passed, session.run.outcome.reason
    assert session.measures().tear is not None
    assert session.measures().force_time_product_N_s <= gentle.product_limit_N_s
    settle(session)


def test_an_exercise_is_failed_by_what_it_forbids() -> None:
    session = Session(phantom(), vertices=300)
    hold, approach, gentle = exercises(session)

    session.start_exercise(hold, Feedback.SUMMARY)
    session.grab(session.grasp)
    session.hand_to(1.4 * hold.deflection_mm)
    assert not session.run.feedback_visible
    go(session)
    assert session.run.outcome is not None
    assert not session.run.outcome.passed
    assert session.run.feedback_visible

    session.start_exercise(approach)
    session.set_force(session.force_limit)
    go(session)
    assert session.run.outcome is not None
    assert "tore" in session.run.outcome.reason
    settle(session)

    session.start_exercise(gentle)
    session.set_force(0.9 * session.force_limit / 1.5)
    go(session)
    assert session.run.outcome is not None
    assert not session.run.outcome.passed
    session.reset()
    assert session.run.exercise is None
    assert session.run.outcome is None


def test_an_exercise_s_clock_waits_for_the_first_pull() -> None:
    session = Session(phantom(), vertices=300)
    session.start_exercise(exercises(session)[1])
    session.advance(300)
    assert session.run.seconds == 0.0
    session.set_force(1.0)
    session.advance(30)
    assert session.run.seconds == pytest.approx(1.0)
    assert session.run.progress > 0.0


def test_an_exercise_keeps_its_numbers_and_its_grasp_wherever_the_hand_takes_hold() -> None:
    session = Session(phantom(), vertices=300)
    hold, *_ = offered = exercises(session)
    middle = session.grasp
    for place in (middle + 8.0, middle - 5.0):
        session.start_exercise(hold)
        session.grab(place)
        session.hand_to(hold.deflection_mm)
        go(session)
        assert session.grasp == place
        assert session.task_grasp == middle
        assert session.exercises_offered() == offered  # the same task as before
    session.let_go()
    settle(session)
    assert session.exercises_offered() == offered
    session.reset()
    assert session.grasp == session.task_grasp == middle
    # A grasp that is asked for after the result is the next exercise's.
    session.start_exercise(hold)
    session.grab(middle + 8.0)
    session.finish()
    session.set_grasp(12.0)
    assert session.task_grasp == 12.0
    assert session.exercises_offered() != offered
    session.reset()
    assert session.grasp == 12.0
    # That of an earlier run can be started from again.
    session.start_exercise(hold, grasp=middle)
    assert session.grasp == session.task_grasp == middle


@pytest.mark.parametrize(
    ("exercise", "changes"),
    [
        (HOLD, {"deflection_mm": 0.0}),
        (HOLD, {"force_limit_N": float("inf")}),
        (HOLD, {"seconds": 61.0}),
        (HOLD, {"time_limit_s": 1e9}),
        (APPROACH, {"margin": 1.0}),
        (APPROACH, {"seconds": -1.0}),
        (GENTLE, {"product_limit_N_s": float("nan")}),
        (GENTLE, {"time_limit_s": 0.0}),
    ],
)
def test_exercises_that_nobody_can_do_are_refused(
    exercise: Exercise, changes: dict[str, float]
) -> None:
    (name,) = changes
    named = "seconds" if name == "time_limit_s" else name
    with pytest.raises(ValueError, match=f"{named} must be"):
        type(exercise)(**{**msgspec.structs.asdict(exercise), **changes})
