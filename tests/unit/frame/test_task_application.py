"""One long operation at a time, whoever asks for it."""

from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from threading import Barrier, BrokenBarrierError, Event

from typing_extensions import override

from cosmic.frame.errors import NotAvailable
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.operation import Task
from cosmic.frame.task_application import TaskApplication


class AskedTwice(TaskApplication):
    """Lets two who ask at the same moment get as far as they can together."""

    both: Barrier | None = None

    @override
    def isRunning(self) -> bool:
        if self.both is not None:
            with suppress(BrokenBarrierError):
                self.both.wait(1.0)
        return super().isRunning()


def test_of_two_operations_begun_at_the_same_moment_one_is_refused() -> None:
    application = AskedTwice("Platform", FailurePolicy())
    application.start()
    application.both = Barrier(2)
    over, carried_out = Event(), list[str]()

    def job(task: Task) -> None:
        carried_out.append(task.title)
        over.wait(10.0)
        task.finish()

    def begun(title: str) -> Task | None:
        try:
            return application.begin(title, job)
        except NotAvailable:
            return None

    try:
        with ThreadPoolExecutor() as pool:
            asked = [pool.submit(begun, title) for title in ("Rescan", "Initialisation")]
            tasks = [each.result(10.0) for each in asked]
        over.set()
        for task in tasks:
            if task is not None:
                task.wait(10.0)
    finally:
        application.both = None
        over.set()
        application.shut_down()
    assert len(carried_out) == 1
    assert tasks.count(None) == 1
