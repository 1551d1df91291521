"""Tasks of NI-DAQmx: inputs with a callback for each chunk, and a counter of sample clocks."""

import logging
import math
from collections.abc import Callable
from dataclasses import dataclass, field
from queue import SimpleQueue
from typing import Any, Final

import numpy as np
from nidaqmx.constants import AcquisitionType, Level, TaskMode, TerminalConfiguration, VoltageUnits
from nidaqmx.errors import DaqError, Error

from cosmic.daqco.hw.board_checks import BUFFER_S
from cosmic.daqco.hw.interface import InputMode, InputSettings, OverrunError, Volts
from cosmic.daqco.hw.nidaqmx_errors import TABLE, board_error
from cosmic.daqco.hw.pulses import PulseTrain
from cosmic.frame.errors import DeviceError, DeviceFault, DeviceTimeout

logger = logging.getLogger(__name__)

READ_TIMEOUT_S: Final = 1.0
OVERWRITTEN: Final = -200279
TERMINALS: Final = {
    InputMode.RSE: TerminalConfiguration.RSE,
    InputMode.NRSE: TerminalConfiguration.NRSE,
    InputMode.DIFFERENTIAL: TerminalConfiguration.DIFF,
}

Item = tuple[int, Volts] | BaseException | None


@dataclass(frozen=True, slots=True)
class TaskSettings:
    """What a task acquires.

    Attributes
    ----------
    clock_source : str
        Terminal of the sample clock; empty is the board's own.
    start_trigger : str
        Terminal whose rising edge starts it; empty: it starts when told to.
    """

    board: str
    inputs: tuple[InputSettings, ...]
    rate_hz: float
    chunk_samples: int
    clock_source: str
    start_trigger: str = ""

    @property
    def buffer_samples(self) -> int:
        """Samples a channel of the driver's buffer, of whole chunks: boards with DMA insist."""
        chunks = math.ceil(BUFFER_S * self.rate_hz / self.chunk_samples)
        return max(chunks, 4) * self.chunk_samples


class _EndedWithError(Exception):
    """The driver's Done event, with an error."""

    def __init__(self, code: int) -> None:
        super().__init__(code)
        self.code = code


@dataclass(eq=False)
class Run:
    """What comes between one start and the stop.

    Attributes
    ----------
    items : SimpleQueue
        Number of the first sample and volts; or what went wrong; or None: it was stopped.
    start_s : float
        Platform time of sample 0.
    clocked : bool
        By another board, or a trigger, which decides when sample 0 is taken.
    over : bool
        Nothing more is put in.
    """

    now_s: Callable[[], float]
    clocked: bool = False
    items: SimpleQueue[Item] = field(default_factory=SimpleQueue)
    start_s: float = 0.0
    next_sample: int = 0
    over: bool = False

    def end(self, item: BaseException | None) -> None:
        """Put the last item in, once; any thread."""
        if not self.over:
            self.over = True
            self.items.put(item)


