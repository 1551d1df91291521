"""What exactly goes over to the library, and what becomes of its answers."""

import logging
import math
import threading

import pytest

from contract.fake_scu3d import LINEAR_TYPE, ROTARY_TYPE, FakeScu3d
from cosmic.frame.errors import DeviceError, DeviceFault, DeviceTimeout, NotConnectedError
from cosmic.mico.hw import scu3d_ctypes as sa
from cosmic.mico.hw.interface import Channel, Direction, Failed
from cosmic.mico.hw.scu3d import Scu3dController

LINEAR, ROTARY = Channel(0, 0), Channel(0, 1)


@pytest.fixture
def library() -> FakeScu3d:
    return FakeScu3d({11: [LINEAR_TYPE, ROTARY_TYPE], 12: [LINEAR_TYPE]})


@pytest.fixture
def controller(library: FakeScu3d) -> Scu3dController:
    opened = Scu3dController(library)
    opened.open()
    library.calls.clear()
    return opened


def test_the_integers_of_each_command_are_the_vendors(
    library: FakeScu3d, controller: Scu3dController
) -> None:
    controller.step(LINEAR, -7, amplitude_v=15.05, frequency_hz=250)
    controller.move_to(LINEAR, -12.34, "um", hold_s=0.25)
    controller.move_by(LINEAR, 0.1, "um", hold_s=math.inf)
    controller.move_to(ROTARY, -1.5, "deg", hold_s=math.inf)
    controller.move_by(ROTARY, 359.9999, "deg", hold_s=0.0)
    controller.set_closed_loop_frequency(LINEAR, 5000)
    controller.reference(LINEAR, hold_s=math.inf)
    controller.move_to_end_stop(LINEAR, Direction.FORWARD, hold_s=1.0)
    controller.move_to_end_stop(LINEAR, Direction.BACKWARD, hold_s=1.0)
    controller.report_completion(LINEAR)
    assert library.calls == [
        ("SA_MoveStep_A", 0, 0, -7, 150, 250),
        ("SA_MovePositionAbsolute_A", 0, 0, -123, 250),
        ("SA_MovePositionRelative_A", 0, 0, 1, 60_000),
        ("SA_MoveAngleAbsolute_A", 0, 1, -15_000, 0, 60_000),
        ("SA_MoveAngleRelative_A", 0, 1, 3_599_999, 0, 0),
        ("SA_SetClosedLoopMaxFrequency_A", 0, 0, 5000),
        ("SA_MoveToReference_A", 0, 0, 60_000, 0),
        ("SA_MoveToEndStop_A", 0, 0, 1, 1000, 0),
        ("SA_MoveToEndStop_A", 0, 0, 0, 1000, 0),
        ("SA_SetReportOnComplete_A", 0, 0, 1),
    ]


def test_a_refused_value_never_reaches_the_library(
    library: FakeScu3d, controller: Scu3dController
) -> None:
    for attempt in (
        lambda: controller.step(LINEAR, 30_000, amplitude_v=50.0, frequency_hz=100),
        lambda: controller.move_to(LINEAR, math.nan, "um", hold_s=0.0),
        lambda: controller.move_to(LINEAR, 1.0, "um", hold_s=60.0),
        lambda: controller.move_to(ROTARY, 370.0, "deg", hold_s=0.0),
        lambda: controller.stop(Channel(2**32, 0)),
    ):
        with pytest.raises(DeviceError):
            attempt()
    assert library.calls == []


def test_a_status_becomes_an_exception_with_device_and_call(
    library: FakeScu3d, controller: Scu3dController
) -> None:
    library.statuses["SA_MovePositionAbsolute_A"] = 9
    with pytest.raises(DeviceError) as caught:
        controller.move_to(LINEAR, 1.0, "um", hold_s=0.0)
    assert caught.value.fault is DeviceFault.PARAMETER
    assert "device 0 (serial 11), channel 0: SA_MovePositionAbsolute_A(10, 0)" in str(caught.value)


