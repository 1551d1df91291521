"""The one answer that the gate gives to a wish to move."""

from dataclasses import dataclass
from enum import StrEnum
from typing import NoReturn

from typing_extensions import override


class Reason(StrEnum):
    """Why a movement was allowed or refused."""

    ALLOWED = "ALLOWED"
    STOPPED = "STOPPED"
    NO_LEASE = "NO_LEASE"
    NOT_FINITE = "NOT_FINITE"
    WRONG_KIND = "WRONG_KIND"
    LIMIT = "LIMIT"
    POSITION_UNKNOWN = "POSITION_UNKNOWN"
    COLLISION = "COLLISION"
    NO_ANSWER = "NO_ANSWER"
    DEVICE = "DEVICE"


@dataclass(frozen=True, slots=True)
class MoveVerdict:
    """What the gate says to a wish to move; the same words in window, log and exception.

    Attributes
    ----------
    allowed : bool
        True when the movement may be made. A verdict itself is neither true nor false, so that
        ``if verdict:`` and ``verdict or other`` cannot be mistaken for it.
    reason : Reason
        ALLOWED, or why not.
    axis : str
        Name of the axis that decided, empty when no single axis did.
    value : float or None
        What was asked for, in `unit`; None when it was not a number.
    limit : float or None
        The limit that `value` would have crossed, in `unit`.
    unit : str
        "um", "deg", "steps", "V", "Hz", or empty.
    bodies : tuple of str
        The two bodies that would come too close.
    place_um : tuple of float or None
        Where they would, x, y, z in world coordinates.
    clearance_um : float or None
        How far apart the two bodies would be there.
    pose : tuple of (str, float)
        Where the axes would stand there, by name, in gate coordinates and the unit of each.
    text : str
        The whole story in one sentence: what, where and what to do.
    """

    allowed: bool
    reason: Reason
    axis: str = ""
    value: float | None = None
    limit: float | None = None
    unit: str = ""
    bodies: tuple[str, ...] = ()
    place_um: tuple[float, float, float] | None = None
    clearance_um: float | None = None
    pose: tuple[tuple[str, float], ...] = ()
    text: str = ""

    def __bool__(self) -> NoReturn:
        raise TypeError("ask verdict.allowed: a verdict is neither true nor false")

    @override
    def __str__(self) -> str:
        return self.text or self.reason.value


ALLOWED = MoveVerdict(allowed=True, reason=Reason.ALLOWED, text="allowed")


def refuse(
    reason: Reason,
    text: str,
    *,
    axis: str = "",
    value: float | None = None,
    limit: float | None = None,
    unit: str = "",
) -> MoveVerdict:
    """Make a refusal; `text` says what was asked, why not, and what to do."""
    return MoveVerdict(
        allowed=False, reason=reason, axis=axis, value=value, limit=limit, unit=unit, text=text
    )
