"""Two pieces of which one turns: the joint box is split until every part is proved or refuted."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from cosmic.mico.core.collision.arrangement import Arrangement
from cosmic.mico.core.collision.fcl_pieces import ConvexPiece, separation
from cosmic.mico.core.collision.model import Floats
from cosmic.mico.core.collision.motion_box import Flags, MotionBox
from cosmic.mico.core.collision.sliding import NOTHING_UM

MOST_QUERIES: Final = 600
FLOOR_UM: Final = 1.0
"""A part that moves less than this and is not proved free counts as not free."""


@dataclass(frozen=True, slots=True)
class Turn:
    """Two pieces and the bodies they belong to."""

    first: int
    second: int
    first_body: int
    second_body: int


class TurningPairs:
    """Checks pairs of pieces with a turning joint between them; one thread."""

    def __init__(self, arrangement: Arrangement, pieces: list[ConvexPiece]) -> None:
        self._arrangement = arrangement
        self._pieces = pieces
        shapes = arrangement.model.pieces
        self._vertices = [shape.vertices_um for shape in shapes]

    def first_touch(self, turn: Turn, box: MotionBox, margin_um: float) -> Floats | None:
        """Return joint values at which the margin is not kept, or None where it always is."""
        between = self._between(turn)
        wide = between & (box.high > box.low)
        if self._leaves(turn, box, wide):
            return None
        low, high = box.centre.copy(), box.centre.copy()
        low[wide], high[wide] = box.low[wide], box.high[wide]
        parts = [(low, high)]
        for _ in range(MOST_QUERIES):
            if not parts:
                return None
            low, high = parts.pop()
            middle, half = (low + high) / 2.0, (high - low) / 2.0
            gap, terms = self._measure(turn, middle, half, wide)
            if not gap > margin_um:
                return middle
            if gap - terms.sum() > margin_um:
                continue
            if not terms.sum() > FLOOR_UM:
                return middle
            widest = int(np.argmax(terms))
            upper, lower = low.copy(), high.copy()
            upper[widest] = lower[widest] = middle[widest]
            parts += [(upper, high), (low, lower)]
        return parts[-1][0] if parts else None

    def any_way(self, turn: Turn, half: Floats, rotations: list[Floats], places: Floats) -> float:
        """Return how far the joints, each by its `half`, can carry the two in any direction."""
        total = 0.0
        for joint in np.flatnonzero(self._between(turn) & (half > 0.0)):
            reach = float(half[joint])
            if not self._arrangement.turning[joint]:
                total += reach
                continue
            second = bool(self._arrangement.chains[turn.second_body, joint])
            piece = turn.second if second else turn.first
            body = turn.second_body if second else turn.first_body
            total += self._chord(piece, body, int(joint), reach, (rotations, places), half)
        return total

    def _between(self, turn: Turn) -> Flags:
        chains = self._arrangement.chains
        return np.asarray(chains[turn.first_body] ^ chains[turn.second_body])

    def _leaves(self, turn: Turn, box: MotionBox, wide: Flags) -> bool:
        """Return True when no joint of the box brings the two closer than they stand."""
        gap, normal, poses = self._stand(turn, box.origin)
        if not gap > 0.0:
            return False
        total = 0.0
        for joint in np.flatnonzero(wide):
            ends = (
                box.asked_low[joint] - box.origin[joint],
                box.asked_high[joint] - box.origin[joint],
            )
            slope = self._slope(turn, int(joint), normal)
            if slope is None:
                reach = float(np.max(np.abs(ends)))
                total -= self._term(turn, int(joint), reach, normal, poses, box.half)
            else:
                total += min(slope * ends[0], slope * ends[1])
        return total >= -NOTHING_UM

    def _stand(
        self, turn: Turn, values: Floats
    ) -> tuple[float, Floats, tuple[list[Floats], Floats]]:
        rotations, places = self._arrangement.poses(values)
        for piece, body in ((turn.first, turn.first_body), (turn.second, turn.second_body)):
            self._pieces[piece].put(rotations[body], places[body])
        found = separation(self._pieces[turn.first], self._pieces[turn.second])
        return found.gap_um, np.array(found.normal), (rotations, places)

    def _measure(
        self, turn: Turn, values: Floats, half: Floats, wide: Flags
    ) -> tuple[float, Floats]:
        """Return the gap at `values`, and how much each joint of a part can take away from it."""
        gap, normal, poses = self._stand(turn, values)
        terms = np.zeros(len(values))
        for joint in np.flatnonzero(wide & (half > 0.0)):
            reach = float(half[joint])
            terms[joint] = self._term(turn, int(joint), reach, normal, poses, half)
        return gap, terms

    def _slope(self, turn: Turn, joint: int, normal: Floats) -> float | None:
        """Return by how much the gap along `normal` grows per um, None where that varies."""
        arrangement = self._arrangement
        if arrangement.turning[joint] or not arrangement.steady[joint]:
            return None
        sign = 1.0 if arrangement.chains[turn.second_body, joint] else -1.0
        return sign * float(normal @ arrangement.ways[joint])

    def _term(
        self,
        turn: Turn,
        joint: int,
        reach: float,
        normal: Floats,
        poses: tuple[list[Floats], Floats],
        half: Floats,
    ) -> float:
        """Return the most that one joint can take from the gap when it moves by `reach`."""
        arrangement = self._arrangement
        slope = self._slope(turn, joint, normal)
        if slope is not None:
            return abs(slope) * reach
        if not arrangement.turning[joint]:
            return reach
        second = bool(arrangement.chains[turn.second_body, joint])
        piece = turn.second if second else turn.first
        body = turn.second_body if second else turn.first_body
        across = 1.0
        if arrangement.steady[joint]:
            child = arrangement.model.body_number[arrangement.model.joints[joint].child]
            axis = poses[0][child] @ arrangement.model.joints[joint].axis
            along = float(normal @ axis)
            across = float(np.sqrt(max(0.0, 1.0 - along * along)))
        return across * self._chord(piece, body, joint, reach, poses, half)

    def _chord(
        self,
        piece: int,
        body: int,
        joint: int,
        reach: float,
        poses: tuple[list[Floats], Floats],
        half: Floats,
    ) -> float:
        """Return how far a turn by `reach` can carry any point of a piece."""
        arrangement = self._arrangement
        rotations, places = poses
        child = arrangement.model.body_number[arrangement.model.joints[joint].child]
        axis = rotations[child] @ arrangement.model.joints[joint].axis
        world = self._vertices[piece] @ rotations[body].T + places[body] - places[child]
        radius = float(np.sqrt(np.max((np.cross(world, axis) ** 2).sum(axis=1))))
        for farther in np.flatnonzero(arrangement.chains[body] & ~arrangement.chains[child]):
            if arrangement.turning[farther] and half[farther] > 0.0:
                radius += self._chord(piece, body, int(farther), float(half[farther]), poses, half)
            elif not arrangement.turning[farther]:
                radius += float(half[farther])
        return float(2.0 * radius * np.sin(min(reach, np.pi) / 2.0))
