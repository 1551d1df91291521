"""Find the tips of grippers and of the probe near where the stages say they are."""

import math
from dataclasses import replace
from typing import Final

import numpy as np

from cosmic.frame.errors import ConfigError
from cosmic.vico.core.vision.edges import (
    Blob,
    Body,
    Frame,
    Levels,
    Line,
    blobs,
    levels,
    measure,
    turned,
)
from cosmic.vico.core.vision.grey import middle
from cosmic.vico.core.vision.tool_types import ExpectedTool, GripperTips, NotSeen, ToolEnd
from cosmic.vico.hw.interface import Pixels

Pair = tuple[float, float]

LEAST_KEPT: Final = 0.6
LARGEST_STD_PX: Final = 0.5
# Of a jaw, at which a fibre may lie; and of a probe, which is narrow and often out of focus.
JAW_TOLERANCE: Final = 0.05
PROBE_TOLERANCE: Final = 0.15
WIDTH_TOLERANCE_PX: Final = 1.0
HELD_PART: Final = 0.25
"""Of the width of a gripper that is shut: what it holds may be so thick."""
LARGEST_LEAN_DEG: Final = 8.0
LARGEST_SKEW_DEG: Final = 2.0
FILLED: Final = 0.2
BROADER_PX: Final = 0.6
BROADER: Final = 0.02
BROAD_STD_PX: Final = 0.4
"""Of an inner corner that is reckoned from the outer one: how broad a jaw looks is not exact."""
ROUGHER: Final = 2.0
ONE_SIDED: Final = 4.0
"""A side of a probe that is so much rougher than the other; noise and specks make less than 3."""
ROUGH_STD_PX: Final = 0.1
LARGEST_STEP_PX: Final = 1.5


def find_probe(image: Pixels, expected: ExpectedTool) -> ToolEnd | NotSeen:
    """Find the tip of a probe on a grey image."""
    looked = _look(image, expected)
    if isinstance(looked, NotSeen):
        return looked
    frame, greys, found = looked
    aside = 0.5 * (frame.pixels.shape[0] - 1)
    blob = min(found, key=lambda each: abs(0.5 * (each.low + each.high) - aside))
    body = _body(frame, greys, blob, expected)
    if isinstance(body, NotSeen):
        return body
    end = _tool_end(frame, body, expected, inner_is_high=False)
    if expected.shut or not _touched(body):
        return end
    return replace(end, doubts=(*end.doubts, "something lies against a side of it"))


def find_shut_gripper(image: Pixels, expected: ExpectedTool) -> GripperTips | NotSeen:
    """Find a gripper that looks like one body: its hold is the middle of the front."""
    found = find_probe(image, expected)
    if isinstance(found, NotSeen):
        return found
    std = found.std_px
    return GripperTips(found.tip_px, 0.0, std, std, (found, found), found.doubts)


def find_gripper(image: Pixels, expected: ExpectedTool) -> GripperTips | NotSeen:
    """Find both jaws of a gripper on a grey image."""
    looked = _look(image, expected)
    if isinstance(looked, NotSeen):
        return looked
    frame, greys, found = looked
    pair = _pair(frame, found, expected)
    if isinstance(pair, NotSeen):
        return pair
    bodies = [_body(frame, greys, blob, expected) for blob in pair]
    first, second = bodies
    if isinstance(first, NotSeen):
        return first
    if isinstance(second, NotSeen):
        return second
    return _gripper(frame, greys, (first, second), expected)


