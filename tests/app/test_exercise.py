"""Exercises: what passes, what does not and why; numbers that scale with the duct's break."""

from functools import cache
from typing import NamedTuple

import msgspec
import pytest
from simulated import phantom, pull_session, replayed, settle

from app.simulation import (
    CAREFUL,
    TICK_SECONDS,
    Exercise,
    Feedback,
    Limit,
    Session,
    Stay,
    exercises_offered,
    perform,
    preset_named,
    presets,
    read_run,
    renamed_exercise,
    run_json,
)
from app.simulation.exercises.attempt import Attempt
from app.simulation.exercises.exercise import feedback_visible
from app.simulation.scripts.scripted_hands import CLUMSY, HASTY, Reach
from app.simulation.session.measures import PullMetrics, PullRecorder
from organ_geometry.organ import Organ
from physics import BreakEvent, Exact, RuptureCheck, TautString, Theory

TEARS = Limit("tear", 0)
HOLD = Exercise(
    "hold_stretch", "Hold", Stay("deflection_mm", 4.5, 5.5, 0.2),
    limits=(TEARS, Limit("maximum_force_N", 1.0)),
)  # fmt: skip
APPROACH = Exercise(
    "approach_break", "Approach", Stay("distance_to_break", 0.0, 0.2, 0.1), limits=(TEARS,)
)
GENTLE = Exercise(
    "gentle_lifts", "Dissect gently",
    Stay("deflection_mm", 4.5, 5.5, 0.1, repeats=2, return_below=1.25),
    limits=(
        TEARS, Limit("maximum_force_N", 1.0), Limit("smallest_distance_to_break", 0.25),
        Limit("overshoot", 0.3), Limit("maximum_loading_rate_N_per_s", 8.0),
        Limit("mean_absolute_nonzero_force_N", 0.6, at_end=True),
    ),
    time_limit_s=90.0,
)  # fmt: skip


TEAR = BreakEvent(0.5, 5.0, RuptureCheck(25.4, 1, 0.1, 0.2, 0.3))


class Tick(NamedTuple):
    """One tick of a made-up run."""

    force: float = 0.5
    deflection: float = 5.0
    distance: float = 0.5
    held: bool = True
    torn: bool = False
    elsewhere: bool = False  # whether it is held at another place than before


UP, DOWN = [Tick(0.1, 1.0), Tick(0.3, 3.0), *[Tick()] * 3], [Tick(0.3, 3.0), Tick(0.1, 1.0)]


class MadeUpRecorder(PullMetrics):
    """Takes ticks that are made up."""

    start = PullRecorder.start
    take = PullRecorder.take


def taken(exercise: Exercise, *series: Tick) -> Attempt:
    """An attempt at an exercise after a made-up run, with the measures that it has."""
    recorder = MadeUpRecorder(1.0, exercise.goal.band)
    attempt = Attempt(exercise, recorder)  # pyright: ignore[reportArgumentType]
    for each in series:
        if each.elsewhere:
            recorder.regrasp()
        recorder.add(
            each.force,
            (0.0, 0.0, each.deflection),
            each.distance,
            held=each.held,
            deflection=each.deflection,
        )
        if each.torn:
            recorder.tear(TEAR)
        attempt.take()
    return attempt


def test_a_hold_counts_only_unbroken_time_in_the_band() -> None:
    there, off = Tick(), Tick(deflection=5.51)
    assert taken(HOLD, *[there] * 5).outcome is None
    half = taken(HOLD, *[there] * 3)
    assert half.progress == pytest.approx(0.75)
    assert half.standing == "keep it, 0.1 s to go"
    assert taken(HOLD, *[there] * 3, off).standing == "into the band"
    outcome = taken(HOLD, *[there] * 6).outcome
    assert outcome is not None
    assert outcome.passed
    assert (
        outcome.reason == "Kept there for 0.2 s, with at most 0.5 N and 50.0 % left to the break."
    )
    assert taken(HOLD, *[there] * 5, off, *[there] * 5).outcome is None
    assert taken(HOLD, *[there] * 5, Tick(held=False), *[there] * 5).outcome is None
    assert taken(HOLD, *[Tick(deflection=4.5)] * 6).outcome is not None
    # Another hold leads it there anew: elsewhere it has another deflection, and nothing moved.
    elsewhere = taken(HOLD, *[there] * 5, Tick(elsewhere=True), *[there] * 9)
    assert elsewhere.outcome is None
    assert elsewhere.standing == "out of the band, and into it with this hold"
    again = [off, *[there] * 5]
    assert taken(HOLD, there, Tick(elsewhere=True), *again).outcome is None
    assert taken(HOLD, there, Tick(elsewhere=True), *again, there).outcome is not None


