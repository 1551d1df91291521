"""The way from here to the MiCo of a station: commands in their order, stops past them."""

import logging
from collections.abc import Callable, Mapping
from threading import Lock
from typing import Final, Protocol, TypeVar, runtime_checkable
from weakref import WeakKeyDictionary

from cosmic.frame.errors import CosmicError, DeviceTimeout, WrongThreadError
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.job_queue import JobQueue
from cosmic.frame.network.errors import StationAway, StationTimeout
from cosmic.frame.network.ongoing import Ongoing
from cosmic.frame.network.transport import CALL_TIMEOUT_S, Transport
from cosmic.frame.operation import Operation
from cosmic.frame.threads import forbid_waiting_here
from cosmic.mico.core.motion.movement import Movement

logger = logging.getLogger(__name__)

T = TypeVar("T")
Arguments = Mapping[str, object]

APPLICATION: Final = "mico"
RENEW_LIMIT_S: Final = 0.2
"""A sign that a key is still held is worth nothing later than this."""
STOP_LIMIT_S: Final = 1.0
_CLOSED: Final = "the connection to MiCo is closed"


def may_wait_here() -> bool:
    """Return whether this thread may wait for an answer of another process."""
    try:
        forbid_waiting_here("a call")
    except WrongThreadError:
        return False
    return True


@runtime_checkable
class _Telling(Protocol):
    def add_callback(self, callback: Callable[[object], None]) -> None: ...


