"""Signs along a fibre's axis that it is two fibres end to end.

Each cross section gives the grey levels inside the fibre and what all of it takes from the light.
One fibre changes slowly along its axis; where one ends and another begins there is a gap, a waist,
a patch that is twice as dark, or a step. What counts as a sign is judged against the fibre's own
unevenness, so that a rough fibre is not taken to pieces.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.ndimage import (
    binary_erosion,
    gaussian_filter1d,
    maximum_filter1d,
    median_filter,
    uniform_filter1d,
)

from cosmic.vico.core.vision.grey import Floats, Floats32, middle
from cosmic.vico.core.vision.profiles import Flags, Scene, sample
from cosmic.vico.core.vision.refine import Course
from cosmic.vico.core.vision.smoothing import arc_lengths, directions, resampled

GAP = "the ground shines through in one place: it may be two fibres end to end"
DOUBLED = "a stretch of it is denser than the rest: two fibres may overlap there"
UNCHECKED = "too short a stretch of it is seen to tell one fibre from two"
STEP = "its width, contrast or course changes in one step: it may be two fibres end to end"

# Standard deviations of the fibre's own unevenness.
TIMES = 6.5
# Shares of the fibre's contrast, or of its width, below which nothing is a sign.
DIP, NOTCH, BUMP = 0.1, 0.12, 0.3
CONTRAST_STEP, WIDTH_STEP = 0.12, 0.1
SIDE_STEP, SIDE_STEP_PX = 0.04, 0.4
SWELLING = 0.1
# Radians turned within a width.
TURN = 0.15
# All signs in one place, of which each is the root of the sum of squares of so many.
TOGETHER = 2.0
# What is less than this part of where a sign begins is none in the smoothest fibre.
WITH_OTHERS = 0.4
# Narrower, a gap alone is a sign; below THIN_PX a lumen, a speck on it and an overlap look alike,
# so that the rest counts less.
LEAST_WIDTH_PX, THIN_PX, THIN = 4.0, 7.5, 0.75
# The largest of so many standard deviations is what a fibre of 150 points has by chance.
MANY = 3.2


@dataclass(frozen=True, slots=True)
class Joints:
    """Signs along a fibre, each as a multiple of where it begins to count.

    Attributes
    ----------
    gap, waist, notch : float
        The ground shines through the middle, over the whole width, or at one side.
    doubled : float
        A stretch takes more light away.
    darkness, width, aside : float
        Steps of contrast, of width and of the centre line.
    swollen : float
        In one place the fibre is wider, or takes more light away.
    kinked : float
        It turns more within a width than before and after.
    together : float
        All of these in one place.
    checked : bool
        Whether enough of it is seen to tell.
    """

    gap: float = 0.0
    waist: float = 0.0
    notch: float = 0.0
    doubled: float = 0.0
    darkness: float = 0.0
    width: float = 0.0
    aside: float = 0.0
    swollen: float = 0.0
    kinked: float = 0.0
    together: float = 0.0
    checked: bool = True

    @property
    def doubts(self) -> list[str]:
        """Reasons that count."""
        found = [GAP] if max(self.gap, self.waist, self.notch) > 1.0 else []
        if self.doubled > 1.0:
            found.append(DOUBLED)
        if max(self.darkness, self.width, self.aside, self.kinked) > 1.0:
            found.append(STEP)
        return found


def joints(scene: Scene, course: Course) -> Joints:
    """Return the signs along a course that one fibre ends on it and another begins."""
    line = resampled(course.line, 1.0)
    blur = max(1.0, min(course.blur_px, 0.4 * course.width))
    seen = _seen(course, course.good, line, blur)
    # Where the ground shines through, no edges are seen.
    free = _seen(course, course.free, line, blur)
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
    gap, waist = (_beyond(-values, seen, free, DIP) for values in fine)
    if course.width < LEAST_WIDTH_PX:
        return Joints(_most(gap), _most(waist))
    notches = [_notch(height, across, (seen, free), course.width, blur, part) for part in (-1, 1)]
    steps = (
        (inner, CONTRAST_STEP),
        (mass, WIDTH_STEP),
        (side, max(SIDE_STEP, SIDE_STEP_PX / course.width)),
    )
    stepped = [_stepped(values, seen, course.width, blur, least) for values, least in steps]
    doubled = _beyond(fine[0], seen, seen, BUMP)
    swollen = _beyond(fine[1], seen, seen, SWELLING)
    kinked = _kinked(line, side * course.width, seen, course.width, blur)
    part = THIN if course.width < THIN_PX else 1.0
    signs = (gap, waist, *notches, doubled, swollen, kinked, *stepped)
    notch = max(_most(each) for each in notches)
    darkness, width, aside = (part * _most(each) for each in stepped)
    return Joints(
        _most(gap),
        _most(waist),
        part * notch,
        part * _most(doubled),
        darkness,
        width,
        aside,
        part * _most(swollen),
        part * _most(kinked),
        part * _together(signs, course.width),
    )


def _seen(course: Course, flags: Flags, line: Floats, blur: float) -> Flags:
    """Return the points with a flag all around, away from the ends."""
    s, at = arc_lengths(course.line), arc_lengths(line)
    good = np.interp(at, s, flags.astype(float)) > 0.99
    good = binary_erosion(good, iterations=max(1, int(0.5 * course.width)))
    skip = int(np.ceil(0.75 * course.width + 3.0 * blur))
    good[:skip] = good[-skip:] = False
    return np.asarray(good, dtype=np.bool_)


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
    fine = gaussian_filter1d(values, 0.7 * blur, mode="nearest")
    return np.asarray(fine - median_filter(fine, window, mode="nearest"))


def _notch(
    height: Floats32,
    across: Floats32,
    where: tuple[Flags, Flags],
    width: float,
    blur: float,
    side: float,
) -> Floats:
    """Return how far a notch in one side stands out from its own unevenness."""
    outer = height[:, side * across >= 0.15 * width].sum(axis=1).astype(np.float64)
    outer /= max(middle(outer[where[0]]), 1e-6)
    fine = _uneven(outer, blur, 2 * int(3.0 * width) + 1)
    return _beyond(-fine, *where, NOTCH)


def _kinked(line: Floats, aside_px: Floats, seen: Flags, width: float, blur: float) -> Floats:
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
    angle = gaussian_filter1d(angle, 0.25 * size, mode="nearest")
    angle -= median_filter(angle, 6 * size + 1, mode="nearest")
    whole = binary_erosion(seen, iterations=size // 2)
    values = np.zeros(len(line))
    values[size:-size] = np.abs(angle)
    if whole.sum() <= size:
        return np.zeros((2, len(line)))
    return _beyond(values, whole, whole, TURN)


def _beyond(values: Floats, seen: Flags, where: Flags, least: float) -> Floats:
    """Return how far something stands out at each point from a fibre's own unevenness."""
    return np.where(where | seen, values / _limits(values[seen], least), 0.0)


