"""Between CoSMic's units and SmarActCTL's integers; nothing else converts.

A value that does not fit is refused with `DeviceFault.PARAMETER`; nothing is clipped. All functions
may be called from any thread.
"""

import math
import operator
from typing import Final

from cosmic.frame.units import AxisUnit
from cosmic.mico.hw.addresses import refused
from cosmic.mico.hw.interface import Channel
from cosmic.mico.hw.smaractctl_errors import LIBRARY

COUNTS: Final[dict[AxisUnit, int]] = {"um": 1_000_000, "deg": 1_000_000_000}
MOST_COUNTS: Final = 10**14
MOST_STEPS: Final = 100_000
FREQUENCY_HZ: Final = (50, 20_000)
AMPLITUDE_V: Final = (1.0, 100.0)
MOST_VELOCITY: Final = 10**11
MOST_ACCELERATION: Final = 10**13
FULL_AMPLITUDE: Final = 65_535
HOLD_FOR_EVER_MS: Final = -1

_INT32_MAX: Final = 2**31 - 1


def counts(value: float, unit: AxisUnit, at: Channel | None = None) -> int:
    """Return a position or distance, um or deg, in picometres or nanodegrees.

    Raises
    ------
    DeviceError
        `value` is not finite, or beyond 100 m or 100 000 degrees.
    """
    return _scaled(value, COUNTS[unit], MOST_COUNTS, f"a target or distance in {unit}", at)


def from_counts(number: int, unit: AxisUnit) -> float:
    """Return picometres or nanodegrees as um or deg."""
    return number / COUNTS[unit]


def velocity(value: float, unit: AxisUnit, at: Channel | None = None) -> int:
    """Return a speed above 0, um/s or deg/s, as the library counts it."""
    number = _scaled(value, COUNTS[unit], MOST_VELOCITY, f"a speed in {unit}/s", at)
    return _above_zero(number, value, "a speed", at)


def acceleration(value: float, unit: AxisUnit, at: Channel | None = None) -> int:
    """Return an acceleration above 0, um/s2 or deg/s2, as the library counts it."""
    number = _scaled(value, COUNTS[unit], MOST_ACCELERATION, f"an acceleration in {unit}/s2", at)
    return _above_zero(number, value, "an acceleration", at)


def amplitude(amplitude_v: float, at: Channel | None = None) -> int:
    """Return an amplitude of 1 to 100 V as a part of 65535."""
    low, high = AMPLITUDE_V
    if not low <= amplitude_v <= high:
        raise refused(
            f"amplitude must be {low:g} to {high:g} V, got {amplitude_v!r} V", at, none=LIBRARY
        )
    return round(amplitude_v / high * FULL_AMPLITUDE)


def step_count(steps: int, at: Channel | None = None) -> int:
    """Return `steps` if the library takes it, -100000 to 100000."""
    return _whole(steps, -MOST_STEPS, MOST_STEPS, "steps", at)


def frequency(frequency_hz: int, at: Channel | None = None) -> int:
    """Return a frequency that both kinds of movement take, 50 to 20000 Hz."""
    return _whole(frequency_hz, *FREQUENCY_HZ, "frequency in Hz", at)


def hold_ms(hold_s: float, at: Channel | None = None) -> int:
    """Return a hold time in ms; inf holds for ever."""
    if hold_s == math.inf:
        return HOLD_FOR_EVER_MS
    if not 0.0 <= hold_s <= _INT32_MAX / 1000:
        raise refused(
            f"hold time must not be negative, or inf for ever, got {hold_s!r} s", at, none=LIBRARY
        )
    return round(hold_s * 1000)


def timeout_ms(timeout_s: float) -> int:
    """Return a waiting time in ms, rounded up so that a short wait is not a busy loop."""
    if not 0.0 <= timeout_s <= _INT32_MAX / 1000:
        raise refused(
            f"a wait must be finite and not negative, got {timeout_s!r} s", None, none=LIBRARY
        )
    return math.ceil(timeout_s * 1000)


def _scaled(value: float, factor: int, most: int, what: str, at: Channel | None) -> int:
    if not -most / factor <= value <= most / factor:
        limit = most / factor
        raise refused(f"{what} must lie within {limit:g}, got {value!r}", at)
    return round(value * factor)


def _above_zero(number: int, value: float, what: str, at: Channel | None) -> int:
    # 0 means "not controlled", which is another way to move.
    if not number > 0:
        raise refused(f"{what} must be above 0, got {value!r}", at)
    return number


def _whole(value: int, low: int, high: int, what: str, at: Channel | None) -> int:
    try:
        number = operator.index(value)
    except TypeError:
        raise refused(f"{what} must be a whole number, got {value!r}", at) from None
    if not low <= number <= high:
        raise refused(f"{what} must be {low} to {high}, got {number}", at)
    return number
