"""Random movements on all axes for a long time: nothing may grow.

`python -m benchmarks.soak --minutes 10`. The log is filled before the first look, because the
window keeps the newest 5000 records. tracemalloc counts what Python allocated, at the price of
some speed; the resident set has what Qt took as well. The first half is warm-up: the records
logged before tracemalloc began give way to counted ones.
"""

import argparse
import gc
import logging
import os
import random
import threading
import time
import tracemalloc
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, fields
from pathlib import Path

from benchmarks.figures import Figure, table
from benchmarks.stand import Stand, stand, wait_until
from cosmic.frame.errors import CosmicError
from cosmic.mico.api.axis import Axis

NAME = "soak"
LOG_RECORDS = 6000
_STATUS = Path("/proc/self/status")


@dataclass(frozen=True, slots=True)
class Look:
    """What might grow, at one moment."""

    traced_kb: float
    resident_kb: float
    threads: int
    messages: int
    packets: int
    held: int
    moves: int


def resident_kb() -> float:
    """Return the resident set in kB; 0 outside Linux."""
    return _status(_STATUS).get("VmRSS", 0.0)


def helpers_kb() -> list[float]:
    """Return the resident set of each process that this one has started, kB; none outside Linux."""
    found = [_status(each) for each in Path("/proc").glob("[0-9]*/status")]
    return [each.get("VmRSS", 0.0) for each in found if each.get("PPid") == os.getpid()]


def _status(file: Path) -> dict[str, float]:
    """Return the numbers that stand in a file of the system about a process."""
    try:
        lines = file.read_text(encoding="utf-8").splitlines()
    except OSError:  # it has just ended, or this is no Linux
        return {}
    words = [line.replace(":", " ").split() for line in lines]
    return {each[0]: float(each[1]) for each in words if len(each) > 1 and each[1].isdecimal()}


def thread_count() -> int:
    """Return how many threads the system runs for this process; outside Linux those Python saw.

    Python goes on counting threads of Qt that have ended.
    """
    tasks = Path("/proc/self/task")
    return len(list(tasks.iterdir())) if tasks.exists() else threading.active_count()


def command(axis: Axis, rng: random.Random) -> None:
    """Command something at random; what the gate refuses is part of it."""
    with suppress(CosmicError):
        if axis.limits is None:
            axis.steps(rng.randint(-500, 500), wait=False)
            return
        low, high = axis.limits
        kind = rng.random()
        if kind < 0.6:
            axis.move_to(rng.uniform(1.02 * low, 1.02 * high), wait=False)
        elif kind < 0.9:
            axis.move_by(rng.uniform(-0.1, 0.1) * (high - low), wait=False)
        elif kind < 0.95:
            axis.steps(rng.randint(-20, 20), wait=False)
        else:
            axis.halt()


def fill_log() -> None:
    """Log as much as the window keeps, so that it grows no further."""
    logger = logging.getLogger("cosmic.mico.core.motion.channel")
    for number in range(LOG_RECORDS):
        target = number + 0.123456789
        logger.info("left.x: MoveTo(target=%s, unit='um') (benchmark)", target)


def look(bench: Stand, moves: int) -> Look:
    """Look at everything; the axes stand, so that what is running does not count."""
    with suppress(TimeoutError):
        wait_until(lambda: not any(axis.details.in_motion for axis in bench.mico), timeout_s=25.0)
    time.sleep(0.3)
    gc.collect()
    packets = []  # now and then the answers to the polls at rest are under way
    for _ in range(20):
        packets.append(sum(len(device.queue) for device in bench.library._wired))
        time.sleep(0.005)
    return Look(
        traced_kb=tracemalloc.get_traced_memory()[0] / 1024,
        resident_kb=resident_kb(),
        threads=thread_count(),
        messages=sum(device._inbox.waiting for device in bench.manager.devices.values()),
        packets=min(packets),
        held=len(bench.manager.gate.held()),
        moves=moves,
    )


def collect(
    bench: Stand, seconds: float, publish: Callable[[Look], None], *, parts: int
) -> list[Look]:
    """Move at random and look `parts` times."""
    rng = random.Random(1)
    axes = list(bench.mico)
    for axis in axes:
        axis.details  # noqa: B018 - a script's handles are made before the first look
    fill_log()
    time.sleep(min(1.0, seconds))
    tracemalloc.start()
    looks: list[Look] = []
    moves = 0
    began_s = time.perf_counter()
    for part in range(1, parts + 1):
        while time.perf_counter() - began_s < part * seconds / parts:
            command(rng.choice(axes), rng)
            moves += 1
            time.sleep(rng.uniform(0.01, 0.09))
        looks.append(look(bench, moves))
        publish(looks[-1])
    tracemalloc.stop()
    return looks


def figures(looks: list[Look]) -> list[Figure]:
    """Return what grew from the end of the warm-up to the end."""
    warm, last = looks[max(len(looks) // 2 - 1, 0)], looks[-1]
    return [
        Figure(NAME, "moves commanded", last.moves, ""),
        Figure(NAME, "Python memory, warm", warm.traced_kb, "kB"),
        Figure(NAME, "Python memory, growth", last.traced_kb - warm.traced_kb, "kB"),
        Figure(NAME, "resident set, warm", warm.resident_kb / 1024, "MB"),
        Figure(NAME, "resident set, growth", (last.resident_kb - warm.resident_kb) / 1024, "MB"),
        Figure(NAME, "threads, growth", last.threads - warm.threads, "", 0),
        Figure(NAME, "messages waiting at the end", last.messages, "", 0),
        Figure(NAME, "packets waiting at the end", last.packets, "", 0),
        Figure(NAME, "intervals held at the end", last.held, "", 0),
    ]


def run(seconds: float, publish: Callable[[Look], None], *, parts: int = 12) -> list[Figure]:
    """Return the figures of one soak."""
    with stand(repaint=False, traced=False) as bench:
        return figures(bench.beside(lambda: collect(bench, seconds, publish, parts=parts)))


def measure(quick: bool = False) -> list[Figure]:
    """Return the figures of a short soak."""
    return run(0.1 if quick else 60.0, lambda _look: None, parts=1 if quick else 12)


def _from_command_line() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=1.0)
    minutes = parser.parse_args().minutes
    print(" ".join(field.name for field in fields(Look)))

    def publish(seen: Look) -> None:
        values = (getattr(seen, field.name) for field in fields(Look))
        print(" ".join(f"{value:.0f}" for value in values), flush=True)

    print(table(run(60.0 * minutes, publish)))


if __name__ == "__main__":
    _from_command_line()
