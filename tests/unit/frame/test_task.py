"""Something that takes a while."""

from concurrent.futures import ThreadPoolExecutor

import pytest

from cosmic.frame.errors import DeviceError, DeviceTimeout, WrongThreadError
from cosmic.frame.operation import Progress, Task
from cosmic.frame.threads import declare_gui_thread


@pytest.fixture
def task() -> Task:
    return Task("Initialisation")


def test_a_task_says_how_far_it_is(task: Task) -> None:
    heard: list[Progress] = []
    task.subscribe(heard.append)
    task.report(0.5, "left.x")
    task.finish()
    assert [each.fraction for each in heard] == [0.0, 0.5, 1.0]
    assert [each.done for each in heard] == [False, False, True]
    assert (heard[1].title, heard[1].text, heard[1].error) == ("Initialisation", "left.x", "")


def test_the_time_left_is_reported_only_once_something_can_be_said(task: Task) -> None:
    assert task.progress.left_s is None
    task.report(0.5, "half")
    left_s = task.progress.left_s
    assert left_s is not None
    assert 0.0 <= left_s < 60.0


@pytest.mark.parametrize(("reported", "shown"), [(-1.0, 0.0), (2.0, 1.0)])
def test_progress_stays_between_nothing_and_all(task: Task, reported: float, shown: float) -> None:
    task.report(reported, "x")
    assert task.progress.fraction == shown


def test_waiting_ends_with_the_task_in_another_thread(task: Task) -> None:
    with ThreadPoolExecutor() as pool:
        waiting = pool.submit(task.wait, 20.0)
        task.finish()
        waiting.result(20.0)
    assert task.done


def test_waiting_raises_what_the_task_failed_with(task: Task) -> None:
    task.fail(DeviceError("left.x: no answer"))
    with pytest.raises(DeviceError, match=r"left\.x: no answer"):
        task.wait()
    assert (task.done, task.progress.error) == (True, "left.x: no answer")


def test_waiting_too_long_says_so_and_leaves_the_task_running(task: Task) -> None:
    with pytest.raises(DeviceTimeout, match=r"Initialisation had not ended after 0\.001 s"):
        task.wait(0.001)
    assert not task.done


def test_waiting_is_forbidden_in_the_gui_thread_while_the_task_runs(task: Task) -> None:
    take_back = declare_gui_thread()
    with pytest.raises(WrongThreadError):
        task.wait()
    task.finish()
    task.wait()
    take_back()


def test_cancelling_is_seen_and_carried_out(task: Task) -> None:
    calls: list[str] = []
    task.on_cancel(lambda: calls.append("stop"))
    assert not task.cancel_requested
    task.cancel()
    task.on_cancel(lambda: calls.append("late"))
    assert (task.cancel_requested, calls) == (True, ["stop", "late"])


def test_cancelling_a_task_that_has_ended_stops_nothing(task: Task) -> None:
    calls: list[str] = []
    task.on_cancel(lambda: calls.append("stop"))
    task.finish()
    task.cancel()
    assert calls == []
