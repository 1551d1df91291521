"""Gets away from a start that is too close to something, and to a goal with nothing to spare."""

from collections.abc import Iterator
from typing import Final

from cosmic.mico.core.planning.boxes import Boxes
from cosmic.mico.core.planning.space import DIGITS, Point

STEPS_UM: Final = (5.0, 20.0, 100.0, 500.0, 2500.0)


def departure(boxes: Boxes, start: Point, goal: Point) -> Point | None:
    """Return a point free for every axis to which the axes can retreat: the goal, or one near."""
    inside = boxes.space.clipped(start)
    for point in (goal, inside, *_around(boxes, inside)):
        if boxes.effort.spent:
            return None
        if point == start or not boxes.free(point):
            continue
        if boxes.touch_tight(start, point, leaving=True) is None:
            return point
    return None


def arrival(boxes: Boxes, goal: Point) -> Point | None:
    """Return a free point from which one axis can bring everything to the goal."""
    for point in _around(boxes, goal):
        if boxes.effort.spent:
            return None
        if boxes.free(point) and boxes.touch_tight(point, goal, leaving=False) is None:
            return point
    return None


def _around(boxes: Boxes, point: Point) -> Iterator[Point]:
    """Yield points beside one, each off by one axis, the nearest first."""
    space = boxes.space
    for step_um in STEPS_UM:
        for number, weight in enumerate(space.weights):
            for step in (step_um / weight, -step_um / weight):
                value = round(point[number] + step, DIGITS)
                beside = space.clipped((*point[:number], value, *point[number + 1 :]))
                if beside != point:
                    yield beside
