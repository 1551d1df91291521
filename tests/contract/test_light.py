"""What every lamp does: over an object in this process and over pyserial."""

import math
import sys
from collections.abc import Iterator
from contextlib import ExitStack

import pytest

from contract.peripheral_rig import PeripheralRig, terminal
from cosmic.frame.errors import ConfigError, DeviceError, DeviceTimeout
from cosmic.vico.hw.factory import make_light
from cosmic.vico.hw.peripherals import Light


class Bench:
    """One lamp under test."""

    def __init__(self, way: str) -> None:
        self.rig = PeripheralRig()
        self._stack = ExitStack()
        if way == "terminal":
            if sys.platform == "win32":
                pytest.skip("there are no pseudo-terminals")
            path = self._stack.enter_context(terminal(self.rig.simulation.light_line)).path
            made = make_light("brightlight", port=path)
        else:
            made = make_light("simulated", simulation=self.rig.simulation)
        assert made is not None
        self.light: Light = made
        self._stack.callback(self.light.close)

    def close(self) -> None:
        self._stack.close()


@pytest.fixture(params=["object", "terminal"])
def bench(request: pytest.FixtureRequest) -> Iterator[Bench]:
    made = Bench(request.param)
    yield made
    made.close()


def test_opening_it_changes_nothing(bench: Bench) -> None:
    assert bench.light.percent() == 50.0
    assert "BrightLight" in bench.light.name


@pytest.mark.parametrize("percent", [0.0, 0.1, 33.3, 100.0])
def test_it_shines_as_commanded_and_reports_it(bench: Bench, percent: float) -> None:
    bench.rig.clock.advance(1.0)
    bench.light.set_percent(percent)
    assert bench.light.percent() == pytest.approx(percent)
    assert bench.rig.light.percent(1.0) == pytest.approx(percent)
    assert bench.rig.light.percent(0.5) == 50.0, "the past is not changed"


@pytest.mark.parametrize("percent", [-0.1, 100.1, math.nan, math.inf])
def test_a_brightness_it_does_not_have_is_refused(bench: Bench, percent: float) -> None:
    with pytest.raises(ConfigError, match="0 to 100"):
        bench.light.set_percent(percent)
    assert bench.light.percent() == 50.0


def test_it_works_through_garbage_and_fails_in_silence(bench: Bench) -> None:
    faults = bench.rig.simulation.faults
    faults.inject("garbage", where="light")
    bench.light.set_percent(20.0)
    assert bench.light.percent() == 20.0
    faults.inject("silent", where="light")
    with pytest.raises(DeviceTimeout):
        bench.light.percent()


def test_closed_it_stays_closed_and_shines_on(bench: Bench) -> None:
    bench.light.close()
    bench.light.close()
    with pytest.raises(DeviceError):
        bench.light.percent()
    assert bench.rig.light.percent(0.0) == 50.0
