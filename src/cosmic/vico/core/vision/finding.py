"""Fibres found on an image and measured."""

from collections.abc import Callable
from types import MappingProxyType

import cv2
import numpy as np
import numpy.typing as npt

from cosmic.frame.arrays import ByteMask, Floats
from cosmic.frame.errors import NotAvailable
from cosmic.vico.core.vision import (
    axial,
    beyond,
    certainty,
    checks,
    marks,
    picture_edge,
    pieces,
)
from cosmic.vico.core.vision.ends import EndKind
from cosmic.vico.core.vision.fibre import Fibre, paint
from cosmic.vico.core.vision.graph import build_graph, prune
from cosmic.vico.core.vision.grey import grey_image, middle
from cosmic.vico.core.vision.joining import Strand, strands
from cosmic.vico.core.vision.measures import (
    grasp_points,
    kink_angles_deg,
    kink_index,
    longest_extent,
)
from cosmic.vico.core.vision.parting import parted_at_gaps, separated
from cosmic.vico.core.vision.profiles import Scene
from cosmic.vico.core.vision.refine import Course, near_ends, neighbours_of, refine
from cosmic.vico.core.vision.relief import blockiness, find_relief, level_step
from cosmic.vico.core.vision.section import (
    APERTURE_PX,
    FEWEST_ROWS,
    Section,
    fit_section,
    gathered,
    pooled,
)
from cosmic.vico.core.vision.smoothing import arc_lengths, resampled
from cosmic.vico.hw.interface import Pixels

MOST_FORKS = 400
# A fibre is at least so many times longer than wide.
SLENDER = 5.0
LEAST_PX = 12.0
LEAST_OF_IMAGE = 0.025
# Lighter inside, it is ground between two fibres and no hollow.
MOST_HOLLOW = 0.8
# Of the blur of its edges, by which a fibre on a clipped ground is too short.
CLIPPED_BLURS = 1.5
# More cannot be told apart in time, nor in a network at all.
MOST_STRANDS = 96


Wanted = Callable[[Floats], bool]


def find_fibres(image: npt.NDArray[np.generic], *, wanted: Wanted | None = None) -> list[Fibre]:
    """Find the fibres on an image and measure them, the longest first.

    Parameters
    ----------
    image : ndarray, shape (height, width), uint8 or uint16
        Fibres darker or lighter than the ground. An image of shape (height, width, 3) or
        (height, width, 4) is taken as blue, green, red, opacity and turned to grey; bool, other
        whole numbers and floats are converted as `grey_image` says.
    wanted : callable or None
        Says of a line as it is first seen, shape (n, 2), pixels, whether it is measured: that takes
        most of the time. None: each is.

    Returns
    -------
    list of Fibre
        Empty where there is none. Each says whether it is certain.

    Raises
    ------
    ConfigError
        The image has another type or shape, or is smaller than 16 x 16; dtype and shape are named.
    NotAvailable
        They cannot be looked for on this image.
    """
    pixels = grey_image(image)
    try:
        return _found(pixels, wanted)
    except (ValueError, ArithmeticError, IndexError, cv2.error) as exc:  # numpy's, scipy's too
        raise NotAvailable(
            f"fibres cannot be looked for on this image, {image.dtype} of shape {image.shape} "
            f"({type(exc).__name__}: {exc}); take "
            "another, or change zoom, focus or light"
        ) from exc


def _found(pixels: Pixels, wanted: Wanted | None) -> list[Fibre]:
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
        1.0 if pixels.dtype == np.uint8 else level_step(pixels),
        blockiness(pixels),
    )
    least = max(LEAST_PX, LEAST_OF_IMAGE * float(np.hypot(*pixels.shape)))
    kept = [each for each in strands(graph) if long_enough(each, relief.factor, least)]
    kept.sort(key=lambda each: -float(arc_lengths(each.points)[-1]))
    crowd = len(kept) > MOST_STRANDS
    kept = kept[:MOST_STRANDS]
    found = [
        refine(scene, each, neighbours_of(scene, kept, index))
        if wanted is None or wanted(scene.full(each.points))
        else None
        for index, each in enumerate(kept)
    ]
    kept, found = parted_at_gaps(scene, kept, found)
    kept, found = separated(scene, kept, found, least)
    courses = [
        (strand, course)
        for strand, course in zip(kept, found, strict=True)
        if course is not None and slender(course, least)
    ]
    return checked_fibres(scene, courses, crowd=crowd)


