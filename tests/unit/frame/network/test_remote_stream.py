"""A stream from another station: gaps, what does not belong in it, and when it comes."""

import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import pytest
from typing_extensions import override

from cosmic.frame.declaration import Declared, declaration_of, stream
from cosmic.frame.errors import ProtocolError
from cosmic.frame.network.remote_stream import RemoteStream
from cosmic.frame.network.transport import (
    PresenceListener,
    Receiver,
    Rule,
    Subscription,
    Transport,
)


@dataclass(frozen=True)
class Piece:
    first: int
    samples: int = 10


class Source(Declared):
    @stream(Rule.ALL, missing=lambda a, b: max(0, b.first - a.first - a.samples))
    def pieces(self, receiver: Callable[[Piece], object]) -> Callable[[], None]:
        raise NotImplementedError

    @stream(Rule.ALL)
    def events(self, receiver: Callable[[str], object]) -> Callable[[], None]:
        raise NotImplementedError


class Received(Subscription):
    def __init__(self) -> None:
        self.closed = False
        self.gaps = 0

    @property
    @override
    def lost(self) -> int:
        return self.gaps

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


@pytest.fixture
def transport() -> ByHand:
    return ByHand()


def made(transport: ByHand, name: str = "pieces") -> tuple[RemoteStream, list[object], list[None]]:
    received: list[None] = []
    declared = declaration_of(Source).streams[name]
    result = RemoteStream(declared, name, transport, lambda: received.append(None))
    got: list[object] = []
    result.subscribe(got.append)
    return result, got, received


def test_a_gap_is_reported_with_its_size_and_what_follows_is_handed_on(
    transport: ByHand, caplog: pytest.LogCaptureFixture
) -> None:
    pieces, got, received = made(transport)
    put = transport.receivers["pieces", Rule.ALL]
    beyond_32_bit = 2**40
    put(Piece(beyond_32_bit))
    put(Piece(beyond_32_bit + 10))
    assert pieces.missed == 0
    with caplog.at_level(logging.ERROR):
        put(Piece(beyond_32_bit + 47))
    assert pieces.missed == 27
    assert "27 were lost" in caplog.text
    assert len(received) == 1
    assert got == [Piece(beyond_32_bit + each) for each in (0, 10, 47)]


def test_numbers_that_begin_anew_are_no_gap(transport: ByHand) -> None:
    pieces, got, received = made(transport)
    put = transport.receivers["pieces", Rule.ALL]
    for first in (500, 20, 30):
        put(Piece(first))
    assert (pieces.missed, received) == (0, [])
    assert got == [Piece(500), Piece(20), Piece(30)]


def test_what_the_line_lost_is_counted_where_nothing_else_says_it(transport: ByHand) -> None:
    events, got, received = made(transport, "events")
    put = transport.receivers["events", Rule.ALL]
    put("one")
    transport.subscriptions[0].gaps = 3
    put("five")
    put("six")
    assert events.missed == 3
    assert (got, len(received)) == (["one", "five", "six"], 1)


@pytest.mark.parametrize("payload", [None, 5, "x", {"first": 1}])
def test_what_does_not_belong_in_it_is_refused(transport: ByHand, payload: object) -> None:
    pieces, got, _ = made(transport)
    with pytest.raises(ProtocolError):
        transport.receivers["pieces", Rule.ALL](payload)
    assert pieces.newest is None
    assert got == []


def test_it_comes_only_while_somebody_wants_it(
    transport: ByHand, monkeypatch: pytest.MonkeyPatch
) -> None:
    pieces = RemoteStream(
        declaration_of(Source).streams["pieces"], "pieces", transport, lambda: None
    )
    assert transport.subscriptions == []
    end = pieces.subscribe(lambda _: None)
    assert len(transport.subscriptions) == 1
    end()
    pieces.tidy()
    assert not transport.subscriptions[0].closed, "somebody may want it again soon"
    monkeypatch.setattr("cosmic.frame.network.remote_stream.LINGER_S", 0.0)
    pieces.tidy()
    assert transport.subscriptions[0].closed
    pieces.subscribe(lambda _: None)
    assert len(transport.subscriptions) == 2
    pieces.close()
    assert transport.subscriptions[1].closed


def test_one_that_is_kept_comes_all_the_time(
    transport: ByHand, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("cosmic.frame.network.remote_stream.LINGER_S", 0.0)
    pieces = RemoteStream(
        declaration_of(Source).streams["pieces"], "pieces", transport, lambda: None
    )
    pieces.keep()
    pieces.tidy()
    assert not transport.subscriptions[0].closed
    transport.receivers["pieces", Rule.ALL](Piece(1))
    assert pieces.newest == Piece(1)
    pieces.clear()
    assert pieces.newest is None
