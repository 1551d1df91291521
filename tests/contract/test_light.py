"""The lamp under the suite for all, over an object in this process and over pyserial; and more."""

import sys
from collections.abc import Iterator
from contextlib import ExitStack

import pytest

from contract.peripheral_rig import PeripheralRig, terminal
from cosmic.frame.errors import DeviceTimeout
from cosmic.testing.lights import LightContract
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


class _BrightLight(LightContract):
    step_percent = 0.1
    way: str

    @pytest.fixture(autouse=True)
    def benches(self) -> Iterator[None]:
        with ExitStack() as self._benches:
            yield

    def make_light(self) -> Light:
        bench = Bench(self.way)
        self._benches.callback(bench.close)
        return bench.light


class TestOverAnObject(_BrightLight):
    way = "object"


class TestOverATerminal(_BrightLight):
    way = "terminal"


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


def test_it_works_through_garbage_and_fails_in_silence(bench: Bench) -> None:
    faults = bench.rig.simulation.faults
    faults.inject("garbage", where="light")
    bench.light.set_percent(20.0)
    assert bench.light.percent() == 20.0
    faults.inject("silent", where="light")
    with pytest.raises(DeviceTimeout):
        bench.light.percent()


def test_closed_it_shines_on(bench: Bench) -> None:
    bench.light.close()
    assert bench.rig.light.percent(0.0) == 50.0
