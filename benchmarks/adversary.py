"""Hostile commands through all ways in at once, judged by an oracle that shares no code.

`python -m benchmarks.adversary --commands 1000000` takes three quarters of an hour. Threads of this
process command axes, groups, jogs, trajectories, detours, forged orders, force limits, control
loops, cameras, lens and lamp, and stop everything again and again; a client in a process of its own
does the same to MiCo and ViCo through a station. DAQCo records, ViCo is live. The oracle
(tests/oracles/clearance.py, which reads URDF, SRDF and scene by itself) follows the true stages and
says whether any watched pair came nearer than its margin by more than a sensor's step, whether
anything moved after a stop, and whether an axis left its soft limits. A run that is not harmless
ends with exit code 1 and what was seen.

With `--halt-s 20` all its processes are halted for so long again and again, as on a computer that
is suspended, while the platform's time runs on: what was sent goes on, and nobody stops it.
"""

import argparse
import math
import os
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final
from unittest.mock import patch

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")


from benchmarks.adversary_attacks import (
    Attack,
    AxisAttack,
    ForceAttack,
    OrderAttack,
    StopAttack,
    StopSwitch,
    TrajectoryAttack,
)
from benchmarks.adversary_images import ImageAttack
from benchmarks.adversary_watch import Findings, Watch
from benchmarks.figures import Figure, table
from cosmic.app.configuration.network import serving
from cosmic.app.platform import Platform, build_platform
from cosmic.app.rig import Rig
from cosmic.app.simulation import make_scene
from cosmic.app.stations.host import StationHost
from cosmic.frame.clock import RatedClock
from cosmic.twin.scene import Scene

NAME = "adversary"
ROOT = Path(__file__).resolve().parents[1]
START_S: Final = 60.0
TELL_S: Final = 60.0
SCENE = ROOT / "config" / "scenes" / "fiberstation.toml"


class Result:
    """What a run found."""

    def __init__(
        self, found: Findings, attacks: Sequence[Attack], remote: dict[str, int], raw: list[str]
    ) -> None:
        self.found = found
        self.by_way = {each.name: each.calls for each in attacks} | remote
        self.commands = sum(self.by_way.values())
        self.refused = sum(each.refused for each in attacks)
        self.raw = [text for each in attacks for text in each.raw] + raw


def _free_port() -> int:
    import socket

    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


HALT: Final = """
import os, signal, sys, time
parent, halt_s = os.getppid(), float(sys.argv[2])
while os.getppid() == parent:
    time.sleep(15.0)
    os.killpg(int(sys.argv[1]), signal.SIGSTOP)
    time.sleep(halt_s)
    os.killpg(int(sys.argv[1]), signal.SIGCONT)
"""


@contextmanager
def halted(halt_s: float) -> Iterator[None]:
    """Halt this process and its children for `halt_s` again and again; never with 0."""
    if sys.platform == "win32" or halt_s <= 0.0:
        yield
        return
    os.setpgid(0, 0)  # whoever started this goes on
    command = [sys.executable, "-c", HALT, str(os.getpgrp()), str(halt_s)]
    halting = subprocess.Popen(command, start_new_session=True)
    try:
        with patch("cosmic.app.platform.RatedClock", lambda rate, **_: RatedClock(rate)):
            yield
    finally:
        halting.kill()
        halting.wait()


@contextmanager
def served(rate: float, seed: int) -> Iterator[tuple[Platform, Rig, str, Scene]]:
    """Run a platform with everything, as a station too; last comes the truth of its twin."""
    scenes: list[Scene] = []

    def keep(*args: Any, **more: Any) -> Scene:
        scenes.append(make_scene(*args, **more))
        return scenes[-1]

    with patch("cosmic.app.platform.make_scene", keep):
        platform = build_platform(rate=rate, seed=seed)
    rig = Rig(platform, "adversary")
    try:
        platform.initialize()
        endpoint = f"tcp/127.0.0.1:{_free_port()}"
        how = serving(
            platform.file.network,
            platform.file.platform.name,
            platform.path.parent,
            listen=endpoint,
        )
        host = StationHost(platform, how)
        try:
            yield platform, rig, endpoint, scenes[0]
        finally:
            host.close()
    finally:
        rig.close()


def attack(
    commands: int, *, rate: float, seed: int, client: bool = True, minutes: float = math.inf
) -> Result:
    """Give so many commands, but not for longer than `minutes`, and return what was seen."""
    end_s = time.monotonic() + 60.0 * minutes
    with (
        tempfile.TemporaryDirectory() as folder,
        served(rate, seed) as (platform, rig, endpoint, scene),
    ):
        limits = {axis.details.name: axis.limits for axis in rig.mico if axis.limits is not None}
        watch = Watch(SCENE, scene.stages, platform.clock, limits)
        for name in ("probe.y", "table.rotation"):
            watch.may_leave_limits(name)
        coast_s = 0.05 * max(rate, 1.0)
        switch = StopSwitch(rig, watch, platform.clock.now_s, coast_s)
        attacks: list[Attack] = [
            AxisAttack(rig, seed, "axes 1", switch),
            AxisAttack(rig, seed, "axes 2", switch),
            OrderAttack(rig, seed),
            ForceAttack(rig, seed, Path(folder)),
            TrajectoryAttack(rig, seed),
            ImageAttack(rig, seed, Path(folder)),
            StopAttack(switch, seed),
        ]
        ended = threading.Event()

        def go(each: Attack) -> None:
            while not ended.wait(each.pause_s):
                if not watch.behind:
                    each.act()

        threads = [threading.Thread(target=go, args=(each,), name=each.name) for each in attacks]
        watch.start()
        remote = _Client(endpoint, seed, folder) if client else None
        for thread in threads:
            thread.start()
        _wait_for(commands, attacks, remote, end_s)
        ended.set()
        for thread in threads:
            thread.join()
        calls, raw = remote.end() if remote is not None else ({}, [])
        if not all(calls.values()):
            raise RuntimeError(f"no command went through the station: {calls}, {raw[:3]}")
        watch.may_move()
        watch.end()
        return Result(watch.found, attacks, calls, raw)


