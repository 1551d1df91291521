"""Our own controllers under the suite that other packages import."""

from contract import controller_rig as rigs
from cosmic.mico.hw.interface import Channel, Controller
from cosmic.mico.hw.joined import JoinedController
from cosmic.testing.controllers import ControllerContract


class _OfThreeChannels(ControllerContract):
    steps_only = Channel(3, 1)
    nothing = Channel(0, 3)


class TestSimulatedScu(_OfThreeChannels):
    def make_controller(self) -> Controller:
        return rigs.simulated()


class TestScuOverFake(_OfThreeChannels):
    def make_controller(self) -> Controller:
        return rigs.over_fake()

    def test_a_stop_ends_a_movement_before_its_target(self, opened: Controller) -> None:
        """Not asked: this fake arrives at once."""


class TestSimulatedMcs2(_OfThreeChannels):
    def make_controller(self) -> Controller:
        return rigs.simulated_mcs2()


class TestSerialScu(_OfThreeChannels):
    def make_controller(self) -> Controller:
        return rigs.simulated_serial()


class TestARotaryAxis(_OfThreeChannels):
    closed_loop = Channel(3, 0)
    unit = "deg"
    ways = (3.0, -1.0)
    tolerance = 0.05

    def make_controller(self) -> Controller:
        return rigs.simulated()


class TestControllersOfTwoMakes(_OfThreeChannels):
    def make_controller(self) -> Controller:
        return JoinedController([rigs.simulated(), rigs.simulated_mcs2()])
