"""One stream from another station, as it is received here."""

import logging
from collections.abc import Callable
from threading import Lock
from typing import Any, Final

from cosmic.frame.clock import WALL
from cosmic.frame.declaration import UNKNOWN, StreamDeclaration
from cosmic.frame.errors import ProtocolError
from cosmic.frame.events import Event, Unsubscribe
from cosmic.frame.network.conform import Mismatch, conform
from cosmic.frame.network.transport import Rule, Subscription, Transport

logger = logging.getLogger(__name__)

LINGER_S: Final = 2.0
"""How long a stream still comes after nobody wants it any more."""

Receiver = Callable[[Any], object]


class RemoteStream:
    """One stream from another station; any thread.

    It comes while somebody wants it, in a thread of its own, and a little longer.

    Parameters
    ----------
    on_loss : callable
        Called when something was lost on the way.
    """

    def __init__(
        self,
        declared: StreamDeclaration,
        topic: str,
        transport: Transport,
        on_loss: Callable[[], object],
    ) -> None:
        self._declared = declared
        self._topic = topic
        self._transport = transport
        self._on_loss = on_loss
        self._lock = Lock()
        self._came: Event[Any] = Event()
        self._subscription: Subscription | None = None
        self._kept = False
        self._before: object = UNKNOWN
        self._gaps = 0
        self._missed = 0
        self._newest: object = None
        self._unwanted_wall_s = 0.0
        self.heard_wall_s = -float("inf")

    @property
    def newest(self) -> object:
        """The newest that came; None before the first."""
        return self._newest

    @property
    def missed(self) -> int:
        """How much was wanted and did not reach this process."""
        return self._missed

    def subscribe(self, receiver: Receiver) -> Unsubscribe:
        """Call `receiver` with what comes from now on; raises `StationAway` once it is closed."""
        self._open()
        end = self._came.subscribe(receiver)

        def unsubscribe() -> None:
            end()
            self._unwanted_wall_s = WALL.now_s()

        return unsubscribe

    def keep(self) -> None:
        """Have it come all the time, whether anybody wants it or not."""
        self._kept = True
        self._open()

    def _open(self) -> None:
        with self._lock:
            if self._subscription is None:
                self._before, self._gaps = UNKNOWN, 0
                self._subscription = self._transport.subscribe(
                    self._topic, self._declared.rule, self._take
                )

    def clear(self) -> None:
        """Forget the newest: it is no longer what there is now."""
        self._newest = None

    def tidy(self) -> None:
        """End it where nobody wants it any more; not in a thread that receives."""
        with self._lock:
            idle_s = WALL.now_s() - self._unwanted_wall_s
            if len(self._came) or self._kept or idle_s < LINGER_S:
                return
            unwanted, self._subscription = self._subscription, None
        if unwanted is not None:
            unwanted.close()

    def close(self) -> None:
        """Receive no more; any state."""
        with self._lock:
            subscription, self._subscription = self._subscription, None
            self._came = Event()
        if subscription is not None:
            subscription.close()

    # In the thread that receives

    def _take(self, payload: object) -> None:
        if payload is None and self._declared.asks:
            return  # from now on the station knows that this is wanted
        try:
            payload = conform(payload, self._declared.kind)
        except Mismatch as exc:
            raise ProtocolError(f"{self._topic}: {exc}") from exc
        self.heard_wall_s = WALL.now_s()
        self._count(payload)
        self._newest = payload
        self._came.emit(payload)

    def _count(self, payload: object) -> None:
        before, self._before = self._before, payload
        if self._declared.rule is not Rule.ALL:
            return
        if self._declared.missing is not None:
            lost = 0 if before is UNKNOWN else self._declared.missing(before, payload)
        else:
            gaps = self._subscription.lost if self._subscription is not None else self._gaps
            lost, self._gaps = gaps - self._gaps, gaps
        if lost > 0:
            self._missed += lost
            logger.error("%s: %d were lost on the way from the station", self._topic, lost)
            self._on_loss()
