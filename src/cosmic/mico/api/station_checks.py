"""What is looked at before something that another process sent is used."""

import math
from typing import Final

from cosmic.frame.errors import refusal
from cosmic.frame.verdict import Reason, refuse

_LONGEST: Final = 120


def finite(value: float, what: str) -> float:
    """Return `value`; raises `MoveRefused` where it is no finite number."""
    if not math.isfinite(value):
        raise refusal(refuse(Reason.NOT_FINITE, f"{what} must be a finite number, not {value!r}"))
    return value


def one_line(text: str) -> str:
    """Return `text` as it may stand in a log: short, and in one line."""
    return "".join(each if each.isprintable() else " " for each in text[:_LONGEST])
