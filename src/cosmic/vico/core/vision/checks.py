"""Reasons not to rely on what was found."""

from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from cosmic.frame.arrays import Floats
from cosmic.vico.core.vision.ends import EndKind
from cosmic.vico.core.vision.grey import middle, middles, quantile
from cosmic.vico.core.vision.profiles import Scene, sample
from cosmic.vico.core.vision.refine import STEP_PX, Course
from cosmic.vico.core.vision.smoothing import levelled

OUT_OF_FOCUS = "out of focus: its edges are blurred over a large part of its width"
FAINT = "hardly stands out from the noise"
FADES = "it fades towards an end, so that the end is uncertain"
UNEVEN = "its width varies so much that it may be more than one fibre, or none"
UNSEEN = "its edges are seen on too small a part of its length"
HIDDEN_STRETCH = "a long stretch of it lies on or beside another fibre"
CONTINUES = "another piece begins where it ends: it may be one broken fibre"
LEFT_OVER = "something beside it belongs to no fibre"
CROWDED = "the image is full of fibres: no single one can be told apart"
IMPRECISE = "its length is known to less than one per cent"
PARTED = "it may be two fibres side by side: the ground shows between its edges"
RUNS_ON = (EndKind.BODY, EndKind.LOST)
EDGING = "it lies along the edge of something wider"
DIRTY_END = "at an end its edges are not seen: dirt may lie there"
DRAWN = "it is as even as what is drawn into a picture: a scale bar, a line, a letter, or a frame"
COPY = "another one has the same shape: it may be a reflection, or a mark that was drawn"
SHARP = "it bends more sharply than its own width"
EMBOSSED = "a dark band and a light one lie along each other: a scratch, or lit from a side"
# Of stretches along a fibre, what such a share differ by at most is its own unevenness.
OWN_UNEVENNESS = 0.9


@dataclass(frozen=True, slots=True)
class Limits:
    """When something is doubtful."""

    blur_of_width: float = 0.5
    blur_px: float = 2.0
    blur_most_px: float = 4.4
    dip: float = 0.15
    edging: float = 0.1
    turn: float = 1.6
    tilt: float = 0.4
    contrast_to_noise: float = 1.5
    levels: float = 4.0
    fade: float = 0.55
    width_spread: float = 0.3
    bumps: float = 0.08
    bumps_px: float = 0.5
    seen: float = 0.6
    gap_widths: float = 14.0
    other_side: float = 0.2
    clipped: float = 0.005
    same_level: float = 0.01


LIMITS = Limits()


def doubts_of(course: Course, step: float) -> list[str]:
    """Return what is doubtful about one fibre by itself; `step` is one of 256 levels."""
    found = [
        end.kind.value for end in course.ends if end.kind not in (EndKind.FREE, EndKind.HIDDEN)
    ]
    seen = course.good
    typical = middle(course.contrast[seen]) if seen.any() else 0.0
    hidden_px = longest_gap(seen) * STEP_PX
    blurred_px = max(LIMITS.blur_px, LIMITS.blur_of_width * course.width)
    reasons = (
        (course.blur_px > min(blurred_px, LIMITS.blur_most_px), OUT_OF_FOCUS),
        (parted(course), PARTED),
        (embossed(course), EMBOSSED),
        (edging(course, typical) > LIMITS.edging, EDGING),
        (typical < max(LIMITS.contrast_to_noise * course.noise, LIMITS.levels * step), FAINT),
        (fades(course, typical), FADES),
        (dirty_end(course), DIRTY_END),
        (width_spread(course) > LIMITS.width_spread or bumpy(course), UNEVEN),
        (float(seen.mean()) < LIMITS.seen or course.cut, UNSEEN),
        (hidden_px > max(30.0, LIMITS.gap_widths * course.width), HIDDEN_STRETCH),
        (sharpest_turn(course) > LIMITS.turn, SHARP),
    )
    return [*found, *(reason for doubtful, reason in reasons if doubtful)]


def parted(course: Course) -> bool:
    """Return whether the ground shows in the middle of a fibre, as between two fibres."""
    inner = course.mean[np.abs(course.across) < 0.3 * course.width]
    return len(inner) > 0 and float(np.abs(inner).min()) < LIMITS.dip


def embossed(course: Course) -> bool:
    """Return whether a band beyond the ground, the other way, lies along one side of a fibre.

    Sharpening and phase contrast leave a seam along both sides.
    """
    sides = [
        course.mean[side * course.across > 0.5 * course.width].min(initial=0.0) for side in (-1, 1)
    ]
    low, high = float(min(sides)), float(max(sides))
    return low < -LIMITS.other_side and high - low > LIMITS.other_side


