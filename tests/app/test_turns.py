"""Turns: all draw while there is time, each in an even share of the ticks when there is not."""

import itertools

from app.trainer.turns import EVEN_TICKS, MOST_TICKS, Turns


def test_everybody_draws_in_every_tick_that_is_on_time() -> None:
    turns = Turns()
    for _ in range(500):
        turns.take(late=False)
        assert all(turns.draws(number) for number in range(16))


def test_late_ticks_spread_the_drawing_evenly_and_nobody_is_forgotten() -> None:
    turns = Turns()
    for ticks in range(2, MOST_TICKS + 3):
        turns.take(late=True)
        assert turns.ticks == min(ticks, MOST_TICKS)
    drawn = []
    for _ in range(MOST_TICKS * 6):
        turns.take(late=False)
        drawn.append([turns.draws(number) for number in range(16)])
    # 16 ducts: a quarter of them in each tick, and each in every fourth.
    assert {sum(row) for row in drawn} == {16 // MOST_TICKS}
    assert {sum(column) for column in zip(*drawn, strict=True)} == {6}
    for column in zip(*drawn, strict=True):
        at = [tick for tick, draws in enumerate(column) if draws]
        assert {after - before for before, after in itertools.pairwise(at)} == {MOST_TICKS}


def test_even_ticks_bring_the_pictures_back_one_step_at_a_time() -> None:
    turns = Turns()
    for _ in range(MOST_TICKS):
        turns.take(late=True)
    for ticks in range(MOST_TICKS, 1, -1):
        for _ in range(EVEN_TICKS - 1):
            turns.take(late=False)
        assert turns.ticks == ticks
        turns.take(late=False)
        assert turns.ticks == ticks - 1
    # One late tick starts the count anew.
    turns.take(late=True)
    for _ in range(EVEN_TICKS - 1):
        turns.take(late=False)
    turns.take(late=True)
    assert turns.ticks == 3
