"""How long garbage collection stops the interpreter, with window and campaign, for a minute.

Two runs in processes of their own: by Python's own rules, and as CoSMic has it. The pauses are
those that Python tells (`gc.callbacks`); beside them how late a thread was at most that wants to
run every millisecond, which holds all else that keeps the interpreter.
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


def run(policy: str, seconds: float) -> dict[str, Any]:
    """Return what a run of so long found, with the policy "on" or "off"."""
    done = subprocess.run(
        [sys.executable, "-m", "benchmarks.garbage_child", policy, str(seconds)],
        capture_output=True,
        text=True,
        timeout=seconds + 120,
        check=True,
        cwd=ROOT,
        env=os.environ | {"QT_QPA_PLATFORM": "offscreen"},
    )
    found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return found


def figures_of(found: dict[str, Any], title: str, limit_ms: float | None) -> list[Figure]:
    """Return the figures of one run."""
    longest = max(found["longest_ms"].values())
    return [
        Figure(NAME, f"{title}: longest pause", longest, "ms", limit_ms),
        Figure(NAME, f"{title}: of these of old objects", found["longest_ms"][OLD], "ms"),
        Figure(NAME, f"{title}: looks through old objects", found["counts"][OLD], ""),
        Figure(
            NAME,
            f"{title}: all pauses of the CPU time",
            0.1 * found["total_ms"] / found["cpu_s"],
            "%",
        ),
        Figure(NAME, f"{title}: a thread that ticks, late by at most", found["late_ms"], "ms"),
        Figure(NAME, f"{title}: objects at the end", found["objects"], ""),
    ]


def measure(quick: bool = False) -> list[Figure]:
    """Return the figures of one run."""
    if quick:
        return figures_of(run("on", 2.0), "as CoSMic has it", 20.0)
    by_python, ours = run("off", 60.0), run("on", 60.0)
    return [
        *figures_of(by_python, "by Python's rules", None),
        *figures_of(ours, "as CoSMic has it", 20.0),
        Figure(
            NAME,
            "longest pause, to that by Python's rules",
            max(ours["longest_ms"].values()) / max(by_python["longest_ms"].values()),
            "x",
            0.2,
        ),
    ]


if __name__ == "__main__":
    main(__doc__, measure)
