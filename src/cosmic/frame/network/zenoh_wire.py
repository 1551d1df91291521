"""The engine between processes and computers: eclipse-zenoh, imported here and nowhere else.

No Python callback is given to it: each would run in a thread that outlives the main one, so that a
process whose main thread has died would go on answering. Threads of ours wait on its channels.
"""

import atexit
import json
import logging
import os
import weakref
from collections.abc import Callable
from threading import Lock
from typing import Any, Final, Generic, TypeVar

import zenoh
from typing_extensions import override

from cosmic.frame.network.delivery import Inbox, InboxClosed
from cosmic.frame.network.errors import StationAway, StationTimeout
from cosmic.frame.network.line_settings import Line
from cosmic.frame.network.transport import Rule
from cosmic.frame.network.wire import Liveliness, Outlet, Question, Wire

logger = logging.getLogger(__name__)
T = TypeVar("T")

_QUEUE: Final = 1024


def config(line: Line) -> "zenoh.Config":
    """Return the one configuration that this program opens a line with."""
    made = zenoh.Config()
    for key, value in line.settings().items():
        made.insert_json5(key, json.dumps(value))
    return made


class ZenohWire(Wire):
    """One end of a line.

    Raises
    ------
    StationAway
        A station cannot listen at its endpoint.
    """

    def __init__(self, line: Line) -> None:
        try:
            self._session = zenoh.open(config(line))
        except zenoh.ZError as exc:
            raise StationAway(f"the line cannot be opened: {exc}") from exc
        self._line = line
        if line.listens and (problem := self._out_of_date()):
            logger.warning("%s: nobody is let in: %s", line.station, problem)
        self._lock = Lock()
        self._inboxes: weakref.WeakSet[_Channel[Any]] = weakref.WeakSet()
        self._closed = False
        _open_wires.add(self)

    @property
    def line(self) -> Line:
        """Where it goes; direct lines go there as well."""
        return self._line

    def _out_of_date(self) -> str:
        """Return why the certificate of this end is not accepted today; empty: it is."""
        if self._line.certificates is None:
            return ""
        # Imported here: it loads a library of cryptography.
        from cosmic.frame.network.certificates import out_of_date

        return out_of_date(self._line.certificates)

    @override
    def ask(self, key: str, message: bytes, *, timeout_s: float) -> bytes:
        try:
            replies = self._session.get(
                key,
                payload=message,
                timeout=timeout_s,
                priority=zenoh.Priority.REAL_TIME,
                congestion_control=zenoh.CongestionControl.BLOCK,  # DROP loses calls
                express=True,
                consolidation=zenoh.ConsolidationMode.NONE,
            )
            reply = next(iter(replies), None)
        except zenoh.ZError as exc:
            raise StationAway(f"the line is closed: {exc}") from exc
        if reply is None:
            reason = self._out_of_date() or "the station is not running or not reachable"
            raise StationAway(f"no answer: {reason}")
        if reply.ok is None:
            raise StationTimeout(f"no answer came within {timeout_s:g} s")
        return bytes(reply.ok.payload.to_bytes())

    @override
    def questions(self, keys: str) -> Inbox[Question]:
        return self._inbox(
            lambda: self._session.declare_queryable(
                keys, zenoh.handlers.FifoChannel(_QUEUE), complete=True
            ),
            _ZenohQuestion,
        )

    @override
    def outlet(self, key: str, rule: Rule) -> Outlet:
        latest = rule is Rule.LATEST
        congestion = zenoh.CongestionControl
        try:
            return _ZenohOutlet(
                self._session.declare_publisher(
                    key,
                    priority=zenoh.Priority.DATA_LOW if latest else zenoh.Priority.DATA,
                    congestion_control=congestion.DROP if latest else congestion.BLOCK,
                )
            )
        except zenoh.ZError as exc:
            raise StationAway(f"the line is closed: {exc}") from exc

    @override
    def inlet(self, key: str, rule: Rule) -> Inbox[bytes]:
        kinds = zenoh.handlers
        channel: Any = kinds.RingChannel(1) if rule is Rule.LATEST else kinds.FifoChannel(_QUEUE)
        return self._inbox(
            lambda: self._session.declare_subscriber(key, channel),
            lambda sample: bytes(sample.payload.to_bytes()),
        )

    @override
    def liveliness(self, key: str) -> Liveliness:
        try:
            return _ZenohLiveliness(self._session.liveliness().declare_token(key))
        except zenoh.ZError as exc:
            raise StationAway(f"the line is closed: {exc}") from exc

    @override
    def watch_liveliness(self, keys: str) -> Inbox[tuple[str, bool]]:
        return self._inbox(
            lambda: self._session.liveliness().declare_subscriber(
                keys, zenoh.handlers.FifoChannel(_QUEUE), history=True
            ),
            lambda sample: (str(sample.key_expr), sample.kind == zenoh.SampleKind.PUT),
        )

    @override
    def close(self) -> None:
        with self._lock:
            if self._closed:
                return
            self._closed = True
        _open_wires.discard(self)
        for inbox in list(self._inboxes):
            inbox.close()
        self._session.close()  # type: ignore[no-untyped-call]

    def _inbox(self, declare: Callable[[], Any], read: Callable[[Any], T]) -> Inbox[T]:
        try:
            made: _Channel[T] = _Channel(declare(), read)
        except zenoh.ZError as exc:
            raise StationAway(f"the line is closed: {exc}") from exc
        self._inboxes.add(made)
        return made


