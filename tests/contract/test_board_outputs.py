"""Outputs, simulated, NI's and LabJack's, under the suite for all, and what else they do."""

import inspect
from abc import ABC, abstractmethod
from collections.abc import Iterator

import nidaqmx
import nidaqmx.stream_writers
import numpy as np
import pytest
from nidaqmx.task.collections import (
    AOChannelCollection,
    COChannelCollection,
    DOChannelCollection,
)
from nidaqmx.task.triggering import StartTrigger
from typing_extensions import override

from contract import fake_nidaqmx_outputs
from contract.fake_ljm import FakeLjm
from contract.fake_nidaqmx_outputs import FakeOutputNidaqmx
from cosmic.daqco.hw.interface import BoardInfo, BoardLibrary
from cosmic.daqco.hw.joined_boards import JoinedLibrary
from cosmic.daqco.hw.labjack_library import LabjackLibrary
from cosmic.daqco.hw.nidaqmx_library import NidaqmxLibrary
from cosmic.daqco.hw.outputs import AnalogOutput, Waveform, open_outputs
from cosmic.daqco.hw.sim_library import SimulatedLibrary
from cosmic.frame.clock import ManualClock
from cosmic.frame.errors import (
    NotAvailable,
    NotConnectedError,
)
from cosmic.testing.outputs import OutputBench, OutputsContract

PIEZO = AnalogOutput("ao0", 0.0, 5.0)
OTHER = AnalogOutput("ao1", 0.0, 5.0)


class OutputRig(ABC):
    """One board with outputs, and a voltmeter."""

    library: BoardLibrary
    board = "Dev1"
    plays = True

    def __init__(self) -> None:
        self.clock = ManualClock()

    @abstractmethod
    def volts(self, output: str) -> float: ...

    @abstractmethod
    def is_high(self, line: str) -> bool: ...

    @abstractmethod
    def unplug(self) -> None: ...

    def go_on(self, after_s: float) -> None:
        """Let time pass in which a waveform comes to its end."""
        self.clock.advance(after_s)

    def rise(self, terminal: str) -> None:
        raise NotImplementedError(terminal)

    def check_left(self) -> None:
        """Check that nothing is held after the end."""
        assert self.library.name


class SimulatedOutputRig(OutputRig):
    def __init__(self) -> None:
        super().__init__()
        self.library = self._simulated = SimulatedLibrary(self.clock)

    @override
    def volts(self, output: str) -> float:
        return self._simulated.output_level("Dev1", output).at(self.clock.now_s())

    @override
    def is_high(self, line: str) -> bool:
        return self._simulated.line_is_high("Dev1", line)

    @override
    def unplug(self) -> None:
        self._simulated.faults.inject("unplugged", board="Dev1")

    @override
    def rise(self, terminal: str) -> None:
        self._simulated.terminals.rise(terminal, self.clock.now_s())


class NidaqmxOutputRig(OutputRig):
    def __init__(self) -> None:
        super().__init__()
        self.driver = FakeOutputNidaqmx()
        self.library = NidaqmxLibrary(self.clock, api=self.driver)

    @override
    def volts(self, output: str) -> float:
        found: float = self.driver.device("Dev1").volts.get(f"Dev1/{output}", 0.0)
        return found

    @override
    def is_high(self, line: str) -> bool:
        found: bool = self.driver.device("Dev1").lines.get(f"Dev1/{line}", False)
        return found

    @override
    def unplug(self) -> None:
        self.driver.unplug("Dev1")

    @override
    def go_on(self, after_s: float) -> None:
        super().go_on(after_s)
        self.driver.give_all()

    @override
    def rise(self, terminal: str) -> None:
        self.driver.rise(terminal)

    @override
    def check_left(self) -> None:
        assert not self.driver.tasks, "a task was left open"


class LabjackOutputRig(OutputRig):
    board = "T7_470010001"
    plays = False

    def __init__(self) -> None:
        super().__init__()
        self.ljm = FakeLjm()
        self.library = LabjackLibrary(self.clock, api=self.ljm)

    @override
    def volts(self, output: str) -> float:
        return self.ljm.boards[0].written.get(output.replace("ao", "DAC"), 0.0)

    @override
    def is_high(self, line: str) -> bool:
        return bool(self.ljm.boards[0].written.get(line.replace("port0/line", "FIO"), 0.0))

    @override
    def unplug(self) -> None:
        self.ljm.boards[0].unplug()

    @override
    def check_left(self) -> None:
        assert not self.ljm.handles


RIGS = [SimulatedOutputRig, NidaqmxOutputRig, LabjackOutputRig]


class _Suite(OutputsContract):
    kind: type[OutputRig]

    @pytest.fixture(autouse=True)
    def nothing_is_left(self) -> Iterator[None]:
        self._rigs: list[OutputRig] = []
        yield
        for each in self._rigs:
            each.check_left()

    def make_bench(self) -> OutputBench:
        rig = self.kind()
        self._rigs.append(rig)
        return OutputBench(rig.library, rig.board, rig.volts, rig.is_high, rig.go_on)


