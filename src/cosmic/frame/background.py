"""What may take a while, done in a thread of its own so that no window waits for it."""

from collections.abc import Callable
from typing import TypeVar

from cosmic.frame.errors import CosmicError
from cosmic.frame.job_queue import JobQueue
from cosmic.frame.operation import Operation

T = TypeVar("T")
OnResult = Callable[[T | None, CosmicError | None], object]
"""Takes the result of something, or why there is none."""


def do_and_report(action: Callable[[], T], told: OnResult[T]) -> None:
    """Do `action` now and tell its result, or the `CosmicError` that it raised."""
    try:
        result = action()
    except CosmicError as exc:
        told(None, exc)
    else:
        told(result, None)


class BackgroundJobs(JobQueue):
    """Does one after the other what a window must not wait for."""

    def do(self, action: Callable[[], T], told: OnResult[T]) -> None:
        """Have `action` done and `told` how it ended; returns at once, any thread."""

        def tell(ended: Operation[T]) -> None:
            error = ended.failure
            if error is None:
                told(ended.result, None)
            elif isinstance(error, CosmicError):
                told(None, error)
            else:
                told(None, CosmicError(f"{type(error).__name__}: {error}"))

        self.submit(action, "an errand").add_callback(tell)
