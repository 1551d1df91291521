"""A day's work: one campaign over many plates, with standards, and programs that die in between.

`cosmic campaign` runs as a program of its own until all plates are worked off or the hours are
over. Now and then it is killed without warning and started again in the same folder, where it goes
on with the plate that is there. What is good is compared with the twin's own truth, and at the end
all values are computed anew from the raw files.

The twin forgets with its process what became of the fibres of a plate: what was measured lies
there again and has to be known again.

    python -m benchmarks.campaign_day                             # realistic, 10 plates, 8 hours
    python -m benchmarks.campaign_day --world friendly --plates 30 --hours 24
    python -m benchmarks.campaign_day --quick                     # two plates of three fibres
"""

import argparse
import math
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from sqlite3 import connect

from benchmarks.figures import Figure, table
from cosmic.app.commands.blind_trial import true_of
from cosmic.autonomy.campaign.analysis import analyse, compare, scale_in
from cosmic.autonomy.campaign.rates import rates_of
from cosmic.autonomy.campaign.records import FibreRecord, Outcome
from cosmic.autonomy.campaign.storage_format import DATABASE
from cosmic.autonomy.campaign.store_read import CampaignReader
from cosmic.twin.truth import TruthRecord, read_truth

NAME = "campaign_day"
RATE = 20.0
LIMIT_WALL_S = 12 * 3600.0
POLL_S = 1.0
LEAST_COVER, MOST_COVER = 90.0, 99.0
RECIPE = """
procedure = "{procedure}"
[sample]
name = "{sample}"
[stop]
plates = {plates}
time_s = {time_s}
[parameters.standard]
ei_n_m2 = 1.789e-10
at = ["begin", "middle", "plate", "end"]
[output]
pictures = false
html = false
pdf = false
"""


@dataclass(frozen=True, slots=True)
class Day:
    """What is asked for.

    Attributes
    ----------
    kills : int
        How often the program is killed, evenly over what there is to do.
    """

    world: str = "realistic"
    sample: str = "forty-dry"
    procedure: str = "bend test"
    plates: int = 10
    hours: float = 8.0
    kills: int = 2
    seed: int = 1


QUICK = Day(world="friendly", sample="three-dry", plates=2, hours=1.0, kills=1, seed=3)


@dataclass(frozen=True, slots=True)
class Life:
    """One start of the program: its truth, and whether it was killed."""

    truth: TruthRecord
    killed: bool


def carry_out(day: Day, folder: Path) -> tuple[CampaignReader, list[Life], float, int]:
    """Return the campaign, the lives of the program, seconds of the wall, and the last exit code.

    Raises
    ------
    RuntimeError
        The program does not come to an end.
    """
    recipe, out = folder / "day.toml", folder / "out"
    recipe.write_text(
        RECIPE.format(
            procedure=day.procedure,
            sample=day.sample,
            plates=day.plates,
            time_s=3600.0 * day.hours,
        ),
        encoding="utf-8",
    )
    lives: list[Life] = []
    began_s, code, reader = time.monotonic(), -1, CampaignReader(out)
    while code in (-1, -signal.SIGKILL) and time.monotonic() - began_s < LIMIT_WALL_S:
        truth = folder / f"truth-{len(lives)}.jsonl"
        command = [sys.executable, "-m", "cosmic", "campaign", str(recipe), "--out", str(out)]
        command += ["--world", day.world, "--seed", str(day.seed), "--rate", str(RATE)]
        command += ["--sample", day.sample, "--truth", str(truth)]
        with (folder / f"output-{len(lives)}.txt").open("wb") as output:
            program = subprocess.Popen(command, stdout=output, stderr=output)
            code = _watched(program, reader, _killed_at(day, len(lives)))
        lives.append(Life(read_truth(truth), code == -signal.SIGKILL))
    if code < 0:
        raise RuntimeError(f"the campaign did not end: {(folder / 'output-0.txt').read_text()}")
    return reader, lives, time.monotonic() - began_s, code


def _killed_at(day: Day, life: int) -> float:
    """Return the part of the plates worked off at which a life of the program ends; inf: never."""
    return (life + 1) / (day.kills + 1) if life < day.kills else math.inf


def _watched(program: subprocess.Popen[bytes], reader: CampaignReader, part: float) -> int:
    """Wait for the program, and kill it in the midst of a fibre once so much is done."""
    while True:
        try:
            return program.wait(POLL_S)
        except subprocess.TimeoutExpired:
            if math.isfinite(part) and _part_done(reader) >= part:
                program.kill()
                part = math.inf


