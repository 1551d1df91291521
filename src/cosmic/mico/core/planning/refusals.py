"""What the planner tells the operator when there is no path."""

from cosmic.mico.core.collision.answer import Approach
from cosmic.mico.core.planning.boxes import Boxes
from cosmic.mico.core.planning.problem import NoPath
from cosmic.mico.core.planning.space import Point, between

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
