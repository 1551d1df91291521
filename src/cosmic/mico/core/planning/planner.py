"""The path from one point of some axes to another: what is simplest first, then a search.

Where there is none, what the operator is told.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

from cosmic.mico.core.collision.answer import Approach
from cosmic.mico.core.collision.sweep import Sweep
from cosmic.mico.core.planning.boxes import Boxes, Effort
from cosmic.mico.core.planning.detour import detour, lifts, one_by_one
from cosmic.mico.core.planning.problem import NoPath, Plan, Problem, Segment, validate
from cosmic.mico.core.planning.rrt_connect import MOST_LEGS, search
from cosmic.mico.core.planning.simplify import legs, shorten
from cosmic.mico.core.planning.space import DIGITS, Path, Point, Space, between

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


LONG: Final = 1.5
"""A path this many times as long as the straight one is worth a search for a better one."""
GOOD: Final = 1.1
"""A path not longer than this many times the straight one is left as it is."""
WORTH_LEGS: Final = 0.95
"""Cutting the corners of a simple path makes more legs; it must save this much of its length."""
CHECKS_NEAR: Final = 60
CHECKS_SEARCHED: Final = 400
"""Questions to the gate that cutting corners may cost, for a simple path and for one searched."""
MOST_CORNERS: Final = 20
"""Of a path with more corners the clearance is not worked out."""
FEW_STEPS: Final = 8
"""An edge that cuts the corner of a simple path is driven in at most so many legs."""
MOST_STEPS: Final = 16
"""The straight path is driven in at most so many legs."""


@dataclass(frozen=True)
class _Found:
    """A path in clear legs, with its first point, and how long it was before it was shortened."""

    method: str
    path: Path
    found_length: float


def plan_path(sweep: Sweep, problem: Problem) -> Plan | NoPath:
    """Return a path from start to goal on which every leg is clear, or what blocks it.

    Straight at once, in steps, one axis after the other, up and over, and only then a search by
    chance, which is the same for the same seed as long as the time suffices.

    Raises
    ------
    UnknownAxisError, MoveRefused
        The problem makes no sense, or the gate has no answer.
    """
    validate(sweep.model, problem)
    space = Space(sweep.model, problem)
    boxes = Boxes(sweep, problem, space, Effort(problem.budget_s))
    if space.start == space.goal:
        return _plan(problem, boxes, _Found("straight", (space.start,), 0.0))
    ends = _ends(boxes)
    if isinstance(ends, NoPath):
        return ends
    here, there = ends
    found = _Found("straight", (here,), 0.0) if here == there else _best(boxes, problem, ends)
    if found is None:
        return no_path(boxes, here, there)
    before = () if here == space.start else (space.start,)
    after = () if there == space.goal else (space.goal,)
    whole = _Found(found.method, before + found.path + after, found.found_length)
    if not _certified(boxes, whole.path, leaving=bool(before), arriving=bool(after)):
        return no_path(boxes, here, there)
    return _plan(problem, boxes, whole)


def _ends(boxes: Boxes) -> tuple[Point, Point] | NoPath:
    """Return where the axes move freely from the start, and until shortly before the goal."""
    start, goal = boxes.space.start, boxes.space.goal
    here, there = start, goal
    if not boxes.free(goal):
        touch = boxes.touch_exactly_at(goal)
        if touch is not None:
            return at_goal(touch)
        before = arrival(boxes, goal)
        if before is None:
            return too_tight(boxes.touch_at(goal))
        there = before
    if not (boxes.free(start) and boxes.space.contains(start)):
        after = departure(boxes, start, there)
        if after is None:
            return at_start(boxes, boxes.touch_at(start))
        here = after
    return here, there


def _best(boxes: Boxes, problem: Problem, ends: tuple[Point, Point]) -> _Found | None:
    """Return the shortest path that was found, None where there is none."""
    space = boxes.space
    near = _nearby(boxes, *ends)
    straight = space.distance(*ends)
    if near is not None:
        if near.method in ("straight", "steps"):
            return near
        if space.length(near.path) > GOOD * straight:
            near = _shortened(boxes, near, problem.seed)
        if space.length(near.path) <= LONG * straight and not problem.optimise:
            return near
    found = [near]
    seed = problem.seed
    while not boxes.effort.spent:
        found.append(_searched(boxes, *ends, seed))
        if not problem.optimise:
            break
        seed += 1
    paths = [each for each in found if each is not None]
    return min(paths, key=lambda each: space.length(each.path), default=None)


def _nearby(boxes: Boxes, here: Point, there: Point) -> _Found | None:
    """Return a path that an operator would choose."""
    edge = boxes.edge(here, there, MOST_STEPS)
    if edge is not None:
        method = "straight" if len(edge) == 1 else "steps"
        return _in_legs(boxes, method, (here, there), MOST_STEPS)
    serial = one_by_one(boxes, here, there, lifts(boxes.space, boxes.detour_height))
    if serial is not None:
        return _in_legs(boxes, "one by one", (here, *serial), 1)
    path = detour(boxes, here, there, boxes.detour_height)
    return None if path is None else _in_legs(boxes, "detour", (here, *path), 1)


def _searched(boxes: Boxes, here: Point, there: Point, seed: int) -> _Found | None:
    corners = search(boxes, here, there, seed)
    if corners is None:
        return None
    raw = (here, *corners)
    path = shorten(boxes, raw, seed, MOST_LEGS, CHECKS_SEARCHED)
    return _in_legs(boxes, "search", path, MOST_LEGS, boxes.space.length(raw))


def _shortened(boxes: Boxes, found: _Found, seed: int) -> _Found:
    """Return the path with its corners cut, where that saves enough to be worth more legs."""
    path = shorten(boxes, found.path, seed, FEW_STEPS, CHECKS_NEAR)
    cut = _in_legs(boxes, found.method, path, FEW_STEPS, found.found_length)
    length = boxes.space.length(found.path)
    worthwhile = cut is not None and boxes.space.length(cut.path) < WORTH_LEGS * length
    return cut if cut is not None and worthwhile else found


def _in_legs(
    boxes: Boxes, method: str, path: Sequence[Point], most: int, before: float | None = None
) -> _Found | None:
    driven = legs(boxes, path, most)
    if driven is None:
        return None
    return _Found(method, driven, boxes.space.length(path) if before is None else before)


def _certified(boxes: Boxes, path: Path, *, leaving: bool, arriving: bool) -> bool:
    """Ask once more about every leg as it will be driven, with nothing remembered."""
    for number, (one, other) in enumerate(pairwise(path)):
        if (leaving and number == 0) or (arriving and number == len(path) - 2):
            touch = boxes.touch_tight(one, other, leaving=leaving and number == 0)
        else:
            touch = boxes.touch(one, other)
        if touch is not None:
            return False
    return True


def _plan(problem: Problem, boxes: Boxes, found: _Found) -> Plan:
    space = boxes.space
    pairs = pairwise(found.path)
    return Plan(
        start=dict(problem.start),
        segments=tuple(_segment(space, one, other) for one, other in pairs),
        method=found.method,
        length=space.length(found.path),
        straight_length=space.distance(space.start, space.goal),
        found_length=found.found_length,
        clearance_um=_clearance_um(boxes, found.path),
    )


def _clearance_um(boxes: Boxes, path: Path) -> float | None:
    if len(path) > MOST_CORNERS:
        return None
    gaps = [gap for point in path if (gap := boxes.gap_at(point)) is not None]
    return min(gaps, default=None)


def _segment(space: Space, one: Point, other: Point) -> Segment:
    targets = zip(space.axes, one, other, strict=True)
    return Segment({axis: target for axis, before, target in targets if target != before})


_HALVINGS = 7


def at_goal(touch: Approach) -> NoPath:
    """Return the answer to a goal that is too close to something itself."""
    return NoPath(
        f"the goal itself is blocked: {_gap(touch)}; choose another goal, or move one of the two "
        "aside first",
        touch,
    )


def too_tight(touch: Approach | None) -> NoPath:
    """Return the answer to a goal that is free but leaves no axis room to arrive."""
    return NoPath(
        "the goal is so close to something that no axis can arrive without overshooting into the "
        f"margin: {_gap(touch)}; choose a goal a little farther away",
        touch,
    )


def at_start(boxes: Boxes, touch: Approach | None) -> NoPath:
    """Return the answer to a start from which no retreat was found."""
    why = "the time ran out" if boxes.effort.spent else "no axis alone leads out of it"
    return NoPath(
        f"the start is too close to something and {why}: {_gap(touch)}; they may only retreat: "
        "move them away from each other by hand",
        touch,
    )


def no_path(boxes: Boxes, here: Point, there: Point) -> NoPath:
    """Return the answer to a search that found nothing."""
    late = boxes.effort.spent
    reached, touch = _reached(boxes, here, there)
    others = [pair for pair, _ in boxes.refused.most_common(3)]
    blocking = "; ".join(f"{one} and {other}" for one, other in others)
    why = "no path found in the time given" if late else "no path found"
    return NoPath(
        f"{why}: straight on, {_gap(touch)}; most often blocking: {blocking or 'nothing'}; "
        "move one of them aside first, or go there by hand in several steps",
        touch,
        boxes.space.named(reached) if reached != here else {},
    )


def _reached(boxes: Boxes, here: Point, there: Point) -> tuple[Point, Approach | None]:
    """Return how far the straight path can be followed, and what blocks it there.

    Asks a few questions more, whatever time it is.
    """
    touch = boxes.touch(here, there)
    if touch is None:
        return there, None
    at, length = 0.0, 1.0
    for _ in range(_HALVINGS):
        length /= 2.0
        ahead = boxes.touch(between(here, there, at), between(here, there, at + length))
        if ahead is None:
            at += length
        else:
            touch = ahead
    return between(here, there, at), touch


def _gap(touch: Approach | None) -> str:
    if touch is None:
        return "nothing that could be named"
    one, other = touch.bodies
    x, y, z = (f"{value / 1000.0:.2f}" for value in touch.place_um)
    apart = "touch" if touch.distance_um <= 0.0 else f"come within {touch.distance_um:.3g} µm"
    return f"{one} and {other} {apart} (margin {touch.margin_um:.3g} µm) at ({x}, {y}, {z}) mm"
