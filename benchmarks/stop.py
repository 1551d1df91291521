"""From `stop()` to the last of the eleven channels stopped, with everything running.

A channel counts as stopped when its first SA_Stop_A has come back from the library. The time for
which the stopping thread was ready to run and had no core is taken off, and told beside it; that
of the threads which had the interpreter meanwhile is not.
"""

import random
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from PySide6.QtCore import QObject, Qt, Signal

from benchmarks.figures import Figure, main, percentile
from benchmarks.full_platform import (
    RECIPE,
    CoreWait,
    FullStand,
    busy_processes,
    full_platform,
)
from benchmarks.stand import wait_until
from cosmic.app.configuration.network import serving
from cosmic.app.stations.host import StationHost
from cosmic.frame.errors import CosmicError, MoveRefused
from cosmic.mico.api.trajectory_state import PlayState
from cosmic.mico.core.trajectory.reader import parse

NAME = "stop"
CALL = "SA_Stop_A"
SPEED_HZ, WAY_UM, WAY_STEPS = 100, 60.0, 400
PAUSE_S = (0.01, 0.08)
BLOCKED_S = 0.2
ONE_AXIS = "right.x"
LONGEST_S = 60.0
P99_MS, WORST_MS, LOADED_P99_MS = 10.0, 25.0, 60.0
TRAJECTORY = "cosmic-trajectory 1\nplatform {}\nleft.x to -400 um\nleft.x to 0 um\n"
OTHER = """
import sys, time
import cosmic
with cosmic.connect(applications=(), stations={"stand": sys.argv[1]}) as rig:
    print("ready", flush=True)
    for _ in sys.stdin:
        began_s = time.perf_counter()
        rig.stop("another process")
        print(began_s, flush=True)
"""

Begin = Callable[[FullStand, int], Callable[[], object]]
"""Sets things moving for the nth stop, and returns what to do after it."""
Stop = Callable[[], float]
"""Stops everything and returns when that began, as `time.perf_counter` tells."""


@dataclass(frozen=True, slots=True)
class Taken:
    """How long one stop took, and how much of that its thread waited for a core."""

    whole_s: float
    core_s: float

    @property
    def own_s(self) -> float:
        """What is the program's own."""
        return self.whole_s - self.core_s


class Watch:
    """Sees when every channel has been stopped, or that of `axis`; for the thread that makes it."""

    def __init__(self, stand: FullStand, axis: str | None = None) -> None:
        self._library = stand.library
        addresses = [each.details.address for each in stand.mico if axis in (None, each.key)]
        self._wanted = {(each.device, each.channel) for each in addresses}
        self._reached: dict[tuple[int, int], float] = {}
        self._all = threading.Event()
        self._thread = threading.get_ident()
        self._core = CoreWait()
        self._core_s = 0.0

    def stopped_by(self, stop: Stop) -> Taken:
        """Have `stop` called, here, and return how long it took until all were stopped."""
        self._reached.clear()
        self._all.clear()
        before_s = self._core_s = self._core.now_s()
        self._library.left[CALL] = self._note
        began_s = stop()
        if not self._all.wait(LONGEST_S):
            raise RuntimeError(f"only {len(self._reached)} channels were stopped")
        del self._library.left[CALL]
        return Taken(max(self._reached.values()) - began_s, self._core_s - before_s)

    def close(self) -> None:
        """Watch no more."""
        self._core.close()

    def _note(self, when_s: float, args: tuple[int, ...]) -> None:
        if (args[0], args[1]) not in self._wanted:
            return
        self._reached.setdefault((args[0], args[1]), when_s)
        if len(self._reached) == len(self._wanted) and not self._all.is_set():
            if threading.get_ident() == self._thread:
                self._core_s = self._core.now_s()
            self._all.set()


def nothing() -> None:
    """Do nothing after a stop."""


# What moves


def all_axes(stand: FullStand, number: int) -> Callable[[], object]:
    """Let all axes go to and fro slowly; what the gate refuses stands."""
    sign = -1 if number % 2 else 1
    for axis in stand.mico:
        with suppress(MoveRefused):
            if axis.limits is None:
                axis.steps(sign * WAY_STEPS, frequency_hz=1000, wait=False)
            else:
                axis.move_by(sign * WAY_UM, wait=False)
    return nothing


def one_axis(stand: FullStand, number: int) -> Callable[[], object]:
    """Let one axis go to and fro slowly."""
    axis = stand.mico[ONE_AXIS]
    axis.move_by(-WAY_UM if number % 2 else WAY_UM, wait=False)
    wait_until(lambda: axis.details.in_motion)
    return nothing


def one_thread_hangs(stand: FullStand, number: int) -> Callable[[], object]:
    """Have a device thread hang in a library call, which the stop has to pass."""
    stand.library.faults.inject("blocked_call", delay_s=BLOCKED_S)
    all_axes(stand, number)
    with suppress(TimeoutError):
        wait_until(lambda: not stand.library.faults.active, 2.0)
    return stand.library.faults.clear


def trajectory(stand: FullStand, _number: int) -> Callable[[], object]:
    """Run a trajectory."""
    text = TRAJECTORY.format(stand.platform.file.platform.name)
    run = stand.mico.trajectories.run(parse(text), wait=False)
    wait_until(lambda: stand.mico["left.x"].details.in_motion)

    def end() -> None:
        run.cancel()
        wait_until(lambda: run.state is not PlayState.RUNNING)

    return end


def control_loop(stand: FullStand, _number: int) -> Callable[[], object]:
    """Hold a force, or rather look for it where nothing is."""
    loop = stand.rig.control.hold_force("force", "probe.y", 50.0, direction=-1)
    wait_until(lambda: stand.mico["probe.y"].details.in_motion, 20.0)
    return loop.stop


