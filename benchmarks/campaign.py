"""Campaigns of one simulated hour, scored from the twin's own truth.

Each seed is a program of its own, as an operator would start it: `cosmic campaign` with the sample
`forty-dry`, its default faults, and the speeds of the real axes; then some with wet fibres, and
some with two grippers. It ends before the hour where no fibre is left that can be taken up. The
records are compared with what the twin wrote to its file of truth, which the campaign cannot read.

The platform runs up to twenty times faster than the wall, and as the wall while the program
thinks, so that a fibre takes as long on the platform as it would without any hurry.

    python -m benchmarks.campaign                 # 14 campaigns, on two quiet cores
    python -m benchmarks.campaign --quick         # one seed, eight fibres
"""

import math
import statistics
import subprocess
import sys
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

from benchmarks.figures import Figure, main, percentile
from cosmic.autonomy.campaign.records import FibreRecord, Outcome
from cosmic.autonomy.campaign.store_read import CampaignReader
from cosmic.twin.truth import TrueFibre, TruthRecord, read_truth

NAME = "campaign"
RATE = 20.0
LIMIT_S = 1800.0
GOAL_FROM_N_M2 = 1e-12
SENSOR_UN = 180.0
PEAK_PART = 0.8
MUST_PER_HOUR, MUST_SUCCESS = 60.0, 90.0
MEDIAN_PERCENT, P90_PERCENT = 5.0, 10.0
LEAST_COVER, MOST_COVER = 90.0, 99.0
OUT_OF_JAWS = {"released", "came off", "landed", "broken"}

RECIPE = """
procedure = "{procedure}"
[sample]
name = "{sample}"
[stop]
{stop}
[output]
pictures = false
html = false
pdf = false
"""


@dataclass(frozen=True, slots=True)
class Kind:
    """Campaigns of one kind, with seeds from 1 on."""

    name: str
    sample: str = "forty-dry"
    procedure: str = "bend test"
    seeds: int = 2


KINDS = (
    Kind(NAME, seeds=10),
    Kind(f"{NAME}, wet", sample="forty-wet"),
    Kind(f"{NAME}, two grippers", procedure="bend test with two grippers"),
)


@dataclass(frozen=True, slots=True)
class Run:
    """One campaign with what truly happened."""

    fibres: tuple[FibreRecord, ...]
    elapsed_s: float
    truth: TruthRecord
    end: str

    @property
    def good(self) -> list[FibreRecord]:
        """Fibres that were measured, and trusted."""
        return [each for each in self.fibres if each.outcome is Outcome.GOOD]

    @property
    def tried(self) -> list[FibreRecord]:
        """Fibres whose treatment has an end."""
        return [each for each in self.fibres if each.outcome is not Outcome.RUNNING]

    def true_of(self, record: FibreRecord) -> TrueFibre | None:
        """Return the fibre that was in the jaws while a record was made; None: none was."""
        known = {each.number: each for each in self.truth.fibres}
        held = [
            number
            for number, began_s, ended_s in self.truth_held()
            if record.began_s <= began_s and ended_s <= record.ended_s
        ]
        return known.get(held[-1]) if held else None

    def truth_held(self) -> list[tuple[int, float, float]]:
        """Return which fibre was in jaws, from when to when; of two grippers both, by begin."""
        held: list[tuple[int, float, float]] = []
        since: dict[int, float] = {}
        for event in self.truth.events:
            number: int = event.facts.get("fibre", -1)
            if event.event == "grasped":
                since[number] = event.time_s
            elif event.event in OUT_OF_JAWS and number in since:
                held.append((number, since.pop(number), event.time_s))
        return sorted(held, key=lambda each: each[1])


def carry_out(kind: Kind, seed: int, stop: str, folder: Path) -> Run:
    """Run one campaign to its end; raises `RuntimeError` where the program failed."""
    recipe, out, truth = folder / "hour.toml", folder / f"out-{seed}", folder / f"truth-{seed}"
    text = RECIPE.format(procedure=kind.procedure, sample=kind.sample, stop=stop)
    recipe.write_text(text, encoding="utf-8")
    command = [sys.executable, "-m", "cosmic", "campaign", str(recipe), "--out", str(out)]
    command += ["--seed", str(seed), "--rate", str(RATE), "--truth", str(truth)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=LIMIT_S, check=False)
    reader = CampaignReader(out)
    _, end = reader.ended()
    if not end:
        raise RuntimeError(f"seed {seed}: {done.stderr[-2000:]}")
    return Run(reader.fibres(), reader.elapsed_s(), read_truth(truth), end)


