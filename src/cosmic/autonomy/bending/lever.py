"""Stiffness over position along the fibre: how EI and the unknown clamp are told apart.

k = 3 EI / (position + offset)^3, so k^(-1/3) is a straight line over the position, which encoders
know exactly from span to span. Its slope is (3 EI)^(-1/3), and the offset cancels in it.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from cosmic.autonomy.bending.result import Floats, SpanFit
from cosmic.autonomy.bending.settings import FitSettings

INTERVAL: Final = 3.8415
"""How much chi squared grows to the ends of a 95 % interval."""

WIDEST: Final = math.log(1000.0) / 3.0
ROUNDS: Final = 3
LEAST_PART: Final = 1e-4


@dataclass(frozen=True, slots=True)
class Lever:
    """The straight line, with the interval of its slope alone."""

    ei_un_um2: float
    low_un_um2: float
    high_un_um2: float
    offset_um: float
    offset_std_um: float
    chi2: float


@dataclass(frozen=True, slots=True, eq=False)
class _Line:
    """k^(-1/3) = slope (position + offset), with what is known of the offset beforehand."""

    positions: Floats
    roots: Floats
    sigmas: Floats
    prior_um: float
    prior_std_um: float

    def offset(self, slope: float) -> tuple[float, float]:
        """Return the best offset for a slope, and its standard deviation."""
        weights = (slope / self.sigmas) ** 2
        own = self.prior_std_um**-2
        total = float(weights.sum()) + own
        wanted = self.roots / slope - self.positions
        return (float(weights @ wanted) + own * self.prior_um) / total, total**-0.5

    def chi2(self, slope: float) -> float:
        """Return the sum of squares with the best offset for a slope."""
        offset, _ = self.offset(slope)
        away = (self.roots - slope * (self.positions + offset)) / self.sigmas
        return float(away @ away) + ((offset - self.prior_um) / self.prior_std_um) ** 2


def fit_lever(
    fits: Sequence[SpanFit],
    settings: FitSettings,
    *,
    stiffnesses: Sequence[float] | None = None,
) -> Lever:
    """Return EI and offset from stiffnesses at known positions.

    Parameters
    ----------
    stiffnesses : sequence of float, optional
        To be taken instead of those of the spans, to see what would change.
    """
    k = np.array([fit.k_un_um for fit in fits] if stiffnesses is None else stiffnesses)
    parts = np.array([max(fit.k_std_un_um / fit.k_un_um, LEAST_PART) for fit in fits])
    positions = np.array([fit.place_um for fit in fits])
    roots = k ** (-1.0 / 3.0)
    log_slope = float(np.log(np.mean(roots / np.maximum(positions + settings.offset_um, 10.0))))
    line = _line(positions, roots, parts, log_slope, settings)
    for _ in range(ROUNDS):
        log_slope = _best(line, log_slope)
        line = _line(positions, roots, parts, log_slope, settings)
    lowest = line.chi2(math.exp(log_slope))
    low, high = _ends(line, log_slope, lowest, scale=_excess(lowest, len(fits) - 1))
    offset, _ = line.offset(math.exp(log_slope))
    return Lever(
        ei_un_um2=_ei(log_slope),
        low_un_um2=_ei(high),
        high_un_um2=_ei(low),
        offset_um=offset,
        offset_std_um=_offset_std(line, log_slope),
        chi2=lowest,
    )


def _line(
    positions: Floats, roots: Floats, parts: Floats, log_slope: float, settings: FitSettings
) -> _Line:
    # An error of the position counts as one of the root, by a slope that is not known beforehand.
    contact = math.exp(log_slope) * settings.contact_std_um
    sigmas = np.hypot(roots * parts / 3.0, contact)
    return _Line(positions, roots, sigmas, settings.offset_um, settings.offset_std_um)


def _ei(log_slope: float) -> float:
    return math.exp(-3.0 * log_slope) / 3.0


def _best(line: _Line, start: float) -> float:
    from scipy.optimize import minimize_scalar  # half a second, at the first fit

    found = minimize_scalar(
        lambda each: line.chi2(math.exp(each)),
        bounds=(start - WIDEST, start + WIDEST),
        method="bounded",
        options={"xatol": 1e-7},
    )
    return float(found.x)


def _excess(chi2: float, freedom: int) -> float:
    """Return by how much the noise was underrated, if that is beyond doubt."""
    return max(1.0, chi2 / freedom) if freedom > 0 and chi2 > INTERVAL * freedom else 1.0


def _ends(line: _Line, best: float, lowest: float, *, scale: float) -> tuple[float, float]:
    """Return where chi squared has grown by `INTERVAL` on both sides of the best slope."""
    from scipy.optimize import brentq

    def above(log_slope: float) -> float:
        return line.chi2(math.exp(log_slope)) - lowest - INTERVAL * scale

    ends = []
    for side in (-1.0, 1.0):
        step = 1e-3
        while above(best + side * step) < 0.0 and step < WIDEST:
            step *= 2.0
        far = best + side * min(step, WIDEST)
        ends.append(float(brentq(above, best, far)) if above(far) > 0.0 else far)
    return ends[0], ends[1]


def _offset_std(line: _Line, log_slope: float) -> float:
    """Return the offset's standard deviation, the slope's included."""
    slope = math.exp(log_slope)
    matrix = np.column_stack(
        [(line.positions + line.offset(slope)[0]), np.full_like(line.positions, slope)]
    )
    weighed = matrix / line.sigmas[:, None]
    information = weighed.T @ weighed
    information[1, 1] += line.prior_std_um**-2
    return float(np.sqrt(np.linalg.pinv(information)[1, 1]))
