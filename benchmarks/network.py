"""Calls, events and frames between two processes, next to bare sockets in the same run.

"mTLS" is a line with certificates on both sides, which uses no shared memory and so is what two
computers get, but for the wire itself. "one host" is a line on the loopback without certificates,
where large messages go through shared memory.
"""

import logging
import os
import socket
import ssl
import struct
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.figures import Figure, main, percentile
from benchmarks.network_child import FRAME_SHAPE, receive, receive_message, send_message
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.network.certificates import make_certificates
from cosmic.frame.network.client_side_connection import ClientSideConnection
from cosmic.frame.network.line_settings import Certificates, Line
from cosmic.frame.network.transport import Rule
from cosmic.frame.network.zenoh_wire import ZenohWire

NAME = "network"
ROOT = Path(__file__).resolve().parents[1]
FRAME_BYTES = FRAME_SHAPE[0] * FRAME_SHAPE[1]


@dataclass(frozen=True)
class Bench:
    """The other process, and where it listens."""

    raw_port: int
    tls_port: int
    context: ssl.SSLContext
    secure: ClientSideConnection
    same_host: ClientSideConnection


def free_ports(count: int) -> list[int]:
    """Return ports that nobody uses now."""
    probes = [socket.create_server(("127.0.0.1", 0)) for _ in range(count)]
    ports = [probe.getsockname()[1] for probe in probes]
    for probe in probes:
        probe.close()
    return ports


@contextmanager
def bench() -> Iterator[Bench]:
    """Start the other process and connect to it."""
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        own = make_certificates(folder / "all", "server", "client")["client"]
        ports = free_ports(4)
        process = subprocess.Popen(
            [sys.executable, "-m", "benchmarks.network_child", str(folder / "all")]
            + [str(port) for port in ports],
            cwd=ROOT,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env=os.environ | {"PYTHONPATH": os.pathsep.join([str(ROOT), str(ROOT / "src")])},
        )
        stack.callback(process.wait, 20)
        stack.callback(process.kill)
        assert process.stdout is not None
        assert process.stdout.readline().strip() == "ready"
        context = ssl.create_default_context(cafile=own.authority)
        context.load_cert_chain(own.certificate, own.key)
        yield Bench(
            ports[0],
            ports[1],
            context,
            stack.enter_context(connected(f"tls/127.0.0.1:{ports[3]}", own)),
            stack.enter_context(connected(f"tcp/127.0.0.1:{ports[2]}", None)),
        )


@contextmanager
def connected(endpoint: str, own: Certificates | None) -> Iterator[ClientSideConnection]:
    """Connect to the station."""
    line = Line(endpoint, listens=False, station="server", certificates=own)
    client = ClientSideConnection("server", "client", lambda: ZenohWire(line), FailurePolicy())
    try:
        client.start()
        if not client.wait_until_here(10.0):
            raise RuntimeError(client.state.why)
        yield client
    finally:
        client.close()


def timed(call: Callable[[], object], count: int, warm: int = 20) -> list[float]:
    """Return how long each call took, in us."""
    for _ in range(warm):
        call()
    found = []
    for _ in range(count):
        began_s = time.perf_counter()
        call()
        found.append(1e6 * (time.perf_counter() - began_s))
    return found


def bare(port: int) -> socket.socket:
    """Connect to a bare socket."""
    line = socket.create_connection(("127.0.0.1", port))
    line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return line


def raw_figures(port: int, calls: int, frames: int) -> tuple[list[float], float]:
    """Return echo times in us and the rate of frames in MB/s, of a bare TCP socket."""
    with bare(port) as line:

        def echo() -> None:
            line.sendall(b"x" * 64)
            receive(line, 64)

        found = timed(echo, calls)
        line.sendall(bytes(64))
        receive(line, 64)
        began_s = time.perf_counter()
        line.sendall(struct.pack(">I", frames))
        for _ in range(frames):
            receive(line, FRAME_BYTES)
        return found, 1e-6 * frames * FRAME_BYTES / (time.perf_counter() - began_s)


def tls_calls(bench_: Bench, calls: int) -> list[float]:
    """Return how long a call takes over a TLS socket with msgpack, in us."""
    with bench_.context.wrap_socket(bare(bench_.tls_port), server_hostname="localhost") as line:

        def call() -> None:
            send_message(line, {"function": "ping", "arguments": {"a": 1.0}})
            receive_message(line)

        return timed(call, calls)


def own_call(client: ClientSideConnection) -> Callable[[], object]:
    """Return a call over a line."""
    return lambda: client.call("source", "ping", {"a": 1.0}, timeout_s=5.0)


