"""A socket of its own for calls: one question at a time, answered by the thread that reads it.

The engine hands a question through several threads on its way there and back. Here the caller's
thread writes and reads the socket itself, and so does the thread at the station. With certificates
it is TLS 1.3 and both sides prove who they are. Who may open one was let in by the engine before.
"""

import socket
import ssl
import struct
from typing import Final

from cosmic.frame.clock import WALL, Clock
from cosmic.frame.errors import ProtocolError
from cosmic.frame.network.codec import MESSAGE_LIMIT_BYTES, decode, encode
from cosmic.frame.network.errors import StationTimeout
from cosmic.frame.network.line_settings import Certificates, Line
from cosmic.frame.network.messages import read_answer

OPEN_LIMIT_S: Final = 0.5
ATTACH_LIMIT_BYTES: Final = 1024
"""The most that a stranger may send before it has said who it is."""
_LENGTH: Final = struct.Struct(">I")
_CHUNK: Final = 65536
_LARGEST_READ: Final = 4 * 1024 * 1024


class LineLost(Exception):  # noqa: N818 - private to this package
    """A direct line is broken, and of no use any more."""


class FramedSocket:
    """Messages over a stream, each with its length before it; one thread, but `shut` is for any."""

    def __init__(self, stream: socket.socket, limit_bytes: int) -> None:
        self._stream = stream
        self._limit_bytes = limit_bytes
        self._buffer = bytearray()

    def set_limit(self, limit_bytes: int) -> None:
        """Let messages of that size come."""
        self._limit_bytes = limit_bytes

    def send(self, message: bytes, timeout_s: float | None = None) -> None:
        """Send one; None waits for ever for a line that is full.

        Raises
        ------
        LineLost
            It could not be sent as a whole.
        """
        try:
            self._set_timeout(timeout_s)
            self._stream.sendall(_LENGTH.pack(len(message)) + message)
        except (OSError, ValueError) as exc:
            raise LineLost(str(exc)) from exc

    def receive(self, timeout_s: float | None = None) -> bytes:
        """Return the next; what came before a time-out is kept for the next call.

        Parameters
        ----------
        timeout_s : float or None
            For each piece that comes. 0 takes what is there; None waits for ever.

        Raises
        ------
        TimeoutError
            It is not there yet.
        LineLost
            The line has ended, or a message is too large.
        """
        buffer = self._buffer
        while True:
            missing = _CHUNK
            if len(buffer) >= _LENGTH.size:
                (size,) = _LENGTH.unpack_from(buffer)
                if size > self._limit_bytes:
                    raise LineLost(
                        f"a message of {size} bytes came; {self._limit_bytes} are allowed"
                    )
                end = _LENGTH.size + size
                if len(buffer) >= end:
                    message = bytes(memoryview(buffer)[_LENGTH.size : end])
                    del buffer[:end]
                    return message
                missing = min(max(end - len(buffer), _CHUNK), _LARGEST_READ)
            buffer += self._read(missing, timeout_s)

    def _read(self, size: int, timeout_s: float | None) -> bytes:
        try:
            self._set_timeout(timeout_s)
            found = self._stream.recv(size)
        except (BlockingIOError, ssl.SSLWantReadError, ssl.SSLWantWriteError) as exc:
            raise TimeoutError from exc
        except TimeoutError:
            raise
        except (OSError, ValueError) as exc:
            raise LineLost(str(exc)) from exc
        if not found:
            raise LineLost("the other side has closed it")
        return found

    def _set_timeout(self, timeout_s: float | None) -> None:
        if self._stream.gettimeout() != timeout_s:
            self._stream.settimeout(timeout_s)

    def shut(self) -> None:
        """End it: whoever waits for it wakes; any thread."""
        try:
            # Not `SSLSocket.shutdown`, which takes the encryption off under whoever reads.
            socket.socket.shutdown(self._stream, socket.SHUT_RDWR)
        except OSError:
            return  # it has ended already

    def close(self) -> None:
        """Release it; the thread that uses it."""
        self._stream.close()


class DirectLine:
    """The client's end: asks one question at a time; one thread at a time.

    Raises
    ------
    LineLost
        The station does not let it in, or cannot be reached there.
    """

    def __init__(
        self, line: Line, port: int, client: str, token: str, *, urgent: bool, clock: Clock = WALL
    ) -> None:
        self._clock = clock
        self._owed = 0
        try:
            stream = _connected(line, port)
        except (OSError, ValueError) as exc:
            raise LineLost(f"port {port} there cannot be reached: {exc}") from exc
        self._framed = FramedSocket(stream, MESSAGE_LIMIT_BYTES)
        try:
            said = self.ask(encode([client, token, urgent]), OPEN_LIMIT_S)
            _, _, error = read_answer(said)
        except (StationTimeout, ProtocolError, LineLost) as exc:
            self.close()
            raise LineLost(str(exc)) from exc
        if error is not None:
            self.close()
            raise LineLost(str(error)) from error

    def ask(self, message: bytes, timeout_s: float) -> bytes:
        """Send a message and return the answer to it.

        Raises
        ------
        StationTimeout
            No answer came in time; the line is of use again when it has come.
        LineLost
            The line broke.
        """
        until_s = self._clock.now_s() + timeout_s
        self._framed.send(message, timeout_s)
        self._owed += 1
        try:
            answer = self._framed.receive(max(0.001, until_s - self._clock.now_s()))
        except TimeoutError as exc:
            raise StationTimeout(f"no answer came within {timeout_s:g} s") from exc
        self._owed -= 1
        return answer

    def settle(self) -> bool:
        """Take what is owed, if it has come; True when the line is free for a question."""
        try:
            while self._owed:
                self._framed.receive(0.0)
                self._owed -= 1
        except (TimeoutError, LineLost):
            return False
        return True

    def shut(self) -> None:
        """Wake whoever waits for an answer; any thread."""
        self._framed.shut()

    def close(self) -> None:
        """Release it."""
        self._framed.close()


def _connected(line: Line, port: int) -> socket.socket:
    host = line.host
    stream = socket.create_connection((host, port), OPEN_LIMIT_S)
    try:
        stream.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        if line.encrypted and line.certificates is not None:
            return client_context(line.certificates).wrap_socket(stream, server_hostname=host)
    except (OSError, ValueError):
        stream.close()
        raise
    return stream


def client_context(certificates: Certificates) -> ssl.SSLContext:
    """Return what a client proves itself with, and checks the station with."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)  # checks the name of the host as well
    _fill(context, certificates)
    return context


def server_context(certificates: Certificates) -> ssl.SSLContext:
    """Return what a station proves itself with, and checks its clients with."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.verify_mode = ssl.CERT_REQUIRED
    context.num_tickets = 0
    _fill(context, certificates)
    return context


def _fill(context: ssl.SSLContext, certificates: Certificates) -> None:
    context.minimum_version = ssl.TLSVersion.TLSv1_3
    context.load_verify_locations(certificates.authority)
    context.load_cert_chain(certificates.certificate, certificates.key)


def read_attachment(message: bytes) -> tuple[str, str, bool]:
    """Return the client's key, its token, and whether the line is for what is urgent.

    Raises
    ------
    ProtocolError
        It is something else.
    """
    parts = decode(message, ATTACH_LIMIT_BYTES)
    if not isinstance(parts, list) or [type(each) for each in parts] != [str, str, bool]:
        raise ProtocolError("a direct line has to say whose it is")
    return parts[0], parts[1], parts[2]
