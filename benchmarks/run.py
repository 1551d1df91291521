"""Run all benchmarks and print one table in Markdown.

`python -m benchmarks.run --repeat 3` starts each benchmark three times, in turn, each time in a
process of its own, and prints the medians with the range. The long ones, such as `soak` and
`campaign`, are run where they are named. `--quick` sees that all of them work; its figures say
nothing.
"""

import argparse
import ast
import importlib
import platform
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

import PySide6

from benchmarks.figures import Figure, from_json, medians, table, to_json

LONG = frozenset(
    {
        "acquisition_soak",
        "adversary",
        "campaign",
        "campaign_day",
        "campaign_faults",
        "campaign_kills",
        "campaign_worlds",
        "certainty",
        "collision_oracles",
        "full_soak",
        "soak",
        "worlds",
    }
)
"""Commands of their own: each takes from ten minutes to hours."""


def discovered() -> tuple[str, ...]:
    """Return every benchmark in the folder: the modules with a NAME and a function `measure`.

    They are read, not imported, so that one that is broken is found as well.
    """
    found = []
    for file in sorted(Path(__file__).parent.glob("*.py")):
        names = set()
        for part in ast.parse(file.read_text(encoding="utf-8")).body:
            if isinstance(part, ast.FunctionDef):
                names.add(part.name)
            elif isinstance(part, ast.Assign):
                names |= {each.id for each in part.targets if isinstance(each, ast.Name)}
        if {"NAME", "measure"} <= names:
            found.append(file.stem)
    return tuple(found)


ALL = discovered()
NAMES = tuple(name for name in ALL if name not in LONG)
ROOT = Path(__file__).resolve().parents[1]


def figures_here(names: Sequence[str], *, quick: bool) -> list[Figure]:
    """Return the figures of one run of each in this process."""
    found: list[Figure] = []
    for name in names:
        found += importlib.import_module(f"benchmarks.{name}").measure(quick=quick)
    return found


def one_run(name: str) -> list[Figure]:
    """Run one benchmark in a process of its own."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "figures.json"
        command = [sys.executable, "-m", "benchmarks.run", "--only", name, "--json", str(file)]
        subprocess.run(command, cwd=ROOT, check=True, timeout=None if name in LONG else 600)
        return from_json(file.read_text(encoding="utf-8"))


def main() -> None:
    """Read the command line and run."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeat", type=int, default=3, help="runs of each benchmark")
    parser.add_argument("--only", nargs="+", choices=ALL)
    parser.add_argument("--quick", action="store_true", help="see that everything works")
    parser.add_argument("--output", type=Path, metavar="FILE", help="write the table there")
    parser.add_argument("--json", type=Path, metavar="FILE", help="one run, in this process")
    chosen = parser.parse_args()
    if chosen.json is not None:
        found = figures_here(chosen.only or NAMES, quick=chosen.quick)
        chosen.json.write_text(to_json(found), encoding="utf-8")
        return
    if chosen.quick:
        text = table(figures_here(chosen.only or ALL, quick=True))
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
