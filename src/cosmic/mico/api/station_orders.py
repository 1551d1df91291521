"""Orders that other processes gave, and how they are told that one has ended."""

from collections import OrderedDict
from collections.abc import Callable
from threading import Lock
from typing import Any, Final

from cosmic.frame.errors import CosmicError, MoveCancelled
from cosmic.frame.network.errors import RemoteDefect
from cosmic.frame.network.travelling_errors import to_plain
from cosmic.mico.api.group import GroupMovement
from cosmic.mico.api.station_tell import MicoTeller
from cosmic.mico.api.station_words import AxisOutcome, Outcomes
from cosmic.mico.core.motion.movement import Movement
from cosmic.mico.core.motion.orders import Order

_KEPT: Final = 512

Key = tuple[str, int]
"""Token of a session, and the number that it gave to the order."""


class Ordered:
    """What was ordered together goes on; ends with how each axis fared, never with an exception.

    Any thread.
    """

    def __init__(self, group: GroupMovement, teller: MicoTeller) -> None:
        self._group = group
        self._teller = teller

    @property
    def title(self) -> str:
        """What moves."""
        return f"moving {', '.join(self._group.movements)}"

    @property
    def done(self) -> bool:
        """True when every axis has ended."""
        return self._group.done

    def cancel(self) -> None:
        """Stop every axis that still moves."""
        self._group.cancel()

    def add_callback(self, callback: "Callable[[Ordered], None]") -> None:
        """Call `callback(self)` when all have ended."""
        self._group.add_callback(lambda _group: callback(self))

    def wait(self, timeout_s: float | None = None) -> Outcomes:
        """Wait for all and return how they ended; raises `DeviceTimeout`."""
        self._group.exception(timeout_s)
        of = {name: self._outcome(name, each) for name, each in self._group.movements.items()}
        return Outcomes(of, self._teller.status(), self._group.start_skew_ms)

    def _outcome(self, name: str, movement: Movement) -> AxisOutcome:
        error = movement.exception()
        if error is not None and not isinstance(error, CosmicError):
            error = RemoteDefect(f"{type(error).__name__}: {error}")
        return AxisOutcome(
            position=movement.wait() if error is None else None,
            error=None if error is None else to_plain(error),
            state=self._teller.state_of(name),
        )


class OrderBook:
    """The newest orders of every session, by the numbers that the session gave them; any thread.

    A session's halt overtakes its own orders on the way: they are void when they arrive.
    """

    def __init__(self) -> None:
        self._lock = Lock()
        self._orders: OrderedDict[Key, Order] = OrderedDict()
        self._void_to: OrderedDict[tuple[str, str], int] = OrderedDict()
        self._withdrawn: OrderedDict[Key, None] = OrderedDict()

    def keep(self, key: Key, axis: str, order: Order) -> None:
        """Remember an order that is about to be carried out.

        Raises
        ------
        MoveCancelled
            It was withdrawn, or its axis was halted, while it was on its way.
        """
        token, number = key
        with self._lock:
            void = key in self._withdrawn or number <= self._void_to.get((token, axis), 0)
            if not void:
                self._orders[key] = order
                _trim(self._orders)
        if void:
            raise MoveCancelled(f"{axis}: halted before it started")

    def find(self, key: Key) -> Order | None:
        """Return an order; None where it was forgotten, or never came."""
        with self._lock:
            return self._orders.get(key)

    def newest(self, key: Key, axis: str) -> Order:
        """Return the order that another one follows.

        Raises
        ------
        MoveCancelled
            It was forgotten long ago: something else came since.
        """
        found = self.find(key)
        if found is None:
            raise MoveCancelled(f"{axis}: a newer command came first")
        return found

    def void(self, token: str, axis: str, up_to: int) -> None:
        """Have no order of a session to `axis` up to that number carried out any more."""
        with self._lock:
            place = (token, axis)
            self._void_to[place] = max(up_to, self._void_to.get(place, 0))
            _trim(self._void_to)

    def withdraw(self, key: Key) -> Order | None:
        """Have one order not carried out; returns it where it was begun already."""
        with self._lock:
            self._withdrawn[key] = None
            _trim(self._withdrawn)
            return self._orders.get(key)


def _trim(book: "OrderedDict[Any, Any]") -> None:
    while len(book) > _KEPT:
        book.popitem(last=False)
