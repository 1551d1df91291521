"""Paths that an operator would choose: straight on, one axis after the other, up and over."""

from collections.abc import Iterator, Mapping
from itertools import combinations

from cosmic.mico.core.planning.boxes import Boxes
from cosmic.mico.core.planning.space import Path, Point, Space


def one_by_one(boxes: Boxes, here: Point, there: Point, up: Mapping[int, float]) -> Path | None:
    """Return legs that move axes one after the other, those left over at once where possible.

    Parameters
    ----------
    up : mapping of float
        Highest points of lifting axes, by number: those that go up go first, down last.
    """
    hopeless: set[Point] = set()

    def rank(number: int) -> int:
        if number not in up:
            return 1
        return 0 if abs(there[number] - up[number]) < abs(here[number] - up[number]) else 2

    order = sorted(range(len(here)), key=rank)

    def onwards(at: Point) -> Path | None:
        if at == there:
            return ()
        if at in hopeless:
            return None
        if boxes.clear(at, there):
            return (there,)
        for number in order:
            following = (*at[:number], there[number], *at[number + 1 :])
            if following not in (at, there) and boxes.clear(at, following):
                rest = onwards(following)
                if rest is not None:
                    return (following, *rest)
        hopeless.add(at)
        return None

    return onwards(here)


def detour(boxes: Boxes, here: Point, there: Point, heights: Mapping[str, float]) -> Path | None:
    """Return a path that retracts, travels and descends.

    Lifting axes go to their detour height, the fewest first; where that does not help, any one
    axis goes to one of its ends.
    """
    up = lifts(boxes.space, heights)
    found = [
        path
        for path in (over(boxes, here, there, lifted, up) for lifted in _choices(up))
        if path is not None
    ]
    if found:
        return min(found, key=lambda path: boxes.space.length((here, *path)))
    for lifted in _ends(boxes.space):
        path = over(boxes, here, there, lifted, up)
        if path is not None:
            return path
    return None


def lifts(space: Space, heights: Mapping[str, float]) -> dict[int, float]:
    """Return how high the lifting axes go, within their limits, by number of axis."""
    return {
        number: min(max(heights[axis], space.low[number]), space.high[number])
        for number, axis in enumerate(space.axes)
        if axis in heights
    }


def _choices(up: Mapping[int, float]) -> Iterator[Mapping[int, float]]:
    for count in range(1, len(up) + 1):
        for chosen in combinations(up, count):
            yield {number: up[number] for number in chosen}


def _ends(space: Space) -> Iterator[Mapping[int, float]]:
    for number in range(len(space.axes)):
        yield {number: space.low[number]}
        yield {number: space.high[number]}


def over(
    boxes: Boxes, here: Point, there: Point, lifted: Mapping[int, float], up: Mapping[int, float]
) -> Path | None:
    """Return a path on which the axes `lifted` are up while the others travel."""
    above, beyond = (
        _raised(boxes.space, here, there, lifted),
        _raised(boxes.space, there, here, lifted),
    )
    path: Path = ()
    for begin, end in ((here, above), (above, beyond), (beyond, there)):
        leg = one_by_one(boxes, begin, end, up)
        if leg is None:
            return None
        path += leg
    return path


def _raised(space: Space, point: Point, other: Point, lifted: Mapping[int, float]) -> Point:
    """Return `point` with some axes lifted; one that is higher at either end stays there."""
    raised = list(point)
    for number, height in lifted.items():
        upwards = height >= (space.low[number] + space.high[number]) / 2.0
        ends = (height, point[number], other[number])
        raised[number] = max(ends) if upwards else min(ends)
    return tuple(raised)