def test_a_hold_fails_by_force_by_a_tear_and_by_time() -> None:
    forced = taken(HOLD, Tick(force=1.0), Tick(force=1.001)).outcome
    assert forced is not None
    assert not forced.passed
    assert "past 1 N" in forced.reason
    torn = taken(HOLD, Tick(force=3.0, torn=True)).outcome
    assert torn is not None
    assert "the duct tore at 25 mm" in torn.reason
    late = taken(HOLD, *[Tick(deflection=0.0)] * round(60.0 / TICK_SECONDS)).outcome
    assert late is not None
    assert not late.passed
    assert late.reason == "The 60 s were over with it held 0.0 of 0.2 s."


def test_an_approach_passes_at_the_margin_and_fails_with_a_tear() -> None:
    assert taken(APPROACH, *[Tick(distance=0.21)] * 30).outcome is None
    near = taken(APPROACH, *[Tick(distance=0.2)] * 3)
    assert near.outcome is not None
    assert near.outcome.passed
    assert "20.0 %" in near.outcome.reason
    assert taken(APPROACH, Tick(distance=0.6)).progress == pytest.approx(0.25)
    torn = taken(APPROACH, *[Tick(distance=0.1)] * 2, Tick(distance=0.0, torn=True)).outcome
    assert torn is not None
    assert not torn.passed


def test_a_gentle_dissection_is_lifted_held_and_led_back_as_often_as_it_says() -> None:
    once = taken(GENTLE, *UP, *DOWN)
    assert once.outcome is None
    assert once.progress == pytest.approx(0.5)
    assert once.standing.startswith("Lift 2 of 2")
    assert taken(GENTLE, *UP).standing == "Lift 1 of 2: lead it back"
    twice = taken(GENTLE, *UP, *DOWN, *UP, *DOWN)
    assert twice.outcome is not None
    assert twice.outcome.passed
    assert twice.progress == 1.0
    # Two ticks in the band are too few, and what springs back was not led.
    short = [Tick(0.1, 1.0), Tick(0.3, 3.0), *[Tick()] * 2, *DOWN]
    assert taken(GENTLE, *short, *short, *UP, *DOWN).outcome is None
    slipped = [*UP, Tick(0.0, 3.0, held=False), Tick(0.0, 0.0, held=False)]
    assert taken(GENTLE, *slipped, *slipped, *UP, *DOWN).outcome is None
    # Nor is what is held elsewhere, where it is deflected less.
    aside = [*UP, Tick(0.1, 1.0, elsewhere=True), Tick(elsewhere=True)]
    assert taken(GENTLE, *aside, *aside, *UP, *DOWN).progress == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("reason", "run"),
    [
        ("The force reached 1.1 N, past 1 N", [*UP, Tick(0.8), Tick(1.1)]),
        ("The distance to break fell to 20 %, below 25 %", [*UP, Tick(0.6, 5.0, 0.2)]),
        ("It went 40 % past the goal, more than 30 %", [*UP, Tick(0.7, 6.5), Tick(0.9, 7.5)]),
        ("It was loaded by 9 N/s, faster than 8 N/s", [Tick(0.0, 0.0), Tick(0.9, 5.0)]),
        (
            "The mean force was 0.73 N, past 0.6 N.",
            [*UP, *[Tick(0.8)] * 40, *DOWN, *UP, *[Tick(0.8)] * 40, *DOWN],
        ),
        ("At 0.2 s the duct tore at 25 mm", [*UP, Tick(0.9, torn=True)]),
        ("The 90 s were over with 0 of 2 lifts done.", [Tick(0.1, 1.0)] * (90 * 30)),
    ],
)
def test_a_gentle_dissection_is_failed_by_each_of_its_limits_alone(
    reason: str, run: list[Tick]
) -> None:
    outcome = taken(GENTLE, *run).outcome
    assert outcome is not None
    assert not outcome.passed
    assert outcome.reason.startswith(reason)  # an error of the last second follows a colon


