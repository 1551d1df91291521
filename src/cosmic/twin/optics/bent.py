"""How a fibre in one gripper looks while the probe pushes it: turned cell by cell from its clamp.

The push is turned up until the fibre lies where the probe holds it. What the picture shows so is
bent by where it is truly clamped, by how much the jaws turn, and by how soft each place is.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from cosmic.frame.arrays import Floats

CELLS: Final = 48
INSIDE: Final = 4
"""Cells between the clamp and the jaws' tip."""
SETTLES: Final = 3
"""So often the push is aligned with the fibre that it has turned."""
TRIES: Final = 5
NEAR_UM: Final = 0.02


@dataclass(frozen=True, slots=True, eq=False)
class Compliance:
    """How a fibre gives way from its clamp on.

    Attributes
    ----------
    depth_um : float
        How far inside the jaws' tip it is clamped.
    turn_um : float
        So much of fibre would turn the end as much as the jaws do.
    places_um, softness : ndarray, shape (n,), float64
        Places along it from the jaws' tip, and how much it bends there for the same moment.
    """

    depth_um: float
    turn_um: float
    places_um: Floats
    softness: Floats

    def over_um(self, edges_um: Floats) -> Floats:
        """Return lengths between places, each as many times as long as it is soft."""
        means = 0.5 * (self.softness[1:] + self.softness[:-1])
        whole = np.concatenate([[0.0], np.cumsum(means * np.diff(self.places_um))])
        inside = self.softness[0] * np.minimum(edges_um, 0.0)
        return np.diff(np.interp(edges_um, self.places_um, whole) + inside)


def bent(free_um: Floats, compliance: Compliance, along_um: float, deflection_um: float) -> Floats:
    """Return a fibre out of the jaws as a push bends it, shape (m, 2).

    Parameters
    ----------
    free_um : ndarray, shape (n, 2), float64
        As it would run, from the jaws' tip on: along them, rising, and to the side.
    along_um : float
        Where the probe stands; it pushes to where the side is less.
    deflection_um : float
        By how much it has pushed the fibre aside there.
    """
    arcs = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(free_um, axis=0).T))])
    contact = float(np.interp(along_um, free_um[:, 0], arcs))
    inside = np.linspace(-compliance.depth_um, 0.0, INSIDE, endpoint=False)
    edges = np.concatenate([inside, np.linspace(0.0, contact, CELLS + 1)])
    edges = np.concatenate([edges, np.unique(np.append(arcs[arcs > contact + 1.0], arcs[-1]))])
    x = np.where(edges < 0.0, edges, np.interp(edges, arcs, free_um[:, 0]))
    y = np.where(edges < 0.0, 0.0, np.interp(edges, arcs, free_um[:, 1]))
    natural, steps = np.arctan2(np.diff(y), np.diff(x)), np.hypot(np.diff(x), np.diff(y))
    at = INSIDE + CELLS
    turns = np.where(np.arange(len(steps)) < at, compliance.over_um(edges), 0.0)
    turns[0] += compliance.softness[0] * compliance.turn_um
    height = float(np.interp(along_um, free_um[:, 0], free_um[:, 1]))

    def pushed(load: float) -> tuple[Floats, Floats]:
        heading = natural
        for _ in range(SETTLES):
            ahead = np.concatenate([[x[0]], x[0] + np.cumsum(np.cos(heading) * steps)])
            aside = np.concatenate([[0.0], np.cumsum(np.sin(heading) * steps)])
            cos, sin = np.cos(heading[at - 1]), np.sin(heading[at - 1])
            arm = (ahead[at] - 0.5 * (ahead[1:] + ahead[:-1])) * cos
            arm += (aside[at] - 0.5 * (aside[1:] + aside[:-1])) * sin
            turn = -load * turns * arm
            heading = natural + np.cumsum(turn) - 0.5 * turn
        ahead = np.concatenate([[x[0]], x[0] + np.cumsum(np.cos(heading) * steps)])
        return ahead, np.concatenate([[0.0], np.cumsum(np.sin(heading) * steps)])

    def short_um(load: float) -> float:
        ahead, aside = pushed(load)
        return height - float(np.interp(along_um, ahead, aside)) - deflection_um

    arm = x[at] - 0.5 * (x[1:] + x[:-1])
    low, high = 0.0, deflection_um / float(turns @ arm**2)
    off_low, off_high = -deflection_um, short_um(high)
    for _ in range(TRIES):
        if abs(off_high) < NEAR_UM or off_high == off_low:
            break
        low, high = high, high - off_high * (high - low) / (off_high - off_low)
        off_low, off_high = off_high, short_um(high)
    return np.column_stack(pushed(high))[INSIDE:]
