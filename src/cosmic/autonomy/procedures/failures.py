"""What ends an operation, said in the few words that failures are counted by."""

from typing import Final

from cosmic.autonomy.procedures.operation import OperationFailed
from cosmic.frame.errors import (
    ConfigError,
    CosmicError,
    DeviceError,
    MoveCancelled,
    MoveRefused,
    NotAvailable,
    StoppedError,
)

STOPPED: Final = "stopped"
UNDO_FAILED: Final = "undo failed"
DEFECT: Final = "defect"


class ProcedureStopped(OperationFailed):
    """The platform was stopped: nothing is tried again, nothing is undone, nothing moves."""

    def __init__(self, text: str) -> None:
        super().__init__(STOPPED, text)


class UndoFailed(OperationFailed):
    """An operation could not be undone, so that it must not be begun again."""

    def __init__(self, operation: str, text: str) -> None:
        super().__init__(UNDO_FAILED, f"{operation} could not be undone: {text}")


class ProcedureAborted(CosmicError):  # noqa: N818 - reads as what happened
    """A procedure was ended before its end by whoever watched over it."""


def failure_of(error: CosmicError) -> OperationFailed:
    """Return what `error` means for the operation it came from, with `error` as its cause."""
    if isinstance(error, OperationFailed):
        return error
    text = str(error)
    failure = (
        ProcedureStopped(text)
        if isinstance(error, StoppedError)
        else OperationFailed(_cause(error), text)
    )
    failure.__cause__ = error
    return failure


def _cause(error: CosmicError) -> str:
    if isinstance(error, MoveRefused):
        return f"refused: {error.verdict.reason.value.lower().replace('_', ' ')}"
    if isinstance(error, DeviceError):
        return f"device: {error.fault.value}"
    kinds: tuple[tuple[type[CosmicError], str], ...] = (
        (MoveCancelled, "interrupted"),
        (NotAvailable, "not available"),
        (ConfigError, "configuration"),
    )
    return next((word for kind, word in kinds if isinstance(error, kind)), "error")


def defect_of(error: BaseException) -> OperationFailed:
    """Return the failure that stands for a mistake in an operation, with `error` as its cause."""
    failure = OperationFailed(DEFECT, f"{type(error).__name__}: {error}")
    failure.__cause__ = error
    return failure
