"""No command is begun later than it said, whatever the clocks and the line do."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cosmic.frame.clock import ManualClock
from cosmic.frame.network.errors import CommandExpired
from cosmic.frame.network.freshness import SequenceGuard, StationTime, check_age


@given(
    st.lists(st.tuples(st.floats(0.0, 5.0), st.floats(0.0, 5.0), st.floats(0.0, 5.0)), max_size=10),
    st.floats(0.0, 1e5),
)
def test_the_reckoning_of_the_stations_clock_is_never_ahead_of_it(
    exchanges: list[tuple[float, float, float]], ahead_s: float
) -> None:
    client, station = ManualClock(), ManualClock()
    station.advance(ahead_s)
    reckoning = StationTime(client)

    def both(duration_s: float) -> None:
        client.advance(duration_s)
        station.advance(duration_s)

    for there_s, back_s, later_s in exchanges:
        both(there_s)
        stamp_s = station.now_s()
        both(back_s)
        reckoning.note(stamp_s)
        both(later_s)
        assert reckoning.now_s() <= station.now_s() + 1e-6


def test_the_reckoning_is_as_old_as_the_fastest_answer() -> None:
    clock = ManualClock()
    reckoning = StationTime(clock)
    reckoning.note(100.0)
    clock.advance(1.0)
    reckoning.note(100.5)  # this answer took half a second longer
    assert reckoning.now_s() == pytest.approx(101.0, abs=1e-3)
    reckoning.forget()
    assert reckoning.now_s() == float("-inf")


def test_a_client_whose_clock_runs_fast_is_not_ahead_either() -> None:
    client, station = ManualClock(), ManualClock()
    reckoning = StationTime(client)
    for _ in range(1000):
        reckoning.note(station.now_s())
        client.advance(1.0001)
        station.advance(1.0)
        assert reckoning.now_s() <= station.now_s()


@pytest.mark.parametrize("until_s", [4.9, float("nan"), float("-inf")])
def test_what_is_too_old_or_not_dated_is_not_done(until_s: float) -> None:
    clock = ManualClock()
    clock.advance(5.0)
    check_age(clock, 5.0, "a move")
    with pytest.raises(CommandExpired):
        check_age(clock, until_s, "a move")


def test_each_number_passes_once_in_any_order() -> None:
    guard = SequenceGuard()
    for number in (1, 3, 2, 7, 5):
        guard.check(number)
    for number in (1, 2, 3, 5, 7):
        with pytest.raises(CommandExpired):
            guard.check(number)
    for number in range(10, 5000):
        guard.check(number)
    with pytest.raises(CommandExpired):
        guard.check(6)
