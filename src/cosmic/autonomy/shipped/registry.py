"""The procedures that a recipe can name: those that ship with CoSMic and those that are brought.

A package brings one under ``[project.entry-points."cosmic.procedures"]``; the name there is what a
recipe says, and the `options` of the backend are the model of the recipe's parameters.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final

from typing_extensions import override

from cosmic.autonomy.handling.context import HandlingContext
from cosmic.autonomy.handling.plate_change import PlateHandler
from cosmic.autonomy.handling.settings import HandlingSettings
from cosmic.autonomy.procedures.procedure import Procedure
from cosmic.autonomy.shipped.bend_test import (
    build_bend_test,
    build_plate_change,
    build_standard,
    build_transport,
)
from cosmic.autonomy.shipped.ping_pong import (
    build_ping_pong,
    build_plate_change_in_turn,
    build_standard_in_turn,
)
from cosmic.frame.config import StrictModel
from cosmic.frame.plugins import Backend, Kind, find_backend, names


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
    standard : callable or None
        Makes from the same parameters the procedure that bends the standard and puts it back;
        None: a standard is not measured.
    change_plate : callable
        Makes from the same parameters the procedure by which a handler puts a plate there.
    """

    build: Callable[[Any], Procedure[HandlingContext]]
    measures: bool = True
    arms: int = 1
    standard: Callable[[Any], Procedure[HandlingContext]] | None = None
    change_plate: Callable[[Any, PlateHandler, int], Procedure[HandlingContext]] = (
        build_plate_change
    )


ProcedureBackend = Backend[None, ShippedProcedure]
"""What an entry point of the group ``cosmic.procedures`` leads to.

Its `options` are `HandlingSettings` or a model derived from them; what it makes is not bound to the
parameters, which `ShippedProcedure.build` takes.
"""


class Procedures(Mapping[str, ShippedProcedure]):
    """All procedures by name, each loaded when it is asked for.

    Asking for one that cannot be loaded raises `PluginError`.
    """

    @override
    def __getitem__(self, name: str) -> ShippedProcedure:
        if name not in names(Kind.PROCEDURE):
            raise KeyError(name)
        found: ShippedProcedure = find_backend(Kind.PROCEDURE, name).make(None, None)
        return found

    @override
    def __iter__(self) -> Iterator[str]:
        return iter(names(Kind.PROCEDURE))

    @override
    def __len__(self) -> int:
        return len(names(Kind.PROCEDURE))


class Parameters(Mapping[str, type[StrictModel]]):
    """The model of each procedure's parameters; as `Procedures`."""

    @override
    def __getitem__(self, name: str) -> type[StrictModel]:
        if name not in names(Kind.PROCEDURE):
            raise KeyError(name)
        return find_backend(Kind.PROCEDURE, name).options

    @override
    def __iter__(self) -> Iterator[str]:
        return iter(names(Kind.PROCEDURE))

    @override
    def __len__(self) -> int:
        return len(names(Kind.PROCEDURE))


PROCEDURES: Final = Procedures()
PARAMETERS: Final = Parameters()


def procedure_backend(
    procedure: ShippedProcedure, options: type[HandlingSettings] = HandlingSettings
) -> ProcedureBackend:
    """Return what announces a procedure."""
    return ProcedureBackend(lambda _options, _context: procedure, options=options)


BEND_TEST: Final = procedure_backend(ShippedProcedure(build_bend_test, standard=build_standard))
PING_PONG: Final = procedure_backend(
    ShippedProcedure(
        build_ping_pong,
        arms=2,
        standard=build_standard_in_turn,
        change_plate=build_plate_change_in_turn,
    )
)
TRANSPORT: Final = procedure_backend(ShippedProcedure(build_transport, measures=False))
