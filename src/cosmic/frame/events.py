"""`Event`: whoever wants to hear of something subscribes; none may harm the others."""

import logging
from collections.abc import Callable
from threading import Lock
from typing import Generic, ParamSpec

logger = logging.getLogger(__name__)

P = ParamSpec("P")

Unsubscribe = Callable[[], None]
"""Ends a subscription; harmless the second time."""


def notify(subscriber: Callable[P, object], *args: P.args, **kwargs: P.kwargs) -> None:
    """Call `subscriber`; what it raises is logged, and harms nobody else."""
    try:
        subscriber(*args, **kwargs)
    except Exception:
        logger.exception("a subscriber failed: %r", subscriber)


class Event(Generic[P]):
    """Something that happens again and again, of which others want to hear; any thread.

    ``Event[CameraImage]`` hands on an image, ``Event[[]]`` says only that something happened.

    Subscribers are called one after the other, in the order in which they subscribed, in the
    thread that emits. They must return at once. One that raises is logged, and keeps nobody else
    from hearing. Emitting takes no lock, so that a stop may pass through an event while other
    threads emit, subscribe or hear of something slowly.

    Parameters
    ----------
    whose : str
        What the log calls a subscriber that fails, such as "a safe stop".
    """

    __slots__ = ("_changing", "_subscribers", "_whose")

    def __init__(self, whose: str = "a subscriber") -> None:
        self._whose = whose
        self._changing = Lock()
        self._subscribers: tuple[Callable[P, object], ...] = ()

    def subscribe(self, subscriber: Callable[P, object]) -> Unsubscribe:
        """Call `subscriber` whenever this is emitted; returns the function that ends it.

        Each subscription is one of its own, also where the same callable is subscribed twice. An
        emission under way in another thread may still reach a subscriber that has just ended.

        Raises
        ------
        TypeError
            It cannot be called.
        """
        if not callable(subscriber):
            raise TypeError(f"subscriber must be callable, not {subscriber!r:.60}")
        with self._changing:
            self._subscribers = (*self._subscribers, subscriber)
        ended = False

        def unsubscribe() -> None:
            nonlocal ended
            with self._changing:
                if not ended:
                    ended = True
                    self._subscribers = _without_one(self._subscribers, subscriber)

        return unsubscribe

    def __len__(self) -> int:
        """Return how many hear of it, for who can spare the work where nobody does."""
        return len(self._subscribers)

    def emit(self, *args: P.args, **kwargs: P.kwargs) -> None:
        """Tell all subscribers."""
        for subscriber in self._subscribers:
            try:
                subscriber(*args, **kwargs)
            except Exception:
                logger.exception("%s failed: %r", self._whose, subscriber)


def _without_one(
    subscribers: tuple[Callable[P, object], ...], subscriber: Callable[P, object]
) -> tuple[Callable[P, object], ...]:
    for index, each in enumerate(subscribers):
        if each is subscriber:
            return subscribers[:index] + subscribers[index + 1 :]
    return subscribers
