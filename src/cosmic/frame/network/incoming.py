"""A topic of another station being received; it outlives reconnections."""

from collections.abc import Callable
from threading import Lock
from typing import Any

from typing_extensions import override

from cosmic.frame.errors import ProtocolError
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.network.codec import decode
from cosmic.frame.network.delivery import Backlog, InboxReader
from cosmic.frame.network.transport import Receiver, Rule, Subscription
from cosmic.frame.network.wire import Wire


class Incoming(Subscription):
    """Takes messages off the line, counts gaps, and calls the receiver in another thread.

    Under the rule ALL the line is emptied at once into a backlog, so that a slow receiver holds
    up nothing else on it. Under LATEST the engine itself keeps the newest only.
    """

    def __init__(
        self,
        topic: str,
        key: str,
        rule: Rule,
        receiver: Receiver,
        policy: FailurePolicy,
        on_close: "Callable[[Incoming], None]",
    ) -> None:
        self._topic = topic
        self._key = key
        self._rule = rule
        self._receiver: Receiver | None = receiver
        self._policy = policy
        self._on_close = on_close
        self._lock = Lock()
        self._backlog: Backlog[bytes] = Backlog(rule)
        self._last: tuple[str, int] | None = None
        self._gaps = 0
        self._threads: list[InboxReader[Any]] = []

    def connect(self, wire: Wire) -> None:
        """Begin to receive, once."""
        with self._lock:
            if self._threads or self._receiver is None:
                return
            inlet = wire.inlet(self._key, self._rule)
            name = f"topic {self._topic}"
            if self._rule is Rule.LATEST:
                self._threads = [InboxReader(name, self._policy, inlet, self._deliver)]
            else:
                self._threads = [
                    InboxReader(f"{name} comes", self._policy, inlet, self._keep),
                    InboxReader(name, self._policy, self._backlog, self._deliver),
                ]
            for thread in self._threads:
                thread.start()

    @property
    @override
    def lost(self) -> int:
        return self._gaps

    @override
    def close(self) -> None:
        with self._lock:
            self._receiver = None
            threads, self._threads = self._threads, []
        for thread in threads:
            thread.request_end()
        for thread in threads:
            thread.join()
        self._on_close(self)

    def _keep(self, message: bytes) -> None:
        self._backlog.put(message)  # what finds no room shows as a gap in the numbers

    def _deliver(self, message: bytes) -> None:
        receiver = self._receiver
        if receiver is None:
            return
        where = f"receiver of {self._topic!r}"
        try:
            incarnation, number, payload = _read(message)
            self._count(incarnation, number)
            receiver(payload)
        except Exception as exc:  # noqa: BLE001 - the edge to foreign code
            self._policy.report(exc, where)

    def _count(self, incarnation: str, number: int) -> None:
        if self._rule is Rule.ALL and self._last is not None and self._last[0] == incarnation:
            self._gaps += max(0, number - self._last[1] - 1)
        self._last = (incarnation, number)


def _read(message: bytes) -> tuple[str, int, object]:
    parts = decode(message)
    if not (isinstance(parts, list) and [type(each) for each in parts[:2]] == [str, int]):
        raise ProtocolError("something broken was published")
    if len(parts) != 3:
        raise ProtocolError("something broken was published")
    return parts[0], parts[1], parts[2]
