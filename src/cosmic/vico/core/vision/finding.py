"""Fibres found on a picture and measured."""

from types import MappingProxyType

import cv2
import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from cosmic.vico.core.vision import checks
from cosmic.vico.core.vision.ends import EndKind
from cosmic.vico.core.vision.fibre import Fibre, paint
from cosmic.vico.core.vision.graph import build_graph, prune
from cosmic.vico.core.vision.grey import Floats, Mask, grey_picture
from cosmic.vico.core.vision.joining import Strand, strands
from cosmic.vico.core.vision.measures import (
    grasp_points,
    kink_angles_deg,
    kink_index,
    longest_extent,
)
from cosmic.vico.core.vision.profiles import Scene
from cosmic.vico.core.vision.refine import Course, Neighbours, refine
from cosmic.vico.core.vision.relief import find_relief
from cosmic.vico.core.vision.smoothing import arc_lengths, resampled

MOST_FORKS = 400
# A fibre is at least so many times longer than wide.
SLENDER = 5.0
LEAST_PX = 12.0
LEAST_OF_PICTURE = 0.025
# More cannot be told apart in time, nor in a network at all.
MOST_STRANDS = 48


def find_fibres(image: npt.NDArray[np.generic]) -> list[Fibre]:
    """Find the fibres on a picture and measure them, the longest first.

    Parameters
    ----------
    image : ndarray, shape (height, width), uint8 or uint16
        Fibres darker or lighter than the ground. A picture of shape (height, width, 3) is taken
        as blue, green, red and turned to grey.

    Returns
    -------
    list of Fibre
        Empty where there is none. Each says whether it is certain.

    Raises
    ------
    ConfigError
        The picture has another type or shape, or is smaller than 16 x 16.
    """
    pixels = grey_picture(image)
    relief = find_relief(pixels)
    if relief.crowded or not relief.mask.any():
        return []
    graph = build_graph(relief.mask, MOST_FORKS)
    if graph is None:
        return []
    prune(graph)
    scene = Scene(
        pixels.astype(np.float32),
        relief.mask.astype(np.float32),
        relief.factor,
        1.0 if relief.lighter else -1.0,
    )
    least = max(LEAST_PX, LEAST_OF_PICTURE * float(np.hypot(*pixels.shape)))
    kept = [each for each in strands(graph) if long_enough(each, relief.factor, least)]
    kept.sort(key=lambda each: -float(arc_lengths(each.points)[-1]))
    courses = []
    crowd = len(kept) > MOST_STRANDS
    kept = kept[:MOST_STRANDS]
    for index, strand in enumerate(kept):
        course = refine(scene, strand, neighbours(scene, kept, index))
        if course is not None and slender(course, least):
            courses.append((strand, course))
    return judged(scene, courses, crowd=crowd)


def long_enough(strand: Strand, factor: int, least: float) -> bool:
    """Return whether a strand can be a fibre at all."""
    length = float(arc_lengths(strand.points)[-1]) * factor
    width = (2.0 * strand.half_width - 0.5) * factor
    return length > max(0.7 * least, (SLENDER - 2.0) * width)


def slender(course: Course, least: float) -> bool:
    """Return whether what was measured is long and narrow."""
    length = float(arc_lengths(course.line)[-1])
    typical = float(np.median(course.contrast[course.good])) if course.good.any() else 0.0
    beside = checks.edging(course, typical) < 0.5
    return beside and typical > 0 and length >= max(least, SLENDER * course.width)


def neighbours(scene: Scene, kept: list[Strand], index: int) -> Neighbours:
    """Return all strands but one."""
    others = [(each, scene.full(each.points)) for n, each in enumerate(kept) if n != index]
    if not others:
        return Neighbours(None, np.zeros(0))
    points = np.concatenate([line for _, line in others])
    margins = np.concatenate(
        [np.full(len(line), each.half_width * scene.factor) for each, line in others]
    )
    return Neighbours(cKDTree(points), margins)


