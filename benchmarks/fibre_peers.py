"""Fibres measured by CoSMic and by others on the same drawn images, in one run.

The others are what a laboratory would take from PyPI: Otsu's threshold with the skeleton of
scikit-image and the lengths of skan, and Steger's lines by ridge-detector. They are given what
they need to know: which side is darker, and the range of widths. `benchmarks/peers.txt` says how
they are installed; without them there is only our own row.
"""

import importlib.util
import statistics
import time
from collections.abc import Callable
from functools import cache
from typing import Any

import cv2
import numpy as np

from benchmarks import figures
from benchmarks.fibre_images import Recipe, Truth, draw
from benchmarks.figures import Figure, percentile
from cosmic.vico.api import find_fibres

NAME = "fibre_peers"
ROWS = {
    "plain": Recipe(shape=(480, 640), length_px=(200.0, 450.0), width_px=(6.0, 12.0), specks=6),
    "noise 8": Recipe(
        shape=(480, 640), length_px=(200.0, 450.0), width_px=(6.0, 12.0), specks=6, noise=8.0
    ),
    "crossing itself": Recipe(
        shape=(480, 640),
        length_px=(450.0, 900.0),
        width_px=(6.0, 9.0),
        specks=0,
        crossing=True,
        turns=3.0,
    ),
}
IMAGES = 12
LOST = 100.0
"""Error of an image on which nothing is found, %."""

Method = Callable[[np.ndarray], float]


def ours(image: np.ndarray) -> float:
    """Return the length of the longest fibre that is found."""
    found = find_fibres(image)
    return found[0].length_px if found else 0.0


def skeleton_and_skan(image: np.ndarray) -> float:
    """Return the length of the largest skeleton of Otsu's mask, uneven light taken away before."""
    from skimage.morphology import skeletonize

    skan: Any = importlib.import_module("skan")
    smooth = cv2.GaussianBlur(image, (0, 0), 1.5)
    even = cv2.morphologyEx(smooth, cv2.MORPH_BLACKHAT, np.ones((41, 41), np.uint8))
    _, mask = cv2.threshold(even, 0, 1, cv2.THRESH_BINARY | cv2.THRESH_OTSU)
    _, labels, stats, _ = cv2.connectedComponentsWithStats(mask)
    largest = 1 + int(np.argmax(stats[1:, cv2.CC_STAT_AREA]))
    skeleton = skeletonize(labels == largest)
    table = skan.summarize(skan.Skeleton(skeleton), separator="-")
    return float(table["branch-distance"].sum())


def steger(image: np.ndarray) -> float:
    """Return the length of the longest of Steger's lines."""
    module: Any = importlib.import_module("ridge_detector")
    detector = module.RidgeDetector(
        line_widths=np.arange(6, 13, 3), low_contrast=15, high_contrast=40, dark_line=True
    )
    detector.detect_lines(cv2.cvtColor(image, cv2.COLOR_GRAY2BGR))
    lengths = [
        float(np.hypot(np.diff(each.row), np.diff(each.col)).sum()) for each in detector.contours
    ]
    return max(lengths, default=0.0)


@cache
def methods() -> dict[str, Method]:
    """Return the methods that are installed."""
    found: dict[str, Method] = {"CoSMic": ours}
    if importlib.util.find_spec("skan"):
        found["Otsu, skeleton, skan"] = skeleton_and_skan
    if importlib.util.find_spec("ridge_detector"):
        found["Steger (ridge-detector)"] = steger
    return found


def length_of(truths: list[Truth]) -> float:
    """Return the length of the one fibre that was drawn."""
    return truths[0].length_px


def measure(quick: bool) -> list[Figure]:
    """Measure everything."""
    cv2.setNumThreads(1)
    result = []
    for name, recipe in ROWS.items():
        drawn = [draw(recipe, seed) for seed in range(2 if quick else IMAGES)]
        for method, length in methods().items():
            length(drawn[0][0])  # what is compiled or loaded at first
            errors, times = [], []
            for image, truths in drawn:
                began = time.thread_time()
                found = length(image)
                times.append(1e3 * (time.thread_time() - began))
                true = length_of(truths)
                errors.append(min(LOST, 100.0 * abs(found - true) / true))
            title = f"{name}, {method}"
            median = statistics.median(errors)
            result += [
                Figure(NAME, f"{title}: length error, median", median, "%"),
                Figure(NAME, f"{title}: length error, p95", percentile(errors, 95), "%"),
                Figure(NAME, f"{title}: processor time", statistics.median(times), "ms"),
            ]
    return result


if __name__ == "__main__":
    figures.main(__doc__, measure)
