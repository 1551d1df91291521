"""What every transport promises, in one process and between two ends of a line."""

import logging
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from datetime import UTC, datetime
from typing import Any

import numpy as np
import pytest

from contract.station_rig import VERDICT, StationRig, station_rig, wait_until
from cosmic.frame.clock import WALL
from cosmic.frame.errors import (
    CollisionError,
    DeviceError,
    DeviceFault,
    MoveRefused,
    NotAvailable,
    UnknownAxisError,
    WrongThreadError,
)
from cosmic.frame.network.errors import (
    CallRefused,
    CommandExpired,
    RemoteDefect,
    StationAway,
    StationTimeout,
)
from cosmic.frame.network.transport import Presence, Rule
from cosmic.frame.operation import Progress
from cosmic.frame.threads import declare_gui_thread
from cosmic.frame.verdict import Reason


@pytest.fixture(params=["memory", "zenoh"])
def rig(request: pytest.FixtureRequest) -> Iterator[StationRig]:
    with station_rig(request.param) as made:
        yield made


# --- calls ------------------------------------------------------------------------------------


def test_a_call_returns_what_the_function_returns(rig: StationRig) -> None:
    assert rig.client.call("stage", "add", {"a": 2.0, "b": 0.5}) == 2.5
    assert rig.client.call("stage", "add", {"a": 2}) == 3.0
    assert rig.client.call("stage", "count") == 0


VALUES: list[Any] = [
    None,
    True,
    -(2**63),
    1.5,
    "µm",
    b"\0\1",
    [1, "a", None],
    (1, (2.0, "b")),
    {"a": [1, 2], 3: (4,)},
    datetime(2026, 11, 21, 12, 30, tzinfo=UTC),
    Reason.LIMIT,
    VERDICT,
]


def test_values_arrive_as_they_are(rig: StationRig) -> None:
    for value in VALUES:
        back = rig.client.call("stage", "echo", {"value": value})
        assert back == value
        assert type(back) is type(value)


def test_arrays_arrive_with_their_type_and_shape(rig: StationRig) -> None:
    for sent in (np.arange(6.0).reshape(2, 3), np.zeros((0, 4), np.uint16), np.array(1 + 2j)):
        back: Any = rig.client.call("stage", "echo", {"value": sent})
        assert back.dtype == sent.dtype
        assert np.array_equal(back, sent)
    image: Any = rig.client.call("stage", "image", {"rows": 300})
    assert image.shape == (300, 4)


REFUSED_CALLS: list[tuple[str, str, dict[Any, Any]]] = [
    ("stage", "hidden", {}),
    ("stage", "__class__", {}),
    ("stage", "__init__", {}),
    ("stage", "nothing", {}),
    ("nothing", "add", {"a": 1.0}),
    ("stage", "add", {}),
    ("stage", "add", {"a": 1.0, "c": 2.0}),
    ("stage", "add", {"a": "1.0"}),
    ("stage", "add", {"a": True}),
    ("stage", "add", {"a": None}),
    ("stage", "image", {"rows": 1.0}),
]


def test_what_is_not_offered_is_refused_and_nothing_else_is_disturbed(rig: StationRig) -> None:
    for application, function, arguments in REFUSED_CALLS:
        with pytest.raises(CallRefused):
            rig.client.call(application, function, arguments)
    assert rig.client.call("stage", "add", {"a": 1.0}) == 2.0
    assert not rig.failures


# --- exceptions -------------------------------------------------------------------------------


def test_a_refused_move_comes_back_with_its_verdict(rig: StationRig) -> None:
    with pytest.raises(CollisionError, match="would touch the table") as caught:
        rig.client.call("stage", "refuse")
    assert caught.value.verdict == VERDICT


def test_a_failed_device_comes_back_with_its_fault(rig: StationRig) -> None:
    with pytest.raises(DeviceError, match="device 1 hangs") as caught:
        rig.client.call("stage", "break_device")
    error = caught.value
    assert (error.fault, error.code, error.device) == (DeviceFault.TIMEOUT, 5, 1)
    assert error.channel is None


def test_an_exception_with_parameters_of_its_own_keeps_its_text(rig: StationRig) -> None:
    with pytest.raises(UnknownAxisError) as caught:
        rig.client.call("stage", "ask_axis")
    assert str(caught.value) == "there is no axis 'left.q'; known axes: left.x"


@pytest.mark.defects
def test_a_mistake_in_the_program_is_reported_there_and_shown_here(rig: StationRig) -> None:
    with pytest.raises(RemoteDefect, match="ZeroDivisionError"):
        rig.client.call("stage", "be_wrong")
    assert [failure.defect for failure in rig.failures] == [True]
    assert "called by vision" in rig.failures[0].where
    assert rig.client.call("stage", "add", {"a": 1.0}) == 2.0


# --- one after the other ----------------------------------------------------------------------