def test_a_failure_is_put_down_to_the_error_of_the_last_second() -> None:
    still = [Tick(0.1, 1.0, 0.9)] * 40
    slow, fast = (
        taken(HOLD, *still, *[Tick(0.1 + 0.9 * t / n, 1.0 + t / n, 0.9 - 0.5 * t / n)
                              for t in range(1, n + 1)], Tick(1.1, 2.0, 0.4)).outcome
        for n in (60, 3)
    )  # fmt: skip
    assert slow is not None
    assert slow.reason == "The force reached 1.1 N, past 1 N."
    assert fast is not None
    assert fast.reason.startswith("The force reached 1.1 N, past 1 N: at 1.4 s you pulled at ")
    assert fast.reason.endswith("Lift at half that speed, and slower still near the break.")
    gentle = HOLD.with_limits({"fast_pull": 0})
    assert gentle.errors == {"tear": 0, "fast_pull": 0}
    named = taken(gentle, *still, Tick(0.9, 2.0, 0.4)).outcome
    assert named is not None
    assert named.reason.startswith("At 1.4 s you pulled at "), "an error may fail a pull by itself"


def older(**fields: object) -> Exercise:
    return msgspec.convert(renamed_exercise(fields), Exercise)


IMPULSE = older(exercise="gentle-dissection", product_limit_N_s=2.0, time_limit_s=60.0)


def test_an_impulse_of_a_run_of_version_1_is_judged_as_it_was() -> None:
    under, over = [Tick(1.0)] * 59, [Tick(1.0)] * 61
    passed = taken(IMPULSE, *under, Tick(1.0, torn=True)).outcome
    assert passed is not None
    assert passed.passed
    assert "2 N s" in passed.reason
    failed = taken(IMPULSE, *over).outcome
    assert failed is not None
    assert not failed.passed
    assert failed.reason.startswith("2.03 N s was spent, more than 2 N s")


def test_exercises_of_a_pull_that_were_recorded_before_are_the_same_ones() -> None:
    hold = older(exercise="hold-stretch", deflection_mm=5.0, tolerance_mm=0.5, seconds=0.2,
                 force_limit_N=1.0)  # fmt: skip
    assert (hold.goal, hold.limits) == (HOLD.goal, HOLD.limits)
    approach = older(exercise="approach_break", margin=0.2, seconds=0.1, errors={})
    assert (approach.goal, approach.limits) == (APPROACH.goal, APPROACH.limits)
    gentle = older(
        exercise="gentle-lifts", low_mm=4.5, high_mm=5.5, slack_mm=1.25, seconds=0.1, lifts=2,
        force_limit_N=1.0, mean_force_limit_N=0.6, loading_rate_limit_N_per_s=8.0,
        overshoot_limit=0.3, reserve_limit=0.25, time_limit_s=90.0,
    )  # fmt: skip
    assert gentle.goal == GENTLE.goal
    assert set(gentle.limits) == set(GENTLE.limits)
    assert (gentle.name, gentle.title, gentle.time_limit_s) == (
        "gentle_lifts", "Dissect gently", 90.0,
    )  # fmt: skip
    with pytest.raises(ValueError, match="'juggle' is no exercise; there are: hold_stretch, "):
        renamed_exercise({"exercise": "juggle"})


def test_what_comes_after_the_outcome_changes_nothing() -> None:
    run = [*UP, *DOWN, *UP, *DOWN]
    before = taken(GENTLE, *run).outcome
    assert before is not None
    assert taken(GENTLE, *run, Tick(9.0, torn=True)).outcome == before


def test_every_reason_is_one_sentence_and_every_exercise_says_what_to_do() -> None:
    for exercise in (HOLD, APPROACH, GENTLE, IMPULSE):
        for text in (exercise.task, exercise.caution):
            assert text.endswith(".")
            assert text.count(". ") == 0
        assert exercise.title


def test_continuous_feedback_is_always_there_and_a_summary_only_at_the_end() -> None:
    for seconds in (0.0, 10.0, 1e4):
        assert feedback_visible(Feedback.CONTINUOUS, seconds, over=False)
        assert not feedback_visible(Feedback.SUMMARY, seconds, over=False)
        assert feedback_visible(Feedback.SUMMARY, seconds, over=True)


def test_fading_feedback_is_seen_for_ever_less_of_the_time() -> None:
    def fraction(start: int) -> float:
        ticks = range(start * 30, (start + 3) * 30)
        return sum(feedback_visible(Feedback.FADING, t / 30.0, over=False) for t in ticks) / 90

    fractions = [fraction(start) for start in range(0, 33, 3)]
    assert fractions == pytest.approx([1.0 - 0.1 * n for n in range(11)], abs=0.02)
    assert feedback_visible(Feedback.FADING, 100.0, over=True)


