"""Strips of drawn fibres whose joints are known, for `joint_training` to learn from.

`python -m benchmarks.joint_strips FOLDER` draws single fibres and pairs of `fibre_pairs`, and some
of `fibre_images`, finds them, and keeps the strip of each with where on it a drawn fibre ends;
`--processes 2` does it in two processes, with the same result. Each image of `fibre_pairs` is taken
three times, with other noise and as JPEG, and five times with fibres uneven in another way on the
same lines. Nothing that is drawn is what the weights of the certainty are fitted to, or checked on.
"""

import argparse
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from unittest.mock import patch

import cv2
import numpy as np
from scipy.spatial import cKDTree

from benchmarks import certainty as benchmark
from benchmarks import fibre_images, fibre_pairs
from benchmarks.fibre_pairs import TOLD_APART, Kind, Piece, View
from cosmic.vico.api import find_fibres
from cosmic.vico.core.vision import learned_joint
from cosmic.vico.core.vision.learned_joint import Strip
from cosmic.vico.core.vision.profiles import Scene, cross_sections
from cosmic.vico.core.vision.refine import Course
from cosmic.vico.core.vision.relief import blockiness
from cosmic.vico.core.vision.smoothing import arc_lengths

KINDS = (Kind.SINGLE, *benchmark.PAIRS, Kind.SINGLE, *benchmark.PAIRS)
TAKEN, AGAIN = 3, 5
"""So often is each image taken, each time with other noise, and so often is it drawn again."""
SOURCES = {"pairs": range(1_000_000, 1_020_000), "other": range(200_000, 202_000)}
MARGIN_PX, LEAST_PX2 = 56.0, 60_000.0
"""How far an image reaches beyond its fibres, and how large it is at least."""
PART = 50
BESIDE, AROUND = 0.5, 1.25
"""Widths beside an end that is drawn: up to the first it is a joint, from the second on none."""


@dataclass(frozen=True, slots=True, eq=False)
class Known:
    """A strip, and where one fibre ends on it.

    Attributes
    ----------
    ends : ndarray, shape (n,), int8
        At each answer of the network 1 where one ends, 0 where none does, -1 where nobody knows.
    """

    strip: Strip
    ends: np.ndarray
    seed: int


def ends_on(course: Course, points: np.ndarray, count: int, *, right: bool) -> np.ndarray | None:
    """Return where on a course fibres end, at `count` points; None where it is not known.

    Parameters
    ----------
    points : ndarray, shape (n, 2)
        Where one drawn fibre ends and another begins.
    """
    ends = np.zeros(count, np.int8)
    s = arc_lengths(course.line)
    if not len(points):
        return ends if right else None
    away, index = cKDTree(course.line).query(points)
    on = s[index]
    inside = (away < 1.5 * course.width) & (on > course.width) & (on < s[-1] - course.width)
    if not inside.any():
        return ends if right else None
    if right or not inside.all():
        return None
    at = (np.arange(count) + 0.5) / count * s[-1]
    off = np.maximum(on.min() - at, at - on.max()) / course.width
    ends[off < AROUND] = -1
    ends[off < BESIDE] = 1
    return ends


def found_on(
    image: np.ndarray, lines: list[np.ndarray], points: np.ndarray
) -> list[tuple[Scene, Course, np.ndarray]]:
    """Return what is found on an image, as far as it is known where fibres end on it."""
    # What the network there is says of it decides nothing here, and there may be none.
    unasked = patch.object(learned_joint, "clearest", return_value=None)
    with benchmark.recorded() as traced, unasked:
        cases = benchmark.cases(find_fibres(image), lines)
    found = []
    for case in cases:
        if set(case.fibre.doubts) - benchmark.OWN:
            continue
        own = benchmark.of_fibre(traced, case.fibre)
        strip = learned_joint.strip_of(own.scene, own.course)
        if strip is None:
            continue
        ends = ends_on(own.course, points, len(strip.where), right=case.right)
        if ends is not None:
            found.append((own.scene, own.course, ends))
    return found


