"""The timer: what is late comes, what is later than a period is missed and counted."""

import threading
from typing import cast

import pytest

from app.trainer.server.fixed_rate_timer import FixedRateTimer

PERIOD = 0.25  # binary, so that sums are exact


class FakeTime:
    """A clock that stands still but for waits and for the work that is put on it."""

    def __init__(self) -> None:
        self.now = 100.0
        self.stopped = False

    def __call__(self) -> float:
        return self.now

    def wait(self, seconds: float) -> bool:
        """As an event's."""
        self.now += seconds
        return self.stopped


def test_ticks_are_even_and_none_is_missed_while_work_is_shorter_than_a_period() -> None:
    time = FakeTime()
    timer = FixedRateTimer(PERIOD, clock=time)
    stop = cast("threading.Event", time)
    came: list[float] = []
    for tick in range(40):
        timer.wait(stop)
        came.append(time.now)
        time.now += PERIOD * (0.0, 0.5, 0.875)[tick % 3]
    assert came == [100.0 + PERIOD * tick for tick in range(40)]
    assert (timer.ticks, timer.missed) == (40, 0)


@pytest.mark.parametrize(
    ("work", "missed"), [(1.0, 0), (1.5, 0), (1.875, 0), (2.0, 1), (2.5, 1), (3.0, 2), (40.25, 39)]
)
def test_a_long_piece_of_work_misses_what_was_due_meanwhile_and_the_rest_stays_even(
    work: float, missed: int
) -> None:
    time = FakeTime()
    timer = FixedRateTimer(PERIOD, clock=time)
    stop = cast("threading.Event", time)
    timer.wait(stop)
    time.now += work * PERIOD
    assert timer.wait(stop) == work * PERIOD
    assert (timer.ticks, timer.missed) == (2, missed)
    timer.wait(stop)
    assert time.now == 100.0 + PERIOD * (missed + 2)
    assert timer.missed == missed


def test_every_tick_due_was_run_or_missed() -> None:
    time = FakeTime()
    timer = FixedRateTimer(PERIOD, clock=time)
    stop = cast("threading.Event", time)
    passed = 0.0
    for tick in range(200):
        passed += timer.wait(stop) or 0.0
        time.now += PERIOD * ((7 * tick) % 13) / 4.0
    assert passed == pytest.approx((timer.ticks + timer.missed - 1) * PERIOD, abs=PERIOD)


def test_a_stop_ends_the_wait() -> None:
    stop = threading.Event()
    stop.set()
    timer = FixedRateTimer(60.0)
    assert timer.wait(stop) is None
    assert timer.ticks == 0


@pytest.mark.parametrize("period", [0.0, -1.0, float("nan")])
def test_a_period_is_positive(period: float) -> None:
    with pytest.raises(ValueError, match="period must be positive"):
        FixedRateTimer(period)
