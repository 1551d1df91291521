"""The contract of a `Light`, as a suite for pytest.

A package that brings one derives from `LightContract` and says how its lamp is made over a fake::

    class TestMyLight(LightContract):
        def make_light(self) -> Light:
            return MyLight(FakeLamp())
"""

import math
from abc import abstractmethod
from collections.abc import Iterator
from typing import ClassVar

import pytest

from cosmic.frame.errors import ConfigError, DeviceError
from cosmic.vico.hw.peripherals import Light


class LightContract:
    """What ViCo relies on in any lamp.

    Attributes
    ----------
    step_percent : float
        How finely it can be set.
    """

    step_percent: ClassVar[float] = 1.0

    @abstractmethod
    def make_light(self) -> Light:
        """Return the lamp over its fake."""

    @pytest.fixture
    def light(self) -> Iterator[Light]:
        """The lamp; closed afterwards."""
        made = self.make_light()
        yield made
        made.close()

    def test_it_has_a_name_and_says_how_bright_it_is(self, light: Light) -> None:
        assert light.name
        assert 0.0 <= light.percent() <= 100.0

    @pytest.mark.parametrize("percent", [100.0, 37.0, 0.0])
    def test_it_shines_as_commanded_and_reports_it(self, light: Light, percent: float) -> None:
        light.set_percent(percent)
        assert light.percent() == pytest.approx(percent, abs=self.step_percent / 2.0)

    @pytest.mark.parametrize("percent", [-0.1, 100.1, math.nan, math.inf, -math.inf])
    def test_a_brightness_it_does_not_have_is_refused_and_changes_nothing(
        self, light: Light, percent: float
    ) -> None:
        light.set_percent(60.0)
        with pytest.raises(ConfigError):
            light.set_percent(percent)
        assert light.percent() == pytest.approx(60.0, abs=self.step_percent / 2.0)

    def test_closing_twice_is_harmless_and_afterwards_it_is_closed(self, light: Light) -> None:
        light.close()
        light.close()
        with pytest.raises(DeviceError):
            light.percent()
        with pytest.raises(DeviceError):
            light.set_percent(10.0)
