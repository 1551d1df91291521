"""An application that carries out long operations in its own thread, one at a time."""

import logging
from collections.abc import Callable
from threading import Lock

from PySide6.QtCore import QObject, Signal
from typing_extensions import override

from cosmic.frame.application import CosmicApplicationBase, GuiFactory
from cosmic.frame.errors import MoveCancelled, MoveRefused, NotAvailable
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.job_queue import Jobs
from cosmic.frame.operation import Task

logger = logging.getLogger(__name__)

Job = Callable[[Task], None]


class TaskApplication(CosmicApplicationBase):
    """Carries out what takes long in its own thread, and tells how far it is.

    Signals
    -------
    task_started(Task)
        A long operation began; widgets show its progress.
    """

    task_started = Signal(object)

    def __init__(
        self,
        title: str,
        policy: FailurePolicy,
        gui_factory: GuiFactory | None = None,
        parent: QObject | None = None,
    ) -> None:
        super().__init__(title, policy, gui_factory, parent)
        self._jobs = Jobs(title)
        self._running_task: Task | None = None
        self._beginning = Lock()

    @property
    def running_task(self) -> Task | None:
        """The long operation under way."""
        return self._running_task

    def begin(self, title: str, job: Job) -> Task:
        """Have `job(task)` carried out in the application's thread; returns at once.

        Raises
        ------
        NotAvailable
            Another long operation is under way, or the application is closed.
        """
        with self._beginning:
            running = self._running_task
            if running is not None and not running.done:
                raise NotAvailable(f"{running.title} is running; cancel it or wait for its end")
            if not self.isRunning() or self.end_requested:
                raise NotAvailable(f"{self.title} is closed")
            task = self._running_task = Task(title)
        if not self._jobs.put(lambda: _carry_out(job, task), task):
            raise NotAvailable(f"{self.title} is closed")
        self.task_started.emit(task)
        return task

    @override
    def custom_event_loop(self) -> bool:
        try:
            self._jobs.carry_out(_end_by)
        finally:
            self._jobs.close()
        return True

    @override
    def request_end(self) -> None:
        super().request_end()
        self._jobs.close()


def _carry_out(job: Job, task: Task) -> None:
    logger.info("%s started", task.title)
    try:
        job(task)
    except Exception as exc:
        task.fail(exc)
        raise
    finally:
        failure = task.failure
        if isinstance(failure, (MoveRefused, MoveCancelled)):
            logger.warning("%s ended: %s", task.title, failure)
        elif failure is not None:
            logger.error("%s ended: %s", task.title, failure)
        else:
            logger.info("%s finished", task.title)


def _end_by(error: Exception, _where: str) -> None:
    """Let a defect end the application's thread, which the policy then hears of."""
    raise error
