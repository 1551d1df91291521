"""Is what is certain right, and what is right certain? And the weights of that certainty.

`--fit` draws the population of `fibre_pairs`, finds its fibres and prints the weights for
`cosmic.vico.core.vision.certainty`. Without it they are checked: on images of `fibre_pairs` that
were not fitted, on pairs drawn in the other way of `fibre_images`, on JPEG and on fields of twenty.
`--images FOLDER` counts the certain ones on photographs as well; `--count N` draws N pairs.
"""

import argparse
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from unittest.mock import patch

import cv2
import numpy as np
from scipy.optimize import minimize

from benchmarks import fibre_images, figures
from benchmarks.fibre_pairs import TOLD_APART, Drawn, Kind, draw
from benchmarks.figures import Figure
from cosmic.vico.api import Fibre, find_fibres
from cosmic.vico.core.vision import axial, beyond, certainty
from cosmic.vico.core.vision.grey import Mask
from cosmic.vico.core.vision.profiles import Scene
from cosmic.vico.core.vision.refine import Course

NAME = "certainty"
PAIRS = (Kind.TOUCHING, Kind.OVERLAPPING, Kind.GAP)
MIX = (Kind.SINGLE,) * 8 + PAIRS * 3 + (Kind.GOES_ON,) * 3
FITTED = range(3000)
CHECKED = range(50_000, 52_000)
LENGTH_PART = 0.03
OWN = {axial.GAP, axial.DOUBLED, axial.STEP, beyond.GOES_ON, beyond.SOFT, certainty.IMPROBABLE}
GRIP = 1e-4
"""How strongly weights are kept small in the fit."""
LEAST_WEIGHT = 0.1
ROUNDS = 8


@dataclass(frozen=True, slots=True, eq=False)
class Case:
    """One fibre that was found, and whether it is one that was drawn."""

    fibre: Fibre
    right: bool
    length_px: float


def cases(fibres: Iterable[Fibre], lines: list[np.ndarray]) -> list[Case]:
    """Return the fibres found with what is true of them."""
    found = []
    for fibre in fibres:
        best, length = np.inf, 0.0
        for line in lines:
            ends = line[[0, -1]]
            off = min(
                float(np.linalg.norm(fibre.ends_px - each, axis=1).max())
                for each in (ends, ends[::-1])
            )
            if off < best:
                best, length = off, float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum())
        alike = length > 0 and abs(fibre.length_px / length - 1.0) < LENGTH_PART
        found.append(Case(fibre, alike and best < fibre.width_px + 4.0, length))
    return found


def drawn_cases(one: Drawn) -> list[Case]:
    """Return what is found on one drawn image."""
    return cases(find_fibres(one.image), [each.line_px for each in one.fibres])


def tellable(one: Drawn) -> bool:
    """Return whether the pixels tell what is drawn from one fibre."""
    return one.kind not in PAIRS or one.apart >= TOLD_APART


@contextmanager
def recorded() -> Iterator[list[certainty.Signs]]:
    """Keep the signs of everything that is found meanwhile, all along each fibre."""
    found: list[certainty.Signs] = []

    def signs_of(scene: Scene, course: Course, explained: Mask) -> certainty.Signs:
        found.append(original(scene, course, explained))
        return found[-1]

    original = certainty.signs_of
    with patch.object(certainty, "signs_of", signs_of):
        yield found


@dataclass(slots=True, eq=False)
class Learned:
    """What a fit learns from: the signs of each case, and whether it is right.

    Attributes
    ----------
    pulls : list of float
        Errors of the length of whole fibres without a sign, in standard deviations.
    """

    signs: list[certainty.Signs] = field(default_factory=list)
    right: list[bool] = field(default_factory=list)
    pulls: list[float] = field(default_factory=list)

    def add(self, one: Drawn) -> None:
        """Find the fibres on an image, and add them."""
        with recorded() as signs:
            found = drawn_cases(one)
        for case in found:
            # What thins and is found whole shows all signs of what it is not.
            if set(case.fibre.doubts) - OWN or (case.right and one.kind is Kind.GOES_ON):
                continue
            own = next(each for each in signs if each.values == case.fibre.signs)
            self.signs.append(own)
            self.right.append(case.right)
            if case.right and not own.doubts:
                pull = abs(case.fibre.length_px - case.length_px) / case.fibre.length_std_px
                self.pulls.append(pull)


