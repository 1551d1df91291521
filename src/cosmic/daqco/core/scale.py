"""Custom scales: polynomials from volts to the physical unit (thesis, DAQSI.10)."""

import math
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from cosmic.frame.arguments import checked_class
from cosmic.frame.errors import ConfigError

LARGEST_DEGREE = 9
LARGEST_COEFFICIENT = 1e12


@checked_class
@dataclass(frozen=True, slots=True)
class Scale:
    """A named polynomial, frozen; value = c0 + c1 V + c2 V**2 + ...

    Attributes
    ----------
    coefficients : tuple of float
        From the constant upwards, at least one.
    unit : str
        Of the value, as config keys spell it: "uN", "V".

    Raises
    ------
    ConfigError
        No name, no coefficients, too many, or one that is not finite or absurdly large.
    """

    name: str
    unit: str
    coefficients: tuple[float, ...] = field(default=(0.0, 1.0))

    def __post_init__(self) -> None:
        if not self.name.strip():
            raise ConfigError("a scale needs a name")
        count = len(self.coefficients)
        if not 1 <= count <= LARGEST_DEGREE + 1:
            raise ConfigError(
                f"scale {self.name!r}: {count} coefficients; give 1 to {LARGEST_DEGREE + 1}"
            )
        for power, coefficient in enumerate(self.coefficients):
            if not (math.isfinite(coefficient) and abs(coefficient) <= LARGEST_COEFFICIENT):
                raise ConfigError(
                    f"scale {self.name!r}: coefficient {power} is {coefficient!r}; "
                    f"give a finite number up to {LARGEST_COEFFICIENT:g}"
                )

    def apply(self, volts: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """Return physical values of `volts`, of the same shape, float64."""
        given = np.asarray(volts, dtype=np.float64)
        result = np.full(given.shape, self.coefficients[-1])
        for coefficient in self.coefficients[-2::-1]:
            result *= given
            result += coefficient
        return result


VOLTS = Scale("Volts", "V")
"""The scale of a channel that has none of its own."""
