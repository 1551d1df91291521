"""Pieces too short to be fibres that lie where one ends: it is broken, or hidden in between."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np

from cosmic.vico.core.vision.checks import outward
from cosmic.vico.core.vision.ends import EndKind
from cosmic.vico.core.vision.grey import Floats, Mask, middle, quantile
from cosmic.vico.core.vision.profiles import Scene, sample
from cosmic.vico.core.vision.refine import Course

ALIKE: Final = 0.7
"""Of width and contrast of the fibre, and no more than the inverse: dust is as thick seldom."""
LEAST_AREA: Final = 0.8
"""Squares of the fibre's width."""
AHEAD: Final = 0.9
"""Cosine of how far off its direction a fibre may go on."""


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
            # As near as the end of a fibre would have to be: checks.continued.
            if gap < 1.8 * course.width + 6.0 or (
                gap < 4.0 * course.width + 30.0 and float(outward(course.line, at) @ ahead) > AHEAD
            ):
                return True
        return False


def _alike(one: float, other: float) -> bool:
    return ALIKE * other < one < other / ALIKE


def broken_off(scene: Scene, courses: Sequence[Course], explained: Mask) -> set[int]:
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


def _fragments(scene: Scene, explained: Mask, least: float) -> Iterator[Fragment]:
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
