"""What everybody may rely on who is handed something that takes a while: `Operation`."""

import asyncio
import gc
import logging
import threading
import time
import weakref
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import pytest

from cosmic.frame.clock import Clock, ManualClock, WallClock
from cosmic.frame.errors import DeviceError, DeviceTimeout, WrongThreadError
from cosmic.frame.operation import Operation, Progress, Task
from cosmic.frame.plan_shape import PlanStatus
from cosmic.frame.threads import declare_gui_thread
from cosmic.mico.api.move_status import MoveStatus

BROKEN = DeviceError("left.x: no answer")

Make = Callable[[str], Operation[None]]


KINDS: list[Make] = [Operation, Task, PlanStatus, MoveStatus]


@pytest.fixture(params=KINDS)
def operation(request: pytest.FixtureRequest) -> Operation[None]:
    make: Make = request.param
    return make("the work")


def test_a_new_operation_has_neither_ended_nor_succeeded(operation: Operation[None]) -> None:
    assert (operation.done, operation.success, operation.failure) == (False, False, None)


def test_it_ends_well_once_and_stays_so(operation: Operation[None]) -> None:
    assert operation.finish(None)
    assert not operation.fail(BROKEN)
    assert not operation.finish(None)
    assert (operation.done, operation.success, operation.exception()) == (True, True, None)


def test_it_ends_badly_once_and_stays_so(operation: Operation[None]) -> None:
    assert operation.fail(BROKEN)
    assert not operation.finish(None)
    assert (operation.done, operation.success) == (True, False)
    assert operation.failure is operation.exception() is BROKEN


def test_the_result_is_what_it_finished_with() -> None:
    counted = Operation[int]("counting")
    counted.finish(42)
    assert (counted.wait(), counted.result) == (42, 42)


def test_the_result_of_what_still_runs_is_not_there(operation: Operation[None]) -> None:
    with pytest.raises(DeviceTimeout, match="had not ended"):
        _ = operation.result


def test_waiting_raises_what_it_failed_with(operation: Operation[None]) -> None:
    operation.fail(BROKEN)
    with pytest.raises(DeviceError, match=r"left\.x: no answer"):
        operation.wait()


def test_waiting_ends_with_it_in_another_thread(operation: Operation[None]) -> None:
    with ThreadPoolExecutor() as pool:
        waiting = [pool.submit(operation.wait, 20.0) for _ in range(3)]
        operation.finish(None)
        for each in waiting:
            each.result(20.0)


def test_of_many_threads_that_end_it_one_does(operation: Operation[None]) -> None:
    with ThreadPoolExecutor(8) as pool:
        ended = list(pool.map(lambda _: operation.finish(None), range(64)))
    assert ended.count(True) == 1


@pytest.mark.parametrize("clock", [WallClock(), ManualClock(auto_advance=True)])
def test_waiting_too_long_says_so_and_leaves_it_running(clock: Clock) -> None:
    operation = Operation[None]("the work", clock=clock)
    with pytest.raises(DeviceTimeout, match=r"the work had not ended after 0\.001 s"):
        operation.wait(0.001)
    with pytest.raises(DeviceTimeout):
        operation.exception()
    assert not operation.done


def test_its_timeout_is_counted_by_its_clock() -> None:
    clock = ManualClock(auto_advance=True)
    operation = Operation[None]("the work", clock=clock)
    began_s = time.monotonic()
    with pytest.raises(DeviceTimeout):
        operation.wait(3600.0)
    assert time.monotonic() - began_s < 60.0
    assert operation.progress.elapsed_s == pytest.approx(3600.0)


def test_it_ends_for_who_waits_by_the_clock_of_a_platform() -> None:
    operation = Operation[int]("the work", clock=ManualClock())
    with ThreadPoolExecutor() as pool:
        waiting = pool.submit(operation.wait, 3600.0)
        operation.finish(7)
        assert waiting.result(20.0) == 7


def test_no_window_waits_for_it_but_may_look(operation: Operation[None]) -> None:
    take_back = declare_gui_thread()
    try:
        with pytest.raises(WrongThreadError, match="the work"):
            operation.wait()
        with pytest.raises(DeviceTimeout):
            operation.wait(0.0)
        operation.finish(None)
        operation.wait()
    finally:
        take_back()


def test_who_asked_to_be_called_is_called_with_it_at_its_end(operation: Operation[None]) -> None:
    ended: list[tuple[Operation[None], bool]] = []
    operation.add_callback(lambda each: ended.append((each, each.done)))
    assert ended == []
    operation.finish(None)
    assert ended == [(operation, True)]


def test_who_asks_to_be_called_after_the_end_is_called_at_once(operation: Operation[None]) -> None:
    operation.fail(BROKEN)
    ended: list[Exception | None] = []
    operation.add_callback(lambda each: ended.append(each.failure))
    assert ended == [BROKEN]


