"""Makes a path shorter by cutting corners, and its legs fewer; every cut is proved by the gate."""

import random
from collections.abc import Sequence
from itertools import pairwise
from typing import Final

from cosmic.mico.core.planning.boxes import Boxes
from cosmic.mico.core.planning.space import DIGITS, Path, Point, between

CUTS: Final = 40
"""Random cuts tried."""
IN_VAIN: Final = 12
"""It is left at that after so many cuts in a row that were of no use."""
WORTHWHILE: Final = 0.002
"""A cut that shortens the path by less, as a share, is of no use."""
HALVINGS: Final = 4
"""How closely the largest cut of a corner is found: to a sixteenth of its edges."""


def shorten(boxes: Boxes, path: Sequence[Point], seed: int, most: int, checks: int) -> Path:
    """Return a shorter path of clear edges between the same ends.

    Parameters
    ----------
    path : sequence of points
        With both ends; its edges can be driven in `most` legs each.
    checks : int
        It is left at that after so many questions to the gate.
    """
    chance = random.Random(seed)
    until = boxes.effort.checks + checks
    best = _corners_cut(boxes, _skip(boxes, path, most), most, until)
    in_vain = 0
    for _ in range(CUTS):
        if len(best) < 3 or in_vain >= IN_VAIN or boxes.effort.checks >= until:
            break
        cut = _cut(boxes, best, chance, most)
        before = boxes.space.length(best)
        useful = cut is not None and boxes.space.length(cut) < before * (1.0 - WORTHWHILE)
        in_vain = 0 if useful else in_vain + 1
        if cut is not None and useful:
            best = cut
    return _skip(boxes, best, most) if boxes.effort.checks < until else best


def _corners_cut(boxes: Boxes, path: Path, most: int, until: int) -> Path:
    """Cut every corner once, as far as its two edges and the gate allow."""
    cut = [path[0]]
    for number in range(1, len(path) - 1):
        before, corner, after = cut[-1], path[number], path[number + 1]
        if boxes.effort.checks >= until:
            cut.append(corner)
            continue
        cut.extend(_cut_off(boxes, (before, corner, after), most))
    return (*cut, *path[len(path) - 1 :])


def _cut_off(boxes: Boxes, corner: tuple[Point, Point, Point], most: int) -> Path:
    """Return the two points between which the largest part of a corner is cut off, or itself."""
    before, at, after = corner
    best: Path = (at,)
    share, step = 0.5, 0.25
    for _ in range(HALVINGS):
        one, other = _rounded(between(at, before, share)), _rounded(between(at, after, share))
        pieces = ((before, one), (one, other), (other, after))
        good = all(boxes.edge(*piece, most) is not None for piece in pieces[1::-1] + pieces[2:])
        if good:
            best = (one, other)
        share += step if good else -step
        step /= 2.0
    return best


def _skip(boxes: Boxes, path: Sequence[Point], most: int) -> Path:
    """Go from each corner straight to the farthest one that can be reached."""
    kept = [path[0]]
    at = 0
    while at < len(path) - 1:
        following = at + 1
        for farther in range(len(path) - 1, at + 1, -1):
            if boxes.edge(path[at], path[farther], most) is not None:
                following = farther
                break
        kept.append(path[following])
        at = following
    return tuple(kept)


def _cut(boxes: Boxes, path: Path, chance: random.Random, most: int) -> Path | None:
    """Return the path with a straight edge between two of its points, None if blocked."""
    first, second = sorted(chance.sample(range(len(path) - 1), 2))
    begin = _on(path, first, chance)
    end = _on(path, second, chance)
    for one, other in ((path[first], begin), (begin, end), (end, path[second + 1])):
        if one != other and boxes.edge(one, other, most) is None:
            return None
    middle = [point for point in (begin, end) if point not in (path[first], path[second + 1])]
    return (*path[: first + 1], *middle, *path[second + 1 :])


def _on(path: Path, edge: int, chance: random.Random) -> Point:
    return _rounded(between(path[edge], path[edge + 1], chance.random()))


def _rounded(point: Point) -> Point:
    return tuple(round(value, DIGITS) for value in point)


def legs(boxes: Boxes, path: Sequence[Point], most: int) -> Path | None:
    """Return the corners of the legs of a path, as few as can be found by joining neighbours.

    None when one of its edges is not clear after all.
    """
    corners = [path[0]]
    for one, other in pairwise(path):
        edge = boxes.edge(one, other, most)
        if edge is None:
            return None
        corners.extend(edge)
    return _joined(boxes, corners)


def _joined(boxes: Boxes, corners: Sequence[Point]) -> Path:
    kept = [corners[0]]
    at = 0
    while at < len(corners) - 1:
        reach = at + 1
        while reach < len(corners) - 1 and boxes.clear(corners[at], corners[reach + 1]):
            reach += 1
        kept.append(corners[reach])
        at = reach
    return tuple(kept)
