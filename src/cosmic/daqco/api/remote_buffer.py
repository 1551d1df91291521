"""Samples from another station: the newest for a display, and all for whoever wants them."""

import logging
from collections.abc import Callable
from threading import Event, Lock
from typing import Final

from cosmic.daqco.api.station_report import CHUNKS, DISPLAY, DaqPiece, checked_piece
from cosmic.daqco.core.chunk import DataChunk
from cosmic.frame.clock import WALL
from cosmic.frame.listeners import tell
from cosmic.frame.network.transport import Rule, Subscription, Transport

logger = logging.getLogger(__name__)

Receiver = Callable[[DataChunk], None]
LINGER_S: Final = 2.0
"""How long all samples still come after nobody wants them any more."""


class RemoteBuffer:
    """What a `UDaqBuffer` is at home; any thread.

    The newest samples always come. All of them come only while somebody subscribes, in a thread
    of their own; their numbers are checked, and a gap is told with its size.
    """

    def __init__(self, transport: Transport, on_loss: Callable[[], object]) -> None:
        self._transport = transport
        self._on_loss = on_loss
        self._lock = Lock()
        self._receivers: tuple[Receiver, ...] = ()
        self._followers: tuple[Receiver, ...] = ()
        self._latest: DataChunk | None = None
        self._filled = Event()
        self._heard_wall_s = -float("inf")
        self._run, self._next, self._lost = "", 0, 0
        self._display: Subscription | None = None
        self._all: Subscription | None = None
        self._unwanted_wall_s = 0.0

    @property
    def latest_chunk(self) -> DataChunk | None:
        """The newest piece; None before the first."""
        return self._latest

    @property
    def samples(self) -> int:
        """How many samples a channel came in since the start of the acquisition."""
        chunk = self._latest
        return chunk.first_sample + chunk.samples if chunk is not None else 0

    @property
    def lost(self) -> int:
        """How many samples a channel were wanted and did not reach this process."""
        return self._lost

    @property
    def heard_wall_s(self) -> float:
        """When the newest samples came, on the clock of the wall."""
        return self._heard_wall_s

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

    def wait_for_data(self, timeout_s: float) -> bool:
        """Wait until there is a latest value; False after `timeout_s` of wall time."""
        return self._filled.wait(timeout_s)

    def subscribe(self, receiver: Receiver) -> Callable[[], None]:
        """Call `receiver(chunk)` with every chunk that comes from now on, in order.

        It runs in a thread of its own, which the line waits for up to 256 MB.

        Raises
        ------
        StationAway
            The connection is closed.
        """
        with self._lock:
            if self._all is None:
                self._run = ""
                self._all = self._transport.subscribe(CHUNKS, Rule.ALL, self._take_chunk)
            self._receivers = (*self._receivers, receiver)

        def unsubscribe() -> None:
            with self._lock:
                self._receivers = tuple(each for each in self._receivers if each is not receiver)
                self._unwanted_wall_s = WALL.now_s()

        return unsubscribe

    def follow(self, receiver: Receiver) -> Callable[[], None]:
        """Call `receiver(chunk)` with the newest; what came meanwhile is passed over."""
        with self._lock:
            self._followers = (*self._followers, receiver)

        def unsubscribe() -> None:
            with self._lock:
                self._followers = tuple(each for each in self._followers if each is not receiver)

        return unsubscribe

    # For the application

    def open(self) -> None:
        """Begin to receive the newest."""
        self._display = self._transport.subscribe(DISPLAY, Rule.LATEST, self._take_newest)

    def clear(self) -> None:
        """Forget the newest: it is no longer what there is now."""
        self._filled.clear()
        self._latest = None

    def tidy(self) -> None:
        """End what nobody wants any more; not in a thread that receives."""
        with self._lock:
            idle_s = WALL.now_s() - self._unwanted_wall_s
            if self._receivers or self._all is None or idle_s < LINGER_S:
                return
            unwanted, self._all = self._all, None
        unwanted.close()

    def close(self) -> None:
        """Receive no more; any state."""
        with self._lock:
            ends, self._display, self._all = (self._display, self._all), None, None
            self._receivers, self._followers = (), ()
        for each in ends:
            if each is not None:
                each.close()

    # In the threads that receive

    def _take_newest(self, payload: object) -> None:
        chunk = checked_piece(payload).chunk
        self._heard_wall_s = WALL.now_s()
        self._latest = chunk
        self._filled.set()
        tell(self._followers, chunk)

    def _take_chunk(self, payload: object) -> None:
        piece = checked_piece(payload)
        self._count(piece)
        tell(self._receivers, piece.chunk)

    def _count(self, piece: DaqPiece) -> None:
        chunk = piece.chunk
        missing = chunk.first_sample - self._next
        if piece.run == self._run and missing > 0:
            self._lost += missing
            logger.error(
                "%d samples a channel were lost on the way from the station, before sample %d",
                missing,
                chunk.first_sample,
            )
            self._on_loss()
        self._run, self._next = piece.run, chunk.first_sample + chunk.samples
