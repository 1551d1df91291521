"""How much a curve must bend to enter a crossing by one branch and leave it by another."""

from dataclasses import dataclass

import numpy as np

from cosmic.vico.core.vision.graph import Branch
from cosmic.vico.core.vision.grey import Floats
from cosmic.vico.core.vision.smoothing import arc_lengths


@dataclass(frozen=True, slots=True, eq=False)
class Exit:
    """How a branch leaves its crossing: point, direction and curvature."""

    branch: int
    point: Floats
    direction: Floats
    curvature: float


def leaving(branch: Branch, number: int, end: int, half_width: float) -> Exit:
    """Return how a branch leaves its crossing, where its skeleton is no longer bent by it."""
    points = branch.points if end == 0 else branch.points[::-1]
    s = arc_lengths(points)
    total = float(s[-1])
    near = min(2.0 * half_width + 1.0, 0.3 * total)
    far = min(near + max(12.0, 10.0 * half_width), 0.9 * total if total > 12 else total)
    chosen = (s >= near) & (s <= far)
    if chosen.sum() < 3:
        chosen[:] = True
    t = s[chosen] - near
    part = points[chosen]
    order = 2 if len(part) >= 10 else 1
    x, y = (np.polyfit(t, part[:, axis], order) for axis in (0, 1))
    slope = np.array([x[-2], y[-2]])
    speed = max(float(np.linalg.norm(slope)), 1e-6)
    bow = 2.0 * np.array([x[0], y[0]]) if order == 2 else np.zeros(2)
    curvature = float(slope[0] * bow[1] - slope[1] * bow[0]) / speed**3
    most = 0.3 / half_width
    point = np.array([x[-1], y[-1]])
    return Exit(number, point, slope / speed, float(np.clip(curvature, -most, most)))


def turn(first: Floats, last: Floats) -> float:
    """Return the angle from one direction to another, -pi to pi."""
    return float(np.arctan2(first[0] * last[1] - first[1] * last[0], first @ last))


def bending(first: Exit, last: Exit) -> float:
    """Return how much a curve must leave its bow to enter by one branch and leave by another."""
    way = last.point - first.point
    gap = float(np.linalg.norm(way))
    if gap < 1e-6 or first.branch == last.branch:
        # A fibre has ends: a branch is not joined to itself.
        return float(np.pi**2)
    bow = 0.5 * (last.curvature - first.curvature) * gap
    change = (last.curvature + first.curvature) * gap
    enter = turn(way, -first.direction) + 0.5 * bow
    leave = turn(way, last.direction) - 0.5 * bow
    return enter**2 + enter * leave + leave**2 + change**2 / 12.0
