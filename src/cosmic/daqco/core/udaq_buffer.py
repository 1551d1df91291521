"""`UDaqBuffer`: keeps the latest values and hands every chunk on (thesis 6.2.1, Fig. 6.12)."""

from collections.abc import Callable
from threading import Event, Lock

from PySide6.QtCore import QObject, Signal

from cosmic.daqco.core.chunk import DataChunk
from cosmic.frame.listeners import tell

Receiver = Callable[[DataChunk], None]


class UDaqBuffer(QObject):
    """Joins the acquisition with whoever wants its data; any thread.

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
        self._lock = Lock()
        self._receivers: tuple[Receiver, ...] = ()
        self._latest: DataChunk | None = None
        self._samples = 0
        self._filled = Event()

    @property
    def latest_chunk(self) -> DataChunk | None:
        """The newest chunk; None before the first."""
        return self._latest

    @property
    def samples(self) -> int:
        """How many samples a channel came in since the start."""
        return self._samples

    @property
    def lost(self) -> int:
        """How many samples a channel did not reach this process: none on the way to here."""
        return 0

    def get_latest_data(self) -> dict[str, float]:
        """Return the newest value of every channel in its physical unit; empty before any."""
        chunk = self._latest
        if chunk is None:
            return {}
        newest = (
            float(scale.apply(volts))
            for scale, volts in zip(chunk.scales, chunk.volts[:, -1], strict=True)
        )
        return dict(zip(chunk.channels, newest, strict=True))

    def subscribe(self, receiver: Receiver) -> Callable[[], None]:
        """Call `receiver(chunk)` with every chunk; returns the function that ends it.

        It runs in the acquisition thread, in the order of subscription, and must return at once.
        """
        with self._lock:
            self._receivers = (*self._receivers, receiver)

        def unsubscribe() -> None:
            with self._lock:
                self._receivers = tuple(each for each in self._receivers if each is not receiver)

        return unsubscribe

    def follow(self, receiver: Receiver) -> Callable[[], None]:
        """As `subscribe`: here a display gets every chunk as well."""
        return self.subscribe(receiver)

    def wait_for_data(self, timeout_s: float) -> bool:
        """Wait until there is a latest value; False after `timeout_s` of wall time."""
        return self._filled.wait(timeout_s)

    def clear(self) -> None:
        """Forget what was there: another acquisition begins."""
        self._filled.clear()
        self._latest, self._samples = None, 0

    def put(self, chunk: DataChunk) -> None:
        """Take a chunk and hand it on; acquisition thread."""
        self._latest = chunk
        self._samples = chunk.first_sample + chunk.samples
        if not self._filled.is_set():
            self._filled.set()
        tell(self._receivers, chunk)
        self.data_ready.emit()
        self.data_chunk_ready.emit(chunk)
