"""What twenty browsers cost the window: images a second on its live view, with and without them.

The whole window stands offscreen with its camera live, force recorded and plotted, and serves HTTP.
The browsers are programs of another process that ask and follow what the page does, and decode
nothing. Both are measured in turn, so that what else the computer does meets both.
"""

import json
import logging
import os
import re
import statistics
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from benchmarks.figures import Figure, main, percentile
from benchmarks.full_platform import FullStand, full_platform
from benchmarks.load import threads
from benchmarks.network import free_ports
from cosmic.app.configuration.gateways import EpicsSettings, HttpSettings, doors
from cosmic.app.configuration.network import serving
from cosmic.app.stations.host import StationHost
from cosmic.app.windows.tasks import LOOK
from cosmic.vico.gui.camera_view import CameraView

NAME = "web_clients"
CLIENTS = 20
LIMIT_PERCENT = 5.0


@dataclass(frozen=True)
class Seen:
    """What was seen of the window in one stretch.

    Attributes
    ----------
    shown_hz : float
        Images shown a second.
    gaps_ms : list of float
        From one image to the next.
    core_percent : float
        Processor time of the window's process.
    """

    shown_hz: float
    gaps_ms: list[float]
    core_percent: float


@contextmanager
def served(bench: FullStand) -> Iterator[tuple[str, str]]:
    """Serve the window's platform over HTTP; yields address and token."""
    web, line = free_ports(2)
    opened = doors(HttpSettings(), EpicsSettings(), listen=f"127.0.0.1:{web}")
    file, path = bench.platform.file, bench.platform.path
    how = serving(file.network, "bench", path.parent, listen=f"tcp/127.0.0.1:{line}")
    host = StationHost(bench.platform, how, opened)
    try:
        (said,) = host.gateways
        found = re.search(r"HTTP at (\S+) \(token (\S+)\)", said)
        assert found is not None, said
        yield found[1], found[2]
    finally:
        host.close()


@contextmanager
def browsers(address: str, token: str, count: int) -> Iterator[dict[str, int]]:
    """Have so many browsers look; what came to them is filled in at the end."""
    command = [sys.executable, "-m", "benchmarks.web_clients_child", address, token, str(count)]
    root = Path(__file__).resolve().parents[1]
    found: dict[str, int] = {}
    with subprocess.Popen(
        command, cwd=root, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as child:
        assert child.stdin is not None and child.stdout is not None
        try:
            if child.stdout.readline() != "there\n":
                raise RuntimeError("the browsers did not come")
            yield found
            child.stdin.close()
            found |= json.loads(child.stdout.readline())
        finally:
            child.stdin.close()
            child.kill()


class Looker:
    """Notes when the view of a camera shows an image."""

    def __init__(self, view: CameraView) -> None:
        self._times_s: list[float] = []
        show = view.view.show_image

        def shown(*image: object) -> None:
            show(*image)
            self._times_s.append(time.perf_counter())

        view.view.show_image = shown  # type: ignore[method-assign]

    def look(self, seconds: float) -> Seen:
        """Watch for so long, from another thread."""
        self._times_s.clear()
        began_s, cpu_s = time.perf_counter(), time.process_time()
        time.sleep(seconds)
        passed_s, times_s = time.perf_counter() - began_s, list(self._times_s)
        percent = 100.0 * (time.process_time() - cpu_s) / passed_s
        gaps = [1e3 * (b - a) for a, b in pairwise(times_s)]
        return Seen(len(times_s) / passed_s, gaps, percent)


def measure(quick: bool = False) -> list[Figure]:
    """Return the figures of one run."""
    logging.getLogger("cosmic").setLevel(logging.ERROR)
    turns, seconds, clients = (1, 1.0, 2) if quick else (4, 15.0, CLIENTS)
    alone: list[Seen] = []
    beside: list[Seen] = []
    came: list[dict[str, int]] = []
    with full_platform(campaign=False) as bench, served(bench) as (address, token):
        looker = Looker(live_view(bench))

        def work() -> None:
            for _ in range(turns):
                time.sleep(0.2 if quick else 2.0)
                alone.append(looker.look(seconds))
                with browsers(address, token, clients) as found:
                    before = threads()
                    beside.append(looker.look(seconds))
                    if os.environ.get("COSMIC_BENCHMARK_THREADS"):
                        _tell(before, threads(), seconds)
                came.append(found)

        bench.beside(work)
    if any(each["lost"] for each in came):
        raise RuntimeError("a browser was sent away")
    cost = [100.0 * (1.0 - b.shown_hz / a.shown_hz) for a, b in zip(alone, beside, strict=True)]
    megabytes = sum(each["bytes"] for each in came) / 1e6 / (turns * seconds)
    images = sum(each["images"] for each in came) / (turns * seconds * clients)
    return [
        Figure(NAME, "images shown without browsers", _middle(alone), "Hz"),
        Figure(NAME, f"images shown with {clients} browsers", _middle(beside), "Hz"),
        Figure(NAME, "lost by browsers", statistics.median(cost), "%", LIMIT_PERCENT),
        Figure(NAME, "between images without, p95", _late(alone), "ms"),
        Figure(NAME, "between images with, p95", _late(beside), "ms"),
        Figure(NAME, "window's process without", _share(alone), "% of a core"),
        Figure(NAME, "window's process with", _share(beside), "% of a core"),
        Figure(NAME, "images a browser gets", images, "Hz"),
        Figure(NAME, "sent to all browsers", megabytes, "MB/s"),
    ]


def live_view(bench: FullStand) -> CameraView:
    """Return the live view of the first camera, in the workspace Look."""
    bench.window.workspaces.choose(LOOK)
    first = next(iter(bench.rig.vico.cameras))
    (view,) = (each for each in bench.window.findChildren(CameraView) if each.camera.name == first)
    if not view.isVisible():
        raise RuntimeError(f"the window shows no live view of {first}")
    return view


def _tell(before: dict[str, float], after: dict[str, float], seconds: float) -> None:
    spent = {name: 100.0 * (each - before.get(name, 0.0)) / seconds for name, each in after.items()}
    for name, percent in sorted(spent.items(), key=lambda item: -item[1])[:14]:
        print(f"{percent:6.1f} % {name}", file=sys.stderr)


def _middle(found: list[Seen]) -> float:
    return statistics.median(each.shown_hz for each in found)


def _late(found: list[Seen]) -> float:
    return percentile([gap for each in found for gap in each.gaps_ms] or [0.0], 95)


def _share(found: list[Seen]) -> float:
    return statistics.median(each.core_percent for each in found)


if __name__ == "__main__":
    main(__doc__, measure)
