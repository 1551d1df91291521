"""Messages on their way out, so that whoever publishes never waits for the line."""

import logging
from dataclasses import dataclass
from threading import Lock

from cosmic.frame.errors import ProtocolError
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.network.addresses import topic_key
from cosmic.frame.network.codec import encode
from cosmic.frame.network.delivery import Backlog, InboxReader
from cosmic.frame.network.errors import StationAway
from cosmic.frame.network.transport import Rule
from cosmic.frame.network.wire import Outlet, Wire
from cosmic.frame.threads import WorkerThread

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class _Parcel:
    outlet: Outlet
    value: object

    @property
    def nbytes(self) -> int:
        """Size by which a backlog is limited."""
        return int(getattr(self.value, "nbytes", 0)) or 256


class _NewestOfEach:
    """An inbox that keeps the newest parcel of each outlet."""

    def __init__(self) -> None:
        self._waiting: dict[int, _Parcel] = {}
        self._lock = Lock()
        self._bell: Backlog[None] = Backlog(Rule.LATEST)

    def put(self, parcel: _Parcel) -> None:
        with self._lock:
            self._waiting[id(parcel.outlet)] = parcel
        self._bell.put(None)

    def take(self) -> list[_Parcel]:
        self._bell.take()
        with self._lock:
            found = list(self._waiting.values())
            self._waiting.clear()
        return found

    def close(self) -> None:
        self._bell.close()


class Outbox:
    """Sends what is published: frames in one thread, what must not be lost in another.

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
            InboxReader(f"{station} sends all", policy, self._all, self._send),
            InboxReader(f"{station} sends newest", policy, self._latest, self._send_each),
        ]
        for thread in self._threads:
            thread.start()

    def publish(self, topic: str, number: int, payload: object) -> None:
        """Queue `payload` for everybody who wants it; returns at once."""
        value = [self._incarnation, number, payload]
        for rule in Rule:
            outlet = self._outlet(topic_key(self._station, topic, rule), rule)
            if outlet is None or not outlet.wanted:
                continue
            if rule is Rule.LATEST:
                self._latest.put(_Parcel(outlet, value))
            else:
                self.send(outlet, value)

    def send(self, outlet: Outlet, value: object) -> None:
        """Queue a message that must not be lost; returns at once."""
        if not self._all.put(_Parcel(outlet, value)):
            logger.warning("%s: a message found no room and was not sent", self._station)

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

    def _outlet(self, key: str, rule: Rule) -> Outlet | None:
        with self._lock:
            found = self._outlets.get((key, rule))
            if found is None:
                try:
                    found = self._wire.outlet(key, rule)
                except StationAway:  # the wire is closed
                    return None
                self._outlets[key, rule] = found
            return found

    def _send_each(self, parcels: list[_Parcel]) -> None:
        for each in parcels:
            self._send(each)

    def _send(self, parcel: _Parcel) -> None:
        try:
            parcel.outlet.put(encode(parcel.value))
        except ProtocolError as exc:
            logger.error("%s: something published cannot travel: %s", self._station, exc)
        except StationAway as exc:
            logger.debug("%s: not sent: %s", self._station, exc)
