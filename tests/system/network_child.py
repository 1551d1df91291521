"""What the tests of stations run in processes of their own; the first argument says which."""

import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Event

from contract.station_rig import Application, connected, wait_until
from cosmic.frame.errors import CosmicError, MoveRefused
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.network.certificates import station_certificates
from cosmic.frame.network.line_settings import Line
from cosmic.frame.network.server_listener import ServerListener
from cosmic.frame.network.station import Station
from cosmic.frame.network.transport import Rule
from cosmic.frame.network.zenoh_wire import ZenohWire


def say(text: str) -> None:
    sys.stdout.write(f"{text}\n")
    sys.stdout.flush()


def hold(endpoint: str, folder: str = "") -> None:
    """Take the lease and command motion on and on, each time to the moment of sending."""
    files = station_certificates(Path(folder)) if folder else None
    with connected(endpoint, "holder", certificates=files) as client:
        client.take_lease()
        while True:
            try:
                client.call("stage", "move", {"target_um": time.monotonic()}, timeout_s=5.0)
            except MoveRefused:
                if folder:  # go on after a cut
                    client.take_lease()
            except CosmicError as exc:
                say(f"{type(exc).__name__}: {exc}")
            wait_until(lambda: False, 0.02)


def serve(endpoint: str) -> None:
    """Serve a station until a line comes; then the main thread dies of an exception."""
    station = Station("fibres", FailurePolicy())
    station.host("stage", Application())
    # Without a `with`, on purpose: whoever forgets it must not leave a process that answers.
    line = Line(endpoint, listens=True, station="fibres")
    listener = ServerListener(station, ZenohWire(line))
    listener.start()
    say("serving")
    sys.stdin.readline()
    raise RuntimeError("the main thread dies")


def watch(endpoint: str) -> None:
    """Subscribe, and take so long for each that the line fills."""
    with connected(endpoint, "watcher") as client:
        client.subscribe("frames", Rule.ALL, lambda _: wait_until(lambda: False, 5.0))
        client.subscribe("frames", Rule.LATEST, lambda _: wait_until(lambda: False, 5.0))
        say("watching")
        sys.stdin.readline()


def flood(endpoint: str) -> None:
    """Call from eight threads, receive frames, and stop in between: say how long the worst took."""
    with connected(endpoint, "flooder") as client:
        frames = client.subscribe("frames", Rule.ALL, lambda _: None)
        ended = Event()

        def call() -> None:
            while not ended.is_set():
                client.call("stage", "add", {"a": 1.0}, timeout_s=10.0)

        with ThreadPoolExecutor(8) as pool:
            calls = [pool.submit(call) for _ in range(8)]
            say("flooding")
            worst_s = 0.0
            for _ in range(20):
                wait_until(lambda: False, 0.02)
                began_s = time.monotonic()
                client.call("stage", "stop")
                worst_s = max(worst_s, time.monotonic() - began_s)
            sys.stdin.readline()
            ended.set()
        for each in calls:
            each.result()
        say(f"{worst_s}")
        frames.close()


if __name__ == "__main__":
    {"hold": hold, "flood": flood, "serve": serve, "watch": watch}[sys.argv[1]](*sys.argv[2:])
