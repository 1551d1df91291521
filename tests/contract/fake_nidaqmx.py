"""A stand-in for nidaqmx over imaginary boards that do what NI documents.

Pass a `FakeNidaqmx` where the program expects the module. It has no time: a test says how many
samples the boards take (`take`), and the callbacks then run on a thread of the driver, through
ctypes as in the real package, so that what they return is checked as C would see it. Input aiK
carries K * 0.1 V plus a microvolt for each sample since the start. Errors, constants and their
numbers are nidaqmx's own. It shares no code with the simulator.
"""

import ctypes
import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any, NoReturn

import numpy as np
import numpy.typing as npt
from nidaqmx.constants import AcquisitionType, Edge, TaskMode, TerminalConfiguration, VoltageUnits
from nidaqmx.errors import DaqError, DaqNotFoundError, DaqReadError

OnSamples = ctypes.CFUNCTYPE(
    ctypes.c_int32, ctypes.c_void_p, ctypes.c_int, ctypes.c_uint, ctypes.c_void_p
)
OnDone = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_void_p, ctypes.c_int, ctypes.c_void_p)

RESERVED, NO_DEVICE, ABSENT, LOST, TOO_FAST = -50103, -200220, -200324, -201003, -200332
OVERWRITTEN, OVERFLOW, NOT_YET, NO_ATTRIBUTE = -200279, -200361, -200284, -200197
BAD_VALUE, NOT_DIVISIBLE, TWICE, NOT_RUNNING = -200077, -200877, -200489, -200473
MICROVOLT = 1e-6


def fail(code: int, text: str = "something in the driver's own words") -> NoReturn:
    raise DaqError(f"{text}\n\nStatus Code: {code}", code)


@dataclass
class FakeDevice:
    """One board; the attributes are those of `nidaqmx.system.Device`.

    `paired` boards read differentially between an input and the one eight above; others have
    differential inputs only.
    """

    driver: "FakeNidaqmx" = field(repr=False)
    name: str = "Dev1"
    product_type: str = "PCI-6229"
    count: int = 32
    paired: bool = True
    is_simulated: bool = False
    serial_num: int = 0x1234567
    ai_max_single_chan_rate: float = 250e3
    ai_max_multi_chan_rate: float = 250e3
    ai_voltage_rngs: tuple[float, ...] = (-0.2, 0.2, -1.0, 1.0, -5.0, 5.0, -10.0, 10.0)
    plugged: bool = True
    taken: bool = False
    unreadable: bool = False
    broken: int = 0

    @property
    def ai_physical_chans(self) -> list[Any]:
        if self.unreadable:
            fail(NO_ATTRIBUTE)
        return [
            SimpleNamespace(name=f"{self.name}/ai{number}", ai_term_cfgs=self._modes(number))
            for number in range(self.count)
        ]

    def _modes(self, number: int) -> list[TerminalConfiguration]:
        if not self.paired:
            return [TerminalConfiguration.DIFF]
        single = [TerminalConfiguration.RSE, TerminalConfiguration.NRSE]
        return [*single, TerminalConfiguration.DIFF] if number % 16 < 8 else single


class FakeNidaqmx:
    """What `import nidaqmx` gives, and the boards behind it.

    Attributes
    ----------
    installed : bool
        The driver is there.
    tasks : list of FakeTask
        Those that exist.
    answers : list of int
        What the callbacks returned.
    fail_in : dict
        Error code by name of the call of a task that shall fail.
    starts : int
        How many tasks were started.
    levels_v : dict of str to float
        Level of an input, such as "Dev1/ai0", in place of K * 0.1 V.
    """

    def __init__(self, boards: int = 2) -> None:
        self.installed = True
        self.tasks: list[FakeTask] = []
        self.answers: list[int] = []
        self.fail_in: dict[str, int] = {}
        self.levels_v: dict[str, float] = {}
        self.starts = 0
        self.all_devices = [
            FakeDevice(self, name=f"Dev{number}", serial_num=0x1234567 + number)
            for number in range(1, boards + 1)
        ]
        self.system = SimpleNamespace(System=SimpleNamespace(local=self._local))
        self.stream_readers = SimpleNamespace(AnalogMultiChannelReader=FakeReader)

    def Task(self, new_task_name: str = "") -> "FakeTask":
        self._check_installed()
        return FakeTask(self, new_task_name)

    def device(self, name: str) -> FakeDevice:
        for device in self.all_devices:
            if device.name == name:
                return device
        fail(NO_DEVICE, f"Device identifier is invalid: {name}")

    def take(self, samples: int, *, events: bool = True, board: str | None = None) -> None:
        """Let the running tasks take `samples` of each channel; without `events` in silence."""
        for task in list(self.tasks):
            if task.running and board in (None, task.board) and not task.device.broken:
                self.in_driver(lambda task=task: task.take(samples, events))

    def break_down(self, board: str, code: int, *, announced: bool = True) -> None:
        """Fail with `code` while acquiring; `announced` by a Done event, or silently."""
        device = self.device(board)
        device.broken = code
        for task in list(self.tasks):
            if announced and task.running and task.device is device and task.on_done is not None:
                done = task.on_done
                self.in_driver(lambda done=done: self.answers.append(done(None, code, None)))

    def unplug(self, board: str, *, announced: bool = True) -> None:
        self.device(board).plugged = False
        self.break_down(board, LOST, announced=announced)

    def plug_in(self, board: str) -> None:
        self.device(board).plugged, self.device(board).broken = True, 0

    @staticmethod
    def in_driver(what: Callable[[], object]) -> None:
        thread = threading.Thread(target=what, name="driver")
        thread.start()
        thread.join(20.0)
        assert not thread.is_alive(), "a callback does not come back"

    def _local(self) -> Any:
        self._check_installed()
        # An unplugged PCI board stays listed in NI MAX; an unplugged USB board does not.
        listed = [device for device in self.all_devices if device.plugged]
        version = SimpleNamespace(major_version=26, minor_version=8, update_version=0)
        return SimpleNamespace(devices=listed, driver_version=version)

    def _check_installed(self) -> None:
        if not self.installed:
            raise DaqNotFoundError("Could not find an installation of NI-DAQmx. Please ensure ...")


