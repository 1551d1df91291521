"""From whoever publishes to whoever receives, so that a slow receiver delays nobody."""

from abc import abstractmethod
from collections import deque
from collections.abc import Callable, Sized
from threading import Condition
from typing import Any, Final, Generic, Protocol, TypeVar

from typing_extensions import override

from cosmic.frame.failure import FailurePolicy
from cosmic.frame.network.transport import Receiver, Rule, Subscription
from cosmic.frame.threads import WorkerThread

T = TypeVar("T")
T_co = TypeVar("T_co", covariant=True)

BACKLOG_ITEMS: Final = 100_000
BACKLOG_BYTES: Final = 256 * 1024 * 1024


class InboxClosed(Exception):  # noqa: N818 - reads as what happened
    """Nothing comes out of it any more."""


class Inbox(Protocol[T_co]):
    """Where one thread takes things from."""

    @abstractmethod
    def take(self) -> T_co:
        """Wait for the next and return it.

        Raises
        ------
        InboxClosed
            It was closed.
        """

    @abstractmethod
    def close(self) -> None:
        """Let `take` raise from now on; any thread."""


class Backlog(Inbox[T], Generic[T]):
    """An inbox in memory: one value that is replaced, or a queue with a limit.

    Parameters
    ----------
    rule : Rule
        LATEST keeps the newest only; ALL keeps everything up to the limits and counts the rest.
    """

    def __init__(
        self, rule: Rule, max_items: int = BACKLOG_ITEMS, max_bytes: int = BACKLOG_BYTES
    ) -> None:
        self._items: deque[tuple[T, int]] = deque()
        self._latest_only = rule is Rule.LATEST
        self._max_items = max_items
        self._max_bytes = max_bytes
        self._bytes = 0
        self._changed = Condition()
        self._closed = False
        self._lost = 0

    @property
    def lost(self) -> int:
        """How many found no room under the rule ALL."""
        return self._lost

    def __len__(self) -> int:
        return len(self._items)

    def put(self, item: T) -> bool:
        """Add `item`; returns at once, False when it found no room."""
        size = size_of(item)
        with self._changed:
            if self._closed:
                return False
            if self._latest_only:
                self._items.clear()
            elif len(self._items) >= self._max_items or self._bytes + size > self._max_bytes:
                self._lost += 1
                return False
            self._items.append((item, size))
            self._bytes += size
            self._changed.notify()
        return True

    @override
    def take(self) -> T:
        with self._changed:
            while not self._items:
                if self._closed:
                    raise InboxClosed
                self._changed.wait()
            item, size = self._items.popleft()
            self._bytes -= size
            return item

    @override
    def close(self) -> None:
        with self._changed:
            self._closed = True
            self._changed.notify_all()


def size_of(item: object) -> int:
    """Return about how many bytes `item` holds; arrays and bytes count, the rest is small."""
    nbytes = getattr(item, "nbytes", None)
    if isinstance(nbytes, int):
        return nbytes
    if isinstance(item, (bytes, str)):
        return len(item)
    if isinstance(item, (tuple, list)):
        return sum(size_of(each) for each in item)
    return len(item) if isinstance(item, Sized) else 1


class InboxReader(WorkerThread, Generic[T]):
    """A thread that hands everything that comes out of an inbox to a function."""

    def __init__(
        self, name: str, policy: FailurePolicy, inbox: Inbox[T], handle: Callable[[T], None]
    ) -> None:
        super().__init__(name, policy)
        self._inbox = inbox
        self._handle = handle

    @override
    def run_body(self) -> None:
        while not self.end_requested:
            try:
                item = self._inbox.take()
            except InboxClosed:
                return
            self._handle(item)

    @override
    def request_end(self) -> None:
        super().request_end()
        self._inbox.close()


class Delivery(Subscription):
    """A subscription: takes what comes and calls the receiver in a thread of its own.

    A receiver that raises is reported to the policy and called again with the next.
    """

    def __init__(
        self,
        topic: str,
        inbox: Inbox[Any],
        receiver: Receiver,
        policy: FailurePolicy,
        *,
        lost: Callable[[], int],
        on_close: Callable[[], None],
    ) -> None:
        self._receiver: Receiver | None = receiver
        self._where = f"receiver of {topic!r}"
        self._policy = policy
        self._lost = lost
        self._on_close = on_close
        self._thread = InboxReader(f"topic {topic}", policy, inbox, self._deliver)
        self._thread.start()

    @property
    @override
    def lost(self) -> int:
        return self._lost()

    @override
    def close(self) -> None:
        self._receiver = None
        self._on_close()
        self._thread.request_end()
        self._thread.join()

    def _deliver(self, payload: object) -> None:
        receiver = self._receiver
        if receiver is None:
            return
        try:
            receiver(payload)
        except Exception as exc:  # noqa: BLE001 - the edge to foreign code
            self._policy.report(exc, self._where)
