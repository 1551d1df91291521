"""How much friction holds sections that stand askew, as the fibres of a campaign show it together.

A slide tells of one fibre how much too stiff it is on the way out, to a few per cent. What those of
a campaign show tells how far such holds lie apart: where friction is small they all are nothing,
and a slide of one more fibre then tells of its noise.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from cosmic.autonomy.bending.result import SpanFit
from cosmic.frame.arrays import Floats

TWISTED: Final = 0.25
"""Of what friction does to a section askew: the part that differs between spans, by twist; it may
be seen to differ by more."""

TWISTED_LEAST: Final = 0.015
"""The same at least, of ln(k), of a fibre of which no others are known."""

LEAST_STD: Final = 0.004
"""Of ln(k): no slide tells more."""

FARTHEST: Final = 0.1
"""Of the mean hold of a campaign: how far it may lie from nothing, one standard deviation."""

SPREADS: Final = np.array([0.003, 0.01, 0.03, 0.06, 0.12, 0.2])
TWISTS: Final = np.array([0.003, 0.006, 0.01, 0.015, 0.03])
"""Of ln(k): standard deviations between fibres, and between the spans of one beside its part of the
hold; those that are weighed, all as likely beforehand."""

FEWEST: Final = 2
"""Fibres from which something is learned of the next."""


@dataclass(frozen=True, slots=True)
class Holds:
    """What is known of the holds of a campaign.

    Attributes
    ----------
    mean, std : float
        ln of the force once friction was made to let go by that before, over fibres.
    twisted : float
        How far that of a span lies from that of its fibre, beside `TWISTED` of it.
    """

    mean: float = 0.0
    std: float = math.inf
    twisted: float = TWISTED_LEAST


UNKNOWN_HOLDS: Final = Holds()


def holds_of(fibres: Sequence[Sequence[SpanFit]]) -> Holds:
    """Return what the slides of the spans of these fibres say."""
    slides = [found for each in fibres if len((found := slides_of(each))[0])]
    if len(slides) < FEWEST:
        return UNKNOWN_HOLDS
    likely = np.array([sum(_of_twist(*each, twist)[2] for each in slides) for twist in TWISTS])
    twisted = math.sqrt(float(_weights(likely) @ TWISTS**2))
    seen = [_of_twist(*each, twisted) for each in slides]
    means, variances = np.array([each[0] for each in seen]), np.array([each[1] for each in seen])
    spread = [_of_spread(means, variances, each) for each in SPREADS]
    middles, errors = np.array([each[0] for each in spread]), np.array([each[1] for each in spread])
    weights = _weights(np.array([each[2] for each in spread]))
    mean = float(weights @ middles)
    return Holds(mean, math.sqrt(float(weights @ (errors + (middles - mean) ** 2))), twisted)


def slides_of(fits: Sequence[SpanFit]) -> tuple[Floats, Floats]:
    """Return what the slides of a fibre showed, and the standard deviations of that."""
    logs = np.array([each.freed_log for each in fits], dtype=np.float64)
    stds = np.array([each.freed_std_part for each in fits], dtype=np.float64)
    known = np.isfinite(logs) & np.isfinite(stds)
    return logs[known], np.maximum(stds[known], LEAST_STD)


def _weights(log_likelihood: Floats) -> Floats:
    likely = np.exp(log_likelihood - log_likelihood.max())
    return np.asarray(likely / likely.sum())


def _of_twist(logs: Floats, stds: Floats, twist: float) -> tuple[float, float, float]:
    """Return mean of a fibre, variance of that, and ln of how likely its spans lie so far apart."""
    plain = stds**-2.0
    part = TWISTED * float(plain @ logs) / float(plain.sum())
    variances = stds**2 + part**2 + twist**2
    precision = float((1.0 / variances).sum())
    mean = float((logs / variances).sum()) / precision
    apart = float(((logs - mean) ** 2 / variances).sum())
    log_likelihood = -0.5 * (float(np.log(variances).sum()) + math.log(precision) + apart)
    return mean, 1.0 / precision, log_likelihood


def _of_spread(means: Floats, variances: Floats, spread: float) -> tuple[float, float, float]:
    """Return mean of all, variance of one more about it, and ln of how likely they lie so."""
    every = variances + spread**2
    precision = float((1.0 / every).sum()) + FARTHEST**-2.0
    mean = float((means / every).sum()) / precision
    left = float((means**2 / every).sum()) - mean**2 * precision
    log_likelihood = -0.5 * (float(np.log(every).sum()) + math.log(precision) + left)
    return mean, spread**2 + 1.0 / precision, log_likelihood