def test_a_status_that_nobody_documented_still_raises(
    library: FakeScu3d, controller: Scu3dController
) -> None:
    library.statuses["SA_Stop_A"] = 77
    with pytest.raises(DeviceError, match="unknown status 77"):
        controller.stop(LINEAR)


@pytest.mark.parametrize(("code", "kind"), [(10, DeviceError), (15, DeviceTimeout)])
def test_waiting_at_a_device_that_is_gone_raises(
    library: FakeScu3d, controller: Scu3dController, code: int, kind: type[DeviceError]
) -> None:
    library.statuses["SA_ReceiveNextPacket_A"] = code
    with pytest.raises(kind, match="device 1 \\(serial 12\\)") as caught:
        controller.receive(1, 0.1)
    assert caught.value.device == 1


def test_waiting_hands_the_time_over_in_milliseconds(
    library: FakeScu3d, controller: Scu3dController
) -> None:
    controller.receive(1, 0.0001)
    controller.receive(0, 0.2)
    assert [call[:2] for call in library.called("SA_ReceiveNextPacket_A")] == [(1, 1), (0, 200)]


def test_trouble_at_the_hardware_comes_as_an_event(
    library: FakeScu3d, controller: Scu3dController
) -> None:
    library.push(1, 1, 0, 132)
    event = controller.receive(1, 0.0)
    assert isinstance(event, Failed)
    assert event.channel == Channel(1, 0)
    assert event.error.fault is DeviceFault.END_STOP


def test_only_asynchronous_mode_without_reset_is_asked_for(library: FakeScu3d) -> None:
    Scu3dController(library).open()
    assert library.called("SA_InitDevices") == [(1,)]


def test_the_devices_are_listed_before_and_chosen_before_they_are_opened(
    library: FakeScu3d,
) -> None:
    Scu3dController(library).open([12])
    names = [call[0] for call in library.calls[:4]]
    assert names == [
        "SA_GetAvailableDevices",
        "SA_ClearInitDevicesList",
        "SA_AddDeviceToInitDevicesList",
        "SA_InitDevices",
    ]


def test_the_firmware_is_read_as_eight_eight_sixteen_bit(library: FakeScu3d) -> None:
    assert [device.firmware for device in Scu3dController(library).open()] == ["2.2.5", "2.2.5"]


def test_a_long_list_of_devices_is_read_whole() -> None:
    serials = {1000 + number: [LINEAR_TYPE] for number in range(100)}
    assert Scu3dController(FakeScu3d(serials)).find_devices() == tuple(serials)


def test_a_list_that_is_always_too_small_ends_in_an_error(library: FakeScu3d) -> None:
    library.statuses["SA_GetAvailableDevices"] = 17
    with pytest.raises(DeviceError, match="ID_LIST_TOO_SMALL"):
        Scu3dController(library).find_devices()


@pytest.mark.parametrize("status", [None, 3])
def test_no_device_at_all_says_what_to_check(status: int | None) -> None:
    library = FakeScu3d({})
    if status is not None:
        library.statuses["SA_GetAvailableDevices"] = status
    assert Scu3dController(library).find_devices() == ()
    with pytest.raises(NotConnectedError, match="USB cable"):
        Scu3dController(library).open()


def test_a_library_that_opens_nothing_is_reported_as_no_device(library: FakeScu3d) -> None:
    library.statuses["SA_InitDevices"] = 0
    with pytest.raises(NotConnectedError, match="USB cable"):
        Scu3dController(library).open()


def test_a_serial_number_that_32_bit_would_wrap_is_refused(library: FakeScu3d) -> None:
    with pytest.raises(DeviceError, match="serial number"):
        Scu3dController(library).open([2**32 + 11])
    assert library.called("SA_InitDevices") == []


