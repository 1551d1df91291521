"""The smallest clearance on the way of a trajectory, and where it is."""

import heapq
from collections.abc import Iterable, Mapping, Set
from typing import Final

from cosmic.mico.core.collision.answer import Approach
from cosmic.mico.core.collision.model import BodyPair, SceneModel
from cosmic.mico.core.collision.sweep import Sweep
from cosmic.mico.core.planning.space import um_per_unit

Pose = Mapping[str, float]

TOLERANCE_UM: Final = 1.0
TOLERANCE_SHARE: Final = 0.01
"""The smallest clearance is found to a micrometre, or this part of it."""
MOST_LOOKS: Final = 8
"""Poses looked at on one line at most, so that a long parallel slide does not take for ever."""


class ClearanceSearch:
    """Follows a way pose by pose and keeps where bodies came nearest to each other.

    No body comes nearer to another than the axes travel, so most of the way need not be looked
    at. Pairs that none of `axes` brings nearer are left out: their distance says nothing.
    """

    def __init__(
        self, sweep: Sweep, axes: Iterable[str], ignored: Set[BodyPair] = frozenset()
    ) -> None:
        self._sweep = sweep
        model = sweep.model
        used = set(axes)
        self._ignored = frozenset(ignored) | unmoved_pairs(model, used)
        self._any = any(pair.bodies not in self._ignored for pair in model.pairs)
        self._reach = {axis: _reach(model, axis) for axis in used if axis in model.axes}
        self._at_least = 0.0  # lower bound of the clearance at the newest pose
        self.best: Approach | None = None
        self.line = 0

    def begin(self, pose: Pose) -> None:
        """Start at a pose."""
        self._at_least = self._look(pose, 0)

    def follow(self, start: Pose, end: Pose, line: int) -> None:
        """Go straight from one pose to another."""
        if not self._any or self.best is None:
            return
        longest = self._travel(start, end)
        if self._at_least - longest >= self._enough():
            self._at_least -= longest
            return
        before, after = self._look(start, line), self._look(end, line)
        self._at_least = after
        self._refine(start, end, before, after, line)

    def _enough(self) -> float:
        """Return the clearance that is no news."""
        best = self.best.distance_um if self.best is not None else 0.0
        return best - max(TOLERANCE_UM, TOLERANCE_SHARE * best)

    def _refine(self, start: Pose, end: Pose, before: float, after: float, line: int) -> None:
        """Look at the parts of a straight way that can be nearest, the likeliest first."""
        parts = [(_least(before, after, self._travel(start, end)), 0.0, 1.0, before, after)]
        for _ in range(MOST_LOOKS):
            least, first, last, at_first, at_last = heapq.heappop(parts)
            if least >= self._enough():
                return
            middle = (first + last) / 2.0
            here = self._look(_between(start, end, middle), line)
            longest = self._travel(start, end) * (last - first) / 2.0
            heapq.heappush(parts, (_least(at_first, here, longest), first, middle, at_first, here))
            heapq.heappush(parts, (_least(here, at_last, longest), middle, last, here, at_last))

    def _look(self, pose: Pose, line: int) -> float:
        """Measure at a pose."""
        found = self._sweep.nearest(pose, self._ignored)
        if found is None:
            return float("inf")
        if self.best is None or found.distance_um < self.best.distance_um:
            self.best, self.line = found, line
        return found.distance_um

    def _travel(self, start: Pose, end: Pose) -> float:
        """Return how much nearer two bodies can come at most."""
        return sum(reach * abs(end[axis] - start[axis]) for axis, reach in self._reach.items())


def _least(before: float, after: float, longest: float) -> float:
    return (before + after - longest) / 2.0


def _between(start: Pose, end: Pose, share: float) -> dict[str, float]:
    return {axis: value + share * (end[axis] - value) for axis, value in start.items()}


def _reach(model: SceneModel, axis: str) -> float:
    """Return how far a unit of an axis can bring two bodies nearer; both jaws of a gripper."""
    drives = [drive for drive in model.drives if drive.axis == axis]
    return um_per_unit(model, axis) * max(1.0, sum(abs(drive.factor) for drive in drives))


def unmoved_pairs(model: SceneModel, axes: Set[str]) -> frozenset[BodyPair]:
    """Return the watched pairs whose distance none of `axes` changes."""
    carried = [_carried(model, drive.joint) for drive in model.drives if drive.axis in axes]
    return frozenset(
        pair.bodies
        for pair in model.pairs
        if all((pair.bodies[0] in each) == (pair.bodies[1] in each) for each in carried)
    )


def _carried(model: SceneModel, driven: str) -> set[str]:
    bodies: set[str] = set()
    for joint in model.joints:  # parents come before their children
        if joint.name == driven or joint.parent in bodies:
            bodies.add(joint.child)
    return bodies
