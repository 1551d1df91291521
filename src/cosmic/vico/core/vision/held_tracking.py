"""Follow a fibre that a gripper holds, from frame to frame: its free part, its tip, its clamp.

Where the gripper is, is known from the stages, and where the fibre was from the frame before: its
line is measured anew there, and looked for where that does not do. A fibre that comes out between
the jaws is the one that was followed where its length and width are; another one is never taken for
it, and one that was hidden is known again by them.
"""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from cosmic.frame.arrays import Floats
from cosmic.frame.errors import CosmicError, NotAvailable
from cosmic.vico.core.vision.ends import EndKind
from cosmic.vico.core.vision.fibre import Fibre
from cosmic.vico.core.vision.finding import find_fibres
from cosmic.vico.core.vision.held import HeldShape, held_shape
from cosmic.vico.core.vision.joining import Strand
from cosmic.vico.core.vision.profiles import Scene
from cosmic.vico.core.vision.refine import Neighbours, refine
from cosmic.vico.core.vision.relief import level_step
from cosmic.vico.core.vision.tool_tips import HeldSeen, find_jaws
from cosmic.vico.core.vision.tool_types import ExpectedTool, GripperTips, NotSeen
from cosmic.vico.core.vision.tracking import TrackState
from cosmic.vico.hw.interface import Pixels

Pair = tuple[float, float]

AROUND_PX: Final = 48.0
"""So far around where the fibre was it is looked for; each frame it is lost, as much again."""
MOST_AROUND: Final = 4
BEHIND_PX: Final = 60.0
"""Of the jaws a part is looked at as well: a line runs into them."""
OPEN_PX: Final = 700.0
"""How far ahead of the jaws a fibre is looked for that was not seen before."""
ANEW_EVERY: Final = 15
"""Frames after which it is looked for as if nothing were known of it."""
LEAST_GOOD: Final = 0.7
"""Share of its line on which both edges are seen."""
LENGTH_CHANGE: Final = 0.05
WIDTH_CHANGE: Final = 0.3
LARGEST_STD_PX: Final = 0.5
MEAN_OF: Final = 3


@dataclass(frozen=True, slots=True, eq=False)
class HeldTrack:
    """A held fibre on one frame.

    Attributes
    ----------
    shape : HeldShape or None
        None while it is lost.
    tip_px : (float, float) or None
        Its free end.
    tip_std_px : float or None
        Standard deviation of a coordinate of it.
    velocity_px : (float, float)
        By how much the tip went on since the frame before; 0 after one on which it was lost.
    reason : str
        Why it is lost or not sure.
    scale_um_px : float or None
        Size of a pixel at the height of the gripper; None where nobody knows.
    """

    state: TrackState
    shape: HeldShape | None = None
    tip_px: Pair | None = None
    tip_std_px: float | None = None
    velocity_px: Pair = (0.0, 0.0)
    reason: str = ""
    scale_um_px: float | None = None


