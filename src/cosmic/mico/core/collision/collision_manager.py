"""`CollisionManager`: lets no two bodies come closer than their margin (thesis 6.1.2, Fig. 6.5)."""

import logging
from collections.abc import Iterable, Mapping, Set
from dataclasses import replace
from typing import Final, Protocol

from typing_extensions import override

from cosmic.frame.errors import NotAvailable
from cosmic.frame.verdict import ALLOWED, MoveVerdict, Reason
from cosmic.mico.core.collision import words
from cosmic.mico.core.collision.answer import INSIDE_TEXT, Approach, SweepAnswer
from cosmic.mico.core.collision.callback import CollisionCallbackBase, RefuseContact, Response
from cosmic.mico.core.collision.checker import CollisionChecker, Spans
from cosmic.mico.core.collision.exemptions import Exemptions
from cosmic.mico.core.collision.helper_link import GateProcess, LateAnswerError, NoAnswerError
from cosmic.mico.core.collision.model import BodyPair, SceneModel, pair_of

logger = logging.getLogger(__name__)

_NOBODY: Final[frozenset[BodyPair]] = frozenset()


MOST_CHECKED: Final = 3
"""How often a question is put again because what is left out of it changed meanwhile."""
JUST_BEHIND: Final = 2.0
"""How far behind the free part of a way its end is looked at, um or degrees."""


class Answering(Protocol):
    """What the manager asks: `GateProcess`, or something in its place."""

    def start(self) -> None:
        """Make it ready; raises `NoAnswerError` when it does not come up."""

    def close(self) -> None:
        """Give everything back."""

    def check(self, spans: Spans, ignored: Set[BodyPair] = _NOBODY) -> SweepAnswer:
        """See `Sweep.check`; raises `NoAnswerError`."""

    def check_promptly(self, spans: Spans, ignored: Set[BodyPair] = _NOBODY) -> SweepAnswer | None:
        """See `GateProcess.check_promptly`; raises `NoAnswerError`."""

    def nearest(
        self, positions: Mapping[str, float], ignored: Set[BodyPair] = _NOBODY
    ) -> Approach | None:
        """See `Sweep.nearest`; raises `NoAnswerError`."""

    def clear_travel(
        self, spans: Spans, axis: str, ignored: Set[BodyPair] = _NOBODY
    ) -> float | None:
        """See `clear_travel`; raises `NoAnswerError`."""


