"""A straight line through a measured curve, with how sure it is."""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from cosmic.frame.errors import RecordingError

Values = npt.NDArray[np.float64]
ROUNDING: Final = 1e-9
"""Part of a position that interpolation adds to one that does not change."""
FEWEST_SAMPLES: Final = 3


@dataclass(frozen=True, slots=True)
class Slope:
    """A line fitted by least squares, such as force over position.

    Attributes
    ----------
    value : float
        Rise per unit of position, in `unit`.
    standard_error : float
        Of `value`, same unit; wider where neighbouring residuals resemble each other.
    offset : float
        Value of the line at position 0.
    residual : float
        Standard deviation of the values around the line.
    samples : int
        How many were used.
    """

    value: float
    standard_error: float
    unit: str
    offset: float
    residual: float
    samples: int

    @property
    def text(self) -> str:
        """Value and standard error, with two figures of the error, and the unit."""
        error = self.standard_error
        known = math.isfinite(error) and error > 0.0
        digits = min(6, max(0, 1 - math.floor(math.log10(error)))) if known else 3
        return f"{self.value:.{digits}f} ± {error:.{digits}f} {self.unit}"


def fit_slope(positions: Values, values: Values, unit: str = "") -> Slope:
    """Fit a line through `values` over `positions`, both shape (n,), in the order of time.

    Raises
    ------
    RecordingError
        Fewer than three samples, or all at one position.
    """
    count = positions.size
    if count < FEWEST_SAMPLES:
        raise RecordingError(f"a slope needs at least {FEWEST_SAMPLES} samples, there are {count}")
    middle = float(positions.mean())
    offsets = positions - middle
    spread = float(offsets @ offsets)
    if not float(np.ptp(positions)) > ROUNDING * max(1.0, abs(middle)):
        raise RecordingError(f"a slope needs travel; all {count} samples lie at {middle:g}")
    value = float(offsets @ values) / spread
    level = float(values.mean())
    residuals = values - level - value * offsets
    squares = float(residuals @ residuals)
    variance = squares / (count - 2)
    return Slope(
        value=value,
        standard_error=float(np.sqrt(variance / spread * _widening(residuals, squares))),
        unit=unit,
        offset=level - value * middle,
        residual=float(np.sqrt(variance)),
        samples=count,
    )


def _widening(residuals: Values, squares: float) -> float:
    """Return by how much fewer independent samples there are, seen from neighbours."""
    if not squares > 0.0:
        return 1.0
    alike = float(residuals[1:] @ residuals[:-1]) / squares
    alike = min(max(alike, 0.0), 1.0 - 1.0 / residuals.size)
    return (1.0 + alike) / (1.0 - alike)