def _look(image: Pixels, expected: ExpectedTool) -> tuple[Frame, Levels, list[Blob]] | NotSeen:
    if image.ndim != 2:
        raise ConfigError(f"tool tips: a grey image is needed, not the shape {image.shape}")
    height, width = image.shape
    x, y = expected.tip_px
    if not (0.0 <= x <= width - 1.0 and 0.0 <= y <= height - 1.0):
        return NotSeen(f"its tip is expected at {x:.0f}, {y:.0f} px, off the image")
    frame = turned(
        image,
        expected.tip_px,
        expected.forward,
        back=expected.reach_px + 4.5 * expected.width_px,
        ahead=expected.reach_px + 1.5 * expected.width_px,
        aside=expected.reach_px + 0.5 * expected.gap_px + 2.0 * expected.width_px,
    )
    greys = levels(frame)
    found = [] if greys is None else blobs(frame, greys, expected.width_px)
    if greys is None or not found:
        return NotSeen(
            "no large dark body was found where the tool is expected; check that it is in "
            "view, lit and in focus"
        )
    return frame, greys, found


def _pair(frame: Frame, found: list[Blob], expected: ExpectedTool) -> tuple[Blob, Blob] | NotSeen:
    centre = 0.5 * (frame.pixels.shape[0] - 1)
    half = 0.5 * (expected.gap_px + expected.width_px)
    if len(found) == 1:
        across = found[0].high - found[0].low
        if across > 1.6 * expected.width_px:
            return NotSeen("its jaws cannot be told apart: they are closed, or not in focus")
        return NotSeen("only one of its jaws is seen")
    pairs = [(one, other) for i, one in enumerate(found) for other in found[i + 1 :]]

    def off(pair: tuple[Blob, Blob]) -> float:
        at = [0.5 * (each.low + each.high) - centre for each in pair]
        apart = abs(pair[0].front - pair[1].front)
        return float(abs(at[0] + half) + abs(at[1] - half) + 0.5 * apart)

    return min(pairs, key=off)


def _body(frame: Frame, greys: Levels, blob: Blob, expected: ExpectedTool) -> Body | NotSeen:
    if blob.front >= frame.pixels.shape[1] - 4:
        return NotSeen(f"it reaches more than {expected.reach_px:.0f} px beyond where it should be")
    body = measure(frame, greys, blob, expected.width_px)
    if body is None:
        return NotSeen("its edges cannot be measured; focus, and light it evenly")
    return body


def _tool_end(frame: Frame, body: Body, expected: ExpectedTool, *, inner_is_high: bool) -> ToolEnd:
    corners = (frame.image_px(*body.corner(body.low)), frame.image_px(*body.corner(body.high)))
    lean = 0.5 * (body.low.slope + body.high.slope)
    ahead = frame.forward + lean * frame.side
    x, y = ahead / np.linalg.norm(ahead)
    return ToolEnd(
        frame.image_px(*body.tip),
        (corners[1], corners[0]) if inner_is_high else corners,
        (float(x), float(y)),
        body.width,
        body.std,
        _doubts(body, lean, expected),
    )


def _doubts(body: Body, lean: float, expected: ExpectedTool) -> tuple[str, ...]:
    doubts = []
    kept = min(body.front.kept, body.low.kept, body.high.kept)
    if not kept >= LEAST_KEPT:
        doubts.append("its edges are hidden in part")
    if not body.std <= LARGEST_STD_PX:
        doubts.append(f"its tip is known to {body.std:.1f} px only")
    share = JAW_TOLERANCE if expected.gap_px > 0.0 else PROBE_TOLERANCE
    tolerance_px = max(WIDTH_TOLERANCE_PX, share * expected.width_px)
    wider = body.width - expected.width_px
    if expected.shut:  # what the jaws hold keeps them apart
        wider = min(wider, max(0.0, wider - HELD_PART * expected.width_px))
    if not abs(wider) <= tolerance_px:
        doubts.append(f"it is {body.width:.0f} px wide, and should be {expected.width_px:.0f} px")
    angle_deg = math.degrees(math.atan(abs(lean)))
    if not angle_deg <= LARGEST_LEAN_DEG:
        doubts.append(f"it points {angle_deg:.0f} degrees away from where it should")
    # A fibre that lies across a corner of the front moves that corner.
    skew = abs(body.front.slope + lean)
    if not skew <= math.tan(math.radians(LARGEST_SKEW_DEG)) + body.front.slope_std:
        doubts.append(f"its front is askew by {math.degrees(math.atan(skew)):.0f} degrees")
    return tuple(doubts)


