"""A read, a move and images over HTTP and EPICS beside the scripted API and a station, in one run.

The scripted API is measured in this process, HTTP and EPICS against a station in a process of its
own, one after the other. A move goes 1 um there or back and is measured until the axis is at rest
and the caller knows it: an EPICS put by design ends 80 ms after that. Images are those of a live
camera, followed by one client at a time; HTTP sends them as a page shows them, compressed.
"""

import json
import logging
import os
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import cycle
from pathlib import Path
from typing import Any

import httpx
from tests.system.served_program import served_program

import cosmic
from benchmarks.figures import Figure, main, percentile
from benchmarks.network import free_ports

NAME = "gateways"
AXIS = "left.x"
POSITION = f"/api/mico/state/axes/{AXIS}/_latest/position"
TARGETS = (10.0, 11.0)


@dataclass(frozen=True)
class Served:
    """A station with both gateways."""

    http: httpx.Client
    epics_port: int
    station: str


@contextmanager
def served() -> Iterator[Served]:
    """Start a station in a process of its own."""
    web, records, line = free_ports(3)
    more = {"EPICS_CA_SERVER_PORT": str(records)}
    with (
        tempfile.TemporaryDirectory() as folder,
        served_program(
            Path(folder), web, line, "--epics", "BENCH:", "--name", "bench", variables=more
        ) as program,
    ):
        yield Served(program.http, records, f"tcp/127.0.0.1:{line}")


def timed_ms(action: Callable[[], object], count: int) -> list[float]:
    """Return how long each of `count` calls took."""
    times = []
    for _ in range(count):
        begun_s = time.perf_counter()
        action()
        times.append(1e3 * (time.perf_counter() - begun_s))
    return times


def scripted(reads: int, moves: int) -> tuple[list[float], list[float]]:
    """Return the times of reads and moves of the scripted API in this process."""
    targets = cycle(TARGETS)
    with cosmic.connect() as rig:
        axis = rig.mico[AXIS]
        axis.move_to(TARGETS[1])
        return (
            timed_ms(lambda: axis.position_um, reads),
            timed_ms(lambda: axis.move_to(next(targets)), moves),
        )


def over_http(http: httpx.Client, reads: int, moves: int) -> tuple[list[float], list[float]]:
    """Return the times of reads and moves over HTTP."""
    targets = cycle(TARGETS)

    def move() -> None:
        motion = {"motion": {"kind": "MoveTo", "target": next(targets), "unit": "um"}}
        path = f"/api/mico/axes/{AXIS}/begin?wait=10"
        http.post(path, json=motion).raise_for_status()

    http.post("/api/control").raise_for_status()
    move()
    move()
    moved = timed_ms(move, moves)
    http.delete("/api/control").raise_for_status()
    # Held below the 200 requests a second that one client may send.
    read = []
    for _ in range(reads):
        read += timed_ms(lambda: http.get(POSITION).raise_for_status(), 1)
        time.sleep(max(0.0, 0.0055 - read[-1] / 1e3))
    return read, moved


def over_epics(port: int, reads: int, moves: int) -> tuple[list[float], list[float]]:
    """Return the times of reads and moves over EPICS."""
    os.environ |= {
        "EPICS_CA_SERVER_PORT": str(port),
        "EPICS_CA_ADDR_LIST": "127.0.0.1",
        "EPICS_CA_AUTO_ADDR_LIST": "NO",
    }
    from caproto.threading.client import Context  # it reads the environment when it is loaded

    context: Any = Context()
    place, target, control = context.get_pvs("BENCH:left_x.RBV", "BENCH:left_x", "BENCH:control")
    for each in (place, target, control):
        each.wait_for_connection(timeout=30)
    targets = cycle(TARGETS)

    def move() -> None:
        done = target.write([next(targets)], wait=True, timeout=30)
        assert done.status.success, done

    control.write([1], wait=True, timeout=30)
    move()
    move()
    moved = timed_ms(move, moves)
    read = timed_ms(lambda: place.read(timeout=30), reads)
    control.write([0], wait=True, timeout=30)
    context.disconnect()
    return read, moved


