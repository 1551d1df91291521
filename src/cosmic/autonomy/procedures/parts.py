"""All that a procedure is written with, in one place to import from."""

from cosmic.autonomy.procedures.combinators import (
    Fallback,
    Guard,
    Parallel,
    Repeat,
    Retry,
    Sequence,
)
from cosmic.autonomy.procedures.operation import (
    SAFE_POINT,
    OperationFailed,
    Steps,
    UnitOperation,
)
from cosmic.autonomy.procedures.procedure import Procedure
from cosmic.autonomy.procedures.resources import Resource
from cosmic.autonomy.procedures.sharing import Holding, Role
from cosmic.autonomy.procedures.tree import NodeEvent, NodeState

__all__ = [
    "SAFE_POINT",
    "Fallback",
    "Guard",
    "Holding",
    "NodeEvent",
    "NodeState",
    "OperationFailed",
    "Parallel",
    "Procedure",
    "Repeat",
    "Resource",
    "Retry",
    "Role",
    "Sequence",
    "Steps",
    "UnitOperation",
]
