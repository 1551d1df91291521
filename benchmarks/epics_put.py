"""From a put of an EPICS client, in a process of its own, to the call of the library that moves.

Everything else that CoSMic does beside goes on: the window, the states of all axes as records. One
move follows the other, so that none waits for the one before.
"""

import logging
import subprocess
import sys
from queue import Empty, SimpleQueue

from benchmarks.figures import Figure, main, percentile
from benchmarks.network import free_ports
from benchmarks.stand import Stand, stand
from cosmic.app.configuration.gateways import EpicsSettings
from cosmic.app.gateways.epics import EpicsGateway
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.network.host import Host
from cosmic.frame.network.station import Station

NAME = "epics_put"
CALL = "SA_MovePositionAbsolute_A"
LIMIT_MS = 15.0
CLIENT = """
import os, sys, time
port, count = sys.argv[1:]
os.environ |= {
    "EPICS_CA_SERVER_PORT": port,
    "EPICS_CA_ADDR_LIST": "127.0.0.1",
    "EPICS_CA_AUTO_ADDR_LIST": "NO",
}
from caproto.threading.client import Context
target, control = Context().get_pvs("BENCH:left_x", "BENCH:control")
for each in (target, control):
    each.wait_for_connection(timeout=30)
control.write([1], wait=True, timeout=30)
for number in range(int(count)):
    begun_s = time.perf_counter()
    done = target.write([100.0 + 10.0 * (number % 2)], wait=True, timeout=30)
    print(begun_s, done.status.success, flush=True)
"""


def collect(bench: Stand, port: int, count: int) -> list[float]:
    """Return the times in ms of `count` puts; all processes of a computer share the clock."""
    calls: SimpleQueue[float] = SimpleQueue()
    bench.library.entered[CALL] = lambda when_s, _args: calls.put(when_s)
    command = [sys.executable, "-c", CLIENT, str(port), str(count)]
    found = []
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as client:
        assert client.stdout is not None
        for line in client.stdout:
            begun_s, done = line.split()
            if done != "1":
                raise RuntimeError("a put was refused")
            found.append(1e3 * (_first_after(calls, float(begun_s)) - float(begun_s)))
    return found


def _first_after(calls: "SimpleQueue[float]", begun_s: float) -> float:
    while True:
        try:
            called_s = calls.get(timeout=5.0)
        except Empty:
            raise RuntimeError("a put ended without a call of the library") from None
        if called_s > begun_s:
            return called_s


def measure(quick: bool = False) -> list[Figure]:
    """Return the figures of one run."""
    logging.getLogger("cosmic").setLevel(logging.ERROR)
    count = 20 if quick else 1000
    (port,) = free_ports(1)
    with stand(repaint=not quick) as bench:

        def work() -> list[float]:
            station = Station("bench", FailurePolicy())
            host = Host("mico", bench.mico)
            station.host("mico", host)
            records = EpicsGateway(
                station, {"mico": host}, EpicsSettings(prefix="BENCH:", port=port)
            )
            try:
                return collect(bench, port, count)
            finally:
                records.close()
                host.close()

        times_ms = bench.beside(work)
    return [
        Figure(NAME, "put to call of the library, p50", percentile(times_ms, 50), "ms"),
        Figure(NAME, "put to call of the library, p99", percentile(times_ms, 99), "ms", LIMIT_MS),
        Figure(NAME, "put to call of the library, longest", max(times_ms), "ms"),
    ]


if __name__ == "__main__":
    main(__doc__, measure)
