"""A station: applications under one name, with their topics, their lease and who uses them."""

from collections.abc import Callable, Mapping
from threading import Lock
from typing import Protocol, runtime_checkable

from cosmic.frame.clock import WALL, Clock
from cosmic.frame.events import Event, notify
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.network.delivery import Backlog, Delivery
from cosmic.frame.network.errors import CallRefused
from cosmic.frame.network.invoker import ApplicationInvoker
from cosmic.frame.network.lease import StationLease
from cosmic.frame.network.transport import (
    SHARED_PREFIX,
    Presence,
    PresenceListener,
    Receiver,
    Rule,
    Subscription,
)

Tap = Callable[[str, int, object], None]
Wants = Callable[[str], bool]


class Bus:
    """Topics of one station; any thread. Publishing never waits for a receiver."""

    def __init__(self, policy: FailurePolicy) -> None:
        self._policy = policy
        self._lock = Lock()
        self._backlogs: dict[str, tuple[Backlog[object], ...]] = {}
        self._numbers: dict[str, int] = {}
        self._taps: tuple[Tap, ...] = ()
        self._wants: tuple[Wants, ...] = ()

    def publish(self, topic: str, payload: object) -> None:
        """Hand `payload` to everybody who subscribed to `topic`; returns at once.

        It is handed on by reference: it must not change afterwards.
        """
        with self._lock:  # held while it is queued, so that everybody sees the same order
            number = self._numbers.get(topic, 0) + 1
            self._numbers[topic] = number
            for backlog in self._backlogs.get(topic, ()):
                backlog.put(payload)
            for tap in self._taps:
                tap(topic, number, payload)

    def subscribe(self, topic: str, rule: Rule, receiver: Receiver) -> Subscription:
        """Have `receiver(payload)` called in a thread of its own."""
        backlog: Backlog[object] = Backlog(rule)

        def remove() -> None:
            with self._lock:
                left = tuple(each for each in self._backlogs[topic] if each is not backlog)
                self._backlogs[topic] = left

        with self._lock:
            self._backlogs[topic] = (*self._backlogs.get(topic, ()), backlog)
        return Delivery(
            topic, backlog, receiver, self._policy, lost=lambda: backlog.lost, on_close=remove
        )

    def wanted(self, topic: str) -> bool:
        """Return whether anybody receives what is published to `topic`.

        Over a line it is known only after something has been published to it.
        """
        return bool(self._backlogs.get(topic)) or any(wants(topic) for wants in self._wants)

    def tap(self, tap: Tap, wants: Wants | None = None) -> Callable[[], None]:
        """Call `tap(topic, number, payload)` with everything; it must return at once.

        `wants(topic)` says whether it has anybody to hand a topic on to. Returns the function that
        ends it.
        """
        asked = () if wants is None else (wants,)
        with self._lock:
            self._taps = (*self._taps, tap)
            self._wants = (*self._wants, *asked)

        def remove() -> None:
            with self._lock:
                self._taps = tuple(each for each in self._taps if each is not tap)
                self._wants = tuple(each for each in self._wants if each not in asked)

        return remove


LEASE_TOPIC = "station/lease"


@runtime_checkable
class Hosted(Protocol):
    """An application that wants to know where it is hosted, to publish there."""

    def on_hosted(self, station: "Station") -> None:
        """Take note of the station; called once, by `Station.host`."""


class Station:
    """What is hosted here, for a `ServerListener` to let others in.

    Parameters
    ----------
    name : str
        How others call it: letters, digits, `-` and `_`.
    policy : FailurePolicy
        Told of mistakes in the applications.
    lease : StationLease or None
        Who may move; a new one, offered to everybody, by default.
    """

    def __init__(
        self,
        name: str,
        policy: FailurePolicy,
        lease: StationLease | None = None,
        clock: Clock = WALL,
    ) -> None:
        self._name = checked_name(name)
        self._policy = policy
        self._clock = clock
        self._lease = lease or StationLease(f"the operator at {name}", clock=clock)
        self._bus = Bus(policy)
        self._lock = Lock()
        self._invokers: dict[str, ApplicationInvoker] = {}
        self._clients: dict[str, Presence] = {}
        self._client_changed: Event[Presence] = Event()
        self._lease.subscribe(lambda state: self._bus.publish(LEASE_TOPIC, state))

    @property
    def name(self) -> str:
        """How others call it."""
        return self._name

    @property
    def policy(self) -> FailurePolicy:
        """Told of mistakes in the applications."""
        return self._policy

    @property
    def clock(self) -> Clock:
        """The clock by which it judges how old a command is."""
        return self._clock

    @property
    def lease(self) -> StationLease:
        """Who may move."""
        return self._lease

    @property
    def bus(self) -> Bus:
        """Its topics."""
        return self._bus

    @property
    def invokers(self) -> Mapping[str, ApplicationInvoker]:
        """The applications it hosts."""
        return dict(self._invokers)

    def host(self, name: str, application: object) -> ApplicationInvoker:
        """Offer what is marked with `remote` in `application` under `name`.

        An application that is `Hosted` is told of the station.

        Raises
        ------
        TypeError
            A marked function has a signature that cannot be checked.
        ValueError
            There is one of that name, or the name is none.
        """
        invoker = ApplicationInvoker(checked_name(name), application, self._lease, self._policy)
        with self._lock:
            if name in self._invokers:
                raise ValueError(f"{self._name} hosts an application {name!r} already")
            self._invokers[name] = invoker
        if isinstance(application, Hosted):
            application.on_hosted(self)
        return invoker

    def invoker(self, name: object) -> ApplicationInvoker:
        """Return the way into an application.

        Raises
        ------
        CallRefused
            There is none of that name.
        """
        found = self._invokers.get(name) if isinstance(name, str) else None
        if found is None:
            hosted = ", ".join(self._invokers) or "none"
            raise CallRefused(f"{self._name} hosts no {str(name)[:60]!r}; it hosts: {hosted}")
        return found

    def publish(self, topic: str, payload: object) -> None:
        """Publish to a topic of the station; returns at once. `payload` must not change later."""
        self._bus.publish(topic, payload)

    def wanted(self, topic: str) -> bool:
        """Return whether anybody receives a topic; see `Bus.wanted`."""
        return self._bus.wanted(topic)

    def publish_shared(self, who: str, topic: object, payload: object) -> None:
        """Publish for a client, if the topic is open to clients.

        Raises
        ------
        CallRefused
            It is not.
        """
        if not (isinstance(topic, str) and topic.startswith(SHARED_PREFIX)):
            raise CallRefused(f"{who} may publish to topics that begin with {SHARED_PREFIX!r} only")
        self._bus.publish(topic, payload)

    def presence(self, listener: PresenceListener) -> Callable[[], None]:
        """Call `listener` with each client that is here, and at each change."""
        with self._lock:
            end = self._client_changed.subscribe(listener)
            here = list(self._clients.values())
        for each in here:
            notify(listener, each)
        return end

    def note_client(self, key: str, presence: Presence) -> None:
        """Remember that a client came or went, and tell; for whoever lets clients in."""
        with self._lock:
            if presence.here:
                self._clients[key] = presence
            elif self._clients.pop(key, None) is None:
                return
        self._client_changed.emit(presence)


def checked_name(name: str) -> str:
    """Return `name` if it can stand in an address.

    Raises
    ------
    ValueError
        It cannot.
    """
    if not name or not all((each.isalnum() and each.isascii()) or each in "-_" for each in name):
        raise ValueError(f"a name has letters, digits, - and _, got {name!r}")
    return name
