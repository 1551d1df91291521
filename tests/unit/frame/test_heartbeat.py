"""A thread that hangs is noticed, one that is slow or was asleep with the computer is not."""

import pytest

from cosmic.frame.failure import FailurePolicy
from cosmic.frame.heartbeat import OPEN_S, STALL_S, Heartbeat, HeartbeatWatch
from unit.mico.rigs import wait_until


@pytest.fixture
def told() -> list[float]:
    return []


@pytest.fixture
def beating(told: list[float]) -> Heartbeat:
    return Heartbeat(told.append)


def looks(beating: Heartbeat, seconds: float) -> None:
    for _ in range(round(seconds / 0.5)):
        beating.look(0.5)


def test_a_hang_is_reported_once_and_so_is_its_end(beating: Heartbeat, told: list[float]) -> None:
    beating.beat()
    beating.look(0.5)
    looks(beating, STALL_S - 0.5)
    assert told == []
    looks(beating, 10.0)
    assert told == [STALL_S]
    beating.beat()
    looks(beating, 2.0)
    assert told == [STALL_S, 0.0]


def test_what_is_opened_may_take_longer(beating: Heartbeat, told: list[float]) -> None:
    beating.beat(OPEN_S)
    beating.look(0.5)
    looks(beating, OPEN_S - 0.5)
    assert told == []
    looks(beating, 0.5)
    assert told == [OPEN_S]


def test_a_thread_that_has_not_begun_or_has_ended_does_not_hang(
    beating: Heartbeat, told: list[float]
) -> None:
    looks(beating, 60.0)
    beating.beat()
    beating.look(0.5)
    beating.end()
    looks(beating, 60.0)
    assert told == []


def test_the_watch_looks_until_it_is_ended(beating: Heartbeat, told: list[float]) -> None:
    beating.beat(0.5)
    watch = HeartbeatWatch("drivers", [beating], FailurePolicy())
    watch.start()
    try:
        wait_until(lambda: told)
    finally:
        watch.request_end()
        assert watch.join()
    assert told == [0.5]
