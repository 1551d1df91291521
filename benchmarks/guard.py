"""Compare the main ratios with those of the last good state; fail by name where one got worse.

    python -m benchmarks.guard                # ratios of CPU time, below a minute; part of ./test
    python -m benchmarks.guard --full         # p99 and worst values too, about half an hour
    python -m benchmarks.guard --keep         # what is measured now is the last good state
    python -m benchmarks.guard --only gate    # one probe: see benchmarks/guarded.py

A ratio may be up to 1.5 times the kept one. What is beyond is measured once more, and fails only
if it is beyond again. What is measured but not kept, or kept but not measured any longer, fails
as well. The kept state is in benchmarks/last_good.toml, with its date, commit and machine.

Run it alone: beside other programs, CPU times are up to half as long again.
"""

import argparse
import json
import os
import platform
import statistics
import subprocess
import sys
import time
import tomllib
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from benchmarks.figures import Figure
from benchmarks.guarded import PROBES, Ratios, reference_s
from benchmarks.run import one_run

ROOT: Final = Path(__file__).resolve().parents[1]
KEPT: Final = Path(__file__).with_name("last_good.toml")
TIMES: Final = 1.5
TIMES_ELSEWHERE: Final = 2.5
"""Against a state of another machine or Python, whose ratios differ by a half of themselves."""
KEPT_RUNS: Final = 3
FULL: Final = (
    "commander",
    "stop",
    "completion",
    "skew",
    "load",
    "start",
    "acquisition",
    "network",
    "gate_process",
    "procedure_engine",
    "fibres",
    "recorder",
    "control_loop",
)
"""Benchmarks with a reaction or a load that was promised."""
TAILS: Final = ("p99", "worst", "max")
TAIL_FROM: Final = {"ms": 1.0, "us": 100.0, "s": 0.01}
"""Below this a tail is that of the machine, not of the program."""


@dataclass(frozen=True, slots=True)
class State:
    """What was measured once.

    Attributes
    ----------
    reference_us : float
        CPU time of the reference then: how fast the machine was.
    ratios : dict
        By probe and name, of the short form.
    full : dict
        Tails by benchmark, figure and unit.
    """

    date: str
    commit: str
    machine: str
    reference_us: float
    ratios: Ratios
    full: Ratios


def machine() -> str:
    """Return the class of this machine."""
    return (
        f"{platform.machine()}, {os.cpu_count()} cores, {platform.system()}, "
        f"Python {platform.python_version()}"
    )


def read(path: Path = KEPT) -> State | None:
    """Return the kept state; None where there is none."""
    if not path.exists():
        return None
    found = tomllib.loads(path.read_text(encoding="utf-8"))
    return State(**found["state"], ratios=found.get("ratios", {}), full=found.get("full", {}))


