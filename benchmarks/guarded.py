"""The guarded ratios: CPU time of what must not become slow, against a reference in the same run.

Each probe is a process of its own, `python -m benchmarks.guarded PROBE`, and tells its ratios as
JSON. Where a bare way of doing the same is at hand (a hand-over between threads, native calls, a
bare TLS line), that is the reference; else a fixed piece of Python and numpy, timed in turn with
what is measured, so that a slower or busier machine slows both.
"""

import argparse
import json
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from queue import SimpleQueue
from typing import Any, Final

import numpy as np

Ratios = dict[str, float]
ROOT: Final = Path(__file__).resolve().parents[1]
RECIPE: Final = """
procedure = "bend test"
[sample]
name = "three-dry"
[stop]
count = 1
[output]
html = false
pdf = false
table = false
"""


def reference_s() -> float:
    """Return the CPU time of a fixed calculation, about 6 ms: objects, dictionaries, arrays."""
    grid = np.linspace(0.0, 1.0, 2000)
    before_s = time.thread_time()
    found: dict[str, float] = {}
    for number in range(16_000):
        name = f"axis {number % 97}"
        found[name] = found.get(name, 0.0) + abs(number - 50.0) ** 0.5
    for turn in range(600):
        grid = np.sqrt(grid * grid + 1e-6 * turn)
    assert found
    assert grid.any()
    return time.thread_time() - before_s


def to_reference(sample: Callable[[], float], count: int) -> float:
    """Return the median of some samples to that of the reference, taken in turn."""
    sample()
    pairs = [(sample(), reference_s()) for _ in range(count)]
    return statistics.median(each[0] for each in pairs) / statistics.median(
        each[1] for each in pairs
    )


def thread_s(work: Callable[[], object]) -> float:
    """Return the CPU time of a call in this thread."""
    before_s = time.thread_time()
    work()
    return time.thread_time() - before_s


def children_s(command: Sequence[str], environment: dict[str, str] | None = None) -> float:
    """Return the CPU time of a program and of the programs that it waited for."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(
        command,
        cwd=ROOT,
        check=True,
        capture_output=True,
        timeout=100,
        env=os.environ | (environment or {}),
    )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def commands() -> Ratios:
    """Return what orders cost on the platform, and its window where nothing happens."""
    from benchmarks.stand import stand

    with stand(repaint=False) as bench:
        return bench.beside(lambda: _commands(bench))


def _commands(bench: Any) -> Ratios:
    from PySide6.QtCore import QMetaObject, Qt

    idle = _idle(2.0)
    # Else what is painted by chance counts as well.
    QMetaObject.invokeMethod(bench.window, "hide", Qt.ConnectionType.BlockingQueuedConnection)
    return {
        "idle, window open": idle,
        "call of the commander to a bare hand-over": _call(bench, 60),
        "end of a movement told": _completion(bench, 60),
        "start of a group of 6 to native calls": _group(bench, 24),
        "stop of 11 channels": _stop(bench, 20),
    }


def _idle(seconds: float) -> float:
    time.sleep(0.5)
    before_s, began_s = time.process_time(), time.perf_counter()
    time.sleep(seconds)
    share = (time.process_time() - before_s) / (time.perf_counter() - began_s)
    return share / statistics.median(reference_s() for _ in range(9))


class _Echo:
    """A thread that tells the CPU time of the process when it is handed something."""

    def __init__(self) -> None:
        self._there: SimpleQueue[bool] = SimpleQueue()
        self._back: SimpleQueue[float] = SimpleQueue()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self) -> None:
        while self._there.get():
            self._back.put(time.process_time())

    def cpu_s(self) -> float:
        """Return the CPU time of one hand-over."""
        before_s = time.process_time()
        self._there.put(True)
        return self._back.get() - before_s

    def end(self) -> None:
        """End the thread."""
        self._there.put(False)
        self._thread.join()


def _call(bench: Any, count: int) -> float:
    """Return the CPU time from a call to the library's function, to that of a bare hand-over."""
    from benchmarks.skew import CALL

    axis, echo = bench.mico["left.x"], _Echo()
    channel = bench.manager.address(axis.key).channel
    entered: SimpleQueue[float] = SimpleQueue()
    calls, bare = [], []
    for number in range(count):
        bare.append(echo.cpu_s())
        time.sleep(0.01)
        bench.library.entered[CALL] = lambda _when_s, _args: entered.put(time.process_time())
        before_s = time.process_time()
        movement = axis.commander.move_absolute(channel, 1000.0 + number % 2, "um")
        calls.append(entered.get(timeout=5.0) - before_s)
        del bench.library.entered[CALL]
        movement.wait(10.0)
        time.sleep(0.01)
    echo.end()
    return statistics.median(calls) / statistics.median(bare)


