"""How far apart the axes of a group start: six axes on three devices, in a busy program.

A start counts when its call enters the library. Beside it the same six calls are made natively,
back to back in one thread, into the same simulated library with the same load.
"""

import ctypes
import time
from collections.abc import Callable

from benchmarks.figures import Figure, main, percentile
from benchmarks.stand import Stand, stand, wait_until
from cosmic.mico.hw.scu3d_ctypes import SA_OK

NAME = "skew"
CALL = "SA_MovePositionAbsolute_A"
AXES = ("left.x", "left.y", "right.x", "right.y", "probe.x", "probe.y")
HOLD_MS = 60_000
WAY_UM = 30.0


def through_the_gate(bench: Stand, count: int) -> tuple[list[float], list[float]]:
    """Return the skew of `count` groups, as the library saw it and as it was told; seconds."""
    seen: list[float] = []
    told: list[float] = []
    entered: list[float] = []
    for number in range(count):
        entered.clear()
        bench.library.entered[CALL] = lambda when_s, _args: entered.append(when_s)
        way = WAY_UM if number % 2 else -WAY_UM
        group = bench.mico.move_by(dict.fromkeys(AXES, way), wait=False)
        group.wait(5.0)
        del bench.library.entered[CALL]
        seen.append(max(entered) - min(entered))
        told.append(1e-3 * (group.start_skew_ms or 0.0))
    return seen, told


def natively(bench: Stand, count: int) -> list[float]:
    """Return the skew of `count` rounds of bare calls, in seconds."""
    where = [bench.mico[name].details for name in AXES]
    function: Callable[..., int] = getattr(bench.library, CALL)
    skews: list[float] = []
    for number in range(count):
        way = round(10 * WAY_UM) if number % 2 else 0
        calls = [
            (
                ctypes.c_uint32(state.address.device),
                ctypes.c_uint32(state.address.channel),
                ctypes.c_int32(way),
                ctypes.c_uint32(HOLD_MS),
            )
            for state in where
        ]
        entered: list[float] = []
        for call in calls:
            entered.append(time.perf_counter())
            if function(*call) != SA_OK:
                raise RuntimeError(f"{CALL} was refused")
        skews.append(entered[-1] - entered[0])
        wait_until(lambda: all(bench.mico[name].details.activity.at_rest for name in AXES))
        time.sleep(0.02)
    return skews


def collect(bench: Stand, count: int) -> tuple[list[float], list[float], list[float]]:
    """Return both skews of groups and that of bare calls."""
    seen, told = through_the_gate(bench, count)
    return seen, told, natively(bench, count)


def measure(quick: bool = False) -> list[Figure]:
    """Return the figures of one run."""
    with stand() as bench:
        seen, told, bare = bench.beside(lambda: collect(bench, 4 if quick else 300))
    return [
        Figure(NAME, "6 axes on 3 devices, p50", 1e3 * percentile(seen, 50), "ms"),
        Figure(NAME, "6 axes on 3 devices, p99", 1e3 * percentile(seen, 99), "ms", 2),
        Figure(NAME, "as told by start_skew_ms, p99", 1e3 * percentile(told, 99), "ms"),
        Figure(NAME, "native calls, p50", 1e3 * percentile(bare, 50), "ms"),
        Figure(NAME, "native calls, p99", 1e3 * percentile(bare, 99), "ms"),
        Figure(
            NAME, "groups by native calls, p50", percentile(seen, 50) / percentile(bare, 50), "x"
        ),
        Figure(
            NAME, "groups by native calls, p99", percentile(seen, 99) / percentile(bare, 99), "x"
        ),
    ]


if __name__ == "__main__":
    main(__doc__, measure)