@dataclass
class Came:
    """What came of images, counted by whoever receives them."""

    images: int = 0
    size: int = 0

    def add(self, size: int) -> None:
        """Count an image of `size` bytes."""
        self.images += 1
        self.size += size

    def rows(self, door: str, seconds: float) -> list[Figure]:
        """Return them a second."""
        return [
            Figure(NAME, f"{door}: images", self.images / seconds, "Hz"),
            Figure(NAME, f"{door}: bytes of images", self.size / 1e6 / seconds, "MB/s"),
        ]


def images_by_station(endpoint: str, seconds: float) -> list[Figure]:
    """Follow a camera as a program does that uses the platform as a station; it stays live."""
    came = Came()
    with cosmic.connect(applications=(), stations={"bench": endpoint}) as rig:
        camera = rig.vico.camera()
        camera.start().wait(20.0)
        end = camera.watch_frames(lambda image: came.add(image.data.nbytes))
        time.sleep(seconds)
        end()
    return came.rows("station", seconds)


def images_by_http(http: httpx.Client, seconds: float) -> list[Figure]:
    """Follow a camera as the page does."""
    from websockets.sync.client import connect

    cameras = http.get("/api/vico/state/camera_handles").raise_for_status().json()
    topic = f"vico/camera_handles/{next(iter(cameras))}/shown"
    token = http.headers["Authorization"].removeprefix("Bearer ")
    address = str(http.base_url).rstrip("/").replace("http", "ws", 1)
    came, until_s = Came(), time.perf_counter() + seconds
    with connect(f"{address}/api/events", max_size=None) as line:
        line.send(json.dumps({"token": token, "follow": [topic]}))
        while time.perf_counter() < until_s:
            message = line.recv(timeout=20.0)
            if isinstance(message, bytes):
                came.add(len(message))
    return came.rows("HTTP", seconds)


def images_by_epics(seconds: float) -> list[Figure]:
    """Monitor the array of a camera's image."""
    from caproto.threading.client import Context

    context: Any = Context()
    (array,) = context.get_pvs("BENCH:microscope:image:ArrayData")
    array.wait_for_connection(timeout=30)
    came = Came()

    def take(_subscription: object, response: Any) -> None:
        came.add(len(response.data))

    subscription = array.subscribe()
    subscription.add_callback(take)
    time.sleep(seconds)
    subscription.clear()
    context.disconnect()
    return came.rows("EPICS", seconds)


def measure(quick: bool = False) -> list[Figure]:
    """Return the figures of one run."""
    logging.getLogger("cosmic").setLevel(logging.ERROR)
    reads, moves = (20, 3) if quick else (1000, 60)
    own_read, own_moved = scripted(reads, moves)
    figures = [
        Figure(NAME, "scripted API: read, p50", 1e3 * percentile(own_read, 50), "us"),
        Figure(NAME, "scripted API: move of 1 um, p50", percentile(own_moved, 50), "ms"),
    ]
    with served() as station:
        found = {
            "HTTP": over_http(station.http, reads, moves),
            "EPICS": over_epics(station.epics_port, reads, moves),
        }
        seconds = 2.0 if quick else 15.0
        seen = images_by_station(station.station, seconds)
        seen += images_by_http(station.http, seconds)
        seen += images_by_epics(seconds)
    for door, (read, moved) in found.items():
        figures += [
            Figure(NAME, f"{door}: read, p50", percentile(read, 50), "ms"),
            Figure(NAME, f"{door}: read, p99", percentile(read, 99), "ms"),
            Figure(NAME, f"{door}: read to scripted, p50", _ratio(read, own_read), ""),
            Figure(NAME, f"{door}: move of 1 um, p50", percentile(moved, 50), "ms"),
            Figure(NAME, f"{door}: move of 1 um, p99", percentile(moved, 99), "ms"),
            Figure(NAME, f"{door}: move to scripted, p50", _ratio(moved, own_moved), ""),
        ]
    return figures + seen


def _ratio(of: list[float], to: list[float]) -> float:
    return percentile(of, 50) / percentile(to, 50)


if __name__ == "__main__":
    main(__doc__, measure)
