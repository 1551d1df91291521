"""From `stop()` to the last of the eleven channels stopped, under load.

A channel counts as stopped when its first SA_Stop_A has come back from the library. Every other
time one device thread hangs in a library call, which a stop has to pass.
"""

import random
import threading
import time

from benchmarks.figures import Figure, main, percentile
from benchmarks.stand import Stand, Traffic, stand, wait_until

NAME = "stop"
CALL = "SA_Stop_A"
BLOCKED_S = 0.2


def collect(bench: Stand, count: int) -> tuple[list[float], list[float]]:
    """Stop `count` times each way; return the times in seconds, plain and with a hanging thread."""
    rng = random.Random(1)
    manager, axes = bench.manager, list(bench.mico)
    reached: dict[tuple[int, int], float] = {}
    all_reached = threading.Event()

    def note(when_s: float, args: tuple[int, ...]) -> None:
        reached.setdefault((args[0], args[1]), when_s)
        if len(reached) == len(axes):
            all_reached.set()

    free: list[float] = []
    blocked: list[float] = []
    for number in range(2 * count):
        traffic = Traffic(bench.mico)
        traffic.start()
        time.sleep(rng.uniform(0.05, 0.15))
        times = blocked if number % 2 else free
        if number % 2:
            stuck = bench.mico["left.x"]
            traffic.hand_over(stuck)
            bench.library.faults.inject("blocked_call", device=0, channel=0, delay_s=BLOCKED_S)
            stuck.move_to(rng.uniform(-1000.0, 1000.0), wait=False)
            wait_until(lambda: not bench.library.faults.active)
        traffic.end()
        reached.clear()
        all_reached.clear()
        bench.library.left[CALL] = note
        began_s = time.perf_counter()
        manager.stop("benchmark")
        if not all_reached.wait(5.0):
            raise RuntimeError(f"only {len(reached)} of {len(axes)} channels were stopped")
        times.append(max(reached.values()) - began_s)
        del bench.library.left[CALL]
        wait_until(lambda: not any(axis.details.in_motion for axis in axes))
        manager.reset_stop()
    return free, blocked


def measure(quick: bool = False) -> list[Figure]:
    """Return the figures of one run."""
    with stand() as bench:
        free, blocked = bench.beside(lambda: collect(bench, 1 if quick else 60))
    return [
        Figure(NAME, "11 channels, p50", 1e3 * percentile(free, 50), "ms"),
        Figure(NAME, "11 channels, p99", 1e3 * percentile(free, 99), "ms", 10),
        Figure(NAME, "11 channels, worst", 1e3 * max(free), "ms"),
        Figure(NAME, "one thread hanging, p50", 1e3 * percentile(blocked, 50), "ms"),
        Figure(NAME, "one thread hanging, p99", 1e3 * percentile(blocked, 99), "ms", 10),
        Figure(NAME, "one thread hanging, worst", 1e3 * max(blocked), "ms"),
    ]


if __name__ == "__main__":
    main(__doc__, measure)