def test_only_calls_to_the_same_application_wait_for_each_other(rig: StationRig) -> None:
    with ThreadPoolExecutor(3) as pool:
        calls = [pool.submit(rig.client.call, "stage", "wait_here") for _ in range(2)]
        assert rig.application.entered.wait(5.0)
        assert rig.client.call("camera", "add", {"a": 1.0}) == 2.0
        rig.application.go_on.set()
        assert [call.result(5.0) for call in calls] == ["done", "done"]
    assert rig.application.most_together == 1


def test_a_stop_waits_for_nobody_and_needs_no_lease(rig: StationRig) -> None:
    with ThreadPoolExecutor(1) as pool:
        call = pool.submit(rig.client.call, "stage", "wait_here")
        assert rig.application.entered.wait(5.0)
        rig.client.call("stage", "stop")
        assert rig.application.stops == 1
        assert not call.done()
        rig.application.go_on.set()
        call.result(5.0)


def test_a_stop_is_carried_out_whatever_it_is_given(rig: StationRig) -> None:
    for given in ({"reason": 5}, {"": None}):
        rig.client.call("stage", "stop", given)
    assert rig.application.stops == 2


def test_what_waited_too_long_is_not_carried_out(rig: StationRig) -> None:
    rig.client.take_lease()
    with ThreadPoolExecutor(2) as pool:
        blocking = pool.submit(rig.client.call, "stage", "wait_here", timeout_s=10.0)
        assert rig.application.entered.wait(5.0)
        late = pool.submit(rig.client.call, "stage", "move", {"target_um": 1.0}, timeout_s=0.15)
        with pytest.raises((CommandExpired, StationTimeout)):
            late.result(5.0)
        rig.application.go_on.set()
        blocking.result(5.0)
    assert rig.client.call("stage", "add", {"a": 1.0}) == 2.0  # has passed behind the late one
    assert rig.application.moved == []


# --- the lease --------------------------------------------------------------------------------


def test_moving_needs_the_lease(rig: StationRig) -> None:
    with pytest.raises(MoveRefused) as caught:
        rig.client.call("stage", "move", {"target_um": 1.0})
    assert caught.value.verdict.reason is Reason.NO_LEASE
    rig.client.take_lease()
    assert rig.client.call("stage", "move", {"target_um": 1.0}) == 1.0
    assert rig.application.callers == ["vision"]
    rig.client.release_lease()
    with pytest.raises(MoveRefused):
        rig.client.call("stage", "move", {"target_um": 2.0})
    assert rig.application.moved == [1.0]


def test_one_holds_the_lease_at_a_time(rig: StationRig) -> None:
    other = rig.another("other")
    rig.client.take_lease()
    with pytest.raises(MoveRefused, match="held by vision"):
        other.take_lease()
    assert rig.station.lease.state.holder == "vision"
    rig.client.release_lease()
    other.take_lease()
    assert other.call("stage", "move", {"target_um": 1.0}) == 1.0


def test_the_local_operator_takes_over_and_what_moved_has_to_stop(rig: StationRig) -> None:
    rig.client.take_lease()
    rig.client.call("stage", "move", {"target_um": 1.0})
    dead_man = rig.application.dead_man
    assert dead_man is not None
    assert not dead_man.expired
    rig.station.lease.take_over()
    assert dead_man.expired
    assert "took over" in dead_man.why
    with pytest.raises(MoveRefused):
        rig.client.call("stage", "move", {"target_um": 2.0})
    with pytest.raises(MoveRefused):
        rig.client.take_lease()
    rig.station.lease.offer()
    rig.client.take_lease()
    assert dead_man.expired, "a new lease revives no old motion"


def test_what_fails_to_be_cancelled_leaves_nothing_else_moving(rig: StationRig) -> None:
    def fail() -> None:
        raise DeviceError("the line to the stage is cut")

    other = rig.another("other")
    for end in (rig.station.lease.take_over, other.close):
        rig.station.lease.offer()
        other.take_lease()
        rig.application.tasks.clear()
        for _ in range(3):
            other.call("stage", "travel")
        first, *rest = rig.application.tasks
        first.on_cancel(fail)
        end()
        assert wait_until(lambda: all(each.done for each in rest), 5.0)  # noqa: B023


def test_closing_gives_the_lease_back_and_stops_what_moves(rig: StationRig) -> None:
    other = rig.another("other")
    other.take_lease()
    other.call("stage", "move", {"target_um": 1.0})
    dead_man = rig.application.dead_man
    assert dead_man is not None
    other.close()
    assert wait_until(lambda: dead_man.expired)
    assert wait_until(lambda: rig.station.lease.state.local)
    with pytest.raises(StationAway):
        other.call("stage", "add", {"a": 1.0})


def test_every_command_is_in_the_log_with_who_sent_it(
    rig: StationRig, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.DEBUG, "cosmic.frame.network"):
        rig.client.call("stage", "add", {"a": 2.0})
    assert "vision: stage.add(a=2.0)" in caplog.text


def test_nothing_but_a_stop_may_make_the_window_wait(rig: StationRig) -> None:
    take_back = declare_gui_thread()
    try:
        rig.client.call("stage", "stop")
        with pytest.raises(WrongThreadError):
            rig.client.call("stage", "add", {"a": 1.0})
    finally:
        take_back()
    assert rig.application.stops == 1


