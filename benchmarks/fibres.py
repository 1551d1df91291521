"""Fibres on drawn images of known shape: errors, doubts and time; real ones with --images.

The time is that of the processor in one thread, with OpenCV held to one; the textbook's way
(threshold at full size and skeleton) is timed in turn with it. `--images FOLDER` takes images
with masks beside them (`NAME.jpg` and `NAME_labels.npy`, 0 where there is ground).
"""

import argparse
import statistics
import sys
import time
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import cv2
import numpy as np

from benchmarks import figures
from benchmarks.fibre_images import ROWS, Recipe, Truth, draw
from benchmarks.figures import Figure, percentile
from cosmic.vico.api import Fibre, fibre_mask, find_fibres
from cosmic.vico.core.vision.graph import skeletonize

NAME = "fibres"
ORDINARY = (
    "plain",
    "lighter than the ground",
    "16 bit",
    "hollow",
    "thin",
    "thick",
    "straight",
    "three fibres",
    "small image",
)
PLAIN_IMAGES, OTHER_IMAGES, CROSSINGS = 120, 12, 24
WRONG_PERCENT = 5.0


@dataclass(frozen=True, slots=True)
class Found:
    """What became of one fibre that was drawn."""

    error_percent: float
    tip_px: float
    width_px: float
    certain: bool


def tip_error_px(fibre: Fibre, truth: Truth) -> float:
    """Return the mean distance of the ends from where they were drawn."""
    pairs = (truth.ends_px, truth.ends_px[::-1])
    errors = [np.linalg.norm(fibre.ends_px - ends, axis=1) for ends in pairs]
    return float(min(float(each.mean()) for each in errors))


def nearest(fibres: list[Fibre], truth: Truth) -> Fibre | None:
    """Return the fibre that lies best on what was drawn."""
    points = truth.line_px[::40]

    def away(fibre: Fibre) -> float:
        distance = np.linalg.norm(fibre.centre_line_px[None] - points[:, None], axis=2)
        return float(distance.min(axis=1).mean())

    return min(fibres, key=away, default=None)


def compared(fibres: list[Fibre], truth: Truth) -> Found:
    """Return how well a fibre was found; one that was missed is wholly wrong and not certain."""
    fibre = nearest(fibres, truth)
    if fibre is None:
        return Found(100.0, 1000.0, 1000.0, False)
    return Found(
        error_percent=100.0 * abs(fibre.length_px / truth.length_px - 1.0),
        tip_px=tip_error_px(fibre, truth),
        width_px=abs(fibre.width_px - truth.width_px),
        certain=fibre.certain,
    )


def cpu_ms(work: partial[object]) -> float:
    """Return the processor time of a call in this thread."""
    began = time.thread_time()
    work()
    return 1e3 * (time.thread_time() - began)


def textbook(image: np.ndarray) -> np.ndarray:
    """Return the skeleton of what is darker than Otsu's threshold."""
    grey = image if image.dtype == np.uint8 else (image >> 8).astype(np.uint8)
    _, mask = cv2.threshold(grey, 0, 1, cv2.THRESH_BINARY_INV | cv2.THRESH_OTSU)
    return np.asarray(skeletonize(mask > 0))


def row(recipe: Recipe, seeds: range) -> tuple[list[Found], list[float], int]:
    """Return what was found on the images of a row, the time of each, and false certain ones."""
    found: list[Found] = []
    times: list[float] = []
    false = 0
    for seed in seeds:
        image, truths = draw(recipe, seed)
        began = time.thread_time()
        fibres = find_fibres(image)
        times.append(1e3 * (time.thread_time() - began))
        found += [compared(fibres, truth) for truth in truths]
        false += max(0, sum(fibre.certain for fibre in fibres) - len(truths))
    return found, times, false


