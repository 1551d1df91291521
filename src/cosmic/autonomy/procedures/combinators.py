"""Putting operations together: in order, again, instead, guarded, side by side, and sharing."""

from collections.abc import Callable, Collection, Iterable
from itertools import pairwise
from typing import Final, TypeVar

from typing_extensions import override

from cosmic.autonomy.procedures.failures import (
    ProcedureStopped,
    UndoFailed,
    failure_of,
)
from cosmic.autonomy.procedures.operation import SAFE_POINT, OperationFailed, UnitOperation
from cosmic.autonomy.procedures.procedure import (
    Branch,
    ExecutionContext,
    Node,
    NodeSteps,
    Part,
    TreePosition,
    perform,
)
from cosmic.autonomy.procedures.tree import OPERATION, NodeState, Outline
from cosmic.autonomy.procedures.waits import ForAny, ForTurn, Pending, Resource, Watch, Watched
from cosmic.frame.errors import CosmicError

W = TypeVar("W")


class Sequence(Node[W]):
    """One part after the other; the first that fails ends it.

    Parameters
    ----------
    name : str
        What the parts do together, as shown in the tree.
    """

    kind = "sequence"

    @override
    def steps(self, position: TreePosition[W]) -> NodeSteps:
        for number, part in enumerate(self.parts):
            yield from perform(part, position.child(number))


class Retry(Node[W]):
    """A part that is begun again when it fails, after what it did was undone.

    Parameters
    ----------
    times : int
        How often it is tried at most, the first time included.
    only : collection of str or None
        Causes that are worth another try; None: all. A stop never is, nor is an operation that
        could not be undone.
    between : Part or None
        Done before each further try, after the undoing: to shift, to wipe, to look again.

    Raises
    ------
    ValueError
        `times` is less than 1.
    """

    kind = "retry"

    def __init__(
        self,
        part: Part[W],
        times: int,
        *,
        only: Collection[str] | None = None,
        between: Part[W] | None = None,
        name: str = "",
    ) -> None:
        if not times >= 1:
            raise ValueError(f"a part is tried once or more, got {times!r}")
        parts = (part,) if between is None else (part, between)
        super().__init__(name or f"up to {times} times", *parts)
        self.times: Final = times
        self.only: Final = None if only is None else frozenset(only)

    @override
    def steps(self, position: TreePosition[W]) -> NodeSteps:
        context = position.context
        for attempt in range(1, self.times + 1):
            mark = len(context.begun)
            try:
                yield from perform(self.parts[0], position.child(0, attempt=attempt))
                return
            except OperationFailed as exc:
                if attempt == self.times or not self._worth_another(exc):
                    raise
            yield from context.undo_back(mark)
            for between in self.parts[1:]:
                yield from perform(between, position.child(1, attempt=attempt))

    def _worth_another(self, failure: OperationFailed) -> bool:
        if isinstance(failure, (ProcedureStopped, UndoFailed)):
            return False
        return self.only is None or failure.cause in self.only


class Fallback(Node[W]):
    """The first part that does not fail; fails as the last one does.

    The operation that failed is undone before the next part begins; what was done well before it
    stays as it is, for the next part to go on from there.
    """

    kind = "fallback"

    def __init__(self, name: str, *parts: Part[W]) -> None:
        if not parts:
            raise ValueError(f"{name}: a fallback needs a part")
        super().__init__(name, *parts)

    @override
    def steps(self, position: TreePosition[W]) -> NodeSteps:
        last = len(self.parts) - 1
        for number, part in enumerate(self.parts):
            mark = len(position.context.begun)
            try:
                yield from perform(part, position.child(number))
                return
            except ProcedureStopped:
                raise
            except OperationFailed:
                if number == last:
                    raise
            yield from position.context.undo_failed(mark)


