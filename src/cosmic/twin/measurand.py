"""What a bending test of one span is about: the stiffness that a perfect one would find."""

from typing import Final

import numpy as np

from cosmic.frame.arrays import Floats
from cosmic.twin.grip import Hold

CELLS: Final = 200


def compliance_weights(hold: Hold, abscissa_um: float) -> tuple[Floats, Floats]:
    """Return places along the fibre and how much each counts for a push, shape (n,).

    Parameters
    ----------
    abscissa_um : float
        Of the contact, along the jaws from their tip.

    Returns
    -------
    places_um, weights
        Places from the fibre's first end; weights are squares of the bending moment that a unit
        force along the fibre's normal at the contact makes there, from the clamp to the contact.
    """
    free = hold.free
    u, v = free.abscissas_um, free.asides_um
    arcs = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(u), np.diff(v)))])
    rising = len(u) if (np.diff(u) > 0.0).all() else int(np.argmin(np.diff(u) > 0.0)) + 1
    end = float(np.interp(abscissa_um, u[:rising], arcs[:rising]))
    length = end + hold.depth_um
    along = (np.arange(CELLS) + 0.5) / CELLS * length - hold.depth_um
    x = np.where(along < 0.0, along, np.interp(along, arcs, u))
    y = np.where(along < 0.0, 0.0, np.interp(along, arcs, v))
    near = np.interp([end - 1.0, end + 1.0], arcs, u), np.interp([end - 1.0, end + 1.0], arcs, v)
    tangent = np.array([near[0][1] - near[0][0], near[1][1] - near[1][0]])
    tangent = tangent / np.hypot(*tangent)
    away = np.interp(end, arcs, u) - x, np.interp(end, arcs, v) - y
    moments = away[0] * tangent[0] + away[1] * tangent[1]
    return hold.at_um + hold.outwards * along, moments * moments