class CollisionManager(Exemptions, CollisionChecker):
    """Checks movements on the scene, in words for the operator; any thread.

    Parameters
    ----------
    answer_s : float
        How long an answer may take, in wall time, before it is no.
    process : Answering or None
        Who answers; a `GateProcess` unless told.
    axes : iterable of str
        All axes of the platform, those of the scene unless told.
    """

    def __init__(
        self,
        model: SceneModel,
        *,
        answer_s: float = 5.0,
        process: Answering | None = None,
        axes: Iterable[str] = (),
    ) -> None:
        super().__init__(model.contacts, tuple(axes) or model.axes)
        self.model = model
        self._process = process or GateProcess(model, answer_s=answer_s)
        self._callbacks: dict[BodyPair, CollisionCallbackBase] = {}
        self._default_callback: CollisionCallbackBase = RefuseContact()

    # Start and end

    @property
    @override
    def available(self) -> bool:
        return True

    @override
    def start(self) -> None:
        try:
            self._process.start()
        except NoAnswerError as exc:
            logger.error("every movement is refused: the collision check does not start: %s", exc)

    @override
    def close(self) -> None:
        self._process.close()

    def movers(self, pairs: Set[BodyPair]) -> frozenset[str]:
        """Return the axes that move one of two bodies of `pairs`."""
        bodies = {body for pair in pairs for body in pair}
        return frozenset(axis for axis in self.model.axes if self.model.carried(axis) & bodies)

    # Questions

    @override
    def check(self, spans: Spans, *, advice: bool = True) -> MoveVerdict:
        try:
            for _ in range(MOST_CHECKED):
                before = self.taken_out, self.ignored_pairs
                verdict = self._decide(self._with_freed(spans), advice=advice)
                if not verdict.allowed or before == (self.taken_out, self.ignored_pairs):
                    return verdict
            return words.changed()
        except LateAnswerError as exc:
            return words.late_answer(str(exc))
        except NoAnswerError as exc:
            return words.no_answer(str(exc))
        except Exception as exc:  # a check that cannot answer says no
            logger.exception("the collision check failed")
            return words.no_answer(f"{type(exc).__name__}: {exc}")

    @override
    def check_promptly(self, spans: Spans) -> MoveVerdict | None:
        before = self.taken_out, self.ignored_pairs
        freed = self._with_freed(spans)
        try:
            answer = self._process.check_promptly(freed, before[1])
        except NoAnswerError as no:
            return words.no_answer(str(no))
        if answer is None or answer.clear is not True:
            return None
        return self._allow(freed) if before == (self.taken_out, self.ignored_pairs) else None

    def nearest(self, positions: Mapping[str, float]) -> Approach | None:
        """Return the pair nearest to each other with the axes at `positions`, if any is watched.

        Raises
        ------
        NoAnswerError
            There is no answer.
        """
        return self._process.nearest(positions, self.ignored_pairs)

    def _with_freed(self, spans: Spans) -> Spans:
        freed = self.taken_out
        if not freed:
            return spans
        return {
            axis: replace(span, free=True) if axis in freed else span
            for axis, span in spans.items()
        }

    def _decide(self, spans: Spans, *, advice: bool) -> MoveVerdict:
        ignored = self.ignored_pairs
        responses: dict[BodyPair, Response] = {}

        def waved_through(found: Approach) -> bool:
            if found.bodies not in responses:
                responses[found.bodies] = self._respond(found, spans)
            return responses[found.bodies] is Response.IGNORE

        while True:
            answer = self._process.check(spans, ignored)
            if answer.clear is True:
                return self._allow(spans)
            approach = answer.approach
            if approach is None:
                return words.cannot_check(answer.reason or "it gave no reason")
            if approach.bodies in ignored:
                return words.no_answer(f"it does not leave {approach.bodies} aside")
            free_to = None
            if not waved_through(approach):
                inside = answer.reason == INSIDE_TEXT
                if advice and not inside:
                    free_to, first = self._free_part(spans, ignored)
                    approach = first or approach
                if not waved_through(approach):
                    approach = replace(approach, pose=_with_resting(approach.pose, spans))
                    return words.collision(
                        self.model, spans, approach, inside=inside, free_to=free_to
                    )
            ignored = ignored | {approach.bodies}

    def _allow(self, spans: Spans) -> MoveVerdict:
        if not self.taken_out:
            return ALLOWED
        unwatched = [axis for axis, span in spans.items() if span.free and span.moving]
        if not unwatched:
            return ALLOWED
        text = f"allowed; {', '.join(unwatched)}: taken out of collision detection"
        return MoveVerdict(allowed=True, reason=Reason.ALLOWED, text=text)

    def _free_part(
        self, spans: Spans, ignored: Set[BodyPair]
    ) -> tuple[float | None, Approach | None]:
        """Return how far the only axis that moves may go, and what comes too close behind that."""
        axes = words.moving_axes(spans)
        if len(axes) != 1:
            return None, None
        axis, span = axes[0], spans[axes[0]]
        try:
            free_to = self._process.clear_travel(spans, axis, ignored)
            if free_to is None or span.now is None or span.end is None:
                return free_to, None
            sign = 1.0 if span.end > span.now else -1.0
            beyond = free_to + sign * JUST_BEHIND
            part = replace(span, low=min(span.now, beyond), high=max(span.now, beyond))
            return free_to, self._process.check({**spans, axis: part}, ignored).approach
        except NoAnswerError as exc:  # the refusal stands without it
            logger.warning("no answer about the clear travel of %s: %s", axis, exc)
            return None, None

    def _respond(self, approach: Approach, spans: Spans) -> Response:
        callback = self._callbacks.get(pair_of(*approach.bodies), self._default_callback)
        try:
            return callback.on_contact(approach, spans)
        except Exception:  # a response that fails is a refusal
            logger.exception("the collision callback %r failed", callback)
            return Response.REFUSE

    # Who responds

    def set_callback(self, bodies: BodyPair, callback: CollisionCallbackBase | None) -> None:
        """Let a pair of bodies have its own response to a contact; None gives it back.

        Raises
        ------
        NotAvailable
            The two are not watched.
        """
        pair = pair_of(*bodies)
        if all(watched.bodies != pair for watched in self.model.pairs):
            raise NotAvailable(f"{pair[0]} and {pair[1]} are not watched in {self.model.name}")
        before = self._callbacks.get(pair)
        if callback is None:
            self._callbacks.pop(pair, None)
        else:
            self._callbacks[pair] = callback
        if before is not None and before is not callback:
            self.watch_again(frozenset(), {pair})

    def set_default_callback(self, callback: CollisionCallbackBase) -> None:
        """Set the response of all pairs without their own."""
        before, self._default_callback = self._default_callback, callback
        if before is not callback and not isinstance(before, RefuseContact):
            self.watch_again(frozenset(), {pair.bodies for pair in self.model.pairs})


def _with_resting(pose: Mapping[str, float], spans: Spans) -> dict[str, float]:
    """Return `pose` with axes at rest where they are believed to be, not somewhere they could."""
    rest = {
        axis: span.now for axis, span in spans.items() if not span.moving and span.now is not None
    }
    return {axis: rest.get(axis, place) for axis, place in pose.items()}
