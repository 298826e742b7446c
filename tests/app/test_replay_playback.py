"""Playback of a run: the clock alone goes to the moment that was asked for last."""

import math
from functools import cache
from threading import Thread

import pytest
from simulated import phantom, pull_session

from app.simulation import AFTER_TEAR, TICK_SECONDS, Replay, RunFile, Session
from app.trainer.client import replay_playback
from app.trainer.client.replay_playback import LivePlayback, ReplayPlayback


@cache
def a_run() -> RunFile:
    session = pull_session(phantom(), vertices=300)
    session.set_target_force(0.4 * session.planar.force_limit)
    session.advance(60)
    session.set_target_force(0.0)
    session.advance(30)
    return session.run_file()


def reached(playback: ReplayPlayback) -> int:
    """Tick until the moment that was asked for is seen, and return how often."""
    for count in range(1, 1000):
        if playback.tick(0):
            return count
    raise AssertionError("it is never reached")


@pytest.mark.parametrize("quick", [True, False])
def test_the_last_moment_asked_for_by_any_thread_is_seen(
    monkeypatch: pytest.MonkeyPatch, quick: bool
) -> None:
    monkeypatch.setattr(replay_playback, "SEEK_SECONDS", 60.0 if quick else 0.0)
    playback, again = (
        ReplayPlayback(Replay(a_run().log, phantom())),
        Replay(a_run().log, phantom()),
    )
    assert playback.tick(0)  # its first picture
    assert not playback.tick(0)
    for ticks in (80, 35, 90):
        asking = [Thread(target=playback.seek, args=(each,)) for each in (1.0, 0.1, 2.0)]
        for each in asking:
            each.start()
        for each in asking:
            each.join()
        playback.seek(ticks * TICK_SECONDS)
        playback.seek(math.nan)  # as from an empty field
        assert playback.time == pytest.approx(ticks * TICK_SECONDS)
        assert playback.on_its_way
        counted = reached(playback)
        assert not playback.on_its_way
        assert (counted == 1) is quick
        again.seek_tick(ticks)
        assert playback.session.reading() == again.session.reading()
    assert playback.at_end


def test_it_plays_to_its_end_and_from_its_start_again() -> None:
    playback = ReplayPlayback(Replay(a_run().log, phantom()))
    playback.tick(0)  # its first picture
    playback.seek(1e9)
    playback.play()
    reached(playback)
    assert playback.time == playback.duration
    playback.tick(1)
    assert not playback.playing
    playback.play()
    reached(playback)
    assert (playback.time, playback.playing) == (0.0, True)
    assert playback.tick(3)
    assert playback.time == pytest.approx(3 * TICK_SECONDS)
    playback.speed = 4
    assert playback.tick(3)
    assert playback.time == pytest.approx(15 * TICK_SECONDS)
    playback.pause()
    assert not playback.tick(3)


def test_a_replay_begins_before_the_whole_run_was_computed() -> None:
    """Its length is known from the file, and its errors come as it goes on, if none are given."""
    session = pull_session(phantom(), vertices=300)
    session.set_target_force(2.0 * session.planar.force_limit)
    session.advance(90)
    run, made = session.run_file(), session.run.incidents()
    assert made
    replay = Replay(run.log, phantom(), tore=True)
    playback = ReplayPlayback(replay)
    assert playback.duration == pytest.approx((run.log.ticks + AFTER_TEAR) * TICK_SECONDS)
    assert playback.session.run.seconds == 0.0
    assert list(playback.incidents) == []
    assert ReplayPlayback(replay, made).incidents == made
    assert playback.tick(0)  # its first picture
    playback.seek(playback.duration)
    reached(playback)
    assert list(playback.incidents) == made
    assert playback.duration == Replay(run.log, phantom()).duration


def test_what_goes_on_live_stays_where_it_was_once_the_other_page_is_gone() -> None:
    first, second = (pull_session(phantom(), vertices=300) for _ in range(2))
    found: list[Session | None] = [second, None]
    playback = LivePlayback(first, lambda: found.pop(0))
    for session in (second, second):
        while not playback.tick(1):
            pass
        assert playback.session is session
