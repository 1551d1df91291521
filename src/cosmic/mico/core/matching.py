"""How fast each axis of a group goes, so that all arrive together; pure."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from cosmic.mico.core.orders import FREQUENCY_HZ


@dataclass(frozen=True, slots=True)
class Leg:
    """What one axis has before it.

    Attributes
    ----------
    way : float
        How far it goes, without sign, in its unit.
    step : float
        How far it goes with one step, in its unit.
    approach : float
        What its slow end costs, as a way in its unit gone at full speed.
    top_hz : int
        The most steps per second that it may make.
    """

    way: float
    step: float
    approach: float
    top_hz: int

    @property
    def steps(self) -> float:
        """How many steps its way is worth."""
        return (self.way + self.approach) / self.step


def matched_frequencies(legs: Mapping[str, Leg]) -> dict[str, int]:
    """Return the steps per second of every axis that has a way to go.

    The axis that takes longest keeps the speed that it has; the others are slowed down to it.
    """
    moving = {name: leg for name, leg in legs.items() if leg.way > 0.0}
    longest_s = max((leg.steps / leg.top_hz for leg in moving.values()), default=0.0)
    low, _ = FREQUENCY_HZ
    return {
        name: max(low, min(leg.top_hz, math.ceil(leg.steps / longest_s - 1e-9)))
        for name, leg in moving.items()
    }
