"""Limits that another station watches: what stops here, and how often."""

from collections.abc import Callable

import pytest

from cosmic.daqco.api.limit_watch import LimitWatch
from cosmic.daqco.core.chunk import DataChunk
from cosmic.daqco.core.limits import Crossing, Limit
from cosmic.daqco.core.settings import LimitSettings
from cosmic.frame.clock import Clock, WallClock

ARMED = Limit("force", high=30.0, armed=True)
CROSSED = Crossing("force", 7, 1.0, 31.0, 30.0, "uN", "force reached 31 uN, its limit is 30", 0.01)


class There:
    """What a station tells; a test sets it."""

    def __init__(self) -> None:
        self.clock: Clock = WallClock()
        self.away = ""
        self.remote = "at the station fibres"
        self.running = True
        self.latest_chunk: DataChunk | None = None
        self.limits_there: tuple[Limit, ...] = (ARMED,)
        self.crossings_there: tuple[Crossing, ...] = ()

    def watch_crossings(self, receiver: Callable[[Crossing], object]) -> Callable[[], None]:
        raise NotImplementedError

    def watch_failures(self, receiver: Callable[[str], object]) -> Callable[[], None]:
        raise NotImplementedError


def made() -> tuple[There, LimitWatch, list[str], list[Crossing]]:
    stops: list[str] = []
    heard: list[Crossing] = []
    there = There()
    watch = LimitWatch(there)
    watch.trip = stops.append
    watch.subscribe(heard.append)
    return there, watch, stops, heard


def test_a_crossing_stops_once_however_often_it_is_reported() -> None:
    there, watch, stops, heard = made()
    watch.on_state(first=True)
    watch.take_crossing(CROSSED)
    there.crossings_there = (CROSSED,)
    watch.on_state(first=False)
    watch.take_crossing(CROSSED)
    assert stops == [CROSSED.text]
    assert heard == [CROSSED]


def test_a_crossing_that_the_stream_lost_is_found_in_the_state() -> None:
    there, watch, stops, _ = made()
    watch.on_state(first=True)
    there.crossings_there = (CROSSED,)
    watch.on_state(first=False)
    assert stops == [CROSSED.text]


def test_what_was_crossed_long_ago_and_is_over_stops_nothing_at_the_first_state() -> None:
    there, watch, stops, _ = made()
    there.crossings_there = (CROSSED,)
    watch.on_state(first=True)
    assert stops == []


def test_a_stop_that_fails_keeps_nobody_from_hearing(caplog: pytest.LogCaptureFixture) -> None:
    _, watch, _, heard = made()

    def fail(_reason: str) -> None:
        raise RuntimeError("the other station is away")

    watch.trip = fail
    watch.take_crossing(CROSSED)
    assert heard == [CROSSED]
    assert "the other station is away" in caplog.text


def test_silence_stops_once_and_only_while_a_limit_is_armed() -> None:
    there, watch, stops, _ = made()
    there.limits_there = ()
    watch.look(10.0)
    assert stops == []
    watch.look(0.0)
    there.limits_there = (ARMED,)
    for silent_s in (0.4, 0.6, 0.8):
        watch.look(silent_s)
    assert len(stops) == 1
    watch.look(0.1)
    watch.look(0.6)
    assert len(stops) == 2


SET_ANEW: list[tuple[str, dict[str, object]]] = [
    ("reset_limit", {"channel": "force"}),
    ("remove_limit", {"channel": "force"}),
    ("disarm_limit", {"channel": "force"}),
    ("set_limit", {"limit": LimitSettings(channel="force", high=1.0)}),
]


@pytest.mark.parametrize(("command", "arguments"), SET_ANEW)
def test_a_limit_stays_crossed_by_silence_until_it_is_set_anew_from_here(
    command: str, arguments: dict[str, object]
) -> None:
    _, watch, _, _ = made()
    watch.look(10.0)
    watch.look(0.0)
    assert watch.limits["force"].tripped
    watch.on_commanded("mark", {"text": "force"})
    watch.on_commanded(command, {**arguments, "channel": "light"} if "channel" in arguments else {})
    assert watch.limits["force"].tripped
    watch.on_commanded(command, arguments)
    assert not watch.limits["force"].tripped
