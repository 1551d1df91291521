"""All that a procedure is written with, for one import."""

from cosmic.autonomy.procedures.combinators import (
    Fallback,
    Guard,
    Holding,
    Parallel,
    Repeat,
    Retry,
    Role,
    Sequence,
)
from cosmic.autonomy.procedures.operation import (
    SAFE_POINT,
    OperationFailed,
    Steps,
    UnitOperation,
)
from cosmic.autonomy.procedures.procedure import Procedure
from cosmic.autonomy.procedures.tree import NodeEvent, NodeState
from cosmic.autonomy.procedures.waits import Resource

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
