"""`UDaqBuffer`: keeps the latest values and hands every chunk on (thesis 6.2.1, Fig. 6.12)."""

import threading
from collections.abc import Callable

from PySide6.QtCore import QMetaMethod, QObject, Signal

from cosmic.daqco.core.chunk import DataChunk
from cosmic.frame.buffer import DataBuffer
from cosmic.frame.events import Event, Unsubscribe
from cosmic.frame.overrides import override

Receiver = Callable[[DataChunk], None]


class UDaqBuffer(QObject):
    """Joins the acquisition with whoever wants its data; any thread.

    It is a producer for a `Connector`: `buffer` has the newest chunk when `data_ready` is emitted.

    Attributes
    ----------
    buffer : DataBuffer
        Keeps the newest chunk.

    Signals
    -------
    data_ready()
        There is a new latest value.
    data_chunk_ready(DataChunk)
        Every chunk, in order, by reference. Receivers in other threads get it queued.
    """

    data_ready = Signal()
    data_chunk_ready = Signal(object)

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self.buffer: DataBuffer[DataChunk] = DataBuffer()
        self._arrived: Event[DataChunk] = Event()
        self._samples = 0
        self._filled = threading.Event()
        self._connected = False

    @override
    def connectNotify(self, signal: QMetaMethod) -> None:
        # A signal to nobody costs microseconds as well, at 500 chunks a second and more.
        self._connected = True

    @property
    def latest_chunk(self) -> DataChunk | None:
        """The newest chunk; None before the first."""
        return self.buffer.latest()

    @property
    def samples(self) -> int:
        """How many samples a channel came in since the start."""
        return self._samples

    def get_latest_data(self) -> dict[str, float]:
        """Return the newest value of every channel in its physical unit; empty before any."""
        chunk = self.latest_chunk
        return chunk.newest() if chunk is not None else {}

    def subscribe(self, receiver: Receiver) -> Unsubscribe:
        """Call `receiver(chunk)` with every chunk; returns the function that ends it.

        It runs in the acquisition thread, in the order of subscription, and must return at once.
        """
        return self._arrived.subscribe(receiver)

    def wait_for_data(self, timeout_s: float) -> bool:
        """Wait until there is a latest value; False after `timeout_s` of wall time."""
        return self._filled.wait(timeout_s)

    def clear(self) -> None:
        """Forget what was there: another acquisition begins."""
        self._filled.clear()
        self.buffer.clear()
        self._samples = 0

    def put(self, chunk: DataChunk) -> None:
        """Take a chunk and hand it on; acquisition thread."""
        self.buffer.put(chunk)
        self._samples = chunk.first_sample + chunk.samples
        if not self._filled.is_set():
            self._filled.set()
        self._arrived.emit(chunk)
        if self._connected:
            self.data_ready.emit()
            self.data_chunk_ready.emit(chunk)
