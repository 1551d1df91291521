"""The controllers under contract, and a rig that waits for their events."""

from dataclasses import dataclass
from typing import TypeVar

from contract.fake_scu3d import LINEAR_TYPE, NO_TYPE, ROTARY_TYPE, FakeScu3d
from contract.fake_scu_serial import FakeScuLines
from contract.fake_smaractctl import FakeSmaractctl
from contract.fake_stages import FakePipython, FakePylablib
from cosmic.frame.clock import ManualClock
from cosmic.frame.units import AxisUnit
from cosmic.mico.hw import pipython_stages, pylablib_stages
from cosmic.mico.hw.interface import (
    Activity,
    ActivityRead,
    Channel,
    Controller,
    Event,
    PositionRead,
)
from cosmic.mico.hw.scu3d import Scu3dController
from cosmic.mico.hw.scu_serial import ScuSerialController
from cosmic.mico.hw.sim_scu3d import load_simulated_library
from cosmic.mico.hw.sim_scu_serial import SimulatedScus
from cosmic.mico.hw.sim_smaractctl import load_simulated_library as load_simulated_smaractctl
from cosmic.mico.hw.smaractctl import SmaractCtlController

E = TypeVar("E", bound=Event)


@dataclass
class Rig:
    """A controller with four devices of three channels, laid out LLL,LLL,LLN,RNN."""

    controller: Controller

    def __enter__(self) -> "Rig":
        self.controller.open()
        return self

    def __exit__(self, *_: object) -> None:
        self.controller.close()

    def event(self, kind: type[E], at: Channel) -> E:
        """Return the next event of that kind and channel; skip the others."""
        for _ in range(400):
            event = self.controller.receive(at.device, 0.1)
            if isinstance(event, kind) and event.channel == at:
                return event
        raise AssertionError(f"no {kind.__name__} from {at}")

    def position(self, at: Channel, unit: AxisUnit = "um") -> float:
        self.controller.ask_position(at, unit)
        return self.event(PositionRead, at).value

    def activity(self, at: Channel) -> Activity:
        self.controller.ask_activity(at)
        return self.event(ActivityRead, at).activity

    def come_to_rest(self, at: Channel) -> Activity:
        for _ in range(2000):
            activity = self.activity(at)
            if activity.at_rest:
                return activity
        raise AssertionError(f"{at} does not come to rest")


def simulated() -> Controller:
    library = load_simulated_library(clock=ManualClock(auto_advance=True))
    return Scu3dController(library, simulated=True)


def over_fake() -> Controller:
    linear = [LINEAR_TYPE] * 3
    devices = {
        101: linear,
        102: linear,
        103: [LINEAR_TYPE, LINEAR_TYPE, NO_TYPE],
        104: [ROTARY_TYPE, NO_TYPE, NO_TYPE],
    }
    return Scu3dController(FakeScu3d(devices))


def simulated_mcs2() -> Controller:
    library = load_simulated_smaractctl(clock=ManualClock(auto_advance=True))
    return SmaractCtlController(library, simulated=True)


def simulated_serial() -> Controller:
    scus = SimulatedScus(clock=ManualClock(auto_advance=True))
    return ScuSerialController("0123", scus.open_port, keep_alive_s=0.0, simulated=True)


def serial_over_fake() -> Controller:
    return ScuSerialController("0123", FakeScuLines().open_port, answer_s=0.2)


def mcs2_over_fake() -> Controller:
    devices = {"MCS2-101": "LLL", "MCS2-102": "LLL", "MCS2-103": "LLN", "MCS2-104": "RNN"}
    return SmaractCtlController(FakeSmaractctl(devices))


def pylablib_over_fake() -> Controller:
    package = FakePylablib()
    return pylablib_stages.make_controller(package.controller_options(), package)


def pi_over_fake() -> Controller:
    package = FakePipython()
    return pipython_stages.make_controller(package.controller_options(), package)
