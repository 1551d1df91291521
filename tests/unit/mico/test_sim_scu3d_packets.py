"""Packets: order, waiting, looking, discarding, bounds; several threads and clocks."""

import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from ctypes import byref

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cosmic.frame.clock import WALL, ManualClock, RatedClock
from cosmic.mico.hw.scu3d_ctypes import SA_PACKET
from cosmic.mico.hw.sim_scu3d import load_simulated_library
from cosmic.twin.scene import Scene
from cosmic.twin.settings import shipped_settings
from unit.mico.sim_client import COMPLETED, ERROR, OK, POSITION, STATUS, SYNC, Client, Packet

NOTHING = Packet(0, 0, 0, 0, 0)


def started(work: Callable[[], object]) -> threading.Thread:
    thread = threading.Thread(target=work, daemon=True)
    thread.start()
    return thread


def test_a_timeout_answers_ok_with_an_empty_packet() -> None:
    client = Client()
    assert client.receive(timeout_ms=200) == NOTHING
    assert client.clock.now_s() == pytest.approx(0.2)
    assert client.receive(timeout_ms=0) == NOTHING


def test_an_answer_takes_one_to_two_milliseconds() -> None:
    client = Client()
    for _ in range(20):
        start_s = client.clock.now_s()
        client.ok("GetPosition_A", 0, 0)
        assert client.receive(timeout_ms=0) == NOTHING
        assert client.receive().type == POSITION
        assert 0.001 <= client.clock.now_s() - start_s <= 0.002


@settings(max_examples=25)
@given(st.lists(st.tuples(st.integers(0, 2), st.sampled_from(["GetStatus", "GetSensorType"]))))
def test_answers_of_one_channel_come_in_the_order_asked(asked: list[tuple[int, str]]) -> None:
    client = Client()
    for channel, name in asked:
        client.ok(f"{name}_A", 0, channel)
    client.advance(0.01)
    packets = client.drain()
    types = {"GetStatus": STATUS, "GetSensorType": 7}
    for channel in range(3):
        expected = [types[name] for where, name in asked if where == channel]
        assert [packet.type for packet in packets if packet.channel == channel] == expected


def test_each_device_has_its_own_queue() -> None:
    client = Client()
    client.ok("GetStatus_A", 1, 2)
    assert client.receive(0, 50) == NOTHING
    assert client.receive(1) == Packet(STATUS, 2, 0, 0, 0)


def test_looking_consumes_nothing_and_discarding_drops_the_head() -> None:
    client = Client()
    client.ok("GetStatus_A", 0, 0)
    client.ok("GetSensorType_A", 0, 0)
    assert client.look().type == STATUS
    assert client.look().type == STATUS
    client.ok("DiscardPacket_A", 0)
    assert client.receive().type == 7
    client.ok("DiscardPacket_A", 0)
    assert client.look(timeout_ms=10) == NOTHING


def test_receiving_for_a_channel_leaves_another_channels_head_alone() -> None:
    client = Client()
    client.ok("GetStatus_A", 0, 1)
    client.advance(0.01)
    start_s = client.clock.now_s()
    assert client.receive_if(0, 0, 100) == NOTHING
    assert client.clock.now_s() - start_s == pytest.approx(0.1)
    assert client.receive_if(0, 1).channel == 1


def test_a_second_notification_is_refused_until_the_next_session() -> None:
    client = Client()
    client.ok("SetReceiveNotification_A", 0, 1)
    assert client.call("SetReceiveNotification_A", 0, 2) == 16
    client.ok("SetReceiveNotification_A", 1, 1)
    client.ok("InitDevices", 1)
    client.ok("SetReceiveNotification_A", 0, 1)


def test_an_unread_queue_is_bounded_and_drops_nothing(caplog: pytest.LogCaptureFixture) -> None:
    constants = shipped_settings()
    small = constants.model_copy(
        update={"controller": constants.controller.model_copy(update={"queue_capacity": 100})}
    )
    scene = Scene.from_layout("LLL", small, ManualClock(auto_advance=True))
    client = Client(load_simulated_library(scene=scene))
    client.ok("SetReportOnComplete_A", 0, 0, 1)
    client.ok("MoveStep_A", 0, 0, 30_000, 1000, 1000)
    for _ in range(100):
        client.ok("GetStatus_A", 0, 0)
    for _ in range(50):
        assert client.call("GetStatus_A", 0, 0) == 8
    assert caplog.text.count("packets unread") == 1
    client.ok("Stop_A", 0, 0)
    client.advance(1.0)
    packets = client.drain()
    assert [packet.type for packet in packets] == [STATUS] * 100 + [COMPLETED]
    client.ok("GetStatus_A", 0, 0)


