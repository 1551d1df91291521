"""Messages on their way out, so that whoever publishes never waits for the line."""

import logging
from dataclasses import dataclass
from threading import Lock

from typing_extensions import override

from cosmic.frame.errors import ProtocolError
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.network.addresses import topic_key
from cosmic.frame.network.codec import encode
from cosmic.frame.network.delivery import Backlog, Inbox, InboxReader, size_of
from cosmic.frame.network.errors import StationAway
from cosmic.frame.network.transport import Rule
from cosmic.frame.network.wire import Outlet, Wire
from cosmic.frame.threads import WorkerThread

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class _Parcel:
    """A message on its way; without an outlet it goes to everybody who wants the topic."""

    value: object
    topic: str = ""
    outlet: Outlet | None = None

    @property
    def nbytes(self) -> int:
        """Size by which a backlog is limited."""
        return size_of(self.value) + 256


class _NewestOfEach(Inbox[list[_Parcel]]):
    """An inbox that keeps the newest parcel of each topic."""

    def __init__(self) -> None:
        self._waiting: dict[str, _Parcel] = {}
        self._lock = Lock()
        self._bell: Backlog[None] = Backlog(Rule.LATEST)

    def put(self, parcel: _Parcel) -> None:
        """Keep `parcel` in place of the one before; returns at once."""
        with self._lock:
            self._waiting[parcel.topic] = parcel
        self._bell.put(None)

    @override
    def take(self) -> list[_Parcel]:
        self._bell.take()
        with self._lock:
            found = list(self._waiting.values())
            self._waiting.clear()
        return found

    @override
    def close(self) -> None:
        self._bell.close()


class Outbox:
    """Sends what is published: the newest in one thread, what must not be lost in another.

    A line that is full delays only the thread that sends on it. What finds no room is not sent;
    receivers count the gap in the numbers.
    """

    def __init__(self, station: str, incarnation: str, wire: Wire, policy: FailurePolicy) -> None:
        self._station = station
        self._incarnation = incarnation
        self._wire = wire
        self._lock = Lock()
        self._outlets: dict[tuple[str, Rule], Outlet] = {}
        self._all: Backlog[_Parcel] = Backlog(Rule.ALL)
        self._latest = _NewestOfEach()
        self._threads: list[WorkerThread] = [
            InboxReader(f"{station} sends all", policy, self._all, self._send_in_order),
            InboxReader(f"{station} sends newest", policy, self._latest, self._send_newest),
        ]
        for thread in self._threads:
            thread.start()

    def publish(self, topic: str, number: int, payload: object) -> None:
        """Queue `payload` for everybody who wants it; returns at once."""
        parcel = _Parcel([self._incarnation, number, payload], topic)
        if self._may_be_wanted(topic, Rule.LATEST):
            self._latest.put(parcel)
        if self._may_be_wanted(topic, Rule.ALL):
            self._queue(parcel)

    def wants(self, topic: str) -> bool:
        """Return whether anybody receives a topic; False before it was published to."""
        found = (self._outlets.get((topic, rule)) for rule in Rule)
        return any(outlet is not None and outlet.wanted for outlet in found)

    def send(self, outlet: Outlet, value: object) -> None:
        """Queue a message that must not be lost; returns at once."""
        self._queue(_Parcel(value, outlet=outlet))

    def close(self) -> None:
        """Send no more and release every outlet."""
        for thread in self._threads:
            thread.request_end()
        for thread in self._threads:
            thread.join()
        with self._lock:
            outlets, self._outlets = list(self._outlets.values()), {}
        for each in outlets:
            each.close()

    def _queue(self, parcel: _Parcel) -> None:
        if not self._all.put(parcel):
            logger.debug("%s: a message found no room and was not sent", self._station)

    def _may_be_wanted(self, topic: str, rule: Rule) -> bool:
        # Making an outlet may have to wait for the line, so that is left to the sending threads.
        outlet = self._outlets.get((topic, rule))
        return outlet is None or outlet.wanted

    # In the sending threads

    def _send_in_order(self, parcel: _Parcel) -> None:
        self._send(parcel, Rule.ALL)

    def _send_newest(self, parcels: list[_Parcel]) -> None:
        for each in parcels:
            self._send(each, Rule.LATEST)

    def _send(self, parcel: _Parcel, rule: Rule) -> None:
        try:
            outlet = parcel.outlet or self._outlet(parcel.topic, rule)
            if outlet.wanted:
                outlet.put(encode(parcel.value))
        except ProtocolError as exc:
            logger.error("%s: something published cannot travel: %s", self._station, exc)
        except StationAway as exc:
            logger.debug("%s: not sent: %s", self._station, exc)

    def _outlet(self, topic: str, rule: Rule) -> Outlet:
        with self._lock:
            found = self._outlets.get((topic, rule))
            if found is None:
                found = self._wire.outlet(topic_key(self._station, topic, rule), rule)
                self._outlets[topic, rule] = found
            return found
