"""A grip on a fibre: the shape that the fibre has in it, and what of it the probe can meet."""

import math
from bisect import bisect_right
from dataclasses import dataclass

import numpy as np

from cosmic.frame.arrays import Floats
from cosmic.twin.centre_line import CentreLine, turned
from cosmic.twin.fate import Fate
from cosmic.twin.kinematics import Point


class Free:
    """What stands out of the jaws, as functions of the abscissa from their tip, um.

    Attributes
    ----------
    reach_um : float
        As far as the abscissa rises along the fibre.
    length_um : float
        Of fibre outside the jaws.
    abscissas_um, asides_um : ndarray, shape (n,), float64
        All of it, where it turns back too.
    """

    def __init__(self, abscissas: Floats, asides: Floats) -> None:
        self.abscissas_um, self.asides_um = abscissas, asides
        steps = np.hypot(np.diff(abscissas), np.diff(asides))
        arcs = np.concatenate([[0.0], np.cumsum(steps)])
        rises = np.diff(abscissas) > 1e-9
        last = len(abscissas) if rises.all() else int(rises.argmin()) + 1
        self.length_um = float(arcs[-1])
        u = abscissas[:last]
        self.reach_um = float(u[-1])
        self._straight = not asides.any()
        self._u: list[float] = u.tolist()
        self._aside: list[float] = asides[:last].tolist()
        self._beyond: list[float] = (self.length_um - arcs[:last]).tolist()

    def aside_um(self, along_um: float) -> float:
        """Return how far to the side the undeformed fibre is there."""
        return 0.0 if self._straight else self._at(self._aside, along_um)

    def beyond_um(self, along_um: float) -> float:
        """Return the length of fibre beyond the position."""
        return self.length_um - along_um if self._straight else self._at(self._beyond, along_um)

    def _at(self, values: list[float], along_um: float) -> float:
        nodes = self._u
        after = min(max(bisect_right(nodes, along_um), 1), len(nodes) - 1)
        low, high = nodes[after - 1], nodes[after]
        part = min(max((along_um - low) / (high - low), 0.0), 1.0) if high > low else 0.0
        return values[after - 1] + part * (values[after] - values[after - 1])


@dataclass(slots=True)
class Hold:
    """One grip on a fibre.

    Attributes
    ----------
    at_um : float
        Position on the fibre, from its first end, where it leaves the jaws.
    outwards : int
        +1: the fibre's second end is the one outside the jaws.
    towards : int
        +1: the jaws point towards +x.
    depth_um : float
        How far inside the jaws it is really held.
    angle_rad : float
        By which the fibre's own frame is turned in the world.
    line_um : ndarray, shape (n, 2), float64
        The whole fibre from its first end on, relative to where it leaves the jaws.
    """

    at_um: float
    outwards: int
    towards: int
    depth_um: float
    angle_rad: float
    line_um: Floats
    free: Free
    fate: Fate

    def frame_um(self, line: CentreLine, hold: Point) -> tuple[float, float]:
        """Return where the origin of the fibre's own frame is in the world."""
        x, y = turned(line.point(self.at_um)[None, :], self.angle_rad)[0].tolist()
        return hold[0] - x, hold[1] - y


def make_hold(line: CentreLine, at_um: float, outwards: int, towards: int, fate: Fate) -> Hold:
    """Return the grip on a fibre at a position: straight inside the jaws, as it grew outside.

    Where it leaves the jaws it points along them.
    """
    angle = (0.0 if towards * outwards > 0 else math.pi) - line.heading(at_um + 1e-6 * outwards)
    whole = line.length_um
    low, high = (at_um, whole) if outwards > 0 else (0.0, at_um)
    _, points = line.part(low, high)
    outside = turned(points - line.point(at_um), angle)
    outside = outside if outwards > 0 else outside[::-1]
    free = Free(towards * outside[:, 0], np.where(np.abs(outside[:, 1]) < 1e-9, 0.0, outside[:, 1]))
    inside = np.array([[-towards * (at_um if outwards > 0 else whole - at_um), 0.0]])
    both = np.concatenate([inside, outside])
    nodes = both if outwards > 0 else both[::-1]
    return Hold(at_um, outwards, towards, fate.depth_um, angle, nodes, free, fate)
