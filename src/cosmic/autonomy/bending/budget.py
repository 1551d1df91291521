"""What the interval of a bending stiffness follows from, after GUM."""

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from cosmic.autonomy.bending.inference import (
    Common,
    Evidence,
    Posterior,
    Readings,
    fixed_covariance,
    varied_covariance,
)
from cosmic.autonomy.bending.result import COMMON_SOURCES, Contribution, Kind
from cosmic.autonomy.bending.settings import FitSettings
from cosmic.frame.arrays import Floats

EXCESS_SCATTER: Final = "scatter of the spans beyond what was foreseen"
"""By what the interval is wider where readings scatter more than foreseen."""


def budget_of(
    readings: Readings,
    common: Common,
    settings: FitSettings,
    posterior: Posterior,
    evidence: Evidence,
) -> tuple[Contribution, ...]:
    """Return the contributions to the variance of ln(EI), the largest first.

    With depth and variation at their means ln(EI) is a weighted sum of the readings; the weights
    are the sensitivities. What the depth adds is the spread of ln(EI) over its weights.
    """
    span, variation = readings.span, posterior.variation
    nearest = int(np.abs(evidence.depths_um - posterior.depth_um).argmin())
    varied = varied_covariance(readings, settings)[nearest] * variation**2
    whole = fixed_covariance(readings, common) + varied
    each = np.linalg.solve(whole, np.ones(len(span)))
    weights = each / each.sum()
    by = weights @ readings.to_common
    lines = [
        _line("readings", Kind.A, by_noise := _root(weights, readings.noise), "", by_noise),
        _line(
            "places of contact",
            Kind.A,
            settings.contact_std_um,
            "um",
            _root(weights, readings.repeat),
        ),
        _line(
            "friction on a section askew",
            Kind.B,
            _typical_std(weights, readings.askew),
            "",
            _root(weights, readings.askew),
        ),
        _line("stiffness along the fibre", Kind.B, variation, "", _root(weights, varied)),
    ]
    stds = np.sqrt(np.diag(common.covariance))
    units = ("", "", "", "um/uN", "um", "", "", "", "")
    for number, (name, unit) in enumerate(zip(COMMON_SOURCES, units, strict=True)):
        # What goes together is shared among both by its covariance.
        part = float(by[number] * (common.covariance[number] @ by))
        lines.append((name, Kind.B, float(stds[number]), unit, float(by[number]), max(part, 0.0)))
    for name, unit, column, _, std in readings.own:
        slope = float(weights @ column)
        lines.append((name, Kind.B, std, unit, slope, (slope * std) ** 2))
    of_depth = posterior.weights.sum(axis=1)
    at_depth = (posterior.weights * evidence.log_ei).sum(axis=1) / np.maximum(of_depth, 1e-12)
    mean = float(of_depth @ at_depth)
    clamp = float(of_depth @ (at_depth - mean) ** 2)
    slope = math.sqrt(clamp) / max(posterior.depth_std_um, 1e-9)
    more = (posterior.excess - 1.0) * sum(line[5] for line in lines)
    lines.append((EXCESS_SCATTER, Kind.A, math.sqrt(more), "", 1.0, more))
    lines.append(("depth of the clamp", Kind.B, posterior.depth_std_um, "um", slope, clamp))
    variance = sum(line[5] for line in lines) or 1.0
    budget = [
        Contribution(name, kind, std, unit, slope, part / variance)
        for name, kind, std, unit, slope, part in lines
    ]
    return tuple(sorted(budget, key=lambda line: -line.share))


def combined_std_ln(budget: Sequence[Contribution], *, common: bool = False) -> float:
    """Return the standard uncertainty of ln(EI) by its budget, or that which all fibres share.

    What is learned together goes together, so that its lines alone do not add up: the whole
    follows from the shares of the others.
    """
    alone = [line for line in budget if line.source not in COMMON_SOURCES]
    share = sum(line.share for line in alone)
    lines = alone if share > 0.0 else budget
    variance = sum((line.std * line.sensitivity) ** 2 for line in lines)
    whole = variance / share if share > 0.0 else variance
    part = sum(line.share for line in budget if line.common) if common else 1.0
    return math.sqrt(whole * part)


def _typical_std(weights: Floats, covariance: Floats) -> float:
    return math.sqrt(float(np.average(np.diag(covariance), weights=weights**2)))


def _root(weights: Floats, covariance: Floats) -> float:
    return math.sqrt(max(float(weights @ covariance @ weights), 0.0))


def _line(
    name: str, kind: Kind, std: float, unit: str, effect: float
) -> tuple[str, Kind, float, str, float, float]:
    return name, kind, std, unit, effect / std if std > 0.0 else 0.0, effect**2