def test_a_callback_that_fails_is_logged_and_keeps_no_other_from_being_called(
    operation: Operation[None], caplog: pytest.LogCaptureFixture
) -> None:
    ended: list[Operation[None]] = []
    operation.add_callback(lambda _each: 1 // 0)
    operation.add_callback(ended.append)
    with caplog.at_level(logging.ERROR, "cosmic"):
        operation.finish(None)
    assert ended == [operation]
    assert "ZeroDivisionError" in caplog.text


def test_cancelling_does_what_was_named_for_it_before_and_after(operation: Operation[None]) -> None:
    calls: list[str] = []
    operation.on_cancel(lambda: calls.append("stop"))
    assert not operation.cancel_requested
    operation.cancel()
    operation.on_cancel(lambda: calls.append("late"))
    assert (operation.cancel_requested, calls) == (True, ["stop", "late"])
    assert not operation.done


def test_cancelling_what_has_ended_stops_nothing(operation: Operation[None]) -> None:
    calls: list[str] = []
    operation.on_cancel(lambda: calls.append("stop"))
    operation.finish(None)
    operation.cancel()
    assert calls == []


def test_cancelling_does_not_wait_for_who_hears_slowly(operation: Operation[None]) -> None:
    entered, release = threading.Event(), threading.Event()

    def hear(progress: Progress) -> None:
        if progress.fraction > 0.0:
            entered.set()
            release.wait(20.0)

    operation.subscribe(hear)
    slow = threading.Thread(target=operation.report, args=(0.5, "half"))
    slow.start()
    assert entered.wait(20.0)
    operation.cancel()
    assert slow.is_alive()
    release.set()
    slow.join(20.0)


def test_it_says_how_far_it_is_from_the_beginning_to_the_end(operation: Operation[None]) -> None:
    heard: list[Progress] = []
    operation.subscribe(heard.append)
    operation.report(0.5, "left.x")
    operation.finish(None)
    assert [each.fraction for each in heard] == [0.0, 0.5, 1.0]
    assert [each.done for each in heard] == [False, False, True]
    assert (heard[1].title, heard[1].text, heard[2].error) == ("the work", "left.x", "")


def test_a_failure_is_the_last_that_is_heard(operation: Operation[None]) -> None:
    heard: list[Progress] = []
    operation.subscribe(heard.append)
    operation.report(0.25, "left.x")
    operation.fail(BROKEN)
    assert (heard[-1].fraction, heard[-1].done) == (0.25, True)
    assert heard[-1].error == "left.x: no answer"


def test_nothing_is_heard_after_the_subscription_ended(operation: Operation[None]) -> None:
    heard: list[Progress] = []
    operation.subscribe(heard.append)()
    operation.finish(None)
    assert len(heard) == 1


def test_it_says_what_it_is_and_how_it_stands(operation: Operation[None]) -> None:
    assert repr(operation) == "<the work: running>"
    operation.fail(BROKEN)
    assert repr(operation) == "<the work: left.x: no answer>"


# Awaited in an event loop


def test_who_awaits_it_gets_the_result_from_whichever_thread_ends_it() -> None:
    operation: Operation[float] = Operation("the movement")

    async def main() -> tuple[float, int]:
        ticks = 0

        async def tick() -> None:
            nonlocal ticks
            while not operation.done:
                ticks += 1
                await asyncio.sleep(0.001)

        ticking = asyncio.create_task(tick())
        threading.Timer(0.05, operation.finish, [5.0]).start()
        result = await operation
        await ticking
        return result, ticks

    result, ticks = asyncio.run(main())
    assert result == 5.0
    assert ticks > 3, "the loop was held up"


def test_who_awaits_what_has_ended_goes_on_and_what_fails_raises(
    operation: Operation[None],
) -> None:
    async def wait() -> None:
        await operation

    operation.fail(BROKEN)
    with pytest.raises(DeviceError, match="no answer"):
        asyncio.run(wait())


def test_a_task_that_is_cancelled_while_it_awaits_cancels_it(operation: Operation[None]) -> None:
    stopped = threading.Event()
    operation.on_cancel(stopped.set)

    async def give_up() -> None:
        async with asyncio.timeout(0.01):
            await operation

    with pytest.raises(TimeoutError):
        asyncio.run(give_up())
    assert stopped.is_set()
    assert operation.finish(None), "whoever carries it out ends it"


def test_several_await_it(operation: Operation[None]) -> None:
    async def wait() -> None:
        await operation

    async def main() -> None:
        waiting = [asyncio.create_task(wait()) for _ in range(3)]
        await asyncio.sleep(0)
        operation.finish(None)
        await asyncio.gather(*waiting)

    asyncio.run(main())


class Owner:
    """Holds its operation, and is held by what is called at the end of it."""

    def __init__(self) -> None:
        self.operation: Operation[None] = Operation("the work")
        self.operation.on_cancel(self.nothing)
        self.operation.add_callback(self.nothing)

    def nothing(self, _ended: object = None) -> None:
        """Do nothing."""


@pytest.mark.parametrize("error", [None, BROKEN])
def test_who_followed_what_has_ended_is_freed_without_the_collector(
    error: DeviceError | None,
) -> None:
    owner = Owner()
    gone = weakref.ref(owner)
    gc.disable()
    try:
        if error is None:
            owner.operation.finish(None)
        else:
            owner.operation.fail(error)
        del owner
        assert gone() is None
    finally:
        gc.enable()


def test_progress_that_is_no_number_is_named(operation: Operation[None]) -> None:
    with pytest.raises(TypeError, match="fraction"):
        operation.report("half", "somewhere")  # type: ignore[arg-type]
