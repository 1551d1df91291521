"""From the start of the process to a window that can be used, with its bytecode warm.

A child process opens the operator's window as `python -m cosmic` does, offscreen, and tells when
the first card was painted after every axis had its position, and when after that a move was
accepted, seen to move, and stopped by F12. What `./run` does before it starts
Python (looking whether anything is to be installed) is measured by itself, without installing.
"""

import json
import os
import subprocess
import sys
import time
from pathlib import Path

from benchmarks.figures import Figure, main

NAME = "start"
ROOT = Path(__file__).resolve().parents[1]
PRELUDE = 'root=$1; . "$root/tools/setup.sh"; find_missing run; find_venv_version; installation_key'


def child_figures(run: list[str]) -> dict[str, float]:
    """Start the child and return the seconds it reports, counted from its start."""
    began_s = time.monotonic()
    done = subprocess.run(
        [*run, "-m", "benchmarks.start_child", repr(began_s)],
        capture_output=True,
        text=True,
        timeout=120,
        check=True,
        cwd=ROOT,
        env=os.environ | {"QT_QPA_PLATFORM": "offscreen"},
    )
    found: dict[str, float] = json.loads(done.stdout.splitlines()[-1])
    return found


def prelude_s() -> float:
    """Return how long `./run` takes before it starts Python, in s."""
    began_s = time.perf_counter()
    command = ["sh", "-c", PRELUDE, "sh", str(ROOT)]
    subprocess.run(command, capture_output=True, timeout=120, check=False)
    return time.perf_counter() - began_s


def bare_cpu_s() -> float:
    """Return the CPU time of a Python that imports Qt's widgets and numpy, in s: the yardstick."""
    program = "import time, numpy, PySide6.QtWidgets; print(time.process_time())"
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=120, check=True
    )
    return float(done.stdout)


def heaviest_imports(count: int) -> list[tuple[str, float]]:
    """Return the packages whose import takes longest, with everything they import, in ms."""
    done = subprocess.run(
        [sys.executable, "-X", "importtime", "-c", "import cosmic.app.windows.run_window"],
        capture_output=True,
        text=True,
        timeout=120,
        check=True,
        cwd=ROOT,
    )
    own: dict[str, float] = {}
    for line in done.stderr.splitlines():
        if not line.startswith("import time:") or "self [us]" in line:
            continue
        itself_us, _, module = line.removeprefix("import time:").split("|")
        package = module.strip().split(".")[0]
        own[package] = own.get(package, 0.0) + float(itself_us) / 1e3
    return sorted(own.items(), key=lambda item: -item[1])[:count]


def measure(quick: bool = False) -> list[Figure]:
    """Return the figures of one run."""
    before_s = 0.0 if quick else prelude_s()
    if not quick:
        child_figures([sys.executable])  # so that bytecode and files are warm
    child = child_figures([sys.executable])
    figures = [
        Figure(NAME, "./run to a usable window", before_s + child["usable"], "s", 2.5),
        Figure(NAME, "of these: ./run before Python", before_s, "s"),
        Figure(NAME, "of these: start of Python", child["python"], "s"),
        Figure(NAME, "of these: imports", child["imported"] - child["python"], "s"),
        Figure(NAME, "of these: to the window shown", child["shown"] - child["imported"], "s"),
        Figure(NAME, "of these: to the axes painted", child["painted"] - child["shown"], "s"),
        Figure(
            NAME,
            "of these: a move accepted and STOP in force",
            child["usable"] - child["painted"],
            "s",
        ),
        Figure(NAME, "CPU time of the process until then", child["cpu"], "s"),
        Figure(NAME, "CPU time to that of a bare start", child["cpu"] / bare_cpu_s(), "x"),
    ]
    if not quick:
        figures += [
            Figure(NAME, f"importing {name} (with -X importtime)", took_ms / 1e3, "s")
            for name, took_ms in heaviest_imports(4)
        ]
    return figures


if __name__ == "__main__":
    main(__doc__, measure)