class InputTask:
    """A task of the driver, reserved and ready to start.

    Parameters
    ----------
    api : module
        nidaqmx.

    Raises
    ------
    CosmicError
        The driver refused; nothing is reserved then.
    """

    def __init__(self, api: Any, settings: TaskSettings) -> None:
        self._settings = settings
        self._run: Run | None = None
        self._most = settings.buffer_samples // settings.chunk_samples
        try:
            self._task = api.Task()
        except Error as exc:
            raise board_error(exc, "create a task", settings.board) from exc
        try:
            self._prepare()
            self._reader = api.stream_readers.AnalogMultiChannelReader(self._task.in_stream)
            # The arrays are made here, so that their shape need not be checked at each chunk.
            self._reader.verify_array_shape = False
            self.rate_hz = float(self._task.timing.samp_clk_rate)
        except BaseException as exc:
            self.close()
            if isinstance(exc, Error):
                raise board_error(exc, "configure", settings.board) from exc
            raise

    def _prepare(self) -> None:
        settings, task = self._settings, self._task
        for each in settings.inputs:
            task.ai_channels.add_ai_voltage_chan(
                f"{settings.board}/{each.input}",
                terminal_config=TERMINALS[each.mode],
                min_val=each.low_v,
                max_val=each.high_v,
                units=VoltageUnits.VOLTS,
            )
        task.timing.cfg_samp_clk_timing(
            settings.rate_hz,
            source=settings.clock_source,
            sample_mode=AcquisitionType.CONTINUOUS,
            samps_per_chan=settings.buffer_samples,
        )
        if settings.start_trigger:
            task.triggers.start_trigger.cfg_dig_edge_start_trig(settings.start_trigger)
        # The driver takes the line above for a hint and may make a buffer of another size.
        task.in_stream.input_buf_size = settings.buffer_samples
        task.register_every_n_samples_acquired_into_buffer_event(
            settings.chunk_samples, self._on_samples
        )
        task.register_done_event(self._on_done)
        # Taken by another program, or wrong? Better told here than at the start.
        task.control(TaskMode.TASK_COMMIT)

    def start(self, run: Run) -> None:
        """Begin to acquire into `run`; raises what the driver says."""
        self._run = run
        try:
            self._task.start()
        except Error as exc:
            run.over = True
            raise board_error(exc, "start", self._settings.board) from exc

    def stop(self) -> bool:
        """End acquiring; False when the task cannot be used again."""
        try:
            self._task.stop()
        except Error as exc:
            logger.warning("%s: stop: %s", self._settings.board, exc)
            return False
        return True

    def close(self) -> None:
        """Give the board back; a driver that fails here is logged."""
        try:
            self._task.close()
        except Error as exc:
            logger.warning("%s: close: %s", self._settings.board, exc)

    def check_alive(self) -> None:
        """Raise when the task has ended, which a lost board does not always report."""
        board = self._settings.board
        try:
            done = self._task.is_task_done()
        except Error as exc:
            raise board_error(exc, "acquire", board) from exc
        if done:
            raise DeviceError(
                f"{board}: the acquisition ended by itself; check the board in NI MAX, then start "
                f"again",
                fault=DeviceFault.COMMUNICATION,
            )

    def translated(self, exc: BaseException, run: Run) -> BaseException:
        """Return what `exc`, put in by a callback, means."""
        board = self._settings.board
        if isinstance(exc, _EndedWithError):
            return TABLE.error(exc.code, "acquire", board, lost=self._lost(exc.code, run))
        if isinstance(exc, DaqError):
            return board_error(exc, "read", board, lost=self._lost(exc.error_code, run))
        return board_error(exc, "read", board) if isinstance(exc, Error) else exc

    # --- the driver's thread: an exception or anything but an int would be garbage in C ----------

    def _on_samples(self, _handle: object, _kind: object, _count: object, _data: object) -> int:
        run = self._run
        if run is not None:
            try:
                self._fetch(run)
            except BaseException as exc:  # noqa: BLE001
                run.end(exc)
        return 0

    def _on_done(self, _handle: object, status: int, _data: object) -> int:
        run = self._run
        if run is not None and status < 0:
            run.end(_EndedWithError(status))
        return 0

    def _fetch(self, run: Run) -> None:
        """Read all whole chunks: several events may have become one, or one come late."""
        stream, count = self._task.in_stream, self._settings.chunk_samples
        while not run.over and (there := stream.avail_samp_per_chan) >= count:
            if run.clocked and not run.next_sample:
                run.start_s = run.now_s() - there / self.rate_hz
            if run.items.qsize() >= self._most:
                raise self._too_slow(run)
            volts = self._read()
            run.items.put((run.next_sample, volts))
            run.next_sample += count

    def _read(self) -> Volts:
        inputs, count = len(self._settings.inputs), self._settings.chunk_samples
        volts = np.empty((inputs, count))
        got = self._reader.read_many_sample(volts, count, READ_TIMEOUT_S)
        if got == count:
            return volts
        # After a short read the driver leaves the samples packed at the start of the array.
        parts: list[Volts] = []
        while True:
            if got <= 0:
                raise DeviceTimeout(
                    f"{self._settings.board}: read brought "
                    f"{sum(part.shape[1] for part in parts)} of {count} samples, then none",
                    fault=DeviceFault.TIMEOUT,
                )
            parts.append(volts.ravel()[: inputs * got].reshape(inputs, got))
            missing = count - sum(part.shape[1] for part in parts)
            if not missing:
                return np.concatenate(parts, axis=1)
            volts = np.empty((inputs, missing))
            got = self._reader.read_many_sample(volts, missing, READ_TIMEOUT_S)

    def _too_slow(self, run: Run) -> DeviceError:
        lost = self._behind(run)
        return OverrunError(
            f"{self._settings.board}: CoSMic did not take its samples for {BUFFER_S:g} s; all "
            f"after sample {run.next_sample} were lost ({lost} of each channel so far); close what "
            f"slows the computer, or lower the rate, and start again",
            lost=lost,
        )

    def _behind(self, run: Run) -> int:
        return int(self._task.in_stream.total_samp_per_chan_acquired) - run.next_sample

    def _lost(self, code: int, run: Run) -> int | None:
        """Return how many samples a channel an overrun cost, as far as the driver knows."""
        try:
            behind = self._behind(run)
        except Error:
            return None
        lost = behind - self._settings.buffer_samples if code == OVERWRITTEN else behind
        return lost if lost > 0 else None


class CounterTask:
    """A counter that gives a pulse at every so many samples; start it before the inputs.

    The pulse comes out at the counter's own terminal, PFI 12 for ctr0 and PFI 13 for ctr1 on boards
    of the M series.

    Raises
    ------
    CosmicError
        The driver refused; nothing is reserved then.
    """

    def __init__(self, api: Any, train: PulseTrain) -> None:
        self._board = train.board
        high = train.every_samples // 2
        try:
            self._task = api.Task()
        except Error as exc:
            raise board_error(exc, "create a task", train.board) from exc
        try:
            self._task.co_channels.add_co_pulse_chan_ticks(
                f"{train.board}/{train.counter}",
                f"/{train.board}/ai/SampleClock",
                idle_state=Level.LOW,
                initial_delay=train.first_sample,
                low_ticks=train.every_samples - high,
                high_ticks=high,
            )
            self._task.timing.cfg_implicit_timing(sample_mode=AcquisitionType.CONTINUOUS)
            self._task.start()
        except Error as exc:
            self.close()
            raise board_error(exc, f"start {train.counter}", train.board) from exc

    def close(self) -> None:
        """End the pulses and give the counter back; a driver that fails here is logged."""
        try:
            self._task.close()
        except Error as exc:
            logger.warning("%s: close of a counter: %s", self._board, exc)
