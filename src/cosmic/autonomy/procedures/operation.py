"""A unit operation: the smallest part of a procedure that can be checked, repeated and undone."""

from collections.abc import Generator
from typing import Final, Generic, Protocol, TypeVar

from cosmic.frame.errors import CosmicError

W = TypeVar("W")


class Awaited(Protocol):
    """What takes a while: a movement, a group's movement, a task, a status."""

    @property
    def done(self) -> bool:
        """True when it has ended, well or not."""
        ...

    def wait(self, timeout_s: float | None = None) -> object:
        """Wait for the end, and raise what it failed with."""
        ...

    def cancel(self) -> None:
        """End it; what it has set in motion stops."""
        ...


class SafePoint:
    """Yielded where a procedure may rest: nothing is in motion, and nothing is lost by waiting."""


SAFE_POINT: Final = SafePoint()

Yielded = Awaited | float | SafePoint
"""What an operation yields: something to wait for, seconds of the platform's time, or a rest."""

Steps = Generator[Yielded, object, None]
"""An operation on its way. What `wait` of an `Awaited` returned is sent back into it."""


class OperationFailed(CosmicError):  # noqa: N818 - reads as what happened
    """An operation did not do what it should.

    Parameters
    ----------
    cause : str
        Short and the same for all failures of a kind, such as "missed grasp": failures are counted
        by it.
    text : str
        What was found, where, and what may be done.
    """

    def __init__(self, cause: str, text: str) -> None:
        super().__init__(f"{cause}: {text}")
        self.cause = cause
        self.text = text


class UnitOperation(Generic[W]):
    """One operation on `work`, which holds all that the operations of a procedure share.

    Subclasses override `run` and whatever else applies. None of these may block: what takes a
    while is yielded.

    Attributes
    ----------
    name : str
        As shown in the tree and in records, such as "close the gripper".
    """

    name: str = ""

    def precondition(self, work: W) -> None:
        """Look whether the operation may begin, without changing anything.

        Raises
        ------
        OperationFailed
            It may not.
        """

    def run(self, work: W) -> Steps:
        """Carry it out."""
        raise NotImplementedError

    def verify(self, work: W) -> Steps | None:
        """See by image or force whether it worked; None: there is nothing to see.

        Raises
        ------
        OperationFailed
            It did not.
        """

    def undo(self, work: W) -> Steps | None:
        """Bring things to where the operation can be begun again; called when it failed."""
