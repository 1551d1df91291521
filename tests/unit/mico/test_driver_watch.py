"""Stops that hang in a library, while others stop as well."""

import threading
from collections.abc import Iterator

import pytest

from cosmic.frame.failure import FailurePolicy
from cosmic.mico.core.motion.driver_watch import LATE_S, SUSPECT_S, DriverCalls

LOOK_S = 0.125


class Calls(DriverCalls):
    """Calls of a device, whose watch looks when a test says so."""

    def __init__(self) -> None:
        self.late_s = list[float]()
        super().__init__("device 0", FailurePolicy(), lambda _: None, self.late_s.append)
        self.go_on = threading.Event()
        self.callers = list[threading.Thread]()

    def hang(self) -> None:
        """Stop from a thread of its own, and hang in it."""
        inside = threading.Event()

        def call() -> None:
            inside.set()
            self.go_on.wait(20.0)

        self.callers.append(threading.Thread(target=self.stop, args=(call,)))
        self.callers[-1].start()
        assert inside.wait(5.0)

    def look_for(self, duration_s: float) -> None:
        for _ in range(round(duration_s / LOOK_S)):
            self.stops.look(LOOK_S)


@pytest.fixture
def calls() -> Iterator[Calls]:
    calls = Calls()
    yield calls
    calls.go_on.set()
    for each in calls.callers:
        each.join(5.0)
    calls.stop(lambda: None)


def test_one_that_hangs_is_reported_and_again_when_it_returns(calls: Calls) -> None:
    calls.hang()
    calls.look_for(LATE_S - LOOK_S)
    assert not calls.late_s
    calls.look_for(2.0 * LOOK_S)
    assert calls.late_s
    calls.go_on.set()
    calls.callers[0].join(5.0)
    calls.look_for(LOOK_S)
    assert calls.late_s[-1] == 0.0
    assert not calls.suspect


def test_further_stops_do_not_put_off_that_one_hangs(calls: Calls) -> None:
    calls.hang()
    for _ in range(round(SUSPECT_S / LOOK_S)):
        calls.look_for(LOOK_S)
        calls.hang()
    calls.look_for(2.0 * LOOK_S)
    assert calls.suspect


def test_one_that_begins_just_when_another_ends_is_watched(calls: Calls) -> None:
    really = calls.stops.beat
    begun = list[bool]()

    def beat(allowed_s: float) -> None:
        if allowed_s > LATE_S and not begun:
            begun.append(True)
            calls.hang()
        really(allowed_s)

    calls.stops.beat = beat  # type: ignore[method-assign]
    calls.stop(lambda: None)
    calls.look_for(LATE_S + 2.0 * LOOK_S)
    assert calls.late_s


def test_stops_that_return_are_never_suspected(calls: Calls) -> None:
    for _ in range(20):
        calls.stop(lambda: None)
        calls.look_for(LOOK_S)
    calls.look_for(10.0)
    assert not calls.suspect
    assert not calls.late_s
