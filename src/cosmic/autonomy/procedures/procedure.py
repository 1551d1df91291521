"""`Procedure`: the parts put together, and how each part is carried out."""

import copy
from abc import ABC, abstractmethod
from collections.abc import Callable, Generator
from contextlib import suppress
from dataclasses import dataclass
from typing import Final, Generic, Self, TypeVar

from cosmic.autonomy.procedures.failures import (
    ProcedureStopped,
    UndoFailed,
    defect_of,
    failure_of,
)
from cosmic.autonomy.procedures.operation import OperationFailed, Steps, UnitOperation, Yielded
from cosmic.autonomy.procedures.tree import NodeState, Path, ProcedureTreeState
from cosmic.autonomy.procedures.waits import (
    OPERATION_END,
    ForEnd,
    ForNothing,
    Pending,
    Resource,
    RunControl,
    pending_of,
)
from cosmic.frame.errors import CosmicError, StoppedError

W = TypeVar("W")

NodeSteps = Generator[Yielded | Pending, object, None]
"""A part on its way: what it yields is waited for before it goes on."""

ENDING_S: Final = 5.0
"""How long what was cancelled may take to end before the undoing begins."""


class Node(ABC, Generic[W]):
    """Combines parts of a procedure; a description only, which many runs may share."""

    kind: str = ""

    def __init__(self, name: str, *parts: "Part[W]") -> None:
        self.name: Final = name
        self.parts: Final = parts

    @abstractmethod
    def steps(self, position: "TreePosition[W]") -> NodeSteps:
        """Carry the parts out."""


Part = UnitOperation[W] | Node[W]
"""What can be put together: an operation, or operations put together."""


class BegunOperation(Generic[W]):
    """An operation that was begun and may have to be undone."""

    def __init__(self, operation: UnitOperation[W], path: Path, work: W) -> None:
        self.operation = operation
        self.path = path
        self.work = work
        self.failed = False


class ExecutionContext(Generic[W]):
    """What all parts share on their way through the tree, and what was begun on this branch."""

    def __init__(self, work: W, tree: ProcedureTreeState, control: RunControl) -> None:
        self.work = work
        self.tree = tree
        self.control = control
        self.begun: list[BegunOperation[W]] = []
        self.holds: tuple[Resource, ...] = ()

    def fork(self) -> Self:
        """Return one for a branch that keeps its own account of what it began."""
        other = copy.copy(self)
        other.begun = []
        return other

    def undo_back(self, mark: int) -> NodeSteps:
        """Undo what was begun since there were `mark`, the last first."""
        while len(self.begun) > mark:
            yield from self._undo(self.begun.pop())

    def undo_failed(self, mark: int = 0) -> NodeSteps:
        """Undo what failed since there were `mark`, and leave alone what was done well."""
        for each in [each for each in reversed(self.begun[mark:]) if each.failed]:
            self.begun.remove(each)
            yield from self._undo(each)

    def _undo(self, each: BegunOperation[W]) -> NodeSteps:
        change = self.tree.change
        name = each.operation.name
        undone = False
        text = ""
        try:
            steps = each.operation.undo(each.work)
            if steps is not None:
                change(each.path, NodeState.UNDOING)
                yield from steps
                change(each.path, NodeState.UNDONE)
            undone = True
        except CosmicError as exc:
            text = str(exc)
            failure = failure_of(exc)
            if isinstance(failure, ProcedureStopped):
                raise failure from exc
            raise UndoFailed(name, text) from exc
        finally:
            if not undone:
                change(each.path, NodeState.NOT_UNDONE, text)


@dataclass(frozen=True, slots=True)
class TreePosition(Generic[W]):
    """Where in the tree a part is carried out.

    Attributes
    ----------
    context : ExecutionContext
        What all parts share.
    path : tuple of int
        Of the part in the tree.
    attempt, round : int
        Of the nearest retry and repeat above; `round` is 0 where there is none.
    """

    context: ExecutionContext[W]
    path: Path = ()
    attempt: int = 1
    round: int = 0

    def child(
        self,
        number: int,
        *,
        context: ExecutionContext[W] | None = None,
        attempt: int | None = None,
        round_: int | None = None,
    ) -> "TreePosition[W]":
        """Return the position of a part below this one."""
        return TreePosition(
            context or self.context,
            (*self.path, number),
            self.attempt if attempt is None else attempt,
            self.round if round_ is None else round_,
        )


