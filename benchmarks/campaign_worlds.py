"""Whole campaigns in worlds of the twin: what becomes of the fibres, and what touches what.

Each campaign is a program of its own on the sample `forty-dry`, in the plain, friendly, realistic
and harsh world and in two mixtures, of which each constant is that of one of the three worlds by
chance. It goes on until no fibre is left that can be taken, and is scored from the twin's truth.

Three shares are told apart: of the fibres that lie alone on the plate, good or not; of those that
can be grasped, which have room for the jaws and are no longer, shorter or more curled than the
settings allow, by the truth and not by what was seen; and of those tried.

A contact of jaw and plate counts as not intended where it is deeper than the world allows.

    python -m benchmarks.campaign_worlds               # six worlds, two seeds: an hour
    python -m benchmarks.campaign_worlds --quick       # three fibres in the friendly world
"""

import argparse
import math
import os
import random
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import tomlkit

import cosmic
from benchmarks.campaign import RECIPE, Run
from benchmarks.figures import Figure, percentile, table
from cosmic.autonomy.bending.fit import half_width_percent
from cosmic.autonomy.bending.result import BendingResult
from cosmic.autonomy.campaign.records import FibreRecord
from cosmic.autonomy.campaign.store_read import CampaignReader
from cosmic.autonomy.handling.plate import Candidate, Jaws, Neighbours, PlateFrame, reaches
from cosmic.autonomy.handling.settings import GraspSettings
from cosmic.frame.config import read_toml
from cosmic.twin.centre_line import CentreLine
from cosmic.twin.truth import TrueFibre, TruthRecord, read_truth

NAME = "campaign_worlds"
STANDARD = """
[parameters.standard]
ei_n_m2 = 1.79e-10
expanded_percent = 2.0
"""
"""What the certificate of the glass fibre says that lies on the plates of these worlds."""
CONFIG = Path(cosmic.__file__).parents[2] / "config"
LAB = ("friendly", "realistic", "harsh")
WORLDS = ("plain", *LAB, "mixture 1", "mixture 2")
RATE = 20.0
"""Faster, the platform's own times become coarse: who waits goes on 2 ms of the wall late."""
LIMIT_S = 3600.0
WIDEST_PERCENT = 30.0
SEEDS = (1, 2)
DEPTH_UM = {"friendly": 1.0, "plain": 1.0}
OTHER_DEPTH_UM = 3.0
SUCCESS = {"friendly": 95.0, "realistic": 85.0}
AN_HOUR = {"friendly": 150.0, "realistic": 90.0}


def mixture(number: int) -> dict[str, Any]:
    """Return a world of which each constant is that of one of the three, by chance."""
    chance = random.Random(f"mixture {number}")
    worlds = [read_toml(CONFIG / "worlds" / f"{name}.toml") for name in LAB]
    mixed: dict[str, Any] = {"about": f"Mixture {number}.", "standard": "glass"}
    for part in ("session", "fibre"):
        keys = sorted(set().union(*(each[part] for each in worlds)))
        drawn = {key: chance.choice(worlds)[part].get(key) for key in keys}
        mixed[part] = {key: value for key, value in drawn.items() if value is not None}
    return mixed


@dataclass(frozen=True, slots=True)
class Scored:
    """One campaign and what truly happened; see `Run`."""

    run: Run
    wall_s: float
    cpu_s: float

    @property
    def alone(self) -> int:
        """How many fibres lie alone on the plate."""
        return sum(each.role == "single" for each in self.run.truth.fibres)

    @property
    def graspable(self) -> set[int]:
        """The numbers of those that can be taken."""
        return graspable(self.run.truth)

    @property
    def values(self) -> list[tuple[BendingResult, float]]:
        """What was measured of each fibre, and what is true of its longest span, N m2."""
        pairs = ((each.bending, self._true_ei(each)) for each in self.run.tried)
        return [(found, true) for found, true in pairs if found is not None and true is not None]

    def _true_ei(self, record: FibreRecord) -> float | None:
        fibre = self.run.true_of(record)
        met = [
            each.facts
            for each in self.run.truth.of("touched", None if fibre is None else fibre.number)
            if record.began_s <= each.time_s <= record.ended_s and "ei_n_m2" in each.facts
        ]
        if fibre is None or not met:
            return None
        return float(max(met, key=lambda facts: facts["abscissa_um"])["ei_n_m2"])

    @property
    def depths_um(self) -> list[float]:
        """How deep jaws came into the plate, contact by contact."""
        return [
            float(each.facts["depth_um"])
            for each in self.run.truth.of("contact over")
            if "plate" in each.facts["bodies"]
        ]

    @property
    def other_contacts(self) -> int:
        """Contacts of anything else that were not meant."""
        return sum(
            not each.facts["meant"] and "plate" not in each.facts["bodies"]
            for each in self.run.truth.of("contact over")
        )