def test_a_waiting_listener_wakes_when_another_thread_asks() -> None:
    client = Client(load_simulated_library(clock=RatedClock(1.0)))
    got: list[Packet] = []
    start_s = WALL.now_s()
    thread = started(lambda: got.append(client.receive(0, 20_000)))
    while not thread.is_alive():
        pass
    client.ok("GetStatus_A", 0, 0)
    thread.join(5.0)
    assert got == [Packet(STATUS, 0, 0, 0, 0)]
    assert WALL.now_s() - start_s < 5.0


def test_a_waiting_listener_wakes_for_a_completion_nobody_asked_for() -> None:
    client = Client(load_simulated_library(clock=RatedClock(50.0)))
    client.ok("SetReportOnComplete_A", 0, 0, 1)
    client.ok("MoveStep_A", 0, 0, 500, 1000, 100)
    start_s = WALL.now_s()
    assert client.receive(0, 10_000).type == COMPLETED
    assert 0.08 < WALL.now_s() - start_s < 3.0, "5 s of the stage in 0.1 s of the wall"


def test_a_listener_that_waits_already_wakes_when_a_new_movement_completes() -> None:
    client = Client(load_simulated_library(clock=RatedClock(50.0)))
    client.ok("SetReportOnComplete_A", 0, 0, 1)
    got: list[Packet] = []
    thread = started(lambda: got.append(client.receive(0, 20_000)))
    thread.join(0.05)
    client.ok("MoveStep_A", 0, 0, 500, 1000, 1000)
    thread.join(5.0)
    assert [packet.type for packet in got] == [COMPLETED]


def test_the_receive_timeout_counts_on_the_wall() -> None:
    client = Client(load_simulated_library(clock=RatedClock(1000.0)))
    start_s = WALL.now_s()
    assert client.receive(0, 50) == NOTHING
    assert WALL.now_s() - start_s >= 0.049


def test_release_wakes_a_waiting_listener_with_2() -> None:
    client = Client(load_simulated_library(clock=ManualClock()))
    statuses: list[int] = []

    def listen() -> None:
        packet = SA_PACKET()
        statuses.append(client.call("ReceiveNextPacket_A", 0, 60_000, byref(packet)))

    thread = started(listen)
    for _ in range(100):
        # The thread may not have got to its call yet; then it waits in the next session.
        thread.join(0.02)
        client.ok("ReleaseDevices")
        client.ok("InitDevices", 1)
        if not thread.is_alive():
            break
    assert statuses == [2]


def test_on_a_clock_that_nobody_moves_receiving_still_ends() -> None:
    client = Client(load_simulated_library(clock=ManualClock()))
    start_s = WALL.now_s()
    assert client.receive(0, 60) == NOTHING
    assert WALL.now_s() - start_s < 5.0


def test_a_clock_moved_by_a_test_delivers_when_it_is_moved() -> None:
    clock = ManualClock()
    client = Client(load_simulated_library(clock=clock))
    client.ok("SetReportOnComplete_A", 0, 0, 1)
    client.ok("MoveStep_A", 0, 0, 100, 1000, 100)
    clock.advance(1.0)
    assert client.receive(0, 0) == NOTHING
    clock.advance(0.003)
    assert client.receive(0, 0).type == COMPLETED


def test_many_threads_on_all_channels_lose_nothing_and_keep_the_order() -> None:
    client = Client(load_simulated_library(clock=RatedClock(20.0)))
    each = 120

    def ask(place: tuple[int, int]) -> None:
        for number in range(each):
            # A closed-loop frequency that counts up shows the order of the answers.
            client.ok("SetClosedLoopMaxFrequency_A", *place, number + 1)
            client.ok("GetClosedLoopMaxFrequency_A", *place)

    def listen(device: int) -> list[Packet]:
        packets: list[Packet] = []
        while len(packets) < 3 * each:
            packet = client.receive(device, 2000)
            assert packet.type, f"device {device} went silent after {len(packets)} packets"
            packets.append(packet)
        return packets

    places = [(device, channel) for device in range(2) for channel in range(3)]
    with ThreadPoolExecutor(8) as pool:
        listeners = [pool.submit(listen, device) for device in range(2)]
        list(pool.map(ask, places))
        for listener in listeners:
            packets = listener.result(20.0)
            for channel in range(3):
                numbers = [packet.data1 for packet in packets if packet.channel == channel]
                assert numbers == list(range(1, each + 1))


