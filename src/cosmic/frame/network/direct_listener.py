"""Where clients that were let in open direct lines, and strangers do no harm."""

import errno
import logging
import selectors
import socket
import ssl
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from typing_extensions import override

from cosmic.frame.clock import WALL
from cosmic.frame.errors import CosmicError
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.network.direct_line import (
    ATTACH_LIMIT_BYTES,
    FramedSocket,
    LineLost,
    read_attachment,
    server_context,
)
from cosmic.frame.network.line_settings import Line
from cosmic.frame.network.messages import refusal_of
from cosmic.frame.network.refusals import AT_ONCE, RefusalCount
from cosmic.frame.threads import WorkerThread

logger = logging.getLogger(__name__)

PENDING_LIMIT: Final = 32
"""So many may be about to say who they are; the oldest makes room for one more."""
GREETING_LIMIT_S: Final = 2.0
"""Whoever has not said by then who it is, is turned away."""
FULL_S: Final = 0.05
"""Until somebody is tried to be taken again where there are too many open files."""
_FULL: Final = frozenset({errno.EMFILE, errno.ENFILE, errno.ENOBUFS, errno.ENOMEM})
_ACCEPTED_AT_ONCE: Final = 4

Attach = Callable[[str, str, str | None, bool, FramedSocket], None]


@dataclass(slots=True)
class _Pending:
    """Somebody who has not yet said who it is."""

    stream: socket.socket
    framed: FramedSocket
    where: str
    until_s: float
    encrypted: bool


class DirectListener(WorkerThread):
    """Takes connections and hands on those that say whose they are; waits for none of them.

    Parameters
    ----------
    attach : callable
        `attach(client key, token, proven name, urgent, line)` takes it over; raises `CosmicError`
        where it may not. The name is the one of the certificate, None without certificates.

    Raises
    ------
    OSError
        It cannot listen there.
    """

    def __init__(self, name: str, line: Line, policy: FailurePolicy, attach: Attach) -> None:
        super().__init__(name, policy)
        self._attach = attach
        self._context = (
            server_context(line.certificates)
            if line.encrypted and line.certificates is not None
            else None
        )
        family = socket.AF_INET6 if ":" in line.host else socket.AF_INET
        self._server = socket.create_server((line.host, 0), family=family)
        self._server.setblocking(False)
        self._port: int = self._server.getsockname()[1]
        self._wake, self._woken = socket.socketpair()
        self._selector = selectors.DefaultSelector()
        self._selector.register(self._server, selectors.EVENT_READ)
        self._selector.register(self._woken, selectors.EVENT_READ)
        self._pending: dict[socket.socket, _Pending] = {}
        self._refused = RefusalCount(WALL)

    @property
    def port(self) -> int:
        """Where it listens."""
        return self._port

    @override
    def request_end(self) -> None:
        super().request_end()
        try:
            self._wake.send(b"x")
        except OSError:
            return  # it has ended

    @override
    def run_body(self) -> None:
        try:
            while not self.end_requested:
                wait_s = min(
                    (each.until_s - WALL.now_s() for each in self._pending.values()), default=None
                )
                for key, _ in self._selector.select(None if wait_s is None else max(0.0, wait_s)):
                    if key.fileobj is self._server:
                        self._accept()
                    elif isinstance(key.fileobj, socket.socket):
                        self._hear(key.fileobj)
                self._drop_late()
        finally:
            self._release()

    def _release(self) -> None:
        for each in list(self._pending.values()):
            self._drop(each)
        self._selector.close()
        for stream in (self._server, self._wake, self._woken):
            stream.close()

    def _accept(self) -> None:
        for _ in range(_ACCEPTED_AT_ONCE):
            try:
                stream, address = self._server.accept()
            except OSError as exc:
                if exc.errno in _FULL:  # who waits is told of again at once, and can't be taken
                    WALL.sleep(FULL_S)
                return  # or nobody is there any more
            where = f"{address[0]}:{address[1]}"
            if self._refused.of(address[0]) >= AT_ONCE:  # calls of its own go over the engine
                stream.close()
                logger.warning("%s: %s was turned away: too often", self.name, where)
                continue
            stream.setblocking(False)
            if len(self._pending) >= PENDING_LIMIT:
                self._turn_away(next(iter(self._pending.values())), "others wait as well")
            try:
                stream.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                if self._context is not None:
                    stream = self._context.wrap_socket(
                        stream, server_side=True, do_handshake_on_connect=False
                    )
            except OSError as exc:
                stream.close()
                self._refused.note(address[0])
                logger.warning("%s: %s was turned away: %s", self.name, where, exc)
                continue
            self._pending[stream] = _Pending(
                stream,
                FramedSocket(stream, ATTACH_LIMIT_BYTES),
                where,
                WALL.now_s() + GREETING_LIMIT_S,
                self._context is not None,
            )
            self._selector.register(stream, selectors.EVENT_READ)

    def _hear(self, stream: socket.socket) -> None:
        pending = self._pending.get(stream)
        if pending is None:
            return
        try:
            if isinstance(stream, ssl.SSLSocket) and pending.encrypted:
                stream.do_handshake()
                pending.encrypted = False  # that is done
            message = pending.framed.receive(0.0)
        except (TimeoutError, ssl.SSLWantReadError):
            return
        except ssl.SSLWantWriteError:  # what it is sent fills no buffer, unless it does not read
            self._turn_away(pending, "it does not read")
            return
        except (OSError, LineLost) as exc:
            self._turn_away(pending, str(exc))
            return
        self._hand_over(pending, message)

    def _hand_over(self, pending: _Pending, message: bytes) -> None:
        stream = pending.stream
        try:
            client, token, urgent = read_attachment(message)
            name = _proven_name(stream) if isinstance(stream, ssl.SSLSocket) else None
            self._forget(pending)
            stream.setblocking(True)
            self._attach(client, token, name, urgent, pending.framed)
        except CosmicError as exc:
            try:
                pending.framed.send(refusal_of(0.0, exc), 0.0)
            except LineLost:
                logger.debug("%s is gone", pending.where)
            self._turn_away(pending, str(exc))

    def _drop_late(self) -> None:
        now_s = WALL.now_s()
        for each in list(self._pending.values()):
            if each.until_s <= now_s:
                self._turn_away(each, f"it did not say who it is within {GREETING_LIMIT_S:g} s")

    def _turn_away(self, pending: _Pending, why: str) -> None:
        self._refused.note(pending.where.rpartition(":")[0])
        logger.warning("%s: %s was turned away: %s", self.name, pending.where, why)
        self._drop(pending)

    def _drop(self, pending: _Pending) -> None:
        self._forget(pending)
        pending.framed.close()

    def _forget(self, pending: _Pending) -> None:
        if self._pending.pop(pending.stream, None) is not None:
            self._selector.unregister(pending.stream)


def _proven_name(stream: ssl.SSLSocket) -> str:
    """Return the name in the certificate of the other side, which was checked."""
    certificate = stream.getpeercert() or {}
    for part in certificate.get("subject", ()):
        for entry in part:
            if len(entry) == 2 and entry[0] == "commonName":
                return str(entry[1])
    return ""