def _gripper(
    frame: Frame, greys: Levels, bodies: tuple[Body, Body], expected: ExpectedTool
) -> GripperTips:
    first, second = bodies
    jaws = (
        _tool_end(frame, first, expected, inner_is_high=True),
        _tool_end(frame, second, expected, inner_is_high=False),
    )
    doubts = [
        f"{which} jaw: {doubt}"
        for which, jaw in zip(("first", "second"), jaws, strict=True)
        for doubt in jaw.doubts
    ]
    step = _step(first, second) - expected.step_px
    if not abs(step) <= LARGEST_STEP_PX:
        doubts.append(f"the second jaw's front lies {step:+.1f} px from where the first's tells")
    width = _true_width(frame, greys, bodies, expected)
    limit = width + max(BROADER_PX, BROADER * width)
    broad = (
        first.width > limit and not _rougher(first.low, first.high),
        second.width > limit and not _rougher(second.high, second.low),
    )
    # What lies against a jaw makes it look broader; its outer edge is free.
    one = _inner(first, first.high, first.low, width if broad[0] else None)
    other = _inner(second, second.low, second.high, -width if broad[1] else None)
    if max(first.width, second.width) > limit:
        doubts.append("something lies against a jaw, which looks broader than the other")
    gap_std = math.hypot(
        (first.low if broad[0] else first.high).std_at(one[0]),
        (second.high if broad[1] else second.low).std_at(other[0]),
        BROAD_STD_PX * sum(broad),
    )
    ahead_std = math.hypot(first.front.std_at(one[1]), second.front.std_at(other[1]))
    return GripperTips(
        frame.image_px(0.5 * (one[0] + other[0]), 0.5 * (one[1] + other[1])),
        max(0.0, other[1] - one[1]),
        gap_std,
        0.5 * max(gap_std, ahead_std),
        jaws,
        tuple(doubts),
    )


def _step(first: Body, second: Body) -> float:
    """Return how much further the second jaw reaches, in the direction the jaws point to."""
    lean = 0.25 * sum(side.slope for body in (first, second) for side in (body.low, body.high))
    across = second.front.middle - first.front.middle
    return second.front.offset - first.front.offset + lean * across


def _touched(body: Body) -> bool:
    """Return whether something lies against one side of a probe, which moves that side."""
    smooth, rough = sorted((body.low.std, body.high.std))
    return rough > max(ONE_SIDED * smooth, ROUGH_STD_PX)


def _rougher(one: Line, other: Line) -> bool:
    """Return whether something lies at the first edge rather than at the other."""
    return one.std * other.kept > ROUGHER * other.std * one.kept


def _inner(body: Body, inner: Line, outer: Line, width: float | None) -> Pair:
    """Return the inner corner: seen, or so far from the outer one where it is not."""
    if width is None:
        return body.corner(inner)
    aside = body.corner(outer)[1] + width
    return body.front.at(aside), aside


def _true_width(
    frame: Frame, greys: Levels, bodies: tuple[Body, Body], expected: ExpectedTool
) -> float:
    """Return how broad a jaw looks with nothing at it: the narrower one's width, mostly."""
    narrow = min(body.width for body in bodies)
    first, second = bodies
    low = math.ceil(first.corner(first.high)[1]) + 2
    high = math.floor(second.corner(second.low)[1]) - 1
    front = int(min(first.front.offset, second.front.offset))
    strip = frame.pixels[low:high, max(0, front - 40) : max(1, front - 4)]
    # Filled from jaw to jaw, both look broader.
    filled = strip.size == 0 or middle(strip) < greys.ground - FILLED * greys.contrast
    return min(narrow, expected.width_px) if filled else narrow
