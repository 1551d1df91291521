"""Is what is certain right, and what is right certain? And the weights of that certainty.

`--fit` draws the populations `FITTED`, finds their fibres and prints the weights as they stand in
`cosmic.vico.core.vision.certainty`; `--processes 2` does it in two processes, with the same result.
Without it they are checked: on images of `fibre_pairs` that were not fitted, on pairs drawn in the
other way of `fibre_images`, on JPEG and on fields of twenty. `--images FOLDER` counts the certain
ones on photographs as well; `--count N` draws N pairs.
"""

import argparse
import sys
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from unittest.mock import patch

import cv2
import numpy as np
from scipy.optimize import minimize

from benchmarks import fibre_images, figures
from benchmarks.fibre_pairs import TOLD_APART, Drawn, Kind, draw
from benchmarks.figures import Figure
from cosmic.frame.arrays import ByteMask
from cosmic.vico.api import Fibre, find_fibres
from cosmic.vico.core.vision import axial, beyond, certainty
from cosmic.vico.core.vision.profiles import Scene
from cosmic.vico.core.vision.refine import Course

NAME = "certainty"
PAIRS = (Kind.TOUCHING, Kind.OVERLAPPING, Kind.GAP)
CHECKED = range(50_000, 52_000)
LENGTH_PART = 0.03
OWN = {axial.GAP, axial.DOUBLED, axial.STEP, beyond.GOES_ON, beyond.SOFT, certainty.IMPROBABLE}
GRIP = 1e-4
"""How strongly weights are kept small in the fit."""
LEAST_WEIGHT = 0.1
ROUNDS = 8
FIRST_WEIGHT, FIRST_LOGIT = 1.5, 8.0
PART = 50
"""Images that a process looks at before it takes others."""


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


@dataclass(frozen=True, slots=True, eq=False)
class Traced:
    """Something that was found: where it lies, and its signs all along."""

    scene: Scene
    course: Course
    signs: certainty.Signs


@contextmanager
def recorded() -> Iterator[list[Traced]]:
    """Keep everything that is found meanwhile."""
    found: list[Traced] = []

    def signs_of(scene: Scene, course: Course, explained: ByteMask) -> certainty.Signs:
        found.append(Traced(scene, course, original(scene, course, explained)))
        return found[-1].signs

    original = certainty.signs_of
    with patch.object(certainty, "signs_of", signs_of):
        yield found


@dataclass(frozen=True, slots=True, eq=False)
class Example:
    """One fibre that was found, to learn from: its signs, and whether it is right.

    Attributes
    ----------
    pull : float or None
        Error of the length of a whole fibre without a sign, in standard deviations.
    """

    signs: certainty.Signs
    right: bool
    pull: float | None


@dataclass(frozen=True, slots=True)
class Population:
    """Images that are drawn to learn from.

    Attributes
    ----------
    jpeg : bool or None
        Whether they are compressed; None: one of three.
    """

    kinds: tuple[Kind, ...]
    seeds: range
    jpeg: bool | None = None

    def draw(self, seed: int, *, compare: bool) -> Drawn:
        """Return one image; two of seven are large."""
        kind = self.kinds[seed % len(self.kinds)]
        return draw(kind, seed, jpeg=self.jpeg, large=seed % 7 < 2, compare=compare)


FITTED = (
    Population((Kind.SINGLE,), range(320_000, 322_000)),
    Population((Kind.SINGLE,), range(320_000, 322_000, 2), jpeg=False),
    Population(PAIRS, range(300_000, 303_000)),
    # More JPEG among the pairs than among the single fibres: what is certain on JPEG is to be right
    # in a thousand, and what compression hides gives no sign.
    Population(PAIRS, range(330_000, 331_000), jpeg=True),
    Population((Kind.GOES_ON,), range(335_000, 335_300)),
)
"""What the weights are fitted to: nothing of it is checked."""


def thinned(signs: certainty.Signs) -> certainty.Signs:
    """Return signs without the places at which none is above noise."""
    along = signs.joints.along
    kept = (along > certainty.NOISE).any(axis=0)
    kept[0] |= not kept.any()
    return replace(signs, joints=replace(signs.joints, along=along[:, kept].astype(np.float32)))


def examples(population: Population, seeds: Iterable[int]) -> list[Example]:
    """Return what is found on images of a population, as far as signs decide about it."""
    found = []
    for seed in seeds:
        one = population.draw(seed, compare=False)
        with recorded() as traced:
            on_image = drawn_cases(one)
        kept = [each for each in on_image if learnable(each, one.kind)]
        wrongs = one.kind in PAIRS and any(not case.right for case in kept)
        if wrongs and not tellable(population.draw(seed, compare=True)):
            continue
        for case in kept:
            own = of_fibre(traced, case.fibre).signs
            pull = None
            if case.right and not own.doubts:
                pull = abs(case.fibre.length_px - case.length_px) / case.fibre.length_std_px
            found.append(Example(thinned(own), case.right, pull))
    return found