class Guard(Node[W]):
    """A part that goes on only while a condition holds.

    The condition is looked at before, whenever the part waits or has waited, and every 20 ms of
    the platform's time meanwhile; not during a pause. When it breaks, what is in motion is
    cancelled, the part ended, and all that it did undone. It must answer at once; one that
    raises counts as broken. The force limit and the gate do not depend on it.

    Parameters
    ----------
    condition : callable
        Of the work; True as long as the part may go on.
    cause : str
        What it fails with when the condition breaks.
    """

    kind = "guard"

    def __init__(
        self, part: Part[W], condition: Callable[[W], bool], cause: str, *, name: str = ""
    ) -> None:
        super().__init__(name or f"unless {cause}", part)
        self.condition: Final = condition
        self.cause: Final = cause

    @override
    def steps(self, position: TreePosition[W]) -> NodeSteps:
        context = position.context
        mark = len(context.begun)
        watch = Watch(lambda: self.condition(context.work))
        if watch.broken():
            raise self._failure(watch, "it was true before the part started")
        branch = Branch(perform(self.parts[0], position.child(0)), context.control)
        try:
            while not watch.broken():
                branch.go()
                if branch.over:
                    return
                yield Watched(branch.pending, watch)
        finally:
            left = branch.end()
        yield branch.until_ended(left)
        failure = self._failure(watch, "it became true while the part ran")
        if not isinstance(failure, ProcedureStopped):
            yield from context.undo_back(mark)
        raise failure

    def _failure(self, watch: Watch, text: str) -> OperationFailed:
        error = watch.error
        if error is None:
            return OperationFailed(self.cause, text)
        if not isinstance(error, CosmicError):
            raise error
        failure = failure_of(error)
        if not isinstance(failure, ProcedureStopped):
            text = f"the condition could not be evaluated: {error}"
            failure = OperationFailed(self.cause, text)
            failure.__cause__ = error
        return failure


class Parallel(Node[W]):
    """Parts side by side in one thread, so that their waits overlap; ends when all have ended.

    Where one fails, the others are ended at once, and all that they did is undone. In a pause
    each goes on to its own next safe point.
    """

    kind = "parallel"

    @override
    def steps(self, position: TreePosition[W]) -> NodeSteps:
        contexts = [position.context.fork() for _ in self.parts]
        branches = [
            Branch(perform(part, position.child(number, context=context)), context.control)
            for number, (part, context) in enumerate(zip(self.parts, contexts, strict=True))
        ]
        failed: int | None = None
        failure: OperationFailed | None = None
        left: list[Pending] = []
        try:
            while failure is None and any(not branch.over for branch in branches):
                for number, branch in enumerate(branches):
                    if branch.over or not branch.ready:
                        continue
                    try:
                        branch.go()
                    except OperationFailed as exc:
                        failed, failure = number, exc
                        break
                    # One at a time: whoever ends the whole ends it before the next goes on.
                    yield ForAny([each.pending for each in branches if not each.over])
        finally:
            for branch in branches:  # first all that moves
                branch.cancel()
            left = [branch.end() for branch in branches]
        if failure is None:
            for context in contexts:
                position.context.begun.extend(context.begun)
            return
        yield branches[0].until_ended(*left)
        yield from self._give_up(position.context, contexts, failed, failure)

    @staticmethod
    def _give_up(
        context: ExecutionContext[W],
        contexts: list[ExecutionContext[W]],
        failed: int | None,
        failure: OperationFailed,
    ) -> NodeSteps:
        for number, each in enumerate(contexts):
            if number != failed and not isinstance(failure, ProcedureStopped):
                yield from each.undo_back(0)
        if failed is not None:
            context.begun.extend(contexts[failed].begun)
        raise failure


class Repeat(Node[W]):
    """A part again and again, such as the way of one fibre, until there is no more to do.

    What a finished round did is never undone. A procedure may rest between two rounds.

    Parameters
    ----------
    until : callable
        Of the work; looked at before each round: True ends it.
    """

    kind = "repeat"

    def __init__(self, part: Part[W], until: Callable[[W], bool], *, name: str = "again") -> None:
        super().__init__(name, part)
        self.until: Final = until

    @override
    def steps(self, position: TreePosition[W]) -> NodeSteps:
        context = position.context
        number = 0
        while not self.until(context.work):
            number += 1
            mark = len(context.begun)
            context.tree.reset(position.path)
            yield SAFE_POINT
            yield from perform(self.parts[0], position.child(0, round_=number))
            del context.begun[mark:]


