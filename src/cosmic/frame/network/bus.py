"""What is published on a station, to receivers in its own process and to its listener."""

from collections.abc import Callable
from threading import Lock

from cosmic.frame.failure import FailurePolicy
from cosmic.frame.network.delivery import Backlog, Delivery
from cosmic.frame.network.transport import Receiver, Rule, Subscription

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