def long_enough(strand: Strand, factor: int, least: float) -> bool:
    """Return whether a strand can be a fibre at all."""
    length = float(arc_lengths(strand.points)[-1]) * factor
    width = (2.0 * strand.half_width - 0.5) * factor
    return length > max(0.7 * least, (SLENDER - 2.0) * width)


def slender(course: Course, least: float) -> bool:
    """Return whether what was measured is long and narrow."""
    length = float(arc_lengths(course.line)[-1])
    typical = middle(course.contrast[course.good]) if course.good.any() else 0.0
    long = length >= max(least, SLENDER * course.width)
    return long and typical > 0 and checks.edging(course, typical) < 0.5


def section_of(scene: Scene, course: Course) -> Section:
    """Return the cross section of a fibre; one that is no bar is as wide as half of its height."""
    scene = course.alone or scene
    reach = 0.5 * course.width + 3.0 * min(course.blur_px, 0.4 * course.width) + 3.0
    good = course.good & ~near_ends(course)
    good = good if good.sum() >= FEWEST_ROWS else course.good
    found = fit_section(gathered(scene, course.line, good, course.ground, reach), course.width)
    if found is not None:
        return found
    blur_ln = float(np.log(max(course.blur_px, APERTURE_PX)))
    return Section(course.width, 0.2 * course.width + 0.2, blur_ln, 0.5, 0.0)


def fibre(
    scene: Scene, course: Course, section: Section, doubts: list[str], signs: certainty.Signs
) -> Fibre:
    """Return what a course amounts to."""
    fine = resampled(course.line, 0.5, multiple=4)
    line = fine[::4]
    length = float(arc_lengths(fine)[-1])
    projected, orientation = longest_extent(line)
    width = section.width_px
    widths = filled(course.widths, len(line))
    widths *= width / float(widths.mean())
    kinks = kink_angles_deg(line, width)
    ends_std = np.array([end.std_px for end in course.ends])
    clipped = checks.is_clipped(scene, course)
    length_std = length_deviation(course, length, clipped=clipped)
    if length_std > 0.01 * length:
        doubts.append(checks.IMPRECISE)
    whole = certainty.probability(signs, doubts)
    if not (doubts or whole >= certainty.CERTAIN):
        doubts.append(certainty.IMPROBABLE)
    width_std = width_deviation(course, section)
    free = clear_around(scene, line, width)
    contrast = middle(course.contrast[course.good])
    return Fibre(
        centre_line_px=frozen(line),
        widths_px=frozen(widths),
        length_px=length,
        length_std_px=length_std,
        length_interval_px=certainty.interval(length, length_std),
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
        probability=whole,
        signs=signs.values,
        doubts=tuple(dict.fromkeys(doubts)),
        uncertainties=MappingProxyType(
            uncertainties(length, length_std, width, width_std, projected, ends_std)
        ),
    )


def length_deviation(course: Course, length: float, *, clipped: bool) -> float:
    """Return the standard deviation of the length.

    Where the ground is clipped nobody sees where a half of the contrast would have been.
    """
    ends = sum(end.std_px**2 for end in course.ends)
    hidden = float((~course.good).sum()) * 2.0
    dirt = 2.0 * max(0.0, checks.uneven_ends(course) - 1.0)
    edges = CLIPPED_BLURS * course.edge_blur_px if clipped else 0.0
    return float(np.sqrt(ends + (2e-4 * length) ** 2 + (0.004 * hidden) ** 2 + dirt**2 + edges**2))