# With the whole session under them: a careful hand passes, a hasty and a clumsy one do not.


def exercises(session: Session) -> tuple[Exercise, Exercise, Exercise]:
    hold, approach, gentle = exercises_offered(session)
    return hold, approach, gentle


def stay(exercise: Exercise) -> Stay:
    assert isinstance(exercise.goal, Stay)
    return exercise.goal


def go(session: Session, *, most_seconds: float = 70.0) -> None:
    for _ in range(round(most_seconds / TICK_SECONDS)):
        if session.run.over:
            return
        session.advance()
    raise AssertionError("the exercise does not end")


@cache
def own_organ() -> Organ:
    """An organ of one's own, twice as long as the shipped one and two thirds as thick."""
    organ = phantom()
    return Organ(
        2.0 * organ.axis, organ.frames, organ.keys, organ.outer / 1.5,
        None if organ.lumen is None else organ.lumen / 1.5, name="own",
    )  # fmt: skip


DUCTS = [*presets(), "own organ"]


def session_on(duct: str) -> Session:
    if duct == "own organ":
        return pull_session(own_organ(), vertices=300)
    return pull_session(phantom(), preset_named(duct), vertices=300)


HANDS = {"careful": CAREFUL, "hasty": HASTY, "clumsy": CLUMSY}


@pytest.mark.slow
@pytest.mark.parametrize(
    "feedback",
    [
        Feedback.CONTINUOUS,
        *(pytest.param(each, marks=pytest.mark.long) for each in list(Feedback)[1:]),
    ],
)
@pytest.mark.parametrize("duct", DUCTS)
def test_a_careful_hand_passes_every_exercise_and_the_others_none(
    duct: str, feedback: Feedback
) -> None:
    session = session_on(duct)
    for exercise in exercises(session):
        for name, manner in HANDS.items():
            session.start_exercise(exercise, feedback)
            perform(session, manner)
            outcome = session.run.outcome
            assert outcome is not None
            assert outcome.passed == (name == "careful"), (exercise.title, name, outcome.reason)


@pytest.mark.parametrize("theory", [Exact(), TautString()], ids=lambda theory: theory.name)
def test_the_hands_fare_the_same_by_other_theories(theory: Theory) -> None:
    session = session_on(next(iter(presets())))
    session.choose_theory(theory)
    for exercise in exercises(session):
        for name, manner in HANDS.items():
            session.start_exercise(exercise)
            perform(session, manner)
            outcome = session.run.outcome
            assert outcome is not None
            assert outcome.passed == (name == "careful"), (exercise.title, name, outcome.reason)


def test_a_quick_but_accurate_hand_is_not_gentle() -> None:
    session = session_on("porcine-gallbladder")
    session.start_exercise(exercises(session)[2])
    perform(session, Reach(0.25))
    outcome = session.run.outcome
    assert outcome is not None
    assert "loaded by" in outcome.reason
    session.start_exercise(exercises(session)[2])
    perform(session, Reach(2.0))
    assert session.run.outcome is not None
    assert session.run.outcome.passed


@pytest.mark.parametrize("duct", DUCTS)
def test_limits_follow_from_the_duct_s_own_break(duct: str) -> None:
    session = session_on(duct)
    hold, _, gentle = exercises(session)
    event = session.reading().breaks_at
    assert event is not None
    middle = 0.5 * (stay(hold).low + stay(hold).high)
    assert middle == pytest.approx(0.6 * event.deflection)
    assert hold.limit_of["maximum_force_N"] < event.force
    limits = gentle.limit_of
    # Half of the strength in the band's middle, two thirds of it at the limit.
    session.grab(0, session.planar.grasp)
    session.lift(0.5 * (stay(gentle).low + stay(gentle).high))
    settle(session)
    reading = session.reading()
    assert reading.check.distance_to_break == pytest.approx(0.5, abs=1e-6)
    assert reading.force == pytest.approx(limits["mean_absolute_nonzero_force_N"], rel=1e-6)
    session.lift(stay(gentle).high * (1.0 + limits["overshoot"] / 1.08))
    settle(session)
    reading = session.reading()
    assert reading.check.distance_to_break == pytest.approx(
        limits["smallest_distance_to_break"], abs=1e-6
    )
    assert reading.force == pytest.approx(limits["maximum_force_N"], rel=1e-6)
    reached = limits["maximum_force_N"] + 0.25 * limits["maximum_loading_rate_N_per_s"]
    assert reached == pytest.approx(event.force, rel=1e-9)