class FakeTask:
    """`nidaqmx.Task` for analogue inputs of one board."""

    def __init__(self, driver: FakeNidaqmx, new_task_name: str = "") -> None:
        self.driver = driver
        self.name = new_task_name
        self.channels: list[tuple[str, TerminalConfiguration, float, float]] = []
        self.rate_hz, self.source, self.buffer = 0.0, "", 0
        self.every, self.on_samples, self.on_done = 0, None, None
        self.running = self.committed = self.closed = False
        self.taken = self.read = self.announced_samples = 0
        self.short: list[int] = []
        self.ai_channels = FakeChannels(self)
        self.timing = FakeTiming(self)
        self.in_stream = FakeInStream(self)
        driver.tasks.append(self)

    @property
    def board(self) -> str:
        return self.channels[0][0].split("/")[0]

    @property
    def device(self) -> FakeDevice:
        return self.driver.device(self.board)

    def called(self, name: str) -> None:
        assert not self.closed, f"{name} of a closed task"
        if name in self.driver.fail_in:
            fail(self.driver.fail_in[name])

    def register_every_n_samples_acquired_into_buffer_event(
        self, sample_interval: int, callback_method: Any
    ) -> None:
        self.called("register_every_n_samples_acquired_into_buffer_event")
        assert self.on_samples is None and not self.running
        self.every, self.on_samples = sample_interval, OnSamples(callback_method)

    def register_done_event(self, callback_method: Any) -> None:
        self.called("register_done_event")
        assert self.on_done is None and not self.running
        self.on_done = OnDone(callback_method)

    def control(self, action: TaskMode) -> None:
        self.called("control")
        assert action is TaskMode.TASK_COMMIT
        device = self.device
        if not device.plugged:
            fail(ABSENT)
        others = (each for each in self.driver.tasks if each is not self and each.committed)
        if device.taken or any(each.device is device for each in others):
            fail(RESERVED, "The specified resource is reserved.")
        aggregate = self.rate_hz * len(self.channels)
        if aggregate > device.ai_max_multi_chan_rate:
            fail(TOO_FAST, "Specified sample rate is higher than the fastest rate supported.")
        if self.every and self.buffer % self.every:
            fail(NOT_DIVISIBLE)
        self.committed = True

    def start(self) -> None:
        self.called("start")
        if not self.committed:
            self.control(TaskMode.TASK_COMMIT)
        if self.device.broken:
            fail(self.device.broken)
        assert not self.running
        self.taken = self.read = self.announced_samples = 0
        self.running = True
        self.driver.starts += 1

    def stop(self) -> None:
        self.called("stop")
        self.running = False
        if self.device.broken:
            fail(self.device.broken)

    def is_task_done(self) -> bool:
        self.called("is_task_done")
        if self.running and self.device.broken:
            fail(self.device.broken)
        return not self.running

    def close(self) -> None:
        assert not self.closed, "closed twice"
        self.closed = True
        self.running = self.committed = False
        self.driver.tasks.remove(self)
        if "close" in self.driver.fail_in:
            fail(self.driver.fail_in["close"])

    def take(self, samples: int, events: bool) -> None:
        """On the driver's thread: take samples and tell of each `every`."""
        end = self.taken + samples
        while self.running and self.taken < end:
            self.taken = min(end, self.announced_samples + self.every) if events else end
            while self.running and self.taken - self.announced_samples >= self.every:
                self.announced_samples += self.every
                if events or self.taken - self.announced_samples < self.every:
                    assert self.on_samples is not None
                    self.driver.answers.append(self.on_samples(None, 1, self.every, None))

    def check_readable(self) -> None:
        assert not self.closed, "read of a closed task"
        if not self.running:
            raise DaqReadError("Read cannot be performed ...", NOT_RUNNING, 0)
        if self.device.broken:
            raise DaqReadError("... in the driver's words", self.device.broken, 0)
        if self.taken - self.read > self.buffer:
            raise DaqReadError("The application is not able to keep up ...", OVERWRITTEN, 0)

    def samples(self, count: int) -> npt.NDArray[np.float64]:
        """Return the next `count` samples, shape (channels, count)."""
        numbers = np.arange(self.read, self.read + count)
        known = self.driver.levels_v
        levels = [
            [known.get(name, 0.1 * int(name.partition("/ai")[2]))] for name, *_ in self.channels
        ]
        self.read += count
        return np.array(levels) + MICROVOLT * numbers


