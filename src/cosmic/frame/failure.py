"""One way from a failure to the log, the operator and a safe stop.

See docs/explanation/errors.md for the policy that this module enforces.
"""

import logging
from collections.abc import Callable
from dataclasses import dataclass
from threading import local
from typing import ParamSpec, TypeVar

from cosmic.frame.errors import CosmicError
from cosmic.frame.events import Event, Unsubscribe

logger = logging.getLogger(__name__)

P = ParamSpec("P")
R = TypeVar("R")


@dataclass(frozen=True, slots=True)
class Failure:
    """One failure, as the operator is told of it.

    Attributes
    ----------
    where : str
        The place, such as "thread 'device 0'" or "window".
    text : str
        What happened, in one line, without a traceback.
    defect : bool
        True when nobody foresaw it: a mistake in the program, and a reason to stop all motion.
    """

    where: str
    text: str
    defect: bool


class _Entered(local):
    """What this thread is doing now, so that a failure of it does not start it again."""

    stopping = False
    publishing = False


class FailurePolicy:
    """Receives every failure that nothing else handled; any thread.

    A defect (any exception that is no `CosmicError`) and the death of a thread stop all motion.
    A `CosmicError` is foreseen: it is logged and told, and the hardware is left as it is.
    """

    def __init__(self) -> None:
        self._safe_stop: Event[str] = Event("a safe stop")
        self._failed: Event[Failure] = Event("a failure listener")
        self._entered = _Entered()

    def on_safe_stop(self, stop: Callable[[str], object]) -> Unsubscribe:
        """Call `stop(reason)` when motion must end; returns the function that undoes it."""
        return self._safe_stop.subscribe(stop)

    def subscribe(self, listener: Callable[[Failure], object]) -> Unsubscribe:
        """Call `listener` with each failure, in the thread where it happened."""
        return self._failed.subscribe(listener)

    def report(self, error: BaseException, where: str, *, thread_died: bool = False) -> Failure:
        """Log `error` with its traceback, stop what must stop, and tell the operator."""
        defect = not isinstance(error, CosmicError)
        text = str(error) or type(error).__name__
        if defect:
            text = f"{type(error).__name__}: {text}"
        failure = Failure(where=where, text=text, defect=defect)
        if defect or thread_died:
            self._stop_everything(f"{where}: {text}")
        logger.error("%s: %s", where, text, exc_info=error if defect else None)
        self._publish(failure)
        return failure

    def _stop_everything(self, reason: str) -> None:
        if self._entered.stopping:
            return
        self._entered.stopping = True
        try:
            self._safe_stop.emit(reason)
        finally:  # also after Ctrl-C: the next failure must stop as well
            self._entered.stopping = False

    def _publish(self, failure: Failure) -> None:
        if self._entered.publishing:
            return
        self._entered.publishing = True
        try:
            self._failed.emit(failure)
        finally:
            self._entered.publishing = False

    def guarded(self, where: str, function: Callable[P, R], fallback: R) -> Callable[P, R]:
        """Wrap a driver callback, out of which no exception may escape into C code."""

        def call(*args: P.args, **kwargs: P.kwargs) -> R:
            try:
                return function(*args, **kwargs)
            except Exception as exc:  # noqa: BLE001 - the edge to foreign code
                self.report(exc, where)
                return fallback

        return call