def summary(name: str, found: list[Found], *, targets: bool) -> list[Figure]:
    """Return the figures of one row."""
    errors = [each.error_percent for each in found]
    tips = [each.tip_px for each in found]
    widths = [each.width_px for each in found]
    unsure = 100.0 * (1.0 - statistics.mean(each.certain for each in found))

    def figure(what: str, value: float, unit: str, limit: float | None) -> Figure:
        return Figure(NAME, f"{name}: {what}", value, unit, limit if targets else None)

    return [
        figure("length error, median", statistics.median(errors), "%", 0.1),
        figure("length error, p95", percentile(errors, 95), "%", 0.5),
        figure("tip error, median", statistics.median(tips), "px", 0.5),
        figure("tip error, p95", percentile(tips, 95), "px", 1.5),
        figure("width error, p95", percentile(widths, 95), "px", 0.5),
        figure("not sure", unsure, "%", None),
    ]


def measure(quick: bool, images: Path | None = None) -> list[Figure]:
    """Measure everything."""
    cv2.setNumThreads(1)
    find_fibres(draw(ROWS["small image"], 1)[0])
    result: list[Figure] = []
    ordinary: list[Found] = []
    times: list[float] = []
    wrong = 0
    for number, (name, recipe) in enumerate(ROWS.items()):
        count = PLAIN_IMAGES if name == "plain" else OTHER_IMAGES
        count = CROSSINGS if recipe.crossing else count
        first = 1000 * number
        found, spent, false = row(recipe, range(first, first + (2 if quick else count)))
        wrong += false + sum(each.certain and each.error_percent > WRONG_PERCENT for each in found)
        result += summary(name, found, targets=name in ORDINARY)
        if name in ORDINARY:
            ordinary += found
        if recipe.shape == Recipe().shape and recipe.fibres == 1:
            times += spent
        if recipe.crossing:
            bad = sum(each.error_percent > 1.0 for each in found)
            result.append(Figure(NAME, f"{name}: off by over 1 %", bad, f"of {len(found)}", 2))
    result += summary("all ordinary rows", ordinary, targets=True)
    result.append(Figure(NAME, "certain and off by over 5 %, or not there", wrong, "fibres", 0))
    result += timing(times, quick=quick)
    return result + (real(images) if images is not None else [])


def timing(times: list[float], *, quick: bool) -> list[Figure]:
    """Return the time of an image, next to the textbook's way."""
    ratios = []
    for seed in range(2 if quick else 10):
        image = draw(ROWS["plain"], seed)[0]
        ours, theirs = cpu_ms(partial(find_fibres, image)), cpu_ms(partial(textbook, image))
        ratios.append(ours / theirs)
    return [
        Figure(NAME, "processor time of 1600 x 1200, median", statistics.median(times), "ms", 40.0),
        Figure(NAME, "processor time of 1600 x 1200, p95", percentile(times, 95), "ms"),
        Figure(NAME, "against threshold and skeleton", statistics.median(ratios), "times"),
    ]


def dice(fibres: list[Fibre], truth: np.ndarray) -> float:
    """Return how well painted fibres cover a mask: 1 is perfect."""
    painted = np.zeros(truth.shape, bool)
    for fibre in fibres:
        painted |= fibre_mask(fibre, truth.shape) > 0
    both = int((painted & truth).sum())
    return 2.0 * both / max(1, int(painted.sum()) + int(truth.sum()))


def real(folder: Path) -> list[Figure]:
    """Return how real images fared."""
    scores = []
    for labels in sorted(folder.glob("*_labels.npy")):
        stem = labels.name.removesuffix("_labels.npy")
        file = next(path for path in sorted(folder.glob(f"{stem}.*")) if path != labels)
        pixels = cv2.imread(str(file), cv2.IMREAD_COLOR)
        if pixels is None:
            continue
        scores.append(dice(find_fibres(pixels), np.load(labels) > 0))
    if not scores:
        return []
    poor = 100.0 * sum(score < 0.85 for score in scores) / len(scores)
    return [
        Figure(NAME, "real images: Dice, median", statistics.median(scores), ""),
        Figure(NAME, "real images: Dice below 0.85", poor, "%", 5.0),
    ]


if __name__ == "__main__":
    parser = argparse.ArgumentParser(add_help=False)
    parser.add_argument("--images", type=Path)
    chosen, sys.argv[1:] = parser.parse_known_args()
    figures.main(__doc__, partial(measure, images=chosen.images))