def fit(seeds: Iterable[int]) -> tuple[np.ndarray, float, float]:
    """Return weights and the logit alone, right for each wrong, and how wide an interval is.

    A joint is in one place: of each fibre the signs of the place count where together they weigh
    most. Which that is depends on the weights, so that both are found in turn.
    """
    learned = Learned()
    for seed in seeds:
        one = draw(MIX[seed % len(MIX)], seed, large=seed % 7 < 2)
        if tellable(one):
            learned.add(one)
    y = np.where(np.array(learned.right), 1.0, -1.0)
    state = np.append(np.full(len(certainty.NAMES), 2.0), 8.0)
    for number in range(ROUNDS):
        x = np.array([each.weighed_by(state[:-1]) for each in learned.signs])

        def loss(state: np.ndarray, x: np.ndarray = x) -> tuple[float, np.ndarray]:
            logit = state[-1] - x @ state[:-1]
            miss = 1.0 / (1.0 + np.exp(np.clip(y * logit, -40.0, 40.0)))
            value = np.logaddexp(0.0, -y * logit).mean() + GRIP * float(state[:-1] @ state[:-1])
            slope = (y * miss) @ x / len(y) + 2.0 * GRIP * state[:-1]
            return float(value), np.append(slope, -(y * miss).mean())

        bounds = [(LEAST_WEIGHT, None)] * x.shape[1] + [(None, None)]
        best = minimize(loss, state, jac=True, bounds=bounds, method="L-BFGS-B").x
        state = best if number == ROUNDS - 1 else 0.5 * (state + best)
    odds = float((y > 0).sum() / max(1, (y < 0).sum()))
    return state, odds, float(np.percentile(learned.pulls, 95))


def split(seed: int) -> tuple[np.ndarray, list[np.ndarray], float]:
    """Return a pair drawn in the other way, its lines, and the gap in widths."""
    rng = np.random.default_rng(900_000 + seed)
    recipe = fibre_images.Recipe(
        shape=(720, 960),
        length_px=(300.0, 700.0),
        width_px=(6.0, 18.0),
        contrast=float(rng.uniform(35.0, 80.0)),
        noise=float(rng.uniform(1.5, 5.0)),
        blur_px=float(rng.uniform(0.8, 1.6)),
        specks=0,
        turns=1.0,
        margin_px=60.0,
    )
    whole = fibre_images.truths(rng, recipe)[0]
    line, width = whole.line_px, whole.width_px
    gap = float(rng.uniform(0.25, 2.0)) if seed % 2 else 0.0
    lean = float(rng.choice([-1.0, 1.0]) * rng.uniform(0.25, 1.2)) if seed % 2 == 0 else 0.0
    at = int(len(line) * rng.uniform(0.35, 0.65))
    away = round(gap * width / fibre_images.STEP_PX)
    first, second = line[:at], line[at + max(1, away) :]
    cos, sin = np.cos(lean), np.sin(lean)
    second = (second - line[at]) @ np.array([[cos, sin], [-sin, cos]]) + line[at]
    share = np.zeros(recipe.shape, np.float32)
    for part in (first, second):
        one = fibre_images.coverage(recipe.shape, fibre_images.Truth(part, width), width)
        share = np.maximum(share, one)
    return fibre_images.finished(rng, recipe, share), [first, second], gap


def field_of_twenty(seed: int) -> tuple[np.ndarray, list[np.ndarray]]:
    """Return twenty fibres anywhere, which may lie on each other."""
    rng = np.random.default_rng(700_000 + seed)
    recipe = fibre_images.Recipe(length_px=(150.0, 500.0), width_px=(6.0, 14.0), specks=25)
    share = np.zeros(recipe.shape, np.float32)
    lines = []
    while len(lines) < 20:
        width = float(rng.uniform(*recipe.width_px))
        line = fibre_images.placed(rng, recipe, width)
        if line is not None:
            lines.append(line)
            one = fibre_images.Truth(line, width)
            share = np.maximum(share, fibre_images.coverage(recipe.shape, one, width))
    return fibre_images.finished(rng, recipe, share), lines


def wrong(found: Iterable[Case]) -> int:
    """Return how many are certain and wrong."""
    return sum(case.fibre.certain and not case.right for case in found)


@dataclass(slots=True)
class Counted:
    """What came out of a row of images."""

    images: int = 0
    wrong: int = 0
    certain: int = 0
    both: int = 0
    apart: int = 0
    inside: int = 0
    right: int = 0


def pairs(seeds: Iterable[int], *, jpeg: bool | None) -> Iterator[tuple[Drawn, list[Case]]]:
    """Yield drawn pairs of the three kinds in turn."""
    for seed in seeds:
        one = draw(PAIRS[seed % 3], seed, jpeg=jpeg, large=seed % 7 < 2)
        yield one, drawn_cases(one)