def test_scripted_hands_do_the_same_each_time_and_nothing_else_than_exercises() -> None:
    found = []
    for _ in range(2):
        session = session_on(DUCTS[0])
        session.start_exercise(exercises(session)[0])
        perform(session, CLUMSY)
        found.append(session.run_file())
    assert found[0] == found[1]
    assert "release" not in {each.kind for each in found[0].log.inputs}  # it failed before
    with pytest.raises(ValueError, match="start one"):
        perform(session_on(DUCTS[0]), CAREFUL)


def test_nothing_but_the_hand_counts_in_an_exercise() -> None:
    session = session_on(DUCTS[0])
    hold, approach, gentle = exercises(session)
    event = session.reading().breaks_at
    assert event is not None
    for exercise in (hold, approach, gentle):
        session.start_exercise(exercise)
        session.set_target_force(session.planar.force_limit)
        session.set_grasp(12.0)
        session.set_threshold(2.0 * session.tissue.threshold)
        session.advance(30)
        assert not session.run.started
        assert session.reading().force == 0.0
        assert (session.planar.grasp, session.tissue.threshold) == (
            25.4,
            pytest.approx(0.2115, abs=1e-4),
        )
        # Nor while the hand holds it.
        session.grab(0, 25.4)
        session.lift(1.0)
        settle(session)
        held = session.reading()
        session.set_target_force(session.planar.force_limit)
        session.set_grasp(12.0)
        session.advance(30)
        assert session.reading() == held
        assert {each.kind for each in session.run_file().log.inputs} == {"grab", "lift"}
        assert session.run_file().log.exercise_inputs == "hand"
        session.reset()
    session.set_target_force(1.0)  # a free pull takes it again
    settle(session)
    assert session.reading().force == 1.0


def test_a_teacher_can_let_sliders_in_and_the_run_says_so() -> None:
    session = session_on(DUCTS[0])
    approach = exercises(session)[1]
    event = session.reading().breaks_at
    assert event is not None
    session.start_exercise(approach, inputs="any")
    for tick in range(1, 301):  # near the break it is to be pulled slowly by a slider too
        session.set_target_force(0.97 * event.force * min(tick / 240.0, 1.0))
        session.advance()
    assert session.run.outcome is not None
    assert session.run.outcome.passed
    kept = read_run(run_json(session.run_file()))
    assert kept.log.exercise_inputs == "any"
    assert replayed(kept, phantom()) == kept
    # The same run, said to be by hand alone, is not made again as one.
    forged = msgspec.structs.replace(
        kept, log=msgspec.structs.replace(kept.log, exercise_inputs="hand")
    )
    assert replayed(forged, phantom()).outcome is None


def test_the_goal_is_seen_where_the_hand_holds_until_the_exercise_is_over() -> None:
    session = session_on(DUCTS[0])
    hold, approach, gentle = exercises(session)
    assert session.goal is None
    for exercise in (hold, gentle):
        session.start_exercise(exercise)
        assert session.goal == exercise.goal.band
    session.start_exercise(msgspec.structs.replace(approach, limits=()))  # a jump goes on
    for grasp in (25.4, 15.0):
        session.grab(0, grasp)
        session.advance()
        band = session.goal
        assert band is not None
        session.lift(band[0] + 1e-6)
        settle(session)
        distance = session.reading().check.distance_to_break
        assert distance == pytest.approx(stay(approach).high, abs=1e-5)
        event = session.reading().breaks_at
        assert event is not None
        assert band[1] == event.deflection
    session.finish()
    assert session.goal is None


def test_no_hand_moves_the_duct_after_the_result_until_it_is_made_whole() -> None:
    session = session_on(DUCTS[0])
    hold = exercises(session)[0]
    session.start_exercise(hold)
    session.grab(0, 25.4)
    session.lift(session.planar.deflection_limit)  # on to the tear, if nothing stopped it
    while not session.run.over:
        session.advance()
    assert session.run.outcome is not None
    there = session.reading()
    assert there.torn_at is None
    file = session.run_file()
    session.lift(session.planar.deflection_limit)
    session.set_target_force(100.0)
    assert session.grab(0, 20.0) is None
    session.advance(60)
    assert session.reading() == there
    assert session.run_file() == file
    session.release()
    session.advance(60)
    assert session.reading().deflection == pytest.approx(0.0, abs=1e-3)
    session.reset()
    session.grab(0, 25.4)
    session.lift(session.planar.deflection_limit)
    session.advance(120)
    assert session.reading().torn_at is not None, "without an exercise it tears"


