"""`PlanSignal`: a value that plans of bluesky monitor, and that its suspenders watch."""

from abc import abstractmethod
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from threading import RLock

from cosmic.frame.errors import CosmicError
from cosmic.frame.events import Unsubscribe, notify
from cosmic.frame.plan_shape import unix_now_s


class PlanSignal:
    """Subscribable in the terms of bluesky, without importing it; any thread.

    ``bluesky.plan_stubs.monitor`` and the suspenders of ``bluesky.suspenders`` take it.
    """

    _subscribed: tuple[tuple[Callable[..., object], Unsubscribe], ...] = ()

    @abstractmethod
    def get(self) -> float:
        """Return the value, as a suspender compares it.

        Raises
        ------
        CosmicError
            There is none yet.
        """

    @abstractmethod
    def _on_news(self, listener: Callable[[], object]) -> Unsubscribe:
        """Have `listener` called at each new value."""

    def subscribe(
        self, function: Callable[..., object], event_type: object = None, run: bool = True
    ) -> Unsubscribe:
        """Call ``function(value=..., timestamp=..., obj=self)`` at each new value.

        It is called in the thread that has the value and must return at once. Returns the function
        that ends it, as `clear_sub` does.

        Parameters
        ----------
        event_type : object
            Bluesky's; there is one kind.
        run : bool
            Call it with the present value first, where there is one.
        """
        del event_type

        turn, over = RLock(), False

        def publish() -> None:
            with turn, suppress(CosmicError):
                if not over:
                    notify(function, value=self.get(), timestamp=unix_now_s(), obj=self)

        def end() -> None:
            nonlocal over
            forget()
            with turn:  # bluesky takes no event after the end of its run
                over = True

        self.clear_sub(function)
        forget = self._on_news(publish)
        self._subscribed = (*self._subscribed, (function, end))
        if run:
            publish()
        return partial(self.clear_sub, function)

    def clear_sub(self, function: Callable[..., object]) -> None:
        """End a subscription, and wait for a call under way; harmless where there is none."""
        ended = [end for each, end in self._subscribed if each == function]
        self._subscribed = tuple(each for each in self._subscribed if each[0] != function)
        for end in ended:
            end()