def from_pairs(seed: int) -> list[Known]:
    """Return what is learnt from one drawn image, taken and drawn again."""
    kind = KINDS[seed % len(KINDS)]
    rng = np.random.default_rng([seed, 7])
    there, gap, view = fibre_pairs.composed(rng, kind, jpeg=None, large=seed % 7 < 2)
    there, view = trimmed(there, view)
    light = fibre_pairs.light_of(rng, view)
    clean = fibre_pairs.without_noise(there, view, light)
    image = fibre_pairs.taken_with(rng, view, clean)
    points, apart = np.zeros((0, 2)), np.inf
    if kind is not Kind.SINGLE:
        points = np.array([there[0].line_px[-1], there[1].line_px[0]])
        one = fibre_pairs.as_one(there[0], there[1], gap)
        apart = fibre_pairs.difference(one, image, clean, view, light)
    found = found_on(image, [each.line_px for each in there], points)
    known = []
    for number in range(TAKEN + AGAIN if found else 0):
        again, taken, far = view, image, apart
        if number:
            quality = int(rng.integers(10, 96)) if rng.integers(0, 2) else None
            again = replace(view, noise=float(rng.uniform(1.0, 6.0)), jpeg=quality)
            drawn_now = clean
            if number >= TAKEN:
                others = [uneven(rng, each, view) for each in there]
                drawn_now = fibre_pairs.without_noise(others, again, light)
            taken = fibre_pairs.taken_with(rng, again, drawn_now)
            far = apart * view.noise / again.noise
            if number >= TAKEN and any(ends.any() for _, _, ends in found):
                one = fibre_pairs.as_one(others[0], others[1], gap)
                far = fibre_pairs.difference(one, taken, drawn_now, again, light)
        for scene, course, ends in found:
            if ends.any() and far < TOLD_APART:
                continue
            strip = learned_joint.strip_of(*retaken(scene, course, taken))
            if strip is not None and len(strip.where) == len(ends):
                known.append(Known(strip, ends, seed))
    return known


def trimmed(there: list[Piece], view: View) -> tuple[list[Piece], View]:
    """Return fibres on an image no larger than it need be, which is drawn and looked at sooner."""
    points = np.concatenate([each.line_px for each in there])
    size = np.ptp(points, axis=0) + 2.0 * MARGIN_PX
    # What is small beside its fibre is looked at in another way, and has no dust.
    size *= np.sqrt(max(1.0, LEAST_PX2 / np.prod(size)))
    size = np.minimum(np.ceil(size), view.shape[::-1])
    centre = 0.5 * (points.min(axis=0) + points.max(axis=0))
    low = np.clip(np.floor(centre - 0.5 * size), 0.0, view.shape[::-1] - size)
    columns, rows = size.astype(int)
    moved = [replace(each, line_px=each.line_px - low) for each in there]
    return moved, replace(view, shape=(int(rows), int(columns)))


def uneven(rng: np.random.Generator, one: Piece, view: View) -> Piece:
    """Return a fibre on the same line, as wide and as dark, but uneven in another way."""
    width, taken = float(one.width_px.mean()), float(one.taken.mean())
    rough = float(rng.choice([0.0, 0.02, 0.05, 0.08]))
    other = fibre_pairs.unevenness(rng, one.line_px, width, rough)
    return fibre_pairs.shaded(replace(other, taken=np.clip(taken * other.taken, 0.3, 1.45)), view)


def retaken(scene: Scene, course: Course, image: np.ndarray) -> tuple[Scene, Course]:
    """Return what was found on an image, on the same one with other noise."""
    scene = replace(scene, image=image.astype(np.float32), blockiness=blockiness(image))
    margin = 2.0 + 2.0 * min(course.blur_px, 0.3 * course.width)
    reach = 1.2 * course.width + 6.0 + margin
    noise = cross_sections(scene, course.line, course.width, reach, margin).noise
    return scene, replace(course, noise=noise)


