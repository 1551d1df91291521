"""A station in another process or on another computer, as its user sees it."""

import logging
from collections.abc import Callable, Mapping
from threading import Condition, Lock
from typing import Final

from typing_extensions import override

from cosmic.frame.background import BackgroundJobs
from cosmic.frame.clock import WALL, Clock
from cosmic.frame.errors import CosmicError
from cosmic.frame.events import Event, notify
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.forked import FORKED
from cosmic.frame.network.addresses import topic_key
from cosmic.frame.network.client_session import ClientSession, What, read_hosted
from cosmic.frame.network.errors import CallRefused, StationAway, StationTimeout
from cosmic.frame.network.incoming import Incoming
from cosmic.frame.network.messages import Order
from cosmic.frame.network.ongoing import Answered, Ticket
from cosmic.frame.network.remote_task import RemoteTasks
from cosmic.frame.network.transport import (
    CALL_TIMEOUT_S,
    SHARED_PREFIX,
    Presence,
    PresenceListener,
    Receiver,
    Rule,
    Subscription,
)
from cosmic.frame.network.wire import Wire
from cosmic.frame.threads import WorkerThread, forbid_waiting_here, may_wait_here

logger = logging.getLogger(__name__)

BEAT_EVERY_S: Final = 0.1
RETRY_FIRST_S: Final = 0.02
RETRY_EVERY_S: Final = 0.25
MOVE_AGE_LIMIT_S: Final = 1.0
"""The oldest that a command which moves may be when it is begun."""
SILENCE_LIMIT_S: Final = 1.0
"""Silence after which the station counts as away."""
_BEAT_LIMIT_S: Final = 0.5


