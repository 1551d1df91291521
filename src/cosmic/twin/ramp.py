"""How a stepper motor gets up to speed and back: the way gone as a function of time."""

import math
from dataclasses import dataclass

from cosmic.twin.lens_settings import LensMotorSettings


@dataclass(frozen=True, slots=True)
class Ramp:
    """Stretches of even acceleration, one after the other, from standing to standing.

    Attributes
    ----------
    stretches : tuple of (float, float, float)
        Duration in seconds, and speed at its beginning and end in counts per second.
    """

    stretches: tuple[tuple[float, float, float], ...] = ()

    @property
    def duration_s(self) -> float:
        """How long it takes."""
        return sum(duration_s for duration_s, _, _ in self.stretches)

    @property
    def way_counts(self) -> float:
        """How far it leads."""
        return sum(duration_s * (v0 + v1) / 2.0 for duration_s, v0, v1 in self.stretches)

    def gone(self, time_s: float) -> float:
        """Return the way gone `time_s` after the beginning, counts."""
        way = 0.0
        for duration_s, v0, v1 in self.stretches:
            if time_s < duration_s:
                part_s = max(time_s, 0.0)
                return way + part_s * (v0 + (v1 - v0) * part_s / duration_s / 2.0)
            way += duration_s * (v0 + v1) / 2.0
            time_s -= duration_s
        return way

    def speed(self, time_s: float) -> tuple[float, bool]:
        """Return the speed at `time_s`, counts per second, and whether it is falling."""
        for duration_s, v0, v1 in self.stretches:
            if 0.0 <= time_s < duration_s:
                return v0 + (v1 - v0) * time_s / duration_s, v1 < v0
            time_s -= duration_s
        return 0.0, False


def ramp_over(way_counts: float, motor: LensMotorSettings) -> Ramp:
    """Return the ramp that leads `way_counts` far, which is not negative."""
    if way_counts <= 0.0:
        return Ramp()
    slow, fast = motor.initial_speed_counts_s, motor.top_speed_counts_s
    rate = motor.acceleration_counts_s2
    peak = min(fast, math.sqrt(slow * slow + rate * way_counts))
    rise_s = (peak - slow) / rate
    cruise_s = max(way_counts - rise_s * (slow + peak), 0.0) / peak
    return Ramp(((rise_s, slow, peak), (cruise_s, peak, peak), (rise_s, peak, slow)))


def ramp_down(speed_counts_s: float, motor: LensMotorSettings) -> Ramp:
    """Return the ramp that comes to a stand from `speed_counts_s`."""
    slow = motor.initial_speed_counts_s
    if speed_counts_s <= slow:
        return Ramp()
    return Ramp((((speed_counts_s - slow) / motor.acceleration_counts_s2, speed_counts_s, slow),))
