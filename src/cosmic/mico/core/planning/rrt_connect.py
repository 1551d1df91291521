"""Search for a path by two random trees, on edges that the gate has proved."""

import random
from typing import Final

import numpy as np

from cosmic.mico.core.planning.boxes import Boxes
from cosmic.mico.core.planning.space import DIGITS, Path, Point, Space, between

MOST_LEGS: Final = 24
"""An edge of a tree is not cut into more legs: a path with many stops is slow to drive."""
STEP_SHARE: Final = 0.2
"""How far a tree grows at once, as a share of the diagonal of the workspace."""
ONE_AXIS: Final = 1.5
"""Divided by the number of axes, how often only one of them grows: one question proves such an
edge, and a passage between bodies on stages is mostly along one of them."""
SHORTEST_SHARE: Final = 1.0 / 32.0
"""A step that was blocked is halved the next time, down to this share of the full one."""


def search(boxes: Boxes, here: Point, there: Point, seed: int) -> Path | None:
    """Return corners of a path, each edge of which can be driven in clear legs; None if none found.

    The same seed gives the same path, as long as the time suffices.

    Notes
    -----
    J. J. Kuffner and S. M. LaValle, "RRT-Connect: an efficient approach to single-query path
    planning", ICRA 2000: a tree from each end grows towards random points, and the other tree
    then grows towards what was added as far as it can. An edge is in a tree only when the gate
    has proved it. Steps get shorter where a tree was blocked, as in L. Jaillet and others,
    "Adaptive tuning of the sampling domain for dynamic-domain RRTs", IROS 2005: that leads
    into narrow passages.
    """
    space = boxes.space
    chance = random.Random(seed)
    ahead, behind = _Tree(boxes, here), _Tree(boxes, there)
    one_axis = ONE_AXIS / len(here)
    while not boxes.effort.spent:
        only = chance.randrange(len(here)) if chance.random() < one_axis else None
        reached = ahead.grow(_anywhere(space, chance), only)
        if reached is not None:
            met = behind.connect(ahead.points[reached])
            if met is not None:
                return _joined(ahead, reached, behind, met, here)
        ahead, behind = behind, ahead
    return None


class _Tree:
    """Points that can be reached from one end, each with the one that it was reached from."""

    def __init__(self, boxes: Boxes, root: Point) -> None:
        self.points = [root]
        self._boxes = boxes
        self._weights = np.array(boxes.space.weights)
        self._came_from = [0]
        self._places_um = np.empty((64, len(root)))
        self._places_um[0] = self._weights * root
        self._steps_um = [STEP_SHARE * boxes.space.diagonal]
        self._least_um = SHORTEST_SHARE * self._steps_um[0]

    def grow(self, target: Point, only: int | None = None) -> int | None:
        """Add one point towards `target`; return its number, None where it is blocked.

        Parameters
        ----------
        only : int or None
            The one axis that moves; all where None.
        """
        near = self._nearest(target)
        begin = self.points[near]
        if only is not None:
            target = (*begin[:only], target[only], *begin[only + 1 :])
        away_um = self._boxes.space.distance(begin, target)
        step_um = self._steps_um[near]
        if away_um > step_um:
            target = _rounded(self._boxes.space, between(begin, target, step_um / away_um))
        if target == begin:
            return None
        if self._boxes.free(target) and self._boxes.edge(begin, target, MOST_LEGS) is not None:
            return self._add(target, near)
        self._steps_um[near] = max(self._least_um, min(step_um, away_um) / 2.0)
        return None

    def connect(self, target: Point) -> int | None:
        """Grow towards `target` as far as possible; return its number, None if not reached."""
        while (added := self.grow(target)) is not None:
            if self.points[added] == target:
                return added
        return None

    def path_to(self, number: int) -> Path:
        """Return the points from the root to one."""
        found = [self.points[number]]
        while number:
            number = self._came_from[number]
            found.append(self.points[number])
        return tuple(reversed(found))

    def _add(self, point: Point, came_from: int) -> int:
        number = len(self.points)
        if number == len(self._places_um):
            self._places_um = np.concatenate((self._places_um, np.empty_like(self._places_um)))
        self._places_um[number] = self._weights * point
        self.points.append(point)
        self._came_from.append(came_from)
        self._steps_um.append(STEP_SHARE * self._boxes.space.diagonal)
        return number

    def _nearest(self, point: Point) -> int:
        apart_um = self._places_um[: len(self.points)] - self._weights * point
        return int(np.argmin(np.einsum("ij,ij->i", apart_um, apart_um)))


def _joined(one: _Tree, reached: int, other: _Tree, met: int, here: Point) -> Path:
    """Return the path through the point where two trees have met, without its first point."""
    if one.points[0] != here:
        one, reached, other, met = other, met, one, reached
    return one.path_to(reached)[1:] + other.path_to(met)[-2::-1]


def _anywhere(space: Space, chance: random.Random) -> Point:
    return _rounded(space, tuple(map(chance.uniform, space.low, space.high)))


def _rounded(space: Space, point: Point) -> Point:
    return space.clipped(tuple(round(value, DIGITS) for value in point))