class ClientSideConnection(WorkerThread):
    """A `Transport` over a line, which connects by itself and says why it is away.

    While the station is there, heartbeats go to it ten times a second. Start it like any
    thread; `close` in a ``finally``.

    Parameters
    ----------
    station : str
        Name of the station.
    name : str
        How the station knows this client; with certificates, the name of its own.
    open_wire : callable
        Opens the line; tried again until it succeeds.
    """

    def __init__(
        self,
        station: str,
        name: str,
        open_wire: Callable[[], Wire],
        policy: FailurePolicy,
        clock: Clock = WALL,
    ) -> None:
        super().__init__(f"connection to {station}", policy)
        self._station = station
        self._open_wire = open_wire
        self._clock = clock
        self._lock = Lock()
        self._changed = Condition()
        self._wire: Wire | None = None
        self._hosted: dict[tuple[str, str], tuple[bool, bool]] = {}
        self._presence = Presence(station, here=False, why="not connected yet")
        self._presence_changed: Event[Presence] = Event()
        self._tasks = RemoteTasks(self._cancel_task)
        self._background = BackgroundJobs(f"cancels at {station}", policy)
        self._session = ClientSession(station, name, policy, clock, self._tasks.on_message)
        self._incoming: list[Incoming] = []
        self._closed = False
        self._holds_lease = False
        self._lease_orders = 0

    # What everybody uses

    @property
    def state(self) -> Presence:
        """Whether the station is there, and why not."""
        return self._presence

    @property
    def hosted(self) -> dict[str, list[str]]:
        """The applications there with their functions, as the station last told."""
        found: dict[str, list[str]] = {}
        for application, function in self._hosted:
            found.setdefault(application, []).append(function)
        return found

    @property
    def holds_lease(self) -> bool:
        """Whether this client may move things there, as the station last told."""
        return self._holds_lease and self._presence.here

    def wait_until_here(self, timeout_s: float) -> bool:
        """Wait for the station; False when it was not there after `timeout_s`."""
        until_s = self._clock.now_s() + timeout_s
        with self._changed:
            while not self._presence.here:
                if self._clock.now_s() >= until_s or self._closed:
                    return False
                self._clock.wait(self._changed, until_s)
        return True

    def call(
        self,
        application: str,
        function: str,
        arguments: Mapping[str, object] | None = None,
        *,
        timeout_s: float = CALL_TIMEOUT_S,
    ) -> object:
        """As `Transport.call`; what goes on there is followed by a `RemoteTask`."""
        wire = self._here()
        moves, at_once = self._hosted.get((application, function), (True, False))
        if not at_once:
            forbid_waiting_here(f"calling {application}.{function} at {self._station}")
        valid_s = min(timeout_s, MOVE_AGE_LIMIT_S) if moves else timeout_s
        what = What(Order.CALL, application, function, arguments or {}, valid_s, at_once)
        result = self._exchange(wire, what, timeout_s)
        if isinstance(result, Answered) and isinstance(result.result, Ticket):
            return Answered(self._tasks.made(result.result), result.state)
        return self._tasks.made(result) if isinstance(result, Ticket) else result

    def publish(self, topic: str, payload: object) -> None:
        """As `Transport.publish`."""
        if not topic.startswith(SHARED_PREFIX):
            raise CallRefused(f"topics that begin with {SHARED_PREFIX!r} only are open to clients")
        self._order(Order.PUBLISH, topic, {"payload": payload})

    def subscribe(self, topic: str, rule: Rule, receiver: Receiver) -> Subscription:
        """As `Transport.subscribe`; goes on after a reconnection."""
        key = topic_key(self._station, topic, rule)
        made = Incoming(topic, key, rule, receiver, self._policy, self._forget)
        with self._lock:
            if self._closed:
                raise StationAway(f"{self._station}: the connection is closed")
            self._incoming.append(made)
            wire = self._wire
        if wire is not None:
            made.connect(wire)
        return made

    def presence(self, listener: PresenceListener) -> Callable[[], None]:
        """As `Transport.presence`."""
        end = self._presence_changed.subscribe(listener)
        notify(listener, self._presence)
        return end

    def take_lease(self) -> None:
        """As `Transport.take_lease`."""
        self._order(Order.TAKE)
        self._note_lease(holds=True)

    def release_lease(self) -> None:
        """As `Transport.release_lease`."""
        self._note_lease(holds=False)
        self._order(Order.RELEASE)

    @override
    def on_fork(self) -> None:
        super().on_fork()
        self._lock, self._changed = Lock(), Condition()  # whoever held one is not here
        self._presence = Presence(self._station, here=False, why=FORKED)

    @override
    def request_end(self) -> None:
        super().request_end()
        with self._changed:
            self._changed.notify_all()

    def close(self) -> None:
        """As `Transport.close`."""
        self.request_end()
        self.join()
        self._background.request_end()
        self._background.join()
        with self._lock:
            if self._closed:
                return
            self._closed = True
            incoming, self._incoming = self._incoming, []
        for each in incoming:
            each.close()
        if self._wire is not None:
            self._wire.close()
        self._set_away("the connection is closed")

    # The keeper, in a thread of its own

    @override
    def run_body(self) -> None:
        retry_s = RETRY_FIRST_S
        try:
            while not self.end_requested:
                if self._presence.here:
                    self._beat()
                    retry_s = RETRY_FIRST_S
                else:
                    self._connect()
                    retry_s = min(2.0 * retry_s, RETRY_EVERY_S)
                self._pause(BEAT_EVERY_S if self._presence.here else retry_s)
        finally:
            self._session.end()

    def _pause(self, duration_s: float) -> None:
        until_s = self._clock.now_s() + duration_s
        with self._changed:
            if not self.end_requested:
                self._clock.wait(self._changed, until_s)

    def _connect(self) -> None:
        try:
            wire = self._wire or self._opened()
            self._hosted = read_hosted(self._session.begin(wire))
        except CosmicError as exc:
            self._session.end()
            self._set_away(str(exc))
            return
        self._set(Presence(self._station, here=True))

    def _opened(self) -> Wire:
        wire = self._open_wire()
        with self._lock:
            self._wire = wire
            incoming = list(self._incoming)
        for each in incoming:
            each.connect(wire)
        return wire

    def _beat(self) -> None:
        orders = self._lease_orders
        try:
            holds = self._order(Order.BEAT, timeout_s=_BEAT_LIMIT_S)
            if orders == self._lease_orders:  # else the answer is older than what it tells of
                self._holds_lease = holds is True
        except StationTimeout as exc:
            if self._session.unanswered_s > SILENCE_LIMIT_S:
                self._set_away(str(exc))
        except StationAway:
            return  # why, is known where it was found
        except CosmicError as exc:
            self._set_away(str(exc))

    # Questions to the station

    def _here(self) -> Wire:
        presence, wire = self._presence, self._wire
        if not presence.here or wire is None:
            raise StationAway(f"{self._station} is away: {presence.why}")
        return wire

    def _order(
        self,
        order: Order,
        function: str = "",
        arguments: Mapping[str, object] | None = None,
        timeout_s: float = CALL_TIMEOUT_S,
    ) -> object:
        what = What(order, "", function, arguments or {}, valid_s=min(timeout_s, 1.0))
        return self._exchange(self._here(), what, timeout_s)

    def _exchange(self, wire: Wire, what: What, timeout_s: float) -> object:
        try:
            return self._session.ask(wire, what, timeout_s)
        except StationAway as exc:
            self._set_away(str(exc))
            raise StationAway(f"{self._station} is away: {exc}") from exc

    def _cancel_task(self, number: str) -> None:
        if may_wait_here():
            self._order(Order.CANCEL, number)
        else:
            self._background.do(lambda: self._order(Order.CANCEL, number), lambda *_: None)

    def _note_lease(self, *, holds: bool) -> None:
        self._lease_orders += 1
        self._holds_lease = holds

    # State

    def _set_away(self, why: str) -> None:
        self._note_lease(holds=False)
        self._tasks.give_up(f"{self._station} is away: {why}; what it had begun to move stops")
        self._set(Presence(self._station, here=False, why=why))

    def _set(self, presence: Presence) -> None:
        with self._changed:
            before, self._presence = self._presence, presence
            self._changed.notify_all()
        if before == presence:
            return
        if before.here != presence.here:
            logger.info("%s is %s", self._station, "here" if presence.here else presence.why)
        self._presence_changed.emit(presence)

    def _forget(self, incoming: Incoming) -> None:
        with self._lock:
            self._incoming = [each for each in self._incoming if each is not incoming]