class CommandLine:
    """Calls the MiCo of a station; any thread.

    Commands go one after the other, so that they arrive in the order in which they were given.
    A stop has a lane of its own, and so have the signs that a key is still held, of which only
    the newest counts. Where the calling thread must not wait (a window), nothing waits. What a
    call says of the axes goes to `heed`.
    """

    def __init__(self, transport: Transport, policy: FailurePolicy) -> None:
        self._transport = transport
        self._policy = policy
        self._orders = JobQueue("mico orders", policy)
        self._stops = JobQueue("mico stops", policy)
        self._renewals = JobQueue("mico keeps alive", policy)
        self._lock = Lock()
        self._newest: dict[tuple[str, int], Callable[[], object]] = {}
        self._numbers: WeakKeyDictionary[Movement, int] = WeakKeyDictionary()
        self._open = False
        self.heed: Callable[[object], None] = lambda _told: None

    @property
    def transport(self) -> Transport:
        """The station."""
        return self._transport

    def start(self) -> None:
        """Begin to carry out what is put in."""
        for lane in (self._orders, self._stops, self._renewals):
            lane.start()
        self._open = True

    def close(self) -> None:
        """End the lanes; harmless the second time."""
        self._open = False
        for lane in (self._orders, self._stops, self._renewals):
            lane.request_end()
        for lane in (self._orders, self._stops, self._renewals):
            lane.join()

    def call(
        self, function: str, arguments: Arguments, timeout_s: float = CALL_TIMEOUT_S
    ) -> object:
        """Call a function there now, in this thread; raises as `Transport.call`."""
        return self._transport.call(APPLICATION, function, arguments, timeout_s=timeout_s)

    def note_number(self, movement: Movement, number: int) -> None:
        """Remember under which number the station will know a movement."""
        with self._lock:
            self._numbers[movement] = number

    def number_of(self, movement: Movement) -> int:
        """Return that number; -1 where the movement was never ordered there."""
        with self._lock:
            return self._numbers.get(movement, -1)

    # In their order

    def post(self, job: Callable[[], None]) -> None:
        """Have `job` carried out after what was put in before; returns at once."""
        self._check_open()
        self._orders.submit(job, "an order").when_failed(_log)

    def run(self, job: Callable[[], object], timeout_s: float = 2 * CALL_TIMEOUT_S) -> object:
        """Have `job` carried out after what was put in before, and return its result.

        Raises
        ------
        StationTimeout
            Others before it took too long.
        CosmicError
            What it raised.
        """
        self._check_open()
        return _waited_for(self._orders.submit(job, "an order"), timeout_s)

    def do(self, function: str, arguments: Arguments) -> None:
        """Call a function in its order; what it says of the axes is taken note of.

        Waits where this thread may, and raises; otherwise a failure is only logged.
        """

        def job() -> None:
            self.heed(self.call(function, arguments))

        if may_wait_here():
            self.run(job)
        else:
            self.post(job)

    # Past everything

    def at_once(self, function: str, arguments: Arguments) -> None:
        """Call what overtakes everything.

        Waits where this thread may, and raises; elsewhere as `at_once_later`.
        """
        if not may_wait_here():
            self.at_once_later(function, arguments)
            return
        self._check_open()
        sent = self._stops.submit(
            lambda: self.heed(self.call(function, arguments, STOP_LIMIT_S)), function
        )
        _waited_for(sent, 2 * STOP_LIMIT_S)

    def at_once_later(self, function: str, arguments: Arguments) -> None:
        """Call what overtakes everything, without waiting; a failure goes to the policy, loudly."""

        def loud() -> None:
            try:
                self.heed(self.call(function, arguments, STOP_LIMIT_S))
            except CosmicError as exc:
                self._policy.report(exc, f"{function} was NOT carried out at the station")

        if self._open:
            self._stops.submit(loud, function)
        else:
            logger.warning("%s: %s", function, _CLOSED)

    def withdraw(self, number: int) -> None:
        """Give an order up; returns at once, from any thread."""
        arguments = {"numbers": [number]}
        sent = self._stops.submit(
            lambda: self.call("withdraw", arguments, STOP_LIMIT_S), "giving an order up"
        )
        sent.when_failed(_log)

    def open_orders(self) -> list[int]:
        """Return the numbers of the orders whose movements have not ended."""
        with self._lock:
            return [number for movement, number in self._numbers.items() if not movement.done]

    def give_up(self) -> None:
        """Have everything stop that was begun here, before this end closes."""
        numbers = self.open_orders()
        if not (self._open and numbers):
            return
        try:
            self.call("withdraw", {"numbers": numbers}, STOP_LIMIT_S)
        except CosmicError as exc:
            logger.warning("what was begun here stops by the lease only: %s", exc)

    def renew(self, function: str, axis: str, number: int, **more: object) -> None:
        """Say that somebody still holds the key; only the newest word counts."""
        arguments = {"axis": axis, "number": number, **more}
        key = (axis, number)
        with self._lock:
            waiting = key in self._newest
            self._newest[key] = lambda: self.call(function, arguments, RENEW_LIMIT_S)
        if not waiting:
            self._renewals.submit(lambda: self._send_newest(key), function).when_failed(_log)

    def _send_newest(self, key: tuple[str, int]) -> None:
        with self._lock:
            job = self._newest.pop(key)
        job()

    def _check_open(self) -> None:
        if not self._open:
            raise StationAway(_CLOSED)


def when_over(ongoing: Ongoing, callback: Callable[[], None]) -> None:
    """Call `callback` once `ongoing` has ended, in the thread that ends it."""
    if isinstance(ongoing, _Telling):
        ongoing.add_callback(lambda _ended: callback())
    else:
        subscribe = getattr(ongoing, "subscribe", None)
        if subscribe is None:
            raise TypeError(f"the end of {ongoing!r} cannot be followed")
        subscribe(lambda progress: callback() if progress.done else None)


def _waited_for(sent: Operation[T], timeout_s: float) -> T:
    """Return the result of what was sent; raises what it raised, and `StationTimeout`."""
    try:
        return sent.wait(timeout_s)
    except DeviceTimeout:
        if sent.done:
            raise
    raise StationTimeout(f"{APPLICATION}: no answer after {timeout_s:g} s")


def _log(error: CosmicError) -> None:
    logger.warning("MiCo of the station: %s", error)
