"""The contract of `BoardOutputs`, as a suite for pytest.

A package whose boards have outputs derives from `OutputsContract` and says how its library is made
over a fake, and how what it gives is measured::

    class TestMyOutputs(OutputsContract):
        def make_bench(self) -> OutputBench:
            clock, device = ManualClock(), FakeDevice()
            library = MyLibrary(device, clock)
            return OutputBench(library, "my_board1", device.volts, device.is_high, clock.advance)
"""

import math
from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest

from cosmic.daqco.hw.interface import BoardLibrary, InputSettings
from cosmic.daqco.hw.outputs import AnalogOutput, BoardOutputs, Waveform, open_outputs
from cosmic.frame.errors import (
    CosmicError,
    DeviceError,
    DeviceFault,
    LimitError,
    NotAvailable,
    NotConnectedError,
)

_RATE_HZ = 1000.0


@dataclass
class OutputBench:
    """A board with outputs, and a voltmeter.

    Attributes
    ----------
    volts, is_high : callable
        What hangs on an analogue output, V, and on a digital line, by name.
    go_on : callable
        Lets time go on by seconds.
    """

    library: BoardLibrary
    board: str
    volts: Callable[[str], float]
    is_high: Callable[[str], bool]
    go_on: Callable[[float], None]

    def open(self) -> BoardOutputs:
        """Open the outputs."""
        return open_outputs(self.library, self.board)