class _Channel(Inbox[T], Generic[T]):
    """What comes in over one declaration, taken by a thread of ours."""

    def __init__(self, declared: Any, read: Callable[[Any], T]) -> None:
        self._declared = declared
        self._handler = declared.handler  # waiting on `declared` itself would lock it
        self._read = read
        self._closed = False

    @override
    def take(self) -> T:
        try:
            return self._read(self._handler.recv())
        except zenoh.ZError as exc:
            raise InboxClosed from exc

    @override
    def close(self) -> None:
        if not self._closed:
            self._closed = True
            _undeclare(self._declared)


class _ZenohQuestion(Question):
    def __init__(self, query: "zenoh.Query") -> None:
        self._query = query

    @property
    @override
    def key(self) -> str:
        return str(self._query.key_expr)

    @property
    @override
    def message(self) -> bytes:
        payload = self._query.payload
        return b"" if payload is None else bytes(payload.to_bytes())

    @override
    def answer(self, message: bytes) -> None:
        try:
            self._query.reply(self._query.key_expr, message)
        except zenoh.ZError as exc:
            logger.debug("an answer found nobody: %s", exc)
        finally:
            self._query.drop()  # type: ignore[no-untyped-call]


class _ZenohOutlet(Outlet):
    def __init__(self, publisher: "zenoh.Publisher") -> None:
        self._publisher = publisher
        self._lock = Lock()  # it must not be released while another thread asks
        self._closed = False
        self._putting = 0

    @property
    @override
    def wanted(self) -> bool:
        with self._lock:
            if self._closed:
                return False
            try:
                status: Any = self._publisher.matching_status  # the stub says bool
                return bool(status.matching)
            except zenoh.ZError:
                return False

    @override
    def put(self, message: bytes) -> None:
        with self._lock:
            if self._closed:
                raise StationAway("the line is closed")
            self._putting += 1
        try:
            self._publisher.put(message)
        except zenoh.ZError as exc:
            raise StationAway(f"the line is closed: {exc}") from exc
        finally:
            with self._lock:
                self._putting -= 1
                self._release()

    @override
    def close(self) -> None:
        with self._lock:
            if not self._closed:
                self._closed = True
                self._release()

    def _release(self) -> None:
        """Release it when it is closed and nobody puts, which may take a while; locked."""
        if self._closed and not self._putting:
            _undeclare(self._publisher)


class _ZenohLiveliness(Liveliness):
    def __init__(self, token: "zenoh.LivelinessToken") -> None:
        self._token = token

    @override
    def close(self) -> None:
        _undeclare(self._token)


def _undeclare(declared: Any) -> None:
    try:
        declared.undeclare()
    except zenoh.ZError as exc:
        logger.debug("was released with its line already: %s", exc)


_open_wires: Final["weakref.WeakSet[ZenohWire]"] = weakref.WeakSet()


if hasattr(os, "register_at_fork"):  # not on Windows, which has no fork
    os.register_at_fork(after_in_child=_open_wires.clear)  # closing one waits for its threads


@atexit.register
def _close_what_is_open() -> None:
    """Leave no line open that nobody closed: it would keep the process alive and answering."""
    for wire in list(_open_wires):
        wire.close()
