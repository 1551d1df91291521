"""kill -9 at random moments of campaigns: what is lost, what is doubled, how soon work goes on.

`cosmic campaign` runs as a process on the twin, and is killed: at any moment, while the file of a
fibre is written, in the midst of a commit, and while the report is made. Then it is started again
in the same folder, until nothing is left on the plate; then the next campaign begins. The plate
stays as it is from one start to the next (benchmarks/kept_plate.py), and each fourth time the
power was off as well, so that the controllers know no position; these starts are not timed.

After each kill the folder is read: every fibre that was finished must be there once, unchanged,
with its curves. What was truly measured, and how often, tells the twin's own truth.

    python -m benchmarks.campaign_kills           # 50 kills, half an hour on two quiet cores
    python -m benchmarks.campaign_kills --quick   # two kills
"""

import json
import random
import statistics
import sys
import tempfile
from pathlib import Path
from typing import Final

from benchmarks.figures import Figure, main
from benchmarks.killed_campaign import Tally, Victim

NAME = "campaign_kills"
KILLS: Final = 50
KINDS: Final = ("moment", "moment", "moment", "file", "commit", "report")


def measure(quick: bool = False) -> list[Figure]:
    """Return the figures of all kills."""
    wanted, chance, tally, seed = (2 if quick else KILLS), random.Random(8), Tally(), 0
    with tempfile.TemporaryDirectory() as folder:
        while sum(tally.kills.values()) < wanted:
            seed += 1
            home = Path(folder) / str(seed)
            home.mkdir()
            victim = Victim(home, seed, tally)
            while not victim.over and sum(tally.kills.values()) < wanted:
                victim.live(chance.choice(KINDS), chance)
                sys.stderr.write(f"{json.dumps(_state(tally))}\n")
    return figures(tally)


def _state(tally: Tally) -> dict[str, object]:
    names = ("lives", "finished", "lost", "changed", "doubled", "unreadable", "orphans", "trusted")
    return {"kills": dict(tally.kills)} | {name: getattr(tally, name) for name in names}


def figures(tally: Tally) -> list[Figure]:
    """Return what was found."""
    none = 0.0
    return [
        *(Figure(NAME, f"kills: {kind}", n, "kills") for kind, n in sorted(tally.kills.items())),
        Figure(NAME, "starts of the program", tally.lives, "starts"),
        Figure(NAME, "finished fibres", tally.finished, "fibres"),
        Figure(NAME, "fibres cut off, of campaigns that ended", tally.spoilt, "fibres"),
        Figure(NAME, "starts that were refused", tally.refused, "starts", none),
        Figure(NAME, "records lost", tally.lost + tally.unannounced, "fibres", none),
        Figure(NAME, "records changed afterwards", tally.changed, "fibres", none),
        Figure(NAME, "fibres measured twice", tally.doubled, "fibres", none),
        Figure(NAME, "folders that cannot be read", tally.unreadable, "", none),
        Figure(NAME, "processes left running", tally.orphans, "", none),
        Figure(NAME, "starts that trusted old positions", tally.trusted, "", none),
        Figure(NAME, "contacts that were not intended", tally.contacts, "", none),
        *_spread("from the start to an open store", tally.start_up_s, "s, wall"),
        *_spread("from there to the first motion", tally.moving_s, "s, platform"),
        *_spread("from there to work on a fibre", tally.working_s, "s, platform", 60.0),
    ]


def _spread(name: str, values: list[float], unit: str, limit: float | None = None) -> list[Figure]:
    if not values:
        return []
    middle = statistics.median(values)
    return [
        Figure(NAME, f"{name}, median", middle, unit, limit),
        Figure(NAME, f"{name}, longest", max(values), unit),
    ]


if __name__ == "__main__":
    main(__doc__, measure)