class FakeChannels:
    """`Task.ai_channels`."""

    def __init__(self, task: FakeTask) -> None:
        self._task = task

    def add_ai_voltage_chan(
        self,
        physical_channel: str,
        name_to_assign_to_channel: str = "",
        terminal_config: TerminalConfiguration = TerminalConfiguration.DEFAULT,
        min_val: float = -5.0,
        max_val: float = 5.0,
        units: VoltageUnits = VoltageUnits.VOLTS,
        custom_scale_name: str = "",
    ) -> None:
        self._task.called("add_ai_voltage_chan")
        board = physical_channel.partition("/")[0]
        device = self._task.driver.device(board)
        if not device.plugged:
            fail(NO_DEVICE)
        modes = {each.name: each.ai_term_cfgs for each in device.ai_physical_chans}
        if terminal_config not in modes[physical_channel]:
            fail(BAD_VALUE, "Requested value is not a supported value for this property.")
        if any(physical_channel == each[0] for each in self._task.channels):
            fail(TWICE)
        assert units is VoltageUnits.VOLTS and not custom_scale_name and min_val < max_val
        self._task.channels.append((physical_channel, terminal_config, min_val, max_val))


class FakeTiming:
    """`Task.timing`; the rate becomes the next higher one that divides 20 MHz."""

    def __init__(self, task: FakeTask) -> None:
        self._task = task

    def cfg_samp_clk_timing(
        self,
        rate: float,
        source: str = "",
        active_edge: Edge = Edge.RISING,
        sample_mode: AcquisitionType = AcquisitionType.FINITE,
        samps_per_chan: int = 1000,
    ) -> None:
        self._task.called("cfg_samp_clk_timing")
        assert sample_mode is AcquisitionType.CONTINUOUS and active_edge is Edge.RISING
        self._task.rate_hz = 20e6 / int(20e6 / rate)
        self._task.source = source
        # The table in NI's help: the driver's own size where the hint is smaller.
        default = 1_000 if rate <= 100 else 10_000 if rate <= 10_000 else 100_000
        self._task.buffer = max(default, samps_per_chan)

    @property
    def samp_clk_rate(self) -> float:
        self._task.called("samp_clk_rate")
        return self._task.rate_hz


class FakeInStream:
    """`Task.in_stream`."""

    def __init__(self, task: FakeTask) -> None:
        self.task = task

    @property
    def input_buf_size(self) -> int:
        return self.task.buffer

    @input_buf_size.setter
    def input_buf_size(self, val: int) -> None:
        self.task.called("input_buf_size")
        self.task.buffer = val

    @property
    def avail_samp_per_chan(self) -> int:
        self.task.check_readable()
        return self.task.taken - self.task.read

    @property
    def total_samp_per_chan_acquired(self) -> int:
        assert not self.task.closed
        return self.task.taken


class FakeReader:
    """`nidaqmx.stream_readers.AnalogMultiChannelReader`."""

    def __init__(self, task_in_stream: FakeInStream) -> None:
        self._task = task_in_stream.task
        self.verify_array_shape = True

    def read_many_sample(
        self,
        data: npt.NDArray[np.float64],
        number_of_samples_per_channel: int = -1,
        timeout: float = 10.0,
    ) -> int:
        task, count = self._task, number_of_samples_per_channel
        assert data.dtype == np.float64 and data.flags.c_contiguous and data.flags.writeable
        assert data.shape == (len(task.channels), count)
        task.check_readable()
        count = task.short.pop(0) if task.short else count
        if task.taken - task.read < count:
            raise DaqReadError("Some or all of the samples requested ...", NOT_YET, 0)
        data.ravel()[: len(task.channels) * count] = task.samples(count).ravel()
        return count