def test_earlier_tries_are_those_of_the_same_task_in_this_session() -> None:
    session = session_on(DUCTS[0])
    hold, approach, _ = exercises(session)
    runs = []
    for exercise, manner in (
        (hold, HASTY), (approach, HASTY), (hold, CLUMSY), (hold, CAREFUL)
    ):  # fmt: skip
        session.start_exercise(exercise)
        perform(session, manner)
        runs.append(session.run_file())
    assert session.earlier_tries(runs[-1]) == [runs[0], runs[2]]
    session.reset()
    assert session.earlier_tries(runs[-1]) == [runs[0], runs[2]]
    assert session.earlier_tries(runs[1]) == []
    session.set_grasp(20.0)
    session.start_exercise(exercises(session)[0])
    perform(session, CAREFUL)
    assert session.earlier_tries(session.run_file()) == []


@pytest.mark.parametrize("watched", [True, False])
def test_a_session_that_nobody_watches_keeps_no_tries(watched: bool) -> None:
    session = Session(session_on(DUCTS[0]).specimen, vertices=300, watched=watched)
    for _ in range(2):
        session.start_exercise(exercises(session)[0])
        perform(session, CAREFUL)
    assert len(session.earlier_incidents("hold_stretch", 5)) == watched


def test_an_exercise_s_clock_waits_for_the_first_pull() -> None:
    session = pull_session(phantom(), vertices=300)
    session.start_exercise(exercises(session)[1])
    session.advance(300)
    assert session.run.seconds == 0.0
    session.grab(0, 25.4)
    session.lift(3.0)
    session.advance(30)
    assert session.run.seconds == pytest.approx(1.0)
    assert session.run.progress > 0.0


def test_an_exercise_keeps_its_numbers_and_its_grasp_wherever_the_hand_takes_hold() -> None:
    session = pull_session(phantom(), vertices=300)
    hold, *_ = offered = exercises(session)
    middle = session.planar.grasp
    for place in (middle + 8.0, middle - 5.0):
        session.start_exercise(hold)
        session.grab(0, place)
        session.lift(0.5 * (stay(hold).low + stay(hold).high))
        go(session)
        assert session.planar.grasp == place
        assert session.task_grasp == middle
        assert exercises_offered(session) == offered  # the same task as before
    session.release()
    settle(session)
    assert exercises_offered(session) == offered
    session.reset()
    assert session.planar.grasp == session.task_grasp == middle
    # A grasp that is asked for after the result is the next exercise's.
    session.start_exercise(hold)
    session.grab(0, middle + 8.0)
    session.finish()
    session.set_grasp(12.0)
    assert session.task_grasp == 12.0
    assert exercises_offered(session) != offered
    session.reset()
    assert session.planar.grasp == 12.0
    # That of an earlier run can be started from again.
    session.start_exercise(hold, grasp=middle)
    assert session.planar.grasp == session.task_grasp == middle


@pytest.mark.parametrize(
    ("goal", "changes", "words"),
    [
        (HOLD.goal, {"low": -1.0}, "low and high of deflection_mm must rise"),
        (HOLD.goal, {"high": float("inf")}, "low and high of deflection_mm must rise"),
        (HOLD.goal, {"seconds": 61.0}, "time_limit_s must be at most 3600 s and long enough"),
        (APPROACH.goal, {"high": 1.0}, "low and high of distance_to_break must rise"),
        (APPROACH.goal, {"seconds": -1.0}, "seconds must be above 0"),
        (APPROACH.goal, {"return_below": 0.1}, "return_below must be a deflection"),
        (GENTLE.goal, {"return_below": 9.0}, "return_below must be a deflection"),
        (GENTLE.goal, {"return_below": None}, "return_below must be given"),
        (GENTLE.goal, {"repeats": 0}, "repeats must be from 1 to 100"),
    ],
)
def test_exercises_that_nobody_can_do_are_refused(
    goal: Stay, changes: dict[str, float], words: str
) -> None:
    with pytest.raises(ValueError, match=words):
        msgspec.structs.replace(HOLD, goal=msgspec.structs.replace(goal, **changes))
