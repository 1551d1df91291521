"""What MiCo relies on in any `Controller`, against the simulated library and a fake one."""

import math
import re
from collections.abc import Callable, Iterator
from functools import partial

import pytest

from contract.controller_rig import (
    Rig,
    mcs2_over_fake,
    over_fake,
    pi_over_fake,
    pylablib_over_fake,
    serial_over_fake,
    simulated,
    simulated_mcs2,
    simulated_serial,
)
from cosmic.frame.errors import DeviceError, DeviceFault, NotConnectedError
from cosmic.frame.units import AxisUnit
from cosmic.mico.hw.interface import (
    Activity,
    Channel,
    Completed,
    Controller,
    Direction,
    Failed,
    MatchedMove,
    PositionerKind,
    PositionKnownRead,
    PositionRead,
    SafeDirectionRead,
    SensorPresentRead,
    TypeRead,
)

LINEAR, OTHER_LINEAR = Channel(0, 0), Channel(0, 1)
ROTARY, NO_SENSOR = Channel(3, 0), Channel(3, 1)
NO_SUCH_CHANNEL, NO_SUCH_DEVICE = Channel(0, 3), Channel(4, 0)
FOR_EVER = math.inf


@pytest.fixture(
    params=[
        simulated,
        over_fake,
        simulated_mcs2,
        mcs2_over_fake,
        simulated_serial,
        serial_over_fake,
        pylablib_over_fake,
        pi_over_fake,
    ],
    ids=[
        "simulated",
        "fake",
        "simulated_mcs2",
        "fake_mcs2",
        "simulated_serial",
        "fake_serial",
        "pylablib",
        "pi",
    ],
)
def controller(request: pytest.FixtureRequest) -> Iterator[Controller]:
    make: Callable[[], Controller] = request.param
    made = make()
    yield made
    made.close()


def done(rig: Rig, call: Callable[[], None]) -> bool:
    """Do what stages of other makes may refuse, but only as something that they cannot do."""
    try:
        call()
    except DeviceError as exc:
        assert exc.fault is DeviceFault.UNSUPPORTED
        assert rig.controller.name.startswith(("pi", "py"))
        return False
    return True


@pytest.fixture
def rig(controller: Controller) -> Iterator[Rig]:
    with Rig(controller) as opened:
        yield opened


def test_the_devices_are_found_before_anything_is_open(controller: Controller) -> None:
    serials = controller.find_devices()
    assert len(serials) == len(set(serials)) == 4


def test_open_reports_number_serial_and_firmware_of_each_device(controller: Controller) -> None:
    serials = controller.find_devices()
    devices = controller.open()
    assert [device.index for device in devices] == [0, 1, 2, 3]
    assert {device.serial for device in devices} == set(serials)
    assert all(re.fullmatch(r"\d+\.\d+\.\d+", device.firmware) for device in devices)


def test_only_the_devices_named_are_opened(controller: Controller) -> None:
    serials = controller.find_devices()
    devices = controller.open([serials[2], serials[1]])
    assert {device.serial for device in devices} == {serials[1], serials[2]}
    with pytest.raises(DeviceError):
        controller.ask_activity(Channel(2, 0))


def test_naming_some_devices_once_does_not_limit_the_next_open(controller: Controller) -> None:
    controller.open(controller.find_devices()[:1])
    controller.close()
    assert len(controller.open()) == 4


def test_a_device_that_is_not_there_is_named_with_those_that_are(controller: Controller) -> None:
    serials = controller.find_devices()
    with pytest.raises(NotConnectedError) as caught:
        controller.open([serials[0], 999_999])
    assert "999999" in str(caught.value)
    assert str(serials[3]) in str(caught.value)
    assert len(controller.open()) == 4


def test_opening_twice_is_refused_and_leaves_the_first_in_force(controller: Controller) -> None:
    controller.open()
    with pytest.raises(DeviceError) as caught:
        controller.open()
    assert caught.value.fault is DeviceFault.STATE
    controller.ask_activity(LINEAR)


def test_closing_is_harmless_at_any_time_and_can_be_followed_by_open(
    controller: Controller,
) -> None:
    controller.close()
    controller.open()
    controller.close()
    controller.close()
    assert len(controller.open()) == 4


def test_commands_and_waiting_need_an_open_controller(controller: Controller) -> None:
    controller.open()
    controller.close()
    for attempt in (lambda: controller.stop(LINEAR), lambda: controller.receive(0, 0.0)):
        with pytest.raises(DeviceError) as caught:
            attempt()
        assert caught.value.fault is DeviceFault.STATE


def test_the_name_says_what_drives_it(controller: Controller) -> None:
    assert re.match(
        r"(SCU3DControl|SmarActCTL|pylablib|pipython) \d+\.\d+\.\d+|SCU over RS-232",
        controller.name,
    )
    assert ("simulated" in controller.name) == controller.simulated