class Received:
    """Counts what a subscription brings, and waits for it."""

    def __init__(self, client: ClientSideConnection, topic: str, rule: Rule) -> None:
        self.ages_ms: list[float] = []
        self.count = 0
        self.last_s = 0.0
        self.pause_s = 0.0
        self._came = threading.Condition()
        self.subscription = client.subscribe(topic, rule, self._receive)

    def _receive(self, payload: Any) -> None:
        now_s = time.monotonic()
        if isinstance(payload, tuple):
            self.ages_ms.append(1e3 * (now_s - payload[0]))
            np.add.reduce(payload[1][0], dtype=np.int64)
        with self._came:
            self.count += 1
            self.last_s = time.perf_counter()
            self._came.notify_all()
        if self.pause_s:
            time.sleep(self.pause_s)

    def wait_for(self, count: int, timeout_s: float) -> bool:
        """Wait until so many have come."""
        with self._came:
            return self._came.wait_for(lambda: self.count >= count, timeout_s)


def settled(client: ClientSideConnection, received: Received, order: str, **more: object) -> None:
    """Publish single messages until the first arrives, then forget them."""
    while not received.wait_for(1, 0.1):
        client.call("source", order, {"count": 1, **more}, timeout_s=5.0)
    time.sleep(0.2)
    received.count = 0
    received.ages_ms.clear()


def frame_rate(client: ClientSideConnection, count: int) -> tuple[float, int]:
    """Return the rate of frames, none of which may be lost, in MB/s, and how many were lost."""
    received = Received(client, "frames", Rule.ALL)
    settled(client, received, "frames", rate_hz=0.0)
    began_s = time.perf_counter()
    client.call("source", "frames", {"count": count, "rate_hz": 0.0}, timeout_s=5.0)
    received.wait_for(count, 20.0)
    received.subscription.close()
    lost = count - received.count
    return 1e-6 * received.count * FRAME_BYTES / (received.last_s - began_s), lost


def event_rate(client: ClientSideConnection, count: int) -> tuple[float, int]:
    """Return events per second and how many were lost."""
    received = Received(client, "events", Rule.ALL)
    settled(client, received, "events")
    began_s = time.perf_counter()
    client.call("source", "events", {"count": count}, timeout_s=5.0)
    received.wait_for(count, 20.0)
    received.subscription.close()
    return received.count / (received.last_s - began_s), count - received.count


def beside_frames(
    client: ClientSideConnection, seconds: float, rate_hz: float, pause_s: float
) -> tuple[list[float], list[float], float]:
    """Return call times in us and ages of frames in ms while they stream, and the CPU share."""
    received = Received(client, "frames", Rule.LATEST)
    settled(client, received, "frames", rate_hz=0.0)
    received.pause_s = pause_s
    ping, calls = own_call(client), []
    client.call("source", "frames", {"count": 100_000, "rate_hz": rate_hz}, timeout_s=5.0)
    there_s = float(client.call("source", "cpu_s"))  # type: ignore[arg-type]
    here_s, began_s = time.process_time(), time.perf_counter()
    while time.perf_counter() - began_s < seconds:
        calls += timed(ping, 1, warm=0)
        time.sleep(0.01)
    spent_s = time.process_time() - here_s + float(client.call("source", "cpu_s")) - there_s  # type: ignore[arg-type]
    share = 100.0 * spent_s / (time.perf_counter() - began_s)
    client.call("source", "quiet", timeout_s=5.0)
    received.subscription.close()
    return calls, received.ages_ms or [float("nan")], share


def stops(client: ClientSideConnection, count: int) -> list[float]:
    """Return how long stops took to be carried out there, in ms, one every 20 ms."""
    found = []
    for _ in range(count):
        began_s = time.monotonic()
        there_s = float(client.call("source", "stop", timeout_s=5.0))  # type: ignore[arg-type]
        found.append(1e3 * (there_s - began_s))
        time.sleep(0.02)
    return found


def stops_in_a_flood(client: ClientSideConnection, count: int) -> list[float]:
    """Return the same while 60 frames a second come and eight threads call without a pause."""
    received = Received(client, "frames", Rule.ALL)
    settled(client, received, "frames", rate_hz=0.0)
    client.call("source", "frames", {"count": 100_000, "rate_hz": 60.0}, timeout_s=5.0)
    ended = threading.Event()

    def flood() -> None:
        while not ended.is_set():
            client.call("source", "work", {"a": 1.0}, timeout_s=10.0)

    threads = [threading.Thread(target=flood) for _ in range(8)]
    for each in threads:
        each.start()
    try:
        return stops(client, count)
    finally:
        ended.set()
        for each in threads:
            each.join()
        client.call("source", "quiet", timeout_s=5.0)
        received.subscription.close()


