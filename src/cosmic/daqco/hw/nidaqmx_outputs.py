"""The outputs of a board of National Instruments through NI-DAQmx."""

import logging
from typing import Any

from nidaqmx.constants import AcquisitionType, LineGrouping
from nidaqmx.errors import Error
from typing_extensions import override

from cosmic.daqco.hw.nidaqmx_errors import board_error
from cosmic.daqco.hw.outputs import AnalogOutput, BoardOutputs, OutputsInfo, Waveform
from cosmic.frame.errors import DeviceError, DeviceFault, NotAvailable

logger = logging.getLogger(__name__)


class NidaqmxOutputs(BoardOutputs):
    """Analogue outputs and digital lines of one board; made by its library.

    A value is written by a task of its own, which is given back at once: the board keeps the value.
    The limits of each output are the driver's as well, which refuses what lies beyond.

    Parameters
    ----------
    api : module
        nidaqmx.
    """

    def __init__(self, api: Any, info: OutputsInfo) -> None:
        self._api = api
        self._info = info
        self._task: Any = None
        self._playing = ""

    @property
    @override
    def info(self) -> OutputsInfo:
        return self._info

    @override
    def write(self, output: AnalogOutput, volts: float) -> None:
        if self._playing == output.output:
            self.end_waveform()
        task = self._new_task("write")
        try:
            self._add(task, output)
            task.write(float(volts), auto_start=True)
        except Error as exc:
            raise board_error(exc, f"write {output.output}", self._info.board) from exc
        finally:
            self._close(task)

    @override
    def write_line(self, line: str, *, high: bool) -> None:
        if line not in self._info.lines:
            raise self._no_output(line)
        task = self._new_task("write")
        try:
            task.do_channels.add_do_chan(
                f"{self._info.board}/{line}", line_grouping=LineGrouping.CHAN_PER_LINE
            )
            task.write(high, auto_start=True)
        except Error as exc:
            raise board_error(exc, f"write {line}", self._info.board) from exc
        finally:
            self._close(task)

    @override
    def play(self, output: AnalogOutput, waveform: Waveform) -> float:
        if self.playing:
            raise NotAvailable(
                f"{self._info.board}: a waveform is played on {self.playing}; end it"
            )
        self.end_waveform()
        task = self._new_task("play")
        try:
            made_hz = self._prepared(task, output, waveform)
            task.start()
        except BaseException as exc:
            self._close(task)
            if isinstance(exc, Error):
                raise board_error(exc, f"play {output.output}", self._info.board) from exc
            raise
        self._task, self._playing = task, output.output
        return made_hz

    @property
    @override
    def playing(self) -> str:
        if self._task is None:
            return ""
        try:
            done = self._task.is_task_done()
        except Error as exc:
            raise board_error(exc, "play", self._info.board) from exc
        if done:
            self.end_waveform()
        return self._playing

    @override
    def end_waveform(self) -> None:
        task, self._task, self._playing = self._task, None, ""
        if task is None:
            return
        try:
            task.stop()
        except Error as exc:
            logger.warning("%s: end of a waveform: %s", self._info.board, exc)
        self._close(task)

    @override
    def close(self) -> None:
        self.end_waveform()

    def _prepared(self, task: Any, output: AnalogOutput, waveform: Waveform) -> float:
        self._add(task, output)
        count = waveform.volts.size
        mode = AcquisitionType.CONTINUOUS if waveform.repeat else AcquisitionType.FINITE
        task.timing.cfg_samp_clk_timing(waveform.rate_hz, sample_mode=mode, samps_per_chan=count)
        if waveform.trigger:
            task.triggers.start_trigger.cfg_dig_edge_start_trig(waveform.trigger)
        writer = self._api.stream_writers.AnalogSingleChannelWriter(task.out_stream)
        writer.write_many_sample(waveform.volts)
        return float(task.timing.samp_clk_rate)

    def _add(self, task: Any, output: AnalogOutput) -> None:
        if output.output not in self._info.analog:
            raise self._no_output(output.output)
        task.ao_channels.add_ao_voltage_chan(
            f"{self._info.board}/{output.output}", min_val=output.low_v, max_val=output.high_v
        )

    def _new_task(self, call: str) -> Any:
        try:
            return self._api.Task()
        except Error as exc:
            raise board_error(exc, call, self._info.board) from exc

    def _close(self, task: Any) -> None:
        try:
            task.close()
        except Error as exc:
            logger.warning("%s: close: %s", self._info.board, exc)

    def _no_output(self, output: str) -> DeviceError:
        there = ", ".join((*self._info.analog, *self._info.lines))
        return DeviceError(
            f"{self._info.board}: there is no output {output!r}; there are {there}",
            fault=DeviceFault.NO_CHANNEL,
        )


def outputs_info(device: Any) -> OutputsInfo:
    """Return which outputs a device of the driver has; raises the driver's errors."""
    name = str(device.name)
    analog = tuple(_short(each.name, name) for each in device.ao_physical_chans)
    lines = tuple(_short(each.name, name) for each in device.do_lines)
    if not analog:
        return OutputsInfo(name, (), lines, 0.0, 0.0, 0.0)
    ranges = [float(end) for end in device.ao_voltage_rngs]
    return OutputsInfo(name, analog, lines, min(ranges), max(ranges), float(device.ao_max_rate))


def _short(physical: str, board: str) -> str:
    return physical.removeprefix(f"{board}/")