def _wait_for(
    commands: int, attacks: Sequence[Attack], remote: "_Client | None", end_s: float
) -> None:
    """Wait until so many were given, and say each minute how many it are."""
    begun_s = told_s = time.monotonic()
    # A client takes its time to start on a busy computer, and is what a short run is about too.
    while (given := _given(attacks, remote)) < commands or (
        remote is not None and not remote.begun and time.monotonic() < begun_s + START_S
    ):
        now_s = time.monotonic()
        if now_s > end_s:
            return
        if now_s >= told_s + TELL_S:
            told_s = now_s
            print(f"{(now_s - begun_s) / 60.0:.0f} min: {given} commands", file=sys.stderr)
        time.sleep(0.05)


def _given(attacks: Sequence[Attack], remote: "_Client | None") -> int:
    return sum(each.calls for each in attacks) + (remote.total if remote else 0)


class _Client:
    """A hostile program at another computer."""

    def __init__(self, endpoint: str, seed: int, folder: str) -> None:
        command = [sys.executable, "-m", "benchmarks.adversary_client", endpoint, str(seed), folder]
        self._process = subprocess.Popen(
            command, cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        self.calls = {"station": 0, "station, images": 0}
        self._raw: list[str] = []
        self._reader = threading.Thread(target=self._read, name="client's words")
        self._reader.start()

    def _read(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            if line.startswith("calls "):
                self.calls = dict(zip(self.calls, map(int, line.split()[1:]), strict=True))
            else:
                self._raw.append(f"station: {line.strip()}")

    @property
    def begun(self) -> bool:
        """Whether it has given commands of each kind."""
        return all(self.calls.values())

    @property
    def total(self) -> int:
        """How many commands it has given."""
        return sum(self.calls.values())

    def end(self) -> tuple[dict[str, int], list[str]]:
        """End it, and return how much it did and what went wrong."""
        assert self._process.stdin is not None
        self._process.stdin.close()
        try:
            self._process.wait(30.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
        self._reader.join()
        return self.calls, self._raw


def figures(result: Result) -> list[Figure]:
    """Return what a run found as figures."""
    found = result.found
    least = found.least.spare_um if found.least is not None else float("nan")
    return [
        Figure(NAME, "hostile commands", result.commands, ""),
        Figure(NAME, "of these through a station", result.by_way.get("station", 0), ""),
        Figure(NAME, "to ViCo, here and there", _to_vico(result.by_way), ""),
        Figure(NAME, "looks of the oracle", found.looks, ""),
        Figure(NAME, "pairs nearer than their margin", len(found.too_near), "", 0),
        Figure(NAME, "movements after a stop", len(found.late_stops), "", 0),
        Figure(NAME, "axes outside their soft limits", len(found.outside), "", 0),
        Figure(NAME, "movements that the oracle looked at anew", found.late_plans, ""),
        Figure(NAME, "farthest that the oracle was behind", found.behind_s, "s"),
        Figure(NAME, "raw errors", len(result.raw), "", 0),
        Figure(NAME, "least that a pair had to spare", least, "um"),
    ]


def _to_vico(by_way: dict[str, int]) -> int:
    return sum(calls for way, calls in by_way.items() if "images" in way)


def measure(quick: bool = False) -> list[Figure]:
    """Return the figures of one run."""
    return figures(attack(400 if quick else 20_000, rate=1.0, seed=1))


def main() -> int:
    """Read the command line and run."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--commands", type=int, default=20_000)
    parser.add_argument("--minutes", type=float, default=math.inf, help="end after so many")
    parser.add_argument("--rate", type=float, default=1.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--no-station", action="store_true")
    if sys.platform != "win32":
        parser.add_argument("--halt-s", type=float, default=0.0, help="halt all for so long")
    parser.set_defaults(halt_s=0.0)
    options = parser.parse_args()
    began_s = time.perf_counter()
    with halted(options.halt_s):
        result = attack(
            options.commands,
            rate=options.rate,
            seed=options.seed,
            client=not options.no_station,
            minutes=options.minutes,
        )
    print(table(figures(result)))
    print(f"\n{time.perf_counter() - began_s:.0f} s; {result.by_way}; refused {result.refused}")
    for title in ("too_near", "late_stops", "outside"):
        for line in getattr(result.found, title)[:10]:
            print(f"{title}: {line}")
    for line in result.raw[:20]:
        print(f"raw: {line}")
    return 0 if result.found.harmless and not result.raw else 1


if __name__ == "__main__":
    sys.exit(main())
