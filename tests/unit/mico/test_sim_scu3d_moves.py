"""Movements of the simulated controller, as an asynchronous client sees them."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cosmic.frame.clock import ManualClock
from cosmic.mico.hw.sim_scu3d import load_simulated_library
from cosmic.twin.scene import Scene
from cosmic.twin.settings import shipped_settings
from unit.mico.sim_client import (
    ANGLE,
    CALIBRATING,
    COMPLETED,
    ERROR,
    FOR_EVER,
    HOLDING,
    MOVING,
    REFERENCING,
    RESET,
    SETTING,
    STOPPED,
    TARGETING,
    Client,
    Packet,
)

COUNTS_PER_UM = 10
DONE = Packet(COMPLETED, 0, 0, 0, 0)


@pytest.fixture
def client() -> Client:
    """A freshly switched on library that reports every completion of device 0."""
    client = Client()
    for channel in range(3):
        client.ok("SetReportOnComplete_A", 0, channel, 1)
    return client


def known(client: Client, device: int = 0) -> int:
    return client.ask("GetPhysicalPositionKnown", device, 0).data1


def referenced(client: Client, auto_zero: int = 0) -> Client:
    client.ok("MoveToReference_A", 0, 0, 0, auto_zero)
    client.until(COMPLETED)
    return client


def in_the_middle() -> Client:
    """A client of stages that are referenced and stand in the middle of their travel."""
    scene = Scene.from_layout(
        "LLL,RNN", shipped_settings(), ManualClock(auto_advance=True), cold=False
    )
    client = Client(load_simulated_library(scene=scene))
    client.ok("SetReportOnComplete_A", 0, 0, 1)
    return client


def test_at_power_up_positions_read_zero_wherever_the_stages_stand(client: Client) -> None:
    for device, channel in ((0, 0), (0, 1), (1, 2), (2, 1)):
        assert client.position(device, channel) == 0
        assert client.ask("GetPhysicalPositionKnown", device, channel).data1 == 0
        assert abs(client.truth(f"{device}.{channel}")) > 100.0
    assert client.ask("GetAngle", 3, 0) == Packet(ANGLE, 0, 0, 0, 0)


@settings(max_examples=40)
@given(st.lists(st.integers(-15_000, 15_000), min_size=1, max_size=4))
def test_closed_loop_moves_end_within_the_threshold(targets: list[int]) -> None:
    client = in_the_middle()
    for target in targets:
        client.ok("MovePositionAbsolute_A", 0, 0, target, 1000)
        assert client.until(COMPLETED) == DONE
        assert abs(client.position() - target) <= 2
        assert abs(client.truth() * COUNTS_PER_UM - target) <= 2.001
        assert client.status() == HOLDING


def test_relative_moves_add_to_where_the_stage_is(client: Client) -> None:
    for number in range(1, 6):
        client.ok("MovePositionRelative_A", 0, 0, -250, 0)
        client.until(COMPLETED)
        assert abs(client.position() + 250 * number) <= 2 * number
        assert client.status() == STOPPED


def test_a_move_takes_the_time_of_its_frequency() -> None:
    def duration_s(frequency_hz: int) -> float:
        client = in_the_middle()
        client.ok("SetClosedLoopMaxFrequency_A", 0, 0, frequency_hz)
        start_s = client.clock.now_s()
        client.ok("MovePositionAbsolute_A", 0, 0, 15_000, 0)
        client.until(COMPLETED)
        return client.clock.now_s() - start_s

    assert duration_s(5000) == pytest.approx(1495 / 7500 + 5 / 1500 + 0.015, abs=0.01)
    assert duration_s(1000) > 4.5 * duration_s(5000)


def test_the_last_micrometres_are_slower() -> None:
    client = in_the_middle()
    client.ok("SetClosedLoopMaxFrequency_A", 0, 0, 100)
    client.ok("MovePositionAbsolute_A", 0, 0, 200, 0)
    client.until(COMPLETED)
    assert client.clock.now_s() == pytest.approx(15 / 150 + 5 / 30 + 0.0165, abs=0.01)


def test_status_and_position_follow_a_closed_loop_move_through_its_phases() -> None:
    client = in_the_middle()
    client.ok("MovePositionAbsolute_A", 0, 0, 15_000, 500)
    assert client.status() == TARGETING
    client.advance(0.1)
    assert client.status() == TARGETING
    assert 6_000 < client.position() < 9_500
    client.until(COMPLETED)
    assert client.status() == HOLDING
    client.advance(0.4)
    assert client.status() == HOLDING
    client.advance(0.2)
    assert client.status() == STOPPED
    assert client.drain(timeout_ms=10) == [], "the end of the hold is not a completion"


def test_hold_for_ever_holds_and_only_a_stage_not_held_creeps() -> None:
    client = in_the_middle()
    client.ok("MovePositionAbsolute_A", 0, 0, 0, FOR_EVER)
    client.until(COMPLETED)
    held = client.truth()
    client.advance(3600.0)
    assert client.status() == HOLDING
    assert client.truth() == held
    client.ok("Stop_A", 0, 0)
    assert client.status() == STOPPED
    client.advance(600.0)
    assert 0.2 <= abs(client.truth() - held) <= 0.5, "20 to 50 nm a minute"
    assert client.skipped + client.drain(timeout_ms=10) == [], "a hold is no move to interrupt"


def test_steps_move_and_read_back_in_counts() -> None:
    client = in_the_middle()
    client.ok("MoveStep_A", 0, 0, 400, 1000, 1000)
    assert client.status() == MOVING
    client.until(COMPLETED)
    assert client.clock.now_s() == pytest.approx(0.4, abs=0.01)
    assert client.position() == pytest.approx(400 * 1.5 * COUNTS_PER_UM, rel=0.01)
    there = client.position()
    client.ok("MoveStep_A", 0, 0, -400, 1000, 1000)
    client.until(COMPLETED)
    assert client.position() - there == pytest.approx(-400 * 1.5 * 0.95 * COUNTS_PER_UM, rel=0.01)


def test_smaller_amplitudes_make_smaller_steps_after_being_set() -> None:
    client = in_the_middle()
    client.ok("MoveStep_A", 0, 0, 400, 550, 1000)
    assert client.status() == SETTING
    client.advance(0.006)
    assert client.status() == MOVING
    client.until(COMPLETED)
    assert client.position() == pytest.approx(400 * 0.75 * COUNTS_PER_UM, rel=0.01)
    assert client.ask("GetAmplitude", 0, 0).data1 == 550
    client.ok("MoveStep_A", 0, 0, 1, 550, 1000)
    assert client.status() == MOVING, "the amplitude is set already"


def test_setting_an_amplitude_stops_the_channel() -> None:
    client = in_the_middle()
    client.ok("MoveStep_A", 0, 0, 30_000, 1000, 1000)
    client.advance(0.1)
    client.ok("SetAmplitude_A", 0, 0, 1000)
    assert client.status() == MOVING, "nothing changes"
    client.ok("SetAmplitude_A", 0, 0, 500)
    assert client.until(COMPLETED) == DONE
    client.advance(0.01)
    assert client.status() == STOPPED


def test_setting_an_amplitude_is_never_completed() -> None:
    client = in_the_middle()
    for amplitude in range(200, 210):
        client.ok("SetAmplitude_A", 0, 0, amplitude)
        client.ok("MovePositionAbsolute_A", 0, 0, 500, 0)
        assert client.settle() == [DONE]
        client.ok("SetAmplitude_A", 0, 0, 1000)
        client.ok("Stop_A", 0, 0)
        assert client.settle() == []


def test_the_noise_of_many_steps_is_that_of_their_sum() -> None:
    ways = []
    for seed in range(40):
        clock = ManualClock(auto_advance=True)
        scene = Scene.from_layout("LLL", shipped_settings(), clock, seed, cold=False)
        client = Client(load_simulated_library(scene=scene))
        client.ok("MoveStep_A", 0, 0, 100, 1000, 10_000)
        client.settle()
        ways.append(client.truth())
    mean = sum(ways) / len(ways)
    deviation = (sum((way - mean) ** 2 for way in ways) / len(ways)) ** 0.5
    assert 0.1 < deviation < 0.6, "2 % of 1.5 um, times the root of 100"
    assert mean == pytest.approx(150.0, abs=0.3)


@pytest.mark.parametrize("steps", [30_000, -30_000])
def test_thirty_thousand_steps_go_on_until_stopped(steps: int) -> None:
    client = Client(load_simulated_library("LLL", clock=ManualClock(auto_advance=True)))
    client.ok("SetReportOnComplete_A", 0, 0, 1)
    client.ok("MoveStep_A", 0, 0, steps, 1000, 1000)
    client.advance(0.5)
    assert client.position() == pytest.approx(750 * COUNTS_PER_UM * steps / 30_000, rel=0.06)
    client.advance(1000.0)
    assert client.status() == MOVING
    assert abs(client.truth()) == 6000.0, "at the stop it stalls"
    client.ok("MoveStep_A", 0, 0, 0, 1000, 1000)
    assert client.status() == STOPPED
    assert client.skipped == [DONE]


def test_steps_into_a_stop_run_out_and_complete() -> None:
    client = in_the_middle()
    client.ok("MoveStep_A", 0, 0, 8000, 1000, 1000)
    client.advance(6.0)
    assert client.status() == MOVING
    assert client.truth() == 6000.0
    assert client.until(COMPLETED) == DONE
    assert client.clock.now_s() == pytest.approx(8.0, abs=0.1)
    assert client.drain(timeout_ms=10) == []


def test_stop_finishes_the_step_in_hand_and_reports_once() -> None:
    client = in_the_middle()
    client.ok("MoveStep_A", 0, 0, 10, 1000, 10)
    client.advance(0.25)
    client.ok("Stop_A", 0, 0)
    client.ok("Stop_A", 0, 0)
    assert client.status() == STOPPED
    assert client.skipped + client.drain(timeout_ms=10) == [DONE]
    assert client.position() == pytest.approx(3 * 1.5 * COUNTS_PER_UM, abs=1.5)


def test_stop_ends_a_closed_loop_move_where_it_is() -> None:
    client = in_the_middle()
    client.ok("MovePositionAbsolute_A", 0, 0, 15_000, FOR_EVER)
    client.advance(0.1)
    before = client.truth()
    client.ok("Stop_A", 0, 0)
    assert client.until(COMPLETED) == DONE
    assert client.status() == STOPPED
    assert 0.0 <= client.truth() - before < 2.0


def test_stop_on_a_stopped_channel_says_nothing(client: Client) -> None:
    client.ok("Stop_A", 0, 0)
    assert client.drain(timeout_ms=50) == []


def test_without_report_nothing_is_reported() -> None:
    client = Client()
    client.ok("MoveStep_A", 0, 0, 10, 1000, 1000)
    assert client.settle() == []
    client.ok("SetReportOnComplete_A", 0, 0, 1)
    client.ok("MoveStep_A", 0, 0, 10, 1000, 1000)
    assert client.settle() == [DONE]
    client.ok("SetReportOnComplete_A", 0, 0, 0)
    client.ok("MoveStep_A", 0, 0, 10, 1000, 1000)
    assert client.settle() == []


def test_an_overriding_move_gives_one_or_two_completions() -> None:
    client = in_the_middle()
    counts = set()
    for _ in range(30):
        client.ok("MovePositionAbsolute_A", 0, 0, 9_000, 0)
        client.advance(0.02)
        client.ok("MovePositionAbsolute_A", 0, 0, 0, 0)
        packets = client.settle()
        assert set(packets) == {DONE}
        counts.add(len(packets))
        assert abs(client.position()) <= 2
    assert counts == {1, 2}


def test_a_target_beyond_the_stop_is_error_132_and_stopped() -> None:
    client = in_the_middle()
    client.ok("MovePositionAbsolute_A", 0, 0, 61_000, FOR_EVER)
    start_s = client.clock.now_s()
    packet = client.receive(timeout_ms=5000)
    assert packet == Packet(ERROR, 0, 132, 0, 0)
    assert client.clock.now_s() - start_s == pytest.approx(5995 / 7500 + 5 / 1500 + 0.05, abs=0.01)
    assert client.status() == STOPPED
    assert client.truth() == 6000.0
    assert client.drain(timeout_ms=100) == [], "no completion"
    client.ok("MovePositionAbsolute_A", 0, 0, 59_000, 0)
    assert client.until(COMPLETED) == DONE, "and it can leave the stop"


def test_the_stop_itself_is_a_target() -> None:
    client = in_the_middle()
    for target in (60_000, -60_000, 60_001):
        client.ok("MovePositionAbsolute_A", 0, 0, target, 0)
        assert client.until(COMPLETED) == DONE


@pytest.mark.parametrize(("direction", "stop"), [(0, -6000.0), (1, 6000.0)])
def test_the_end_stop_is_found_without_an_error(
    client: Client, direction: int, stop: float
) -> None:
    client.ok("MoveToEndStop_A", 0, 0, direction, 1000, 1)
    assert client.status() == TARGETING
    assert client.receive(timeout_ms=10_000) == DONE
    assert client.status() == HOLDING
    assert client.truth() == stop
    assert client.position() == 0, "auto zero"
    assert known(client) == 0


def test_reference_makes_the_position_known_and_applies_the_stored_offset() -> None:
    scene = Scene.from_settings(shipped_settings(), ManualClock(auto_advance=True), cold=True)
    client = Client(load_simulated_library(scene=scene))
    client.ok("SetReportOnComplete_A", 0, 0, 1)
    assert client.position() == 0
    client.ok("MoveToReference_A", 0, 0, FOR_EVER, 0)
    assert client.status() == REFERENCING
    assert client.until(COMPLETED) == DONE
    assert client.status() == HOLDING
    assert known(client) == 1
    assert client.position() == -60_000
    client.ok("MovePositionAbsolute_A", 0, 0, 1000, 0)
    client.until(COMPLETED)
    assert client.truth("left.x") == pytest.approx(100.0, abs=0.8)


def test_references_lie_apart_but_within_the_repeatability() -> None:
    client = referenced(in_the_middle())
    landings = []
    for _ in range(10):
        client.ok("MovePositionAbsolute_A", 0, 0, 0, 0)
        client.until(COMPLETED)
        referenced(client)
        landings.append(client.truth())
    assert len(set(landings)) == 10
    assert all(0.0 <= landing + 6000.0 <= 0.5 for landing in landings)


def test_reference_with_auto_zero_reads_zero_there() -> None:
    client = referenced(in_the_middle(), auto_zero=1)
    assert client.position() == 0
    assert known(client) == 1


def test_reference_goes_in_the_safe_direction_after_a_new_calibration() -> None:
    client = in_the_middle()
    client.ok("SetSafeDirection_A", 0, 0, 1)
    client.ok("MoveToReference_A", 0, 0, 0, 0)
    assert client.receive() == Packet(ERROR, 0, 137, 0, 0), "the calibration is gone"
    client.ok("CalibrateSensor_A", 0, 0)
    assert client.status() == CALIBRATING
    assert client.until(COMPLETED) == DONE
    assert 2.0 < client.clock.now_s() < 8.0
    assert client.truth() == 6000.0, "end stop types drive to the stop"
    client.ok("MovePositionRelative_A", 0, 0, -30_000, 0)
    client.until(COMPLETED)
    referenced(client)
    assert client.truth() == pytest.approx(6000.0, abs=0.5)


def test_every_stage_can_be_calibrated_and_referenced_right_after_power_up() -> None:
    for seed in range(6):
        clock = ManualClock(auto_advance=True)
        client = Client(load_simulated_library("LRN", seed=seed, clock=clock))
        for channel in (0, 1):
            client.ok("SetReportOnComplete_A", 0, channel, 1)
            client.ok("CalibrateSensor_A", 0, channel)
            assert client.until(COMPLETED).channel == channel
            client.ok("MoveToReference_A", 0, channel, 0, 0)
            assert client.until(COMPLETED).channel == channel
        assert client.skipped == []


def test_calibration_moves_both_ways() -> None:
    client = in_the_middle()
    client.ok("CalibrateSensor_A", 0, 0)
    seen = []
    while client.status() == CALIBRATING:
        seen.append(client.truth())
        client.advance(0.02)
    assert max(seen) == pytest.approx(2000.0, abs=70)
    assert min(seen) == -6000.0


def test_calibration_near_an_end_stop_fails() -> None:
    client = in_the_middle()
    client.ok("MovePositionAbsolute_A", 0, 0, -50_000, 0)
    client.until(COMPLETED)
    client.ok("CalibrateSensor_A", 0, 0)
    assert client.until(ERROR) == Packet(ERROR, 0, 136, 0, 0)
    assert client.status() == STOPPED


@pytest.mark.parametrize("safe_direction", [0, 1])
@pytest.mark.parametrize("start", [-30_000, 30_000])
def test_types_with_a_mark_find_it_from_both_sides(safe_direction: int, start: int) -> None:
    client = in_the_middle()
    client.ok("MovePositionAbsolute_A", 0, 0, start, 0)
    client.until(COMPLETED)
    client.ok("SetSensorType_A", 0, 0, 21)
    client.ok("SetSafeDirection_A", 0, 0, safe_direction)
    assert known(client) == 0
    client.ok("CalibrateSensor_A", 0, 0)
    client.until(COMPLETED)
    client.ok("MoveToReference_A", 0, 0, 0, 0)
    seen = []
    while client.status() == REFERENCING:
        seen.append(client.truth())
        client.advance(0.01)
    assert client.skipped[-1] == DONE
    assert known(client) == 1
    assert client.truth() == pytest.approx(0.0, abs=0.5)
    if safe_direction:
        assert (max(seen) == 6000.0) == (start > 0), "it turns round at the stop, if it must"
    else:
        assert (min(seen) == -6000.0) == (start < 0)


@pytest.mark.parametrize("code", [31, 33, 34, 35])
def test_goniometers_with_end_stop_reference_are_referenced_there(code: int) -> None:
    client = in_the_middle()
    client.ok("SetSensorType_A", 0, 0, code)
    client.ok("CalibrateSensor_A", 0, 0)
    client.until(COMPLETED)
    client.ok("MoveToReference_A", 0, 0, 0, 0)
    client.until(COMPLETED)
    assert known(client) == 1
    assert abs(client.truth()) == pytest.approx(6000.0, abs=5.0)


def test_a_mark_that_cannot_be_reached_fails_the_reference() -> None:
    client = in_the_middle()
    client.ok("MovePositionAbsolute_A", 0, 0, -30_000, 0)
    client.until(COMPLETED)
    client.ok("SetSensorType_A", 0, 0, 21)
    client.ok("CalibrateSensor_A", 0, 0)
    client.until(COMPLETED)
    client.library.scene.stages["0.0"].obstruct(-1000.0, 1)
    client.ok("MoveToReference_A", 0, 0, 0, 0)
    assert client.until(ERROR) == Packet(ERROR, 0, 137, 0, 0)
    assert client.status() == STOPPED
    assert known(client) == 0


def test_another_type_has_to_be_calibrated_first() -> None:
    client = in_the_middle()
    client.ok("SetSensorType_A", 0, 0, 21)
    assert client.ask("MoveToReference", 0, 0, 0, 0) == Packet(ERROR, 0, 137, 0, 0)


@pytest.mark.parametrize(
    ("name", "args", "status"),
    [
        ("MoveStep", (10_000, 500, 1000), MOVING),
        ("MovePositionAbsolute", (15_000, FOR_EVER), TARGETING),
        ("MoveToEndStop", (1, FOR_EVER, 0), TARGETING),
        ("MoveToReference", (FOR_EVER, 0), REFERENCING),
        ("CalibrateSensor", (), CALIBRATING),
    ],
)
def test_stop_ends_every_kind_of_movement_at_once(
    name: str, args: tuple[int, ...], status: int
) -> None:
    client = in_the_middle()
    client.ok(f"{name}_A", 0, 0, *args)
    client.advance(0.02)
    assert client.status() == status
    client.ok("Stop_A", 0, 0)
    assert client.until(COMPLETED) == DONE
    assert client.status() == STOPPED
    there = client.truth()
    client.advance(10.0)
    assert client.truth() == pytest.approx(there, abs=0.01)
    assert client.drain(timeout_ms=10) == []


def test_types_with_coded_marks_need_only_a_few_millimetres() -> None:
    client = in_the_middle()
    client.ok("SetSensorType_A", 0, 0, 18)
    client.ok("CalibrateSensor_A", 0, 0)
    client.until(COMPLETED)
    client.ok("SetScale_A", 0, 0, 0, 0)
    client.ok("MoveToReference_A", 0, 0, 0, 0)
    client.until(COMPLETED)
    assert known(client) == 1
    assert client.position() == pytest.approx(client.truth() * COUNTS_PER_UM, abs=6)


@pytest.mark.parametrize("code", [7, 9, 10, 12])
def test_types_without_a_reference_cannot_be_referenced(code: int) -> None:
    client = in_the_middle()
    client.ok("SetSensorType_A", 1, 0, code)
    client.ok("MoveToReference_A", 1, 0, 0, 0)
    assert client.receive(1) == Packet(ERROR, 0, 129, 0, 0)


def test_the_rotary_stage_moves_in_tenths_of_a_millidegree_either_way() -> None:
    client = in_the_middle()
    client.ok("SetReportOnComplete_A", 1, 0, 1)
    for angle in (900_000, -1_234_567):
        client.ok("MoveAngleAbsolute_A", 1, 0, angle, 0, 1000)
        client.until(COMPLETED, 1, within_s=10.0)
        packet = client.ask("GetAngle", 1, 0)
        assert packet.type == ANGLE and packet.data2 == 0
        signed = packet.data1 - 2**32 if packet.data1 >= 2**31 else packet.data1
        assert abs(signed - angle) <= 6
        assert client.truth("1.0") == pytest.approx(angle / 10_000, abs=0.0006)


def test_the_rotary_stage_ends_at_its_stops() -> None:
    client = in_the_middle()
    client.ok("MoveAngleAbsolute_A", 1, 0, 1_800_000, 0, 0)
    assert client.until(ERROR, 1) == Packet(ERROR, 0, 132, 0, 0)
    assert client.truth("1.0") == pytest.approx(170.0, abs=1e-6)


@pytest.mark.parametrize(
    ("device", "channel", "name", "args", "code"),
    [
        (1, 0, "GetPosition", (), 131),
        (1, 0, "MovePositionAbsolute", (0, 0), 131),
        (1, 0, "MovePositionRelative", (0, 0), 131),
        (0, 0, "GetAngle", (), 131),
        (0, 0, "MoveAngleAbsolute", (0, 0, 0), 131),
        (0, 0, "MoveAngleRelative", (0, 0, 0), 131),
        (1, 1, "GetPosition", (), 130),
        (1, 1, "GetAngle", (), 130),
        (1, 1, "MovePositionAbsolute", (0, 0), 130),
        (1, 1, "SetZero", (), 130),
        (1, 1, "MoveToReference", (0, 0), 130),
        (1, 1, "MoveToEndStop", (0, 0, 0), 130),
        (1, 1, "CalibrateSensor", (), 130),
    ],
)
def test_what_a_channel_cannot_do_is_an_error_packet(
    device: int, channel: int, name: str, args: tuple[int, ...], code: int
) -> None:
    client = in_the_middle()
    assert client.ask(name, device, channel, *args) == Packet(ERROR, channel, code, 0, 0)


def test_a_gripper_steps_without_a_sensor() -> None:
    client = in_the_middle()
    assert client.ask("GetSensorPresent", 1, 1).data1 == 0
    assert client.ask("GetSensorPresent", 1, 0).data1 == 1
    client.ok("SetReportOnComplete_A", 1, 1, 1)
    client.ok("MoveStep_A", 1, 1, 100, 1000, 5000)
    assert client.until(COMPLETED, 1) == Packet(COMPLETED, 1, 0, 0, 0)
    assert client.truth("1.1") == pytest.approx(600.0, abs=2.0)


def test_set_zero_on_an_unknown_position_is_not_stored(client: Client) -> None:
    client.ok("MovePositionRelative_A", 0, 0, 5000, 0)
    client.until(COMPLETED)
    client.ok("SetZero_A", 0, 0)
    assert client.position() == 0
    assert client.ask("GetScale", 0, 0) == Packet(12, 0, 0, 0, 0)


def test_set_zero_on_a_known_position_survives_a_power_cycle_and_reference() -> None:
    client = referenced(in_the_middle())
    client.ok("MovePositionAbsolute_A", 0, 0, -40_000, 0)
    client.until(COMPLETED)
    client.ok("SetZero_A", 0, 0)
    zero = client.truth()
    assert client.position() == 0
    assert client.ask("GetScale", 0, 0).data2 == pytest.approx(-2_000_000, abs=700), "nm"
    client.ok("InitDevices", 1 | RESET)
    client.ok("SetReportOnComplete_A", 0, 0, 1)
    assert (client.position(), known(client)) == (0, 0)
    referenced(client)
    assert client.position() == pytest.approx((client.truth() - zero) * COUNTS_PER_UM, abs=7)


@pytest.mark.parametrize("name", ["SetZero", "SetSensorType", "SetScale"])
def test_changing_the_scale_while_moving_is_not_processable(name: str) -> None:
    client = in_the_middle()
    args = {"SetSensorType": (2,), "SetScale": (0, 0)}.get(name, ())
    client.ok("MovePositionAbsolute_A", 0, 0, 10_000, 0)
    assert client.ask(name, 0, 0, *args) == Packet(ERROR, 0, 138, 0, 0)
    assert client.until(COMPLETED) == DONE, "the movement goes on"


def test_the_scale_acts_at_once_only_on_a_known_position(client: Client) -> None:
    client.ok("SetScale_A", 0, 0, 1_000_000, 0)
    assert client.position() == 0
    assert client.ask("GetScale", 0, 0) == Packet(12, 0, 0, 1_000_000, 0)
    referenced(client)
    assert client.position() == 10_000
    client.ok("SetScale_A", 0, 0, -500_000, 0)
    assert client.position() == -5_000


def test_inversion_flips_the_scale_but_not_the_safe_direction(client: Client) -> None:
    referenced(client)
    client.ok("SetScale_A", 0, 0, 0, 1)
    client.ok("MovePositionAbsolute_A", 0, 0, -10_000, 0)
    client.until(COMPLETED)
    assert client.truth() == pytest.approx(-5000.0, abs=1.0)
    assert client.ask("GetSafeDirection", 0, 0).data1 == 0
    client.ok("MoveStep_A", 0, 0, 100, 1000, 1000)
    before = client.truth()
    client.until(COMPLETED)
    assert client.truth() > before, "steps know no scale"
    client.ok("MoveToReference_A", 0, 0, 0, 0)
    assert client.until(ERROR).data1 == 137, "inversion of an end stop type ends its calibration"


def test_release_and_init_keep_position_and_knowledge() -> None:
    client = referenced(in_the_middle())
    client.ok("MovePositionAbsolute_A", 0, 0, 1234, 0)
    client.until(COMPLETED)
    there = client.position()
    client.ok("ReleaseDevices")
    client.ok("InitDevices", 1)
    assert (client.position(), known(client)) == (there, 1)
    client.ok("InitDevices", 1 | RESET)
    assert (client.position(), known(client)) == (0, 0)


def test_each_session_starts_without_reports() -> None:
    client = in_the_middle()
    client.ok("InitDevices", 1)
    client.ok("MoveStep_A", 0, 0, 10, 1000, 1000)
    assert client.settle() == []


def test_a_hardware_reset_stops_everything() -> None:
    client = in_the_middle()
    client.ok("MovePositionAbsolute_A", 0, 0, 15_000, FOR_EVER)
    client.advance(0.1)
    client.ok("InitDevices", 1 | RESET)
    there = client.truth()
    client.advance(1.0)
    assert client.status() == STOPPED
    assert client.truth() == pytest.approx(there, abs=0.01)


def test_properties_and_settings_read_back(client: Client) -> None:
    for key, value in ((3, 500), (5, 127), (6, 10), (15, 2000), (21, 1)):
        client.ok("SetChannelProperty_A", 0, 0, key, value)
        assert client.ask("GetChannelProperty", 0, 0, key) == Packet(14, 0, key, value, 0)
    assert client.ask("GetChannelProperty", 0, 0, 25).data2 == 0
    assert client.ask("GetChannelProperty", 3, 0, 25).data2 == 1
    client.ok("SetPositionerAlignment_A", 0, 0, 1, 1000, 550)
    assert client.ask("GetPositionerAlignment", 0, 0) == Packet(10, 0, 1, 1000, 550)
    client.ok("SetSafeDirection_A", 0, 0, 1)
    assert client.ask("GetSafeDirection", 0, 0) == Packet(11, 0, 1, 0, 0)
    client.ok("SetClosedLoopMaxFrequency_A", 0, 0, 123)
    assert client.ask("GetClosedLoopMaxFrequency", 0, 0) == Packet(6, 0, 123, 0, 0)
    assert client.ask("GetSensorType", 0, 0) == Packet(7, 0, 1, 0, 0)
    for key, value in ((1, 38), (2, 1000), (3, 1)):
        client.ok("GetSystemProperty_A", 0, key)
        assert client.receive() == Packet(15, 255, key, value, 0)
    client.ok("InitDevices", 1 | RESET)
    assert client.ask("GetChannelProperty", 0, 0, 3).data2 == 200, "3, 5 and 6 are volatile"
    assert client.ask("GetClosedLoopMaxFrequency", 0, 0).data1 == 2000, "the default of 15"


def test_a_vertical_stage_is_slower_where_its_amplitude_is_smaller() -> None:
    client = in_the_middle()
    client.ok("SetPositionerAlignment_A", 0, 0, 1, 1000, 550)
    durations = []
    for target in (10_000, 0):
        start_s = client.clock.now_s()
        client.ok("MovePositionAbsolute_A", 0, 0, target, 0)
        client.until(COMPLETED)
        durations.append(client.clock.now_s() - start_s)
    assert durations[1] > 1.6 * durations[0]


@settings(max_examples=60)
@given(
    st.lists(
        st.one_of(
            st.tuples(st.just("MoveStep_A"), st.integers(-30000, 30000), st.integers(150, 1000),
                      st.integers(1, 18500)),
            st.tuples(st.just("MovePositionAbsolute_A"), st.integers(-(2**31), 2**31 - 1),
                      st.sampled_from([0, 10, 60000])),
            st.tuples(st.just("MovePositionRelative_A"), st.integers(-(2**31), 2**31 - 1),
                      st.just(0)),
            st.tuples(st.just("MoveToReference_A"), st.just(0), st.sampled_from([0, 1])),
            st.tuples(st.just("CalibrateSensor_A")),
            st.tuples(st.just("SetZero_A")),
            st.tuples(st.just("SetScale_A"), st.integers(-(2**31), 2**31 - 1),
                      st.sampled_from([0, 1])),
            st.tuples(st.just("Stop_A")),
        ),
        max_size=8,
    ),
    st.floats(0.0, 3.0),
)  # fmt: skip
def test_whatever_is_commanded_the_stage_stays_in_its_travel_and_the_numbers_are_sane(
    commands: list[tuple[object, ...]], pause_s: float
) -> None:
    client = Client()
    for name, *args in commands:
        client.ok(str(name), 0, 0, *args)
        client.advance(pause_s)
        assert -6000.0 <= client.truth() <= 6000.0
        client.ok("GetPosition_A", 0, 0)
        assert client.until(2).channel == 0
        client.ok("GetStatus_A", 0, 0)
        assert client.until(5).data1 in range(7)
