"""Each fault by name, in front of a client that does not know of it."""

import threading
from ctypes import byref, c_int32

import pytest

from cosmic.frame.clock import WALL, ManualClock, RatedClock
from cosmic.mico.hw.scu3d_ctypes import SA_PACKET
from cosmic.mico.hw.sim_faults import NAMES
from cosmic.mico.hw.sim_scu3d import load_simulated_library
from cosmic.twin.scene import Scene
from cosmic.twin.settings import shipped_settings
from unit.mico.sim_client import (
    COMPLETED,
    ERROR,
    FOR_EVER,
    MOVING,
    RESET,
    STOPPED,
    SYNC,
    Client,
    Packet,
)

DONE = Packet(COMPLETED, 0, 0, 0, 0)


def error(code: int, channel: int = 0) -> Packet:
    return Packet(ERROR, channel, code, 0, 0)


@pytest.fixture
def client() -> Client:
    """Stages in the middle of their travel, referenced; device 0 reports completions."""
    clock = ManualClock(auto_advance=True)
    scene = Scene.from_layout("LLL,RNN", shipped_settings(), clock, cold=False)
    client = Client(load_simulated_library(scene=scene))
    for channel in range(3):
        client.ok("SetReportOnComplete_A", 0, channel, 1)
    return client


def test_an_unknown_name_lists_the_known_ones(client: Client) -> None:
    faults = client.library.faults
    for act in (faults.inject, faults.clear):
        with pytest.raises(ValueError, match="no fault 'gremlin'") as caught:
            act("gremlin")
        assert all(name in str(caught.value) for name in NAMES)
    with pytest.raises(ValueError, match="has no delay"):
        faults.inject("unplugged", delay_s=1.0)
    with pytest.raises(ValueError, match="finite"):
        faults.inject("slow_answer", delay_s=float("nan"))
    assert faults.active == ()


def test_an_unplugged_device_answers_no_call(client: Client) -> None:
    client.library.faults.inject("unplugged", device=0)
    assert client.call("GetPosition_A", 0, 0) == 7
    assert client.call("Stop_A", 0, 0) == 7
    assert client.call("MoveStep_A", 0, 0, 1, 1000, 1000) == 7
    assert client.call("ReceiveNextPacket_A", 0, 100, byref(SA_PACKET())) == 10
    assert client.status(1) == STOPPED, "the other device works"
    client.library.faults.clear("unplugged", device=0)
    assert client.status(0) == STOPPED
    client.ok("InitDevices", SYNC)
    client.library.faults.inject("unplugged", device=0)
    assert client.call("GetPosition_S", 0, 0, byref(c_int32())) == 15
    assert client.call("SetZero_S", 0, 0) == 7


def test_unplugging_wakes_a_waiting_listener() -> None:
    client = Client(load_simulated_library(clock=RatedClock(1.0)))
    statuses: list[int] = []

    def listen() -> None:
        statuses.append(client.call("ReceiveNextPacket_A", 0, 20_000, byref(SA_PACKET())))

    thread = threading.Thread(target=listen, daemon=True)
    thread.start()
    client.library.faults.inject("unplugged", device=0)
    thread.join(5.0)
    assert statuses == [10]


def test_a_lost_completion_still_ends_the_movement(client: Client) -> None:
    client.library.faults.inject("lost_completed", device=0, channel=0)
    for channel in (0, 1):
        client.ok("MovePositionAbsolute_A", 0, channel, 100, FOR_EVER)
    assert client.settle() == [Packet(COMPLETED, 1, 0, 0, 0)]
    assert client.status() == 4
    client.library.faults.clear()
    client.ok("MovePositionAbsolute_A", 0, 0, 0, 0)
    assert client.settle() == [DONE]


def test_a_doubled_completion_comes_twice(client: Client) -> None:
    client.library.faults.inject("doubled_completed")
    client.ok("MovePositionAbsolute_A", 0, 0, 100, 0)
    assert client.settle() == [DONE, DONE]


