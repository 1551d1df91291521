"""Trouble at the simulated hardware, as MiCo sees it through the controller."""

import math
from collections.abc import Iterator

import pytest

from contract.controller_rig import Rig
from cosmic.frame.clock import ManualClock
from cosmic.frame.errors import DeviceError, DeviceFault
from cosmic.mico.hw.interface import Activity, Channel, Failed, PositionRead
from cosmic.mico.hw.scu3d import Scu3dController
from cosmic.mico.hw.sim_scu3d import SimulatedLibrary, load_simulated_library

AT = Channel(0, 0)


@pytest.fixture
def library() -> SimulatedLibrary:
    return load_simulated_library(clock=ManualClock(auto_advance=True))


@pytest.fixture
def rig(library: SimulatedLibrary) -> Iterator[Rig]:
    with Rig(Scu3dController(library, simulated=True)) as opened:
        yield opened


def test_an_unplugged_device_is_reported_at_once_and_spares_the_others(
    rig: Rig, library: SimulatedLibrary
) -> None:
    library.faults.inject("unplugged", device=0)
    for attempt in (lambda: rig.controller.stop(AT), lambda: rig.controller.receive(0, 0.1)):
        with pytest.raises(DeviceError) as caught:
            attempt()
        assert caught.value.fault is DeviceFault.COMMUNICATION
        assert caught.value.device == 0
    rig.controller.stop(Channel(1, 0))


def test_closing_with_everything_unplugged_does_not_raise(
    rig: Rig, library: SimulatedLibrary
) -> None:
    library.faults.inject("unplugged")
    rig.controller.close()
    library.faults.clear()
    assert len(rig.controller.open()) == 4


@pytest.mark.parametrize(
    ("name", "fault"),
    [
        ("end_stop", DeviceFault.END_STOP),
        ("overridden", DeviceFault.OVERRIDDEN),
        ("overheated", DeviceFault.OVERHEATED),
        ("hv_range", DeviceFault.HIGH_VOLTAGE),
        ("sensor_lost", DeviceFault.NO_SENSOR),
    ],
)
def test_a_movement_that_fails_says_why_and_ends_at_rest(
    rig: Rig, library: SimulatedLibrary, name: str, fault: DeviceFault
) -> None:
    library.faults.inject(name, device=0, channel=0)
    rig.controller.report_completion(AT)
    rig.controller.move_to(AT, 40.0, "um", hold_s=math.inf)
    assert rig.event(Failed, AT).error.fault is fault
    assert rig.come_to_rest(AT) in (Activity.STOPPED, Activity.HOLDING)


def test_on_the_library_of_2010_only_the_known_position_is_missing() -> None:
    library = load_simulated_library(clock=ManualClock(auto_advance=True), version="1.2.0")
    with Rig(Scu3dController(library, simulated=True)) as rig:
        assert not rig.controller.capabilities.position_known
        with pytest.raises(DeviceError) as caught:
            rig.controller.ask_position_known(AT)
        assert caught.value.fault is DeviceFault.UNSUPPORTED
        rig.controller.ask_position(AT, "um")
        assert isinstance(rig.event(PositionRead, AT), PositionRead)
