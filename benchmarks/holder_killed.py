"""From kill -9 of the process that holds the lease to the moved axis at a stand.

A station hosts MiCo, DAQCo and ViCo. Another process takes control and moves left.x, now by a jog,
now to a position, and is killed. Half of the holders are as large as a program with a window: the
system gives back their memory before it closes their sockets. "Stationary" is what the station
itself has been told by its controller, which takes some polls longer than the stop. "Loaded" is
beside two programs that do nothing but compute. Told beside: when a small program that does nothing
else saw a bare socket of the same process closed. That is the part of the system, which first takes
the memory of a killed process apart; no station can know of it sooner.
"""

import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from benchmarks.figures import Figure, main, percentile
from benchmarks.network import free_ports
from benchmarks.stand import wait_until
from cosmic.app.configuration.network import NetworkSettings, serving
from cosmic.app.platform import Platform, build_platform
from cosmic.app.stations.host import StationHost
from cosmic.mico.api.axis import Axis
from cosmic.mico.api.mico import Mico

NAME = "holder_killed"
ROOT = Path(__file__).resolve().parents[1]
LARGE_MB = 300
WATCHER = """
import socket, sys, time
server = socket.create_server(("127.0.0.1", 0))
print(server.getsockname()[1], flush=True)
while True:
    line, _ = server.accept()
    try:
        line.recv(1)
    except OSError:
        pass
    print(time.monotonic(), flush=True)
    line.close()
"""
HOLDER = """
import socket, sys, cosmic
bare = socket.create_connection(("127.0.0.1", int(sys.argv[5])))
station, large_mb, jogs, away = sys.argv[1], int(sys.argv[2]), sys.argv[3] == "jog", sys.argv[4]
ballast = bytearray(b"x") * (large_mb * 1_000_000)
with cosmic.connect(stations={"bench": station}) as rig:
    rig.take_control()
    axis = rig.mico["left.x"]
    if jogs:
        jog = axis.jog(1 if away == "up" else -1, 200.0)
    else:
        axis.set_closed_loop_frequency(50)
        axis.move_to(3000.0 if away == "up" else -3000.0, wait=False)
    print("moving", flush=True)
    import threading
    end = threading.Event()
    while not end.wait(0.04):
        if jogs:
            jog.renew()
"""


@dataclass
class Times:
    """What was measured, in ms after the kill."""

    stopped: list[float] = field(default_factory=list)
    stationary: list[float] = field(default_factory=list)
    closed: list[float] = field(default_factory=list)


@dataclass
class Bench:
    """A station with everything on it."""

    platform: Platform
    axis: Axis
    endpoint: str
    lease: Any
    watcher: "subprocess.Popen[str]"
    watched_port: str

    def closed_s(self) -> float:
        """Return when the watcher saw the newest holder's bare socket closed."""
        return float(line_of(self.watcher))


def line_of(process: "subprocess.Popen[str]") -> str:
    """Return the next line that a program prints."""
    if process.stdout is None:
        raise RuntimeError("its output is not read here")
    return process.stdout.readline().strip()


@contextmanager
def bench() -> Iterator[Bench]:
    """Serve the shipped platform from this process."""
    endpoint = f"tcp/127.0.0.1:{free_ports(1)[0]}"
    platform = build_platform()
    with ExitStack() as at_end:
        at_end.callback(platform.shut_down)
        platform.initialize()
        how = serving(NetworkSettings(), "bench", ROOT, listen=endpoint, name="bench")
        host = StationHost(platform, how)
        at_end.callback(host.close)
        if platform.mico is None:
            raise RuntimeError("the shipped platform has no MiCo")
        watcher = at_end.enter_context(program(WATCHER))
        port = line_of(watcher)
        axis = Mico(platform.mico)["left.x"]
        yield Bench(platform, axis, endpoint, host.lease, watcher, port)


@contextmanager
def program(text: str, *arguments: str) -> "Iterator[subprocess.Popen[str]]":
    """Start a program in Python and kill it at the end."""
    process = subprocess.Popen(
        [sys.executable, "-c", text, *arguments],
        stdout=subprocess.PIPE,
        text=True,
        env=os.environ | {"PYTHONPATH": str(ROOT / "src")},
    )
    try:
        yield process
    finally:
        process.kill()
        process.communicate(timeout=20)


@contextmanager
def holder(made: Bench, what: str, large_mb: int) -> Iterator[subprocess.Popen[str]]:
    """Start a process that takes control and moves the axis."""
    away = "down" if (made.axis.position_um or 0.0) > 0.0 else "up"
    given = (made.endpoint, str(large_mb), what, away, made.watched_port)
    with program(HOLDER, *given) as process:
        if line_of(process) != "moving":
            raise RuntimeError("the holder does not move")
        yield process


@contextmanager
def load(count: int) -> Iterator[None]:
    """Keep `count` cores busy with other programs."""
    with ExitStack() as at_end:
        for _ in range(count):
            at_end.enter_context(program("while True: pass"))
        yield


def collect(made: Bench, count: int) -> Times:
    """Kill `count` holders one after the other."""
    found = Times()
    if made.platform.mico is None:
        raise RuntimeError("the shipped platform has no MiCo")
    controller: Any = made.platform.mico.manager.controller
    stop, stops = controller.stop, list[float]()

    def noted(channel: Any) -> None:
        stop(channel)
        stops.append(time.monotonic())

    controller.stop = noted
    try:
        for number in range(count):
            what = "jog" if number % 2 else "travel"
            with holder(made, what, LARGE_MB if number % 4 >= 2 else 0) as process:
                wait_until(lambda: made.axis.details.in_motion)
                time.sleep(0.2 + 0.013 * (number % 7))
                stops.clear()
                began_s = time.monotonic()
                process.kill()
                wait_until(lambda: stops and not made.axis.details.in_motion)
                found.stationary.append(1e3 * (time.monotonic() - began_s))
                found.stopped.append(1e3 * (stops[0] - began_s))
                found.closed.append(1e3 * (made.closed_s() - began_s))
            wait_until(lambda: made.lease.state.local)
    finally:
        del controller.stop
    return found


def _figures(case: str, times: Times, limit_ms: float) -> list[Figure]:
    own = [stopped - closed for stopped, closed in zip(times.stopped, times.closed, strict=True)]
    return [
        Figure(
            NAME, f"{case}: socket closed by the system, p50", percentile(times.closed, 50), "ms"
        ),
        Figure(NAME, f"{case}: socket closed by the system, worst", max(times.closed), "ms"),
        Figure(NAME, f"{case}: from there to the stop, worst", max(own), "ms"),
        Figure(NAME, f"{case}: stop at the controller, p50", percentile(times.stopped, 50), "ms"),
        Figure(NAME, f"{case}: stop at the controller, worst", max(times.stopped), "ms"),
        Figure(NAME, f"{case}: stationary, p50", percentile(times.stationary, 50), "ms"),
        Figure(NAME, f"{case}: stationary, worst", max(times.stationary), "ms", limit_ms),
    ]


def measure(quick: bool = False) -> list[Figure]:
    """Return the figures of one run."""
    count = 2 if quick else 50
    with bench() as made:
        figures = _figures("quiet", collect(made, count), 100)
        with load(2):
            figures += _figures("two cores loaded", collect(made, count), 250)
    return figures


if __name__ == "__main__":
    main(__doc__, measure)
