"""Points that turn about an axis by any angle in an interval: exactly how far they come."""

import math

import numpy as np

from cosmic.mico.core.collision.model import Floats


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
