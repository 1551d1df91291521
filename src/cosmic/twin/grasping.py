"""Whether closing jaws enclose a fibre, by geometry alone."""

import math

import numpy as np

from cosmic.twin.fibre import Floats
from cosmic.twin.force_settings import ContactSettings
from cosmic.twin.tools import Tool


def between_jaws(
    tool: Tool, line: Floats, widest_um: float, contact: ContactSettings
) -> tuple[float, int] | None:
    """Return where along a fibre the jaws' tip is and which end is outside.

    None where the jaws do not enclose it, or where a part of it lies under them.

    Parameters
    ----------
    line : ndarray, shape (n, 3), float64
        The fibre's middle, um, world.
    widest_um : float
        How far the jaws were open before they closed.
    """
    ahead = (line[:, 0] - tool.hold[0]) * tool.towards
    aside = line[:, 1] - tool.hold[1]
    half = widest_um / 2.0
    if (np.abs(aside[ahead < 0.0]) > half).any():
        return None
    steep = math.tan(math.radians(contact.grasp_angle_deg))
    arcs = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line[:, :2], axis=0).T))])
    for after in range(1, len(line)):
        a0, a1 = float(ahead[after - 1]), float(ahead[after])
        if (a0 < 0.0) == (a1 < 0.0):
            continue
        if abs(float(aside[after] - aside[after - 1])) > steep * abs(a1 - a0):
            continue
        part = a0 / (a0 - a1)
        there = line[after - 1] + part * (line[after] - line[after - 1])
        if abs(there[1] - tool.hold[1]) > half:
            continue
        if abs(there[2] - tool.hold[2]) > contact.grasp_height_um:
            continue
        at = float(arcs[after - 1] + part * (arcs[after] - arcs[after - 1]))
        return at, 1 if a1 > a0 else -1
    return None
