"""Numbers with their units, as trajectories write them."""

import math
import re
from typing import Final

from cosmic.frame.errors import QuantityError
from cosmic.frame.units import AxisUnit, parse_quantity

AXIS_PATTERN: Final = re.compile(r"[a-z][a-z0-9_]*(\.[a-z][a-z0-9_]*)?")
LONGEST_S: Final = 86_400.0
"""A wait or a time may not be longer than a day."""
_TIME: Final = re.compile(r"(\d+\.?\d*|\.\d+)\s*(ms|s|min)", re.ASCII)
_TO_S: Final = {"ms": 1e-3, "s": 1.0, "min": 60.0}
_WHOLE: Final = re.compile(r"[+-]?\d{1,9}", re.ASCII)
_RATE_UNITS: Final = {"um": "um/s", "deg": "deg/s"}
_NAME: Final = re.compile(r"[^\s#:,][^#:,]*")


def position(text: str) -> tuple[float, AxisUnit]:
    """Read a length or an angle, which must carry its unit; raises `QuantityError`."""
    if not text:
        raise QuantityError("a position is missing, such as 12.5 um")
    if text[-1].isdigit() or text[-1] == ".":
        raise QuantityError(f"{text!r} has no unit; write it as {text} um, or in mm, deg ...")
    try:
        return parse_quantity(text, "um"), "um"
    except QuantityError as exc:
        if "not a unit" not in str(exc):
            raise
    try:
        return parse_quantity(text, "deg"), "deg"
    except QuantityError as exc:
        if "not a unit" not in str(exc):
            raise
        raise QuantityError(
            f"{text!r}: this is not a unit of a position; use um, mm, nm, deg or mdeg"
        ) from None


def quantity(text: str, unit: str) -> float:
    """Read a number in `unit`, which must be written; raises `QuantityError`."""
    if not text or text[-1].isdigit() or text[-1] == ".":
        raise QuantityError(f"{text!r} has no unit; {unit} is wanted")
    return parse_quantity(text, unit)


def time_s(text: str) -> float:
    """Read a time; raises `QuantityError`."""
    match = _TIME.fullmatch(text)
    value = float(match[1]) * _TO_S[match[2]] if match else math.nan
    if not 0.0 <= value <= LONGEST_S:
        raise QuantityError(f"{text!r} is not a time from 0 to a day; write it as 0.5 s")
    return value


def whole(text: str, what: str) -> int:
    """Read a whole number; raises `QuantityError`."""
    if not _WHOLE.fullmatch(text):
        raise QuantityError(f"{text!r} is not a whole number of {what}")
    return int(text)


def axis_name(text: str) -> str:
    """Return the name of an axis; raises `QuantityError`."""
    if not AXIS_PATTERN.fullmatch(text):
        raise QuantityError(f"{text!r} is not a name of an axis, such as left.x")
    return text


def free_name(text: str, what: str) -> str:
    """Return the name of a platform or a pose; raises `QuantityError`."""
    if len(text) > 80 or not _NAME.fullmatch(text):
        raise QuantityError(
            f"{text[:80]!r} is not a name of a {what}: up to 80 letters, digits, spaces and . - _"
        )
    return text


def speed(text: str) -> tuple[float | None, str]:
    """Read a speed and its unit, "um/s", "deg/s" or "Hz"; "usual" is None."""
    if text == "usual":
        return None, ""
    if text.endswith("/s"):
        value, unit = position(text.removesuffix("/s").strip())
        found = _RATE_UNITS[unit]
    else:
        value, found = quantity(text, "Hz"), "Hz"
    if not value > 0.0:
        raise QuantityError(f"{text!r}: a speed must be above 0")
    return value, found


def number(value: float) -> str:
    """Write a number without loss below a nanometre and without noise."""
    return f"{round(value, 4) + 0.0:.10g}"