def width_deviation(course: Course, section: Section) -> float:
    """Return the standard deviation of the mean width."""
    spread = float(np.nanstd(course.widths)) / np.sqrt(max(1, int(course.good.sum()) // 4))
    return float(np.hypot(np.hypot(0.02, spread), section.width_std_px))


def uncertainties(
    length: float,
    length_std: float,
    width: float,
    width_std: float,
    projected: float,
    ends_std: Floats,
) -> dict[str, float | str]:
    """Return the standard deviation of each value, or why there is none."""
    extent_std = float(np.hypot(*ends_std))
    return {
        "length_px": length_std,
        "projected_length_px": extent_std,
        "width_px": width_std,
        "area_px2": float(np.hypot(width * length_std, length * width_std)),
        "ends_px": float(ends_std.max()),
        "curl": float(length / projected * np.hypot(length_std / length, extent_std / projected)),
        "orientation_deg": float(np.degrees(extent_std / projected)),
        "kink": "kinks are counted, so that one near a limit of angle counts or does not",
        "grasp_points_px": "they are proposals, not measurements",
    }


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
    reach = 1.5 * width + 6.0
    inside = ((line > reach) & (line < scene.corner - reach)).all(axis=1)
    points = scene.reduced(line)
    edge = int(np.ceil(reach / scene.factor)) + 2
    low = np.maximum(np.floor(points.min(axis=0)).astype(int) - edge, 0)
    high = np.ceil(points.max(axis=0)).astype(int) + edge + 1
    part = scene.taken[low[1] : high[1], low[0] : high[0]]
    own = np.zeros(part.shape, np.uint8)
    strip(own, points - low, width / scene.factor + 3.0)
    ground = ((part == 0) | (own > 0)).astype(np.uint8)
    distance = np.minimum(cv2.distanceTransform(ground, cv2.DIST_L2, 3), 1e6)
    last = np.array(part.shape)[::-1] - 1
    columns, rows = np.clip(np.round(points - low).astype(int), 0, last).T
    return np.asarray(inside & (distance[rows, columns] * scene.factor > reach))


def checked_fibres(
    scene: Scene, courses: list[tuple[Strand, Course]], *, crowd: bool
) -> list[Fibre]:
    """Return the fibres, the longest first, with what is doubtful about them together."""
    measured = [course for _, course in courses]
    lines = [course.line for course in measured]
    widths = [course.width for course in measured]
    explained = explained_by(scene, lines, widths)
    together = (
        (marks.drawn(scene, measured), checks.DRAWN),
        (marks.copied(measured), checks.COPY),
        (set(range(len(courses))) if crowd else set(), checks.CROWDED),
        (pieces.in_pieces(scene, measured, explained), checks.CONTINUES),
        (left_over(scene, lines, widths, explained), checks.LEFT_OVER),
    )
    sections = pooled([section_of(scene, course) for course in measured])
    found = []
    for index, (strand, course) in enumerate(courses):
        signs = certainty.signs_of(scene, course, explained)
        doubts = [*strand.doubts, *checks.doubts_of(course, scene.step), *signs.doubts]
        doubts += doubts_by_itself(scene, course, sections[index], signs, explained)
        doubts += [reason for which, reason in together if index in which]
        found.append(fibre(scene, course, sections[index], doubts, signs))
    return sorted(found, key=lambda each: -each.length_px)


def doubts_by_itself(
    scene: Scene, course: Course, section: Section, signs: certainty.Signs, explained: ByteMask
) -> list[str]:
    """Return what is doubtful about a fibre where it lies on the image."""
    compressed = signs.compressed > certainty.NOISE
    reasons = (
        (not signs.joints.checked, axial.UNCHECKED),
        (section.hollow > MOST_HOLLOW, checks.PARTED),
        (touches_border(scene, course), EndKind.BORDER.value),
        (picture_edge.is_cut(scene, course, explained, compressed=compressed), picture_edge.CUT),
        (beyond.is_covered(scene, course, compressed=compressed), beyond.COVERED),
    )
    return [reason for doubtful, reason in reasons if doubtful]


def touches_border(scene: Scene, course: Course) -> bool:
    """Return whether a fibre lies partly beyond the image's border."""
    room = 0.5 * course.width - 0.5
    return bool((course.line < room).any() or (course.line > scene.corner - room).any())


def strip(mask: ByteMask, line: Floats, width: float) -> None:
    """Paint a strip of one width, in as few pieces as its purpose allows."""
    thin = line[:: max(1, len(line) // 120)]
    part = thin if len(thin) > 1 else line
    paint(mask, np.concatenate([part, line[-1:]]), np.full(len(part) + 1, width))


def explained_by(scene: Scene, lines: list[Floats], widths: list[float]) -> ByteMask:
    """Return where fibres lie on the reduced image, with some room."""
    explained = np.zeros(scene.taken.shape, np.uint8)
    for line, width in zip(lines, widths, strict=True):
        strip(explained, scene.reduced(line), width / scene.factor + 4.0)
    return explained


def left_over(
    scene: Scene, lines: list[Floats], widths: list[float], explained: ByteMask
) -> set[int]:
    """Return the fibres to which something large clings that no fibre explains."""
    rest = (scene.taken > 0) & (explained == 0)
    _, labels = cv2.connectedComponents(rest.view(np.uint8), connectivity=8)
    areas = np.bincount(labels[rest])
    found: set[int] = set()
    if not (areas >= 12).any():
        return found
    for index, (line, width) in enumerate(zip(lines, widths, strict=True)):
        around = np.zeros(rest.shape, np.uint8)
        strip(around, scene.reduced(line), width / scene.factor + 8.0)
        beside = np.unique(labels[(around > 0) & rest])
        if len(beside) and int(areas[beside].max()) > max(11.0, 3.0 * (width / scene.factor) ** 2):
            found.add(index)
    return found
