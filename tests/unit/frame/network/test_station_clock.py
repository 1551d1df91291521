"""The clock of another station, as it is known here."""

import pytest

from cosmic.frame.clock import WALL
from cosmic.frame.network.station_clock import Reading, StationClock


def test_the_clock_of_a_station_is_never_behind_and_follows_the_best_answer() -> None:
    clock = StationClock()
    now_s = WALL.now_s()
    readings = [
        Reading(100.0, now_s - 1.0, now_s),
        Reading(100.9, now_s - 0.102, now_s - 0.1),
        Reading(100.0, now_s - 0.5, now_s),
    ]
    clock.forget(1.0)
    clock.take(readings)
    assert clock.uncertain_s == pytest.approx(0.002, abs=1e-6)
    assert 101.002 <= clock.now_s() <= 101.002 + (WALL.now_s() - now_s) + 1e-3


def test_the_clock_does_not_go_back_when_it_is_read_again() -> None:
    clock = StationClock()
    now_s = WALL.now_s()
    clock.take([Reading(100.0, now_s - 1.0, now_s)])
    before_s = clock.now_s()
    clock.take([Reading(100.0, now_s - 0.001, now_s)])
    assert clock.now_s() >= before_s
    clock.forget(20.0)
    clock.take([Reading(5.0, now_s, now_s)])
    assert clock.rate == 20.0
    assert clock.now_s() < before_s
