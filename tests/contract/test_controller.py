"""Our controllers under the suite that other packages import, and what else these makes do."""

import ctypes
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
from contract.fake_scu3d import LINEAR_TYPE, FakeScu3d
from contract.fake_scu_serial import FakeScuLines
from contract.fake_smaractctl import FakeSmaractctl
from cosmic.frame.clock import ManualClock, RatedClock
from cosmic.frame.errors import DeviceError, DeviceFault
from cosmic.mico.hw.interface import (
    Activity,
    Channel,
    Completed,
    Controller,
    Direction,
    MatchedMove,
    PositionerKind,
    SafeDirectionRead,
    TypeRead,
)
from cosmic.mico.hw.joined import JoinedController
from cosmic.mico.hw.scu3d import Scu3dController
from cosmic.mico.hw.scu_serial import ScuSerialController
from cosmic.mico.hw.sim_scu3d import load_simulated_library
from cosmic.mico.hw.sim_smaractctl import load_simulated_library as load_simulated_smaractctl
from cosmic.mico.hw.smaractctl import SmaractCtlController
from cosmic.testing.controllers import ControllerContract

LINEAR, OTHER_LINEAR = Channel(0, 0), Channel(0, 1)
ROTARY, NO_SENSOR = Channel(3, 0), Channel(3, 1)
FOR_EVER = math.inf
MAKES: dict[str, Callable[[], Controller]] = {
    "simulated": simulated,
    "fake": over_fake,
    "simulated_mcs2": simulated_mcs2,
    "fake_mcs2": mcs2_over_fake,
    "simulated_serial": simulated_serial,
    "fake_serial": serial_over_fake,
    "pylablib": pylablib_over_fake,
    "pi": pi_over_fake,
}


class _OfThreeChannels(ControllerContract):
    steps_only = NO_SENSOR
    nothing = Channel(0, 3)


class _ARotaryAxis(_OfThreeChannels):
    closed_loop = ROTARY
    unit = "deg"
    ways = (3.0, -1.0)
    tolerance = 0.05


class _ArrivesAtOnce(ControllerContract):
    def test_a_stop_ends_a_movement_before_its_target(self, opened: Controller) -> None:
        """Not asked: this fake arrives at once."""


class TestSimulatedScu(_OfThreeChannels):
    make_controller = staticmethod(simulated)


class TestSimulatedScuRotary(_ARotaryAxis):
    make_controller = staticmethod(simulated)


class TestScuOverFake(_ArrivesAtOnce, _OfThreeChannels):
    make_controller = staticmethod(over_fake)


class TestScuOverFakeRotary(_ArrivesAtOnce, _ARotaryAxis):
    make_controller = staticmethod(over_fake)


class TestSimulatedMcs2(_OfThreeChannels):
    make_controller = staticmethod(simulated_mcs2)


class TestSimulatedMcs2Rotary(_ARotaryAxis):
    make_controller = staticmethod(simulated_mcs2)


class TestMcs2OverFake(_ArrivesAtOnce, _OfThreeChannels):
    make_controller = staticmethod(mcs2_over_fake)


class TestSimulatedSerialScu(_OfThreeChannels):
    make_controller = staticmethod(simulated_serial)


class TestSimulatedSerialScuRotary(_ARotaryAxis):
    make_controller = staticmethod(simulated_serial)


class TestSerialScuOverFake(_ArrivesAtOnce, _OfThreeChannels):
    make_controller = staticmethod(serial_over_fake)


class TestStagesOfPylablib(_ArrivesAtOnce, _OfThreeChannels):
    make_controller = staticmethod(pylablib_over_fake)


class TestStagesOfPi(_ArrivesAtOnce, _OfThreeChannels):
    make_controller = staticmethod(pi_over_fake)


class TestStagesOfPiRotary(_ArrivesAtOnce, _ARotaryAxis):
    make_controller = staticmethod(pi_over_fake)


class TestControllersOfTwoMakes(_OfThreeChannels):
    def make_controller(self) -> Controller:
        return JoinedController([simulated(), simulated_mcs2()])