def held_seen(name: str, track: object) -> HeldSeen | None:
    """Return a held fibre in short; None where it is lost."""
    if not isinstance(track, HeldTrack) or track.shape is None:
        return None
    shape = track.shape
    certain = track.state is TrackState.FOUND
    return HeldSeen(
        name,
        shape.line_px,
        shape.length_px,
        shape.clamps[0].angle_deg,
        certain,
        scale_um_px=track.scale_um_px,
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Line:
    """A line that may be the held fibre; as `held_shape` takes it."""

    centre_line_px: Floats
    width_px: float
    ends_px: Floats
    ends_std_px: Floats
    doubts: tuple[str, ...] = ()
    lighter: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class _Known:
    """What is known of the fibre from the frame before, in pixels of the image."""

    line: Floats
    hold: Pair
    tip: Pair
    width: float
    length: float
    lighter: bool


class HeldFibreTracker:
    """Follows the fibre in one gripper; one thread.

    Parameters
    ----------
    around_px : float
        How far from where it is expected any part of it may be.
    """

    def __init__(self, *, around_px: float = AROUND_PX) -> None:
        self._around_px = around_px
        self.forget()

    def forget(self) -> None:
        """Follow whatever fibre is held on the next frame."""
        self._known: _Known | None = None
        self._seen = self._missed = self._frames = 0
        self._velocity: Pair = (0.0, 0.0)

    def follow(self, image: Pixels, expected: ExpectedTool) -> HeldTrack:
        """Look for it on the next frame; `expected` is where the gripper should be on it."""
        return replace(self._followed(image, expected), scale_um_px=expected.scale_um_px)

    def _followed(self, image: Pixels, expected: ExpectedTool) -> HeldTrack:
        found = find_jaws(image, expected)
        if isinstance(found, NotSeen):
            return self._lost(f"the gripper: {found.reason}")
        left, top, right, bottom = self._box(image, found)
        part: Pixels = image[top:bottom, left:right].copy()
        if min(part.shape) < 2 * self._around_px:
            return self._lost("the gripper lies at the border of the image")
        corner = np.array([left, top], dtype=np.float64)
        gripper = replace(found, hold_px=(found.hold_px[0] - left, found.hold_px[1] - top))
        self._frames += 1
        searches: list[Callable[[], list[_Line]]] = [
            lambda: self._retraced(part, corner, found.hold_px),
            lambda: [_line_of(each) for each in find_fibres(part, wanted=_from(gripper))],
        ]
        reason = ""
        for search in searches[::-1] if self._frames % ANEW_EVERY == 0 else searches:
            try:
                held, reason = self._chosen(search(), gripper)
            except CosmicError as exc:
                reason = str(exc)
                continue
            if held is not None:
                return self._found(*held, corner=corner, gripper=found)
        return self._lost(reason)

    def _chosen(
        self, lines: Iterable[_Line], gripper: GripperTips
    ) -> tuple[tuple[_Line, HeldShape] | None, str]:
        """Return the line that comes out between the jaws, or why there is none."""
        reason = "no fibre comes out between the jaws"
        best: tuple[_Line, HeldShape] | None = None
        for line in lines:
            try:
                shape = held_shape(line, gripper)
            except NotAvailable:
                continue
            objection = self._objection(shape, line.width_px)
            if objection:
                reason = objection
            elif best is None or shape.length_px > best[1].length_px:
                best = (line, shape)
        return best, reason

    def _retraced(self, part: Pixels, corner: Floats, hold: Pair) -> list[_Line]:
        """Return the line that was known last, measured anew; empty where that does not do."""
        known = self._known
        if known is None or self._missed > MOST_AROUND:
            return []
        strand = Strand(self._expected(known, hold) - corner, 0.5 * (known.width + 0.5))
        scene = Scene(
            part.astype(np.float32),
            np.zeros((1, 1), np.float32),
            1,
            1.0 if known.lighter else -1.0,
            1.0 if part.dtype == np.uint8 else level_step(part),
        )
        course = refine(scene, strand, Neighbours(None, np.zeros(0)))
        if course is None or not course.good.mean() > LEAST_GOOD:
            return []
        away = np.linalg.norm(course.line[[0, -1]] + corner - np.array(known.tip), axis=1)
        if course.ends[int(np.argmin(away))].kind is not EndKind.FREE:
            return []
        stds = np.array([each.std_px for each in course.ends])
        ends = course.line[[0, -1]]
        return [_Line(course.line, course.width, ends, stds, (), known.lighter)]

    def _expected(self, known: _Known, hold: Pair) -> Floats:
        """Return where the line should be: it goes with its gripper, and its tip on as it did."""
        by = np.array(hold) - np.array(known.hold)
        away = np.linalg.norm(known.line - np.array(known.hold), axis=1)
        share = (away / max(float(away.max()), 1e-6))[:, None]
        return np.asarray(known.line + by + share * (np.array(self._velocity) - by))

    def _box(self, image: Pixels, gripper: GripperTips) -> tuple[int, int, int, int]:
        """Return the part of the image to look at: left, top, right, bottom."""
        hold = np.array(gripper.hold_px)
        ahead = np.mean([jaw.forward for jaw in gripper.jaws], axis=0)
        jaw = max(each.width_px for each in gripper.jaws) + 0.5 * gripper.gap_px
        behind, around = hold - BEHIND_PX * ahead, self._around_px + jaw
        points = np.stack([behind, hold + OPEN_PX * ahead])
        if self._known is not None:
            points = np.concatenate([behind[None], self._expected(self._known, gripper.hold_px)])
            around = self._around_px * min(1 + self._missed, MOST_AROUND) + 0.5 * jaw
        low, high = points.min(axis=0) - around, points.max(axis=0) + around
        rows, columns = image.shape
        return (
            max(0, math.floor(low[0])),
            max(0, math.floor(low[1])),
            min(columns, math.ceil(high[0]) + 1),
            min(rows, math.ceil(high[1]) + 1),
        )

    def _objection(self, shape: HeldShape, width: float) -> str:
        """Return why it is not the fibre that was followed; empty where it may be."""
        if self._known is None:
            return ""
        longer = shape.length_px / self._known.length - 1.0
        if not abs(longer) <= LENGTH_CHANGE:
            return f"the length of what is held differs by {100.0 * longer:+.0f} %"
        if not abs(width / self._known.width - 1.0) <= WIDTH_CHANGE:
            return "the width of what is held differs"
        return ""

    def _lost(self, reason: str) -> HeldTrack:
        self._missed += 1
        self._velocity = (0.0, 0.0)
        return HeldTrack(TrackState.LOST, reason=reason)

    def _found(
        self, line: _Line, shape: HeldShape, *, corner: Floats, gripper: GripperTips
    ) -> HeldTrack:
        x, y = (shape.line_px[-1] + corner).tolist()
        known, steady = self._known, self._missed == 0
        self._velocity = (x - known.tip[0], y - known.tip[1]) if known and steady else (0.0, 0.0)
        self._missed = 0
        # It is known again by the mean of the last frames: it may slip a little in the jaws.
        self._seen = min(self._seen + 1, MEAN_OF)
        length, width = shape.length_px, line.width_px
        if known is not None:
            length = known.length + (length - known.length) / self._seen
            width = known.width + (width - known.width) / self._seen
        whole = line.centre_line_px + corner
        self._known = _Known(whole, gripper.hold_px, (x, y), width, length, line.lighter)
        away = np.linalg.norm(line.ends_px - shape.line_px[-1], axis=1)
        std = float(line.ends_std_px[int(np.argmin(away))])
        # What lies against the jaws is what they hold.
        doubts = [each for each in shape.doubts if each not in gripper.doubts]
        if not max(std, gripper.std_px) <= LARGEST_STD_PX:
            doubts.append(f"tip and jaws are known to {max(std, gripper.std_px):.1f} px only")
        state = TrackState.UNSURE if doubts else TrackState.FOUND
        moved = _moved(shape, corner)
        return HeldTrack(state, moved, (x, y), std, self._velocity, "; ".join(doubts))


def _from(gripper: GripperTips) -> Callable[[Floats], bool]:
    """Return what says of a line whether it may come out between the jaws."""
    hold = np.array(gripper.hold_px)
    reach = BEHIND_PX + 0.5 * gripper.gap_px + max(jaw.width_px for jaw in gripper.jaws)
    return lambda line: bool((np.linalg.norm(line - hold, axis=1) <= reach).any())


def _line_of(fibre: Fibre) -> _Line:
    """Return a fibre that was found as a line."""
    return _Line(
        fibre.centre_line_px,
        fibre.width_px,
        fibre.ends_px,
        fibre.ends_std_px,
        fibre.doubts,
        fibre.lighter,
    )


def _moved(shape: HeldShape, by: Floats) -> HeldShape:
    """Return a shape moved on the image."""
    x, y = by.tolist()
    clamps = tuple(
        replace(each, leaves_px=(each.leaves_px[0] + x, each.leaves_px[1] + y))
        for each in shape.clamps
    )
    return replace(shape, line_px=shape.line_px + by, clamps=clamps)
