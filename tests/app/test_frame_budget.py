"""Frame budget: all draw while there is time, each with an even share when there is not."""

import itertools

import pytest

from app.trainer.server.frame_budget import HIGH_LOAD, LOW_LOAD, MAX_INTERVAL, FrameBudget

STEP, PICTURE = 0.02, 0.025
"""Work for each client, in ticks: a session's step, and its duct's picture."""


def served(budget: FrameBudget, clients: int, ticks: int) -> list[list[bool]]:
    """Who was drawn in each tick of a trainer with some clients that pull."""
    rows: list[list[bool]] = []
    work = 0.0
    for _ in range(ticks):
        budget.begin_tick(work)
        rows.append([budget.draws(number) for number in range(clients)])
        work = clients * STEP + sum(rows[-1]) * PICTURE
    return rows


def test_everybody_draws_in_every_tick_while_there_is_time() -> None:
    for clients in (1, 8, 21):
        assert all(all(row) for row in served(FrameBudget(), clients, 300))


@pytest.mark.parametrize(
    ("clients", "ticks"), [(21, 1), (22, 2), (29, 2), (30, 3), (33, 3), (34, 4), (40, 4)]
)
def test_the_drawing_is_spread_until_the_work_fits(clients: int, ticks: int) -> None:
    budget = FrameBudget()
    rows = served(budget, clients, 400)[-24:]
    assert budget.interval == ticks
    work = clients * (STEP + PICTURE / ticks)
    assert work <= HIGH_LOAD or ticks == MAX_INTERVAL
    # Each is drawn in every so many ticks, and nobody more often.
    for column in zip(*rows, strict=True):
        at = [tick for tick, draws in enumerate(column) if draws]
        assert {after - before for before, after in itertools.pairwise(at)} == {ticks}
    most, least = max(map(sum, rows)), min(map(sum, rows))
    assert most - least <= 1


def test_pictures_come_back_when_clients_leave() -> None:
    budget = FrameBudget()
    served(budget, 40, 200)
    assert budget.interval == MAX_INTERVAL
    served(budget, 5, 200)
    assert budget.interval == 1
    assert 5 * (STEP + PICTURE) < LOW_LOAD


def test_one_tick_that_was_held_up_leaves_no_picture_out() -> None:
    budget = FrameBudget()
    served(budget, 3, 50)
    budget.begin_tick(3.0)
    assert budget.interval == 1
    assert all(all(row) for row in served(budget, 3, 50))
