"""One campaign that is killed again and again, and what is found in its folder afterwards."""

import hashlib
import math
import os
import random
import sqlite3
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final

from benchmarks.kept_plate import KeptPlate
from cosmic.autonomy.campaign.storage_format import DATABASE, FIBRES
from cosmic.autonomy.campaign.store_read import CampaignReader
from cosmic.frame.errors import CosmicError
from cosmic.twin.truth import read_truth

RATE: Final = 20.0
LONGEST_S: Final = 25.0
EARLY_S: Final = 15.0
EARLY: Final = 0.15
"""The part of the kills at any moment that come while the program starts."""
LIMIT_S: Final = 600.0
ORPHAN_S: Final = 10.0
POLL_S: Final = 0.001
INITIALISE: Final = "initialise again"
SHORTEST_S: Final = 1.0
"""Whoever is through with it sooner has not initialised anything."""
MOST_LIVES: Final = 30
DONE: Final = "no fibre"
RECIPE = """
procedure = "bend test"
[stop]
count = 40
[parameters.calibration]
rotation_centre = false
"""


@dataclass(slots=True)
class Tally:
    """What was found over all lives of the program."""

    kills: Counter[str] = field(default_factory=Counter)
    lives: int = 0
    finished: int = 0
    lost: int = 0
    changed: int = 0
    doubled: int = 0
    unreadable: int = 0
    unannounced: int = 0
    spoilt: int = 0
    orphans: int = 0
    trusted: int = 0
    contacts: int = 0
    refused: int = 0
    ended: Counter[str] = field(default_factory=Counter)
    start_up_s: list[float] = field(default_factory=list)
    moving_s: list[float] = field(default_factory=list)
    working_s: list[float] = field(default_factory=list)


class Victim:
    """One campaign that is killed and started again until its plate is empty."""

    def __init__(self, home: Path, seed: int, tally: Tally) -> None:
        self._home, self._tally = home, tally
        self._seed = seed
        self._plate = KeptPlate("three-dry", seed)
        self._out = home / "out"
        self._recipe = home / "kills.toml"
        self._recipe.write_text(RECIPE, encoding="utf-8")
        self._before: dict[int, str] = {}
        self._measured: dict[int, int] = {}
        self._life = self._runs = self._seen = 0
        self._cold = False
        self.over = False

    def live(self, kind: str, chance: random.Random) -> bool:
        """Start the program and kill it; returns False when it ended by itself first."""
        self._life += 1
        self._tally.lives += 1
        self._cold = cold = self._life % 4 == 0 and self._cut_off()
        config = self._plate.write(self._home / "config", cold=cold)
        truth = self._home / f"truth-{self._life}.jsonl"
        command = [sys.executable, "-m", "cosmic", "campaign", str(self._recipe)]
        command += ["--out", str(self._out), "--config", str(config), "--truth", str(truth)]
        command += ["--rate", str(RATE), "--seed", str(self._seed)]
        with (self._home / f"output-{self._life}.txt").open("w+", encoding="utf-8") as output:
            program = subprocess.Popen(
                command + (["--cold"] if cold else []), stdout=output, stderr=output
            )
            began = time.perf_counter()
            killed = self._strike(program, began, kind, chance)
            children = _children(program.pid) if killed else []
            program.kill()
            program.wait()
            output.seek(0)
            self._look(output.read())
        self._tally.orphans += _left(children)
        self._true(truth)
        if killed:
            self._tally.kills[kind] += 1
        else:
            reason = _end(self._out)
            self._tally.refused += not reason
            self.over = reason.startswith(DONE) or self._life >= MOST_LIVES
            self._tally.ended[reason] += 1
            if self.over:
                query = "SELECT count(*) FROM fibre WHERE outcome = 'interrupted'"
                self._tally.spoilt += _rows(self._out, query)[0][0]
        return killed

    def _strike(
        self, program: subprocess.Popen[bytes], began: float, kind: str, chance: random.Random
    ) -> bool:
        """Wait for the moment to kill; False when the program was over before."""
        early = chance.random() < EARLY
        at_s = chance.uniform(0.0, EARLY_S if early else LONGEST_S)
        later_s = chance.uniform(0.0, 0.3 if kind == "report" else 0.01)
        come = self._sign(kind)
        opened_s = 0.0 if early else math.inf
        while program.poll() is None and time.perf_counter() - began < LIMIT_S:
            passed_s = time.perf_counter() - began
            if opened_s == math.inf and passed_s % 0.1 < 2.0 * POLL_S and self._opened():
                opened_s = passed_s
                self._tally.start_up_s.append(passed_s)
            if come() if come is not None else passed_s - opened_s > at_s:
                time.sleep(later_s)
                return program.poll() is None
            time.sleep(POLL_S)
        return program.poll() is None

    def _sign(self, kind: str) -> Callable[[], bool] | None:
        """Return what tells that the moment of a kind has come; None: it comes with time."""
        fibres = self._out / FIBRES
        if kind == "file":
            return lambda: any(each.endswith(".part") for each in _names(fibres))
        if kind == "commit":
            before = set(_names(fibres))
            return lambda: any(each.endswith(".h5") for each in set(_names(fibres)) - before)
        if kind == "report":
            names = {"report.html.part", "report.pdf.part", "fibres.csv.part"}
            return lambda: bool(names & set(_names(self._out)))
        return None

    def _cut_off(self) -> bool:
        """Return whether the next start must not believe a position."""
        rows = _rows(self._out, "SELECT end_s FROM run ORDER BY number DESC LIMIT 1")
        return bool(rows) and rows[0][0] is None

    def _opened(self) -> bool:
        return len(_rows(self._out, "SELECT number FROM run")) > self._runs

    # ------------------------------------------------------------------ what is found

    def _look(self, output: str) -> None:
        """Compare the folder with what was in it before, and with what the program told."""
        if not (self._out / DATABASE).exists():
            self._tally.lost += len(self._before)
            return
        tally = self._tally
        try:
            found = _digests(self._out)
        except (CosmicError, sqlite3.Error, OSError) as exc:
            sys.stderr.write(f"life {self._life}: {exc}\n")
            tally.unreadable += 1
            return
        lost = [number for number in self._before if number not in found]
        changed = [n for n, digest in self._before.items() if found.get(n, digest) != digest]
        tally.lost += len(lost)
        tally.changed += len(changed)
        tally.unannounced += max(0, _announced(output) - len(found))
        tally.finished += len(set(found) - set(self._before))
        self._before = found
        self._times()

    def _times(self) -> None:
        """Take how long it took to move, and to work on a fibre, and whether it initialised."""
        runs = _rows(self._out, "SELECT number, begin_s, end_s FROM run ORDER BY number")
        lines = _rows(
            self._out, "SELECT number, fibre, time_s, operation FROM journal ORDER BY number"
        )
        opened, self._runs = len(runs) > self._runs, len(runs)
        new = [each for each in lines if each[0] > self._seen]
        self._seen = max((each[0] for each in lines), default=0)
        if not new or not opened or len(runs) < 2:
            return
        begin_s = runs[-1][1]
        after_s = new[1][2] if len(new) > 1 else math.inf
        believed = new[0][3] != INITIALISE or after_s - new[0][2] < SHORTEST_S
        self._tally.trusted += believed and runs[-2][2] is None
        if self._cold:
            return
        self._tally.moving_s.append(new[0][2] - begin_s)
        working = next((each[2] for each in new if each[1] is not None), None)
        if working is not None:
            self._tally.working_s.append(working - begin_s)

    def _true(self, truth: Path) -> None:
        """Take what became of the fibres, and whether one was measured twice."""
        if not truth.exists() or not truth.read_text(encoding="utf-8").strip():
            return
        grasps = self._plate.live(truth)
        events = read_truth(truth).of("contact over")
        self._tally.contacts += sum(not each.facts["meant"] for each in events)
        rows = _rows(
            self._out,
            "SELECT number, began_s, ended_s FROM fibre WHERE run = (SELECT max(number) FROM run) "
            "AND ended_s IS NOT NULL AND ei_n_m2 IS NOT NULL",
        )
        for number, began_s, ended_s in rows:
            held = [each.fibre for each in grasps if began_s <= each.time_s <= ended_s]
            if number in self._measured or not held:
                continue
            self._tally.doubled += held[-1] in self._measured.values()
            self._measured[number] = held[-1]


