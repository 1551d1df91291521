"""The middle of a fibre as a chain of points, and positions along it."""

import math
from functools import cached_property

import numpy as np

from cosmic.frame.arrays import Floats
from cosmic.twin.optics.shapes import lying


class CentreLine:
    """A fibre's natural shape in a frame of its own, flat; never changed.

    Parameters
    ----------
    points_um : ndarray, shape (n, 2), float64
    """

    def __init__(self, points_um: Floats) -> None:
        points_um.flags.writeable = False
        self.points_um = points_um
        steps = np.hypot(*np.diff(points_um, axis=0).T)
        self.arcs_um: Floats = np.concatenate([[0.0], np.cumsum(steps)])

    @classmethod
    def of(cls, length_um: float, curl_deg: float, kink_deg: float) -> "CentreLine":
        """Return the line that is drawn for a fibre of twin.toml."""
        return cls(lying(length_um, curl_deg, kink_deg))

    @property
    def length_um(self) -> float:
        """Along the line."""
        return float(self.arcs_um[-1])

    @cached_property
    def straight(self) -> bool:
        """Whether it has no bow at all."""
        return len(self.points_um) == 2

    def point(self, at_um: float) -> Floats:
        """Return the position `at_um` along the line, shape (2,)."""
        return np.array([np.interp(at_um, self.arcs_um, column) for column in self.points_um.T])

    def heading(self, at_um: float) -> float:
        """Return the direction of the line there, rad."""
        after = int(np.searchsorted(self.arcs_um, at_um, side="right"))
        after = min(max(after, 1), len(self.arcs_um) - 1)
        dx, dy = (self.points_um[after] - self.points_um[after - 1]).tolist()
        return math.atan2(dy, dx)

    def part(self, low_um: float, high_um: float) -> tuple[Floats, Floats]:
        """Return arcs, shape (m,), and points, shape (m, 2), from one position to another."""
        between = self.arcs_um[(self.arcs_um > low_um) & (self.arcs_um < high_um)]
        arcs = np.concatenate([[low_um], between, [high_um]])
        points = [np.interp(arcs, self.arcs_um, column) for column in self.points_um.T]
        return arcs, np.column_stack(points)

    def placed(self, x_um: float, y_um: float, angle_rad: float) -> Floats:
        """Return the line moved and turned, shape (n, 2)."""
        return np.asarray(turned(self.points_um, angle_rad) + np.array([x_um, y_um]))


def turned(points_um: Floats, angle_rad: float) -> Floats:
    """Return points turned about the origin, shape (n, 2)."""
    cos, sin = math.cos(angle_rad), math.sin(angle_rad)
    return np.asarray(points_um @ np.array([[cos, sin], [-sin, cos]]))