def measure(quick: bool = False) -> list[Figure]:
    """Return the figures of all seeds of each kind together."""
    stop = "count = 8" if quick else "time_s = 3600.0"
    figures = []
    for kind in KINDS[:1] if quick else KINDS:
        seeds = range(1, 2 if quick else kind.seeds + 1)
        with tempfile.TemporaryDirectory() as folder:
            runs = [carry_out(kind, seed, stop, Path(folder)) for seed in seeds]
        found = [*throughput(runs), *stiffness(runs), *safety(runs)]
        figures += [replace(each, benchmark=kind.name) for each in found]
    return figures


def throughput(runs: list[Run]) -> list[Figure]:
    """Return how many fibres were treated, and how well."""
    rates = [3600.0 * len(each.good) / each.elapsed_s for each in runs if each.elapsed_s > 0.0]
    good, tried = sum(len(each.good) for each in runs), sum(len(each.tried) for each in runs)
    cycles = [fibre.duration_s for each in runs for fibre in each.good]
    success = 100.0 * good / tried if tried else math.nan
    return [
        Figure(NAME, "fibres tried", tried, "fibres"),
        Figure(NAME, "good fibres", good, "fibres"),
        Figure(NAME, "good fibres an hour, mean of the seeds", statistics.mean(rates), "1/h"),
        Figure(NAME, "the same, least of a seed", min(rates), "1/h"),
        _short(f"good an hour below {MUST_PER_HOUR:g}", statistics.mean(rates), MUST_PER_HOUR),
        Figure(NAME, "success of the fibres tried", success, "%"),
        _short(f"success below {MUST_SUCCESS:g} %", success, MUST_SUCCESS),
        Figure(NAME, "time of a good fibre, median", statistics.median(cycles), "s"),
    ]


def _short(name: str, value: float, wanted: float) -> Figure:
    """Return by how much a value falls short of what it must be, which may be nothing."""
    return Figure(NAME, name, max(0.0, wanted - value), "", 0.0)


def stiffness(runs: list[Run]) -> list[Figure]:
    """Return how far off the stiffness of good fibres is, and whether the interval says so."""
    errors, covered, lengths, widths, strangers, twice = [], [], [], [], 0, 0
    for run in runs:
        measured: set[int] = set()
        for record in run.good:
            true, found = run.true_of(record), record.bending
            if true is None or found is None:
                strangers += 1
                continue
            twice += true.number in measured
            measured.add(true.number)
            lengths.append(100.0 * abs(record.shape.length_um / true.length_um - 1.0))
            widths.append(100.0 * abs(record.shape.width_um / true.width_um - 1.0))
            if true.ei_n_m2 >= GOAL_FROM_N_M2:
                errors.append(100.0 * abs(found.ei_n_m2 / true.ei_n_m2 - 1.0))
                covered.append(found.ei_low_n_m2 <= true.ei_n_m2 <= found.ei_high_n_m2)
    cover = 100.0 * statistics.mean(covered)
    outside = max(LEAST_COVER - cover, cover - MOST_COVER, 0.0)
    return [
        Figure(NAME, "error of EI, median", statistics.median(errors), "%", MEDIAN_PERCENT),
        Figure(NAME, "error of EI, 90 %", percentile(errors, 90), "%", P90_PERCENT),
        Figure(NAME, "95 % intervals that hold the truth", cover, "%"),
        Figure(NAME, "the same, outside of 90 to 99 %", outside, "%", 0.0),
        Figure(NAME, "error of length, median", statistics.median(lengths), "%"),
        Figure(NAME, "error of width, median", statistics.median(widths), "%"),
        Figure(NAME, "good records without a fibre", strangers, "fibres", 0.0),
        Figure(NAME, "fibres measured twice", twice, "fibres", 0.0),
    ]


def safety(runs: list[Run]) -> list[Figure]:
    """Return what touched what, and how hard."""
    contacts = sum(
        not event.facts["meant"] for each in runs for event in each.truth.of("contact over")
    )
    peaks = [
        float(event.facts["peak_un"])
        for each in runs
        for event in each.truth.of("left")
        if "peak_un" in event.facts
    ]
    limit = 100.0 * PEAK_PART
    ended = sum(each.end.startswith("a mistake") for each in runs)
    return [
        Figure(NAME, "contacts that were not intended", contacts, "", 0.0),
        Figure(NAME, "peak force, of the range", 100.0 * max(peaks) / SENSOR_UN, "%", limit),
        Figure(NAME, "ended by a mistake in the program", ended, "", 0.0),
    ]


if __name__ == "__main__":
    main(__doc__, measure)
