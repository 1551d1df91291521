"""Length, curl, kinks and pose of a centre line (ISO 16065-1, TAPPI T 271)."""

import cv2
import numpy as np

from cosmic.frame.arrays import Floats
from cosmic.vico.core.vision.smoothing import arc_lengths, directions

KINK_DEG = 10.0
# Kibblewhite: a kink of these degrees and more counts so often.
KINK_WEIGHTS = ((91.0, 4), (46.0, 3), (21.0, 2))


def longest_extent(line: Floats) -> tuple[float, float]:
    """Return the largest distance between two points, and its direction in degrees."""
    points = hull_of(line)
    x, y = (np.subtract.outer(points[:, axis], points[:, axis]) for axis in (0, 1))
    squared = x * x + y * y
    first, last = np.unravel_index(int(np.argmax(squared)), squared.shape)
    span = points[last] - points[first]
    angle = float(np.degrees(np.arctan2(span[1], span[0]))) % 180.0
    return float(np.linalg.norm(span)), angle


def hull_of(line: Floats) -> Floats:
    """Return the corners of the convex hull of a line: the only points that can be far apart."""
    corners = cv2.convexHull(line.astype(np.float32)).reshape(-1, 2)
    return np.asarray(corners, dtype=np.float64)


def kink_angles_deg(line: Floats, width: float) -> list[float]:
    """Return the angle of each kink: what a line turns at once, beyond what it turns around it."""
    s = arc_lengths(line)
    step = float(s[-1]) / max(1, len(line) - 1)
    tangent = directions(line)
    angle = np.unwrap(np.arctan2(tangent[:, 1], tangent[:, 0]))
    half = max(2, round(max(1.5 * width, 10.0) / step))
    if len(line) < 6 * half:
        return []
    index = np.arange(2 * half, len(line) - 2 * half)
    turn = angle[index + half] - angle[index - half]
    around = (angle[index + 2 * half] - angle[index + half]) + (
        angle[index - half] - angle[index - 2 * half]
    )
    # On a bow the neighbourhood turns as much as the point itself; at a kink it does not.
    excess = np.degrees(turn - around)
    size = np.where(np.sign(excess) == np.sign(turn), np.abs(excess), 0.0)
    found = []
    while len(size) and float(size.max()) >= KINK_DEG:
        at = int(np.argmax(size))
        found.append(float(min(size[at], abs(np.degrees(turn[at])))))
        size[max(0, at - 2 * half) : at + 2 * half] = 0.0
    return [each for each in found if each >= KINK_DEG]


def kink_index(angles_deg: list[float], length: float) -> float:
    """Return Kibblewhite's kink index per unit of `length`."""
    total = 0
    for angle in angles_deg:
        total += next((weight for least, weight in KINK_WEIGHTS if angle >= least), 0)
    return total / length


def grasp_points(line: Floats, width: float, free: np.ndarray) -> Floats:
    """Return up to two points for grippers: free around, straight, near either end.

    `free` says for each point whether nothing else lies within a gripper's reach.
    """
    s = arc_lengths(line)
    total = float(s[-1])
    tangent = directions(line)
    step = total / max(1, len(line) - 1)
    half = max(1, round(1.5 * width / step))
    lag = np.clip(np.arange(len(line)) + half, 0, len(line) - 1)
    lead = np.clip(np.arange(len(line)) - half, 0, len(line) - 1)
    straight = (tangent[lag] * tangent[lead]).sum(axis=1)
    found = []
    for wanted, low, high in ((0.12, 0.04, 0.4), (0.88, 0.6, 0.96)):
        fit = free & (s >= low * total) & (s <= high * total) & (straight > np.cos(0.5))
        if fit.any():
            price = np.abs(s / total - wanted) + 0.5 * (1.0 - straight)
            found.append(line[int(np.argmin(np.where(fit, price, np.inf)))])
    return np.array(found).reshape(-1, 2)
