"""How much friction holds sections that stand askew, as the fibres of a campaign show it together.

A slide tells of one fibre how much too stiff it is on the way out, to a few per cent. What those of
a campaign show tells how far such holds lie apart: where friction is small they all are nothing,
and a slide of one more fibre then tells of its noise; and how unlike the spans of a fibre are. It
also tells whether the friction along the fibre lets go with a slide: that goes by its slope, from
span to span, and where it does, not one fibre keeps the force that it had.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from scipy.special import log_ndtr

from cosmic.autonomy.bending.result import SpanFit
from cosmic.frame.arrays import Floats

TWISTED: Final = 0.25
"""Of what friction does to a section askew: the part that differs between spans, by twist, of a
fibre of which no others are known."""

TWISTED_LEAST: Final = 0.015
"""The same at least, of ln(k)."""

LEAST_STD: Final = 0.004
"""Of ln(k): no slide tells more."""

FARTHEST: Final = 0.1
"""Of the mean hold of a campaign: how far it may lie from nothing, one standard deviation."""

SPREADS: Final = np.array([0.003, 0.01, 0.03, 0.06, 0.12, 0.2])
TWISTS: Final = np.array([0.003, 0.006, 0.01, 0.015, 0.03])
PARTS: Final = np.array([0.03, 0.06, 0.12, 0.25, 0.5])
"""Of ln(k): standard deviations between fibres, and between the spans of one, by itself and as a
part of the hold; those that are weighed, all as likely beforehand."""

LET_GO: Final = np.linspace(0.0, 1.0, 11)
LET_GO_STD: Final = 0.5
"""Of friction along the fibre: parts that may let go with a slide, those that are weighed, and how
far they lie from nothing beforehand. A contact that slides up is not rubbed along; one that crept
back, or stuck on the way, is again."""

FEWEST: Final = 2
"""Fibres from which something is learned of the next."""


@dataclass(frozen=True, slots=True)
class Holds:
    """What is known of the holds of a campaign.

    Attributes
    ----------
    mean, std : float
        ln of the force once friction was made to let go by that before, over fibres.
    twisted, twisted_part : float
        How far that of a span lies from that of its fibre, by itself and as a part of it.
    along, along_std : float
        Friction along the fibre that lets go with a slide.
    """

    mean: float = 0.0
    std: float = math.inf
    twisted: float = TWISTED_LEAST
    twisted_part: float = TWISTED
    along: float = 0.0
    along_std: float = math.inf


UNKNOWN_HOLDS: Final = Holds()


class Slides(NamedTuple):
    """What the slides of a fibre showed, standard deviations, and what friction along does."""

    logs: Floats
    stds: Floats
    by_friction: Floats


def holds_of(fibres: Sequence[Sequence[SpanFit]]) -> Holds:
    """Return what the slides of the spans of these fibres say."""
    slides = [shown for each in fibres if len((shown := slides_of(each)).logs)]
    if len(slides) < FEWEST:
        return UNKNOWN_HOLDS
    friction = max(fit.friction for each in fibres for fit in each)
    along, along_std = _along(slides, friction)
    found = _twists_of(slides, along)
    spread = [_of_spread(found.means, found.variances, each) for each in SPREADS]
    middles, errors = np.array([each[0] for each in spread]), np.array([each[1] for each in spread])
    weights = _weights(np.array([each[2] for each in spread]))
    mean = float(weights @ middles)
    std = math.sqrt(float(weights @ (errors + (middles - mean) ** 2)))
    return Holds(mean, std, found.twisted, found.part, along, along_std)


def _along(slides: Sequence[Slides], friction: float) -> tuple[float, float]:
    """Return how much of the friction along let go, and the standard deviation of that."""
    likely = np.array([_twists_of(slides, part * friction).log_likelihood for part in LET_GO])
    weights = _weights(likely - 0.5 * (LET_GO / LET_GO_STD) ** 2)
    part = float(weights @ LET_GO)
    # As well as the steps between those that are weighed tell it.
    variance = float(weights @ (LET_GO - part) ** 2) + (LET_GO[1] - LET_GO[0]) ** 2 / 12.0
    return friction * part, friction * math.sqrt(variance)


def slides_of(fits: Sequence[SpanFit]) -> Slides:
    """Return what the slides of a fibre showed."""
    logs = np.array([each.freed_log for each in fits], dtype=np.float64)
    stds = np.array([each.freed_std_part for each in fits], dtype=np.float64)
    rubbed = np.array([each.by_friction_both + each.by_friction for each in fits], dtype=np.float64)
    known = np.isfinite(logs) & np.isfinite(stds)
    return Slides(logs[known], np.maximum(stds[known], LEAST_STD), rubbed[known])


def _weights(log_likelihood: Floats) -> Floats:
    likely = np.exp(log_likelihood - log_likelihood.max())
    return np.asarray(likely / likely.sum())


class _Twists(NamedTuple):
    """How far spans differ, mean and variance of each fibre, and how likely all of it is."""

    twisted: float
    part: float
    means: Floats
    variances: Floats
    log_likelihood: float


def _twists_of(slides: Sequence[Slides], along: float) -> _Twists:
    """Return what the slides say where so much friction along let go with them."""
    grid = np.array([(part, twist) for part in PARTS for twist in TWISTS])
    logs, stds = _side_by_side(slides, along)
    likely = _of_twists(logs, stds, grid)[2].sum(axis=0)
    part, twisted = (float(each) for each in _weights(likely) @ grid)
    means, variances, _ = (
        each[:, 0] for each in _of_twists(logs, stds, np.array([[part, twisted]]))
    )
    held = np.array([_held_down(means, variances, each) for each in SPREADS])
    total = float(np.logaddexp.reduce(likely) + np.logaddexp.reduce(held))
    return _Twists(twisted, part, means, variances, total)


def _side_by_side(slides: Sequence[Slides], along: float) -> tuple[Floats, Floats]:
    """Return what slides showed and its standard deviations, a row a fibre; infinite where none."""
    most = max(len(each.logs) for each in slides)
    logs, stds = np.zeros((len(slides), most)), np.full((len(slides), most), np.inf)
    for number, each in enumerate(slides):
        logs[number, : len(each.logs)] = each.logs + along * each.by_friction
        stds[number, : len(each.logs)] = each.stds
    return logs, stds


def _held_down(means: Floats, variances: Floats, spread: float) -> float:
    """Return ln of how likely holds are that lie so far from nothing: none makes a fibre softer."""
    every = variances + spread**2
    sigmas = -means * spread / np.sqrt(variances * every)
    each = -0.5 * (means**2 / every + np.log(every)) + log_ndtr(sigmas)
    return float(each.sum())


def _of_twists(logs: Floats, stds: Floats, grid: Floats) -> tuple[Floats, Floats, Floats]:
    """Return mean of each fibre, variance of that, and ln of how likely its spans lie so far apart.

    Parameters
    ----------
    logs, stds : ndarray, shape (fibres, spans)
    grid : ndarray, shape (g, 2)
        How far spans differ, as a part of the hold and by itself.

    Returns
    -------
    tuple of ndarray, shape (fibres, g) each
    """
    plain = stds**-2.0
    part, twist = grid.T
    differs = np.outer((plain * logs).sum(axis=1) / plain.sum(axis=1), part)
    variances = stds[:, None, :] ** 2 + (differs**2 + twist**2)[:, :, None]
    weights = 1.0 / variances
    precision = weights.sum(axis=2)
    mean = (weights * logs[:, None, :]).sum(axis=2) / precision
    apart = (weights * (logs[:, None, :] - mean[:, :, None]) ** 2).sum(axis=2)
    sizes = np.log(variances, out=np.zeros_like(variances), where=np.isfinite(variances))
    return mean, 1.0 / precision, -0.5 * (sizes.sum(axis=2) + np.log(precision) + apart)


def _of_spread(means: Floats, variances: Floats, spread: float) -> tuple[float, float, float]:
    """Return mean of all, variance of one more about it, and ln of how likely they lie so."""
    every = variances + spread**2
    precision = float((1.0 / every).sum()) + FARTHEST**-2.0
    mean = float((means / every).sum()) / precision
    left = float((means**2 / every).sum()) - mean**2 * precision
    log_likelihood = -0.5 * (float(np.log(every).sum()) + math.log(precision) + left)
    return mean, spread**2 + 1.0 / precision, log_likelihood
