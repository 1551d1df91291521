"""Signs along a fibre's axis that it is two fibres end to end.

Each cross section gives the grey levels inside the fibre and what all of it takes from the light.
One fibre changes slowly along its axis; where one ends and another begins there is a gap, a waist,
a patch that is twice as dark, or a step. What counts as a sign is judged against the fibre's own
unevenness, so that a rough fibre is not taken to pieces.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy.ndimage import (
    correlate1d,
    label,
    maximum_filter1d,
    maximum_position,
    minimum_filter1d,
    uniform_filter1d,
)

from cosmic.frame.arrays import Floats, Floats32, Mask
from cosmic.vico.core.vision.grey import middle, middles
from cosmic.vico.core.vision.profiles import Scene, sample
from cosmic.vico.core.vision.refine import STEP_PX, Course
from cosmic.vico.core.vision.smoothing import (
    arc_lengths,
    directions,
    eroded,
    levelled,
    resampled,
    softened,
)

GAP = "the ground shines through in one place: it may be two fibres end to end"
DOUBLED = "a stretch of it is denser than the rest: two fibres may overlap there"
UNCHECKED = "too short a stretch of it is seen to tell one fibre from two"
STEP = "its width, contrast or course changes in one step: it may be two fibres end to end"

# Standard deviations of the fibre's own unevenness.
TIMES = 6.5
# Shares of the fibre's contrast, or of its width, below which nothing is a sign.
DIP, NOTCH, BUMP = 0.1, 0.12, 0.3
# Of its contrast, from which a gap parts a fibre in two.
BREAK = 0.35
CONTRAST_STEP, WIDTH_STEP = 0.12, 0.1
SIDE_STEP, SIDE_STEP_PX = 0.04, 0.4
SWELLING = 0.1
# Radians turned within a width.
TURN = 0.15
# What is less than this part of where a sign begins is none in the smoothest fibre.
WITH_OTHERS = 0.4
# As long as this a speck of dust may be.
DUST_PX = 12
# So many widths beside what crosses a fibre its shade may lie.
SHADE = 1.0
# Narrower, a gap alone is a sign; below THIN_PX a lumen, a speck on it and an overlap look alike,
# so that the rest counts less.
LEAST_WIDTH_PX, THIN_PX, THIN = 4.0, 7.5, 0.75
# The largest of so many standard deviations is what a fibre of 150 points has by chance.
MANY = 3.2


# Standard deviations, and the share of contrast, from which an abrupt step counts with others.
ABRUPT_TIMES, ABRUPT = 8.0, 0.04


NAMES: Final = (
    "gap", "waist", "notch", "doubled", "swollen", "kinked", "darkness", "width", "aside",
    "ledge", "seam",
)  # fmt: skip
"""Signs along a fibre.

