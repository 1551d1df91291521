"""Two pieces of which one turns: the joint box is split until every part is proved or refuted."""

import math
from dataclasses import dataclass
from itertools import product
from typing import Final

import numpy as np
import numpy.typing as npt

from cosmic.mico.core.collision.arrangement import Arrangement
from cosmic.mico.core.collision.fcl_pieces import ConvexPiece, gap_along, separation
from cosmic.mico.core.collision.model import Floats
from cosmic.mico.core.collision.motion_box import MotionBox
from cosmic.mico.core.collision.sliding import NOTHING_UM


def circling_loss(
    points: Floats, axis: Floats, direction: Floats, lowest: float, highest: float
) -> float:
    """Return by how much turning takes the least of `points` back along `direction`.

    Parameters
    ----------
    points : ndarray, shape (n, 3)
        From a place on the axis, where the angle is 0.
    axis, direction : ndarray, shape (3,)
        Unit vectors.
    lowest, highest : float
        The interval of the angle, rad.
    """
    middle, half = (lowest + highest) / 2.0, (highest - lowest) / 2.0
    share = float(direction @ axis)
    here = points @ (direction - share * axis)
    ahead = points @ _cross(direction, axis)
    # A point at angle t is at here * cos(t) + ahead * sin(t) = radius * cos(t - phase).
    radius, phase = np.hypot(here, ahead), np.arctan2(ahead, here) - middle
    away = np.abs(np.remainder(phase + math.pi, 2.0 * math.pi) - math.pi) + half
    along = share * (points @ axis)
    least = along + radius * np.cos(np.minimum(away, math.pi))
    return max(0.0, float((along + here).min() - least.min()))


def circling_box(points: Floats, axis: Floats, half: float) -> tuple[Floats, Floats]:
    """Return the corners of the box round `points` turned by up to `half` to either side."""
    along = np.outer(points @ axis, axis)
    here = points - along
    ahead = np.cross(axis, points)
    radius, phase = np.hypot(here, ahead), np.abs(np.arctan2(ahead, here))
    low = along + radius * np.cos(np.minimum(phase + half, math.pi))
    high = along + radius * np.cos(np.maximum(phase - half, 0.0))
    return low.min(axis=0), high.max(axis=0)


def radius_about(points: Floats, axis: Floats) -> float:
    """Return the greatest distance of `points`, told from a place on the axis, from it."""
    return math.sqrt(float((np.cross(points, axis) ** 2).sum(axis=1).max()))


def chord(radius: float, angle: float) -> float:
    """Return how far a turn by at most `angle` carries a point at `radius`."""
    return 2.0 * radius * math.sin(min(angle, math.pi) / 2.0)


def _cross(one: Floats, other: Floats) -> Floats:
    a, b, c = one.tolist()
    x, y, z = other.tolist()
    return np.array((b * z - c * y, c * x - a * z, a * y - b * x))


MOST_QUERIES: Final = 600
FLOOR_UM: Final = 1.0
"""A part that brings the two less than this closer and is not proved free counts as not free."""

CREEP_UM: Final = 0.01
"""So much closer two may come on the way apart: less than a stage can be told to move."""


@dataclass(frozen=True, slots=True)
class Turn:
    """Two pieces and the bodies they belong to."""

    first: int
    second: int
    first_body: int
    second_body: int


@dataclass(frozen=True, slots=True)
class _Rider:
    """A piece, and a joint that carries it but not the other piece.

    Attributes
    ----------
    sign : float
        1 for the second piece, -1 for the first: which way brings the two apart.
    firm : bool
        No other joint of the box turns the joint's own direction.
    """

    joint: int
    piece: int
    body: int
    sign: float
    firm: bool


@dataclass(frozen=True, slots=True)
class _Part:
    """A part of the joint box: from `lowest` below to `highest` above `values`."""

    values: Floats
    lowest: Floats
    highest: Floats


