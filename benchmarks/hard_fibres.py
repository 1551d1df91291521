"""What is hard on an image of fibres: crossings at small angles, bundles, twenty on one, blur.

Drawn in the way of `fibre_images`, whose images the certainty is not calibrated on, with seeds of
its own. A fibre is found where its length is right within 1 % and its ends are where they were
drawn; on images of what is no fibre (scratches, marks of a frame, empty plates) nothing may be
certain. A bundle is handled where each fibre of it is found, or all of it is called a bundle or
doubted, and nothing is certain and wrong.
"""

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
from scipy.spatial import cKDTree

from benchmarks import fibre_images, figures
from benchmarks.certainty import Case, cases, wrong
from benchmarks.fibre_images import Recipe, Truth
from benchmarks.figures import Figure
from cosmic.vico.api import find_fibres

NAME = "hard_fibres"
PART = 0.01
SMALL = Recipe(shape=(720, 960), length_px=(350.0, 600.0), width_px=(7.0, 14.0), specks=4)
FIELD = Recipe(length_px=(150.0, 500.0), width_px=(6.0, 14.0), turns=1.2)
IMAGES = 20

Drawn = tuple[np.ndarray, list[np.ndarray]]


def finished(rng: np.random.Generator, recipe: Recipe, truths: list[Truth]) -> Drawn:
    """Return an image of fibres, and their lines."""
    share = np.zeros(recipe.shape, np.float32)
    for each in truths:
        one = fibre_images.coverage(recipe.shape, each, each.width_px)
        share = np.maximum(share, one)
    return fibre_images.finished(rng, recipe, share), [each.line_px for each in truths]


