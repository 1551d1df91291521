"""The contract of an `InputSource` and its devices, as a suite for pytest.

A package that brings one derives from `InputContract` and says how its source is made over a fake
with at least one device plugged in::

    class TestMyPedal(InputContract):
        def make_source(self) -> InputSource:
            return MySource(FakePedal())
"""

import math
from abc import abstractmethod
from collections.abc import Iterator

import pytest

from cosmic.frame.clock import WALL
from cosmic.frame.errors import NotConnectedError
from cosmic.mico.hw.input_device import InputDevice, InputSource

_POLLS = 200
_LONGEST_POLL_S = 0.005


class InputContract:
    """What MiCo relies on in any input device."""

    @abstractmethod
    def make_source(self) -> InputSource:
        """Return the source over its fake, with a device plugged in."""

    @pytest.fixture
    def source(self) -> Iterator[InputSource]:
        """The source; closed afterwards."""
        made = self.make_source()
        yield made
        made.close()
        made.close()

    @pytest.fixture
    def device(self, source: InputSource) -> Iterator[InputDevice]:
        """Its first device, open; closed afterwards."""
        opened = source.open(source.devices()[0].key)
        yield opened
        opened.close()

    def test_what_is_plugged_in_is_listed_with_names(self, source: InputSource) -> None:
        found = source.devices()
        assert found
        assert len({each.key for each in found}) == len(found)
        for each in found:
            assert each.title
            assert each.quiet_s is None or each.quiet_s > 0.0

    def test_what_is_open_is_what_was_listed_and_names_what_it_reports(
        self, source: InputSource, device: InputDevice
    ) -> None:
        info = device.info
        assert (info.key, info.kind) in [(each.key, each.kind) for each in source.devices()]
        assert info.axes or info.buttons
        assert len(set(info.axes)) == len(info.axes)
        assert len(set(info.buttons)) == len(info.buttons)

    def test_it_reports_every_axis_and_button_that_it_names(self, device: InputDevice) -> None:
        state = device.poll()
        assert set(state.axes) == set(device.info.axes)
        assert set(state.buttons) == set(device.info.buttons)
        assert state.connected
        assert state.time_s <= WALL.now_s()

    def test_nothing_is_deflected_before_a_hand_is_there(self, device: InputDevice) -> None:
        state = device.poll()
        assert all(abs(each) < 0.1 for each in state.axes.values())
        assert not any(state.buttons.values())

    def test_looking_never_waits(self, device: InputDevice) -> None:
        before_s = WALL.now_s()
        for _ in range(_POLLS):
            device.poll()
        assert WALL.now_s() - before_s < _POLLS * _LONGEST_POLL_S

    def test_any_force_is_taken_or_ignored(self, device: InputDevice) -> None:
        named = device.info.axes or ("x",)
        for value in (1.0, -1.0, 0.0, 7.0, math.nan, math.inf):
            device.feel(dict.fromkeys(named, value))
        device.feel({"no such axis": 0.5})
        device.feel({})
        assert device.poll().connected

    def test_what_is_not_there_is_not_opened(self, source: InputSource) -> None:
        with pytest.raises(NotConnectedError):
            source.open("no such device")

    def test_a_device_that_was_closed_can_be_opened_again(
        self, source: InputSource, device: InputDevice
    ) -> None:
        device.close()
        device.close()
        again = source.open(source.devices()[0].key)
        assert again.poll().connected
        again.close()