def test_the_capabilities_are_those_of_the_make(controller: Controller) -> None:
    capabilities = controller.capabilities
    able = "SmarActCTL" in controller.name
    assert capabilities.group_start is able
    assert capabilities.velocity is able
    assert capabilities.position_known
    controller.open()
    assert controller.device_capabilities(0).channels == 3


@pytest.mark.parametrize("at", [NO_SUCH_CHANNEL, NO_SUCH_DEVICE, Channel(-1, 0), Channel(0, -1)])
def test_a_channel_that_is_not_there_is_refused_at_once(rig: Rig, at: Channel) -> None:
    with pytest.raises(DeviceError) as caught:
        rig.controller.ask_sensor_present(at)
    assert caught.value.fault is DeviceFault.NO_CHANNEL
    assert (caught.value.device, caught.value.channel) == (at.device, at.channel)


def test_a_number_that_32_bit_would_wrap_round_reaches_no_channel(rig: Rig) -> None:
    with pytest.raises(DeviceError) as caught:
        rig.controller.step(Channel(0, 2**32), 1, amplitude_v=50.0, frequency_hz=100)
    assert caught.value.fault is DeviceFault.NO_CHANNEL


def test_waiting_ends_without_an_event_when_nothing_happens(rig: Rig) -> None:
    assert rig.controller.receive(0, 0.01) is None


@pytest.mark.parametrize(("at", "present"), [(LINEAR, True), (ROTARY, True), (NO_SENSOR, False)])
def test_a_channel_reports_whether_it_has_a_sensor(rig: Rig, at: Channel, present: bool) -> None:
    rig.controller.ask_sensor_present(at)
    assert rig.event(SensorPresentRead, at).present is present


@pytest.mark.parametrize(
    ("at", "kind"), [(LINEAR, PositionerKind.LINEAR), (ROTARY, PositionerKind.ROTARY)]
)
def test_a_channel_reports_its_type(rig: Rig, at: Channel, kind: PositionerKind) -> None:
    rig.controller.ask_type(at)
    assert rig.event(TypeRead, at).positioner.kind is kind


def test_a_position_needs_a_sensor(rig: Rig) -> None:
    rig.controller.ask_position(NO_SENSOR, "um")
    failed = rig.event(Failed, NO_SENSOR)
    assert failed.error.fault is DeviceFault.NO_SENSOR
    assert (failed.error.device, failed.error.channel) == (NO_SENSOR.device, NO_SENSOR.channel)


def test_a_position_in_the_wrong_unit_is_reported_as_the_wrong_kind(rig: Rig) -> None:
    rig.controller.ask_position(ROTARY, "um")
    assert rig.event(Failed, ROTARY).error.fault is DeviceFault.WRONG_KIND
    rig.controller.ask_position(LINEAR, "deg")
    assert rig.event(Failed, LINEAR).error.fault is DeviceFault.WRONG_KIND


@pytest.mark.parametrize(
    ("at", "unit", "target"),
    [(LINEAR, "um", 120.4), (LINEAR, "um", -77.7), (ROTARY, "deg", 3.25), (ROTARY, "deg", -1.5)],
)
def test_a_movement_is_reported_when_it_has_reached_its_target(
    rig: Rig, at: Channel, unit: AxisUnit, target: float
) -> None:
    rig.controller.report_completion(at)
    rig.controller.move_to(at, target, unit, hold_s=FOR_EVER)
    rig.event(Completed, at)
    # The fake arrives exactly; a stage arrives within its threshold.
    assert rig.position(at, unit) == pytest.approx(target, abs=1.0 if unit == "um" else 0.02)


@pytest.mark.parametrize(("at", "unit"), [(LINEAR, "um"), (ROTARY, "deg")])
def test_a_relative_movement_starts_where_the_positioner_stands(
    rig: Rig, at: Channel, unit: AxisUnit
) -> None:
    rig.controller.report_completion(at)
    rig.controller.move_to(at, 20.0, unit, hold_s=FOR_EVER)
    rig.event(Completed, at)
    rig.controller.move_by(at, -25.0, unit, hold_s=FOR_EVER)
    rig.event(Completed, at)
    assert rig.position(at, unit) == pytest.approx(-5.0, abs=2.0 if unit == "um" else 0.05)


def test_a_target_held_for_ever_is_held_until_stop(rig: Rig) -> None:
    rig.controller.report_completion(LINEAR)
    rig.controller.move_to(LINEAR, 5.0, "um", hold_s=FOR_EVER)
    rig.event(Completed, LINEAR)
    assert rig.activity(LINEAR) is Activity.HOLDING
    rig.controller.stop(LINEAR)
    assert rig.come_to_rest(LINEAR) is Activity.STOPPED


