"""Samples from another station: gaps, and what is no sample."""

import logging
from collections.abc import Callable, Mapping

import numpy as np
import pytest
from typing_extensions import override

from cosmic.daqco.api.remote_buffer import RemoteBuffer
from cosmic.daqco.api.remote_clock import Reading, StationClock
from cosmic.daqco.api.remote_guard import RemoteGuard
from cosmic.daqco.api.station_report import CHUNKS, DISPLAY, DaqPiece
from cosmic.daqco.api.station_stream import SampleStream
from cosmic.daqco.core.chunk import DataChunk
from cosmic.daqco.core.limits import Crossing, Limit
from cosmic.daqco.core.scale import VOLTS, Scale
from cosmic.frame.clock import WALL, WallClock
from cosmic.frame.errors import ProtocolError
from cosmic.frame.network.transport import (
    PresenceListener,
    Receiver,
    Rule,
    Subscription,
    Transport,
)


class Received(Subscription):
    def __init__(self) -> None:
        self.closed = False

    @property
    @override
    def lost(self) -> int:
        return 0

    @override
    def close(self) -> None:
        self.closed = True


class ByHand(Transport):
    """A transport whose topics a test publishes itself."""

    def __init__(self) -> None:
        self.receivers: dict[tuple[str, Rule], Receiver] = {}
        self.subscriptions: list[Received] = []

    @override
    def subscribe(self, topic: str, rule: Rule, receiver: Receiver) -> Subscription:
        self.receivers[topic, rule] = receiver
        self.subscriptions.append(Received())
        return self.subscriptions[-1]

    @override
    def call(
        self,
        application: str,
        function: str,
        arguments: Mapping[str, object] | None = None,
        *,
        timeout_s: float = 1.0,
    ) -> object:
        raise NotImplementedError

    @override
    def publish(self, topic: str, payload: object) -> None: ...

    @override
    def presence(self, listener: PresenceListener) -> Callable[[], None]:
        return lambda: None

    @override
    def take_lease(self) -> None: ...

    @override
    def release_lease(self) -> None: ...

    @override
    def close(self) -> None: ...


def chunk(first: int, samples: int = 10, scale: Scale = VOLTS) -> DataChunk:
    return DataChunk(
        first, first / 1000.0, 1000.0, ("force",), np.full((1, samples), float(first)), (scale,)
    )


@pytest.fixture
def transport() -> ByHand:
    return ByHand()


def subscribed(transport: ByHand) -> tuple[RemoteBuffer, list[int], list[None]]:
    told: list[None] = []
    buffer = RemoteBuffer(transport, lambda: told.append(None))
    firsts: list[int] = []
    buffer.subscribe(lambda each: firsts.append(each.first_sample))
    return buffer, firsts, told


def test_a_gap_is_told_with_its_size_and_what_follows_is_handed_on(
    transport: ByHand, caplog: pytest.LogCaptureFixture
) -> None:
    buffer, firsts, told = subscribed(transport)
    put = transport.receivers[CHUNKS, Rule.ALL]
    beyond_32_bit = 2**40
    put(DaqPiece("a", chunk(beyond_32_bit)))
    put(DaqPiece("a", chunk(beyond_32_bit + 10)))
    assert buffer.lost == 0
    with caplog.at_level(logging.ERROR):
        put(DaqPiece("a", chunk(beyond_32_bit + 47)))
    assert buffer.lost == 27
    assert "27 samples" in caplog.text
    assert len(told) == 1
    assert firsts == [beyond_32_bit, beyond_32_bit + 10, beyond_32_bit + 47]


def test_another_acquisition_begins_its_numbers_anew_without_a_gap(transport: ByHand) -> None:
    buffer, firsts, told = subscribed(transport)
    put = transport.receivers[CHUNKS, Rule.ALL]
    put(DaqPiece("a", chunk(500)))
    put(DaqPiece("b", chunk(20)))
    put(DaqPiece("b", chunk(30)))
    assert (buffer.lost, told, firsts) == (0, [], [500, 20, 30])


WRONG = [
    None,
    5,
    chunk(0),
    DaqPiece("a", DataChunk(0, 0.0, 1000.0, ("a", "b"), np.zeros((1, 5)), (VOLTS,))),
    DaqPiece("a", DataChunk(0, 0.0, 1000.0, ("a",), np.zeros(5), (VOLTS,))),
    DaqPiece("a", DataChunk(0, 0.0, 1000.0, ("a",), np.zeros((1, 5), np.int16), (VOLTS,))),  # type: ignore[arg-type]
    DaqPiece("a", DataChunk(0, 0.0, 1000.0, ("a",), np.zeros((1, 0)), (VOLTS,))),
    DaqPiece("a", DataChunk(0, 0.0, float("nan"), ("a",), np.zeros((1, 5)), (VOLTS,))),
]


