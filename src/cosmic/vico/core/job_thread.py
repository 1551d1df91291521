"""`JobThread`: does one thing after the other, in a thread that begins when it is needed."""

import logging
from collections.abc import Callable
from queue import SimpleQueue
from threading import Lock

from typing_extensions import override

from cosmic.frame.errors import CosmicError, NotAvailable
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.plan_shape import PlanStatus
from cosmic.frame.threads import WorkerThread

logger = logging.getLogger(__name__)

Job = Callable[[], None]


class JobThread(WorkerThread):
    """Carries out jobs and ends the status of each; `put` from any thread."""

    def __init__(self, name: str, policy: FailurePolicy) -> None:
        super().__init__(name, policy)
        self._jobs: SimpleQueue[tuple[Job, PlanStatus] | None] = SimpleQueue()
        self._putting = Lock()
        self._over = False

    def put(self, job: Job, status: PlanStatus) -> None:
        """Have `job` done; `status` fails with the `CosmicError` it raises."""
        with self._putting:
            over = self._over
            if not over:
                self._jobs.put((job, status))
                if not self.isRunning():
                    self.start()
        if over:
            status.fail(NotAvailable(f"{self.name} is closed"))

    @override
    def run_body(self) -> None:
        while True:
            item = self._jobs.get()
            if item is None:
                return
            job, status = item
            if self.end_requested:
                status.fail(NotAvailable(f"{self.name} is closed"))
                continue
            self._do(job, status)

    def _do(self, job: Job, status: PlanStatus) -> None:
        try:
            job()
        except CosmicError as exc:
            status.fail(exc)
        except Exception as exc:
            status.fail(exc)  # whoever waits for it must not wait for ever
            raise
        else:
            status.finish()

    @override
    def request_end(self) -> None:
        super().request_end()
        with self._putting:
            self._over = True
            self._jobs.put(None)