def rows(count: int) -> list[Figure]:
    """Return the figures of pairs, singles, JPEGs and fields."""
    told, untold = Counted(), Counted()
    for one, found in pairs(CHECKED[:count], jpeg=None):
        here = told if tellable(one) else untold
        here.images += 1
        here.wrong += wrong(found)
        if one.gap_widths >= 0.5:
            here.apart += 1
            here.both += sum(case.right for case in found) == 2
    jpeg = [wrong(found) for one, found in pairs(CHECKED[: count // 2], jpeg=True) if tellable(one)]
    single = Counted()
    for seed in CHECKED[: count // 4]:
        drawn = drawn_cases(draw(Kind.SINGLE, seed, jpeg=False, large=seed % 7 < 2))
        single.images += 1
        single.wrong += wrong(drawn)
        single.certain += any(case.fibre.certain and case.right for case in drawn)
        for case in drawn:
            if case.fibre.certain and case.right:
                low, high = case.fibre.length_interval_px
                single.right += 1
                single.inside += low <= case.length_px <= high
    other, gaps, both = 0, 0, 0
    for seed in range(max(4, count // 5)):
        image, lines, gap = split(seed)
        found = cases(find_fibres(image), lines)
        other += wrong(found)
        if gap >= 0.5:
            gaps += 1
            both += sum(case.right for case in found) == 2
    fields = sum(
        wrong(cases(find_fibres(image), lines))
        for image, lines in map(field_of_twenty, range(max(2, count // 100)))
    )
    images = max(4, count // 5), max(2, count // 100)

    def figure(what: str, value: float, unit: str, limit: float | None = None) -> Figure:
        return Figure(NAME, what, value, unit, limit)

    def percent(part: int, whole: int) -> float:
        return 100.0 * part / max(1, whole)

    return [
        figure("pairs, certain and wrong", told.wrong, f"of {told.images}", 0),
        figure("pairs no pixel tells from one, certain", untold.wrong, f"of {untold.images}"),
        figure(
            "gaps from half a width, not two", percent(told.apart - told.both, told.apart), "%", 10
        ),
        figure("pairs drawn in another way, certain and wrong", other, f"of {images[0]}", 0),
        figure("their gaps from half a width, not two", percent(gaps - both, gaps), "%", 10),
        figure("JPEG of quality 10 to 95, certain and wrong", sum(jpeg), f"of {len(jpeg)}", 0),
        figure("fields of twenty, certain and wrong", fields, f"of {images[1]}", 0),
        figure(
            "single fibres, not certain",
            percent(single.images - single.certain, single.images),
            "%",
            5,
        ),
        figure("single fibres, certain and wrong", single.wrong, f"of {single.images}", 0),
        figure(
            "length outside its 95 % interval",
            percent(single.right - single.inside, single.right),
            "%",
            5,
        ),
    ]


def photographs(folder: Path) -> list[Figure]:
    """Return how many fibres on photographs are certain."""
    files = sorted(each for each in folder.iterdir() if each.suffix in (".jpg", ".png", ".tif"))
    certain = 0
    for file in files:
        pixels = cv2.imread(str(file), cv2.IMREAD_COLOR)
        if pixels is not None:
            fibres = find_fibres(pixels)
            certain += any(fibre.certain for fibre in fibres)
    return [Figure(NAME, "photographs with a certain fibre", certain, f"of {len(files)}")]


def measure(quick: bool, images: Path | None = None, count: int = len(CHECKED)) -> list[Figure]:
    """Measure everything, on `count` pairs and fewer of the rest."""
    cv2.setNumThreads(1)
    return rows(40 if quick else count) + (photographs(images) if images else [])


def print_fit() -> None:
    """Print the weights."""
    cv2.setNumThreads(1)
    state, odds, width = fit(FITTED)
    for name, weight in zip((*certainty.NAMES, "alone"), state, strict=True):
        sys.stdout.write(f"{name}: {weight:.2f}\n")
    sys.stdout.write(f"right for each wrong: {odds:.2f}\n")
    sys.stdout.write(f"95 % of lengths lie within {width:.2f} standard deviations\n")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(add_help=False)
    parser.add_argument("--images", type=Path)
    parser.add_argument("--fit", action="store_true")
    parser.add_argument("--count", type=int, default=len(CHECKED))
    chosen, sys.argv[1:] = parser.parse_known_args()
    if chosen.fit:
        print_fit()
    else:
        figures.main(__doc__, partial(measure, images=chosen.images, count=chosen.count))