def fibre(scene: Scene, course: Course, doubts: list[str]) -> Fibre:
    """Return what a course amounts to."""
    line = resampled(course.line, 2.0)
    fine = resampled(course.line, 0.5)
    length = float(arc_lengths(fine)[-1])
    projected, orientation = longest_extent(line)
    widths = filled(course.widths, len(line))
    width = float(widths.mean())
    kinks = kink_angles_deg(line, width)
    ends_std = np.array([end.std_px for end in course.ends])
    length_std = length_deviation(course, length)
    if length_std > 0.01 * length:
        doubts.append(checks.IMPRECISE)
    width_std = float(np.nanstd(course.widths)) if course.good.any() else width
    free = clear_around(scene, line, width)
    contrast = float(np.median(course.contrast[course.good]))
    return Fibre(
        centre_line_px=frozen(line),
        widths_px=frozen(widths),
        length_px=length,
        length_std_px=length_std,
        projected_length_px=projected,
        width_px=width,
        width_std_px=width_std,
        area_px2=width * length,
        ends_px=frozen(line[[0, -1]]),
        ends_std_px=frozen(ends_std),
        curl=length / projected - 1.0,
        kink=kink_index(kinks, length),
        kinks=len(kinks),
        orientation_deg=orientation,
        grasp_points_px=frozen(grasp_points(line, width, free)),
        contrast=contrast,
        lighter=scene.sign > 0,
        certain=not doubts,
        doubts=tuple(dict.fromkeys(doubts)),
        uncertainties=MappingProxyType({}),
    )


def length_deviation(course: Course, length: float) -> float:
    """Return the standard deviation of the length."""
    ends = sum(end.std_px**2 for end in course.ends)
    hidden = float((~course.good).sum()) * 2.0
    return float(np.sqrt(ends + (2e-4 * length) ** 2 + (0.004 * hidden) ** 2))


def filled(widths: Floats, count: int) -> Floats:
    """Return widths at `count` points, gaps bridged."""
    seen = np.nonzero(np.isfinite(widths))[0]
    at = np.linspace(0, len(widths) - 1, count)
    return np.asarray(np.interp(at, seen, widths[seen]))


def frozen(values: Floats) -> Floats:
    """Return a copy that nobody writes to."""
    copy = np.array(values, dtype=np.float64)
    copy.flags.writeable = False
    return copy


def clear_around(scene: Scene, line: Floats, width: float) -> npt.NDArray[np.bool_]:
    """Return where nothing but the fibre lies within a gripper's reach."""
    own = np.zeros(scene.taken.shape, np.uint8)
    wide = np.full(len(line), width / scene.factor + 3.0)
    paint(own, scene.reduced(line), wide)
    other = (scene.taken > 0) & (own == 0)
    reach = 1.5 * width + 6.0
    inside = ((line > reach) & (line < scene.corner - reach)).all(axis=1)
    rows, columns = np.nonzero(other)
    if not len(rows):
        return np.asarray(inside)
    tree = cKDTree(scene.full(np.column_stack([columns, rows]).astype(float)))
    return np.asarray(inside & (tree.query(line)[0] > reach))


def judged(scene: Scene, courses: list[tuple[Strand, Course]], *, crowd: bool) -> list[Fibre]:
    """Return the fibres, the longest first, with what is doubtful about them together."""
    lines = [course.line for _, course in courses]
    widths = [course.width for _, course in courses]
    apart = checks.continued(lines, widths)
    beside = left_over(scene, lines, widths)
    found = []
    for index, (strand, course) in enumerate(courses):
        doubts = [*strand.doubts, *checks.doubts_of(course)]
        if crowd:
            doubts.append(checks.CROWDED)
        if index in apart:
            doubts.append(checks.CONTINUES)
        if index in beside:
            doubts.append(checks.LEFT_OVER)
        found.append(fibre(scene, course, doubts))
    return sorted(found, key=lambda each: -each.length_px)


def left_over(scene: Scene, lines: list[Floats], widths: list[float]) -> set[int]:
    """Return the fibres to which something large clings that no fibre explains."""
    explained = np.zeros(scene.taken.shape, np.uint8)
    for line, width in zip(lines, widths, strict=True):
        wide = np.full(len(line), width / scene.factor + 4.0)
        paint(explained, scene.reduced(line), wide)
    rest = ((scene.taken > 0) & (explained == 0)).astype(np.uint8)
    count, labels, stats, _ = cv2.connectedComponentsWithStats(rest, connectivity=8)
    found: set[int] = set()
    for number in range(1, count):
        area = int(stats[number, cv2.CC_STAT_AREA])
        if area < 12:
            continue
        rows, columns = np.nonzero(labels == number)
        places = scene.full(np.column_stack([columns, rows]).astype(float))
        for index, (line, width) in enumerate(zip(lines, widths, strict=True)):
            near = float(cKDTree(line[::2]).query(places)[0].min())
            reach = 0.5 * width + 4.0 * scene.factor
            if near < reach and area > 3.0 * (width / scene.factor) ** 2:
                found.add(index)
    return found
