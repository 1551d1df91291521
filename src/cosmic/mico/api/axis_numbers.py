"""Numbers in the unit of an axis, as scripts and stations give them, checked where they come in."""

import math

from cosmic.frame.errors import QuantityError, refusal
from cosmic.frame.units import DISPLAY, parse_quantity
from cosmic.frame.verdict import Reason, refuse

Number = float | int | str
"""A number in the unit of the axis, or a text with its own unit, such as "0.2 mm"."""


def finite(value: float, what: str) -> float:
    """Return `value`; raises `MoveRefused` where it is no finite number."""
    if not math.isfinite(value):
        raise refusal(refuse(Reason.NOT_FINITE, f"{what} must be a finite number, not {value!r}"))
    return value


def as_number(value: object, unit: str, axis: str) -> float:
    """Return `value` in `unit`.

    Raises
    ------
    MoveRefused
        NOT_FINITE when it is no finite number, WRONG_KIND when its unit measures another thing.
    """
    if isinstance(value, str):
        return _from_text(value, unit, axis)
    try:
        number = math.nan if isinstance(value, bool) else float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if not math.isfinite(number):
        raise refusal(
            refuse(
                Reason.NOT_FINITE,
                f"{axis}: {value!r} is not a finite number of {DISPLAY.get(unit, unit)}",
                axis=axis,
                unit=unit,
            )
        )
    return number


def _from_text(text: str, unit: str, axis: str) -> float:
    try:
        return parse_quantity(text, unit)
    except QuantityError as exc:
        reason = Reason.WRONG_KIND if "not a unit" in str(exc) else Reason.NOT_FINITE
        raise refusal(refuse(reason, f"{axis}: {exc}", axis=axis, unit=unit)) from None


def as_whole(value: object, unit: str, axis: str) -> int:
    """Return `value` as a whole number of `unit`; raises `MoveRefused` otherwise."""
    number = as_number(value, unit, axis)
    if number != round(number):
        raise refusal(
            refuse(
                Reason.NOT_FINITE,
                f"{axis}: {value!r} is not a whole number of {DISPLAY.get(unit, unit)}",
                axis=axis,
                unit=unit,
            )
        )
    return round(number)
