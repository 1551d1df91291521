"""Lines that are no fibres: drawn into an image as scale bars and frames, or on it twice."""

from collections.abc import Sequence
from itertools import combinations
from typing import Final

import numpy as np

from cosmic.frame.arrays import Floats
from cosmic.vico.core.vision.ends import EndKind
from cosmic.vico.core.vision.grey import middle
from cosmic.vico.core.vision.profiles import Scene, sample
from cosmic.vico.core.vision.refine import Course
from cosmic.vico.core.vision.smoothing import arc_lengths, directions

ASLANT_PX: Final = 0.3
SEVERAL_ASLANT_PX: Final = 0.5
SEVERAL_ASLANT: Final = 2e-3
EVEN_OF_NOISE: Final = 0.8
ONE_LEVEL: Final = 0.98
"""Of the pixels inside, that are as grey as each other."""
NO_LENS_PX: Final = 0.6
"""Edges are sharper than this where no lens has drawn them. Where a fibre is as light as the
camera can tell, its pixels are alike too, and its edges are not as sharp."""
NOISY_STEPS: Final = 0.3
"""Steps of grey, from which noise of the ground would show inside as well."""
POINTS: Final = 9
"""At which courses are compared."""
ALIKE_PX: Final = 1.5
WEAKER: Final = 0.75
"""Of the contrast of another one: then it is the copy."""
QUARTER: Final = np.array([[0.0, 1.0], [-1.0, 0.0]])
MARKS: Final = 3
"""So many lines along rows and columns, or alike and turned by quarters; two may be fibres."""


def drawn(scene: Scene, courses: Sequence[Course]) -> set[int]:
    """Return the lines that are drawn into the image.

    They are of one level with sharp edges on a ground with noise. Those along rows or columns have
    less noise than the ground; or there are several, from end to end on the image or from border
    to border: so many fibres do not come to lie like that.
    """
    even, whole = set(), set()
    for index, course in enumerate(courses):
        aside, length = np.sort(np.ptp(course.line, axis=0)).tolist()
        if (aside <= ASLANT_PX and _is_even(scene, course)) or _is_of_one_level(scene, course):
            even.add(index)
        kinds = {end.kind for end in course.ends}
        if aside <= max(SEVERAL_ASLANT_PX, SEVERAL_ASLANT * length) and (
            kinds in ({EndKind.FREE}, {EndKind.BORDER})
        ):
            whole.add(index)
    several = even | whole
    return several if len(several) >= MARKS else even


def _is_even(scene: Scene, course: Course) -> bool:
    """Return whether a line has less noise than the ground."""
    x, y = (course.line[:, axis].astype(np.float32)[None] for axis in (0, 1))
    levels = sample(scene.image, x, y)[0].astype(np.float64)
    inner = levels[len(levels) // 8 : len(levels) - len(levels) // 8]
    spread = 1.4826 * middle(np.abs(inner - middle(inner)))
    return spread < EVEN_OF_NOISE * course.noise


def _is_of_one_level(scene: Scene, course: Course) -> bool:
    """Return whether the pixels inside are alike, and its edges sharper than through a lens."""
    if not (course.blur_px < NO_LENS_PX and course.noise > NOISY_STEPS * scene.step):
        return False
    tangent = directions(course.line)
    normal = np.column_stack([-tangent[:, 1], tangent[:, 0]])
    part = slice(len(normal) // 8, len(normal) - len(normal) // 8)
    away = np.arange(0.0, 0.25 * course.width)
    away = np.concatenate([-away[:0:-1], away])
    points = course.line[part, None] + away[:, None] * normal[part, None]
    x, y = np.clip(np.round(points), 0, scene.corner).astype(int).reshape(-1, 2).T
    levels = scene.image[y, x].astype(np.float64)
    return float((levels == middle(levels)).mean()) > ONE_LEVEL


def copied(courses: Sequence[Course]) -> set[int]:
    """Return the fibres of which others are copies: moved and stronger, or turned by quarters.

    Fibres as strong as each other may lie side by side alike, as cut and combed.
    """
    shapes = [_shape(course.line) for course in courses]
    contrasts = [middle(each.contrast[each.good]) if each.good.any() else 0.0 for each in courses]
    moved: dict[int, set[int]] = {index: {index} for index in range(len(courses))}
    turned: dict[int, set[int]] = {index: set() for index in range(len(courses))}
    found: set[int] = set()
    for i, j in combinations(range(len(courses)), 2):
        if _same(shapes[i], shapes[j] @ QUARTER):
            turned[i].add(j)
            turned[j].add(i)
        elif _same(shapes[i], shapes[j]):
            moved[i].add(j)
            moved[j].add(i)
            if contrasts[i] < WEAKER * contrasts[j]:
                found.add(i)
            elif contrasts[j] < WEAKER * contrasts[i]:
                found.add(j)
    marks = (i for i in moved if turned[i] and len(moved[i] | turned[i]) >= MARKS)
    return found.union(marks)


def _shape(line: Floats) -> Floats:
    """Return points evenly along a line, around their middle."""
    s = arc_lengths(line)
    at = np.linspace(0.0, float(s[-1]), POINTS)
    points = np.column_stack([np.interp(at, s, line[:, axis]) for axis in (0, 1)])
    return np.asarray(points - points.mean(axis=0))


def _same(one: Floats, other: Floats) -> bool:
    """Return whether two are alike as they are, or turned by half."""
    return any(
        float(np.linalg.norm(one - there, axis=1).max()) < ALIKE_PX
        for there in (other, other[::-1], -other, -other[::-1])
    )
