"""The queue of a thread whose work takes wall time, however fast the platform's clock runs."""

from queue import SimpleQueue
from typing import Generic, TypeVar

from cosmic.frame.clock import Clock

T = TypeVar("T")


class Inbox(Generic[T]):
    """What waits for one thread; it is at work from `put` on until it finds nothing here.

    Any thread may put; one takes.
    """

    def __init__(self, clock: Clock) -> None:
        self._queue: SimpleQueue[T] = SimpleQueue()
        self._worker = clock.worker()

    def put(self, item: T) -> None:
        """Put something at the end."""
        self._worker.busy()
        self._queue.put(item)

    def get(self, timeout_s: float) -> T:
        """Take the first, and wait for it if need be.

        Raises
        ------
        queue.Empty
            There was nothing in `timeout_s` of wall time.
        """
        if timeout_s > 0.0 and self._queue.empty():
            self._worker.idle()
        return self._queue.get(timeout=timeout_s)

    def get_nowait(self) -> T:
        """Take the first; raises `queue.Empty` where there is none."""
        return self._queue.get_nowait()

    def empty(self) -> bool:
        """Tell whether there is nothing."""
        return self._queue.empty()

    @property
    def waiting(self) -> int:
        """How many wait, for those who count them; it may have changed by now."""
        return self._queue.qsize()

    def close(self) -> None:
        """Say that nothing will be taken any more."""
        self._worker.close()
