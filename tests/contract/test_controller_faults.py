"""Trouble at the simulated hardware, as MiCo sees it through the controller."""

import math
from collections.abc import Iterator
from typing import Any, cast

import pytest

from contract.controller_rig import Rig, simulated, simulated_mcs2
from cosmic.frame.clock import ManualClock
from cosmic.frame.errors import ConfigError, DeviceError, DeviceFault
from cosmic.mico.hw.factory import join
from cosmic.mico.hw.interface import Activity, Channel, Controller, Failed, PositionRead
from cosmic.mico.hw.joined import JoinedController
from cosmic.mico.hw.scu3d import Scu3dController
from cosmic.mico.hw.sim_scu3d import SimulatedLibrary, load_simulated_library
from cosmic.mico.hw.smaractctl import SmaractCtlController

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


class _Raising:
    """What a package might bring: it raises what it likes, once it is told to."""

    def __init__(self) -> None:
        self._own = simulated_mcs2()
        self.error: Exception | None = None
        self.says: object = None

    def __getattribute__(self, name: str) -> Any:
        own, error = object.__getattribute__(self, "_own"), object.__getattribute__(self, "error")
        if name in ("_own", "error", "says"):
            return object.__getattribute__(self, name)
        if error is not None and name not in ("name", "close", "capabilities"):
            raise error
        if name == "receive" and self.says is not None:
            return lambda *_: self.says
        return getattr(own, name)


def test_what_a_brought_controller_raises_is_named_and_takes_no_other_along() -> None:
    brought = _Raising()
    joined = join([simulated(), cast("Controller", brought)])
    joined.open()
    brought.error = RuntimeError("boom")
    for attempt in (
        lambda: joined.stop(Channel(4, 0)),
        lambda: joined.move_to(Channel(4, 0), 1.0, "um", hold_s=0.0),
        lambda: joined.receive(4, 0.0),
    ):
        with pytest.raises(DeviceError, match=r"SmarActCTL.*RuntimeError: boom") as caught:
            attempt()
        assert caught.value.device == 4
    joined.stop(Channel(0, 0))
    brought.error, brought.says = None, "not an event"
    with pytest.raises(DeviceError, match="is not an event"):
        joined.receive(4, 0.0)
    joined.close()


def test_one_that_is_brought_alone_is_held_to_the_same() -> None:
    brought = _Raising()
    alone = join([cast("Controller", brought)])
    alone.open()
    brought.error = ZeroDivisionError("boom")
    with pytest.raises(DeviceError, match="ZeroDivisionError"):
        alone.stop(Channel(0, 0))
    brought.error = None
    alone.close()


def test_an_error_of_a_joined_part_names_the_device_as_the_platform_counts_it() -> None:
    joined = JoinedController([simulated(), simulated_mcs2()])
    joined.open()
    with pytest.raises(DeviceError, match=r"^device 5, channel 0: ") as caught:
        joined.move_to(Channel(5, 0), math.nan, "um", hold_s=0.0)
    assert (caught.value.device, caught.value.channel) == (5, 0)
    joined.close()


def test_the_parts_that_are_open_are_closed_when_another_cannot_be_opened() -> None:
    ours = simulated()
    joined = JoinedController([ours, simulated_mcs2()])
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(SmaractCtlController, "open", _refuse)
        with pytest.raises(ConfigError, match="no such option"):
            joined.open()
    assert len(joined.open()) == 8
    joined.close()


def _refuse(*_args: object) -> None:
    raise ConfigError("no such option")
