"""Exact distances of convex bodies from their vertices alone, by quadratic and linear programming.

Nothing here comes from the program or from a collision library.
"""

from itertools import product

import numpy as np
from scipy.optimize import linprog, nnls
from scipy.spatial import ConvexHull

FEW = 400
"""Differences that are looked at all at once."""
EXACT = 1e-7
"""How exact a distance is that took more, in the unit of the points."""


def distance(one: np.ndarray, other: np.ndarray) -> float:
    """Return the distance of the hulls of two sets of points, 0 where they meet.

    The plane that separates them widest is a least-distance problem (Lawson and Hanson, chapter
    23), dual to non-negative least squares over all differences of vertices.
    """
    if len(one) * len(other) > FEW:
        return _of_many(one, other)
    differences = (other[:, np.newaxis, :] - one[np.newaxis, :, :]).reshape(-1, 3)
    return float(np.linalg.norm(_nearest(differences)))


def _of_many(one: np.ndarray, other: np.ndarray) -> float:
    """Take in one difference after the other, always the nearest along what was found."""
    taken = [other[0] - one[0]]
    while True:
        found = _nearest(np.array(taken))
        size = float(np.linalg.norm(found))
        if size == 0.0:
            return 0.0
        nearer = other[np.argmin(other @ found)] - one[np.argmax(one @ found)]
        if nearer @ found >= size * (size - EXACT) or any((nearer == t).all() for t in taken):
            return size
        taken.append(nearer)


def _outer(points: np.ndarray) -> np.ndarray:
    return points[ConvexHull(points).vertices]


def _nearest(points: np.ndarray) -> np.ndarray:
    """Return the point of the hull that is nearest to the origin."""
    scale = float(np.abs(points).max())
    if scale == 0.0:
        return np.zeros(3)
    # Find the smallest w with w . p >= 1 for all points p; the distance is 1 / |w|.
    system = np.vstack((points.T / scale, np.ones(len(points))))
    weights, left = nnls(system, np.array([0.0, 0.0, 0.0, 1.0]), maxiter=30 * len(points))
    if left < 1e-11:
        return np.zeros(3)
    return weights @ points / weights.sum()


def lower_distance(one: np.ndarray, other: np.ndarray, normal: np.ndarray) -> float:
    """Return what a plane proves: how far the two are apart along `normal`."""
    normal = normal / np.linalg.norm(normal)
    return float((other @ normal).min() - (one @ normal).max())


def meet(one: np.ndarray, other: np.ndarray) -> bool:
    """Return True when the hulls of two sets of points share a point, by linear programming."""
    size = len(one) + len(other)
    equal = np.zeros((5, size))
    equal[:3, : len(one)], equal[:3, len(one) :] = one.T, -other.T
    equal[3, : len(one)], equal[4, len(one) :] = 1.0, 1.0
    done = linprog(np.zeros(size), A_eq=equal, b_eq=[0, 0, 0, 1, 1], method="highs")
    return bool(done.status == 0)


def swept(points: np.ndarray, ways: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Return points whose hull is all that a body covers, shifted by ways @ anything between.

    Parameters
    ----------
    points : ndarray, shape (n, 3)
    ways : ndarray, shape (3, m)
    low, high : ndarray, shape (m,)
    """
    corners = np.array(list(product(*zip(low, high, strict=True))))
    every = (points[:, np.newaxis, :] + (corners @ ways.T)[np.newaxis, :, :]).reshape(-1, 3)
    return _outer(every) if len(every) > 60 else every


def slab_distance(
    one: tuple[np.ndarray, np.ndarray], other: tuple[np.ndarray, np.ndarray], shift: np.ndarray
) -> float:
    """Return the least distance of two aligned boxes while the first moves by `shift`.

    Each box is its two corners. Exact for a shift along one axis; else of its bounding box.
    """
    low = np.minimum(one[0], one[0] + shift)
    high = np.maximum(one[1], one[1] + shift)
    apart = np.maximum(np.maximum(other[0] - high, low - other[1]), 0.0)
    return float(np.linalg.norm(apart))