gap, waist, notch: the ground shines through the middle, over the whole width, or at one side;
doubled: a stretch takes more light away; swollen: in one place the fibre is wider, or takes more
light away; kinked: it turns more within a width than before and after; darkness, width, aside:
steps of contrast, of width and of the centre line; ledge, seam: an edge, or the darkness between
the edges, steps abruptly where a fibre of its own slope would not. The last two are never a reason
by themselves.
"""


@dataclass(frozen=True, slots=True, eq=False)
class Joints:
    """Signs along a fibre, in the order of `NAMES`.

    Attributes
    ----------
    clearest : ndarray, shape (signs,)
        The clearest of each sign, as a multiple of where it counts by itself.
    along : ndarray, shape (signs, n)
        How clear each is within half a width of each point, as a multiple of where it counts with
        others in its place.
    checked : bool
        Whether enough of it is seen to tell.
    breaks_px : ndarray
        How far along it the ground shows where it may end and another begin.
    """

    clearest: Floats = field(default_factory=lambda: np.zeros(len(NAMES)))
    along: Floats = field(default_factory=lambda: np.zeros((len(NAMES), 1)))
    checked: bool = True
    breaks_px: Floats = field(default_factory=lambda: np.zeros(0))

    @property
    def doubts(self) -> list[str]:
        """Reasons that count by themselves."""
        clear = dict(zip(NAMES, self.clearest > 1.0, strict=True))
        found = [GAP] if clear["gap"] or clear["waist"] or clear["notch"] else []
        if clear["doubled"]:
            found.append(DOUBLED)
        if clear["darkness"] or clear["width"] or clear["aside"] or clear["kinked"]:
            found.append(STEP)
        return found


def joints(scene: Scene, course: Course) -> Joints:
    """Return the signs along a course that one fibre ends on it and another begins."""
    line = resampled(course.line, 1.0)
    blur = course.edge_blur_px
    seen = _seen(course, course.good, line, blur)
    # Where the ground shines through, no edges are seen. What crosses casts a shade beside it.
    free = _seen(course, unshaded(course), line, blur)
    seen &= free
    if seen.sum() < 6.0 * course.width:
        return Joints(checked=False)
    height, across = _heights(scene, course, line, blur)
    inner = height[:, np.abs(across) <= 0.3 * course.width].mean(axis=1).astype(np.float64)
    typical = middle(inner[seen])
    if not typical > 0:
        return Joints(checked=False)
    inner /= typical
    mass = height.sum(axis=1).astype(np.float64)
    mass /= max(middle(mass[seen]), 1e-6)
    parts = (np.abs(height) * across).sum(axis=1) / np.maximum(np.abs(height).sum(axis=1), 1e-6)
    side = parts.astype(np.float64) / course.width
    window = 2 * int(3.0 * course.width) + 1
    fine = [_uneven(values, blur, window) for values in (inner, mass)]
    signs = [_beyond(-values, seen, free, DIP) for values in fine]
    breaks = _breaks(-fine[0], signs[0][0] > 1.0)
    if course.width < LEAST_WIDTH_PX:
        signs += [np.zeros_like(signs[0])] * (len(NAMES) - len(signs))
        return _joints(signs, course.width, breaks)
    part = THIN if course.width < THIN_PX else 1.0
    notches = [_notch(height, across, (seen, free), course.width, blur, turn) for turn in (-1, 1)]
    # Dust beside a fibre is no step: it comes and goes within a width.
    size = 2 * max(int(course.width), DUST_PX) + 1
    level, weight, side = (levelled(each, size) for each in (inner, mass, side))
    steps = (
        (level, CONTRAST_STEP),
        (weight, WIDTH_STEP),
        (side, max(SIDE_STEP, SIDE_STEP_PX / course.width)),
    )
    others = [
        np.maximum(*notches),
        _beyond(fine[0], seen, seen, BUMP),
        _beyond(fine[1], seen, seen, SWELLING),
        _kinked(line, side * course.width, seen, course.width, blur),
        *(_stepped(values, seen, course.width, blur, least) for values, least in steps),
    ]
    abrupt = _abrupt(height, across, (seen, typical), course.width, blur)
    return _joints([*signs, *(part * each for each in others), *abrupt], course.width, breaks)


def _breaks(dip: Floats, clear: Mask) -> Floats:
    """Return the deepest point of each place at which a fibre is broken."""
    labels, count = label(clear & (dip > BREAK))
    at = maximum_position(dip, labels, range(1, count + 1)) if count else []
    return np.array(at, dtype=np.float64).ravel()


def _joints(signs: Sequence[Floats], width: float, breaks_px: Floats) -> Joints:
    """Return signs, which are near each other where they lie within half a width."""
    reach = 2 * int(0.5 * width) + 1
    near = [maximum_filter1d(np.maximum(each[1], 0.0), reach, mode="nearest") for each in signs]
    clearest = np.array([float(each[0].max()) for each in signs])
    return Joints(clearest, np.array(near), breaks_px=breaks_px)


def _seen(course: Course, flags: Mask, line: Floats, blur: float) -> Mask:
    """Return the points with a flag all around, away from the ends."""
    s, at = arc_lengths(course.line), arc_lengths(line)
    good = np.interp(at, s, flags.astype(float)) > 0.99
    good = eroded(good, max(1, int(0.5 * course.width)))
    skip = int(np.ceil(0.75 * course.width + 3.0 * blur))
    good[:skip] = good[-skip:] = False
    return np.asarray(good, dtype=np.bool_)


def unshaded(course: Course) -> Mask:
    """Return the points of a course with nothing that crosses it, or shades it, beside them."""
    size = 2 * int(SHADE * course.width / STEP_PX) + 1
    return np.asarray(minimum_filter1d(course.free.astype(np.uint8), size, mode="nearest") > 0)


def _heights(
    scene: Scene, course: Course, line: Floats, blur: float
) -> tuple[Floats32, npt.NDArray[np.float32]]:
    """Return what stands out from the ground at each point, shape (n, m), and where across."""
    half = 0.5 * course.width + 1.5 * blur
    across = np.arange(-np.ceil(half), np.ceil(half) + 0.5, 1.0).astype(np.float32)
    tangent = directions(line)
    normal = np.column_stack([-tangent[:, 1], tangent[:, 0]])
    x, y = (
        (line[:, n, None] + across[None, :] * normal[:, n, None]).astype(np.float32) for n in (0, 1)
    )
    ground = np.interp(arc_lengths(line), arc_lengths(course.line), course.ground)
    values = sample(scene.image, x, y) - ground[:, None].astype(np.float32)
    return np.asarray(scene.sign * values, dtype=np.float32), across


def _uneven(values: Floats, blur: float, window: int) -> Floats:
    """Return values about as fine as the image is sharp, without what changes slowly."""
    fine = softened(values, 0.7 * blur)
    return np.asarray(fine - levelled(fine, window))


def _notch(
    height: Floats32,
    across: Floats32,
    where: tuple[Mask, Mask],
    width: float,
    blur: float,
    side: float,
) -> Floats:
    """Return how far a notch in one side stands out from its own unevenness."""
    outer = height[:, side * across >= 0.15 * width].sum(axis=1).astype(np.float64)
    outer /= max(middle(outer[where[0]]), 1e-6)
    fine = _uneven(outer, blur, 2 * int(3.0 * width) + 1)
    return _beyond(-fine, *where, NOTCH)


def _abrupt(
    height: Floats32, across: Floats32, where: tuple[Mask, float], width: float, blur: float
) -> list[Floats]:
    """Return how clearly the edges, and what lies between them, step within a width.

    Of a stretch of a width to each side the slope is taken away: thickness and darkness of one
    fibre change too, but over more than a width.
    """
    seen, typical = where
    edge = max(1.5, 1.5 * blur)
    inner, outer = 0.5 * width - edge, 0.5 * width + edge
    values = np.array(
        [
            height[:, (across >= -outer) & (across < -inner)].sum(axis=1),
            height[:, (across > inner) & (across <= outer)].sum(axis=1),
            height[:, np.abs(across) <= max(1.0, inner)].mean(axis=1),
        ],
        dtype=np.float64,
    )
    size = max(4, int(width))
    none = np.zeros((2, len(seen)))
    if len(seen) < 2 * size + 1:
        return [none, none]
    away = np.arange(-size, size + 1)
    sides = np.sign(away) * (np.abs(away) > round(0.5 * blur))
    kernel = sides - (sides @ away) / (away @ away) * away
    step = correlate1d(
        values / typical, kernel / np.abs(kernel @ np.sign(away)), axis=1, mode="nearest"
    )
    spread = 1.4826 * middles(np.abs(step[:, seen]))
    least = ABRUPT * np.array([1.0, 1.0, 0.7])
    many = max(1.0, math.sqrt(2.0 * math.log(max(int(seen.sum()), 2))) / MANY)
    clear = np.abs(step) / (many * ABRUPT_TIMES * np.maximum(spread, least))[:, None]
    clear = np.minimum(np.where(seen, clear, 0.0), 2.0)
    reach = 2 * int(0.5 * width) + 1
    left, right, middle_part = maximum_filter1d(clear, reach, axis=1, mode="nearest")
    return [np.stack([none[0], np.hypot(left, right)]), np.stack([none[0], middle_part])]


def _kinked(line: Floats, aside_px: Floats, seen: Mask, width: float, blur: float) -> Floats:
    """Return how far the course turns more within a width than before and after.

    The line itself is smooth; where its fibre lies off it the middle of the grey levels says.
    """
    tangent = directions(line)
    normal = np.column_stack([-tangent[:, 1], tangent[:, 0]])
    course = line + aside_px[:, None] * normal
    size = max(4, int(width))
    apart = int(np.ceil(0.5 * size + 0.5 * blur))
    if len(line) < 4 * size + 4 * apart:
        return np.zeros((2, len(line)))
    before, there, after = course[: -2 * size], course[size:-size], course[2 * size :]
    first, last = there - before, after - there
    cross = first[:, 0] * last[:, 1] - first[:, 1] * last[:, 0]
    angle = np.arctan2(cross, (first * last).sum(axis=1))
    angle = softened(angle, 0.25 * size)
    angle -= levelled(angle, 6 * size + 1)
    whole = eroded(seen, size // 2)
    values = np.zeros(len(line))
    values[size:-size] = np.abs(angle)
    if whole.sum() <= size:
        return np.zeros((2, len(line)))
    return _beyond(values, whole, whole, TURN)


def _beyond(values: Floats, seen: Mask, where: Mask, least: float) -> Floats:
    """Return how far something stands out at each point from a fibre's own unevenness."""
    return np.where(where | seen, values / _limits(values[seen], least), 0.0)


