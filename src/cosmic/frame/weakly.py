"""Connections of signals that keep nobody alive."""

from collections.abc import Callable
from weakref import WeakMethod


def weakly(method: Callable[[], object]) -> Callable[[], None]:
    """Return what calls a bound method as long as its object lives; any thread.

    A signal keeps a plain function that is connected to it, where no collection of garbage sees
    it: a function that knows the owner of the signal keeps both for ever.
    """
    weak = WeakMethod(method)

    def call() -> None:
        alive = weak()
        if alive is not None:
            alive()

    return call
