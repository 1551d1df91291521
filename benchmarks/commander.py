"""From a call of `DeviceCommander` to the function of the library, under load.

The measure is a bare hand-over between two threads (put into a queue, get in the other thread),
measured in turn with the calls. The gate's own time is told apart: how long it takes is the
business of the collision model.
"""

import random
import threading
import time
from dataclasses import dataclass, field
from queue import SimpleQueue
from typing import Any

from benchmarks.figures import Figure, main, percentile
from benchmarks.stand import Stand, Traffic, stand
from cosmic.mico.hw.interface import PositionerKind

NAME = "commander"
CALL = "SA_MovePositionAbsolute_A"


@dataclass
class Samples:
    """Times in seconds."""

    bare: list[float] = field(default_factory=list)
    total: list[float] = field(default_factory=list)
    gate: list[float] = field(default_factory=list)

    @property
    def without_gate(self) -> list[float]:
        """The calls without what the gate took."""
        return [total - gate for total, gate in zip(self.total, self.gate, strict=True)]


class BareHandOver:
    """A thread that does nothing but take what is put."""

    def __init__(self) -> None:
        self._there: SimpleQueue[float] = SimpleQueue()
        self._back: SimpleQueue[float] = SimpleQueue()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        while self._there.get() >= 0.0:
            self._back.put(time.perf_counter())

    def measure(self) -> float:
        """Return how long one hand-over took."""
        began_s = time.perf_counter()
        self._there.put(began_s)
        return self._back.get() - began_s

    def end(self) -> None:
        """End the thread."""
        self._there.put(-1.0)
        self._thread.join()


def watch_gate(bench: Stand) -> list[tuple[str, float, float]]:
    """Note axis, begin and end of every decision."""
    decisions: list[tuple[str, float, float]] = []
    gate = bench.manager.gate
    for name in ("decide", "decide_promptly"):
        setattr(gate, name, _timed(getattr(gate, name), decisions))
    return decisions


def _timed(decide: Any, decisions: list[tuple[str, float, float]]) -> Any:
    def timed(requests: Any, *more: Any) -> Any:
        began_s = time.perf_counter()
        answer = decide(requests, *more)
        decisions.append((requests[0].axis, began_s, time.perf_counter()))
        return answer

    return timed


def collect(bench: Stand, count: int) -> Samples:
    """Measure `count` hand-overs and as many calls, in turn."""
    rng = random.Random(1)
    axes = [axis for axis in bench.mico if axis.kind is PositionerKind.LINEAR]
    decisions = watch_gate(bench)
    calls: SimpleQueue[tuple[float, tuple[int, ...]]] = SimpleQueue()
    bench.library.entered[CALL] = lambda when_s, args: calls.put((when_s, args))
    traffic = Traffic(bench.mico)
    traffic.start()
    bare, samples = BareHandOver(), Samples()
    for number in range(count):
        time.sleep(rng.uniform(0.005, 0.025))
        samples.bare.append(bare.measure())
        time.sleep(rng.uniform(0.005, 0.025))
        axis = axes[number % len(axes)]
        # A target that nobody else uses, so that the call is known by it.
        counts = rng.choice((-1, 1)) * (20_000 + 2 * number + 1)
        channel = bench.manager.address(axis.key).channel
        traffic.hand_over(axis)
        began_s = time.perf_counter()
        movement = axis.commander.move_absolute(channel, counts / 10.0, "um")
        called_s, args = calls.get(timeout=5.0)
        while args[2] != counts:
            called_s, args = calls.get(timeout=5.0)
        traffic.adopt(axis, movement)
        gate_s = sum(
            end_s - start_s
            for name, start_s, end_s in decisions
            if name == axis.key and began_s <= start_s <= called_s
        )
        decisions.clear()
        samples.total.append(called_s - began_s)
        samples.gate.append(gate_s)
    traffic.end()
    bare.end()
    if traffic.failures:
        raise RuntimeError(f"the load broke down: {traffic.failures[0]}")
    return samples


def measure(quick: bool = False) -> list[Figure]:
    """Return the figures of one run."""
    with stand() as bench:
        samples = bench.beside(lambda: collect(bench, 4 if quick else 600))
    bare_us = 1e6 * percentile(samples.bare, 50)
    net, total = samples.without_gate, samples.total
    return [
        Figure(NAME, "bare hand-over, p50", bare_us, "us"),
        Figure(NAME, "bare hand-over, p99", 1e6 * percentile(samples.bare, 99), "us"),
        Figure(NAME, "call without gate, p50", 1e6 * percentile(net, 50), "us"),
        Figure(NAME, "call without gate, p50 to bare", 1e6 * percentile(net, 50) / bare_us, "", 3),
        Figure(NAME, "call without gate, p99", 1e3 * percentile(net, 99), "ms", 5),
        Figure(NAME, "gate alone, p50", 1e6 * percentile(samples.gate, 50), "us"),
        Figure(NAME, "gate alone, p99", 1e3 * percentile(samples.gate, 99), "ms"),
        Figure(NAME, "call with gate, p50", 1e6 * percentile(total, 50), "us"),
        Figure(NAME, "call with gate, p50 to bare", 1e6 * percentile(total, 50) / bare_us, ""),
        Figure(NAME, "call with gate, p99", 1e3 * percentile(total, 99), "ms"),
    ]


if __name__ == "__main__":
    main(__doc__, measure)
