"""How a simulated channel counts: from a stage's true position to 0.1 um or 0.1 mdeg."""

import math
from typing import Final

from cosmic.frame.units import AxisUnit

COUNTS_PER_UNIT: Final[dict[AxisUnit, float]] = {"um": 10.0, "deg": 10_000.0}
FINE_PER_UNIT: Final[dict[AxisUnit, float]] = {"um": 1e3, "deg": 1e6}
"""SetScale and the target threshold count in nm and micro-degree."""

_INT32: Final = 2**31 - 1


class CountScale:
    """Logical scale of one channel over its stage's true position.

    The sensor is incremental: until the channel is referenced, zero is where the stage stood at
    power-up. Positions handed in are true ones, in the stage's unit.

    Parameters
    ----------
    unit : {"um", "deg"}
        Unit of the stage.
    scale_fine : int
        Stored offset, nm or micro-degree: the position at the reference.
    """

    def __init__(self, unit: AxisUnit, scale_fine: int) -> None:
        self._per_unit = COUNTS_PER_UNIT[unit]
        self._fine_per_unit = FINE_PER_UNIT[unit]
        self.scale_fine = scale_fine
        self.inverted = False
        self.known = False
        self._sign = 1
        self._shift = 0.0
        self._origin = 0.0

    def power_up(self, position: float) -> None:
        """Forget where the stage is: count from zero here."""
        self.known = False
        self._sign = -1 if self.inverted else 1
        self.read_as(position, 0.0)

    def logical(self, position: float) -> float:
        """Return what the scale shows at `position`, in the stage's unit, not rounded."""
        return self._sign * position + self._shift

    def counts(self, position: float) -> int:
        """Return what the controller answers at `position`; here and only here it is rounded."""
        counts = round(self.logical(position) * self._per_unit)
        return max(-_INT32 - 1, min(_INT32, counts))

    def position(self, counts: int) -> float:
        """Return the true position at which the controller would show `counts`."""
        return self._sign * (counts / self._per_unit - self._shift)

    def distance(self, counts: int) -> float:
        """Return the true way that `counts` mean."""
        return self._sign * counts / self._per_unit

    def read_as(self, position: float, logical: float) -> None:
        """Shift the scale, for now, so that it shows `logical` at `position`."""
        self._shift = logical - self._sign * position

    def set_zero(self, position: float) -> None:
        """Make `position` zero; a known position also moves the stored offset."""
        self.read_as(position, 0.0)
        if self.known:
            fine = -self._sign * (position - self._origin) * self._fine_per_unit
            self.scale_fine = max(-_INT32 - 1, min(_INT32, round(fine)))

    def store(self, scale_fine: int, *, inverted: bool) -> None:
        """Store offset and inversion; they act at once only on a known position."""
        self.scale_fine = scale_fine
        self.inverted = inverted
        if self.known:
            self.reference(self._origin)

    def reference(self, origin: float) -> None:
        """Take `origin` as the place of the reference; the stored offset acts from now on."""
        self._origin = origin
        self._sign = -1 if self.inverted else 1
        self.known = True
        self._shift = self.scale_fine / self._fine_per_unit - self._sign * origin


def folded(counts: int) -> int:
    """Return an angle of less than one revolution either way; the revolution is reserved."""
    return int(math.fmod(counts, 3_600_000))
