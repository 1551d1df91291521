"""The other end of `benchmarks.network`: bare sockets, and a station, in a process of its own."""

import socket
import ssl
import struct
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

import msgpack
import numpy as np

from cosmic.frame.failure import FailurePolicy
from cosmic.frame.network.certificates import station_certificates
from cosmic.frame.network.line_settings import Line
from cosmic.frame.network.remote import remote
from cosmic.frame.network.server_listener import ServerListener
from cosmic.frame.network.station import Station
from cosmic.frame.network.zenoh_wire import ZenohWire

FRAME_SHAPE = (1200, 1600)
_LENGTH = struct.Struct(">I")


def receive(line: socket.socket, size: int) -> bytearray:
    """Return exactly `size` bytes."""
    found = bytearray(size)
    view = memoryview(found)
    while size:
        count = line.recv_into(view, size)
        if not count:
            raise ConnectionError
        view, size = view[count:], size - count
    return found


def send_message(line: socket.socket, message: object) -> None:
    """Send one message in msgpack with its length."""
    packed = msgpack.packb(message)
    line.sendall(_LENGTH.pack(len(packed)) + packed)


def receive_message(line: socket.socket) -> object:
    """Return one message in msgpack."""
    (size,) = _LENGTH.unpack(receive(line, _LENGTH.size))
    return msgpack.unpackb(bytes(receive(line, size)))


def echo_bytes(line: socket.socket) -> None:
    """Answer each 64 bytes with the same; after 64 zeros, send frames."""
    while True:
        data = bytes(receive(line, 64))
        line.sendall(data)
        if data == bytes(64):
            break
    (count,) = _LENGTH.unpack(receive(line, 4))
    frame = np.ones(FRAME_SHAPE, np.uint8).data.cast("B")
    for _ in range(count):
        line.sendall(frame)


def echo_messages(line: socket.socket) -> None:
    """Answer each call with its argument."""
    while True:
        call = receive_message(line)
        send_message(line, {"ok": True, "value": call["arguments"]["a"]})  # type: ignore[call-overload, index]


def listen(
    port: int, serve: Callable[[socket.socket], None], context: ssl.SSLContext | None
) -> None:
    """Serve one client after the other in a thread."""
    server = socket.create_server(("127.0.0.1", port))

    def run() -> None:
        while True:
            line, _ = server.accept()
            line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            try:
                serve(context.wrap_socket(line, server_side=True) if context else line)
            except (ConnectionError, ssl.SSLError):
                line.close()

    threading.Thread(target=run, daemon=True).start()


class Source:
    """What the benchmark calls."""

    def __init__(self, station: Station) -> None:
        self._station = station
        self._end = threading.Event()

    @remote
    def ping(self, a: float) -> float:
        """Return `a`."""
        return a

    @remote
    def work(self, a: float) -> float:
        """Return `a` after some work, as a call that asks the gate."""
        until_s = time.perf_counter() + 0.002
        while time.perf_counter() < until_s:
            a += 0.0
        return a

    @remote(at_once=True)
    def stop(self) -> float:
        """Return when it was carried out, on the clock that both processes share."""
        return time.monotonic()

    @remote
    def cpu_s(self) -> float:
        """Return the CPU time of this process so far."""
        return time.process_time()

    @remote
    def events(self, count: int) -> None:
        """Publish `count` numbers as fast as can be."""
        self._run(lambda: [self._station.publish("events", number) for number in range(count)])

    @remote
    def frames(self, count: int, rate_hz: float) -> None:
        """Publish `count` frames; with a rate of 0 as fast as can be."""
        frame = np.ones(FRAME_SHAPE, np.uint8)
        frame.flags.writeable = False

        def publish() -> None:
            next_s = time.monotonic()
            for _ in range(count):
                self._station.publish("frames", (time.monotonic(), frame))
                if rate_hz:
                    next_s += 1.0 / rate_hz
                    if self._end.wait(max(0.0, next_s - time.monotonic())):
                        return

        self._end.clear()
        self._run(publish)

    @remote
    def quiet(self) -> None:
        """Publish no more frames."""
        self._end.set()

    @staticmethod
    def _run(job: Callable[[], object]) -> None:
        threading.Thread(target=job, daemon=True).start()


def main() -> None:
    """Serve until the standard input ends: FOLDER RAW TLS OPEN SECURE (ports)."""
    folder = Path(sys.argv[1])
    raw, tls, open_port, secure = map(int, sys.argv[2:])
    files = station_certificates(folder / "server")
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(files.certificate, files.key)
    context.load_verify_locations(files.authority)
    context.verify_mode = ssl.CERT_REQUIRED
    listen(raw, echo_bytes, None)
    listen(tls, echo_messages, context)
    station = Station("server", FailurePolicy())
    station.host("source", Source(station))
    lines = [
        Line(f"tcp/127.0.0.1:{open_port}", True, "server"),
        Line(f"tls/127.0.0.1:{secure}", True, "server", files, ("client",)),
    ]
    listeners = []
    try:
        for line in lines:
            listeners.append(ServerListener(station, ZenohWire(line)))
            listeners[-1].start()
        print("ready", flush=True)
        sys.stdin.read()
    finally:
        for listener in listeners:
            listener.shut_down()


if __name__ == "__main__":
    main()