class TurningPairs:
    """Checks pairs of pieces with a turning joint between them; one thread."""

    def __init__(self, arrangement: Arrangement, pieces: list[ConvexPiece]) -> None:
        self._arrangement = arrangement
        self._pieces = pieces
        self._joints = arrangement.model.joints
        self._normals: dict[Turn, Floats] = {}
        self._values = np.zeros(len(self._joints))

    def first_touch(self, turn: Turn, box: MotionBox, margin_um: float) -> Floats | None:
        """Return joint values at which the margin is not kept, or None where it always is."""
        riders = self._riders(turn, box)
        low, high = box.centre, box.centre
        joints = [rider.joint for rider in riders]
        low[joints], high[joints] = box.low[joints], box.high[joints]
        if self._remembered(turn, riders, _part(low, high), margin_um):
            return None
        if box.origin_known[joints].all():
            start = _Part(box.origin, box.lowest, box.highest)
            gap, normal = self._measure(turn, start.values)
            if gap > 0.0 and sum(self._losses(riders, start, normal)) <= NOTHING_UM:
                return None
        return self._search(turn, riders, (low, high), margin_um)

    def keeps(self, turn: Turn, onward: MotionBox, least_um: float) -> bool:
        """Return True when a movement from inside the margin comes nowhere closer than `least_um`.

        On the way it may by `CREEP_UM`, for no part that begins there could be proved otherwise;
        where it ends it may not.
        """
        riders = self._riders(turn, onward)
        low, high = onward.origin.copy(), onward.origin.copy()
        joints = sorted({rider.joint for rider in riders})
        low[joints], high[joints] = onward.low[joints], onward.high[joints]
        for ends in product(*((low[joint], high[joint]) for joint in joints)):
            values = onward.origin.copy()
            values[joints] = ends
            if not self._measure(turn, values)[0] >= least_um - NOTHING_UM:
                return False
        bound = least_um - CREEP_UM
        return self._search(turn, riders, (low, high), bound, CREEP_UM / 8.0) is None

    def parts(self, turn: Turn, onward: MotionBox, normal: Floats) -> bool:
        """Return True when two that overlap come apart along `normal`, and never go back."""
        riders = self._riders(turn, onward)
        start = _Part(onward.origin, onward.lowest, onward.highest)
        self._put(turn, start.values)
        if not sum(self._losses(riders, start, normal)) <= NOTHING_UM:
            return False
        before = gap_along(*self._put(turn, start.values), normal)
        for end in (onward.low, onward.high):
            if gap_along(*self._put(turn, end), normal) > before + NOTHING_UM:
                return True
        return False

    def widen(self, piece: int, body: int, box: MotionBox, corners: tuple[Floats, Floats]) -> None:
        """Widen the box round a piece, put in the middle, by all that joints can turn it."""
        low, high = corners
        arrangement, half = self._arrangement, box.half
        wide = arrangement.chains[body] & (half > 0.0)
        riders = self._carriers(piece, body, 1.0, np.flatnonzero(wide & arrangement.swings))
        self._values = box.centre
        if len(riders) == 1 and arrangement.turning[riders[0].joint]:
            points, axis, place = self._about(riders[0])
            swept = circling_box(points, axis, float(half[riders[0].joint]))
            low[:], high[:] = swept[0] + place, swept[1] + place
            return
        reach = sum(self._reach(rider, half) for rider in riders)
        low -= reach
        high += reach

    def _riders(self, turn: Turn, box: MotionBox) -> list[_Rider]:
        """Return the joints of the box that move the two against each other."""
        first = self._arrangement.chains[turn.first_body]
        second = self._arrangement.chains[turn.second_body]
        wide = (first ^ second) & (box.high > box.low)
        return [
            *self._carriers(turn.first, turn.first_body, -1.0, np.flatnonzero(wide & first)),
            *self._carriers(turn.second, turn.second_body, 1.0, np.flatnonzero(wide & second)),
        ]

    def _carriers(
        self, piece: int, body: int, sign: float, wide: npt.NDArray[np.intp]
    ) -> list[_Rider]:
        # Joints of one chain are numbered from the root outwards.
        joints, turning = wide.tolist(), self._arrangement.turning
        return [
            _Rider(joint, piece, body, sign, not turning[joints[:place]].any())
            for place, joint in enumerate(joints)
        ]

    def _search(
        self,
        turn: Turn,
        riders: list[_Rider],
        whole: tuple[Floats, Floats],
        margin_um: float,
        floor_um: float = FLOOR_UM,
    ) -> Floats | None:
        parts = [whole]
        for _ in range(MOST_QUERIES):
            if not parts:
                return None
            low, high = parts.pop()
            part = _part(low, high)
            if self._remembered(turn, riders, part, margin_um):
                continue
            gap, normal = self._measure(turn, part.values)
            if not gap > margin_um:
                return part.values
            losses = self._losses(riders, part, normal)
            if gap - sum(losses) > margin_um:
                self._normals[turn] = normal
                continue
            if not sum(losses) > floor_um:
                return part.values
            widest = riders[int(np.argmax(losses))].joint
            upper, lower = low.copy(), high.copy()
            upper[widest] = lower[widest] = part.values[widest]
            parts += [(upper, high), (low, lower)]
        return parts[-1][0] if parts else None

    def _put(self, turn: Turn, values: Floats) -> tuple[ConvexPiece, ConvexPiece]:
        first, second = self._pieces[turn.first], self._pieces[turn.second]
        first.put(*self._arrangement.pose(turn.first_body, values))
        second.put(*self._arrangement.pose(turn.second_body, values))
        self._values = values
        return first, second

    def _measure(self, turn: Turn, values: Floats) -> tuple[float, Floats]:
        found = separation(*self._put(turn, values))
        return found.gap_um, np.array(found.normal)

    def _remembered(self, turn: Turn, riders: list[_Rider], part: _Part, margin_um: float) -> bool:
        """Return True when the direction that proved a part before proves this one too."""
        normal = self._normals.get(turn)
        if normal is None:
            return False
        gap = gap_along(*self._put(turn, part.values), normal)
        return gap > margin_um and gap - sum(self._losses(riders, part, normal)) > margin_um

    def _losses(self, riders: list[_Rider], part: _Part, normal: Floats) -> list[float]:
        """Return the most that each joint of a part can take from the gap along `normal`.

        The pieces stand at the `values` of the part. Joints are thought to move one after the
        other, from the root outwards: each then carries the piece as it stands now.
        """
        span = np.maximum(-part.lowest, part.highest)
        losses = []
        for rider in riders:
            lowest, highest = float(part.lowest[rider.joint]), float(part.highest[rider.joint])
            if not rider.firm:
                losses.append(self._reach(rider, span))
            elif not self._arrangement.turning[rider.joint]:
                slope = rider.sign * float(normal @ self._axis(rider.joint)[0])
                losses.append(-min(slope * lowest, slope * highest))
            else:
                points, axis, _ = self._about(rider)
                towards = rider.sign * normal
                losses.append(circling_loss(points, axis, towards, lowest, highest))
        return losses

    def _axis(self, joint: int) -> tuple[Floats, Floats]:
        """Return the direction of a joint and a place on it, where the pieces stand."""
        rotation, place = self._arrangement.pose(self._arrangement.child[joint], self._values)
        return rotation @ self._joints[joint].axis, place

    def _about(self, rider: _Rider) -> tuple[Floats, Floats, Floats]:
        """Return the vertices from a place on the axis, the axis, and that place."""
        axis, place = self._axis(rider.joint)
        return self._pieces[rider.piece].world_um().T - place, axis, place

    def _reach(self, rider: _Rider, span: Floats) -> float:
        """Return how far one joint can carry any point of a piece, in any direction."""
        far = float(span[rider.joint])
        if not self._arrangement.turning[rider.joint]:
            return far
        points, axis, _ = self._about(rider)
        return chord(radius_about(points, axis), far)


def _part(low: Floats, high: Floats) -> _Part:
    half = (high - low) / 2.0
    return _Part((low + high) / 2.0, -half, half)
