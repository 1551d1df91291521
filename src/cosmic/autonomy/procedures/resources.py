"""What one branch of a procedure uses at a time, such as a place, and the wait for it."""

import math
from contextlib import suppress
from typing import Final

from typing_extensions import override

from cosmic.autonomy.procedures.pending import Pending
from cosmic.autonomy.procedures.reins import Reins


class Resource:
    """Something that one branch of a procedure uses at a time; belongs to the thread of the run.

    Whoever came first gets it first.

    Parameters
    ----------
    name : str
        As shown in the tree, such as "the probe".
    rank : int
        Branches take several in the order of their ranks, so that two never wait for each other.
    """

    def __init__(self, name: str, rank: int = 0) -> None:
        self.name: Final = name
        self.rank: Final = rank
        self._queue: list[object] = []

    @property
    def free(self) -> bool:
        """True when nobody has it, and nobody waits for it."""
        return not self._queue

    def ask(self, who: object) -> None:
        """Queue up for it; harmless the second time."""
        if who not in self._queue:
            self._queue.append(who)

    def held_by(self, who: object) -> bool:
        """Tell whether it is the turn of `who`."""
        return bool(self._queue) and self._queue[0] is who

    def give_back(self, who: object) -> None:
        """Let the next one have it, or wait for it no longer."""
        with suppress(ValueError):
            self._queue.remove(who)


class ForTurn(Pending):
    """The moment when a resource is one's own."""

    def __init__(self, resource: Resource, who: object, reins: Reins) -> None:
        self._resource = resource
        self._who = who
        self._reins = reins

    @property
    @override
    def resting(self) -> bool:
        # Nothing is lost by waiting: in a pause this is as good a place of rest as any.
        return (self._reins.pausing or self._reins.stepping) and not self.ready()

    @override
    def ready(self) -> bool:
        return self._resource.held_by(self._who)

    @override
    def look_again_s(self, now_s: float) -> float:
        return math.inf  # it is given back by a branch of the same thread