def test_a_start_that_fails_half_way_releases_what_it_took(library: FakeScu3d) -> None:
    controller = Scu3dController(library)
    library.statuses["SA_GetDeviceFirmwareVersion"] = 10
    with pytest.raises(DeviceError, match="SA_GetDeviceFirmwareVersion"):
        controller.open()
    assert len(library.called("SA_ReleaseDevices")) == 1
    del library.statuses["SA_GetDeviceFirmwareVersion"]
    assert len(controller.open()) == 2


def test_another_device_than_the_one_asked_for_is_given_back(library: FakeScu3d) -> None:
    library.statuses["SA_GetDeviceID"] = 0  # the serial number read stays 0
    with pytest.raises(NotConnectedError, match="serial number 12; connected: 0"):
        Scu3dController(library).open([12])
    assert len(library.called("SA_ReleaseDevices")) == 1


def test_closing_an_unplugged_device_warns_and_does_not_raise(
    library: FakeScu3d, controller: Scu3dController, caplog: pytest.LogCaptureFixture
) -> None:
    library.statuses["SA_ReleaseDevices"] = 8
    controller.close()
    assert [record.levelno for record in caplog.records] == [logging.WARNING]
    assert "SA_WRITE_ERROR" in caplog.text
    controller.close()
    assert len(library.called("SA_ReleaseDevices")) == 1


def test_an_old_library_reports_what_it_lacks_as_unsupported() -> None:
    missing = tuple(set(sa.PROTOTYPES) - sa.FUNCTIONS_V12)
    controller = Scu3dController(FakeScu3d({11: [LINEAR_TYPE]}, without=missing))
    controller.open()
    assert not controller.capabilities.position_known
    with pytest.raises(DeviceError) as caught:
        controller.ask_position_known(LINEAR)
    assert caught.value.fault is DeviceFault.UNSUPPORTED
    controller.move_to(LINEAR, 1.0, "um", hold_s=0.0)


def test_a_library_that_does_not_report_its_version_still_has_a_name(library: FakeScu3d) -> None:
    assert Scu3dController(library, simulated=True).name == "SCU3DControl 1.5.16 (simulated)"
    library.statuses["SA_GetDLLVersion"] = 12
    assert Scu3dController(library).name == "SCU3DControl of unknown version"


class Blocking:
    """A library in which a wait for packets lasts until the test lets it go."""

    def __init__(self) -> None:
        self.waiting, self.go_on = threading.Event(), threading.Event()
        self.SA_ReceiveNextPacket_A = sa.function_type("SA_ReceiveNextPacket_A")(self._receive)
        self.SA_MoveStep_A = sa.function_type("SA_MoveStep_A")(self._move)
        self.SA_Stop_A = sa.function_type("SA_Stop_A")(lambda device, channel: 0)

    def _receive(self, device: int, timeout: int, packet: object) -> int:
        self.waiting.set()
        self.go_on.wait(10.0)
        return 0

    def _move(self, *_: int) -> int:
        return self._receive(0, 0, None)


@pytest.mark.parametrize("call", ["receive", "step"])
def test_stop_passes_a_call_that_hangs_in_the_library(call: str) -> None:
    library = Blocking()
    controller = Scu3dController(library)
    busy = {
        "receive": lambda: controller.receive(0, 1.0),
        "step": lambda: controller.step(LINEAR, 1, amplitude_v=50.0, frequency_hz=1),
    }
    hanging = threading.Thread(target=busy[call])
    hanging.start()
    assert library.waiting.wait(10.0)
    stopping = threading.Thread(target=lambda: controller.stop(LINEAR))
    stopping.start()
    stopping.join(5.0)
    passed = not stopping.is_alive()
    library.go_on.set()
    hanging.join(10.0)
    stopping.join(10.0)
    assert passed


def test_each_call_is_logged_for_debugging_only(
    controller: Scu3dController, caplog: pytest.LogCaptureFixture
) -> None:
    controller.stop(LINEAR)
    assert caplog.records == []
    with caplog.at_level(logging.DEBUG):
        controller.stop(LINEAR)
    assert [record.getMessage() for record in caplog.records] == ["SA_Stop_A(0, 0) answered 0"]
