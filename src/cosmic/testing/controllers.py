"""The contract of a `Controller`, as a suite for pytest.

A package that brings one derives from `ControllerContract`, says how its controller is made over a
fake, and which channels have what::

    class TestMyStage(ControllerContract):
        def make_controller(self) -> Controller:
            return make_my_stage(FakeStage())

Every test opens and closes a controller of its own.
"""

import math
from abc import abstractmethod
from collections.abc import Callable, Iterator
from typing import ClassVar, TypeVar

import pytest

from cosmic.frame.clock import WALL
from cosmic.frame.errors import DeviceError, DeviceFault, NotConnectedError
from cosmic.frame.units import AxisUnit
from cosmic.mico.hw.interface import (
    Activity,
    ActivityRead,
    Channel,
    Completed,
    Controller,
    Event,
    Failed,
    MatchedMove,
    PositionerKind,
    PositionKnownRead,
    PositionRead,
    SensorPresentRead,
    TypeRead,
)

E = TypeVar("E", bound=Event)
FOR_EVER = math.inf
_TRIES = 2000
_WAIT_S = 0.1
_REST_S = 30.0


class ControllerContract:
    """What MiCo relies on in any controller.

    Attributes
    ----------
    closed_loop : Channel
        An axis with a sensor.
    unit : str
        Its unit, "um" or "deg".
    steps_only : Channel or None
        An axis without sensor; None where there is none.
    nothing : Channel
        Where no device has a channel.
    ways : tuple of (float, float)
        Two targets that `closed_loop` can go to quickly.
    tolerance : float
        How near it comes.
    """

    closed_loop: ClassVar[Channel] = Channel(0, 0)
    unit: ClassVar[AxisUnit] = "um"
    steps_only: ClassVar[Channel | None] = None
    nothing: ClassVar[Channel] = Channel(0, 99)
    ways: ClassVar[tuple[float, float]] = (20.0, -5.0)
    tolerance: ClassVar[float] = 1.0

    @abstractmethod
    def make_controller(self) -> Controller:
        """Return the controller over its fake or its simulator, not open."""

    # What the tests use

    @pytest.fixture
    def controller(self) -> Iterator[Controller]:
        """A controller that is not open; closed afterwards."""
        made = self.make_controller()
        yield made
        made.close()

    @pytest.fixture
    def opened(self, controller: Controller) -> Controller:
        """A controller that is open."""
        controller.open()
        return controller

    @staticmethod
    def event(controller: Controller, kind: type[E], at: Channel) -> E:
        """Return the next event of that kind and channel; skip the others."""
        for _ in range(_TRIES):
            event = controller.receive(at.device, _WAIT_S)
            if isinstance(event, kind) and event.channel == at:
                return event
        raise AssertionError(f"no {kind.__name__} from {at}")

    def position(self, controller: Controller) -> float:
        """Ask where the axis with a sensor is."""
        controller.ask_position(self.closed_loop, self.unit)
        return self.event(controller, PositionRead, self.closed_loop).value

    def come_to_rest(self, controller: Controller, at: Channel) -> Activity:
        """Wait until an axis is stationary, and return what it does then."""
        ends_s = WALL.now_s() + _REST_S
        while WALL.now_s() < ends_s:
            controller.ask_activity(at)
            activity = self.event(controller, ActivityRead, at).activity
            if activity.at_rest:
                return activity
        raise AssertionError(f"{at} does not come to rest")

    def refused(self, attempt: Callable[[], object], *faults: DeviceFault) -> None:
        """Check that a call is refused at once, for one of these faults."""
        with pytest.raises(DeviceError) as caught:
            attempt()
        assert caught.value.fault in faults, caught.value

    # Opening and closing

    def test_the_devices_are_found_before_anything_is_open(self, controller: Controller) -> None:
        serials = controller.find_devices()
        assert serials
        assert len(serials) == len(set(serials))

    def test_open_reports_number_serial_and_firmware_of_each_device(
        self, controller: Controller
    ) -> None:
        serials = controller.find_devices()
        devices = controller.open()
        assert [each.index for each in devices] == list(range(len(devices)))
        assert {each.serial for each in devices} == set(serials)
        assert all(each.firmware for each in devices)

    def test_only_the_devices_named_are_opened(self, controller: Controller) -> None:
        last = controller.find_devices()[-1]
        assert [each.serial for each in controller.open([last])] == [last]
        self.refused(lambda: controller.ask_activity(Channel(1, 0)), DeviceFault.NO_CHANNEL)

    def test_a_device_that_is_not_there_is_named_with_those_that_are(
        self, controller: Controller
    ) -> None:
        there = controller.find_devices()
        with pytest.raises(NotConnectedError) as caught:
            controller.open([there[0], 999_999])
        assert "999999" in str(caught.value)
        assert str(there[0]) in str(caught.value)
        assert len(controller.open()) == len(there)

    def test_naming_some_devices_once_does_not_limit_the_next_open(
        self, controller: Controller
    ) -> None:
        there = controller.find_devices()
        controller.open(there[:1])
        controller.close()
        assert len(controller.open()) == len(there)

    def test_opening_twice_is_refused_and_leaves_the_first_in_force(
        self, opened: Controller
    ) -> None:
        self.refused(opened.open, DeviceFault.STATE)
        opened.ask_activity(self.closed_loop)

    def test_closing_is_harmless_at_any_time_and_can_be_followed_by_open(
        self, controller: Controller
    ) -> None:
        controller.close()
        count = len(controller.open())
        controller.close()
        controller.close()
        assert len(controller.open()) == count

    def test_commands_and_waiting_need_an_open_controller(self, controller: Controller) -> None:
        controller.open()
        controller.close()
        self.refused(lambda: controller.stop(self.closed_loop), DeviceFault.STATE)
        self.refused(lambda: controller.receive(0, 0.0), DeviceFault.STATE)

    def test_it_has_a_name_and_says_what_it_can_do(self, controller: Controller) -> None:
        assert controller.name
        controller.open()
        able = controller.device_capabilities(0)
        assert able.channels >= 1
        assert able.frequency_hz[0] <= able.frequency_hz[1]
        assert able.amplitude_v[0] <= able.amplitude_v[1]

    # Channels

    def test_a_channel_that_is_not_there_is_refused_at_once(self, opened: Controller) -> None:
        for at in (self.nothing, Channel(99, 0), Channel(-1, 0), Channel(0, -1)):
            with pytest.raises(DeviceError) as caught:
                opened.ask_sensor_present(at)
            assert caught.value.fault is DeviceFault.NO_CHANNEL
            assert (caught.value.device, caught.value.channel) == (at.device, at.channel)

    def test_a_number_that_32_bit_would_wrap_round_reaches_no_channel(
        self, opened: Controller
    ) -> None:
        at = Channel(self.closed_loop.device, self.closed_loop.channel + 2**32)
        self.refused(lambda: opened.ask_position(at, self.unit), DeviceFault.NO_CHANNEL)
        self.refused(lambda: opened.stop(at), DeviceFault.NO_CHANNEL)

    def test_waiting_ends_without_an_event_when_nothing_happens(self, opened: Controller) -> None:
        assert opened.receive(0, 0.01) is None

    @pytest.mark.parametrize("timeout_s", [math.nan, math.inf, -0.1])
    def test_a_wait_that_has_no_end_is_refused(self, opened: Controller, timeout_s: float) -> None:
        self.refused(lambda: opened.receive(0, timeout_s), DeviceFault.PARAMETER)

    def test_devices_have_separate_queues(self, opened: Controller) -> None:
        at = self.closed_loop
        opened.ask_type(at)
        for device in range(len(opened.find_devices())):
            if device != at.device:
                assert opened.receive(device, 0.01) is None
        self.event(opened, TypeRead, at)

    def test_a_channel_reports_whether_it_has_a_sensor(self, opened: Controller) -> None:
        opened.ask_sensor_present(self.closed_loop)
        assert self.event(opened, SensorPresentRead, self.closed_loop).present
        if self.steps_only is not None:
            opened.ask_sensor_present(self.steps_only)
            assert not self.event(opened, SensorPresentRead, self.steps_only).present

    def test_a_channel_reports_its_type(self, opened: Controller) -> None:
        opened.ask_type(self.closed_loop)
        kind = PositionerKind.ROTARY if self.unit == "deg" else PositionerKind.LINEAR
        assert self.event(opened, TypeRead, self.closed_loop).positioner.kind is kind

    def test_a_position_in_the_wrong_unit_is_reported_as_the_wrong_kind(
        self, opened: Controller
    ) -> None:
        opened.ask_position(self.closed_loop, "um" if self.unit == "deg" else "deg")
        failed = self.event(opened, Failed, self.closed_loop)
        assert failed.error.fault is DeviceFault.WRONG_KIND

    def test_a_position_needs_a_sensor(self, opened: Controller) -> None:
        if self.steps_only is None:
            return
        opened.ask_position(self.steps_only, "um")
        failed = self.event(opened, Failed, self.steps_only)
        assert failed.error.fault is DeviceFault.NO_SENSOR
        assert (failed.error.device, failed.error.channel) == (
            self.steps_only.device,
            self.steps_only.channel,
        )
        opened.move_to(self.steps_only, 1.0, "um", hold_s=0.0)
        assert self.event(opened, Failed, self.steps_only).error.fault is DeviceFault.NO_SENSOR

    def test_the_answers_of_a_channel_keep_the_order_of_the_questions(
        self, opened: Controller
    ) -> None:
        at = self.closed_loop
        for _ in range(3):
            opened.ask_type(at)
            opened.ask_sensor_present(at)
            opened.ask_position(at, self.unit)
        kinds: list[type] = []
        for _ in range(_TRIES):
            event = opened.receive(at.device, _WAIT_S)
            kinds += [] if event is None else [type(event)]
            if len(kinds) == 9:
                break
        assert kinds == [TypeRead, SensorPresentRead, PositionRead] * 3

    # Movements

    def test_a_movement_is_reported_when_it_has_reached_its_target(
        self, opened: Controller
    ) -> None:
        opened.report_completion(self.closed_loop)
        for target in self.ways:
            opened.move_to(self.closed_loop, target, self.unit, hold_s=FOR_EVER)
            self.event(opened, Completed, self.closed_loop)
            assert self.position(opened) == pytest.approx(target, abs=self.tolerance)

    def test_a_relative_movement_starts_where_the_positioner_stands(
        self, opened: Controller
    ) -> None:
        first, second = self.ways
        opened.report_completion(self.closed_loop)
        opened.move_to(self.closed_loop, first, self.unit, hold_s=FOR_EVER)
        self.event(opened, Completed, self.closed_loop)
        opened.move_by(self.closed_loop, second - first, self.unit, hold_s=FOR_EVER)
        self.event(opened, Completed, self.closed_loop)
        assert self.position(opened) == pytest.approx(second, abs=2.0 * self.tolerance)

    def test_a_target_held_for_ever_is_held_until_stop(self, opened: Controller) -> None:
        opened.report_completion(self.closed_loop)
        opened.move_to(self.closed_loop, self.ways[0], self.unit, hold_s=FOR_EVER)
        self.event(opened, Completed, self.closed_loop)
        assert self.come_to_rest(opened, self.closed_loop) is Activity.HOLDING
        opened.stop(self.closed_loop)
        assert self.come_to_rest(opened, self.closed_loop) is Activity.STOPPED

    def test_a_target_that_is_not_held_ends_in_stopped(self, opened: Controller) -> None:
        opened.move_to(self.closed_loop, self.ways[0], self.unit, hold_s=0.0)
        assert self.come_to_rest(opened, self.closed_loop) is Activity.STOPPED

    def test_a_stop_ends_a_movement_before_its_target(self, opened: Controller) -> None:
        before = self.position(opened)
        target = before + 50.0 * (self.ways[0] - self.ways[1])
        opened.move_to(self.closed_loop, target, self.unit, hold_s=FOR_EVER)
        opened.stop(self.closed_loop)
        assert self.come_to_rest(opened, self.closed_loop) is Activity.STOPPED
        assert abs(self.position(opened) - target) > self.tolerance

    def test_stop_is_accepted_at_rest(self, opened: Controller) -> None:
        opened.stop(self.closed_loop)
        opened.stop(self.closed_loop)

    def test_a_referenced_positioner_knows_its_position(self, opened: Controller) -> None:
        opened.report_completion(self.closed_loop)
        opened.reference(self.closed_loop, hold_s=0.0)
        self.event(opened, Completed, self.closed_loop)
        opened.ask_position_known(self.closed_loop)
        assert self.event(opened, PositionKnownRead, self.closed_loop).known

    def test_steps_come_to_an_end_or_are_not_known(self, opened: Controller) -> None:
        at = self.steps_only or self.closed_loop
        opened.report_completion(at)
        volts = opened.device_capabilities(at.device).amplitude_v[1]
        try:
            opened.step(at, 100, amplitude_v=volts, frequency_hz=1000)
        except DeviceError as exc:
            assert exc.fault is DeviceFault.UNSUPPORTED
            return
        self.event(opened, Completed, at)
        assert self.come_to_rest(opened, at) is Activity.STOPPED

    # What is refused

    def test_a_target_that_is_no_number_or_too_far_is_refused(self, opened: Controller) -> None:
        at = self.closed_loop
        for target in (math.nan, math.inf, -math.inf, 2.2e8, -2.2e8):
            for move in (opened.move_to, opened.move_by):
                with pytest.raises(DeviceError) as caught:
                    move(at, target, self.unit, hold_s=0.0)
                assert caught.value.fault is DeviceFault.PARAMETER
                assert f"device {at.device}, channel {at.channel}" in str(caught.value)
        assert self.come_to_rest(opened, at).at_rest

    def test_a_hold_time_that_would_not_be_kept_is_refused(self, opened: Controller) -> None:
        at = self.closed_loop
        for hold_s in (math.nan, -math.inf, -0.001, 1e9):
            with pytest.raises(DeviceError) as caught:
                opened.move_to(at, 1.0, self.unit, hold_s=hold_s)
            assert caught.value.fault is DeviceFault.PARAMETER
            with pytest.raises(DeviceError) as caught:
                opened.reference(at, hold_s=hold_s)
            assert caught.value.fault is DeviceFault.PARAMETER

    def test_steps_out_of_range_are_refused_and_nothing_moves(self, opened: Controller) -> None:
        at, able = self.closed_loop, opened.device_capabilities(self.closed_loop.device)
        (slow, fast), (low_v, high_v) = able.frequency_hz, able.amplitude_v
        before = self.position(opened)
        for steps, amplitude_v, frequency_hz in (
            (able.most_steps + 1, high_v, slow),
            (-able.most_steps - 1, high_v, slow),
            (2**32 + 1, high_v, slow),
            (1.5, high_v, slow),
            (math.nan, high_v, slow),
            (1, low_v - 0.1, slow),
            (1, high_v + 0.1, slow),
            (1, math.nan, slow),
            (1, high_v, slow - 1),
            (1, high_v, fast + 1),
            (1, high_v, -1),
            (1, high_v, math.nan),
        ):
            with pytest.raises(DeviceError) as caught:
                opened.step(
                    at,
                    steps,  # type: ignore[arg-type] # what a script may give
                    amplitude_v=amplitude_v,
                    frequency_hz=frequency_hz,  # type: ignore[arg-type]
                )
            assert caught.value.fault is DeviceFault.PARAMETER
        assert self.position(opened) == pytest.approx(before, abs=self.tolerance)

    def test_what_lies_beyond_the_common_ground_is_done_or_refused(
        self, opened: Controller
    ) -> None:
        at, able = self.closed_loop, opened.device_capabilities(self.closed_loop.device)
        speed = 10.0 * abs(self.ways[0] - self.ways[1])
        move = MatchedMove(at, self.ways[0], self.unit, FOR_EVER, speed, 50.0 * speed, 50.0)
        if able.velocity:
            opened.set_speed(at, speed, 50.0 * speed, self.unit)
        else:
            self.refused(
                lambda: opened.set_speed(at, speed, 50.0 * speed, self.unit),
                DeviceFault.UNSUPPORTED,
            )
        if able.group_start:
            opened.move_together([move])
            self.event(opened, Completed, at)
            assert self.position(opened) == pytest.approx(self.ways[0], abs=self.tolerance)
        else:
            self.refused(lambda: opened.move_together([move]), DeviceFault.UNSUPPORTED)

    def test_a_frequency_out_of_range_is_refused(self, opened: Controller) -> None:
        low, high = opened.device_capabilities(self.closed_loop.device).frequency_hz
        opened.set_closed_loop_frequency(self.closed_loop, low)
        opened.set_closed_loop_frequency(self.closed_loop, high)
        for frequency_hz in (low - 1, high + 1, -5, 1.5, math.nan):
            with pytest.raises(DeviceError) as caught:
                opened.set_closed_loop_frequency(
                    self.closed_loop,
                    frequency_hz,  # type: ignore[arg-type] # what a script may give
                )
            assert caught.value.fault is DeviceFault.PARAMETER
