"""The outputs of a LabJack board: two voltages and its digital lines, a value at a time."""

from typing import Any, Final

from typing_extensions import override

from cosmic.daqco.hw.interface import BoardInfo
from cosmic.daqco.hw.labjack_connection import Connection
from cosmic.daqco.hw.labjack_errors import board_error
from cosmic.daqco.hw.outputs import AnalogOutput, BoardOutputs, OutputsInfo, Waveform
from cosmic.frame.errors import DeviceError, DeviceFault, LimitError, NotAvailable
from cosmic.frame.verdict import Reason, refuse

ANALOG: Final = {"ao0": "DAC0", "ao1": "DAC1"}
HIGHEST_V: Final = {"T4": 5.0, "T7": 5.0, "T8": 10.0}
"""T-series data sheet, chapter 15."""
_PORTS: Final = {"port0": "FIO", "port1": "EIO", "port2": "CIO"}
_LINES: Final = {
    "T4": {"port0": range(4, 8), "port1": range(8), "port2": range(4)},
    "T7": {"port0": range(8), "port1": range(8), "port2": range(4)},
    "T8": {"port0": range(8), "port1": range(8), "port2": range(4)},
}
"""On a T4 the first four of FIO are analogue inputs."""


class LabjackOutputs(BoardOutputs):
    """`ao0` and `ao1` are DAC0 and DAC1; `port0`, `port1` and `port2` are FIO, EIO and CIO.

    A waveform needs a place in the stream of the inputs (stream-out), and is not played.

    Parameters
    ----------
    api : module
        ``labjack.ljm``.
    """

    def __init__(self, api: Any, info: BoardInfo, connection: Connection) -> None:
        self._api = api
        self._board = info.name
        self._connection = connection
        lines = tuple(
            f"{port}/line{number}"
            for port, numbers in _LINES[info.product].items()
            for number in numbers
        )
        high_v = HIGHEST_V[info.product]
        self._info = OutputsInfo(info.name, tuple(ANALOG), lines, 0.0, high_v, 0.0)

    @property
    @override
    def info(self) -> OutputsInfo:
        return self._info

    @override
    def write(self, output: AnalogOutput, volts: float) -> None:
        if output.output not in ANALOG:
            raise self._no_output(output.output)
        # LJM would clip what lies beyond.
        if not self._info.low_v <= volts <= self._info.high_v:
            text = (
                f"{self._board}/{output.output}: {volts:g} V asked; the board gives 0 to "
                f"{self._info.high_v:g} V"
            )
            verdict = refuse(Reason.LIMIT, text, value=volts, limit=self._info.high_v, unit="V")
            raise LimitError(verdict)
        self._write(ANALOG[output.output], volts)

    @override
    def write_line(self, line: str, *, high: bool) -> None:
        if line not in self._info.lines:
            raise self._no_output(line)
        port, _, number = line.partition("/line")
        self._write(f"{_PORTS[port]}{number}", float(high))

    @override
    def play(self, output: AnalogOutput, waveform: Waveform) -> float:
        raise NotAvailable(
            f"{self._board}/{output.output}: waveforms are not played on boards of LabJack; give "
            f"one value after the other, or use a board of National Instruments"
        )

    @property
    @override
    def playing(self) -> str:
        return ""

    @override
    def end_waveform(self) -> None:
        """None is played."""

    @override
    def close(self) -> None:
        self._connection.leave(self)

    def _write(self, register: str, value: float) -> None:
        handle = self._connection.take(self)
        try:
            self._api.eWriteName(handle, register, value)
        except self._api.LJMError as exc:
            raise board_error(exc, f"write {register}", self._board) from exc

    def _no_output(self, output: str) -> DeviceError:
        there = ", ".join((*self._info.analog, *self._info.lines))
        return DeviceError(
            f"{self._board}: there is no output {output!r}; there are {there}",
            fault=DeviceFault.NO_CHANNEL,
        )
