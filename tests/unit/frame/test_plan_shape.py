"""What plans wait for ends once, whoever ends it, and says what became of it."""

import threading
from datetime import UTC, datetime

import pytest

from cosmic.frame.clock import WALL, ManualClock, RatedClock
from cosmic.frame.errors import DeviceTimeout, NotAvailable
from cosmic.frame.plan_shape import (
    PlanStatus,
    plain_name,
    unix_now_s,
    unix_of_platform_s,
    unix_of_wall_s,
)


def test_a_status_that_ends_well_says_so_to_all_once() -> None:
    status, heard = PlanStatus("a move"), list[object]()
    status.add_callback(heard.append)
    assert not status.done and not status.success
    assert status.finish()
    status.add_callback(heard.append)
    assert status.done and status.success and status.exception() is None
    assert heard == [status, status]


def test_a_status_that_fails_gives_the_reason() -> None:
    status = PlanStatus("a move")
    error = NotAvailable("nothing there")
    status.fail(error)
    assert status.done and not status.success
    assert status.exception(timeout=0) is error
    with pytest.raises(NotAvailable):
        status.wait()


@pytest.mark.parametrize("first", ["finish", "fail"])
def test_only_the_first_end_counts(first: str) -> None:
    status = PlanStatus("a move")
    if first == "finish":
        assert status.finish()
        assert not status.fail(NotAvailable("late"))
    else:
        assert status.fail(NotAvailable("first"))
        assert not status.finish()
    assert status.success is (first == "finish")


def test_a_status_ended_by_many_threads_is_reported_once() -> None:
    for _ in range(50):
        status, heard, ended = PlanStatus("a move"), list[object](), list[bool]()
        status.add_callback(heard.append)
        barrier = threading.Barrier(4)

        def end(
            status: PlanStatus = status,
            barrier: threading.Barrier = barrier,
            ended: list[bool] = ended,
        ) -> None:
            barrier.wait()
            ended.append(status.finish())

        threads = [threading.Thread(target=end) for _ in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert heard == [status]
        assert ended.count(True) == 1


def test_waiting_for_what_does_not_end_times_out() -> None:
    with pytest.raises(DeviceTimeout, match="a move"):
        PlanStatus("a move").exception(0.01)
    with pytest.raises(DeviceTimeout):
        PlanStatus("a move").exception()


def test_moments_of_our_clocks_are_reported_as_time_of_the_day() -> None:
    assert unix_now_s() == pytest.approx(datetime.now(UTC).timestamp(), abs=5.0)
    assert unix_of_wall_s(WALL.now_s() - 100.0) == pytest.approx(unix_now_s() - 100.0, abs=5.0)
    fast = RatedClock(50.0)
    assert unix_of_platform_s(fast, fast.now_s() - 5000.0) == pytest.approx(
        unix_now_s() - 100.0, abs=5.0
    )
    still = ManualClock()
    assert unix_of_platform_s(still, still.now_s()) == pytest.approx(unix_now_s(), abs=5.0)


def test_a_plain_name_has_no_dot() -> None:
    assert plain_name("left.x") == "left_x"
