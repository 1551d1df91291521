"""The air of the room over time, and what it does to fibres."""

import math
import random
from typing import Final

import numpy as np

from cosmic.frame.arrays import Floats
from cosmic.twin.force_settings import ClimateSettings

STANDARD_RH: Final = 50.0
"""Humidity at which fibres are as their settings have them."""

CREEP_DOUBLES: Final = 30.0
ADHESION_DOUBLES: Final = 40.0
CHARGE_HALVES: Final = 10.0
"""Per cent of humidity; guesses after the table in docs/explanation/worlds.md."""


class Climate:
    """Humidity and temperature; any thread.

    Notes
    -----
    Both begin at their start and go to and fro, each in its time and from a phase that the seed
    decides.
    """

    def __init__(self, settings: ClimateSettings, seed: int) -> None:
        self._settings = settings
        chance = random.Random(f"climate {seed}")
        self._phases = chance.uniform(0.0, 2.0 * math.pi), chance.uniform(0.0, 2.0 * math.pi)
        self._humid = math.nan, 0.0

    def rh_percent(self, time_s: float) -> float:
        """Return the relative humidity."""
        asked_s, found = self._humid
        if time_s != asked_s:  # a look asks several times
            each = self._settings
            part = _wave(time_s, each.rh_period_s, self._phases[0])
            found = min(max(each.rh_percent + each.rh_wander_percent * part, 0.0), 98.0)
            self._humid = time_s, found
        return found

    def warmer_k(self, time_s: float) -> float:
        """Return how much warmer it is than at the start."""
        each = self._settings
        return each.temperature_wander_k * _wave(time_s, each.temperature_period_s, self._phases[1])

    def warmer_at_k(self, times_s: Floats) -> Floats:
        """Return the same at many times, shape (n,)."""
        each = self._settings
        angles = 2.0 * math.pi * times_s / each.temperature_period_s + self._phases[1]
        return np.asarray(each.temperature_wander_k * (np.sin(angles) - math.sin(self._phases[1])))

    def creep(self, time_s: float) -> float:
        """Return how much more fibres creep than at the standard humidity."""
        return float(2.0 ** ((self.rh_percent(time_s) - STANDARD_RH) / CREEP_DOUBLES))

    def adhesion(self, time_s: float) -> float:
        """Return how much more they stick."""
        return float(2.0 ** ((self.rh_percent(time_s) - STANDARD_RH) / ADHESION_DOUBLES))

    def charge(self, time_s: float) -> float:
        """Return how much more of their charge they keep."""
        return float(2.0 ** ((STANDARD_RH - self.rh_percent(time_s)) / CHARGE_HALVES))


def _wave(time_s: float, period_s: float, phase: float) -> float:
    return math.sin(2.0 * math.pi * time_s / period_s + phase) - math.sin(phase)


STILL_AIR: Final = Climate(ClimateSettings(), 0)
