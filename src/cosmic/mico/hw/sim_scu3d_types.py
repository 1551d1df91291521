"""Words of the simulated SmarAct controller: positioner types, refusals, turns."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum, IntEnum
from typing import Final


class Movement(IntEnum):
    """Value of channel property 25."""

    LINEAR = 0
    ROTARY = 1
    GONIOMETER = 2


class Reference(Enum):
    """What a type is referenced at."""

    NONE = "-"
    END_STOP = "E"
    MARK = "M"
    CODED_MARKS = "D"


class Refusal(Exception):  # noqa: N818 - not an error of the program, an answer of the controller
    """The library or the controller answers with a status code other than OK."""

    def __init__(self, code: int) -> None:
        super().__init__(f"status {code}")
        self.code = code


@dataclass(frozen=True, slots=True)
class Turn:
    """A change of what a channel does, due at `time_s`.

    Attributes
    ----------
    completed : bool
        A movement ends well here.
    error : int
        A movement ends with this status code here; 0 for none.
    then : callable or None
        What else happens.
    """

    time_s: float
    status: int
    completed: bool = False
    error: int = 0
    then: Callable[[], None] | None = None


_LINEAR, _ROTARY, _GONIO = Movement.LINEAR, Movement.ROTARY, Movement.GONIOMETER
_LETTERS: Final = {
    # no sensor
    0: (_LINEAR, "-"),
    # header 1.2; 2 and 3 stand in the header only, their reference is a guess
    1: (_LINEAR, "E"),
    2: (_GONIO, "E"),
    3: (_GONIO, "E"),
    4: (_ROTARY, "E"),
    5: (_GONIO, "E"),
    6: (_GONIO, "E"),
    7: (_ROTARY, "-"),
    8: (_ROTARY, "E"),
    9: (_ROTARY, "-"),
    10: (_ROTARY, "-"),
    11: (_ROTARY, "E"),
    12: (_ROTARY, "-"),
    13: (_ROTARY, "E"),
    # later ones; the reference of the tip-tilts and of what only 1.5.16 knows (38-41) is a guess
    14: (_LINEAR, "E"),
    15: (_GONIO, "E"),
    16: (_LINEAR, "E"),
    17: (_ROTARY, "E"),
    18: (_LINEAR, "D"),
    19: (_ROTARY, "M"),
    20: (_LINEAR, "D"),
    21: (_LINEAR, "M"),
    22: (_LINEAR, "M"),
    23: (_LINEAR, "E"),
    24: (_LINEAR, "E"),
    **dict.fromkeys((25, 26, 27, 28), (_LINEAR, "E")),
    **dict.fromkeys((29, 37), (_ROTARY, "E")),
    **dict.fromkeys((30, 32), (_GONIO, "M")),
    **dict.fromkeys((31, 33, 34, 35), (_GONIO, "E")),
    **dict.fromkeys((36, 38), (_ROTARY, "M")),
    **dict.fromkeys((39, 40, 41), (_ROTARY, "E")),
}

TYPES: Final[dict[int, tuple[Movement, Reference]]] = {
    code: (movement, Reference(letter)) for code, (movement, letter) in _LETTERS.items()
}
"""Movement and reference of every positioner type, by the vendor's number."""
