"""`CollisionManager`: lets no two bodies come closer than their margin (thesis 6.1.2, Fig. 6.5)."""

import logging
from collections.abc import Callable, Iterable, Iterator, Mapping, Set
from contextlib import contextmanager
from dataclasses import replace
from threading import Lock
from typing import Final, Protocol

from typing_extensions import override

from cosmic.frame.errors import NotAvailable, UnknownAxisError
from cosmic.frame.listeners import tell
from cosmic.frame.verdict import ALLOWED, MoveVerdict, Reason
from cosmic.mico.core.collision import words
from cosmic.mico.core.collision.answer import Approach, Spans, SweepAnswer
from cosmic.mico.core.collision.callback import CollisionCallbackBase, RefuseContact, Response
from cosmic.mico.core.collision.checker import CollisionChecker
from cosmic.mico.core.collision.helper_link import GateProcess, NoAnswerError
from cosmic.mico.core.collision.model import BodyPair, SceneModel, pair_of
from cosmic.mico.core.collision.sweep import INSIDE_TEXT

logger = logging.getLogger(__name__)

_NOBODY: Final[frozenset[BodyPair]] = frozenset()


class Answering(Protocol):
    """What the manager asks: `GateProcess`, or something in its place."""

    def start(self) -> None:
        """Make it ready; raises `NoAnswerError` when it does not come up."""

    def close(self) -> None:
        """Give everything back."""

    def check(self, spans: Spans, ignored: Set[BodyPair] = _NOBODY) -> SweepAnswer:
        """See `Sweep.check`; raises `NoAnswerError`."""

    def nearest(
        self, positions: Mapping[str, float], ignored: Set[BodyPair] = _NOBODY
    ) -> Approach | None:
        """See `Sweep.nearest`; raises `NoAnswerError`."""

    def free_way(self, spans: Spans, axis: str, ignored: Set[BodyPair] = _NOBODY) -> float | None:
        """See `free_way`; raises `NoAnswerError`."""