def of_fibre(traced: Iterable[Traced], fibre: Fibre) -> Traced:
    """Return what became a fibre."""
    return next(each for each in traced if each.signs.values == fibre.signs)


def learnable(case: Case, kind: Kind) -> bool:
    """Return whether signs decide about what was found.

    Other doubts decide by themselves; what is wrong on an image of one fibre is no joint; what
    thins and is found whole shows all signs of what it is not.
    """
    if set(case.fibre.doubts) - OWN:
        return False
    return not case.right if kind is Kind.GOES_ON else case.right or kind is not Kind.SINGLE


def learned(populations: Iterable[Population], processes: int = 1) -> list[Example]:
    """Return what is found on all images of some populations."""
    parts = [
        (each, each.seeds[first : first + PART]) for each in populations
        for first in range(0, len(each.seeds), PART)
    ]  # fmt: skip
    if processes == 1:
        return [one for part in parts for one in examples(*part)]
    with ProcessPoolExecutor(processes, initializer=cv2.setNumThreads, initargs=(1,)) as pool:
        return [one for found in pool.map(examples, *zip(*parts, strict=True)) for one in found]


def fit(known: Sequence[Example], count: int = len(certainty.NAMES)) -> np.ndarray:
    """Return the weights of the first `count` signs and, last, the logit where there is none.

    The right and the wrong ones count as much together, however many they are. A joint is in one
    place: of each fibre the signs of the place count where together they weigh most. Which that is
    depends on the weights, so that both are found in turn.
    """
    right = np.array([each.right for each in known])
    y = np.where(right, 1.0, -1.0)
    share = np.where(right, 0.5 / max(right.mean(), 1e-9), 0.5 / max(1.0 - right.mean(), 1e-9))
    state = np.append(np.full(count, FIRST_WEIGHT), FIRST_LOGIT)
    for number in range(ROUNDS):
        x = np.array([each.signs.weighed_by(state[:-1]) for each in known])

        def loss(state: np.ndarray, x: np.ndarray = x) -> tuple[float, np.ndarray]:
            logit = state[-1] - x @ state[:-1]
            miss = share / (1.0 + np.exp(np.clip(y * logit, -40.0, 40.0)))
            small = GRIP * float(state[:-1] @ state[:-1])
            value = (share * np.logaddexp(0.0, -y * logit)).mean() + small
            slope = (y * miss) @ x / len(y) + 2.0 * GRIP * state[:-1]
            return float(value), np.append(slope, -(y * miss).mean())

        bounds = [(LEAST_WEIGHT, None)] * x.shape[1] + [(None, None)]
        best = minimize(loss, state, jac=True, bounds=bounds, method="L-BFGS-B").x
        state = best if number == ROUNDS - 1 else 0.5 * (state + best)
    return np.asarray(state)


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


def print_fit(processes: int) -> None:
    """Print the weights as they stand in `cosmic.vico.core.vision.certainty`."""
    cv2.setNumThreads(1)
    known = learned(FITTED, processes)
    wrong_ones = sum(not each.right for each in known)
    width = np.percentile([each.pull for each in known if each.pull is not None], 95)
    sys.stdout.write(f"# {', '.join(certainty.NAMES)}\n")
    looked = [each for each in known if each.signs.joint is not None]
    plain, coded = ([each for each in looked if each.signs.coded is jpeg] for jpeg in (False, True))
    for names, of, count in (
        ("HAND_WEIGHTS, HAND_LOGIT", known, certainty.HAND_MADE),
        ("WEIGHTS, FITTED_LOGIT", plain, len(certainty.NAMES)),
        ("JPEG_WEIGHTS, JPEG_LOGIT", coded, len(certainty.NAMES)),
    ):
        *weights, alone = fit(of, count)
        written = ", ".join(f"{each:.2f}" for each in weights)
        sys.stdout.write(f"{names} = ({written}), {alone:.2f}\n")
    sys.stdout.write(f"fitted to {len(known)} that were found, {wrong_ones} of them wrong\n")
    sys.stdout.write(f"a network has looked at {len(plain)} of them, and {len(coded)} as JPEG\n")
    sys.stdout.write(f"95 % of lengths lie within {width:.2f} standard deviations\n")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(add_help=False)
    parser.add_argument("--images", type=Path)
    parser.add_argument("--fit", action="store_true")
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--count", type=int, default=len(CHECKED))
    chosen, sys.argv[1:] = parser.parse_known_args()
    if chosen.fit:
        print_fit(chosen.processes)
    else:
        figures.main(__doc__, partial(measure, images=chosen.images, count=chosen.count))