@pytest.fixture(params=MAKES.values(), ids=list(MAKES))
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


def test_open_reports_number_serial_and_firmware_of_each_device(controller: Controller) -> None:
    serials = controller.find_devices()
    devices = controller.open()
    assert [device.index for device in devices] == [0, 1, 2, 3]
    assert {device.serial for device in devices} == set(serials)
    assert all(re.fullmatch(r"\d+\.\d+\.\d+", device.firmware) for device in devices)


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


def test_stop_is_accepted_by_every_channel_at_rest(rig: Rig) -> None:
    for device in range(4):
        for channel in range(3):
            rig.controller.stop(Channel(device, channel))


def test_steps_go_in_the_direction_of_their_sign(rig: Rig) -> None:
    start_um = rig.position(OTHER_LINEAR)
    if not done(
        rig,
        lambda: rig.controller.step(OTHER_LINEAR, -50, amplitude_v=80.0, frequency_hz=1000),
    ):
        return
    rig.come_to_rest(OTHER_LINEAR)
    assert rig.position(OTHER_LINEAR) < start_um


def test_a_channel_reports_which_way_it_looks_for_its_reference(rig: Rig) -> None:
    if not done(rig, lambda: rig.controller.ask_safe_direction(LINEAR)):
        return
    assert rig.event(SafeDirectionRead, LINEAR).direction is Direction.BACKWARD


def inverted(make: str) -> Controller:
    """Return a controller of a make whose channel 0.1 has an inverted scale stored."""
    if make == "simulated_mcs2":
        mcs2 = load_simulated_smaractctl(clock=ManualClock(auto_advance=True))
        handle = ctypes.c_uint32()
        assert mcs2.SA_CTL_Open(ctypes.byref(handle), b"usb:ix:0", b"") == 0
        assert mcs2.SA_CTL_SetProperty_i32(handle, 1, 0x02040025, 1) == 0
        assert mcs2.SA_CTL_Close(handle) == 0
        return SmaractCtlController(mcs2, simulated=True)
    if make == "simulated":
        scu = load_simulated_library(clock=ManualClock(auto_advance=True))
        assert scu.SA_InitDevices(0) == scu.SA_SetScale_S(0, 1, 250_000, 1) == 0
        return Scu3dController(scu, simulated=True)
    if make == "fake_mcs2":
        fake_mcs2 = FakeSmaractctl({"MCS2-101": "LLL"})
        fake_mcs2.devices[0].channels[1].written[0x02040025] = 1
        return SmaractCtlController(fake_mcs2)
    lines = FakeScuLines()
    lines.units[0].inverted = {1}
    return ScuSerialController("0", lines.open_port, answer_s=0.2)


@pytest.mark.parametrize("make", ["simulated", "simulated_mcs2", "fake_mcs2", "fake_serial"])
def test_an_axis_whose_scale_is_inverted_in_the_controller_has_no_kind_that_is_moved(
    make: str,
) -> None:
    """Positions run the other way then; steps and searches for an end do not."""
    with Rig(inverted(make)) as rig:
        for at, kind in ((LINEAR, PositionerKind.LINEAR), (OTHER_LINEAR, None)):
            rig.controller.ask_type(at)
            found = rig.event(TypeRead, at).positioner
            assert found.kind is kind
            assert ("inverted" in found.name) is (kind is None)


def test_a_stored_offset_is_not_taken_for_an_inverted_scale() -> None:
    fake = FakeScu3d({101: [LINEAR_TYPE] * 3})
    with Rig(Scu3dController(fake)) as rig:
        fake.opened[0][0].offset_nm = 1
        fake.opened[0][1].inverted = 1
        for at, kind in ((LINEAR, PositionerKind.LINEAR), (OTHER_LINEAR, None)):
            rig.controller.ask_type(at)
            assert rig.event(TypeRead, at).positioner.kind is kind


