"""Run all benchmarks and print one table in Markdown.

`python -m benchmarks.run --repeat 3` starts each benchmark three times, in turn, each time in a
process of its own, and prints the medians with the range. The long ones, such as `soak` and
`campaign`, are commands of their own.
"""

import argparse
import importlib
import platform
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

import PySide6

from benchmarks.figures import Figure, from_json, medians, table

NAMES = (
    "commander",
    "stop",
    "completion",
    "load",
    "start",
    "simulator",
    "collision_gate",
    "gate_process",
    "planning",
    "scene_view",
    "twin_force",
    "recorder",
    "plot",
    "acquisition",
    "twin_picture",
    "live_view",
    "picture_recorder",
    "aravis_camera",
    "fibres",
    "vision_tools",
    "skew",
    "trajectory",
    "teleoperation",
    "control_loop",
    "network",
    "procedure_engine",
    "bending",
)
ALL = (
    *NAMES,
    "collision_oracles",
    "soak",
    "acquisition_soak",
    "campaign",
    "campaign_faults",
    "campaign_kills",
)
ROOT = Path(__file__).resolve().parents[1]


def quick_figures(names: Sequence[str]) -> list[Figure]:
    """Return figures of a few samples each, all in this process; they say nothing."""
    found: list[Figure] = []
    for name in names:
        found += importlib.import_module(f"benchmarks.{name}").measure(quick=True)
    return found


def one_run(name: str) -> list[Figure]:
    """Run one benchmark in a process of its own."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "figures.json"
        command = [sys.executable, "-m", f"benchmarks.{name}", "--json", str(file)]
        subprocess.run(command, cwd=ROOT, check=True, timeout=600)
        return from_json(file.read_text(encoding="utf-8"))


def main() -> None:
    """Read the command line and run."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeat", type=int, default=3, help="runs of each benchmark")
    parser.add_argument("--only", nargs="+", choices=ALL)
    parser.add_argument("--quick", action="store_true", help="see that everything works")
    parser.add_argument("--output", type=Path, metavar="FILE", help="write the table there")
    chosen = parser.parse_args()
    if chosen.quick:
        text = table(quick_figures(chosen.only or ALL))
    else:
        runs: list[list[Figure]] = []
        for _ in range(chosen.repeat):
            for name in chosen.only or NAMES:
                print(f"{name} ...", file=sys.stderr, flush=True)
                runs.append(one_run(name))
        order = {name: place for place, name in enumerate(ALL)}
        found = sorted(medians(runs), key=lambda figure: order[figure.benchmark])
        text = table(found)
    versions = f"Python {platform.python_version()}, PySide6 {PySide6.__version__}"
    text = f"{versions}\n\n{text}\n"
    if chosen.output is not None:
        chosen.output.write_text(text, encoding="utf-8")
    else:
        print(text)


if __name__ == "__main__":
    main()
