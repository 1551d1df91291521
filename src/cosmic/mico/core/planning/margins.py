"""Gets away from a start that is too close to something, and to a goal with nothing to spare."""

from collections.abc import Iterator
from typing import Final

from cosmic.mico.core.planning.boxes import Boxes
from cosmic.mico.core.planning.space import DIGITS, Point

STEPS_UM: Final = (5.0, 20.0, 100.0, 500.0, 2500.0)


def departure(boxes: Boxes, start: Point, goal: Point) -> Point | None:
    """Return a place free for every axis to which the axes can retreat: the goal, or one near."""
    inside = boxes.space.clipped(start)
    for place in (goal, inside, *_around(boxes, inside)):
        if boxes.effort.spent:
            return None
        if place == start or not boxes.free(place):
            continue
        if boxes.touch_tight(start, place, leaving=True) is None:
            return place
    return None


def arrival(boxes: Boxes, goal: Point) -> Point | None:
    """Return a free place from which one axis can bring everything to the goal."""
    for place in _around(boxes, goal):
        if boxes.effort.spent:
            return None
        if boxes.free(place) and boxes.touch_tight(place, goal, leaving=False) is None:
            return place
    return None


def _around(boxes: Boxes, place: Point) -> Iterator[Point]:
    """Yield places beside one, each off by one axis, the nearest first."""
    space = boxes.space
    for step_um in STEPS_UM:
        for number, weight in enumerate(space.weights):
            for step in (step_um / weight, -step_um / weight):
                value = round(place[number] + step, DIGITS)
                beside = space.clipped((*place[:number], value, *place[number + 1 :]))
                if beside != place:
                    yield beside
