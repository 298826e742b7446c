"""Sessions by token: a page loaded anew finds its own, nobody finds another's."""

import tracemalloc

import pytest
from simulated import phantom, pull, pull_session

from app.trainer.client.practice import Practice
from app.trainer.server.sessions import Sessions, SessionsFullError


class Time:
    """A clock that is set by hand."""

    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


def kept(clock: Time, *, most: int = 3) -> Sessions:
    return Sessions(
        lambda: Practice(phantom(), None, "free"), most=most, kept_seconds=60.0, clock=clock
    )


def test_a_page_loaded_anew_finds_its_run_as_it_was() -> None:
    clock = Time()
    sessions = kept(clock)
    token, practice = sessions.claim()
    session = practice.session("free")
    pull(session, 2.0)
    before, file = session.reading(), session.run_file()
    sessions.leave(token)
    clock.now += 59.0
    again, found = sessions.claim(token)
    assert (again, found) == (token, practice)
    assert found.session("free") is session
    assert session.reading() == before
    assert session.run_file() == file


def test_a_session_is_dropped_when_its_page_stays_away() -> None:
    clock = Time()
    sessions = kept(clock)
    token, session = sessions.claim()
    sessions.leave(token)
    clock.now += 61.0
    sessions.expire()
    assert len(sessions) == 0
    again, found = sessions.claim(token)
    assert again != token
    assert found is not session


def test_a_session_in_use_is_never_dropped_or_shared() -> None:
    clock = Time()
    sessions = kept(clock)
    token, session = sessions.claim()
    clock.now += 1e6
    sessions.expire()
    assert len(sessions) == 1
    other, second = sessions.claim(token)  # a second tab with the same token
    assert other != token
    assert second is not session


def test_of_too_many_the_one_longest_left_goes_and_none_that_works() -> None:
    clock = Time()
    sessions = kept(clock)
    tokens = [sessions.claim()[0] for _ in range(3)]
    with pytest.raises(SessionsFullError, match="3 trainees"):
        sessions.claim()
    for token in (tokens[1], tokens[0]):
        clock.now += 1.0
        sessions.leave(token)
    sessions.claim()
    assert len(sessions) == 3
    assert sessions.claim(tokens[0])[0] == tokens[0]


def test_tokens_cannot_be_guessed_and_a_failed_session_leaves_no_gap() -> None:
    clock = Time()
    sessions = kept(clock, most=2)
    first, second = sessions.claim()[0], sessions.claim()[0]
    assert first != second
    assert len(first) >= 20

    def fail() -> Practice:
        raise RuntimeError("no duct")

    broken = Sessions(fail, most=1, clock=clock)
    for _ in range(3):
        with pytest.raises(RuntimeError):
            broken.claim()
    assert len(broken) == 0


def test_pulling_for_long_allocates_nothing_that_stays() -> None:
    """What stays of a tick is its place in the log: three bare numbers for each new wish."""
    session = pull_session(phantom(), vertices=300)
    session.show_chain(True)
    session.grab(0, 25.4)

    def drag(ticks: int) -> None:
        for tick in range(ticks):
            session.lift(3.0 + 2.0 * (tick % 7))
            session.advance()
            session.reading()
            session.metrics()

    session.set_threshold(session.planar.threshold_range[1])
    drag(300)
    tracemalloc.start()
    try:
        drag(200)
        before = tracemalloc.get_traced_memory()[0]
        drag(3000)
        grown = tracemalloc.get_traced_memory()[0] - before
    finally:
        tracemalloc.stop()
    assert session.reading().phase == "intact"
    assert grown < 3000 * 24 * 1.3 + 20_000
