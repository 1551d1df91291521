"""What a force sensor makes of the load on its probe, before its amplifier."""

import math
from typing import Final

import numpy as np

from cosmic.frame.arrays import Floats
from cosmic.twin.felt import Felt
from cosmic.twin.force_settings import ForceSensorSettings

PLAY_PART: Final = 0.1
"""Part of the range within which a force may turn before the lagging part of the signal does."""

TICK_S: Final = 0.01
SLOWEST_HZ: Final = 0.003
LONGEST_TICKS: Final = 2000


class Transducer:
    """Linearity, hysteresis, and what loads from other sides add; follows the loads in time.

    Parameters
    ----------
    chance : Generator
        What it is drawn from.
    """

    def __init__(self, settings: ForceSensorSettings, chance: np.random.Generator) -> None:
        self._bend_per_un = settings.linearity / settings.range_un
        self.cross_part = settings.cross_talk * float(chance.standard_normal())
        self.axial_part = settings.axial_talk * float(chance.standard_normal())
        self._lag_part = settings.hysteresis / (2.0 * PLAY_PART)
        self._play_un = PLAY_PART * settings.range_un
        self._lagging_un = 0.0

    def signal_un(self, felt: Felt) -> float:
        """Return the force that the sensor believes in, after a load later than the last."""
        force = felt.total_un
        signal = force
        if self.cross_part or self.axial_part:
            for push in felt.pushes:
                signal += self.cross_part * push.along_un + self.axial_part * push.up_un
        signal *= 1.0 + self._bend_per_un * abs(force)
        if self._lag_part:
            low, high = force - self._play_un, force + self._play_un
            lagging = self._lagging_un
            self._lagging_un = low if lagging < low else min(lagging, high)
            signal += self._lag_part * (self._lagging_un - force)
        return signal


class Flicker:
    """Noise that grows as the frequency falls: a few random walks that are pulled back.

    Parameters
    ----------
    density_un2_hz : float
        Of the white noise that it equals at its corner.
    """

    def __init__(
        self, density_un2_hz: float, corner_hz: float, chance: np.random.Generator
    ) -> None:
        self._chance = chance
        decades = max(math.ceil(math.log10(corner_hz / SLOWEST_HZ)), 1)
        rates = SLOWEST_HZ * 10.0 ** (np.arange(decades) + 0.5)
        self._kept = np.exp(-2.0 * math.pi * rates * TICK_S)
        self._sigma = np.full(decades, math.sqrt(density_un2_hz * corner_hz * math.log(10.0)))
        self._fresh = self._sigma * np.sqrt(1.0 - self._kept * self._kept)
        self._parts: list[float] = self._kept.tolist()
        state = self._sigma * chance.standard_normal(decades)
        self._state: list[float] = state.tolist()
        self._tick = 0
        self._times_s: list[float] = [0.0]
        self._values: list[float] = [float(state.sum())]

    def at(self, times_s: Floats) -> Floats:
        """Return the noise at rising times, uN."""
        last = math.floor(float(times_s[-1]) / TICK_S) + 1
        first = math.floor(float(times_s[0]) / TICK_S) - 1
        if first - self._tick > LONGEST_TICKS:
            kept = self._kept ** (first - self._tick)
            fresh = self._sigma * np.sqrt(1.0 - kept * kept)
            self._steps(first, kept.tolist(), fresh, 1)
        if self._tick < last:
            self._steps(self._tick + 1, self._parts, self._fresh, last - self._tick)
        past = 0
        while past + 2 < len(self._times_s) and self._times_s[past + 1] < TICK_S * first:
            past += 1
        del self._times_s[:past], self._values[:past]
        return np.asarray(np.interp(times_s, self._times_s, self._values))

    def _steps(self, tick: int, parts: list[float], fresh: Floats, count: int) -> None:
        """Walk on to a tick and so many from there; for a few numbers no array is worth it."""
        drawn = (fresh * self._chance.standard_normal((count, len(parts)))).tolist()
        state = self._state
        for number, each in enumerate(drawn, start=tick):
            state = [part * was + new for part, was, new in zip(parts, state, each, strict=True)]
            self._times_s.append(TICK_S * number)
            self._values.append(math.fsum(state))
        self._state, self._tick = state, tick + count - 1