def test_the_end_stops_are_found_in_both_directions(rig: Rig) -> None:
    found_um = []
    for direction in (Direction.BACKWARD, Direction.FORWARD):
        run = partial(rig.controller.move_to_end_stop, OTHER_LINEAR, direction, hold_s=0.0)
        if not done(rig, run):
            return
        assert rig.come_to_rest(OTHER_LINEAR) is Activity.STOPPED
        found_um.append(rig.position(OTHER_LINEAR))
    assert found_um[0] < found_um[1] - 1000.0


def test_an_end_stop_is_found_whatever_was_aimed_at_before(rig: Rig) -> None:
    stops_um: dict[Direction, list[float]] = {each: [] for each in Direction}
    rig.controller.report_completion(LINEAR)
    ways = (Direction.FORWARD, Direction.FORWARD, Direction.BACKWARD, Direction.FORWARD)
    for direction in ways:
        run = partial(rig.controller.move_to_end_stop, LINEAR, direction, hold_s=0.0)
        if not done(rig, run):
            return
        rig.come_to_rest(LINEAR)
        stops_um[direction].append(rig.position(LINEAR))
    (low_um,) = stops_um[Direction.BACKWARD]
    assert stops_um[Direction.FORWARD] == pytest.approx(
        [stops_um[Direction.FORWARD][0]] * 3, abs=1.0
    )
    assert low_um < stops_um[Direction.FORWARD][0] - 10_000.0
    # Away from there it goes by as much as it is told.
    rig.controller.move_by(LINEAR, -40.0, "um", hold_s=0.0)
    rig.come_to_rest(LINEAR)
    assert rig.position(LINEAR) == pytest.approx(stops_um[Direction.FORWARD][0] - 40.0, abs=1.0)


def test_calibration_is_reported_when_it_has_ended(rig: Rig) -> None:
    rig.controller.report_completion(LINEAR)
    if done(rig, lambda: rig.controller.calibrate(LINEAR)):
        rig.event(Completed, LINEAR)


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


def test_the_ends_of_the_ranges_belong_to_them(rig: Rig) -> None:
    can = rig.controller.capabilities
    for steps, amplitude_v in zip((can.most_steps, -can.most_steps), can.amplitude_v, strict=True):
        rig.controller.step(
            NO_SENSOR, steps, amplitude_v=amplitude_v, frequency_hz=can.frequency_hz[1]
        )
        rig.controller.stop(NO_SENSOR)


@pytest.mark.parametrize("make", [simulated_mcs2, mcs2_over_fake])
def test_a_group_of_an_mcs2_starts_together(make: Callable[[], Controller]) -> None:
    other = Channel(0, 2)
    moves = [
        MatchedMove(at, target, "um", FOR_EVER, speed, 50.0 * speed, 50.0)
        for at, target, speed in ((LINEAR, 300.0, 600.0), (other, -150.0, 300.0))
    ]
    with Rig(make()) as rig:
        rig.controller.move_together(moves)
        rig.event(Completed, LINEAR)
        rig.come_to_rest(other)
        assert rig.position(LINEAR) == pytest.approx(300.0, abs=0.2)
        assert rig.position(other) == pytest.approx(-150.0, abs=0.2)


def test_a_speed_that_an_mcs2_refuses_in_motion_can_be_refused_as_often_as_one_likes() -> None:
    """The library keeps 240 answers that nobody has fetched, and takes no question after that."""
    library = load_simulated_smaractctl("LLL", clock=RatedClock(1.0))
    with Rig(SmaractCtlController(library, simulated=True)) as rig:
        rig.controller.set_closed_loop_frequency(LINEAR, 50)
        rig.controller.move_to(LINEAR, 3000.0, "um", hold_s=0.0)
        rig.controller.set_speed(LINEAR, 100.0, 1000.0, "um")
        for _ in range(250):
            with pytest.raises(DeviceError) as refusal:
                rig.controller.move_to(LINEAR, 2000.0, "um", hold_s=0.0)
            assert refusal.value.fault is DeviceFault.BUSY
        rig.controller.stop(LINEAR)
        assert math.isfinite(rig.position(LINEAR))
