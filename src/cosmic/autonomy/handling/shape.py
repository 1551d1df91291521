"""The shape of a fibre in the jaws, foretold from how it lay on the plate."""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from cosmic.autonomy.handling.plate import along, ways
from cosmic.vico.core.pixel_map import Floats

TANGENT_UM: Final = 120.0
"""Length to both sides of the jaws' tip from which the direction there is taken."""
STEP_UM: Final = 5.0


@dataclass(frozen=True, slots=True, eq=False)
class HeldShape:
    """The free part of a fibre, which leaves the jaws straight ahead.

    Attributes
    ----------
    ahead_um, aside_um, way_um : ndarray, shape (n,), float64
        Of places along it, from the jaws' tip: along the jaws, in y, and along the fibre. Ends
        where the fibre turns back.
    """

    ahead_um: Floats
    aside_um: Floats
    way_um: Floats

    @property
    def reach_um(self) -> float:
        """How far ahead of the jaws it reaches."""
        return float(self.ahead_um[-1])

    def bow_um(self, ahead_um: float) -> float:
        """Return how far in y the fibre is from straight ahead, so far from the jaws."""
        return float(np.interp(ahead_um, self.ahead_um, self.aside_um))

    def lever_um(self, ahead_um: float) -> float:
        """Return the length of a straight cantilever that gives way as much to a push there.

        The push is across the jaws' axis: each piece of the fibre bends with its arm along the
        axis, and a bowed fibre has more pieces than a straight one.
        """
        count = int(np.searchsorted(self.ahead_um, ahead_um))
        u = np.append(self.ahead_um[:count], ahead_um)
        s = np.append(self.way_um[:count], np.interp(ahead_um, self.ahead_um, self.way_um))
        arm = ahead_um - u
        parts = (arm[:-1] ** 2 + arm[:-1] * arm[1:] + arm[1:] ** 2) / 3.0 * np.diff(s)
        return float(np.cbrt(3.0 * parts.sum()))


def held_shape(line_um: Floats, inside_um: float, forward: float) -> HeldShape:
    """Return the shape that a fibre has in the jaws.

    Parameters
    ----------
    line_um : ndarray, shape (n, 2)
        Its centre line as it lay, from the end that is grasped.
    inside_um : float
        Length between the jaws.
    forward : float
        1 or -1: which way along x the jaws point.
    """
    whole = float(ways(line_um)[-1])
    near = np.linspace(max(0.0, inside_um - TANGENT_UM), min(whole, inside_um + TANGENT_UM), 25)
    points = np.array([along(line_um, float(way)) for way in near])
    slope = np.array([np.polyfit(near - inside_um, points[:, i], 2)[1] for i in (0, 1)])
    angle = (0.0 if forward > 0.0 else math.pi) - math.atan2(slope[1], slope[0])
    cos, sin = math.cos(angle), math.sin(angle)
    count = max(8, int((whole - inside_um) / STEP_UM))
    at = np.linspace(inside_um, whole, count)
    free = np.array([along(line_um, float(way)) for way in at]) - along(line_um, inside_um)
    ahead = forward * (cos * free[:, 0] - sin * free[:, 1])
    aside = sin * free[:, 0] + cos * free[:, 1]
    rises = np.diff(ahead) > 0.0
    last = len(ahead) if rises.all() else max(int(rises.argmin()) + 1, 2)
    return HeldShape(ahead[:last], aside[:last], at[:last] - inside_um)
