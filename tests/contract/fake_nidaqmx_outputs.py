"""The outputs of the imaginary boards of NI: tasks for voltages, lines and counters.

A `FakeOutputNidaqmx` is a `FakeNidaqmx` whose boards have outputs as well. What a board gives
stands in `volts` and `lines` of its device, and stays when a task is closed, as on a real board.
"""

from types import SimpleNamespace
from typing import Any

import numpy as np
import numpy.typing as npt
from nidaqmx.constants import AcquisitionType, Edge, Level, LineGrouping, TaskMode, VoltageUnits

from contract.fake_nidaqmx import (
    ABSENT,
    BAD_VALUE,
    NO_DEVICE,
    RESERVED,
    TOO_FAST,
    FakeDevice,
    FakeNidaqmx,
    FakeTask,
    FakeTiming,
    fail,
)

BEYOND_LIMIT = -200561
"""A value to be written lies outside the limits of its channel."""


class FakeOutputDevice(FakeDevice):
    """A board with two voltages, eight lines and two counters."""

    def __init__(self, driver: "FakeOutputNidaqmx", name: str, serial_num: int) -> None:
        super().__init__(driver, name=name, serial_num=serial_num)
        self.volts: dict[str, float] = {}
        self.lines: dict[str, bool] = {}
        self.ao_voltage_rngs = (-10.0, 10.0)
        self.ao_max_rate = 833e3

    @property
    def ao_physical_chans(self) -> list[Any]:
        return [SimpleNamespace(name=f"{self.name}/ao{number}") for number in range(2)]

    @property
    def do_lines(self) -> list[Any]:
        return [SimpleNamespace(name=f"{self.name}/port0/line{number}") for number in range(8)]


class FakeOutputNidaqmx(FakeNidaqmx):
    """What `import nidaqmx` gives, with outputs."""

    def __init__(self, boards: int = 2) -> None:
        super().__init__(boards)
        self.all_devices: list[Any] = [
            FakeOutputDevice(self, f"Dev{number}", 0x1234567 + number)
            for number in range(1, boards + 1)
        ]
        self.stream_writers = SimpleNamespace(AnalogSingleChannelWriter=FakeWriter)
        self.started: list[str] = []

    def Task(self, new_task_name: str = "") -> "FakeOutputTask":
        self._check_installed()
        return FakeOutputTask(self, new_task_name)

    def rise(self, terminal: str) -> None:
        """Let a terminal rise."""
        for task in self.tasks:
            if isinstance(task, FakeOutputTask) and task.trigger == terminal:
                task.waits = False

    def give_all(self) -> None:
        """Let every waveform that runs come to its end, or go round once."""
        for task in self.tasks:
            if isinstance(task, FakeOutputTask) and task.running and not task.waits:
                task.give_all()


class FakeOutputTask(FakeTask):
    """`nidaqmx.Task` for inputs or for outputs."""

    def __init__(self, driver: FakeOutputNidaqmx, new_task_name: str = "") -> None:
        super().__init__(driver, new_task_name)
        self.kind, self.place = "", ""
        self.limits_v = (0.0, 0.0)
        self.data: npt.NDArray[np.float64] | None = None
        self.mode: AcquisitionType | None = None
        self.trigger, self.waits = "", False
        self.ticks: dict[str, Any] = {}
        self.timing = FakeOutputTiming(self)
        self.ao_channels = FakeAoChannels(self)
        self.do_channels = FakeDoChannels(self)
        self.co_channels = FakeCoChannels(self)
        self.triggers = SimpleNamespace(start_trigger=FakeStartTrigger(self))
        self.out_stream = SimpleNamespace(task=self)

    @property
    def board(self) -> str:
        return self.place.split("/")[0] if self.kind else super().board

    def add(self, kind: str, place: str) -> None:
        self.called(f"add_{kind}")
        assert not self.kind, "one channel a task"
        device = self.driver.device(place.split("/")[0])
        if not device.plugged:
            fail(NO_DEVICE)
        self.kind, self.place = kind, place

    def write(self, data: Any, auto_start: bool = False, timeout: float = 10.0) -> int:
        self.called("write")
        assert auto_start and self.kind in ("ao", "do")
        self._reserve()
        if self.kind == "do":
            assert isinstance(data, bool)
            self.device.lines[self.place] = data
        else:
            self.check_volts(np.array([data]))
            self.device.volts[self.place] = float(data)
        return 1

    def check_volts(self, data: npt.NDArray[np.float64]) -> None:
        low_v, high_v = self.limits_v
        if not (low_v <= data.min() and data.max() <= high_v):
            fail(BEYOND_LIMIT)

    def _reserve(self) -> None:
        device = self.device
        if not device.plugged:
            fail(ABSENT)
        others = [each for each in self.driver.tasks if each is not self and each.committed]
        same = [
            each
            for each in others
            if getattr(each, "kind", "") == self.kind and each.device is device
        ]
        used = any(each.place == self.place or self.mode for each in same)
        if device.taken or (used and self.kind != "do"):
            fail(RESERVED)

    def control(self, action: TaskMode) -> None:
        if not self.kind:
            kept = self.driver.tasks
            self.driver.tasks = [each for each in kept if not getattr(each, "kind", "")]
            try:
                super().control(action)
            finally:
                self.driver.tasks = kept
            return
        self.called("control")
        self._reserve()
        self.committed = True

    def start(self) -> None:
        if not self.kind:
            self.driver.started.append("ai")
            super().start()
            return
        self.called("start")
        self.driver.started.append(self.kind)
        self.control(TaskMode.TASK_COMMIT)
        self.running, self.waits = True, bool(self.trigger)

    def give_all(self) -> None:
        assert self.data is not None
        self.device.volts[self.place] = float(self.data[-1])
        self.running = self.mode is AcquisitionType.CONTINUOUS

    def stop(self) -> None:
        if not self.kind:
            super().stop()
            return
        self.called("stop")
        self.running = False