class CollisionManager(CollisionChecker):
    """Judges movements on the scene, in words for the operator; any thread.

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
        answer_s: float = 1.0,
        process: Answering | None = None,
        axes: Iterable[str] = (),
    ) -> None:
        self.model = model
        self._process = process or GateProcess(model, answer_s=answer_s)
        self._axes = tuple(axes) or model.axes
        self._lock = Lock()
        self._taken_out: frozenset[str] = frozenset()
        self._allowed: frozenset[str] = frozenset()
        self._uses: dict[str, list[object]] = {contact.name: [] for contact in model.contacts}
        self._ignored = _NOBODY
        self._listeners: tuple[Callable[[], object], ...] = ()
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

    # Questions

    @override
    def check(self, spans: Spans) -> MoveVerdict:
        try:
            return self._judge(self._with_freed(spans))
        except NoAnswerError as exc:
            return words.no_answer(str(exc))
        except Exception as exc:  # a check that cannot answer says no
            logger.exception("the collision check failed")
            return words.no_answer(f"{type(exc).__name__}: {exc}")

    def nearest(self, positions: Mapping[str, float]) -> Approach | None:
        """Return the pair nearest to each other with the axes at `positions`, if any is watched.

        Raises
        ------
        NoAnswerError
            There is no answer.
        """
        return self._process.nearest(positions, self._ignored)

    def _with_freed(self, spans: Spans) -> Spans:
        freed = self._taken_out
        if not freed:
            return spans
        return {
            axis: replace(span, free=True) if axis in freed else span
            for axis, span in spans.items()
        }

    def _judge(self, spans: Spans) -> MoveVerdict:
        ignored = self._ignored
        while True:
            answer = self._process.check(spans, ignored)
            if answer.clear:
                return self._allow(spans)
            approach = answer.approach
            if approach is None:
                return words.cannot_judge(answer.reason or "it gave no reason")
            if approach.bodies in ignored:
                return words.no_answer(f"it does not leave {approach.bodies} aside")
            if self._respond(approach, spans) is not Response.IGNORE:
                return self._refuse(spans, answer, approach, ignored)
            ignored = ignored | {approach.bodies}

    def _allow(self, spans: Spans) -> MoveVerdict:
        if not self._taken_out:
            return ALLOWED
        unwatched = [axis for axis, span in spans.items() if span.free and span.moving]
        if not unwatched:
            return ALLOWED
        text = f"allowed; {', '.join(unwatched)}: taken out of collision detection"
        return MoveVerdict(allowed=True, reason=Reason.ALLOWED, text=text)

    def _refuse(
        self, spans: Spans, answer: SweepAnswer, approach: Approach, ignored: Set[BodyPair]
    ) -> MoveVerdict:
        inside = answer.reason == INSIDE_TEXT
        axes = words.moving_axes(spans)
        free_to = None
        if len(axes) == 1 and not inside:
            try:
                free_to = self._process.free_way(spans, axes[0], ignored)
            except NoAnswerError as exc:  # the refusal stands without it
                logger.warning("no answer about the free way of %s: %s", axes[0], exc)
        return words.collision(self.model, spans, approach, inside=inside, free_to=free_to)

    def _respond(self, approach: Approach, spans: Spans) -> Response:
        callback = self._callbacks.get(pair_of(*approach.bodies), self._default_callback)
        try:
            return callback.on_contact(approach, spans)
        except Exception:  # a response that fails is a refusal
            logger.exception("the collision callback %r failed", callback)
            return Response.REFUSE

    # Axes taken out (MiCoCL.13)

    @property
    def taken_out(self) -> frozenset[str]:
        """Axes whose movements are not checked."""
        return self._taken_out

    def take_out(self, axis: str, *, source: str = "script") -> None:
        """Check movements of `axis` no longer; other axes still keep clear of its bodies.

        Raises
        ------
        UnknownAxisError
            The platform has no such axis.
        """
        if self._set_taken_out(axis, out=True):
            logger.warning(
                "%s was taken out of collision detection by %s: its movements are NOT checked",
                axis,
                source,
            )
            tell(self._listeners)

    def take_in(self, axis: str, *, source: str = "script") -> None:
        """Check movements of `axis` again.

        Raises
        ------
        UnknownAxisError
            The platform has no such axis.
        """
        if self._set_taken_out(axis, out=False):
            logger.info("%s was taken into collision detection again by %s", axis, source)
            tell(self._listeners)

    def _set_taken_out(self, axis: str, *, out: bool) -> bool:
        if axis not in self._axes:
            raise UnknownAxisError(axis, self._axes)
        with self._lock:
            before = self._taken_out
            self._taken_out = before | {axis} if out else before - {axis}
            return self._taken_out != before

    # Contacts that are meant

    @property
    def allowed_contacts(self) -> frozenset[str]:
        """Names of the contacts of the scene that are allowed now."""
        return self._allowed

    def allow_contact(self, name: str, *, source: str = "script") -> None:
        """Leave the pairs of a contact of the scene aside until it is forbidden.

        Raises
        ------
        NotAvailable
            The scene describes no such contact.
        """
        self._use(name, name, source)

    def forbid_contact(self, name: str, *, source: str = "script") -> None:
        """Watch the pairs of a contact again, whoever allowed it.

        Raises
        ------
        NotAvailable
            The scene describes no such contact.
        """
        self._end_uses(name, None, source)

    @contextmanager
    def contact(self, name: str, *, source: str = "script") -> Iterator[None]:
        """Leave the pairs of a contact aside during a ``with`` block; may be nested.

        Raises
        ------
        NotAvailable
            The scene describes no such contact.
        """
        use = object()
        self._use(name, use, source)
        try:
            yield
        finally:
            self._end_uses(name, use, source)

    def _use(self, name: str, use: object, source: str) -> None:
        with self._lock:
            uses = self._uses_of(name)
            if use not in uses:
                uses.append(use)
            changed = self._renew_allowed()
        if changed:
            logger.info("the contact %r was allowed by %s", name, source)
            tell(self._listeners)

    def _end_uses(self, name: str, use: object | None, source: str) -> None:
        with self._lock:
            uses = self._uses_of(name)
            uses[:] = [] if use is None else [each for each in uses if each != use]
            changed = self._renew_allowed()
        if changed:
            logger.info("the contact %r was forbidden again by %s", name, source)
            tell(self._listeners)

    def _uses_of(self, name: str) -> list[object]:
        if name not in self._uses:
            known = ", ".join(self._uses) or "none"
            raise NotAvailable(f"the scene describes no contact {name!r}; it knows: {known}")
        return self._uses[name]

    def _renew_allowed(self) -> bool:
        before = self._allowed
        self._allowed = frozenset(name for name, uses in self._uses.items() if uses)
        self._ignored = frozenset(
            pair_of(*pair)
            for contact in self.model.contacts
            if contact.name in self._allowed
            for pair in contact.pairs
        )
        return self._allowed != before

    # Who is told, and who responds

    def subscribe(self, callback: Callable[[], object]) -> Callable[[], None]:
        """Call `callback` when axes are taken out or in, or contacts allowed or forbidden.

        Called in the thread of the change. Returns the function that ends it.
        """
        with self._lock:
            self._listeners = (*self._listeners, callback)

        def unsubscribe() -> None:
            with self._lock:
                self._listeners = tuple(each for each in self._listeners if each != callback)

        return unsubscribe

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
        with self._lock:
            callbacks = {key: each for key, each in self._callbacks.items() if key != pair}
            self._callbacks = callbacks if callback is None else {**callbacks, pair: callback}

    def set_default_callback(self, callback: CollisionCallbackBase) -> None:
        """Set the response of all pairs without their own."""
        self._default_callback = callback