def bow(length: float, turn: float) -> np.ndarray:
    """Return an even bow about (0, 0), along x there."""
    s = np.arange(0.0, length, fibre_images.STEP_PX) - 0.5 * length
    angle = turn * s / length
    steps = np.column_stack([np.cos(angle), np.sin(angle)]) * fibre_images.STEP_PX
    line = np.cumsum(steps, axis=0)
    return line - line[len(line) // 2]


def laid(line: np.ndarray, angle: float, at: np.ndarray) -> np.ndarray:
    """Return a line turned about (0, 0) and moved."""
    cos, sin = np.cos(angle), np.sin(angle)
    return line @ np.array([[cos, sin], [-sin, cos]]) + at


def shallow(seed: int) -> Drawn:
    """Return two fibres that cross at 10 to 18 degrees."""
    rng = np.random.default_rng([81, seed])
    lean = float(rng.uniform(0.0, 6.28))
    cross = np.radians(rng.uniform(10.0, 18.0)) * rng.choice([-1.0, 1.0])
    truths = []
    for angle in (lean, lean + cross):
        line = bow(float(rng.uniform(400.0, 560.0)), float(rng.uniform(-0.3, 0.3)))
        at = np.array([480.0, 360.0]) + rng.uniform(-30.0, 30.0, 2) * (not truths)
        at = at if not truths else truths[0].line_px[len(truths[0].line_px) // 2]
        truths.append(Truth(laid(line, angle, at), float(rng.uniform(7.0, 12.0))))
    return finished(rng, SMALL, truths)


def bundle(seed: int) -> Drawn:
    """Return three fibres that run beside each other, a third to a whole width apart."""
    rng = np.random.default_rng([82, seed])
    lean, width = float(rng.uniform(0.0, 6.28)), float(rng.uniform(7.0, 12.0))
    turn, apart = float(rng.uniform(-0.6, 0.6)), float(rng.uniform(0.3, 1.0))
    truths = []
    for number in (-1, 0, 1):
        line = bow(float(rng.uniform(380.0, 520.0)), turn)
        aside = number * width * (1.0 + apart) * np.array([-np.sin(lean), np.cos(lean)])
        along = rng.uniform(-40.0, 40.0) * np.array([np.cos(lean), np.sin(lean)])
        truths.append(Truth(laid(line, lean, np.array([480.0, 360.0]) + aside + along), width))
    return finished(rng, SMALL, truths)


def loose(seed: int, *, apart_widths: float = 2.0) -> Drawn:
    """Return twenty fibres of which none touches another."""
    rng = np.random.default_rng([83, seed])
    truths: list[Truth] = []
    while len(truths) < 20:
        width = float(rng.uniform(*FIELD.width_px))
        line = fibre_images.placed(rng, FIELD, width)
        if line is None:
            continue
        others = [each.line_px[::8] for each in truths]
        near = cKDTree(np.concatenate(others)).query(line[::4])[0].min() if others else np.inf
        if near > apart_widths * 14.0:
            truths.append(Truth(line, width))
    return finished(rng, FIELD, truths)


def blurred(seed: int) -> Drawn:
    """Return one fibre, blurred by 4 pixels."""
    recipe = Recipe(shape=(720, 960), length_px=(350.0, 700.0), blur_px=4.0, specks=8)
    image, truths = fibre_images.draw(recipe, 82_000 + seed)
    return image, [each.line_px for each in truths]


def scratched(seed: int) -> Drawn:
    """Return scratches that fade at their ends, or the marks of a frame, and no fibre."""
    rng = np.random.default_rng([84, seed])
    share = np.zeros(SMALL.shape, np.float32)
    if seed % 2:
        left, top = (int(v) for v in rng.integers(60, 200, 2))
        right, low = int(rng.integers(600, 900)), int(rng.integers(450, 660))
        thick, arm = int(rng.integers(3, 9)), int(rng.integers(60, 160))
        for x, y, across, down in (
            (left, top, 1, 1), (right, top, -1, 1), (left, low, 1, -1), (right, low, -1, -1),
        ):  # fmt: skip
            cv2.line(share, (x, y), (x + across * arm, y), 1.0, thick)
            cv2.line(share, (x, y), (x, y + down * arm), 1.0, thick)
    for _ in range(3 if seed % 2 == 0 else 0):
        line = laid(
            bow(float(rng.uniform(200.0, 500.0)), float(rng.uniform(-0.05, 0.05))),
            float(rng.uniform(0.0, 6.28)),
            rng.uniform([250.0, 250.0], [700.0, 470.0]),
        )
        depth = np.sin(np.linspace(0.0, np.pi, len(line))) ** 0.7 * rng.uniform(0.3, 0.8)
        for point, value in zip(line[::4], depth[::4], strict=True):
            x, y = np.round(point * 16.0).astype(int)
            cv2.circle(share, (int(x), int(y)), 24, float(value), -1, shift=4)
    return fibre_images.finished(rng, SMALL, share), []


def empty(seed: int) -> Drawn:
    """Return a plate without fibres, with noise and dust."""
    rng = np.random.default_rng([85, seed])
    noise, specks = float(rng.uniform(1.0, 12.0)), int(rng.integers(0, 60))
    recipe = Recipe(shape=(720, 960), noise=noise, specks=specks)
    return fibre_images.finished(rng, recipe, np.zeros(recipe.shape, np.float32)), []


@dataclass(slots=True)
class Row:
    """What came out of a row of images."""

    images: int = 0
    drawn: int = 0
    found: int = 0
    certain: int = 0
    inside: int = 0
    wrong: int = 0
    whole: int = 0
    handled: int = 0

    def add(self, lines: list[np.ndarray], found: list[Case]) -> None:
        """Count one image."""
        right = [
            case for case in found
            if case.right and abs(case.fibre.length_px / case.length_px - 1.0) < PART
        ]  # fmt: skip
        sure = [case for case in right if case.fibre.certain]
        bad = wrong(found)
        self.images += 1
        self.drawn += len(lines)
        self.found += len(right)
        self.certain += len(sure)
        self.wrong += bad
        self.whole += len(right) == len(lines)
        self.handled += not bad and (len(right) == len(lines) or (bool(found) and not sure))
        for case in sure:
            low, high = case.fibre.length_interval_px
            self.inside += low <= case.length_px <= high


def row(draw: Callable[[int], Drawn], seeds: range) -> Row:
    """Return what is found on a row of images."""
    result = Row()
    for seed in seeds:
        image, lines = draw(seed)
        result.add(lines, cases(find_fibres(image), lines))
    return result


def measure(quick: bool, first: int = 0) -> list[Figure]:
    """Measure everything."""
    cv2.setNumThreads(1)

    def seeds(count: int) -> range:
        return range(first, first + (2 if quick else count))

    crossed, bundled = row(shallow, seeds(IMAGES)), row(bundle, seeds(IMAGES))
    field, soft = row(loose, seeds(IMAGES // 2)), row(blurred, seeds(2 * IMAGES))
    nothing, scratches = row(empty, seeds(2 * IMAGES)), row(scratched, seeds(2 * IMAGES))
    every = (crossed, bundled, field, soft, nothing, scratches)
    missed = (
        ("crossings of 10 to 18 degrees, both not found", crossed.whole, crossed.images, 20),
        ("bundles of three, not told apart", bundled.whole, bundled.images, None),
        ("bundles of three, not told apart nor doubted", bundled.handled, bundled.images, 20),
        ("twenty loose fibres, not found", field.found, field.drawn, 5),
        ("twenty loose fibres, not certain", field.certain, field.drawn, None),
        ("blur of 4 px, not certain", soft.certain, soft.drawn, 30),
        ("blur of 4 px, length outside its 95 % interval", soft.inside, soft.certain, 5),
    )
    wrongly = (
        ("empty plates, certain", nothing.wrong, nothing.images),
        ("scratches and marks of a frame, certain", scratches.wrong, scratches.images),
        ("all, certain and wrong", sum(x.wrong for x in every), sum(x.images for x in every)),
    )  # fmt: skip
    return [
        *(
            Figure(NAME, what, 100.0 * (1.0 - part / max(1, of)), "%", limit)
            for what, part, of, limit in missed
        ),
        *(Figure(NAME, what, bad, f"of {of}", 0) for what, bad, of in wrongly),
    ]


if __name__ == "__main__":
    figures.main(__doc__, measure)