def _most(values: Floats) -> float:
    return float(values[0].max())


def _together(signs: Sequence[Floats], width: float) -> float:
    """Return how clear all signs are that lie within a width of each other."""
    reach = 2 * int(0.5 * width) + 1
    near = [maximum_filter1d(np.maximum(each[1], 0.0), reach, mode="nearest") for each in signs]
    return float(np.sqrt(np.square(near).sum(axis=0).max())) / TOGETHER


def _limits(values: Floats, least: float) -> Floats:
    """Return from where on a value counts by itself, and with others in its place.

    The largest of many grows with their number.
    """
    spread = 1.4826 * middle(np.abs(values))
    many = math.sqrt(2.0 * math.log(max(len(values), 2))) / MANY
    own = TIMES * max(1.0, many) * spread
    return np.array([[max(least, own)], [max(WITH_OTHERS * least, own)]])


def _stepped(values: Floats, seen: Flags, width: float, blur: float, least: float) -> Floats:
    """Return how far the mean of a stretch differs from that of the next one, at each point."""
    size = max(6, int(1.5 * width))
    apart = int(np.ceil(0.5 * size + 1.5 * blur))
    found = np.zeros((2, len(values)))
    if len(values) < 4 * size + 4 * apart:
        return found
    mean = uniform_filter1d(values, size, mode="nearest")
    step = mean[2 * apart :] - mean[: -2 * apart]
    whole = binary_erosion(seen, iterations=apart + size // 2)[apart:-apart]
    if whole.sum() < size:
        return found
    # What a slope gives at both sides of a step belongs to no step.
    step = step - median_filter(step, 4 * size + 1, mode="nearest")
    found[:, apart:-apart] = np.where(whole, np.abs(step) / _limits(step[whole], least), 0.0)
    return found
