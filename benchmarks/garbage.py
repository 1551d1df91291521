"""How long garbage collection stops the interpreter, with window and campaign, for a minute.

The pauses are those that Python tells (`gc.callbacks`), beside what one look through all objects
takes at the end, which is what Python's own rules come to. Processor time, for the machine is
shared; a thread that wants to run every millisecond tells how late it was at most, for
whatever reason.
"""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

from benchmarks.figures import Figure, main

NAME = "garbage"
ROOT = Path(__file__).resolve().parents[1]
OLD = "2"


def run(seconds: float) -> dict[str, Any]:
    """Return what a run of so long found."""
    done = subprocess.run(
        [sys.executable, "-m", "benchmarks.garbage_child", str(seconds)],
        capture_output=True,
        text=True,
        timeout=seconds + 120,
        check=True,
        cwd=ROOT,
        env=os.environ | {"QT_QPA_PLATFORM": "offscreen"},
    )
    found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return found


def measure(quick: bool = False) -> list[Figure]:
    """Return the figures of one run."""
    found = run(2.0 if quick else 60.0)
    longest_ms, full_ms = found["longest_cpu_ms"], found["full_ms"]
    return [
        Figure(NAME, "longest pause, CPU", longest_ms, "ms", 20.0),
        Figure(NAME, "longest pause, wall", max(found["longest_ms"].values()), "ms"),
        Figure(NAME, "one look through all objects, CPU", full_ms, "ms"),
        Figure(NAME, "longest pause to that, CPU", longest_ms / full_ms, "x", 0.25),
        Figure(NAME, "looks through old objects", found["counts"][OLD], ""),
        Figure(NAME, "all pauses, of the CPU time", 0.1 * found["total_ms"] / found["cpu_s"], "%"),
        Figure(NAME, "a thread that ticks, late by at most", found["late_ms"], "ms"),
        Figure(NAME, "objects at the end", found["objects"], ""),
    ]


if __name__ == "__main__":
    main(__doc__, measure)