def test_listeners_on_a_clock_that_advances_itself_end() -> None:
    client = Client()
    client.ok("SetReportOnComplete_A", 0, 0, 1)
    with ThreadPoolExecutor(3) as pool:
        waiting = [pool.submit(client.receive, device, 500) for device in (0, 1, 2)]
        client.ok("MovePositionRelative_A", 0, 0, 100, 0)
        for future in waiting:
            assert future.result(10.0).type in (0, COMPLETED)


class TestSynchronous:
    def test_a_call_takes_one_to_three_milliseconds(self) -> None:
        client = Client(mode=SYNC)
        for _ in range(20):
            start_s = client.clock.now_s()
            client.read("GetPosition_S", 0, 0)
            assert 0.001 <= client.clock.now_s() - start_s <= 0.003

    def test_a_move_returns_at_once_and_is_polled(self) -> None:
        client = Client(mode=SYNC)
        client.ok("MovePositionRelative_S", 0, 0, -3000, 60_000)
        assert client.clock.now_s() <= 0.003
        seen = set()
        while (status := client.read("GetStatus_S", 0, 0)) not in (0, 4):
            seen.add(status)
        assert (seen, status) == ({3}, 4)
        assert abs(client.read("GetPosition_S", 0, 0) + 3000) <= 2

    @pytest.mark.parametrize(
        ("device", "channel", "name", "args", "code"),
        [
            (2, 2, "MovePositionAbsolute_S", (0, 0), 130),
            (3, 0, "MovePositionAbsolute_S", (0, 0), 131),
            (0, 0, "MoveAngleAbsolute_S", (0, 0, 0), 131),
        ],
    )
    def test_refusals_come_as_return_codes(
        self, device: int, channel: int, name: str, args: tuple[int, ...], code: int
    ) -> None:
        assert Client(mode=SYNC).call(name, device, channel, *args) == code

    def test_an_end_stop_is_silent(self) -> None:
        client = Client(mode=SYNC)
        client.ok("MovePositionRelative_S", 0, 0, 200_000, 60_000)
        client.advance(5.0)
        assert client.read("GetStatus_S", 0, 0) == 0
        assert client.truth() == pytest.approx(6000.0, abs=0.01)

    def test_answers_fill_all_out_arguments(self) -> None:
        import ctypes

        client = Client(mode=SYNC)
        client.ok("SetPositionerAlignment_S", 0, 0, 1, 1000, 600)
        outs = [ctypes.c_uint32() for _ in range(3)]
        client.ok("GetPositionerAlignment_S", 0, 0, *(byref(out) for out in outs))
        assert [out.value for out in outs] == [1, 1000, 600]
        angle, revolution = ctypes.c_int32(), ctypes.c_int32(7)
        client.ok("MoveAngleRelative_S", 3, 0, -200_000, 0, 0)
        client.advance(5.0)
        client.ok("GetAngle_S", 3, 0, byref(angle), byref(revolution))
        assert angle.value == pytest.approx(-200_000, abs=6) and revolution.value == 0
        scale, inverted = ctypes.c_int32(), ctypes.c_uint32()
        client.ok("SetScale_S", 0, 0, -123, 1)
        client.ok("GetScale_S", 0, 0, byref(scale), byref(inverted))
        assert (scale.value, inverted.value) == (-123, 1)
        assert client.read("GetChannelProperty_S", 0, 0, 15) == 5000
        assert client.read("GetSystemProperty_S", 0, 2) == 1000

    def test_completions_of_a_synchronous_session_do_not_pile_up(self) -> None:
        client = Client(mode=SYNC)
        client.ok("MoveStep_S", 0, 0, 30_000, 1000, 1000)
        client.ok("Stop_S", 0, 0)
        client.ok("InitDevices", 1)
        assert client.settle() == []


def test_every_error_of_a_refused_command_is_one_packet() -> None:
    client = Client()
    client.ok("GetAngle_A", 0, 0)
    assert client.settle() == [Packet(ERROR, 0, 131, 0, 0)]
    assert OK == 0
