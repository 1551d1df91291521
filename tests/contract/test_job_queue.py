"""What everybody may rely on who has jobs done one after the other: `JobQueue`."""

import threading
from collections.abc import Generator
from contextvars import ContextVar
from functools import partial

import pytest

from cosmic.frame.errors import (
    DeviceError,
    DeviceTimeout,
    NotAvailable,
    OperationCancelled,
)
from cosmic.frame.failure import Failure, FailurePolicy
from cosmic.frame.job_queue import JobQueue
from cosmic.frame.operation import Operation

SOON_S = 20.0


class Gate:
    """Holds a job up until it is opened."""

    def __init__(self) -> None:
        self.entered, self.opened = threading.Event(), threading.Event()

    def pass_through(self) -> None:
        self.entered.set()
        assert self.opened.wait(SOON_S)


@pytest.fixture
def policy() -> FailurePolicy:
    return FailurePolicy()


@pytest.fixture
def queue(policy: FailurePolicy) -> Generator[JobQueue]:
    queue = JobQueue("chores", policy)
    yield queue
    queue.request_end()
    assert queue.join()


@pytest.fixture
def gate(queue: JobQueue) -> Generator[Gate]:
    """Keep the queue's thread until it is opened."""
    gate = Gate()
    queue.submit(gate.pass_through, "the first")
    assert gate.entered.wait(SOON_S)
    yield gate
    gate.opened.set()


def test_its_thread_begins_with_the_first_job(queue: JobQueue) -> None:
    assert not queue.isRunning()
    name = queue.submit(lambda: threading.current_thread().name, "asking").wait(SOON_S)
    assert name == "chores"
    assert queue.isRunning()


def test_jobs_are_done_in_the_order_in_which_they_were_put(queue: JobQueue, gate: Gate) -> None:
    done: list[int] = []
    jobs = [queue.submit(partial(done.append, number), "noting") for number in range(20)]
    assert queue.waiting == 20
    gate.opened.set()
    jobs[-1].wait(SOON_S)
    assert done == list(range(20))


def test_a_job_ends_with_what_it_returns_or_raises(queue: JobQueue) -> None:
    def fail() -> None:
        raise DeviceError("left.x: no answer")

    failed = queue.submit(fail, "failing")
    assert queue.submit(lambda: 42, "counting").wait(SOON_S) == 42
    with pytest.raises(DeviceError, match="no answer"):
        failed.wait(SOON_S)


def test_a_job_may_end_an_operation_that_somebody_has_already(queue: JobQueue) -> None:
    operation = Operation[int]("counting")
    queue.put(lambda: 42, operation)
    assert operation.wait(SOON_S) == 42


@pytest.mark.defects
def test_a_defect_in_a_job_is_reported_and_the_next_is_done(
    queue: JobQueue, policy: FailurePolicy
) -> None:
    failures: list[Failure] = []
    policy.subscribe(failures.append)
    broken = queue.submit(lambda: 1 // 0, "dividing")
    assert queue.submit(lambda: 42, "counting").wait(SOON_S) == 42
    assert isinstance(broken.exception(), ZeroDivisionError)
    assert [(each.where, each.defect) for each in failures] == [("chores: dividing", True)]


def test_a_job_that_is_cancelled_before_its_turn_never_begins(queue: JobQueue, gate: Gate) -> None:
    begun: list[str] = []
    waiting = queue.submit(lambda: begun.append("waiting"), "waiting")
    after = queue.submit(lambda: begun.append("after"), "after")
    waiting.cancel()
    with pytest.raises(OperationCancelled, match="waiting was cancelled"):
        waiting.wait(0.0)
    gate.opened.set()
    after.wait(SOON_S)
    assert begun == ["after"]


def test_a_job_that_runs_hears_that_it_is_cancelled(queue: JobQueue) -> None:
    operation, begun, cancelled = Operation[bool]("waiting"), threading.Event(), threading.Event()
    operation.on_cancel(cancelled.set)

    def wait() -> bool:
        begun.set()
        return cancelled.wait(SOON_S)

    queue.put(wait, operation)
    assert begun.wait(SOON_S)
    operation.cancel()
    assert operation.wait(SOON_S)


def test_closing_drops_what_waits_at_once_and_says_so(queue: JobQueue, gate: Gate) -> None:
    begun: list[str] = []
    waiting = queue.submit(lambda: begun.append("waiting"), "waiting")
    queue.request_end()
    with pytest.raises(NotAvailable, match="chores: closed"):
        waiting.wait(0.0)
    gate.opened.set()
    assert queue.join()
    assert begun == []


def test_closing_cancels_the_job_that_runs(queue: JobQueue) -> None:
    operation, begun, cancelled = Operation[None]("waiting"), threading.Event(), threading.Event()
    operation.on_cancel(cancelled.set)

    def wait() -> None:
        begun.set()
        assert cancelled.wait(SOON_S)

    queue.put(wait, operation)
    assert begun.wait(SOON_S)
    queue.request_end()
    operation.wait(SOON_S)


def test_a_closed_queue_fails_every_job_and_begins_no_thread(policy: FailurePolicy) -> None:
    queue = JobQueue("chores", policy)
    queue.request_end()
    queue.request_end()
    with pytest.raises(NotAvailable, match="chores: closed"):
        queue.submit(lambda: 42, "counting").wait(0.0)
    assert not queue.isRunning()


def test_a_job_runs_in_the_context_of_who_put_it(queue: JobQueue) -> None:
    who: ContextVar[str] = ContextVar("who", default="nobody")
    token = who.set("left")
    job = queue.submit(who.get, "asking")
    who.reset(token)
    assert job.wait(SOON_S) == "left"
    assert queue.submit(who.get, "asking").wait(SOON_S) == "nobody"


@pytest.mark.defects
def test_nobody_waits_for_ever_when_a_job_ends_the_thread(
    queue: JobQueue, policy: FailurePolicy, gate: Gate
) -> None:
    def leave() -> None:
        raise SystemExit

    leaving, after = queue.submit(leave, "leaving"), queue.submit(lambda: 42, "counting")
    gate.opened.set()
    assert isinstance(leaving.exception(SOON_S), OperationCancelled)
    with pytest.raises(NotAvailable):
        after.wait(SOON_S)


def test_what_runs_is_not_ended_by_the_timeout_of_who_waits(queue: JobQueue, gate: Gate) -> None:
    waiting = queue.submit(lambda: 42, "counting")
    with pytest.raises(DeviceTimeout):
        waiting.wait(0.001)
    gate.opened.set()
    assert waiting.wait(SOON_S) == 42