def graspable(truth: TruthRecord) -> set[int]:
    """Return the numbers of the fibres on the first plate that jaws have room for."""
    settings = GraspSettings()
    lines = {each.number: _line_um(each) for each in truth.fibres if each.role != "debris"}
    found = set()
    for fibre in truth.fibres:
        if fibre.role != "single":
            continue
        line = lines[fibre.number]
        length = float(np.hypot(*np.diff(line, axis=0).T).sum())
        curl = length / max(float(np.hypot(*(line[-1] - line[0]))), 1.0) - 1.0
        fits = settings.shortest_um <= length <= settings.longest_um and curl <= settings.curliest
        others = Neighbours([each for number, each in lines.items() if number != fibre.number])
        candidate = Candidate(line, length, fibre.width_um, curl, 1.0)
        ways = reaches(candidate, PlateFrame(), Jaws(), settings, others, 0.0)
        if fits and ways:
            found.add(fibre.number)
    return found


def _line_um(fibre: TrueFibre) -> np.ndarray:
    line = CentreLine.of(fibre.length_um, fibre.curl_deg, fibre.kink_deg)
    whole = line.placed(fibre.x_um, fibre.y_um, np.radians(fibre.angle_deg))
    at = np.linspace(0.0, line.length_um, 60)
    return np.column_stack([np.interp(at, line.arcs_um, column) for column in whole.T])


def carry_out(world: str, seed: int, stop: str, folder: Path, *, procedure: str) -> Scored:
    """Run one campaign to its end; raises `RuntimeError` where the program failed."""
    config, name = folder / "config", world.replace(" ", "-")
    if not config.exists():
        shutil.copytree(CONFIG, config)
        for number in (1, 2):
            text = tomlkit.dumps(mixture(number))
            (config / "worlds" / f"mixture-{number}.toml").write_text(text, encoding="utf-8")
    recipe, out, truth = folder / "all.toml", folder / f"{name}-{seed}", folder / f"{name}-{seed}.t"
    text = RECIPE.format(procedure=procedure, sample="forty-dry", stop=stop)
    text += "" if world == "plain" else STANDARD
    recipe.write_text(text, encoding="utf-8")
    command = [sys.executable, "-m", "cosmic", "campaign", str(recipe), "--config", str(config)]
    command += ["--out", str(out), "--world", name]
    command += ["--seed", str(seed), "--rate", str(RATE), "--truth", str(truth)]
    began_s, before_s = time.monotonic(), _children_s()
    done = subprocess.run(command, capture_output=True, text=True, timeout=LIMIT_S, check=False)
    _, end = CampaignReader(out).ended() if out.exists() else ("", "")
    if not end:
        raise RuntimeError(f"{world}, seed {seed}: {done.stderr[-2000:]}")
    reader = CampaignReader(out)
    run = Run(reader.fibres(), reader.elapsed_s(), read_truth(truth), end)
    return Scored(run, time.monotonic() - began_s, _children_s() - before_s)


def _children_s() -> float:
    """Return the processor time of all programs that have ended, with what they started."""
    used = os.times()
    return used.children_user + used.children_system