def _completion(bench: Any, count: int) -> float:
    """Return the CPU time from COMPLETED, handed out, to the movement's own end."""
    from benchmarks.completion import RECEIVE
    from cosmic.mico.hw import scu3d_ctypes as sa

    axis, handed_s = bench.mico["left.x"], [0.0]

    def on_packet(_when_s: float, args: tuple[Any, ...]) -> None:
        if args[2]._obj.packetType == sa.SA_COMPLETED_PACKET_TYPE:
            handed_s[0] = time.process_time()

    def published() -> float:
        ended: SimpleQueue[float] = SimpleQueue()
        movement = axis.move_by(20.0 if axis.position_um < 1000.0 else -20.0, wait=False)
        movement.add_callback(lambda _: ended.put(time.process_time()))
        found = ended.get(timeout=10.0) - handed_s[0]
        time.sleep(0.01)
        return found

    bench.library.left[RECEIVE] = on_packet
    found = to_reference(published, count)
    del bench.library.left[RECEIVE]
    return found


def _group(bench: Any, count: int) -> float:
    """Return the CPU time of starting a group, to that of the six native calls."""
    from benchmarks import skew
    from benchmarks.stand import wait_until

    groups, bare, entered = [], [], SimpleQueue[float]()
    for number in range(count):
        way = skew.TRAVEL_UM if number % 2 else -skew.TRAVEL_UM
        bench.library.entered[skew.CALL] = lambda *_: entered.put(time.process_time())
        before_s = time.process_time()
        group = bench.mico.move_by(dict.fromkeys(skew.AXES, way), wait=False)
        groups.append(max(entered.get(timeout=5.0) for _ in skew.AXES) - before_s)
        del bench.library.entered[skew.CALL]
        group.wait(10.0)
        before_s = time.process_time()
        for name in skew.AXES:
            address = bench.mico[name].details.address
            counts = round(10.0 * (bench.mico[name].position_um or 0.0))
            getattr(bench.library, skew.CALL)(address.device, address.channel, counts, skew.HOLD_MS)
        bare.append(time.process_time() - before_s)
        wait_until(lambda: all(bench.mico[name].details.activity.at_rest for name in skew.AXES))
    return statistics.median(groups) / statistics.median(bare)


def _stop(bench: Any, count: int) -> float:
    """Return the CPU time from a stop to the last of the channels that all move."""
    from benchmarks.load import SLOW_HZ
    from benchmarks.stand import Traffic, wait_until
    from benchmarks.stop import CALL

    axes = list(bench.mico)

    def stopped() -> float:
        reached: set[tuple[int, int]] = set()
        last: SimpleQueue[float] = SimpleQueue()

        def note(_when_s: float, args: tuple[Any, ...]) -> None:
            reached.add((args[0], args[1]))
            if len(reached) == len(axes):
                last.put(time.process_time())

        traffic = Traffic(bench.mico, SLOW_HZ)
        traffic.start()
        traffic.end()
        time.sleep(0.05)
        bench.library.left[CALL] = note
        before_s = time.process_time()
        bench.manager.stop("guard")
        took_s = last.get(timeout=5.0) - before_s
        del bench.library.left[CALL]
        wait_until(lambda: not any(axis.details.in_motion for axis in axes))
        bench.manager.reset_stop()
        return took_s

    return to_reference(stopped, count)


def gate() -> Ratios:
    """Return what the collision gate's check of a movement costs."""
    from benchmarks.gate_process import SCENE, moves
    from cosmic.mico.core.collision.scene_loader import load_scene
    from cosmic.mico.core.collision.sweep import Sweep

    model = load_scene(SCENE)
    sweep, questions = Sweep(model), moves(model, 100)

    def checks() -> None:
        for spans in questions:
            sweep.check(spans)

    return {"check of the gate": to_reference(lambda: thread_s(checks), 7) / len(questions)}