class FakeAoChannels:
    def __init__(self, task: FakeOutputTask) -> None:
        self._task = task

    def add_ao_voltage_chan(
        self,
        physical_channel: str,
        name_to_assign_to_channel: str = "",
        min_val: float = -10.0,
        max_val: float = 10.0,
        units: VoltageUnits = VoltageUnits.VOLTS,
        custom_scale_name: str = "",
    ) -> None:
        self._task.add("ao", physical_channel)
        low_v, high_v = self._task.device.ao_voltage_rngs
        if not low_v <= min_val < max_val <= high_v:
            fail(BAD_VALUE)
        self._task.limits_v = (min_val, max_val)


class FakeDoChannels:
    def __init__(self, task: FakeOutputTask) -> None:
        self._task = task

    def add_do_chan(
        self,
        lines: str,
        name_to_assign_to_lines: str = "",
        line_grouping: LineGrouping = LineGrouping.CHAN_FOR_ALL_LINES,
    ) -> None:
        assert line_grouping is LineGrouping.CHAN_PER_LINE
        self._task.add("do", lines)


class FakeCoChannels:
    def __init__(self, task: FakeOutputTask) -> None:
        self._task = task

    def add_co_pulse_chan_ticks(
        self,
        counter: str,
        source_terminal: str,
        name_to_assign_to_channel: str = "",
        idle_state: Level = Level.LOW,
        initial_delay: int = 0,
        low_ticks: int = 100,
        high_ticks: int = 100,
    ) -> Any:
        self._task.add("co", counter)
        if min(low_ticks, high_ticks) < 2 or idle_state is not Level.LOW:
            fail(BAD_VALUE)
        self._task.ticks = {
            "source": source_terminal,
            "delay": initial_delay,
            "low": low_ticks,
            "high": high_ticks,
        }
        return SimpleNamespace(co_pulse_term="")


class FakeStartTrigger:
    def __init__(self, task: FakeOutputTask) -> None:
        self._task = task

    def cfg_dig_edge_start_trig(
        self, trigger_source: str, trigger_edge: Edge = Edge.RISING
    ) -> None:
        self._task.called("cfg_dig_edge_start_trig")
        assert trigger_edge is Edge.RISING
        self._task.trigger = trigger_source


class FakeOutputTiming(FakeTiming):
    def cfg_samp_clk_timing(
        self,
        rate: float,
        source: str = "",
        active_edge: Edge = Edge.RISING,
        sample_mode: AcquisitionType = AcquisitionType.FINITE,
        samps_per_chan: int = 1000,
    ) -> None:
        task: Any = self._task
        if not task.kind:
            super().cfg_samp_clk_timing(rate, source, active_edge, sample_mode, samps_per_chan)
            return
        if rate > task.device.ao_max_rate:
            fail(TOO_FAST)
        task.rate_hz, task.mode = 20e6 / int(20e6 / rate), sample_mode

    def cfg_implicit_timing(
        self,
        sample_mode: AcquisitionType = AcquisitionType.FINITE,
        samps_per_chan: int = 1000,
    ) -> None:
        task: Any = self._task
        assert task.kind == "co" and sample_mode is AcquisitionType.CONTINUOUS
        task.mode = sample_mode


class FakeWriter:
    """`nidaqmx.stream_writers.AnalogSingleChannelWriter`."""

    def __init__(self, task_out_stream: Any, auto_start: bool = False) -> None:
        self._task = task_out_stream.task

    def write_many_sample(self, data: npt.NDArray[np.float64], timeout: float = 10.0) -> int:
        assert data.dtype == np.float64 and data.ndim == 1
        self._task.check_volts(data)
        self._task.data = data.copy()
        return int(data.size)
