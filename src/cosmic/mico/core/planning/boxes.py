"""Asks the gate about legs of a path: each is a box of all points that its axes can have."""

import math
from collections import Counter, deque
from dataclasses import replace
from typing import Final

from cosmic.frame.clock import WALL
from cosmic.frame.errors import refusal
from cosmic.mico.core.collision.answer import Approach
from cosmic.mico.core.collision.checker import AxisSpan, Spans
from cosmic.mico.core.collision.model import BodyPair, SceneModel
from cosmic.mico.core.collision.sweep import Sweep
from cosmic.mico.core.collision.words import cannot_check
from cosmic.mico.core.planning.problem import Problem
from cosmic.mico.core.planning.space import Path, Point, Space, between

SHORTEST_UM: Final = 20.0
"""A straight path is not cut into shorter legs than this."""


POINT_UM: Final = 1e-3
"""A point is asked about as a box of this half width: the gate takes a box without any width for
a movement that brings nothing closer."""


class Effort:
    """How much more may be asked: until a time on the wall, and a number of questions."""

    def __init__(self, budget_s: float) -> None:
        self._until_s = WALL.now_s() + budget_s
        self.checks = 0

    @property
    def spent(self) -> bool:
        """The time is over."""
        return not WALL.now_s() < self._until_s


class Boxes:
    """Legs between points, each judged as a joint box by the gate.

    After the time is over every leg counts as refused, until it is `certified`.
    """

    def __init__(self, sweep: Sweep, problem: Problem, space: Space, effort: Effort) -> None:
        self.space = space
        self.effort = effort
        self.refused: Counter[BodyPair] = Counter()
        self.detour_height = sweep.model.detour_height
        self._sweep = sweep
        self._others: Spans = {
            **{axis: AxisSpan(point, point, point) for axis, point in problem.start.items()},
            **problem.others,
        }
        over = {drive.axis: drive.overshoot for drive in sweep.model.drives}
        self._point = tuple(POINT_UM / weight for weight in space.weights)
        self._slack = tuple(
            max(over[axis], least) for axis, least in zip(space.axes, self._point, strict=True)
        )
        self._legs: dict[tuple[Point, Point], bool] = {}
        self._free: dict[Point, bool] = {}
        self._edges: dict[tuple[Point, Point, int], Path | None] = {}

    # Points

    def free(self, point: Point) -> bool:
        """Return whether the axes can be at a point, with overshoot and to spare."""
        known = self._free.get(point)
        if known is None:
            if self.effort.spent:
                return False
            known = self._free[point] = self.touch_at(point) is None
        return known

    def touch_at(self, point: Point) -> Approach | None:
        """Return what is too close with the axes at a point, or within their overshoot of it."""
        return self._ask(self._sweep, self._standing(point))

    def touch_exactly_at(self, point: Point) -> Approach | None:
        """Return what is too close with the axes at a point, without overshoot."""
        model = self._sweep.model
        drives = tuple(replace(drive, overshoot=0.0) for drive in model.drives)
        return self._ask(Sweep(replace(model, drives=drives)), self._standing(point))

    def _standing(self, point: Point) -> Spans:
        spans = dict(self._others)
        for axis, value, half in zip(self.space.axes, point, self._point, strict=True):
            spans[axis] = AxisSpan(value - half, value + half, moving=True)
        return spans

    def gap_at(self, point: Point) -> float | None:
        """Return the least distance of two watched bodies with the axes at a point, um.

        The other axes stand where they rest, or in the middle of where they may be.
        """
        model = self._sweep.model
        pose = {
            axis: _middle(model, axis, span)
            for axis, span in self._others.items()
            if axis in model.axes
        }
        near = self._sweep.nearest({**pose, **self.space.named(point)})
        return None if near is None else near.distance_um

    # Legs

    def clear(self, here: Point, there: Point) -> bool:
        """Return whether the axes may go from one point to another, in any step with each other."""
        key = (here, there) if here <= there else (there, here)
        known = self._legs.get(key)
        if known is None:
            if self.effort.spent:
                return False
            known = self._legs[key] = self.touch(here, there) is None
        return known

    def touch(self, here: Point, there: Point) -> Approach | None:
        """Return what is too close somewhere on a leg.

        Where an axis rests, it may have stopped short of its target, or gone too far.
        """
        spans = dict(self._others)
        for axis, one, other, slack in zip(self.space.axes, here, there, self._slack, strict=True):
            if one == other:
                spans[axis] = AxisSpan(one - slack, one + slack)
            else:
                spans[axis] = AxisSpan(min(one, other), max(one, other), moving=True)
        return self._ask(self._sweep, spans)

    def touch_tight(self, here: Point, there: Point, *, leaving: bool) -> Approach | None:
        """Return what is too close on a leg beside something, where there is nothing to spare.

        Parameters
        ----------
        leaving : bool
            It begins with all axes exactly at `here`, so that bodies closer than their margin
            may move apart.
        """
        spans = dict(self._others)
        for axis, one, other in zip(self.space.axes, here, there, strict=True):
            now = one if leaving or one == other else None
            spans[axis] = AxisSpan(min(one, other), max(one, other), now, moving=one != other)
        return self._ask(self._sweep, spans)

    def edge(self, here: Point, there: Point, most: int) -> Path | None:
        """Return the corners of the straight path as legs that are clear; None where it is not.

        The path is halved until every leg is clear. `here` is not among the corners.
        """
        one, other = (here, there) if here <= there else (there, here)
        key = (one, other, most)
        if key not in self._edges:
            found = self._cut(one, other, most)
            if found is None and self.effort.spent:
                return None
            self._edges[key] = found
        path = self._edges[key]
        if path is None:
            return None
        return path[1:] if one is here else path[-2::-1]

    def _cut(self, one: Point, other: Point, most: int) -> Path | None:
        """Return all corners from `one` to `other`, coarse legs first to fail soon."""
        length = self.space.distance(one, other)
        todo = deque([(0.0, 1.0)])
        corners = [0.0]
        while todo:
            begin, end = todo.popleft()
            if self.clear(between(one, other, begin), between(one, other, end)):
                corners.append(end)
                continue
            middle = (begin + end) / 2.0
            if (
                len(corners) + len(todo) + 1 > most
                or (end - begin) * length < 2.0 * SHORTEST_UM
                or not self.free(between(one, other, middle))
            ):
                return None
            todo.extend(((begin, middle), (middle, end)))
        return tuple(between(one, other, share) for share in sorted(corners))

    def _ask(self, sweep: Sweep, spans: Spans) -> Approach | None:
        """Return what is too close, None where everything is clear.

        Raises
        ------
        MoveRefused
            The gate has no answer.
        """
        self.effort.checks += 1
        answer = sweep.check(spans)
        if answer.clear:
            return None
        if answer.approach is None:
            raise refusal(cannot_check(answer.reason or "no reason given"))
        self.refused[answer.approach.bodies] += 1
        return answer.approach


def _middle(model: SceneModel, axis: str, span: AxisSpan) -> float:
    """Return where an axis stands, or the middle of where it may be."""
    if span.now is not None:
        return span.now
    low, high = model.travel(axis)
    middle = (max(span.low, low) + min(span.high, high)) / 2.0
    return middle if math.isfinite(middle) else 0.0
