"""Continuous data between threads that do not know each other (thesis 5.2.2, Fig. 5.8-5.10)."""

from collections import deque
from collections.abc import Callable
from threading import Lock
from typing import Generic, Protocol, TypeVar

from PySide6.QtCore import QObject, Qt, Signal, SignalInstance

T = TypeVar("T")
S = TypeVar("S")


class DataBuffer(Generic[T]):
    """Thread-safe store of the newest values; the producer notifies (Fig. 5.8).

    Parameters
    ----------
    capacity : int
        How many values are kept. Older ones go, and are counted in `lost` when nobody took them.
    """

    def __init__(self, capacity: int = 1) -> None:
        if capacity < 1:
            raise ValueError(f"a buffer holds at least one value, got {capacity}")
        self._values: deque[T] = deque(maxlen=capacity)
        self._latest: tuple[T, ...] = ()
        self._lock = Lock()
        self._lost = 0

    def put(self, value: T) -> None:
        """Store `value`; returns at once."""
        with self._lock:
            if len(self._values) == self._values.maxlen:
                self._lost += 1
            self._values.append(value)
            self._latest = (value,)

    def latest(self) -> T | None:
        """Return the newest value, or None before the first; it stays in the buffer."""
        latest = self._latest
        return latest[0] if latest else None

    def take(self) -> list[T]:
        """Remove and return all values, oldest first."""
        with self._lock:
            values = list(self._values)
            self._values.clear()
        return values

    def clear(self) -> None:
        """Forget all values, the newest too; they do not count as lost."""
        with self._lock:
            self._values.clear()
            self._latest = ()

    def __len__(self) -> int:
        return len(self._values)

    @property
    def lost(self) -> int:
        """How many values were overwritten before anybody took them."""
        return self._lost


class ActiveBuffer(QObject, Generic[S, T]):
    """A buffer that converts what it is given and then notifies by itself (Fig. 5.10).

    Parameters
    ----------
    convert : callable
        From what the producer delivers to what the consumer wants; runs in the producer's thread.
    """

    data_ready = Signal()

    def __init__(self, convert: Callable[[S], T], capacity: int = 1) -> None:
        super().__init__()
        self._convert = convert
        self._buffer: DataBuffer[T] = DataBuffer(capacity)

    @property
    def buffer(self) -> DataBuffer[T]:
        """Where the converted values are."""
        return self._buffer

    def put(self, value: S) -> None:
        """Convert and store `value`, then emit `data_ready`; any thread."""
        self._buffer.put(self._convert(value))
        self.data_ready.emit()


class Producer(Protocol[T]):
    """Owns a buffer and says when there is something new in it."""

    @property
    def buffer(self) -> DataBuffer[T]:
        """The buffer it fills."""

    @property
    def data_ready(self) -> SignalInstance:
        """Emitted after each `put`, without arguments."""


class Consumer(Protocol[T]):
    """Takes values out of a buffer when it is told that there are some."""

    def set_buffer(self, buffer: DataBuffer[T]) -> None:
        """Remember where to take values from."""

    def receive_notification(self) -> None:
        """Slot: there is something new."""


class Connector(Generic[T]):
    """Joins a producer and a consumer, which never learn of each other (Fig. 5.9)."""

    def __init__(self, producer: Producer[T], consumer: Consumer[T]) -> None:
        self._producer = producer
        self._consumer = consumer
        consumer.set_buffer(producer.buffer)
        producer.data_ready.connect(consumer.receive_notification, Qt.ConnectionType.AutoConnection)

    def disconnect(self) -> None:
        """End the connection; values already in the buffer stay there."""
        self._producer.data_ready.disconnect(self._consumer.receive_notification)
