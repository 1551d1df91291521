"""The procedures that a recipe can name."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final

from cosmic.autonomy.handling.settings import HandlingSettings
from cosmic.autonomy.handling.work import FibreWork
from cosmic.autonomy.procedures.procedure import Procedure
from cosmic.autonomy.shipped.bend_test import build_bend_test
from cosmic.autonomy.shipped.ping_pong import build_ping_pong
from cosmic.autonomy.shipped.transport import build_transport


@dataclass(frozen=True, slots=True)
class Shipped:
    """A procedure that treats fibres.

    Attributes
    ----------
    build : callable
        Makes it from the parameters of a recipe. Run once it treats one fibre, or as many as the
        bench of the work says.
    measures : bool
        A fibre without a result is no good one.
    hands : int
        How many fibres may be in work at a time.
    """

    build: Callable[[HandlingSettings], Procedure[FibreWork]]
    measures: bool = True
    hands: int = 1


PROCEDURES: Final[Mapping[str, Shipped]] = {
    "bend test": Shipped(build_bend_test),
    "bend test with two hands": Shipped(build_ping_pong, hands=2),
    "transport": Shipped(build_transport, measures=False),
}

PARAMETERS: Final = dict.fromkeys(PROCEDURES, HandlingSettings)
"""The model of each procedure's parameters."""
