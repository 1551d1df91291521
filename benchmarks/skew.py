"""How far apart the axes of a group start: six axes on three devices, in a busy program.

A start counts when its call enters the library. By turns with it the same six calls are made
natively, back to back in one thread, into the same simulated library with the same load.
"""

import ctypes
import time
from collections.abc import Callable

from benchmarks.figures import Figure, main, percentile
from benchmarks.stand import Stand, stand
from cosmic.mico.hw.scu3d_ctypes import SA_OK

NAME = "skew"
CALL = "SA_MovePositionAbsolute_A"
AXES = ("left.x", "left.y", "right.x", "right.y", "probe.x", "probe.y")
HOLD_MS = 60_000
TRAVEL_UM = 30.0
FRESH_TURN_S = 1e-6
"""A group starts with a fresh turn of the interpreter; preparing bare calls has used it up."""

TRAVEL_S = 0.1


def through_the_gate(bench: Stand, targets_um: dict[str, float]) -> tuple[float, float]:
    """Return the skew of one group, as the library saw it and as it was told; seconds."""
    entered: list[float] = []
    bench.library.entered[CALL] = lambda when_s, _args: entered.append(when_s)
    group = bench.mico.move(targets_um, wait=False)
    group.wait(5.0)
    del bench.library.entered[CALL]
    return max(entered) - min(entered), 1e-3 * (group.start_skew_ms or 0.0)


def natively(bench: Stand, targets_um: dict[str, float]) -> float:
    """Return the skew of one round of bare calls, in seconds."""
    function: Callable[..., int] = getattr(bench.library, CALL)
    calls = [
        (
            ctypes.c_uint32(state.address.device),
            ctypes.c_uint32(state.address.channel),
            ctypes.c_int32(round(10.0 * target_um)),
            ctypes.c_uint32(HOLD_MS),
        )
        for name, target_um in targets_um.items()
        for state in (bench.mico[name].details,)
    ]
    entered: list[float] = []
    time.sleep(FRESH_TURN_S)
    for call in calls:
        entered.append(time.perf_counter())
        if function(*call) != SA_OK:
            raise RuntimeError(f"{CALL} was refused")
    time.sleep(TRAVEL_S)
    bench.mico.move(targets_um)  # what moved without an order may have been stopped on its way
    return entered[-1] - entered[0]


def collect(bench: Stand, count: int) -> tuple[list[float], list[float], list[float]]:
    """Return both skews of groups and that of bare calls, made by turns: load hits them alike."""
    seen, by_event, bare = [], [], []
    home_um = {name: bench.mico[name].details.position or 0.0 for name in AXES}
    away_um = {name: where_um - TRAVEL_UM for name, where_um in home_um.items()}
    for _ in range(count):
        by_library, by_program = through_the_gate(bench, away_um)
        seen.append(by_library)
        by_event.append(by_program)
        bare.append(natively(bench, home_um))
    return seen, by_event, bare


def measure(quick: bool = False) -> list[Figure]:
    """Return the figures of one run."""
    with stand() as bench:
        seen, by_event, bare = bench.beside(lambda: collect(bench, 4 if quick else 300))
    p50, p99, bare_p50, bare_p99 = (
        1e3 * percentile(values, percent) for values in (seen, bare) for percent in (50, 99)
    )
    return [
        Figure(NAME, "6 axes on 3 devices, p50", p50, "ms"),
        Figure(NAME, "6 axes on 3 devices, p99", p99, "ms"),
        Figure(NAME, "as told by start_skew_ms, p99", 1e3 * percentile(by_event, 99), "ms"),
        Figure(NAME, "native calls, p50", bare_p50, "ms"),
        Figure(NAME, "native calls, p99", bare_p99, "ms", 1),
        Figure(NAME, "p99 beyond that of native calls", p99 - bare_p99, "ms", 2),
        Figure(NAME, "groups by native calls, p50", p50 / bare_p50, "x"),
        Figure(NAME, "groups by native calls, p99", p99 / bare_p99, "x"),
    ]


if __name__ == "__main__":
    main(__doc__, measure)
