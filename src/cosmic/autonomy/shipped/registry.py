"""The procedures that a recipe can name."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final

from cosmic.autonomy.handling.context import HandlingContext
from cosmic.autonomy.handling.settings import HandlingSettings
from cosmic.autonomy.procedures.procedure import Procedure
from cosmic.autonomy.shipped.bend_test import build_bend_test, build_transport
from cosmic.autonomy.shipped.ping_pong import build_ping_pong


@dataclass(frozen=True, slots=True)
class ShippedProcedure:
    """A procedure that treats fibres.

    Attributes
    ----------
    build : callable
        Makes it from the parameters of a recipe. Run once it treats one fibre, or as many as the
        shared workspace says.
    measures : bool
        A fibre without a result is no good one.
    arms : int
        How many fibres may be in work at a time.
    """

    build: Callable[[HandlingSettings], Procedure[HandlingContext]]
    measures: bool = True
    arms: int = 1


PROCEDURES: Final[Mapping[str, ShippedProcedure]] = {
    "bend test": ShippedProcedure(build_bend_test),
    "bend test with two grippers": ShippedProcedure(build_ping_pong, arms=2),
    "transport": ShippedProcedure(build_transport, measures=False),
}

PARAMETERS: Final = dict.fromkeys(PROCEDURES, HandlingSettings)
"""The model of each procedure's parameters."""