def test_an_obstacle_ends_the_next_move_half_way_and_stays(client: Client) -> None:
    client.library.faults.inject("end_stop", device=0, channel=0)
    for _ in range(2):
        client.ok("MovePositionAbsolute_A", 0, 0, 10_000, 0)
        assert client.until(ERROR) == error(132)
        assert client.truth() == pytest.approx(500.0, abs=0.01)
        assert client.status() == STOPPED
        client.advance(3600.0)
    client.ok("MovePositionAbsolute_A", 0, 0, 0, 0)
    assert client.until(COMPLETED) == DONE, "the way back is free"
    client.ok("MoveStep_A", 0, 0, 1000, 1000, 1000)
    assert client.until(COMPLETED) == DONE, "steps stall without an error"
    assert client.truth() == pytest.approx(500.0, abs=0.01)
    client.library.faults.clear("end_stop")
    client.ok("MovePositionAbsolute_A", 0, 0, 10_000, 0)
    assert client.until(COMPLETED) == DONE


@pytest.mark.parametrize("target", [20_000, -20_000])
def test_an_obstacle_ends_the_running_move_where_it_is(client: Client, target: int) -> None:
    client.ok("MovePositionAbsolute_A", 0, 0, target, 0)
    client.advance(0.1)
    there = client.truth()
    client.library.faults.inject("end_stop", device=0)
    assert client.until(ERROR) == error(132)
    assert client.truth() == pytest.approx(there, abs=0.01)
    assert client.drain(timeout_ms=50) == []


def test_an_overheated_controller_ends_and_refuses_movements_until_it_is_cool(
    client: Client,
) -> None:
    client.ok("MoveStep_A", 0, 0, 30_000, 1000, 1000)
    client.advance(0.1)
    client.library.faults.inject("overheated", device=0)
    assert client.until(ERROR) == error(135)
    assert client.status() == STOPPED
    client.ok("MovePositionAbsolute_A", 0, 1, 100, 0)
    assert client.until(ERROR) == error(135, 1)
    client.ok("GetSystemProperty_A", 0, 1)
    assert client.receive().data2 > 70
    client.library.faults.clear("overheated")
    client.ok("MovePositionAbsolute_A", 0, 1, 100, 0)
    assert client.until(COMPLETED).channel == 1


def test_high_voltage_trouble_lasts_until_the_power_cycle(client: Client) -> None:
    client.ok("MovePositionAbsolute_A", 0, 0, 30_000, 0)
    client.library.faults.inject("hv_range", device=0)
    assert client.until(ERROR) == error(134)
    assert client.drain(timeout_ms=2000) == []
    client.library.faults.clear("hv_range")
    for name, args in (
        ("MoveStep", (1, 1000, 1000)),
        ("MovePositionAbsolute", (0, 0)),
        ("CalibrateSensor", ()),
        ("MoveToReference", (0, 0)),
        ("MoveToEndStop", (0, 0, 0)),
    ):
        assert client.ask(name, 0, 1, *args) == error(134, 1)
    client.ok("GetPosition_A", 0, 0)
    assert client.receive().type == 2, "it still answers"
    client.ok("InitDevices", 1)
    assert client.ask("MoveStep", 0, 1, 1, 1000, 1000) == error(134, 1)
    client.ok("InitDevices", 1 | RESET)
    client.ok("MoveStep_A", 0, 1, 1, 1000, 1000)
    assert client.settle() == []


def test_the_hand_control_unit_overrides_with_133_instead_of_completed(client: Client) -> None:
    client.ok("MovePositionAbsolute_A", 0, 0, 30_000, 0)
    client.advance(0.05)
    client.library.faults.inject("overridden", device=0)
    assert client.settle() == [error(133)]
    client.ok("MovePositionAbsolute_A", 0, 1, 30_000, FOR_EVER)
    assert client.settle() == [error(133, 1)]
    assert 100.0 < client.truth("0.1") < 2900.0
    client.ok("MoveStep_A", 0, 2, 30_000, 1000, 1000)
    assert client.settle() == [error(133, 2)]
    client.ok("SetAmplitude_A", 0, 2, 500)
    assert client.settle() == [], "setting an amplitude is not a movement"
    client.library.faults.clear("overridden")
    client.ok("MovePositionAbsolute_A", 0, 1, 0, FOR_EVER)
    assert client.settle() == [Packet(COMPLETED, 1, 0, 0, 0)]