# --- what takes long --------------------------------------------------------------------------


def test_a_task_is_followed_to_its_end(rig: StationRig) -> None:
    task: Any = rig.client.call("stage", "export")
    steps: list[Progress] = []
    task.subscribe(steps.append)
    rig.application.tasks[0].report(0.5, "half")
    assert wait_until(lambda: any(step.text == "half" for step in steps))
    assert not task.done
    rig.application.tasks[0].finish()
    task.wait(5.0)
    assert task.done


def test_a_task_that_fails_raises_the_same_exception(rig: StationRig) -> None:
    task: Any = rig.client.call("stage", "export")
    rig.application.tasks[0].fail(NotAvailable("no more paper"))
    with pytest.raises(NotAvailable, match="no more paper"):
        task.wait(5.0)


def test_a_task_can_be_cancelled_remote_daqco(rig: StationRig) -> None:
    rig.client.take_lease()
    task: Any = rig.client.call("stage", "travel")
    task.cancel()
    with pytest.raises(DeviceError, match="halted"):
        task.wait(5.0)


# --- topics -----------------------------------------------------------------------------------


def subscribe(rig: StationRig, topic: str, rule: Rule, receiver: Any) -> Any:
    """Subscribe and wait until the first message has come."""
    came: list[object] = []

    def receive(payload: object) -> None:
        if isinstance(payload, str) and payload == "first":
            came.append(payload)
        else:
            receiver(payload)

    made = rig.client.subscribe(topic, rule, receive)

    def published() -> bool:
        rig.station.publish(topic, "first")
        return bool(came)

    assert wait_until(published)
    return made


def test_the_rule_all_loses_nothing_and_keeps_the_order(rig: StationRig) -> None:
    received: list[object] = []
    subscription = subscribe(rig, "daq/chunks", Rule.ALL, received.append)
    for number in range(3000):
        rig.station.publish("daq/chunks", number)
    assert wait_until(lambda: len(received) == 3000)
    assert received == list(range(3000))
    assert subscription.lost == 0


def test_the_rule_latest_passes_over_what_a_slow_receiver_missed(rig: StationRig) -> None:
    received: list[Any] = []

    def slow(frame: Any) -> None:
        received.append(int(frame[0, 0]))
        wait_until(lambda: False, 0.05)

    subscribe(rig, "camera/frames", Rule.LATEST, slow)
    began_s = WALL.now_s()
    for number in range(100):
        rig.station.publish("camera/frames", np.full((480, 640), number, np.uint8))
        assert rig.client.call("stage", "add", {"a": 1.0}) == 2.0
    assert wait_until(lambda: received and received[-1] == 99)
    assert received == sorted(received)
    assert len(received) <= (WALL.now_s() - began_s) / 0.05 + 3
    assert len(received) < 90, "they were published faster than they were taken"


def test_a_closed_subscription_hears_nothing_more(rig: StationRig) -> None:
    received: list[object] = []
    subscription = subscribe(rig, "daq/chunks", Rule.ALL, received.append)
    subscription.close()
    rig.station.publish("daq/chunks", 1)
    rig.client.call("stage", "add", {"a": 1.0})
    assert received == []


@pytest.mark.defects
def test_a_receiver_that_raises_is_reported_and_called_again(rig: StationRig) -> None:
    received: list[object] = []

    def receive(payload: object) -> None:
        received.append(payload)
        raise ValueError("hm")

    subscribe(rig, "daq/chunks", Rule.ALL, receive)
    rig.station.publish("daq/chunks", 1)
    rig.station.publish("daq/chunks", 2)
    assert wait_until(lambda: received == [1, 2])


def test_a_station_knows_whether_anybody_receives_a_topic(rig: StationRig) -> None:
    rig.station.publish("camera/frames", None)  # over a line it is known from then on
    assert not rig.station.wanted("camera/frames")
    for rule in Rule:
        subscription = rig.client.subscribe("camera/frames", rule, lambda _: None)
        assert wait_until(lambda: rig.station.wanted("camera/frames"))
        assert not rig.station.wanted("camera/other")
        subscription.close()
        assert wait_until(lambda: not rig.station.wanted("camera/frames"))


def test_a_client_publishes_to_shared_topics_only(rig: StationRig) -> None:
    received: list[object] = []
    subscribe(rig, "shared/notes", Rule.ALL, received.append)
    rig.client.publish("shared/notes", "look here")
    assert wait_until(lambda: received == ["look here"])
    with pytest.raises(CallRefused):
        rig.client.publish("station/lease", "mine")


# --- presence ---------------------------------------------------------------------------------


def test_presence_is_reported_at_once_and_when_it_ends(rig: StationRig) -> None:
    other = rig.another("other")
    seen: list[Presence] = []
    other.presence(seen.append)
    assert seen == [Presence("fibres", here=True)]
    other.close()
    assert not seen[-1].here
    assert seen[-1].why