def figures_of(world: str, scored: Sequence[Scored]) -> list[Figure]:
    """Return the figures of all seeds of one world."""
    good = sum(len(each.run.good) for each in scored)
    tried = sum(len(each.run.tried) for each in scored)
    can = sum(len(each.graspable) for each in scored)
    taken = 0
    for each in scored:
        trues = {true.number for record in each.run.good if (true := each.run.true_of(record))}
        taken += len(trues & each.graspable)
    rates = [
        3600.0 * len(each.run.good) / each.run.elapsed_s for each in scored if each.run.elapsed_s
    ]
    depths = [depth for each in scored for depth in each.depths_um]
    allowed = DEPTH_UM.get(world, OTHER_DEPTH_UM)
    percent = 100.0 * taken / max(can, 1)
    rate = statistics.mean(rates)
    elapsed_s = sum(each.run.elapsed_s for each in scored)
    wall_s = 3600.0 * sum(each.wall_s for each in scored) / max(elapsed_s, 1.0)
    cpu_s = 3600.0 * sum(each.cpu_s for each in scored) / max(elapsed_s, 1.0)

    def figure(name: str, value: float, unit: str, limit: float | None = None) -> Figure:
        return Figure(NAME, f"{world}: {name}", value, unit, limit)

    return [
        figure("good fibres", good, "fibres"),
        figure("tried", tried, "fibres"),
        figure("that can be grasped", can, "fibres"),
        figure("good of those that lie alone", 100.0 * good / sum(e.alone for e in scored), "%"),
        figure("good of those that can be grasped", percent, "%"),
        figure("good of those tried", 100.0 * good / max(tried, 1), "%"),
        figure("success short of the target", max(0.0, SUCCESS.get(world, 0) - percent), "%", 0.0),
        figure("good an hour, preparation included", rate, "1/h"),
        figure("the same, short of the target", max(0.0, AN_HOUR.get(world, 0) - rate), "1/h", 0.0),
        figure("contacts of jaw and plate", len(depths), ""),
        figure("depth of these, p90", percentile(depths, 90) if depths else 0.0, "um"),
        figure("depth of these, worst", max(depths, default=0.0), "um"),
        figure(f"deeper than {allowed:g} um", sum(each > allowed for each in depths), "", 0.0),
        figure("other contacts that were not intended", sum(e.other_contacts for e in scored), ""),
        figure("wall a platform hour", wall_s / 60.0, "min", 5.0),
        figure("processor a platform hour", cpu_s / 60.0, "min"),
    ]


def values_of(world: str, scored: Sequence[Scored]) -> list[Figure]:
    """Return how far values may be believed, by the truth that each push is about."""
    pairs = [pair for each in scored for pair in each.values]
    good = [(found, true) for found, true in pairs if found.trusted]
    right = [(found, true) for found, true in pairs if _inside(found, true)]
    right = [pair for pair in right if half_width_percent(pair[0]) <= WIDEST_PERCENT]
    halves = [half_width_percent(found) for found, _ in good]
    errors = [100.0 * (found.ei_n_m2 / true - 1.0) for found, true in good]
    off = sum(abs(error) > 2.0 * half for error, half in zip(errors, halves, strict=True))
    none = [math.nan]

    def figure(name: str, value: float, unit: str) -> Figure:
        return Figure(NAME, f"{world}: {name}", value, unit)

    return [
        figure("good with the truth inside", sum(_inside(*each) for each in good), "fibres"),
        figure("of so many whose truth is known", len(good), "fibres"),
        figure("good and off by more than twice the half width", off, "fibres"),
        figure("right values", len(right), "fibres"),
        figure("thrown away", sum(not found.trusted for found, _ in right), "fibres"),
        figure("half width of good ones, p50", percentile(halves or none, 50), "%"),
        figure("error of good ones with its sign, p10", percentile(errors or none, 10), "%"),
        figure("the same, p50", percentile(errors or none, 50), "%"),
        figure("the same, p90", percentile(errors or none, 90), "%"),
    ]


def _inside(found: BendingResult, true_n_m2: float) -> bool:
    return found.ei_low_n_m2 <= true_n_m2 <= found.ei_high_n_m2


def causes(scored: Sequence[Scored]) -> Counter[str]:
    """Return why fibres that were tried are no good ones."""
    return Counter(
        f"{each.cause or 'not trusted'}"
        for one in scored
        for each in one.run.tried
        if each not in one.run.good
    )


def measure(
    quick: bool = False,
    worlds: Sequence[str] = WORLDS,
    seeds: Sequence[int] = SEEDS,
    procedure: str = "bend test",
) -> list[Figure]:
    """Return the figures of all worlds."""
    figures = []
    for world in ("friendly",) if quick else worlds:
        with tempfile.TemporaryDirectory() as folder:
            stop = "count = 3" if quick else "time_s = 3600.0"
            chosen = seeds[:1] if quick else seeds
            scored = [
                carry_out(world, seed, stop, Path(folder), procedure=procedure) for seed in chosen
            ]
        figures += [*figures_of(world, scored), *values_of(world, scored)]
        print(world, dict(causes(scored)), [each.run.end for each in scored], flush=True)
    return figures


def main() -> None:
    """Read the command line and run."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--world", action="append", choices=WORLDS)
    parser.add_argument("--seed", action="append", type=int)
    parser.add_argument("--two-grippers", action="store_true")
    chosen = parser.parse_args()
    procedure = "bend test with two grippers" if chosen.two_grippers else "bend test"
    found = measure(chosen.quick, chosen.world or WORLDS, chosen.seed or SEEDS, procedure)
    print(table(found))


if __name__ == "__main__":
    main()