@pytest.mark.parametrize("payload", WRONG, ids=range(len(WRONG)))
def test_what_is_no_sample_is_refused(transport: ByHand, payload: object) -> None:
    buffer, firsts, _ = subscribed(transport)
    buffer.open()
    for receiver in transport.receivers.values():
        with pytest.raises(ProtocolError):
            receiver(payload)
    assert buffer.latest_chunk is None
    assert firsts == []


def test_all_samples_come_only_while_somebody_wants_them(
    transport: ByHand, monkeypatch: pytest.MonkeyPatch
) -> None:
    buffer = RemoteBuffer(transport, lambda: None)
    assert transport.subscriptions == []
    end = buffer.subscribe(lambda _: None)
    assert len(transport.subscriptions) == 1
    end()
    buffer.tidy()
    assert not transport.subscriptions[0].closed, "somebody may want them again soon"
    monkeypatch.setattr("cosmic.daqco.api.remote_buffer.LINGER_S", 0.0)
    buffer.tidy()
    assert transport.subscriptions[0].closed
    buffer.subscribe(lambda _: None)
    assert len(transport.subscriptions) == 2
    buffer.close()
    assert transport.subscriptions[1].closed


# --- at the station ---------------------------------------------------------------------------


def test_a_display_gets_the_same_samples_in_larger_pieces() -> None:
    sent: dict[str, list[DaqPiece]] = {CHUNKS: [], DISPLAY: []}

    def publish(topic: str, payload: object) -> None:
        assert isinstance(payload, DaqPiece)
        sent[topic].append(payload)

    stream = SampleStream(publish, display_s=0.05)
    other = Scale("other", "uN", (0.0, 2.0))
    for number in range(12):
        stream.take(chunk(10 * number, scale=VOLTS if number < 7 else other))
    stream.take(chunk(0))
    assert [each.chunk.first_sample for each in sent[CHUNKS]] == [*range(0, 120, 10), 0]
    shown = [(each.chunk.first_sample, each.chunk.samples) for each in sent[DISPLAY]]
    assert shown == [(0, 50), (50, 20), (70, 50)]
    assert np.array_equal(sent[DISPLAY][0].chunk.volts[0, ::10], [0.0, 10.0, 20.0, 30.0, 40.0])
    assert len({each.run for each in sent[CHUNKS]}) == 2
    assert [each.chunk.scales[0] for each in sent[DISPLAY]] == [VOLTS, VOLTS, other]


# --- limits -----------------------------------------------------------------------------------

ARMED = Limit("force", high=30.0, armed=True)
CROSSED = Crossing("force", 7, 1.0, 31.0, 30.0, "uN", "force reached 31 uN, its limit is 30", 0.01)


def guard() -> tuple[RemoteGuard, list[str], list[Crossing]]:
    stops: list[str] = []
    heard: list[Crossing] = []
    made = RemoteGuard(WallClock(), lambda *_: None)
    made.trip = stops.append
    made.subscribe(heard.append)
    return made, stops, heard


def test_a_crossing_stops_once_however_often_it_is_told() -> None:
    made, stops, heard = guard()
    made.take_limits((ARMED,), (), first=True)
    made.take_crossing(CROSSED)
    made.take_limits((ARMED,), (CROSSED,), first=False)
    made.take_crossing(CROSSED)
    assert stops == [CROSSED.text]
    assert heard == [CROSSED]


def test_a_crossing_that_the_topic_lost_is_found_in_the_report() -> None:
    made, stops, _ = guard()
    made.take_limits((ARMED,), (), first=True)
    made.take_limits((ARMED,), (CROSSED,), first=False)
    assert stops == [CROSSED.text]


def test_what_was_crossed_long_ago_and_is_over_stops_nothing_at_the_first_report() -> None:
    made, stops, _ = guard()
    made.take_limits((ARMED,), (CROSSED,), first=True)
    assert stops == []


def test_a_stop_that_fails_keeps_nobody_from_hearing(caplog: pytest.LogCaptureFixture) -> None:
    made, _, heard = guard()

    def fail(_reason: str) -> None:
        raise RuntimeError("the other station is away")

    made.trip = fail
    made.take_crossing(CROSSED)
    assert heard == [CROSSED]
    assert "the other station is away" in caplog.text


def test_silence_stops_once_and_only_while_a_limit_is_armed() -> None:
    made, stops, _ = guard()
    made.look_for_silence(10.0, "cut")
    assert stops == []
    made.look_for_silence(0.0, "")
    made.take_limits((ARMED,), (), first=True)
    for silent_s in (0.4, 0.6, 0.8):
        made.look_for_silence(silent_s, "cut")
    assert len(stops) == 1
    made.look_for_silence(0.1, "")
    made.look_for_silence(0.6, "cut")
    assert len(stops) == 2


# --- the clock --------------------------------------------------------------------------------


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
