"""Centre lines of fibres: curved on the plate, bent by the probe."""

import math
from functools import cache
from typing import Final

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

NODES: Final = 41
PIECES: Final = 33
STEEPEST_RAD: Final = 1.0
"""Slope at the probe up to which a cantilever's shape is laid out, as in the rod."""


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


def cantilever(span_um: float, deflection_um: float, free_um: float) -> Floats:
    """Return abscissa and deflection of a fibre clamped at 0 and pushed at `span_um`.

    Shape (n, 2), um. Beyond the push it is straight, as far as `free_um` of fibre reach.
    """
    shapes, ratios, arcs = _elastica()
    ratio = min(abs(deflection_um) / span_um, float(ratios[-1]))
    after = min(max(int(np.searchsorted(ratios, ratio)), 1), len(ratios) - 1)
    part = (ratio - ratios[after - 1]) / (ratios[after] - ratios[after - 1])
    shape = (1.0 - part) * shapes[after - 1] + part * shapes[after]
    arc = (1.0 - part) * arcs[after - 1] + part * arcs[after]
    left = max(free_um / span_um - arc, 0.0)
    heading = shape[-1] - shape[-2]
    end = shape[-1] + heading * (left / math.hypot(*heading))
    line = np.concatenate([shape, end[None, :]]) * span_um
    line[:, 1] = np.copysign(line[:, 1], deflection_um)
    return np.asarray(line)


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


@cache
def _elastica() -> tuple[Floats, Floats, Floats]:
    """Return shapes, shape (m, n, 2), deflection and arc length of cantilevers of span 1.

    The first integral is the rod's: (psi')^2 = 2 k sin(psi), psi the slope counted from the
    contact. psi = t^2 takes the root out of the integrands.
    """
    t = np.linspace(0.0, math.sqrt(STEEPEST_RAD), 401)
    ratio = np.ones_like(t)
    ratio[1:] = np.sqrt(np.sin(t[1:] ** 2)) / t[1:]
    rise = _integral(2.0 * t * t * ratio, t)
    arc = _integral(2.0 / ratio, t)
    along = 2.0 * np.sqrt(np.sin(t * t))
    shapes = [np.stack([np.linspace(0.0, 1.0, PIECES), np.zeros(PIECES)], axis=1)]
    deflections, arcs = [0.0], [1.0]
    for top in t[10::10]:
        where = np.linspace(top, 0.0, PIECES)
        a, r = np.interp(where, t, along), np.interp(where, t, rise)
        x = a * math.cos(top * top) + r * math.sin(top * top)
        y = a * math.sin(top * top) - r * math.cos(top * top)
        shapes.append(np.stack([x[0] - x, y[0] - y], axis=1) / x[0])
        deflections.append(y[0] / x[0])
        arcs.append(float(np.interp(top, t, arc)) / x[0])
    return np.array(shapes), np.array(deflections), np.array(arcs)


def _integral(values: Floats, over: Floats) -> Floats:
    steps = 0.5 * (values[1:] + values[:-1]) * np.diff(over)
    return np.concatenate([[0.0], np.cumsum(steps)])