def write(state: State, path: Path = KEPT) -> None:
    """Keep a state."""
    lines = [
        "# What `python -m benchmarks.guard --keep` measured; it is not edited by hand.",
        "[state]",
        *(f"{key} = {json.dumps(getattr(state, key))}" for key in ("date", "commit", "machine")),
        f"reference_us = {state.reference_us:.1f}",
    ]
    for title, values in (("ratios", state.ratios), ("full", state.full)):
        lines += ["", f"[{title}]"]
        lines += [f"{json.dumps(name)} = {float(f'{values[name]:.4g}')}" for name in sorted(values)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def beyond(
    kept: Mapping[str, float], now: Mapping[str, float], times: float = TIMES
) -> dict[str, str]:
    """Return what is worse than it may be, by name, each with why."""
    found = {}
    for name, value in now.items():
        if name not in kept:
            found[name] = f"{value:.3g} now; not kept: run with --keep where this is good"
        elif not value <= times * kept[name]:
            found[name] = (
                f"{value:.3g} now, {kept[name]:.3g} kept: {value / kept[name]:.2f} times as much"
            )
    for name in kept.keys() - now.keys():
        found[name] = f"{kept[name]:.3g} kept; no longer measured"
    return found


def probed(names: Sequence[str]) -> Ratios:
    """Run probes, each in a process of its own."""
    found: Ratios = {}
    for name in names:
        command = [sys.executable, "-m", "benchmarks.guarded", name]
        done = subprocess.run(
            command, cwd=ROOT, capture_output=True, text=True, timeout=120, check=False
        )
        if done.returncode:
            sys.stderr.write(done.stderr)
            continue  # its ratios are missing, which fails by their names
        found_ratios: Ratios = json.loads(done.stdout.splitlines()[-1])
        found |= {f"{name}: {key}": value for key, value in found_ratios.items()}
    return found


def tails(figures: Sequence[Figure]) -> Ratios:
    """Return the worst values among figures."""
    return {
        f"{each.benchmark}: {each.name}, {each.unit}": max(each.value, TAIL_FROM[each.unit])
        for each in figures
        if each.unit in TAIL_FROM and any(tail in each.name for tail in TAILS)
    }


def full(names: Sequence[str] = FULL) -> Ratios:
    """Run benchmarks in their long form and return their tails."""
    found: Ratios = {}
    for name in names:
        sys.stderr.write(f"{name} ...\n")
        with suppress(subprocess.CalledProcessError):  # its tails are missing, and fail by name
            found |= tails(one_run(name))
    return found


def worse_than(
    kept: Ratios,
    names: Sequence[str],
    measure: Callable[[Sequence[str]], Ratios],
    times: float = TIMES,
) -> dict[str, str]:
    """Measure and compare; what is beyond, once more.

    Parameters
    ----------
    names : sequence of str
        Probes or benchmarks; `measure` returns the ratios of those it is given.
    """
    parts = {name: measure([name]) for name in names}
    now = {name: value for part in parts.values() for name, value in part.items()}
    bad = beyond(kept, now, times)
    again = [name for name, part in parts.items() if not part or any(each in bad for each in part)]
    if again:
        print(f"beyond, measured once more: {', '.join(sorted(bad))}")
        second = {key: value for name in again for key, value in measure([name]).items()}
        now |= {key: min(value, now.get(key, value)) for key, value in second.items()}
        bad = beyond(kept, now, times)
    for name in sorted(now):
        mark = "WORSE" if name in bad else "ok"
        ratio = f"{now[name] / kept[name]:.2f} of kept" if name in kept else ""
        print(f"{mark:5}  {name}: {now[name]:.3g}  {ratio}")
    return bad


def keep(*, long: bool, path: Path = KEPT) -> None:
    """Measure and keep: medians of three runs of the short form, one of the long form."""
    before = read(path)
    runs = [probed(list(PROBES)) for _ in range(KEPT_RUNS)]
    names = set(runs[0]).union(*runs)
    if any(set(run) != names for run in runs):
        raise SystemExit("a probe did not run: nothing is kept")
    ask = ["git", "describe", "--always", "--dirty"]
    commit = subprocess.run(ask, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    write(
        State(
            date=time.strftime("%Y-%m-%d"),
            commit=commit.strip(),
            machine=machine(),
            reference_us=1e6 * statistics.median(reference_s() for _ in range(15)),
            ratios={name: statistics.median(run[name] for run in runs) for name in names},
            full=full() if long else before.full if before is not None else {},
        ),
        path,
    )


def allowed(state: State) -> float:
    """Return how many times as much as in `state` a ratio may be here."""
    return TIMES if state.machine == machine() else TIMES_ELSEWHERE


def compare(state: State, names: Sequence[str], *, long: bool) -> dict[str, str]:
    """Compare the short form, and the long one where that is wanted; return what is worse."""
    if state.machine != machine():
        print(f"the last good state was measured elsewhere: {state.machine}")
    kept = {key: value for key, value in state.ratios.items() if key.split(": ")[0] in names}
    bad = worse_than(kept, names, probed, allowed(state))
    if long:
        speed = 1e6 * statistics.median(reference_s() for _ in range(15)) / state.reference_us
        print(f"the reference takes {speed:.2f} times as long as then; tails are judged by that")
        bad |= worse_than({name: speed * each for name, each in state.full.items()}, FULL, full)
    return bad


def main(arguments: Sequence[str] | None = None) -> int:
    """Read the command line, compare or keep; returns 1 where something is worse."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--full", action="store_true", help="p99 and worst values too")
    parser.add_argument("--keep", action="store_true", help="keep what is measured now")
    parser.add_argument("--only", nargs="+", choices=PROBES, default=list(PROBES))
    chosen = parser.parse_args(arguments)
    if chosen.keep:
        keep(long=chosen.full)
        return 0
    state = read()
    if state is None:
        print(f"there is no {KEPT.name}: run with --keep where all is good", file=sys.stderr)
        return 1
    began_s = time.monotonic()
    bad = compare(state, chosen.only, long=chosen.full)
    for name, why in sorted(bad.items()):
        last = f"last good {state.date}, {state.commit}"
        print(f"guard: {name}: {why} (at most {allowed(state):g}; {last})")
    print(f"guard: {len(bad)} worse, {time.monotonic() - began_s:.0f} s")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