class TestSimulatedOutputs(_Suite):
    kind = SimulatedOutputRig


class TestOutputsOfNationalInstruments(_Suite):
    kind = NidaqmxOutputRig


class TestOutputsOfLabJack(_Suite):
    kind = LabjackOutputRig


@pytest.fixture(params=RIGS)
def rig(request: pytest.FixtureRequest) -> Iterator[OutputRig]:
    made: OutputRig = request.param()
    yield made
    made.check_left()


@pytest.fixture(params=RIGS[:2])
def player(request: pytest.FixtureRequest) -> Iterator[OutputRig]:
    made: OutputRig = request.param()
    yield made
    made.check_left()


def test_a_lost_board_is_reported(rig: OutputRig) -> None:
    outputs = open_outputs(rig.library, rig.board)
    rig.unplug()
    with pytest.raises(NotConnectedError, match=rig.board):
        outputs.write(PIEZO, 1.0)
    with pytest.raises(NotConnectedError):
        open_outputs(rig.library, rig.board)
    outputs.close()


# --- waveforms --------------------------------------------------------------------------------


def test_a_waveform_waits_for_its_trigger(player: OutputRig) -> None:
    outputs = open_outputs(player.library, player.board)
    outputs.play(PIEZO, Waveform(np.array([1.0, 2.0]), 1000.0, trigger="/Dev1/PFI0"))
    player.go_on(1.0)
    assert outputs.playing == "ao0" and player.volts("ao0") == 0.0
    player.rise("/Dev1/PFI0")
    player.go_on(0.01)
    assert outputs.playing == "" and player.volts("ao0") == 2.0
    outputs.close()


def test_one_waveform_a_board_is_played_at_a_time(player: OutputRig) -> None:
    outputs = open_outputs(player.library, player.board)
    outputs.play(PIEZO, Waveform(np.ones(10), 1000.0, repeat=True))
    with pytest.raises(NotAvailable, match="ao0"):
        outputs.play(OTHER, Waveform(np.ones(10), 1000.0))
    outputs.end_waveform()
    assert outputs.playing == ""
    outputs.play(OTHER, Waveform(np.ones(10), 1000.0))
    outputs.close()


def test_a_waveform_ends_when_the_board_is_given_back(player: OutputRig) -> None:
    outputs = open_outputs(player.library, player.board)
    outputs.play(PIEZO, Waveform(np.linspace(0.0, 5.0, 1001), 1000.0, repeat=True))
    player.go_on(0.25)
    outputs.close()
    kept_v = player.volts("ao0")
    for _ in range(3):
        player.go_on(0.1)
        assert player.volts("ao0") == kept_v
    again = open_outputs(player.library, player.board)
    assert again.playing == ""
    again.close()


# --- libraries --------------------------------------------------------------------------------


def test_the_outputs_of_joined_makes_are_those_of_each() -> None:
    labjack, simulated = LabjackOutputRig(), SimulatedOutputRig()
    joined = JoinedLibrary([simulated.library, labjack.library])
    for rig in (labjack, simulated):
        outputs = open_outputs(joined, rig.board)
        outputs.write(PIEZO, 1.0)
        assert rig.volts("ao0") == 1.0
        outputs.close()


def test_a_driver_without_outputs_is_reported() -> None:
    class Plain(BoardLibrary):
        @property
        @override
        def name(self) -> str:
            return "Plain boards"

        @override
        def list_boards(self) -> tuple[BoardInfo, ...]:
            return ()

        @override
        def open(self, name: str):
            raise NotImplementedError

    with pytest.raises(NotAvailable, match="Plain boards has no outputs"):
        open_outputs(Plain(), "Dev1")


@pytest.mark.parametrize(
    ("fake", "real", "name"),
    [
        (fake_nidaqmx_outputs.FakeOutputTask, nidaqmx.Task, "write"),
        (fake_nidaqmx_outputs.FakeAoChannels, AOChannelCollection, "add_ao_voltage_chan"),
        (fake_nidaqmx_outputs.FakeDoChannels, DOChannelCollection, "add_do_chan"),
        (fake_nidaqmx_outputs.FakeCoChannels, COChannelCollection, "add_co_pulse_chan_ticks"),
        (fake_nidaqmx_outputs.FakeStartTrigger, StartTrigger, "cfg_dig_edge_start_trig"),
        (
            fake_nidaqmx_outputs.FakeWriter,
            nidaqmx.stream_writers.AnalogSingleChannelWriter,
            "write_many_sample",
        ),
    ],
)
def test_the_fake_takes_what_the_real_package_takes(fake: type, real: type, name: str) -> None:
    ours = inspect.signature(getattr(fake, name)).parameters
    assert list(ours) == list(inspect.signature(getattr(real, name)).parameters)
