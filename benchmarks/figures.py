"""What a benchmark found, as numbers with their targets, and how they are printed."""

import argparse
import json
import statistics
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path


@dataclass(frozen=True, slots=True)
class Figure:
    """One number.

    Attributes
    ----------
    limit : float or None
        The target: at most this much; None where there is none.
    low, high : float or None
        Smallest and largest of several runs, where `value` is their median.
    """

    benchmark: str
    name: str
    value: float
    unit: str
    limit: float | None = None
    low: float | None = None
    high: float | None = None

    @property
    def verdict(self) -> str:
        """Whether the target is met, in a word."""
        if self.limit is None:
            return ""
        return "yes" if self.value <= self.limit else "**no**"


def percentile(values: Sequence[float], percent: float) -> float:
    """Return the nearest-rank percentile: a value that was measured."""
    ordered = sorted(values)
    rank = max(0, min(len(ordered) - 1, round(percent / 100.0 * len(ordered) + 0.5) - 1))
    return ordered[rank]


def medians(runs: Iterable[Sequence[Figure]]) -> list[Figure]:
    """Return the median of each figure over several runs, with the range."""
    found: dict[tuple[str, str], list[Figure]] = {}
    for run in runs:
        for figure in run:
            found.setdefault((figure.benchmark, figure.name), []).append(figure)
    middle = []
    for figures in found.values():
        values = [figure.value for figure in figures]
        first = figures[0]
        middle.append(
            Figure(
                first.benchmark,
                first.name,
                statistics.median(values),
                first.unit,
                first.limit,
                low=min(values),
                high=max(values),
            )
        )
    return middle


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.3g}" if abs(value) < 1000 else f"{value:.0f}"


def table(figures: Iterable[Figure]) -> str:
    """Return the figures as a table in Markdown."""
    lines = [
        "| benchmark | figure | value | lowest to highest run | unit | target | met |",
        "|---|---|---:|---:|---|---:|---|",
    ]
    for each in figures:
        spread = "" if each.low is None else f"{_number(each.low)} to {_number(each.high)}"
        target = "" if each.limit is None else f"<= {each.limit:g}"
        cells = (
            each.benchmark,
            each.name,
            _number(each.value),
            spread,
            each.unit,
            target,
            each.verdict,
        )
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def to_json(figures: Iterable[Figure]) -> str:
    """Return the figures as JSON, for `from_json`."""
    return json.dumps([asdict(figure) for figure in figures])


def from_json(text: str) -> list[Figure]:
    """Return the figures that `to_json` wrote."""
    return [Figure(**entry) for entry in json.loads(text)]


def main(description: str | None, measure: Callable[[bool], list[Figure]]) -> None:
    """Run one benchmark from the command line: print its table, or write JSON to a file."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--quick", action="store_true", help="a few samples, to see that it works")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures there")
    chosen = parser.parse_args()
    figures = measure(chosen.quick)
    if chosen.json is not None:
        chosen.json.write_text(to_json(figures), encoding="utf-8")
    else:
        print(table(figures))