def _stop_figures(bench_: Bench, count: int) -> list[Figure]:
    alone, flooded = stops(bench_.secure, count), stops_in_a_flood(bench_.secure, count)
    return [
        Figure(NAME, "stop with mTLS, until it is carried out, p50", percentile(alone, 50), "ms"),
        Figure(NAME, "stop with mTLS, p99", percentile(alone, 99), "ms", 5),
        Figure(NAME, "stop in a flood of calls and frames, p50", percentile(flooded, 50), "ms"),
        Figure(NAME, "stop in a flood of calls and frames, p99", percentile(flooded, 99), "ms", 50),
        Figure(NAME, "stop in a flood of calls and frames, worst", max(flooded), "ms"),
    ]


def _call_figures(bench_: Bench, raw: list[float], calls: int) -> list[Figure]:
    tls = tls_calls(bench_, calls)
    secure = timed(own_call(bench_.secure), calls)
    plain = timed(own_call(bench_.same_host), calls)
    raw_us, tls_us, secure_us = (percentile(each, 50) for each in (raw, tls, secure))
    return [
        Figure(NAME, "bare TCP echo, p50", raw_us, "us"),
        Figure(NAME, "bare TLS with msgpack, p50", tls_us, "us"),
        Figure(NAME, "call with mTLS, p50", secure_us, "us"),
        Figure(NAME, "call with mTLS, p50 to bare TLS", secure_us / tls_us, "", 5),
        Figure(NAME, "call with mTLS, p50 to bare TCP", secure_us / raw_us, ""),
        Figure(NAME, "bare TLS with msgpack, p99", percentile(tls, 99) / 1e3, "ms"),
        Figure(NAME, "call with mTLS, p99", percentile(secure, 99) / 1e3, "ms", 5),
        Figure(NAME, "call on one host, p50", percentile(plain, 50), "us"),
    ]


def _stream_figures(bench_: Bench, raw_mb_s: float, frames: int, events: int) -> list[Figure]:
    secure_mb_s, secure_lost = frame_rate(bench_.secure, frames)
    host_mb_s, host_lost = frame_rate(bench_.same_host, frames)
    rate, lost = event_rate(bench_.secure, events)
    return [
        Figure(NAME, "bare TCP, frames", raw_mb_s, "MB/s"),
        Figure(NAME, "frames with mTLS", secure_mb_s, "MB/s"),
        Figure(NAME, "frames with mTLS: bare TCP is faster by", raw_mb_s / secure_mb_s, "", 12),
        Figure(NAME, "frames on one host", host_mb_s, "MB/s"),
        Figure(NAME, "frames on one host: bare TCP is faster by", raw_mb_s / host_mb_s, "", 3),
        Figure(NAME, "frames lost of all", secure_lost + host_lost, "", 0),
        Figure(NAME, "time an event with mTLS", 1e6 / rate, "us", 50),
        Figure(NAME, "events lost", lost, "", 0),
    ]


def measure(quick: bool = False) -> list[Figure]:
    """Return the figures of one run."""
    logging.getLogger("cosmic").setLevel(logging.ERROR)
    calls, frames, events, seconds = (50, 5, 200, 0.3) if quick else (3000, 100, 20_000, 8.0)
    with bench() as bench_:
        raw, raw_mb_s = raw_figures(bench_.raw_port, calls, frames)
        figures = _call_figures(bench_, raw, calls)
        figures += _stop_figures(bench_, 10 if quick else 500)
        figures += _stream_figures(bench_, raw_mb_s, frames, events)
        times, ages_ms, share = beside_frames(bench_.secure, seconds, 15.0, 0.0)
        figures += [
            Figure(NAME, "15 fps, mTLS: call, p99", percentile(times, 99) / 1e3, "ms", 10),
            Figure(NAME, "15 fps, mTLS: age of a frame, p99", percentile(ages_ms, 99), "ms", 25),
            Figure(NAME, "15 fps, mTLS: CPU of both ends", share, "% of a core", 25),
        ]
        times, ages_ms, _ = beside_frames(bench_.secure, seconds, 60.0, 0.1)
        figures += [
            Figure(NAME, "slow display: call, p99", percentile(times, 99) / 1e3, "ms", 20),
            Figure(NAME, "slow display: age of a frame, p99", percentile(ages_ms, 99), "ms", 100),
        ]
    return figures


if __name__ == "__main__":
    main(__doc__, measure)
