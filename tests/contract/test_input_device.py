"""What our input devices have in common, under the suite that other packages import."""

from collections.abc import Iterator
from contextlib import ExitStack

import pytest

from cosmic.mico.hw.input_device import InputSource
from cosmic.mico.hw.keyboard_input import KeyboardSource
from cosmic.mico.hw.sdl_input import SdlSource
from cosmic.mico.hw.sim_haptic import SimHapticSource
from cosmic.testing.inputs import InputContract
from cosmic.testing.virtual_gamepad import VirtualGamepad


class TestGamepads(InputContract):
    gamepad = True

    @pytest.fixture(autouse=True)
    def plugged_in(self) -> Iterator[None]:
        with ExitStack() as self._plugged:
            yield

    def make_source(self) -> InputSource:
        source = SdlSource()
        source.devices()
        self._plugged.enter_context(VirtualGamepad(gamepad=self.gamepad))
        return source


class TestJoysticks(TestGamepads):
    gamepad = False


class TestKeys(InputContract):
    def make_source(self) -> InputSource:
        source = KeyboardSource()
        source.keyboard.plug(plugged=True)
        return source


class TestHapticDevices(InputContract):
    def make_source(self) -> InputSource:
        return SimHapticSource()
