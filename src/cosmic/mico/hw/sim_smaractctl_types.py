"""Words of the simulated MCS2: what a channel is doing, refusals, turns, positioner types."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from typing import Final

from cosmic.frame.units import AxisUnit
from cosmic.mico.hw import smaractctl_ctypes as sa
from cosmic.mico.hw.sim_scu3d_types import TYPES, Movement, Reference

COUNTS: Final[dict[AxisUnit, float]] = {"um": 1e6, "deg": 1e9}
"""The library counts in picometres and nanodegrees."""


class Phase(IntEnum):
    """What a channel is doing: the last four bits of its state."""

    STOPPED = 0b0000
    OPEN_LOOP = 0b0001
    HOLDING = 0b0010
    MOVING = 0b0011
    CALIBRATING = 0b0101
    REFERENCING = 0b1011


class Refused(Exception):  # noqa: N818 - not an error of the program, an answer of the controller
    """The library or the controller answers with a result other than none."""

    def __init__(self, code: int) -> None:
        super().__init__(f"result {code:#06x}")
        self.code = code


@dataclass(frozen=True, slots=True)
class Turn:
    """A change of what a channel does, due at `time_s`.

    Attributes
    ----------
    result : int or None
        A movement ends here with that result; None where none ends.
    marks : int
        Bits of the state that are set here.
    event : int
        Event of the channel that is sent here before any end; 0 for none.
    then : callable or None
        What else happens.
    """

    time_s: float
    phase: Phase
    result: int | None = None
    marks: int = 0
    event: int = 0
    then: Callable[[], None] | None = None


@dataclass(frozen=True, slots=True)
class TypeOfPositioner:
    """One positioner type of the MCS2."""

    name: str
    movement: int
    reference: int


# The three dots are literal: the vendor's names leave the length open.
TYPE_NAMES: Final[dict[int, TypeOfPositioner]] = {
    300: TypeOfPositioner("SL...S1SS", 0, sa.SA_CTL_REF_TYPE_SINGLE_CODED),
    303: TypeOfPositioner("SL...S1SC1", 0, sa.SA_CTL_REF_TYPE_DISTANCE_CODED),
    309: TypeOfPositioner("SR...S1S5S", 1, sa.SA_CTL_REF_TYPE_SINGLE_CODED),
    325: TypeOfPositioner("SG...D1S1S", 2, sa.SA_CTL_REF_TYPE_SINGLE_CODED),
    342: TypeOfPositioner("SL...S1LE", 0, sa.SA_CTL_REF_TYPE_END_STOP),
    354: TypeOfPositioner("SR...S1L2S", 1, sa.SA_CTL_REF_TYPE_END_STOP),
}
WRITABLE_TYPES: Final = frozenset({0, 250, 251, 252, 253, 299, *TYPE_NAMES})
_LIKE_SCU: Final = {
    (Movement.LINEAR, Reference.MARK): 300,
    (Movement.LINEAR, Reference.CODED_MARKS): 303,
    (Movement.LINEAR, Reference.END_STOP): 342,
    (Movement.ROTARY, Reference.MARK): 309,
    (Movement.ROTARY, Reference.END_STOP): 354,
    (Movement.GONIOMETER, Reference.MARK): 325,
}


def type_like(scu_type: int, unit: AxisUnit) -> int:
    """Return the type of the MCS2 for a stage that the twin describes by its type at an SCU."""
    return _LIKE_SCU.get(TYPES[scu_type], 300 if unit == "um" else 309)