def _digests(folder: Path) -> dict[int, str]:
    """Return a digest of each finished fibre, its row and its files; reads all of them."""
    reader = CampaignReader(folder)
    reader.check()
    with closing(sqlite3.connect(folder / DATABASE)) as line:
        ((answer,),) = line.execute("PRAGMA integrity_check").fetchall()
    if answer != "ok":
        raise CosmicError(f"{folder}: {answer}")
    found = {}
    for record in reader.finished():
        whole = reader.fibre(record.number)
        # What the curves say is worked out anew when the campaign ends, from all of them.
        content = hashlib.sha256(repr(replace(record, bending=None)).encode())
        for file in sorted((folder / FIBRES).glob(f"{whole.number:05d}*")):
            content.update(file.read_bytes())
        found[record.number] = content.hexdigest()
    return found


def _rows(folder: Path, query: str) -> list[tuple[Any, ...]]:
    """Return what is in the tables; nothing where there are none."""
    file = folder / DATABASE
    if not file.exists():
        return []
    try:
        with closing(sqlite3.connect(f"file:{file}?mode=ro", uri=True, timeout=5.0)) as line:
            return line.execute(query).fetchall()
    except sqlite3.Error:
        return []


def _announced(text: str) -> int:
    """Return how many fibres the program said were done."""
    counts = [
        int(part.split(" ")[0])
        for line in text.splitlines()
        for part in [line.partition("] ")[2]]
        if " fibres, " in part
    ]
    return max(counts, default=0)


def _end(folder: Path) -> str:
    try:
        return CampaignReader(folder).ended()[1]
    except CosmicError as exc:
        return str(exc)


def _names(folder: Path) -> list[str]:
    try:
        return [each.name for each in os.scandir(folder)]
    except OSError:
        return []


def _children(number: int) -> list[int]:
    try:
        text = Path(f"/proc/{number}/task/{number}/children").read_text(encoding="ascii")
    except OSError:
        return []
    return [int(each) for each in text.split()]


def _left(children: list[int]) -> int:
    """Return how many processes that the program had started outlive it."""
    until = time.perf_counter() + ORPHAN_S
    while time.perf_counter() < until:
        if not any(Path(f"/proc/{each}").exists() for each in children):
            return 0
        time.sleep(0.05)
    return sum(Path(f"/proc/{each}").exists() for each in children)
