"""Centre lines of fibres: curved on the plate, bent between two grippers."""

import math
from typing import Final

import numpy as np

from cosmic.frame.arrays import Floats

NODES: Final = 41


def lying(length_um: float, curl_deg: float, kink_deg: float) -> Floats:
    """Return the centre line of a fibre about its middle, shape (n, 2), um.

    Parameters
    ----------
    curl_deg : float
        By how much it turns, evenly, from end to end.
    kink_deg : float
        By how much it turns in its middle.
    """
    if not (curl_deg or kink_deg):
        return np.array([[-0.5 * length_um, 0.0], [0.5 * length_um, 0.0]])
    parts = np.linspace(-0.5, 0.5, NODES)
    middles = 0.5 * (parts[1:] + parts[:-1])
    heading = np.radians(curl_deg) * middles + np.radians(kink_deg) * (middles > 0.0)
    steps = np.stack([np.cos(heading), np.sin(heading)], axis=1) * (length_um / (NODES - 1))
    line = np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])
    chord = line[-1] / math.hypot(*line[-1])
    line = line @ np.array([[chord[0], -chord[1]], [chord[1], chord[0]]])
    return np.asarray(line - [0.5 * line[-1, 0], line[:, 1].mean()])


def bridge(span_um: float, deflection_um: float, distance_um: float) -> Floats:
    """Return abscissa and deflection of a fibre clamped at 0 and at `distance_um`; shape (n, 2)."""
    left, right = span_um, distance_um - span_um
    # Two cubics, level at the clamps, alike in slope and curvature at the push.
    slope = deflection_um * 1.5 * (1.0 / left**2 - 1.0 / right**2) / (1.0 / left + 1.0 / right)
    t = np.linspace(0.0, 1.0, NODES // 2)
    rise = deflection_um * t * t * (3.0 - 2.0 * t)
    swing = t * t * (t - 1.0)
    first = np.stack([left * t, rise + slope * left * swing], axis=1)
    second = np.stack([distance_um - right * t, rise - slope * right * swing], axis=1)
    return np.concatenate([first, second[-2::-1]])
