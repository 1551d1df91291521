"""An application that carries out long operations in its own thread, one at a time."""

import logging
from collections.abc import Callable
from contextvars import copy_context
from queue import SimpleQueue
from threading import Lock

from PySide6.QtCore import QObject, Signal
from typing_extensions import override

from cosmic.frame.application import CosmicApplicationBase, GuiFactory
from cosmic.frame.errors import MoveCancelled, MoveRefused, NotAvailable
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.task import Task

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
        self._jobs: SimpleQueue[tuple[Task, Job] | None] = SimpleQueue()
        self._running_task: Task | None = None
        self._taking = Lock()
        self._over = False

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
        running = self._running_task
        if running is not None and not running.done:
            raise NotAvailable(f"{running.title} is under way; cancel it or wait for its end")
        if not self.isRunning() or self.end_requested:
            raise NotAvailable(f"{self.title} is closed")
        task = Task(title)
        self._running_task = task
        with self._taking:
            if self._over:
                raise NotAvailable(f"{self.title} is closed")
            # It is carried out as whoever began it, who may be another process.
            context = copy_context()
            self._jobs.put((task, lambda task: context.run(job, task)))
        self.task_started.emit(task)
        return task

    @override
    def custom_event_loop(self) -> bool:
        try:
            self._work()
        finally:
            self._give_up_jobs()
        return True

    def _give_up_jobs(self) -> None:
        """Leave nobody waiting for a task that will not be begun."""
        with self._taking:
            self._over = True
        while not self._jobs.empty():
            item = self._jobs.get_nowait()
            if item is not None:
                item[0].fail(NotAvailable(f"{self.title} is closed"))

    def _work(self) -> None:
        while not self.end_requested:
            item = self._jobs.get()
            if item is None:
                continue
            task, job = item
            logger.info("%s started", task.title)
            try:
                job(task)
            except Exception as exc:
                task.fail(exc)  # whoever waits for it must not wait for ever
                raise
            failure = task.failure
            if isinstance(failure, (MoveRefused, MoveCancelled)):
                logger.warning("%s ended: %s", task.title, failure)
            elif failure is not None:
                logger.error("%s ended: %s", task.title, failure)
            else:
                logger.info("%s finished", task.title)

    @override
    def request_end(self) -> None:
        super().request_end()
        if self._running_task is not None:
            self._running_task.cancel()
        self._jobs.put(None)
