"""Putting operations together: in order, again, instead, under a condition, and side by side."""

from collections.abc import Callable, Collection
from typing import Final, TypeVar

from typing_extensions import override

from cosmic.autonomy.procedures.failures import (
    ProcedureStopped,
    UndoFailed,
    failure_of,
)
from cosmic.autonomy.procedures.operation import SAFE_POINT, OperationFailed
from cosmic.autonomy.procedures.pending import ForAny, Pending, Watch, Watched
from cosmic.autonomy.procedures.walk import Branch, Course, Node, Part, Place, Walk, perform
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
    def steps(self, place: Place[W]) -> Course:
        for number, part in enumerate(self.parts):
            yield from perform(part, place.child(number))


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
    def steps(self, place: Place[W]) -> Course:
        walk = place.walk
        for attempt in range(1, self.times + 1):
            mark = len(walk.begun)
            try:
                yield from perform(self.parts[0], place.child(0, attempt=attempt))
                return
            except OperationFailed as exc:
                if attempt == self.times or not self._worth_another(exc):
                    raise
            yield from walk.undo_back(mark)
            for between in self.parts[1:]:
                yield from perform(between, place.child(1, attempt=attempt))

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
    def steps(self, place: Place[W]) -> Course:
        last = len(self.parts) - 1
        for number, part in enumerate(self.parts):
            mark = len(place.walk.begun)
            try:
                yield from perform(part, place.child(number))
                return
            except ProcedureStopped:
                raise
            except OperationFailed:
                if number == last:
                    raise
            yield from place.walk.undo_failed(mark)


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
    def steps(self, place: Place[W]) -> Course:
        walk = place.walk
        mark = len(walk.begun)
        watch = Watch(lambda: self.condition(walk.work))
        if watch.broken():
            raise self._failure(watch, "it was so before the part began")
        branch = Branch(perform(self.parts[0], place.child(0)), walk.reins)
        try:
            while not watch.broken():
                branch.go()
                if branch.over:
                    return
                yield Watched(branch.pending, watch)
        finally:
            left = branch.end()
        yield branch.until_ended(left)
        failure = self._failure(watch, "it became so on the way")
        if not isinstance(failure, ProcedureStopped):
            yield from walk.undo_back(mark)
        raise failure

    def _failure(self, watch: Watch, text: str) -> OperationFailed:
        error = watch.error
        if error is None:
            return OperationFailed(self.cause, text)
        if not isinstance(error, CosmicError):
            raise error
        failure = failure_of(error)
        if not isinstance(failure, ProcedureStopped):
            text = f"whether it is so could not be told: {error}"
            failure = OperationFailed(self.cause, text)
            failure.__cause__ = error
        return failure


class Parallel(Node[W]):
    """Parts side by side in one thread, so that their waits overlap; ends when all have ended.

    Where one fails, the others are ended at once, and all that they did is undone. In a pause
    each goes on to its own next place of rest.
    """

    kind = "parallel"

    @override
    def steps(self, place: Place[W]) -> Course:
        walks = [place.walk.fork() for _ in self.parts]
        branches = [
            Branch(perform(part, place.child(number, walk=walk)), walk.reins)
            for number, (part, walk) in enumerate(zip(self.parts, walks, strict=True))
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
            for walk in walks:
                place.walk.begun.extend(walk.begun)
            return
        yield branches[0].until_ended(*left)
        yield from self._give_up(place.walk, walks, failed, failure)

    @staticmethod
    def _give_up(
        walk: Walk[W], walks: list[Walk[W]], failed: int | None, failure: OperationFailed
    ) -> Course:
        for number, each in enumerate(walks):
            if number != failed and not isinstance(failure, ProcedureStopped):
                yield from each.undo_back(0)
        if failed is not None:
            walk.begun.extend(walks[failed].begun)
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
    def steps(self, place: Place[W]) -> Course:
        walk = place.walk
        number = 0
        while not self.until(walk.work):
            number += 1
            mark = len(walk.begun)
            walk.keeper.reset(place.path)
            yield SAFE_POINT
            yield from perform(self.parts[0], place.child(0, round_=number))
            del walk.begun[mark:]
