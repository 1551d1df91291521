"""What may take a while, done in a thread of its own so that no window waits for it."""

from collections.abc import Callable
from typing import TypeVar

from cosmic.frame.errors import CosmicError
from cosmic.frame.job_queue import JobQueue
from cosmic.frame.operation import Operation

T = TypeVar("T")
OnResult = Callable[[T | None, CosmicError | None], object]
"""Takes the result of something, or why there is none."""


def do_and_report(action: Callable[[], T], on_result: OnResult[T]) -> None:
    """Do `action` now and tell its result, or the `CosmicError` that it raised."""
    try:
        result = action()
    except CosmicError as exc:
        on_result(None, exc)
    else:
        on_result(result, None)


class BackgroundJobs(JobQueue):
    """Does one after the other what a window must not wait for."""

    def do(self, action: Callable[[], T], on_result: OnResult[T]) -> None:
        """Have `action` done and `on_result` how it ended; returns at once, any thread."""

        def report(ended: Operation[T]) -> None:
            error = ended.failure
            if error is None:
                on_result(ended.result, None)
            elif isinstance(error, CosmicError):
                on_result(None, error)
            else:
                on_result(None, CosmicError(f"{type(error).__name__}: {error}"))

        self.submit(action, "a background job").add_callback(report)