def start() -> Ratios:
    """Return what importing the program costs, and starting it until its axes are painted."""
    bare = [sys.executable, "-c", "import numpy, PySide6.QtWidgets"]
    imports = [sys.executable, "-c", "import cosmic.app.windows.run_window"]
    opened = [sys.executable, "-m", "benchmarks.start_child"]
    offscreen = {"QT_QPA_PLATFORM": "offscreen"}
    for command in (bare, imports):
        children_s(command)
    bare_s = statistics.median(children_s(bare) for _ in range(5))
    return {
        "imports to those of numpy and Qt": statistics.median(children_s(imports) for _ in range(3))
        / bare_s,
        "start to the axes painted to importing numpy and Qt": statistics.median(
            children_s(opened, offscreen) for _ in range(2)
        )
        / bare_s,
    }


def acquisition() -> Ratios:
    """Return what handling 32 channels at 15 kHz costs, recorded, without boards and plot."""
    from benchmarks.acquisition import chain, settings
    from cosmic.frame.clock import WallClock
    from cosmic.testing.fast_board import FastLibrary

    wanted = settings(("Fast1",), 15_000.0)

    def share() -> float:
        found = chain("guard", FastLibrary(WallClock()), wanted, 1.5, plot=False)
        return next(each.value for each in found if each.name.endswith("processor")) / 100.0

    return {"chunks of 32 channels at 15 kHz, a second": to_reference(share, 2)}


def network() -> Ratios:
    """Return what a call over mTLS costs both sides, to one over a bare TLS line."""
    from benchmarks.network import bench, own_call, tls_calls

    with bench() as lines:
        call = own_call(lines.secure)

        def spent_s(work: Callable[[], object]) -> float:
            there_s, here_s = float(call_cpu()), time.process_time()
            work()
            return time.process_time() - here_s + float(call_cpu()) - there_s

        def call_cpu() -> Any:
            return lines.secure.call("source", "cpu_s", timeout_s=5.0)

        def calls() -> None:
            for _ in range(200):
                call()

        calls()
        ratios = [
            spent_s(calls) / spent_s(lambda: tls_calls(lines, 200)) * 220.0 / 200.0
            for _ in range(11)
        ]
    return {"call over mTLS to bare TLS": statistics.median(ratios)}


def fibres() -> Ratios:
    """Return what finding the fibre on an image costs."""
    import cv2

    from benchmarks.fibre_images import ROWS, draw
    from cosmic.vico.api import find_fibres

    cv2.setNumThreads(1)
    images = iter([draw(ROWS["plain"], seed)[0] for seed in range(10)])
    return {
        "fibres of an image": to_reference(lambda: thread_s(partial(find_fibres, next(images))), 9)
    }


def twin() -> Ratios:
    """Return what a second of the twin's force side costs while the probe pushes."""
    from benchmarks.twin_force import measure

    def pushing_s() -> float:
        named = {each.name: each.value for each in measure(quick=True)}
        return named["two sensors, probe pushes"]

    return {"force side of the twin, a second": to_reference(pushing_s, 9)}


def campaign() -> Ratios:
    """Return what a campaign of one fibre costs, taken, bent and put away."""
    with tempfile.TemporaryDirectory() as folder:
        recipe = Path(folder) / "one.toml"
        recipe.write_text(RECIPE, encoding="utf-8")
        command = [sys.executable, "-m", "cosmic", "campaign", str(recipe)]
        command += ["--out", str(Path(folder) / "out"), "--rate", "50", "--seed", "3"]
        before = [reference_s() for _ in range(5)]
        spent_s = children_s(command)
        after = [reference_s() for _ in range(5)]
    return {"campaign of one fibre": spent_s / statistics.median([*before, *after])}


PROBES: Final[dict[str, Callable[[], Ratios]]] = {
    each.__name__: each
    for each in (commands, gate, start, acquisition, network, fibres, twin, campaign)
}


def main() -> None:
    """Read the command line and measure."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("probe", choices=PROBES)
    print(json.dumps(PROBES[parser.parse_args().probe]()))


if __name__ == "__main__":
    main()
