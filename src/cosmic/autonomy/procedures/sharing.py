"""Parts side by side that share things: each with its own work, and one at a time at a place."""

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Final, TypeVar

from typing_extensions import override

from cosmic.autonomy.procedures.failures import ProcedureStopped
from cosmic.autonomy.procedures.operation import OperationFailed
from cosmic.autonomy.procedures.resources import ForTurn, Resource
from cosmic.autonomy.procedures.tree import NodeState
from cosmic.autonomy.procedures.walk import Course, Node, Part, Place, perform

W = TypeVar("W")


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
        needs: Callable[[W], Sequence[Resource]],
        *,
        leaving: Part[W] | None = None,
        name: str,
    ) -> None:
        super().__init__(name, *((part,) if leaving is None else (part, leaving)))
        self.needs: Final = needs

    @override
    def steps(self, place: Place[W]) -> Course:
        walk = place.walk
        needed = sorted(self.needs(walk.work), key=lambda each: each.rank)
        wanted = [each for each in needed if each not in walk.holds]
        ranks = [each.rank for each in (*walk.holds, *wanted)]
        if not all(rank < after for rank, after in pairwise(ranks)):
            raise ValueError(f"{self.name}: {wanted[0].name} must be taken before what is held")
        mine = walk.fork()
        mine.begun = walk.begun
        token = object()
        try:
            for each in wanted:
                each.ask(token)
                if not each.held_by(token):
                    walk.keeper.change(place.path, NodeState.QUEUED, f"waits for {each.name}")
                    yield ForTurn(each, token, walk.reins)
            if wanted:
                names = " and ".join(each.name for each in wanted)
                walk.keeper.change(place.path, NodeState.HOLDING, f"has {names}")
            mine.holds = (*walk.holds, *wanted)
            yield from self._held(Place(mine, place.path, place.attempt, place.round))
        finally:
            for each in wanted:
                each.give_back(token)

    def _held(self, place: Place[W]) -> Course:
        mark = len(place.walk.begun)
        failure: OperationFailed | None = None
        try:
            yield from perform(self.parts[0], place.child(0))
        except ProcedureStopped:
            raise
        except OperationFailed as exc:
            failure = exc
            if self.parts[1:]:
                yield from place.walk.undo_failed(mark)
        try:
            for leaving in self.parts[1:]:
                yield from perform(leaving, place.child(1))
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
        Whose part it is, such as "left hand"; all events below it carry it.
    work_of : callable
        Of the work of the part above: the one to go on with.
    """

    kind = "role"

    def __init__(self, name: str, part: Part[W], work_of: Callable[[W], W]) -> None:
        super().__init__(name, part)
        self.work_of: Final = work_of

    @override
    def steps(self, place: Place[W]) -> Course:
        walk = place.walk
        own = walk.fork()
        own.work, own.begun = self.work_of(walk.work), walk.begun
        yield from perform(self.parts[0], place.child(0, walk=own))
