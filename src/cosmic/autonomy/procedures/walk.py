"""How the parts of a procedure are carried out: one generator for the whole tree."""

import copy
from abc import ABC, abstractmethod
from collections.abc import Generator
from contextlib import suppress
from dataclasses import dataclass
from typing import Final, Generic, Self, TypeVar

from cosmic.autonomy.procedures.failures import (
    ProcedureStopped,
    UndoFailed,
    defect_of,
    failure_of,
)
from cosmic.autonomy.procedures.operation import OperationFailed, UnitOperation, Wish
from cosmic.autonomy.procedures.pending import (
    ForEnd,
    ForNothing,
    Pending,
    pending_of,
)
from cosmic.autonomy.procedures.reins import OPERATION_END, Reins
from cosmic.autonomy.procedures.resources import Resource
from cosmic.autonomy.procedures.tree import NodeState, Path, TreeKeeper
from cosmic.frame.errors import CosmicError, StoppedError

W = TypeVar("W")

Course = Generator[Wish | Pending, object, None]
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
    def steps(self, place: "Place[W]") -> Course:
        """Carry the parts out."""


Part = UnitOperation[W] | Node[W]
"""What can be put together: an operation, or operations put together."""


class Begun(Generic[W]):
    """An operation that was begun and may have to be undone."""

    def __init__(self, operation: UnitOperation[W], path: Path, work: W) -> None:
        self.operation = operation
        self.path = path
        self.work = work
        self.failed = False


class Walk(Generic[W]):
    """What all parts share on their way through the tree, and what was begun on this branch."""

    def __init__(self, work: W, keeper: TreeKeeper, reins: Reins) -> None:
        self.work = work
        self.keeper = keeper
        self.reins = reins
        self.begun: list[Begun[W]] = []
        self.holds: tuple[Resource, ...] = ()

    def fork(self) -> Self:
        """Return one for a branch that keeps its own account of what it began."""
        other = copy.copy(self)
        other.begun = []
        return other

    def undo_back(self, mark: int) -> Course:
        """Undo what was begun since there were `mark`, the last first."""
        while len(self.begun) > mark:
            yield from self._undo(self.begun.pop())

    def undo_failed(self, mark: int = 0) -> Course:
        """Undo what failed since there were `mark`, and leave alone what was done well."""
        for each in [each for each in reversed(self.begun[mark:]) if each.failed]:
            self.begun.remove(each)
            yield from self._undo(each)

    def _undo(self, each: Begun[W]) -> Course:
        change = self.keeper.change
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
class Place(Generic[W]):
    """Where in the tree a part is carried out.

    Attributes
    ----------
    walk : Walk
        What all parts share.
    path : tuple of int
        Of the part in the tree.
    attempt, round : int
        Of the nearest retry and repeat above; `round` is 0 where there is none.
    """

    walk: Walk[W]
    path: Path = ()
    attempt: int = 1
    round: int = 0

    def child(
        self,
        number: int,
        *,
        walk: Walk[W] | None = None,
        attempt: int | None = None,
        round_: int | None = None,
    ) -> "Place[W]":
        """Return the place of a part below this one."""
        return Place(
            walk or self.walk,
            (*self.path, number),
            self.attempt if attempt is None else attempt,
            self.round if round_ is None else round_,
        )


def perform(part: Part[W], place: Place[W]) -> Course:
    """Carry out `part` and tell of its begin and its end.

    Raises
    ------
    OperationFailed
        It failed; what it means to the parts above is theirs to say.
    """
    keeper, path = place.walk.keeper, place.path
    failure: OperationFailed | None = None
    is_operation = isinstance(part, UnitOperation)
    keeper.begin(path, place.attempt, place.round)
    try:
        if isinstance(part, UnitOperation):
            yield from _operate(part, place)
        else:
            yield from part.steps(place)
    except GeneratorExit:
        keeper.end(path, NodeState.ENDED)
        raise
    except CosmicError as exc:
        failure = failure_of(exc)
        keeper.end(path, NodeState.FAILED, failure)
    except BaseException as exc:
        keeper.end(path, NodeState.FAILED, defect_of(exc))
        raise
    else:
        keeper.end(path, NodeState.DONE)
    if is_operation:
        yield OPERATION_END
    if failure is not None:
        raise failure


def _operate(operation: UnitOperation[W], place: Place[W]) -> Course:
    walk = place.walk
    operation.precondition(walk.work)
    entry = Begun(operation, place.path, walk.work)
    walk.begun.append(entry)
    try:
        steps = operation.run(walk.work)
        if steps is not None:  # a `run` that yields nothing is a plain function
            yield from steps
        looking = operation.verify(walk.work)
        if looking is not None:
            walk.keeper.change(place.path, NodeState.VERIFYING)
            yield from looking
    except CosmicError:
        entry.failed = True
        raise


class Branch:
    """A part on its way, and what it waits for at the moment."""

    def __init__(self, steps: Course, reins: Reins) -> None:
        self._steps = steps
        self._reins = reins
        self.pending: Pending = ForNothing()
        self.over = False

    @property
    def ready(self) -> bool:
        """True when it may go on."""
        return self.pending.ready()

    def go(self) -> None:
        """Go on to the next thing it waits for, or to its end; raises what it fails with."""
        try:
            wish = self._next()
            while True:
                try:
                    self.pending = pending_of(wish, self._reins)
                    return
                except (TypeError, ValueError) as exc:
                    wish = self._steps.throw(exc)
        except StopIteration:
            self.over = True
        except BaseException:
            self.over = True
            raise

    def _next(self) -> Wish | Pending:
        pending, self.pending = self.pending, ForNothing()
        if isinstance(pending, ForNothing):
            return next(self._steps)
        try:
            value = pending.result()
        except StoppedError as exc:
            # Whatever the operation makes of it: after a stop nothing goes on.
            with suppress(StopIteration):
                self.pending = pending_of(self._steps.throw(exc), self._reins)
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
        return ForEnd(self._reins, left, ENDING_S)