class OutputsContract:
    """What DAQCo relies on in the outputs of any board: one analogue output and one line."""

    @abstractmethod
    def make_bench(self) -> OutputBench:
        """Return a board over its fake, and what measures what it gives."""

    @pytest.fixture
    def bench(self) -> OutputBench:
        """The board, outputs not open yet."""
        return self.make_bench()

    @staticmethod
    def first(outputs: BoardOutputs) -> AnalogOutput:
        """Return the first analogue output, in its whole range."""
        return AnalogOutput(outputs.info.analog[0], outputs.info.low_v, outputs.info.high_v)

    @staticmethod
    def inside(outputs: BoardOutputs, part: float) -> float:
        """Return a voltage that the board can give."""
        return outputs.info.low_v + part * (outputs.info.high_v - outputs.info.low_v)

    def test_the_outputs_are_listed_with_what_they_can(self, bench: OutputBench) -> None:
        outputs = bench.open()
        info = outputs.info
        assert info.board == bench.board
        assert info.analog
        assert len({*info.analog, *info.lines}) == len(info.analog) + len(info.lines)
        assert info.low_v < info.high_v
        assert info.max_rate_hz >= 0.0
        outputs.close()
        outputs.close()

    def test_a_board_that_is_not_there_has_no_outputs(self, bench: OutputBench) -> None:
        with pytest.raises(NotConnectedError, match="no such board"):
            open_outputs(bench.library, "no such board")

    def test_a_value_is_given_and_stays_when_the_board_is_given_back(
        self, bench: OutputBench
    ) -> None:
        outputs = bench.open()
        output = self.first(outputs)
        for part in (0.5, 0.25):
            outputs.write(output, self.inside(outputs, part))
            assert bench.volts(output.output) == pytest.approx(self.inside(outputs, part), abs=0.01)
        last_v = self.inside(outputs, 0.25)
        outputs.close()
        assert bench.volts(output.output) == pytest.approx(last_v, abs=0.01)

    def test_other_outputs_keep_what_they_give(self, bench: OutputBench) -> None:
        outputs = bench.open()
        others = outputs.info.analog[1:]
        before_v = [bench.volts(each) for each in others]
        outputs.write(self.first(outputs), self.inside(outputs, 0.75))
        assert [bench.volts(each) for each in others] == before_v
        outputs.close()

    def test_a_line_is_set_and_cleared_alone(self, bench: OutputBench) -> None:
        outputs = bench.open()
        if outputs.info.lines:
            line, *others = outputs.info.lines
            for high in (True, False):
                outputs.write_line(line, high=high)
                assert bench.is_high(line) is high
                assert not any(bench.is_high(each) for each in others)
        outputs.close()

    def test_what_the_board_cannot_give_is_refused_and_not_clipped(
        self, bench: OutputBench
    ) -> None:
        outputs = bench.open()
        output = self.first(outputs)
        outputs.write(output, self.inside(outputs, 0.5))
        for volts in (outputs.info.high_v + 0.5, outputs.info.low_v - 0.5, math.nan, math.inf):
            with pytest.raises(CosmicError, match=bench.board):
                outputs.write(output, volts)
        assert bench.volts(output.output) == pytest.approx(self.inside(outputs, 0.5), abs=0.01)
        outputs.close()

    def test_an_output_that_is_not_there_is_named_with_those_that_are(
        self, bench: OutputBench
    ) -> None:
        outputs = bench.open()
        low_v, high_v = outputs.info.low_v, outputs.info.high_v
        attempts: list[Callable[[], None]] = [
            lambda: outputs.write(AnalogOutput("ao999", low_v, high_v), high_v),
            lambda: outputs.write_line("port9/line99", high=True),
        ]
        for attempt in attempts:
            with pytest.raises(DeviceError, match=outputs.info.analog[0]) as caught:
                attempt()
            assert caught.value.fault is DeviceFault.NO_CHANNEL
        outputs.close()

    def test_outputs_work_while_the_board_acquires(self, bench: OutputBench) -> None:
        board, outputs = bench.library.open(bench.board), bench.open()
        output = self.first(outputs)
        info = board.info
        low_v, high_v = info.ranges_v[0]
        board.configure([InputSettings(info.inputs[0], info.modes[0], low_v, high_v)], _RATE_HZ, 10)
        board.start()
        outputs.write(output, self.inside(outputs, 0.75))
        assert bench.volts(output.output) == pytest.approx(self.inside(outputs, 0.75), abs=0.01)
        board.close()
        outputs.write(output, self.inside(outputs, 0.5))
        outputs.close()
        assert bench.volts(output.output) == pytest.approx(self.inside(outputs, 0.5), abs=0.01)

    # Waveforms, where the board plays them

    def waveform(self, outputs: BoardOutputs, *parts: float, repeat: bool = False) -> Waveform:
        """Return a waveform of parts of the range."""
        volts = np.array([self.inside(outputs, each) for each in parts])
        return Waveform(volts, min(_RATE_HZ, outputs.info.max_rate_hz or _RATE_HZ), repeat=repeat)

    def test_a_waveform_is_given_once_and_its_last_value_stays(self, bench: OutputBench) -> None:
        outputs = bench.open()
        output, waveform = self.first(outputs), self.waveform(outputs, 0.6, 0.7, 0.8)
        if not outputs.info.max_rate_hz:
            with pytest.raises(NotAvailable):
                outputs.play(output, waveform)
            outputs.close()
            return
        made_hz = outputs.play(output, waveform)
        assert made_hz == pytest.approx(waveform.rate_hz, rel=1e-2)
        assert outputs.playing == output.output
        bench.go_on(10.0 / made_hz)
        assert outputs.playing == ""
        assert bench.volts(output.output) == pytest.approx(waveform.volts[-1], abs=0.01)
        outputs.close()

    def test_a_repeated_waveform_ends_when_another_value_is_given(self, bench: OutputBench) -> None:
        outputs = bench.open()
        output = self.first(outputs)
        if outputs.info.max_rate_hz:
            outputs.play(output, self.waveform(outputs, 0.6, 0.7, repeat=True))
            bench.go_on(1.0)
            assert outputs.playing == output.output
            with pytest.raises(NotAvailable):
                outputs.play(output, self.waveform(outputs, 0.6, 0.7))
        outputs.write(output, self.inside(outputs, 0.5))
        assert outputs.playing == ""
        bench.go_on(1.0)
        assert bench.volts(output.output) == pytest.approx(self.inside(outputs, 0.5), abs=0.01)
        outputs.close()

    def test_a_waveform_can_be_ended(self, bench: OutputBench) -> None:
        outputs = bench.open()
        output = self.first(outputs)
        if outputs.info.max_rate_hz:
            outputs.play(output, self.waveform(outputs, 0.6, 0.7, repeat=True))
        outputs.end_waveform()
        outputs.end_waveform()
        assert outputs.playing == ""
        outputs.close()

    def test_a_rate_that_the_board_does_not_make_is_refused(self, bench: OutputBench) -> None:
        outputs = bench.open()
        too_fast = Waveform(np.full(10, self.inside(outputs, 0.5)), 1e12)
        with pytest.raises((LimitError, NotAvailable), match=bench.board):
            outputs.play(self.first(outputs), too_fast)
        assert outputs.playing == ""
        outputs.close()