def test_a_target_that_is_not_held_ends_in_stopped(rig: Rig) -> None:
    rig.controller.move_to(LINEAR, 5.0, "um", hold_s=0.0)
    assert rig.come_to_rest(LINEAR) is Activity.STOPPED


def test_stop_is_accepted_by_every_channel_at_rest(rig: Rig) -> None:
    for device in range(4):
        for channel in range(3):
            rig.controller.stop(Channel(device, channel))


def test_steps_need_no_sensor_and_come_to_an_end(rig: Rig) -> None:
    rig.controller.report_completion(NO_SENSOR)
    rig.controller.step(NO_SENSOR, 100, amplitude_v=100.0, frequency_hz=5000)
    rig.event(Completed, NO_SENSOR)
    assert rig.come_to_rest(NO_SENSOR) is Activity.STOPPED


def test_steps_go_in_the_direction_of_their_sign(rig: Rig) -> None:
    start_um = rig.position(OTHER_LINEAR)
    if not done(
        rig,
        lambda: rig.controller.step(OTHER_LINEAR, -50, amplitude_v=80.0, frequency_hz=1000),
    ):
        return
    rig.come_to_rest(OTHER_LINEAR)
    assert rig.position(OTHER_LINEAR) < start_um


def test_movement_to_a_target_needs_a_sensor(rig: Rig) -> None:
    rig.controller.move_to(NO_SENSOR, 1.0, "um", hold_s=0.0)
    assert rig.event(Failed, NO_SENSOR).error.fault is DeviceFault.NO_SENSOR


def test_a_referenced_positioner_knows_its_position(rig: Rig) -> None:
    rig.controller.report_completion(LINEAR)
    rig.controller.reference(LINEAR, hold_s=0.0)
    rig.event(Completed, LINEAR)
    rig.controller.ask_position_known(LINEAR)
    assert rig.event(PositionKnownRead, LINEAR).known


def test_a_channel_reports_which_way_it_looks_for_its_reference(rig: Rig) -> None:
    if not done(rig, lambda: rig.controller.ask_safe_direction(LINEAR)):
        return
    assert rig.event(SafeDirectionRead, LINEAR).direction is Direction.BACKWARD


def test_the_end_stops_are_found_in_both_directions(rig: Rig) -> None:
    found_um = []
    for direction in (Direction.BACKWARD, Direction.FORWARD):
        run = partial(rig.controller.move_to_end_stop, OTHER_LINEAR, direction, hold_s=0.0)
        if not done(rig, run):
            return
        assert rig.come_to_rest(OTHER_LINEAR) is Activity.STOPPED
        found_um.append(rig.position(OTHER_LINEAR))
    assert found_um[0] < found_um[1] - 1000.0


def test_calibration_is_reported_when_it_has_ended(rig: Rig) -> None:
    rig.controller.report_completion(LINEAR)
    if done(rig, lambda: rig.controller.calibrate(LINEAR)):
        rig.event(Completed, LINEAR)


def test_the_answers_of_a_channel_keep_the_order_of_the_questions(rig: Rig) -> None:
    for _ in range(3):
        rig.controller.ask_type(LINEAR)
        rig.controller.ask_sensor_present(LINEAR)
        rig.controller.ask_position(LINEAR, "um")
    kinds = []
    while len(kinds) < 9:
        event = rig.controller.receive(0, 0.1)
        kinds += [type(event)] if event is not None else []
    assert kinds == [TypeRead, SensorPresentRead, PositionRead] * 3


def test_devices_have_separate_queues(rig: Rig) -> None:
    rig.controller.ask_type(LINEAR)
    assert rig.controller.receive(1, 0.01) is None
    rig.event(TypeRead, LINEAR)


NOT_NUMBERS = [math.nan, math.inf, -math.inf]


@pytest.mark.parametrize("target", [*NOT_NUMBERS, 2.2e8, -2.2e8])
def test_a_target_that_no_counter_can_hold_is_refused(rig: Rig, target: float) -> None:
    for move in (rig.controller.move_to, rig.controller.move_by):
        with pytest.raises(DeviceError) as caught:
            move(LINEAR, target, "um", hold_s=0.0)
        assert caught.value.fault is DeviceFault.PARAMETER
        assert "device 0, channel 0" in str(caught.value)
    assert rig.come_to_rest(LINEAR).at_rest