class Holding(Node[W]):
    """A part that needs things which one branch uses at a time; it waits until it has them.

    They are given back when the part has ended, well or not. What a part around it holds is its
    own already.

    Parameters
    ----------
    needs : callable
        Of the work: what is needed; asked when the part's turn has come.
    leaving : Part or None
        Done before they are given back, even where the part failed, to make room for the next;
        not after a stop or an abort.

    Raises
    ------
    ValueError
        While it runs: what is needed is not of a higher rank than what is held already.
    """

    kind = "holding"

    def __init__(
        self,
        part: Part[W],
        needs: Callable[[W], Iterable[Resource]],
        *,
        leaving: Part[W] | None = None,
        name: str,
    ) -> None:
        super().__init__(name, *((part,) if leaving is None else (part, leaving)))
        self.needs: Final = needs

    @override
    def steps(self, position: TreePosition[W]) -> NodeSteps:
        context = position.context
        needed = sorted(self.needs(context.work), key=lambda each: each.rank)
        wanted = [each for each in needed if each not in context.holds]
        ranks = [each.rank for each in (*context.holds, *wanted)]
        if not all(rank < after for rank, after in pairwise(ranks)):
            raise ValueError(f"{self.name}: {wanted[0].name} must be taken before what is held")
        mine = context.fork()
        mine.begun = context.begun
        token = object()
        try:
            for each in wanted:
                each.ask(token)
                if not each.held_by(token):
                    context.tree.change(position.path, NodeState.QUEUED, f"waits for {each.name}")
                    yield ForTurn(each, token, context.control)
            if wanted:
                names = " and ".join(each.name for each in wanted)
                context.tree.change(position.path, NodeState.HOLDING, f"has {names}")
            mine.holds = (*context.holds, *wanted)
            yield from self._held(
                TreePosition(mine, position.path, position.attempt, position.round)
            )
        finally:
            for each in wanted:
                each.release(token)

    def _held(self, position: TreePosition[W]) -> NodeSteps:
        mark = len(position.context.begun)
        failure: OperationFailed | None = None
        try:
            yield from perform(self.parts[0], position.child(0))
        except ProcedureStopped:
            raise
        except OperationFailed as exc:
            failure = exc
            if self.parts[1:]:
                yield from position.context.undo_failed(mark)
        try:
            for leaving in self.parts[1:]:
                yield from perform(leaving, position.child(1))
        except OperationFailed as exc:
            if failure is None or isinstance(exc, ProcedureStopped):
                raise
            raise failure from exc
        if failure is not None:
            raise failure


class Role(Node[W]):
    """A part that is carried out for one of several that do the same, with a work of its own.

    Parameters
    ----------
    name : str
        Whose part it is, such as "left arm"; all events below it carry it.
    work_of : callable
        Of the work of the part above: the one to go on with.
    """

    kind = "role"

    def __init__(self, name: str, part: Part[W], work_of: Callable[[W], W]) -> None:
        super().__init__(name, part)
        self.work_of: Final = work_of

    @override
    def steps(self, position: TreePosition[W]) -> NodeSteps:
        context = position.context
        own = context.fork()
        own.work, own.begun = self.work_of(context.work), context.begun
        yield from perform(self.parts[0], position.child(0, context=own))


def outline_of(part: Part[W], role: str = "") -> Outline:
    """Return the shape of the tree under `part`, which is done for `role`."""
    if isinstance(part, UnitOperation):
        return Outline(part.name or type(part).__name__, OPERATION, role=role)
    role = part.name if isinstance(part, Role) else role
    below = tuple(outline_of(each, role) for each in part.parts)
    return Outline(part.name, part.kind, below, role)
