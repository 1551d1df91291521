"""How long the lines of a trajectory take, from the speeds in force."""

import math
from collections.abc import Mapping
from typing import Final

from cosmic.mico.core.motion.orders import Motion, Step
from cosmic.mico.core.motion.settings import MotionDefaults
from cosmic.mico.core.trajectory.binding import AxisFacts, nominal_step

LANDING_S: Final = 0.025
"""From standstill until it is known and the next line begins; measured on the twin."""


def leg_times_s(
    motions: Mapping[str, Motion],
    distances: Mapping[str, float],
    frequencies_hz: Mapping[str, float],
    axes: Mapping[str, AxisFacts],
    defaults: MotionDefaults,
) -> dict[str, float]:
    """Return how long each axis of a leg moves.

    Parameters
    ----------
    distances : mapping of float
        How far each axis goes, in its unit.
    frequencies_hz : mapping of float
        Closed-loop frequency limit of each axis.
    """
    times: dict[str, float] = {}
    for axis, motion in motions.items():
        if isinstance(motion, Step):
            times[axis] = abs(motion.steps) / motion.frequency_hz
            continue
        unit = axes[axis].unit
        speed = frequencies_hz[axis] * nominal_step(defaults, unit)
        rise = defaults.acceleration_deg_s2 if unit == "deg" else defaults.acceleration_um_s2
        times[axis] = move_s(abs(distances[axis]), speed, rise)
    return times


def move_s(distance: float, speed: float, acceleration: float) -> float:
    """Return how long a movement from rest to rest takes."""
    if distance * acceleration >= speed**2:
        return distance / speed + speed / acceleration
    return 2.0 * math.sqrt(distance / acceleration)


def scaled_hz(frequency_hz: float, factor: float, within_hz: tuple[int, int]) -> int:
    """Return a frequency at a part of the speed, as far as the controller goes."""
    low, high = within_hz
    return max(low, min(high, round(frequency_hz * factor)))
