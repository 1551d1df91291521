"""Between CoSMic's units and SCU3DControl's integers; nothing else converts.

A value that does not fit is refused with `DeviceFault.PARAMETER`; nothing is clipped, because
the library's integers wrap silently and its largest values mean "endless". All functions may be
called from any thread.

Angles: the library declares a pair (angle, revolution) and calls the second reserved. CoSMic
sends the angle with its sign and revolution 0, and refuses a full turn and more, as another
client of the library does: what an SCU makes of 370 degrees, a further turn or 10 degrees, is
written nowhere. A reading is taken as it comes, plus 360 degrees for each revolution told.
"""

import math
import operator
from collections.abc import Sequence
from typing import Final, SupportsIndex, cast

from cosmic.frame.units import AxisUnit
from cosmic.mico.hw.addresses import refused
from cosmic.mico.hw.interface import Channel, Serial
from cosmic.mico.hw.scu3d_errors import LIBRARY

COUNTS_PER_UM: Final = 10
COUNTS_PER_DEG: Final = 10_000
COUNTS_PER_TURN: Final = 360 * COUNTS_PER_DEG
HOLD_FOR_EVER_MS: Final = 60_000
MAX_STEPS: Final = 29_999  # 30000 and -30000 mean "until Stop"
MIN_DECIVOLTS: Final = 150
MAX_DECIVOLTS: Final = 1_000
MIN_FREQUENCY_HZ: Final = 1
MAX_FREQUENCY_HZ: Final = 18_500

_INT32_MAX: Final = 2**31 - 1
_UINT32_MAX: Final = 2**32 - 1
_PER_UNIT: Final[dict[AxisUnit, int]] = {"um": COUNTS_PER_UM, "deg": COUNTS_PER_DEG}
_MOST_COUNTS: Final[dict[AxisUnit, int]] = {"um": _INT32_MAX, "deg": COUNTS_PER_TURN - 1}


def position_counts(value: float, unit: AxisUnit, at: Channel | None = None) -> int:
    """Return a position or distance, um or deg, in counts of 0.1 um or 0.1 millidegree.

    Raises
    ------
    DeviceError
        `value` is not finite, does not fit 32 bit, or is an angle of a full turn or more.
    """
    counts, most = value * _PER_UNIT[unit], _MOST_COUNTS[unit]
    if not -most - 0.5 < counts < most + 0.5:
        limit = position_from_counts(most, unit)
        text = f"a target or distance must lie within {limit} {unit}, got {value!r} {unit}"
        raise refused(text, at)
    return round(counts)


def position_from_counts(counts: int, unit: AxisUnit) -> float:
    """Return counts of 0.1 um or 0.1 millidegree as um or deg."""
    return counts / _PER_UNIT[unit]


def angle_deg(data1: int, revolution: int = 0) -> float:
    """Return the angle of a packet in degrees; its data1 is unsigned but means a signed number."""
    return (signed(data1) + revolution * COUNTS_PER_TURN) / COUNTS_PER_DEG


def signed(unsigned: int) -> int:
    """Return the 32 bits of an unsigned integer read as a signed one."""
    return unsigned - 2**32 if unsigned > _INT32_MAX else unsigned


def decivolts(amplitude_v: float, at: Channel | None = None) -> int:
    """Return an amplitude of 15 to 100 V in 0.1 V.

    Raises
    ------
    DeviceError
        Outside that range or not a number.
    """
    if not MIN_DECIVOLTS / 10 <= amplitude_v <= MAX_DECIVOLTS / 10:
        raise refused(f"amplitude must be 15 to 100 V, got {amplitude_v!r} V", at)
    return round(amplitude_v * 10)


def hold_ms(hold_s: float, at: Channel | None = None) -> int:
    """Return a hold time in ms; inf holds for ever.

    Raises
    ------
    DeviceError
        Negative, not a number, or finite but so long that the controller would hold for ever.
    """
    if hold_s == math.inf:
        return HOLD_FOR_EVER_MS
    if not 0.0 <= hold_s <= (HOLD_FOR_EVER_MS - 1) / 1000:
        raise refused(
            f"hold time must be 0 to 59.999 s or inf for ever, got {hold_s!r} s", at, none=LIBRARY
        )
    return round(hold_s * 1000)


def timeout_ms(timeout_s: float) -> int:
    """Return a waiting time in ms, rounded up so that a short wait is not a busy loop.

    Raises
    ------
    DeviceError
        Negative, not a number or endless; the library cannot cancel a wait.
    """
    if not 0.0 <= timeout_s <= _INT32_MAX / 1000:
        raise refused(
            f"a wait must be finite and not negative, got {timeout_s!r} s", None, none=LIBRARY
        )
    return math.ceil(timeout_s * 1000)


def step_count(steps: int, at: Channel | None = None) -> int:
    """Return `steps` if the library takes it as a finite number, -29999 to 29999.

    Raises
    ------
    DeviceError
        Beyond that, or not a whole number.
    """
    return _whole(steps, -MAX_STEPS, MAX_STEPS, "steps", at)


def frequency(frequency_hz: int, at: Channel | None = None) -> int:
    """Return `frequency_hz` if it is a whole number from 1 to 18500 Hz.

    Raises
    ------
    DeviceError
        Beyond that, or not a whole number.
    """
    return _whole(frequency_hz, MIN_FREQUENCY_HZ, MAX_FREQUENCY_HZ, "frequency in Hz", at)


def index(number: int, what: str) -> int:
    """Return a device index, channel index or serial number if it fits 32 bit unsigned.

    Raises
    ------
    DeviceError
        It does not; ctypes would let it wrap round to the number of another device.
    """
    return _whole(number, 0, _UINT32_MAX, what, None)


def serial_numbers(serials: Sequence[Serial]) -> list[int]:
    """Return serial numbers as the library takes them; raises `DeviceError` for any other."""
    return [_whole(serial, 0, _UINT32_MAX, "serial number", None) for serial in serials]


def version_text(code: int) -> str:
    """Return a version, packed as 8, 8 and 16 bit, as text such as "1.5.16"."""
    return f"{code >> 24 & 0xFF}.{code >> 16 & 0xFF}.{code & 0xFFFF}"


def _whole(value: SupportsIndex | str, low: int, high: int, what: str, at: Channel | None) -> int:
    try:
        number = operator.index(cast("SupportsIndex", value))
    except TypeError:
        raise refused(f"{what} must be a whole number, got {value!r}", at) from None
    if not low <= number <= high:
        raise refused(f"{what} must be {low} to {high}, got {number}", at)
    return number