def perform(part: Part[W], position: TreePosition[W]) -> NodeSteps:
    """Carry out `part` and tell of its begin and its end.

    Raises
    ------
    OperationFailed
        It failed; what it means to the parts above is theirs to say.
    """
    tree, path = position.context.tree, position.path
    failure: OperationFailed | None = None
    is_operation = isinstance(part, UnitOperation)
    tree.begin(path, position.attempt, position.round)
    try:
        if isinstance(part, UnitOperation):
            yield from _operate(part, position)
        else:
            yield from part.steps(position)
    except GeneratorExit:
        tree.end(path, NodeState.ENDED)
        raise
    except CosmicError as exc:
        failure = failure_of(exc)
        tree.end(path, NodeState.FAILED, failure)
    except BaseException as exc:
        tree.end(path, NodeState.FAILED, defect_of(exc))
        raise
    else:
        tree.end(path, NodeState.DONE)
    if is_operation:
        yield OPERATION_END
    if failure is not None:
        raise failure


def _operate(operation: UnitOperation[W], position: TreePosition[W]) -> NodeSteps:
    context = position.context
    operation.precondition(context.work)
    entry = BegunOperation(operation, position.path, context.work)
    context.begun.append(entry)
    try:
        steps = operation.run(context.work)
        if steps is not None:  # a `run` that yields nothing is a plain function
            yield from steps
        looking = operation.verify(context.work)
        if looking is not None:
            context.tree.change(position.path, NodeState.VERIFYING)
            yield from looking
    except CosmicError:
        entry.failed = True
        raise


class Branch:
    """A part on its way, and what it waits for at the moment."""

    def __init__(self, steps: NodeSteps, control: RunControl) -> None:
        self._steps = steps
        self._control = control
        self.pending: Pending = ForNothing()
        self.over = False

    @property
    def ready(self) -> bool:
        """True when it may go on."""
        return self.pending.ready()

    def go(self) -> None:
        """Go on to the next thing it waits for, or to its end; raises what it fails with."""
        try:
            yielded = self._next()
            while True:
                try:
                    self.pending = pending_of(yielded, self._control)
                    return
                except (TypeError, ValueError) as exc:
                    yielded = self._steps.throw(exc)
        except StopIteration:
            self.over = True
        except BaseException:
            self.over = True
            raise

    def _next(self) -> Yielded | Pending:
        pending, self.pending = self.pending, ForNothing()
        if isinstance(pending, ForNothing):
            return next(self._steps)
        try:
            value = pending.result()
        except StoppedError as exc:
            # Whatever the operation makes of it: after a stop nothing goes on.
            with suppress(StopIteration):
                self.pending = pending_of(self._steps.throw(exc), self._control)
            self.end()
            raise ProcedureStopped(str(exc)) from exc
        except Exception as exc:  # noqa: BLE001 - it is the operation's to handle
            return self._steps.throw(exc)
        return self._steps.send(value)

    def cancel(self) -> None:
        """Cancel what it waits for."""
        self.pending.cancel()

    def end(self) -> Pending:
        """End it at once and return what may yet be moving."""
        pending, self.pending = self.pending, ForNothing()
        self.over = True
        try:
            pending.cancel()
        finally:
            self._steps.close()
        return pending

    def until_ended(self, *left: Pending) -> Pending:
        """Return the wait for the end of what `end` returned."""
        return ForEnd(self._control, left, ENDING_S)


@dataclass(frozen=True)
class Procedure(Generic[W]):
    """What to do, as a description that can be run many times.

    Attributes
    ----------
    name : str
        As shown above the tree and in records.
    root : Part
        All of it.
    make_safe : callable or None
        Its steps are carried out last when the procedure was aborted or failed, but not after a
        stop or a defect, when nothing may move.
    make_safe_s : float
        How long that may take, in the platform's time.
    """

    name: str
    root: Part[W]
    make_safe: Callable[[W], Steps] | None = None
    make_safe_s: float = 20.0