@pytest.mark.parametrize("hold_s", [math.nan, -math.inf, -0.001, 1e9])
def test_a_hold_time_that_would_not_be_kept_is_refused(rig: Rig, hold_s: float) -> None:
    attempts: list[Callable[[], None]] = [
        lambda: rig.controller.move_to(LINEAR, 1.0, "um", hold_s=hold_s),
        lambda: rig.controller.move_by(ROTARY, 1.0, "deg", hold_s=hold_s),
        lambda: rig.controller.reference(LINEAR, hold_s=hold_s),
        lambda: rig.controller.move_to_end_stop(LINEAR, Direction.FORWARD, hold_s=hold_s),
    ]
    for attempt in attempts:
        with pytest.raises(DeviceError) as caught:
            attempt()
        assert caught.value.fault is DeviceFault.PARAMETER


@pytest.mark.parametrize("make", [simulated, over_fake, simulated_serial, serial_over_fake])
@pytest.mark.parametrize("hold_s", [59.9996, 60.0])
def test_an_scu_refuses_a_hold_time_that_it_would_take_for_endless(
    make: Callable[[], Controller], hold_s: float
) -> None:
    with Rig(make()) as rig, pytest.raises(DeviceError) as caught:
        rig.controller.move_to(LINEAR, 1.0, "um", hold_s=hold_s)
    assert caught.value.fault is DeviceFault.PARAMETER


def test_steps_out_of_range_are_refused_and_nothing_moves(rig: Rig) -> None:
    can, before_um = rig.controller.capabilities, rig.position(LINEAR)
    (slow, fast), (low_v, high_v) = can.frequency_hz, can.amplitude_v
    for steps, amplitude_v, frequency_hz in (
        (can.most_steps + 1, 50.0, 100),
        (-can.most_steps - 1, 50.0, 100),
        (2**32 + 1, 50.0, 100),
        (1.5, 50.0, 100),
        (math.nan, 50.0, 100),
        (1, low_v - 0.1, 100),
        (1, high_v + 0.1, 100),
        (1, math.nan, 100),
        (1, 50.0, slow - 1),
        (1, 50.0, fast + 1),
        (1, 50.0, -1),
        (1, 50.0, math.nan),
    ):
        with pytest.raises(DeviceError) as caught:
            rig.controller.step(
                LINEAR,
                steps,
                amplitude_v=amplitude_v,
                frequency_hz=frequency_hz,
            )
        assert caught.value.fault is DeviceFault.PARAMETER
    assert rig.position(LINEAR) == pytest.approx(before_um, abs=0.1)


def test_the_ends_of_the_ranges_belong_to_them(rig: Rig) -> None:
    can = rig.controller.capabilities
    for steps, amplitude_v in zip((can.most_steps, -can.most_steps), can.amplitude_v, strict=True):
        rig.controller.step(
            NO_SENSOR, steps, amplitude_v=amplitude_v, frequency_hz=can.frequency_hz[1]
        )
        rig.controller.stop(NO_SENSOR)


def test_the_speed_limit_is_taken_within_its_range_only(rig: Rig) -> None:
    low, high = rig.controller.capabilities.frequency_hz
    rig.controller.set_closed_loop_frequency(LINEAR, low)
    rig.controller.set_closed_loop_frequency(LINEAR, high)
    for frequency_hz in (low - 1, high + 1, -5, 1.5, math.nan):
        with pytest.raises(DeviceError) as caught:
            rig.controller.set_closed_loop_frequency(LINEAR, frequency_hz)
        assert caught.value.fault is DeviceFault.PARAMETER


def test_what_the_controller_can_do_beyond_the_common_ground_is_done_or_refused(rig: Rig) -> None:
    other = Channel(0, 2)
    moves = [
        MatchedMove(at, target, "um", FOR_EVER, speed, 50.0 * speed, 50.0)
        for at, target, speed in ((LINEAR, 300.0, 600.0), (other, -150.0, 300.0))
    ]
    can = rig.controller.capabilities
    if not (can.group_start and can.velocity):
        for attempt in (
            lambda: rig.controller.move_together(moves),
            lambda: rig.controller.set_speed(LINEAR, 100.0, 1000.0, "um"),
        ):
            with pytest.raises(DeviceError) as caught:
                attempt()
            assert caught.value.fault is DeviceFault.UNSUPPORTED
        return
    rig.controller.move_together(moves)
    rig.event(Completed, LINEAR)
    rig.come_to_rest(other)
    assert rig.position(LINEAR) == pytest.approx(300.0, abs=0.2)
    assert rig.position(other) == pytest.approx(-150.0, abs=0.2)


@pytest.mark.parametrize("timeout_s", [math.nan, math.inf, -0.1])
def test_a_wait_that_has_no_end_is_refused(rig: Rig, timeout_s: float) -> None:
    with pytest.raises(DeviceError) as caught:
        rig.controller.receive(0, timeout_s)
    assert caught.value.fault is DeviceFault.PARAMETER