def _limits(values: Floats, least: float) -> Floats:
    """Return from where on a value counts by itself, and with others in its place.

    The largest of many grows with their number.
    """
    spread = 1.4826 * middle(np.abs(values))
    many = math.sqrt(2.0 * math.log(max(len(values), 2))) / MANY
    own = TIMES * max(1.0, many) * spread
    return np.array([[max(least, own)], [max(WITH_OTHERS * least, own)]])


def _stepped(values: Floats, seen: Mask, width: float, blur: float, least: float) -> Floats:
    """Return how far the mean of a stretch differs from that of the next one, at each point."""
    size = max(6, int(1.5 * width))
    apart = int(np.ceil(0.5 * size + 1.5 * blur))
    found = np.zeros((2, len(values)))
    if len(values) < 4 * size + 4 * apart:
        return found
    mean = uniform_filter1d(values, size, mode="nearest")
    step = mean[2 * apart :] - mean[: -2 * apart]
    whole = eroded(seen, apart + size // 2)[apart:-apart]
    if whole.sum() < size:
        return found
    # What a slope gives at both sides of a step belongs to no step.
    step = step - levelled(step, 4 * size + 1)
    found[:, apart:-apart] = np.where(whole, np.abs(step) / _limits(step[whole], least), 0.0)
    return found
