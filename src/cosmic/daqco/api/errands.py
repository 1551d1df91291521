"""What may take a while, done in a thread of its own so that no window waits for it."""

from collections.abc import Callable
from queue import SimpleQueue
from threading import Lock
from typing import TypeVar

from typing_extensions import override

from cosmic.frame.errors import CosmicError, NotAvailable
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.threads import WorkerThread

T = TypeVar("T")
Told = Callable[[T | None, CosmicError | None], object]
"""Takes the result of something, or why there is none."""


def do_and_tell(action: Callable[[], T], told: Told[T]) -> None:
    """Do `action` now and tell its result, or the `CosmicError` that it raised."""
    try:
        result = action()
    except CosmicError as exc:
        told(None, exc)
    else:
        told(result, None)


class Errands(WorkerThread):
    """Does one after the other what a window must not wait for; begins with the first."""

    def __init__(self, policy: FailurePolicy) -> None:
        super().__init__("DAQCo errands", policy)
        self._jobs: SimpleQueue[Callable[[], None] | None] = SimpleQueue()
        self._giving = Lock()
        self._over = False

    def do(self, action: Callable[[], T], told: Told[T]) -> None:
        """Have `action` done and `told` how it ended; returns at once, any thread."""
        with self._giving:
            over = self._over
            if not over:
                self._jobs.put(lambda: do_and_tell(lambda: self._guarded(action), told))
                if not self.isRunning():
                    self.start()
        if over:
            told(None, NotAvailable("DAQCo is closed"))

    def _guarded(self, action: Callable[[], T]) -> T:
        """Do `action`; a mistake in the program is reported, and told to who waits for it."""
        try:
            return action()
        except CosmicError:
            raise
        except Exception as exc:
            failure = self._policy.report(exc, "an errand for DAQCo")
            raise CosmicError(failure.text) from exc

    @override
    def run_body(self) -> None:
        while (job := self._jobs.get()) is not None:
            job()

    @override
    def request_end(self) -> None:
        super().request_end()
        with self._giving:
            if not self._over:
                self._over = True
                self._jobs.put(None)
