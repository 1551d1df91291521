"""The procedures that a recipe can name."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final

from cosmic.autonomy.handling.settings import HandlingSettings
from cosmic.autonomy.handling.work import FibreWork
from cosmic.autonomy.procedures.procedure import Procedure
from cosmic.autonomy.shipped.bend_test import build_bend_test
from cosmic.autonomy.shipped.transport import build_transport


@dataclass(frozen=True, slots=True)
class Shipped:
    """A procedure that treats one fibre.

    Attributes
    ----------
    build : callable
        Makes it from the parameters of a recipe.
    measures : bool
        A fibre without a result is no good one.
    """

    build: Callable[[HandlingSettings], Procedure[FibreWork]]
    measures: bool = True


PROCEDURES: Final[Mapping[str, Shipped]] = {
    "bend test": Shipped(build_bend_test),
    "transport": Shipped(build_transport, measures=False),
}

PARAMETERS: Final = dict.fromkeys(PROCEDURES, HandlingSettings)
"""The model of each procedure's parameters."""