def from_other(seed: int) -> list[Known]:
    """Return what is learnt from an image drawn in the other way."""
    points = np.zeros((0, 2))
    if seed % 25 == 0:
        image, lines = benchmark.field_of_twenty(seed + 300_000)
    elif seed % 2:
        image, lines, _ = benchmark.split(seed)
        points = np.array([lines[0][-1], lines[1][0]])
    else:
        rng = np.random.default_rng(seed)
        recipe = fibre_images.Recipe(
            shape=(720, 960),
            length_px=(250.0, 700.0) if seed % 8 else (900.0, 1600.0),
            width_px=(5.0, 36.0) if seed % 4 == 0 else (5.0, 18.0),
            contrast=float(rng.choice([-1.0, 1.0, 1.0]) * rng.uniform(20.0, 60.0)),
            ground=float(rng.uniform(80.0, 150.0)),
            noise=float(rng.uniform(1.0, 10.0)),
            blur_px=float(rng.uniform(0.7, 4.0)),
            specks=int(rng.integers(0, 30)),
            turns=float(rng.uniform(0.1, 2.0)) if seed % 8 else 3.0,
            lumen=float(rng.choice([0.0, 0.0, 0.5])),
            crossing=seed % 8 == 0,
        )
        image, truths = fibre_images.draw(recipe, seed + 1_000_000)
        lines = [each.line_px for each in truths]
    return [
        Known(strip, ends, seed) for scene, course, ends in found_on(image, lines, points)
        if (strip := learned_joint.strip_of(scene, course)) is not None
    ]  # fmt: skip


def drawn(folder: Path, source: str, seeds: Sequence[int]) -> None:
    """Draw images and keep what is learnt from them in a file."""
    file = folder / f"{source}_{seeds[0]}.npz"
    if file.exists():
        return
    one = from_pairs if source == "pairs" else from_other
    known = [each for seed in seeds for each in one(seed)]
    kept = folder / f"{file.stem}_unfinished.npz"
    np.savez(
        kept,
        counts=np.array([len(each.ends) for each in known]),
        levels=np.concatenate([each.strip.levels.astype(np.float16) for each in known]),
        where=np.concatenate([each.strip.where for each in known]),
        ends=np.concatenate([each.ends for each in known]),
        facts=np.array([each.strip.facts for each in known]),
        seeds=np.array([each.seed for each in known]),
    )
    kept.rename(file)


def draw_all(folder: Path, processes: int) -> None:
    """Draw all images; files that exist are kept."""
    folder.mkdir(parents=True, exist_ok=True)
    parts = [
        (source, seeds[first : first + PART]) for source, seeds in SOURCES.items()
        for first in range(0, len(seeds), PART)
    ]  # fmt: skip
    # In an order that gives of each source early.
    parts.sort(key=lambda part: (part[1][0] - SOURCES[part[0]][0]) / len(SOURCES[part[0]]))
    with ProcessPoolExecutor(processes, initializer=cv2.setNumThreads, initargs=(1,)) as pool:
        list(pool.map(partial(drawn, folder), *zip(*parts, strict=True)))


def loaded(folder: Path) -> list[Known]:
    """Return what was drawn."""
    known = []
    for file in sorted(folder.glob("*.npz")):
        if file.stem.endswith("unfinished"):
            continue
        with np.load(file) as kept:
            counts = kept["counts"]
            stops = np.cumsum(counts)[:-1]
            levels = np.split(kept["levels"], learned_joint.STRIDE * stops)
            where, ends = np.split(kept["where"], stops), np.split(kept["ends"], stops)
            facts, seeds = kept["facts"], kept["seeds"]
        known += [
            Known(Strip(*each[:3]), each[3], int(each[4]))
            for each in zip(levels, where, facts, ends, seeds, strict=True)
        ]
    return known


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--processes", type=int, default=1)
    asked = parser.parse_args()
    draw_all(asked.folder, asked.processes)
