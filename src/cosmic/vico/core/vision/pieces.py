"""Fibres that lie in pieces: broken, hidden in between, or on an image that is torn."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
from scipy.spatial import cKDTree

from cosmic.frame.arrays import ByteMask, Floats
from cosmic.vico.core.vision.checks import RUNS_ON
from cosmic.vico.core.vision.ends import EndKind
from cosmic.vico.core.vision.grey import middle, quantile
from cosmic.vico.core.vision.profiles import Scene, sample
from cosmic.vico.core.vision.refine import Course

TORN_PX: Final = 1.5
TORN_REACH_PX: Final = 64.0
ALIKE: Final = 0.7
"""Of width and contrast of the fibre, and no more than the inverse: dust is as thick seldom."""
LEAST_AREA: Final = 0.8
"""Squares of the fibre's width."""
AHEAD: Final = 0.9
"""Cosine of how far off its direction a fibre may go on."""


def in_pieces(scene: Scene, courses: Sequence[Course], explained: ByteMask) -> set[int]:
    """Return the fibres that may be a piece of one, by other fibres and by what is left.

    Parameters
    ----------
    explained : ndarray, shape of the reduced image, uint8
        Where fibres lie.
    """
    return continued(courses) | broken_off(scene, courses, explained)


def continued(courses: Sequence[Course]) -> set[int]:
    """Return the fibres at an end of which another one, or their own other end, goes on.

    Ends so near that they may touch are one broken fibre at any angle, as far as is known; so is
    one that begins at the end of another with an end that cannot be told from that.
    """
    found: set[int] = set()
    ends = [
        (index, each.line[at], outward(each.line, at), end.kind in RUNS_ON)
        for index, each in enumerate(courses)
        for at, end in zip((0, -1), each.ends, strict=True)
    ]
    if not ends:
        return found
    widths = [each.width for each in courses]
    points = np.array([point for _, point, _, _ in ends])
    for first, last in cKDTree(points).query_pairs(4.0 * max(widths) + TORN_REACH_PX):
        (i, point, out, runs), (j, other, other_out, other_runs) = ends[first], ends[last]
        step = other - point
        gap = float(np.linalg.norm(step))
        both = widths[i] + widths[j]
        if i != j and gap < (both + 12.0 if runs or other_runs else 0.9 * both + 6.0):
            found |= {i, j}
        elif gap <= 2.0 * both + 30.0:
            step /= max(gap, 1e-9)
            if float(out @ step) > 0.8 and float(other_out @ -step) > 0.8:
                found |= {i, j}
        if i != j and _torn(other - point, out, other_out):
            found |= {i, j}
    return found


def _torn(step: Floats, out: Floats, other_out: Floats) -> bool:
    """Return whether two ends face each other across a row or a column, shifted along it.

    So an image is torn whose halves were taken one after another, or put together.
    """
    across = int(np.argmin(np.abs(step)))
    return (
        float(np.abs(step).min()) < TORN_PX
        and float(np.abs(step).max()) < TORN_REACH_PX
        and float(out @ other_out) < -0.8
        and float(out[across] * other_out[across]) < -0.1
    )


def outward(line: Floats, at: int) -> Floats:
    """Return the direction in which a line leaves its first (0) or last (-1) point."""
    inner = min(8, len(line) - 1)
    step = line[0] - line[inner] if at == 0 else line[-1] - line[-1 - inner]
    return np.asarray(step / max(float(np.linalg.norm(step)), 1e-9))


@dataclass(frozen=True, slots=True, eq=False)
class Fragment:
    """A piece that stands out and belongs to no fibre: its pixels at full size, and their grey."""

    points: Floats
    width: float
    area: float
    grey: float

    def continues(self, scene: Scene, course: Course) -> bool:
        """Return whether a fibre may go on with it behind one of its ends."""
        if self.area < LEAST_AREA * course.width**2 or not _alike(self.width, course.width):
            return False
        typical = middle(course.contrast[course.good]) if course.good.any() else 0.0
        for at, end in zip((0, -1), course.ends, strict=True):
            if end.kind is not EndKind.FREE:
                continue
            if not _alike(scene.sign * (self.grey - float(course.ground[at])), typical):
                continue
            away = self.points - course.line[at]
            gap = float(np.linalg.norm(away, axis=1).min())
            ahead = away.mean(axis=0)
            ahead /= max(float(np.linalg.norm(ahead)), 1e-9)
            # As near as the end of a fibre would have to be in `continued`.
            if gap < 1.8 * course.width + 6.0 or (
                gap < 4.0 * course.width + 30.0 and float(outward(course.line, at) @ ahead) > AHEAD
            ):
                return True
        return False


def _alike(one: float, other: float) -> bool:
    return ALIKE * other < one < other / ALIKE


def broken_off(scene: Scene, courses: Sequence[Course], explained: ByteMask) -> set[int]:
    """Return the fibres behind an end of which lies a fragment as thick and dark as they are.

    Parameters
    ----------
    explained : ndarray, shape of the reduced image, uint8
        Where fibres lie.
    """
    if not courses:
        return set()
    least = LEAST_AREA * min(course.width for course in courses) ** 2
    return {
        index
        for fragment in _fragments(scene, explained, least)
        for index, course in enumerate(courses)
        if fragment.continues(scene, course)
    }


def _fragments(scene: Scene, explained: ByteMask, least: float) -> Iterator[Fragment]:
    rest = ((scene.taken > 0) & (explained == 0)).view(np.uint8)
    _, labels, boxes, _ = cv2.connectedComponentsWithStats(rest, connectivity=8)
    depth = cv2.distanceTransform(rest, cv2.DIST_L2, 5)
    for label in np.flatnonzero(boxes[:, cv2.CC_STAT_AREA] * scene.factor**2 >= least)[1:]:
        x, y, across, down, area = (int(each) for each in boxes[label])
        part = (slice(y, y + down), slice(x, x + across))
        own = labels[part] == label
        points = scene.full(np.argwhere(own)[:, ::-1].astype(np.float64) + np.array([x, y]))
        grey = sample(scene.image, *points.T.astype(np.float32)[:, None])
        # Its own level, and not that of its edges: what is farthest from the ground.
        share = 0.8 if scene.sign > 0 else 0.2
        yield Fragment(
            points,
            (2.0 * float(depth[part][own].max()) - 0.5) * scene.factor,
            float(area * scene.factor**2),
            quantile(grey.astype(np.float64), share),
        )
