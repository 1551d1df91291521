"""The gate's collision check without its process: for rehearsals, in one thread."""

from collections.abc import Iterable, Mapping, Set

from typing_extensions import override

from cosmic.mico.core.collision.answer import Approach, SweepAnswer
from cosmic.mico.core.collision.checker import Spans
from cosmic.mico.core.collision.clear_travel import clear_travel
from cosmic.mico.core.collision.collision_manager import Answering, CollisionManager
from cosmic.mico.core.collision.model import BodyPair, SceneModel
from cosmic.mico.core.collision.sweep import Sweep

_NOBODY: frozenset[BodyPair] = frozenset()


class PureAnswers(Answering):
    """Answers as `GateProcess` does, from a `Sweep` of its own; one thread at a time."""

    def __init__(self, model: SceneModel) -> None:
        self.model = model
        self.sweep = Sweep(model)

    @override
    def start(self) -> None:
        """Do nothing: it is ready."""

    @override
    def close(self) -> None:
        """Do nothing: there is nothing to give back."""

    @override
    def check(self, spans: Spans, ignored: Set[BodyPair] = _NOBODY) -> SweepAnswer:
        return self.sweep.check(spans, ignored)

    @override
    def check_promptly(self, spans: Spans, ignored: Set[BodyPair] = _NOBODY) -> SweepAnswer | None:
        return self.check(spans, ignored)

    @override
    def nearest(
        self, positions: Mapping[str, float], ignored: Set[BodyPair] = _NOBODY
    ) -> Approach | None:
        return self.sweep.nearest(positions, ignored)

    @override
    def clear_travel(
        self, spans: Spans, axis: str, ignored: Set[BodyPair] = _NOBODY
    ) -> float | None:
        return clear_travel(self.sweep, spans, axis, ignored)


def pure_copy(
    live: CollisionManager, answers: PureAnswers, axes: Iterable[str]
) -> CollisionManager:
    """Return a manager that answers as `live` does now, without its process."""
    copy = CollisionManager(answers.model, process=answers, axes=axes)
    for axis in live.taken_out:
        copy.take_out(axis, source="rehearsal")
    for name in live.allowed_contacts:
        copy.allow_contact(name, source="rehearsal")
    return copy
