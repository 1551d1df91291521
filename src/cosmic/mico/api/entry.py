"""Numbers and texts as scripts and other stations give them, looked at where they come in."""

import math
from typing import Final

from cosmic.frame.errors import QuantityError, refusal
from cosmic.frame.network.caller import current_call
from cosmic.frame.units import DISPLAY, parse_quantity
from cosmic.frame.verdict import Reason, refuse

Number = float | int | str
"""A number in the unit of the axis, or a text with its own unit, such as "0.2 mm"."""


_LONGEST: Final = 120


def finite(value: float, what: str) -> float:
    """Return `value`; raises `MoveRefused` where it is no finite number."""
    if not math.isfinite(value):
        raise refusal(refuse(Reason.NOT_FINITE, f"{what} must be a finite number, not {value!r}"))
    return value


def one_line(text: str) -> str:
    """Return `text` as it may stand in a log: short, and in one line."""
    return "".join(each if each.isprintable() else " " for each in text[:_LONGEST])


def source_of(source: str) -> str:
    """Return who commands, for the log: `source` here, the name of a client before it."""
    call = current_call()
    return source if call is None else f"{call.caller.name} {one_line(source)}".strip()


def caller_token() -> str:
    """Return the token of the client whose call this thread carries out; empty for none."""
    call = current_call()
    return "" if call is None else call.caller.token


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
