"""`JobQueue`: one thread that does one job after the other, each an `Operation`."""

from collections.abc import Callable
from contextvars import copy_context
from functools import partial
from queue import SimpleQueue
from threading import Lock
from typing import TypeVar

from typing_extensions import override

from cosmic.frame.errors import CosmicError, NotAvailable, OperationCancelled
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.operation import Operation
from cosmic.frame.threads import WorkerThread

T = TypeVar("T")


class _Job:
    """An action and the operation that it is; it either begins or is dropped."""

    def __init__(self, action: Callable[[], T], operation: Operation[T]) -> None:
        self.title = operation.title
        self.cancel = operation.cancel
        self._fail = operation.fail
        self._carry_out = partial(copy_context().run, _carry_out, action, operation)
        self._lock = Lock()
        self._taken = False

    def _take(self) -> bool:
        """Claim it, to begin it or to drop it; False where that was done before."""
        with self._lock:
            first, self._taken = not self._taken, True
        return first

    def drop(self, error: CosmicError) -> None:
        """End it without having begun; harmless where it has."""
        if self._take():
            self._fail(error)

    def carry_out(self) -> None:
        """Do it, unless it was dropped; raises what is a mistake in the program."""
        if self._take():
            self._carry_out()


def _carry_out(action: Callable[[], T], operation: Operation[T]) -> None:
    try:
        result = action()
    except CosmicError as exc:
        operation.fail(exc)
    except Exception as exc:
        operation.fail(exc)  # whoever waits for it must not wait for ever
        raise
    except BaseException as exc:
        operation.fail(OperationCancelled(f"{operation.title}: {type(exc).__name__}"))
        raise
    else:
        operation.finish(result)


class Jobs:
    """Jobs in their order, for one thread to carry out; any thread may put more.

    What a job returns is the result of its operation, what it raises the failure. A job runs in the
    context of whoever put it. Cancelled before its turn it never begins; later it ends where it
    looks at `Operation.cancel_requested`, or by what it named with `Operation.on_cancel`.
    """

    def __init__(self, name: str) -> None:
        self._name = name
        self._lock = Lock()
        self._closed = False
        self._waiting: SimpleQueue[_Job | None] = SimpleQueue()
        self._running: _Job | None = None

    @property
    def waiting(self) -> int:
        """How many have not begun; it may have changed by now."""
        return self._waiting.qsize()

    def put(self, action: Callable[[], T], operation: Operation[T]) -> bool:
        """Have `action` carried out, which ends `operation`; returns at once.

        False where the queue is closed: `operation` has failed then.
        """
        job = _Job(action, operation)
        with self._lock:
            closed = self._closed
            if not closed:
                self._waiting.put(job)
        if closed:
            job.drop(self._refusal())
        else:
            operation.on_cancel(lambda: job.drop(_cancelled(operation)))
        return not closed

    def carry_out(self, on_defect: Callable[[Exception, str], object]) -> None:
        """Do one after the other until `close`; in the one thread that does.

        `on_defect` gets what is a mistake in the program, and where it was; it may raise to end.
        """
        while (job := self._waiting.get()) is not None:
            self._running = job
            try:
                job.carry_out()
            except Exception as exc:  # noqa: BLE001 - the others must have their turn
                on_defect(exc, f"{self._name}: {job.title}")
            self._running = None

    def close(self) -> None:
        """Drop what waits, and cancel what runs; returns at once, harmless the second time."""
        with self._lock:
            self._closed = True
            dropped = []
            while not self._waiting.empty():
                dropped.append(self._waiting.get_nowait())
            self._waiting.put(None)
        running = self._running
        if running is not None:
            running.cancel()
        for job in dropped:
            if job is not None:
                job.drop(self._refusal())

    def _refusal(self) -> NotAvailable:
        return NotAvailable(f"{self._name}: closed")


class JobQueue(WorkerThread):
    """A thread that does one job after the other; it begins with the first. See `Jobs`.

    A mistake in the program goes to the policy, and the next job begins all the same.
    """

    def __init__(self, name: str, policy: FailurePolicy) -> None:
        super().__init__(name, policy)
        self._jobs = Jobs(name)
        self._starting = Lock()

    @property
    def waiting(self) -> int:
        """How many jobs have not begun; it may have changed by now."""
        return self._jobs.waiting

    def submit(self, action: Callable[[], T], title: str) -> Operation[T]:
        """Have `action` carried out in the thread; returns at once. See `put`."""
        operation: Operation[T] = Operation(title)
        self.put(action, operation)
        return operation

    def put(self, action: Callable[[], T], operation: Operation[T]) -> None:
        """Have `action` carried out in the thread, which ends `operation`; returns at once.

        Where the queue is closed, or closes before its turn, it fails with `NotAvailable`.
        """
        if self._jobs.put(action, operation):
            with self._starting:
                if not (self.isRunning() or self.end_requested):
                    self.start()

    @override
    def run_body(self) -> None:
        try:
            self._jobs.carry_out(self._policy.report)
        finally:
            self._jobs.close()

    @override
    def on_fork(self) -> None:
        super().on_fork()
        self._jobs, self._starting = Jobs(self.name), Lock()  # whoever held a lock is not here
        self._jobs.close()

    @override
    def request_end(self) -> None:
        with self._starting:
            super().request_end()
        self._jobs.close()


def _cancelled(operation: Operation[T]) -> OperationCancelled:
    return OperationCancelled(f"{operation.title} was cancelled before it started")