def test_a_lost_sensor_refuses_and_forgets(client: Client) -> None:
    client.ok("MovePositionAbsolute_A", 0, 0, 30_000, 0)
    client.advance(0.1)
    client.library.faults.inject("sensor_lost", device=0, channel=0)
    assert client.until(ERROR) == error(130)
    assert client.ask("GetPosition", 0, 0) == error(130)
    assert client.ask("GetSensorPresent", 0, 0).data1 == 0
    assert client.ask("MovePositionAbsolute", 0, 0, 0, 0) == error(130)
    before = client.truth()
    client.ok("MoveStep_A", 0, 0, 200, 1000, 1000)
    assert client.until(COMPLETED) == DONE
    client.library.faults.clear("sensor_lost")
    assert client.ask("GetPhysicalPositionKnown", 0, 0).data1 == 0
    assert client.position() == pytest.approx(before * 10, abs=10), "it did not see the steps"
    assert client.truth() - before > 290.0


def test_steps_do_not_need_the_sensor_that_is_lost(client: Client) -> None:
    client.ok("MoveStep_A", 0, 0, 1000, 1000, 1000)
    client.library.faults.inject("sensor_lost")
    assert client.status() == MOVING
    assert client.until(COMPLETED) == DONE


def test_a_slow_answer_comes_later_but_in_order(client: Client) -> None:
    client.library.faults.inject("slow_answer", device=0, delay_s=3.0)
    client.ok("GetStatus_A", 0, 0)
    client.library.faults.clear("slow_answer")
    client.ok("GetSensorType_A", 0, 0)
    client.ok("GetStatus_A", 0, 1)
    assert client.receive() == Packet(5, 1, 0, 0, 0), "another channel is not late"
    assert [client.receive(timeout_ms=5000).type for _ in range(2)] == [5, 7]
    assert client.clock.now_s() >= 3.0
    client.ok("InitDevices", SYNC)
    client.library.faults.inject("slow_answer", device=0, delay_s=3.0)
    start_s = client.clock.now_s()
    client.read("GetPosition_S", 0, 0)
    assert client.clock.now_s() - start_s > 3.0
    client.ok("Stop_S", 0, 0)
    assert client.clock.now_s() - start_s < 3.1, "stop never waits"


@pytest.mark.parametrize("letter", ["A", "S"])
def test_a_stop_gets_through_while_a_movement_call_blocks(letter: str) -> None:
    clock = ManualClock()
    scene = Scene.from_layout("LLL", shipped_settings(), clock, cold=False)
    client = Client(load_simulated_library(scene=scene), mode=1 if letter == "A" else SYNC)
    client.library.faults.inject("blocked_call", device=0, delay_s=30.0)
    statuses: list[int] = []

    def move() -> None:
        statuses.append(client.call(f"MovePositionAbsolute_{letter}", 0, 0, 9000, 0))

    thread = threading.Thread(target=move, daemon=True)
    thread.start()
    start_s = WALL.now_s()
    while client.library.faults.active and WALL.now_s() - start_s < 5.0:
        pass
    for channel in range(3):
        client.ok(f"Stop_{letter}", 0, channel)
    assert WALL.now_s() - start_s < 5.0
    assert statuses == [] and thread.is_alive()
    while thread.is_alive() and WALL.now_s() - start_s < 5.0:
        clock.advance(31.0)
        thread.join(0.01)
    assert statuses == [0], "the blocked call then goes its way"
    assert client.library.faults.active == (), "it blocks once"


def test_faults_can_be_cleared_one_by_one(client: Client) -> None:
    faults = client.library.faults
    faults.inject("overheated", device=0)
    faults.inject("overheated", device=1)
    faults.inject("lost_completed")
    faults.clear("overheated", device=1)
    assert [(f.name, f.device) for f in faults.active] == [
        ("overheated", 0),
        ("lost_completed", None),
    ]
    faults.clear()
    assert faults.active == ()
