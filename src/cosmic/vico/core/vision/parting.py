"""Strands that are more than one fibre: end to end with a gap between, or side by side.

The reduced image joins what lies less than one of its pixels apart. Where the ground shows across
a strand it is cut. Where a strand is wider than one fibre, or reads in two ways, the image is
looked at again at full size; what is found there counts where each has two ends, so that nothing is
guessed. What touches is drawn, as `bundles` says. Else the strand stays what it was, and its doubts
say so.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise, repeat
from typing import Final

import cv2
import numpy as np
from scipy.spatial import cKDTree

from cosmic.frame.arrays import ByteMask, Floats, Mask
from cosmic.vico.core.vision import axial, bundles, checks
from cosmic.vico.core.vision.bundle_strip import whole
from cosmic.vico.core.vision.ends import EndKind
from cosmic.vico.core.vision.graph import build_graph, prune
from cosmic.vico.core.vision.joining import AMBIGUOUS, FOLDED, Strand, strands
from cosmic.vico.core.vision.profiles import Scene
from cosmic.vico.core.vision.refine import STEP_PX, Course, Neighbours, lying, neighbours_of, refine
from cosmic.vico.core.vision.relief import hats, stands_out, threshold
from cosmic.vico.core.vision.smoothing import arc_lengths

BUNDLED: Final = "other fibres run close beside it, as in a bundle"
WIDEST_PX: Final = 64
LEAST_LEVELS: Final = 3.0
DEPTHS: Final = (0.6, 0.7, 0.8)
"""Of the strongest around: below, it is ground between two fibres; tried in turn."""
ON: Final = 2.0
BESIDE: Final = 6.0
"""Within so many half widths a strand lies on another, or beside it."""
MOST_FORKS: Final = 60
MOST_PARTS: Final = 8
MOST_STRANDS: Final = 24
MOST_SUSPECTS: Final = 4
"""So many of so many strands of an image are looked at again, for the sake of time."""
OWN_SPREAD: Final = 0.1
"""Of a width: one that varies by more may be that of several fibres."""
STRAY_WIDTHS: Final = 0.5
SLENDER: Final = 5.0
MARGIN_PX: Final = 16
MOSTLY: Final = 0.7


def parted_at_gaps(
    scene: Scene, kept: list[Strand], found: list[Course | None]
) -> tuple[list[Strand], list[Course | None]]:
    """Return strands and courses, each that the reduced image joins across a gap as its parts."""
    parts = [
        _cut(scene, strand, _breaks_px(scene, course))
        for strand, course in zip(kept, found, strict=True)
    ]
    if all(len(each) == 1 for each in parts):
        return kept, found
    strands_now = [part for each in parts for part in each]
    old = [
        course if len(each) == 1 else None
        for each, course in zip(parts, found, strict=True)
        for _ in each
    ]
    fresh = [len(each) > 1 for each in parts for _ in each]
    return strands_now, [
        refine(scene, strand, neighbours_of(scene, strands_now, index)) if new else course
        for index, (strand, course, new) in enumerate(zip(strands_now, old, fresh, strict=True))
    ]


def _breaks_px(scene: Scene, course: Course | None) -> Floats:
    """Return the points of a course at which the ground shows, shape (n, 2)."""
    if course is None or not (course.free & ~course.good).any():
        return np.zeros((0, 2))
    at = axial.joints(scene, course).breaks_px
    s = arc_lengths(course.line)
    return np.column_stack([np.interp(at, s, course.line[:, axis]) for axis in (0, 1)])


def _cut(scene: Scene, strand: Strand, breaks: Floats) -> list[Strand]:
    """Return a strand cut at some points; one that is closed, or crosses another, is not cut."""
    if not len(breaks) or strand.closed or strand.joints or strand.doubts:
        return [strand]
    full = scene.full(strand.points)
    cuts = [int(np.linalg.norm(full - each, axis=1).argmin()) for each in breaks]
    room = int(np.ceil(strand.half_width)) + 1
    edges = [0, *sorted(cuts), len(full)]
    pieces = [
        strand.points[first + room * (first > 0) : last - room * (last < len(full))]
        for first, last in pairwise(edges)
    ]
    long = [each for each in pieces if len(each) > SLENDER * 2 * strand.half_width]
    return [Strand(each, strand.half_width) for each in long] if len(long) > 1 else [strand]


def separated(
    scene: Scene, kept: list[Strand], found: list[Course | None], least: float
) -> tuple[list[Strand], list[Course | None]]:
    """Return strands and courses with each bundle replaced by its fibres where they are told.

    Parameters
    ----------
    least : float
        Length of the shortest fibre, full-size pixels.
    """
    if len(kept) > MOST_STRANDS:
        return kept, found
    gone: set[int] = set()
    fresh: list[tuple[Strand, Course | None]] = []
    tried: list[Mask] = []
    suspects = [
        (index, strand)
        for index, (strand, course) in enumerate(zip(kept, found, strict=True))
        if course is not None and _suspect(strand, course)
    ]
    for index, strand in suspects[:MOST_SUSPECTS]:
        if index in gone:
            continue
        separated = _separated(scene, strand, least, tried)
        fresh += separated
        parts = [part for part, _ in separated]
        gone |= {n for n, each in enumerate(kept) if parts and _covered(each, parts, ON)}
        gone |= {index} if parts else set()
    old = [each for n, each in enumerate(zip(kept, found, strict=True)) if n not in gone]
    both = [*old, *fresh]
    return [strand for strand, _ in both], [course for _, course in both]


def _separated(
    scene: Scene, strand: Strand, least: float, tried: list[Mask]
) -> list[tuple[Strand, Course | None]]:
    """Return the fibres of a bundle, none where they cannot be told apart."""
    for depth in DEPTHS:
        parts = _parts(scene, strand, least, depth)
        if len(parts) < 2 or any(part.doubts != [BUNDLED] for part in parts):
            continue
        courses = [
            refine(scene, each, neighbours_of(scene, parts, n)) for n, each in enumerate(parts)
        ]
        if _separate(courses, least) and all(map(_held, repeat(scene), parts, courses)):
            return list(zip(parts, courses, strict=True))
    return _drawn_apart(scene, strand, least, tried)


def _drawn_apart(
    scene: Scene, strand: Strand, least: float, tried: list[Mask]
) -> list[tuple[Strand, Course | None]]:
    """Return the fibres of a bundle that touch, none where drawing them does not tell them apart.

    Each is looked at without what the others look like. What was tried is added to `tried`.
    """
    own = whole(scene, strand)
    if any(np.array_equal(own, each) for each in tried):
        return []
    tried.append(own)
    bars = bundles.separated_bars(scene, own)
    if len(bars) < 2:
        return []
    parts = [
        Strand(scene.reduced(each.line), (0.5 * each.width + 0.25) / scene.factor, doubts=[BUNDLED])
        for each in bars
    ]
    courses = [
        lying(one, bar.line, bar.width, bar.blur_px, _on_it(bars, number))
        for number, (one, bar) in enumerate(zip(bundles.alone(scene, bars), bars, strict=True))
    ]
    return list(zip(parts, courses, strict=True)) if _separate(courses, least) else []


def _on_it(bars: list[bundles.Bar], number: int) -> Neighbours:
    """Return the other fibres of a bundle, as far as they lie on one: there it is not seen."""
    others = [each for n, each in enumerate(bars) if n != number]
    margins = [np.full(len(each.line), 0.5 * each.width - 2.0) for each in others]
    return Neighbours(
        cKDTree(np.concatenate([each.line for each in others])), np.concatenate(margins)
    )


def _suspect(strand: Strand, course: Course) -> bool:
    doubted = AMBIGUOUS in strand.doubts or FOLDED in strand.doubts
    wide = checks.parted(course) or checks.width_spread(course) > OWN_SPREAD
    return not strand.closed and (doubted or wide)


def _parts(scene: Scene, strand: Strand, least: float, depth: float) -> list[Strand]:
    """Return what is found around a strand at full size, in pixels of the reduced image."""
    points = scene.full(strand.points)
    room = 3.0 * strand.half_width * scene.factor + MARGIN_PX
    low = np.maximum(np.floor(points.min(axis=0) - room), 0).astype(int)
    high = np.minimum(np.ceil(points.max(axis=0) + room), scene.corner + 1).astype(int)
    mask = _mask(scene, low, high, depth)
    graph = build_graph(mask, MOST_FORKS)
    if graph is None:
        return []
    prune(graph)
    found = [
        replace(
            each,
            points=scene.reduced(each.points + low),
            half_width=each.half_width / scene.factor,
            joints=[scene.reduced(joint + low) for joint in each.joints],
            doubts=[*each.doubts, BUNDLED],
        )
        for each in strands(graph)
    ]
    long = [each for each in found if _length(scene, each) > 0.7 * least]
    near = [each for each in long if _covered(each, [strand], BESIDE)]
    return near if len(near) <= MOST_PARTS else []


def _mask(scene: Scene, low: np.ndarray, high: np.ndarray, depth: float) -> ByteMask:
    part = cv2.GaussianBlur(scene.image[low[1] : high[1], low[0] : high[0]], (5, 5), 1.0)
    side = max(3, min(WIDEST_PX, int(0.6 * min(part.shape))) | 1)
    kind = cv2.MORPH_TOPHAT if scene.sign > 0 else cv2.MORPH_BLACKHAT
    height = stands_out(*hats(np.asarray(part, dtype=np.float32), side, [kind]))
    level = threshold(height, LEAST_LEVELS * scene.step)
    strongest = cv2.dilate(height, np.ones((11, 11), np.uint8))
    return np.asarray(height > np.maximum(level, depth * strongest), dtype=np.uint8)


def _separate(courses: Sequence[Course | None], least: float) -> bool:
    """Return whether each is long, narrow, even, and has two ends."""
    return all(
        course is not None
        and float(arc_lengths(course.line)[-1]) >= max(least, SLENDER * course.width)
        and all(end.kind is EndKind.FREE for end in course.ends)
        and checks.width_spread(course) < checks.LIMITS.width_spread
        and not checks.parted(course)
        for course in courses
    )


def _held(scene: Scene, strand: Strand, course: Course | None) -> bool:
    """Return whether a course is seen on most of its length and lies where the strand does."""
    if course is None or float(course.good.mean()) < checks.LIMITS.seen:
        return False
    room = int(np.ceil(STRAY_WIDTHS * course.width / STEP_PX))
    away, _ = cKDTree(scene.full(strand.points)).query(course.line[room:-room])
    return bool((away < STRAY_WIDTHS * course.width).all())


def _length(scene: Scene, strand: Strand) -> float:
    return float(arc_lengths(strand.points)[-1]) * scene.factor


def _covered(strand: Strand, others: Sequence[Strand], half_widths: float) -> bool:
    """Return whether most of a strand lies within so many half widths of others, and a pixel."""
    reach = half_widths * max(each.half_width for each in others) + 1.0
    away, _ = cKDTree(np.concatenate([each.points for each in others])).query(strand.points)
    return bool((away < reach).mean() > MOSTLY)