def own_campaign(stand: FullStand, _number: int) -> Callable[[], object]:
    """Run a campaign on the platform that is stopped."""
    folder = tempfile.TemporaryDirectory()
    campaign = stand.rig.campaign(RECIPE, folder.name)
    campaign.start()

    def end() -> None:
        campaign.abort()
        campaign.join()
        folder.cleanup()

    wait_until(lambda: any(axis.details.in_motion for axis in stand.mico), 20.0)
    return end


# Who stops


def from_here(stand: FullStand) -> Stop:
    """Stop in the thread that measures."""

    def stop() -> float:
        began_s = time.perf_counter()
        stand.manager.stop("benchmark")
        return began_s

    return stop


class Key(QObject):
    """Stops in the window's thread, as a key does, behind whatever is painted there."""

    pressed = Signal()

    def __init__(self, stand: FullStand) -> None:
        super().__init__()
        self._manager = stand.manager
        self.moveToThread(stand.app.thread())
        self.pressed.connect(self._on_pressed, Qt.ConnectionType.QueuedConnection)

    def stop(self) -> float:
        """Press the key."""
        began_s = time.perf_counter()
        self.pressed.emit()
        return began_s

    def _on_pressed(self) -> None:
        self._manager.stop("benchmark")


@contextmanager
def another_process(stand: FullStand) -> Iterator[Stop]:
    """Stop from a process that uses the platform as a station."""
    with socket.create_server(("127.0.0.1", 0)) as free:
        endpoint = f"tcp/127.0.0.1:{free.getsockname()[1]}"
    platform = stand.platform
    how = serving(platform.file.network, "stand", platform.path.parent, listen=endpoint)
    with ExitStack() as at_end:
        at_end.callback(StationHost(platform, how).close)
        child = subprocess.Popen(
            [sys.executable, "-c", OTHER, endpoint],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            cwd=Path(__file__).parents[1],
        )
        at_end.callback(child.wait)
        at_end.callback(child.kill)
        if child.stdin is None or child.stdout is None or child.stdout.readline() != "ready\n":
            raise RuntimeError("the other process does not start")
        asked, answers = child.stdin, child.stdout

        def stop() -> float:
            asked.write("stop\n")
            asked.flush()
            return float(answers.readline())  # one clock for all processes of a computer

        yield stop


def collect(
    stand: FullStand,
    count: int,
    begin: Begin = all_axes,
    stop: Stop | None = None,
    *,
    axis: str | None = None,
) -> list[Taken]:
    """Stop everything `count` times while it moves; measured of all, or of one axis."""
    rng = random.Random(1)
    taken = []
    with closing(Watch(stand, axis)) as watch:
        for number in range(count):
            end = begin(stand, number)
            time.sleep(rng.uniform(*PAUSE_S))
            taken.append(watch.stopped_by(stop or from_here(stand)))
            with suppress(CosmicError):
                end()
            wait_until(lambda: not any(axis.details.in_motion for axis in stand.mico))
            stand.manager.reset_stop()
    return taken


def rows(
    name: str, taken: list[Taken], p99_ms: float | None = P99_MS, worst_ms: float | None = None
) -> list[Figure]:
    """Return the rows of one kind of stop."""
    own = [1e3 * each.own_s for each in taken]
    worst = max(own)
    print(f"{name}: {len(own)} stops, the slowest {worst:.1f} ms", file=sys.stderr, flush=True)
    core = [1e3 * each.core_s for each in taken]
    whole = [1e3 * each.whole_s for each in taken]
    return [
        Figure(NAME, f"{name}, p50", percentile(own, 50), "ms"),
        Figure(NAME, f"{name}, p99", percentile(own, 99), "ms", p99_ms),
        Figure(NAME, f"{name}, worst of {len(own)}", worst, "ms", worst_ms),
        Figure(NAME, f"{name}, waited for a core, p99", percentile(core, 99), "ms"),
        Figure(NAME, f"{name}, with that, p99", percentile(whole, 99), "ms"),
        Figure(NAME, f"{name}, with that, worst", max(whole), "ms"),
    ]


def every_kind(stand: FullStand, many: int, some: int, few: int) -> list[Figure]:
    """Return the whole table; `many`, `some` and `few` stops of the kinds."""
    for axis in stand.mico:
        if axis.limits is not None:
            axis.set_closed_loop_frequency(SPEED_HZ)
    found = rows("from another thread", collect(stand, many), worst_ms=WORST_MS)
    stand.library.lets_go = True
    found += rows("library in C", collect(stand, some), worst_ms=WORST_MS)
    one = collect(stand, some, one_axis, axis=ONE_AXIS)
    found += rows("library in C, the one axis that moves", one, worst_ms=WORST_MS)
    stand.library.lets_go = False
    found += rows("one thread hangs", collect(stand, few, one_thread_hangs))
    key = Key(stand)
    found += rows("from the window's thread", collect(stand, some, stop=key.stop), None)
    found += rows("in a trajectory", collect(stand, few, trajectory))
    found += rows("in a control loop", collect(stand, few, control_loop))
    found += rows("in a campaign", collect(stand, max(1, few // 5), own_campaign))
    with another_process(stand) as stop:
        found += rows("from another process, a station", collect(stand, few, stop=stop), None)
    with busy_processes(2):
        found += rows("two cores loaded", collect(stand, some), LOADED_P99_MS)
    return found


def measure(quick: bool = False) -> list[Figure]:
    """Return the figures of one run."""
    counts = (3, 2, 1) if quick else (2000, 200, 50)
    with full_platform() as stand:
        return stand.beside(lambda: every_kind(stand, *counts))


if __name__ == "__main__":
    main(__doc__, measure)
