"""Jobs are done one after the other, and nobody waits for one that will not be done."""

from threading import Event

import pytest

from cosmic.frame.errors import NotAvailable
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.plan_shape import PlanStatus
from cosmic.vico.core.job_thread import JobThread


def test_jobs_are_done_in_their_order_in_a_thread_that_begins_with_the_first() -> None:
    thread, done = JobThread("jobs", FailurePolicy()), list[int]()
    assert not thread.isRunning()
    statuses = [PlanStatus(f"job {number}") for number in range(5)]
    for number, status in enumerate(statuses):
        thread.put(lambda number=number: done.append(number), status)
    for status in statuses:
        status.wait(5.0)
    assert done == [0, 1, 2, 3, 4]
    thread.request_end()
    assert thread.join()


def test_a_job_that_fails_fails_its_own_status_only() -> None:
    thread = JobThread("jobs", FailurePolicy())

    def fail() -> None:
        raise NotAvailable("no picture")

    bad, good = PlanStatus("bad"), PlanStatus("good")
    thread.put(fail, bad)
    thread.put(lambda: None, good)
    good.wait(5.0)
    with pytest.raises(NotAvailable):
        bad.wait()
    thread.request_end()
    assert thread.join()


def test_jobs_that_will_not_be_done_fail() -> None:
    thread, go_on, begun = JobThread("jobs", FailurePolicy()), Event(), Event()

    def wait() -> None:
        begun.set()
        go_on.wait(5.0)

    running, waiting, late = PlanStatus("running"), PlanStatus("waiting"), PlanStatus("late")
    thread.put(wait, running)
    thread.put(lambda: None, waiting)
    assert begun.wait(5.0)
    thread.request_end()
    thread.put(lambda: None, late)
    go_on.set()
    assert thread.join()
    assert running.success
    assert isinstance(waiting.exception(), NotAvailable)
    assert isinstance(late.exception(), NotAvailable)
