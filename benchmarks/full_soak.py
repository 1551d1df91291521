"""Everything at once for hours: nothing may grow.

`python -m benchmarks.full_soak --minutes 120`. One platform with its whole window records, a new
file now and then, with its camera live; chance moves all axes, stops and resets, and stands still
for some seconds before each new file. Beside it, in the same process, one platform after the other
is made, carries out a campaign and is closed. The first quarter is warm-up.
"""

import argparse
import gc
import random
import tempfile
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import astuple, dataclass, fields
from pathlib import Path

import cosmic
from benchmarks.figures import Figure, table
from benchmarks.full_platform import FullStand, full_platform
from benchmarks.soak import command, helpers_kb, resident_kb, thread_count
from cosmic.frame.errors import CosmicError
from cosmic.frame.garbage import objects_of

NAME = "full_soak"
PARTS = 40
REST_S = 7.0
"""Garbage of closed platforms is looked for when nothing has moved for five seconds."""
RECIPE, RATE = "quick", 5.0
FILES = Path("/proc/self/fd")


@dataclass(frozen=True, slots=True)
class Look:
    """What might grow, at one moment."""

    minute: float
    resident_mb: float
    helpers_mb: float
    objects: int
    threads: int
    files: int
    log_kb: float
    moves: int
    campaigns: int


class Campaigns(threading.Thread):
    """Carries out one campaign after the other, each on a platform of its own."""

    def __init__(self, folder: Path) -> None:
        super().__init__(name="campaigns")
        self.done = 0
        self.failure = ""
        self._folder = folder
        self._end = threading.Event()

    def run(self) -> None:
        """Go on until the end, or until one fails."""
        while not self._end.is_set() and not self.failure:
            try:
                with cosmic.connect(rate=RATE, sample="three-dry", seed=self.done) as rig:
                    campaign = rig.campaign(RECIPE, self._folder / str(self.done))
                    campaign.start()
                    while not campaign.over and not self._end.wait(0.2):
                        pass
                    campaign.abort()
                    campaign.join()
            except CosmicError as exc:
                self.failure = str(exc)
            else:
                self.done += 1

    def end(self) -> None:
        """End the one that runs, and wait."""
        self._end.set()
        self.join()


def log_kb(folder: Path) -> float:
    """Return how much the log takes on the disk."""
    return sum(file.stat().st_size for file in folder.glob("*.log*")) / 1024


def collect(bench: FullStand, seconds: float, publish: Callable[[Look], None]) -> list[Look]:
    """Move, stop and record at random; look `PARTS` times."""
    chance = random.Random(1)
    axes, folder = list(bench.mico), bench.recording.parent
    looks: list[Look] = []
    moves, began_s = 0, time.perf_counter()
    with tempfile.TemporaryDirectory() as elsewhere:
        campaigns = Campaigns(Path(elsewhere))
        campaigns.start()
        try:
            for part in range(1, PARTS + 1):
                while time.perf_counter() - began_s < part * seconds / PARTS:
                    command(chance.choice(axes), chance)
                    moves += 1
                    time.sleep(chance.uniform(0.01, 0.09))
                    if chance.random() < 0.003:
                        bench.rig.stop("the soak")
                        bench.rig.reset_stop()
                time.sleep(min(REST_S, 0.1 * seconds / PARTS))
                bench.rig.daqco.stop_recording()
                bench.recording.unlink(missing_ok=True)
                with suppress(CosmicError):
                    bench.rig.daqco.start_recording(bench.recording)
                looks.append(
                    Look(
                        (time.perf_counter() - began_s) / 60.0,
                        resident_kb() / 1024,
                        max(helpers_kb(), default=0.0) / 1024,
                        objects_of() + gc.get_freeze_count(),
                        thread_count(),
                        len(list(FILES.iterdir())) if FILES.exists() else 0,
                        log_kb(folder),
                        moves,
                        campaigns.done,
                    )
                )
                publish(looks[-1])
        finally:
            campaigns.end()
    if campaigns.failure:
        raise RuntimeError(campaigns.failure)
    return looks


def figures(looks: list[Look]) -> list[Figure]:
    """Return what grew after the first quarter: medians of the next tenth and of the last."""
    warm, tenth = looks[len(looks) // 4 :], max(1, len(looks) // 10)

    def middle(name: str, some: list[Look]) -> float:
        values = sorted(float(getattr(each, name)) for each in some)
        return values[len(values) // 2]

    def growth(name: str) -> float:
        return middle(name, warm[-tenth:]) - middle(name, warm[:tenth])

    last = looks[-1]
    return [
        Figure(NAME, "length", last.minute, "min"),
        Figure(NAME, "moves commanded", last.moves, ""),
        Figure(NAME, "campaigns carried out", last.campaigns, ""),
        Figure(NAME, "resident set after the first quarter", warm[0].resident_mb, "MB"),
        Figure(NAME, "resident set, growth since", growth("resident_mb"), "MB", 10),
        Figure(NAME, "largest helper process, growth since", growth("helpers_mb"), "MB", 10),
        Figure(NAME, "Python objects, growth since", growth("objects"), ""),
        Figure(NAME, "threads, growth since", growth("threads"), "", 2),
        Figure(NAME, "open files, growth since", growth("files"), "", 2),
        Figure(NAME, "log on the disk at the end", last.log_kb / 1024, "MB", 50),
    ]


def run(seconds: float, publish: Callable[[Look], None]) -> list[Figure]:
    """Return the figures of one soak."""
    with full_platform(campaign=False) as bench:
        return figures(bench.beside(lambda: collect(bench, seconds, publish)))


def measure(quick: bool = False) -> list[Figure]:
    """Return the figures of a short soak."""
    return run(4.0 if quick else 600.0, lambda _look: None)


def _from_command_line() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=10.0)
    minutes = parser.parse_args().minutes
    print(" ".join(field.name for field in fields(Look)))

    def publish(seen: Look) -> None:
        print(" ".join(f"{value:.5g}" for value in astuple(seen)), flush=True)

    print(table(run(60.0 * minutes, publish)))


if __name__ == "__main__":
    _from_command_line()