def _part_done(reader: CampaignReader) -> float:
    """Return the part of the plates that is worked off, the fibres of this one included."""
    if not (reader.folder / DATABASE).exists():
        return 0.0
    recipe = reader.info().recipe_text
    plates = float(next(x for x in recipe.splitlines() if x.startswith("plates")).split("=")[1])
    fibres, changes = reader.finished(), reader.plate_changes()
    plate = 1 + sum(each.over for each in changes)
    seen = sum(each.plate == plate for each in reader.sightings()) or 1
    here = sum(each.plate == plate for each in fibres)
    return (plate - 1 + min(here / seen, 1.0)) / plates


def figures_of(
    day: Day, reader: CampaignReader, lives: Sequence[Life], wall_s: float, code: int
) -> list[Figure]:
    """Return the figures of a day."""
    rates = rates_of(reader)
    scale = scale_in(reader.analysis())
    used = sum(not each.refused for each in scale.standards) if scale is not None else 0
    covered = _covered(reader, lives)
    cover = 100.0 * sum(covered) / len(covered) if covered else math.nan
    depths = [
        float(each.facts["depth_um"])
        for life in lives
        for each in life.truth.of("contact over")
        if "plate" in each.facts["bodies"]
    ]
    anew = compare(reader, analyse(reader))

    def figure(name: str, value: float, unit: str, limit: float | None = None) -> Figure:
        return Figure(NAME, f"{day.world}: {name}", value, unit, limit)

    return [
        figure("hours of the platform", rates.elapsed_s / 3600.0, "h"),
        figure("plates", rates.plates, ""),
        figure("starts of the program", len(lives), ""),
        figure("exit code of the last", code, "", 0.0),
        figure("fibres seen", rates.seen, "fibres"),
        figure("that could be grasped", rates.graspable, "fibres"),
        figure("tried", rates.tried, "fibres"),
        figure("good", rates.good, "fibres"),
        figure("good of those seen", 100.0 * rates.part(rates.seen), "%"),
        figure("good of those that could be grasped", 100.0 * rates.part(rates.graspable), "%"),
        figure("good of those tried", 100.0 * rates.part(rates.tried), "%"),
        figure("good an hour, all counted", rates.an_hour, "1/h"),
        figure("the same without changes of the plate", rates.an_hour_without_plates, "1/h"),
        figure("the same of treatment alone", rates.an_hour_of_treatment, "1/h"),
        figure("preparation, of the time", 100.0 * rates.preparation_s / rates.elapsed_s, "%"),
        figure("standards that count", used, ""),
        figure("scale not verified", float(scale is None or not scale.verified), "", 0.0),
        figure("compared with the truth", len(covered), "fibres"),
        figure("95 % intervals that hold the truth", cover, "%"),
        figure(
            "the same, outside of 90 to 99 %",
            max(LEAST_COVER - cover, cover - MOST_COVER, 0.0),
            "%",
        ),
        figure("contacts of jaw and plate", len(depths), ""),
        figure("depth of these, worst", max(depths, default=0.0), "um"),
        figure("values that raw files do not give again", len(anew.changed), "", 0.0),
        figure("wall a platform hour", wall_s / rates.elapsed_s * 60.0, "min", 5.0),
    ]


def _covered(reader: CampaignReader, lives: Sequence[Life]) -> list[bool]:
    """Return for each good fibre with a truth whether its interval holds it."""
    with closing(connect(reader.folder / DATABASE)) as base:
        runs = dict(base.execute("SELECT number, run FROM fibre").fetchall())
    found = []
    for record in reader.finished():
        true = _true(record, lives[runs[record.number] - 1])
        if record.outcome is Outcome.GOOD and record.bending is not None and true is not None:
            found.append(record.bending.ei_low_n_m2 <= true <= record.bending.ei_high_n_m2)
    return found


def _true(record: FibreRecord, life: Life) -> float | None:
    return true_of(life.truth, record)


def measure(quick: bool = False, day: Day | None = None) -> list[Figure]:
    """Return the figures of a day."""
    day = QUICK if quick else day or Day()
    with tempfile.TemporaryDirectory() as folder:
        reader, lives, wall_s, code = carry_out(day, Path(folder))
        return figures_of(day, reader, lives, wall_s, code)


def main() -> None:
    """Read the command line and run."""
    usual = Day()
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--world", default=usual.world)
    parser.add_argument("--plates", type=int, default=usual.plates)
    parser.add_argument("--hours", type=float, default=usual.hours)
    parser.add_argument("--kills", type=int, default=usual.kills)
    parser.add_argument("--seed", type=int, default=usual.seed)
    parser.add_argument("--two-grippers", action="store_true")
    chosen = parser.parse_args()
    day = Day(
        world=chosen.world,
        procedure="bend test with two grippers" if chosen.two_grippers else usual.procedure,
        plates=chosen.plates,
        hours=chosen.hours,
        kills=chosen.kills,
        seed=chosen.seed,
    )
    print(table(measure(chosen.quick, day)))


if __name__ == "__main__":
    main()