def edging(course: Course, typical: float) -> float:
    """Return on what share of its length the ground differs between the two sides."""
    return float((course.tilt > LIMITS.tilt * max(typical, 1e-6)).mean())


def fades(course: Course, typical: float) -> bool:
    """Return whether a fibre is much fainter at an end than on the whole."""
    skip = int(np.ceil((1.0 + 2.0 * course.blur_px) / STEP_PX))
    count = max(3, int(1.5 * course.width / STEP_PX))
    parts = (course.contrast[skip : skip + count], course.contrast[-skip - count : -skip])
    return any(len(part) > 0 and middle(part) < LIMITS.fade * typical for part in parts)


def dirty_end(course: Course) -> bool:
    """Return whether a fibre is wider before an end than on the whole, or has no edges there."""
    skip = int(np.ceil((1.0 + 1.5 * course.blur_px) / STEP_PX))
    count = max(3, int(1.2 * course.width / STEP_PX))
    usual = np.abs(course.widths) < 1.3 * course.width + 0.7
    for end, part in zip(
        course.ends, (usual[skip:][:count], usual[::-1][skip:][:count]), strict=True
    ):
        if end.kind is EndKind.FREE and len(part) > 0 and float(part.mean()) < 0.6:
            return True
    return False


def uneven_ends(course: Course) -> float:
    """Return by how many pixels more of a fibre is missing at one end than at the other.

    A speck of dirt that lengthens it is seldom as dark as the fibre. What stretches elsewhere
    along the fibre miss of the stretch beside them is its own unevenness, and no dirt.
    """
    count = max(6, int(2.5 * course.width / STEP_PX))
    if len(course.contrast) < 4 * count:
        return 0.0
    inner = course.contrast[count:-count]
    ends = [_missing(each[: 2 * count], count) for each in (course.contrast, course.contrast[::-1])]
    own = np.concatenate([_missing(each, count) for each in (inner, inner[::-1])])
    more = abs(float(ends[0][0] - ends[1][0]))
    return max(0.0, more - quantile(own, OWN_UNEVENNESS))


def _missing(values: Floats, count: int) -> Floats:
    """Return how many pixels stretches of `count` points miss, by the height of the next one."""
    windows = sliding_window_view(values, count)
    first = np.arange(0, len(values) - 2 * count + 1, max(1, count // 4))
    usual = np.maximum(middles(windows[first + count]), 1e-6)
    return np.asarray(STEP_PX * np.maximum(1.0 - windows[first] / usual[:, None], 0.0).sum(axis=1))


def width_spread(course: Course) -> float:
    """Return the robust relative spread of a fibre's width."""
    widths = course.widths[np.isfinite(course.widths)]
    if len(widths) < 4:
        return 1.0
    low, high = quantile(widths, 0.16), quantile(widths, 0.84)
    return 0.5 * (high - low) / max(middle(widths), 1e-6)


def bumpy(course: Course) -> bool:
    """Return whether the width goes up and down within a few widths.

    So it does along a word, or a row of beads, whose joints are no more than their own unevenness.
    """
    widths = course.widths[np.isfinite(course.widths)]
    if len(widths) < 4:
        return True
    around = levelled(widths, 2 * int(3.0 * course.width / STEP_PX) + 1)
    spread = 1.4826 * middle(np.abs(widths - around))
    return spread > max(LIMITS.bumps * course.width, LIMITS.bumps_px)


def longest_gap(seen: np.ndarray) -> int:
    """Return the longest run of points that were not seen."""
    edges = np.nonzero(np.concatenate([[True], seen, [True]]))[0]
    return int(np.diff(edges).max()) - 1


def sharpest_turn(course: Course) -> float:
    """Return the largest angle that a fibre turns within twice its width, radians."""
    count = max(2, int(2.0 * course.width / STEP_PX))
    line = course.line
    if len(line) < 2 * count + 2:
        return 0.0
    step = line[count:] - line[:-count]
    angle = np.arctan2(step[:, 1], step[:, 0])
    turn = np.angle(np.exp(1j * (angle[count:] - angle[:-count])))
    return float(np.abs(turn).max()) if len(turn) else 0.0


def is_clipped(scene: Scene, course: Course) -> bool:
    """Return whether the ground is at the end of the range, without noise, and the fibre is not."""
    if course.noise > 0.0 or not course.good.any():
        return False
    ground = middle(scene.sign * course.ground)
    if ground > float((scene.sign * scene.image).min()) + LIMITS.same_level:
        return False
    x, y = (course.line[:, axis].astype(np.float32)[None] for axis in (0, 1))
    levels = sample(scene.image, x, y)[0].astype(np.float64)
    spread = middle(np.abs(levels - middle(levels)))
    return spread > LIMITS.clipped * middle(course.contrast[course.good])
