"""A board of National Instruments through NI-DAQmx."""

import logging
from collections.abc import Mapping, Sequence
from queue import Empty
from threading import RLock
from typing import Any

from nidaqmx.constants import TerminalConfiguration
from typing_extensions import override

from cosmic.daqco.hw.board_checks import check_chunk, check_inputs, check_rate
from cosmic.daqco.hw.interface import Board, BoardChunk, BoardInfo, InputSettings
from cosmic.daqco.hw.nidaqmx_task import TERMINALS, CounterTask, InputTask, Run, TaskSettings
from cosmic.daqco.hw.pulses import PulseTrain
from cosmic.frame.clock import WALL, Clock
from cosmic.frame.errors import CosmicError, DeviceError, DeviceFault, LimitError

logger = logging.getLogger(__name__)

Wiring = Mapping[str, Sequence[TerminalConfiguration]]


class NidaqmxBoard(Board):
    """One board; made by its library.

    Parameters
    ----------
    api : module
        nidaqmx.
    wiring : mapping of str to sequence of TerminalConfiguration
        How each input can be wired.
    clock_source : str
        Terminal of the sample clock, such as "/Dev1/ai/SampleClock"; empty is the board's own.
        Start the board that takes its clock from another before that other.
    start_trigger : str
        Terminal whose rising edge starts it, such as "/Dev1/PFI0"; empty: it starts when told to.
    """

    def __init__(
        self,
        api: Any,
        info: BoardInfo,
        wiring: Wiring,
        clock: Clock,
        *,
        clock_source: str = "",
        start_trigger: str = "",
    ) -> None:
        self._api = api
        self._info = info
        self._wiring = wiring
        self._clock = clock
        self._clock_source = clock_source
        self._start_trigger = start_trigger
        self._train: PulseTrain | None = None
        self._counter: CounterTask | None = None
        # Orders configure, start, stop and close; the driver's thread never takes it.
        self._lock = RLock()
        self._settings: TaskSettings | None = None
        self._task: InputTask | None = None
        self._run: Run | None = None
        self._heard_s = 0.0
        self._closed = False

    @property
    @override
    def info(self) -> BoardInfo:
        return self._info

    @override
    def configure(
        self, inputs: Sequence[InputSettings], rate_hz: float, chunk_samples: int
    ) -> float:
        with self._lock:
            self._check_idle("configure")
            self._settings = None
            self._check_wiring(inputs)
            check_rate(self._info, len(inputs), rate_hz)
            check_chunk(self._info, chunk_samples)
            self._drop_task()
            settings = TaskSettings(
                self._info.name,
                tuple(inputs),
                rate_hz,
                chunk_samples,
                self._clock_source,
                self._start_trigger,
            )
            self._task = InputTask(self._api, settings)
            self._settings = settings
            logger.debug("%s: %d inputs at %g Hz", settings.board, len(inputs), self._task.rate_hz)
            return self._task.rate_hz

    @override
    def start(self) -> None:
        with self._lock:
            self._check_idle("start")
            if self._settings is None:
                raise self._error("start: it was not configured", DeviceFault.STATE)
            run = Run(self._clock.now_s, clocked=bool(self._clock_source or self._start_trigger))
            try:
                self._begin(run)
            except LimitError as exc:
                raise self._error(f"start: {exc}", DeviceFault.PARAMETER) from exc
            self._heard_s = WALL.now_s()
            self._run = run

    @override
    def receive(self, timeout_s: float) -> BoardChunk | None:
        run, task = self._run, self._task
        if run is None or task is None:
            return None
        try:
            item = run.items.get(timeout=max(timeout_s, 0.0))
        except Empty:
            self._check_heard(run, task)
            return None
        if item is None or self._run is not run:
            return None
        if isinstance(item, BaseException):
            error = task.translated(item, run)
            self._give_up(run)
            raise error from (None if error is item else item)
        self._heard_s = WALL.now_s()
        first, volts = item
        return BoardChunk(first, run.start_s + first / task.rate_hz, volts)

    @override
    def stop(self) -> None:
        with self._lock:
            run, self._run = self._run, None
            if run is None:
                return
            run.end(None)
            self._end_pulses()
            if self._task is not None and not self._task.stop():
                self._drop_task()

    @override
    def close(self) -> None:
        with self._lock:
            self.stop()
            self._drop_task()
            self._closed = True

    def pulse(self, train: PulseTrain | None) -> None:
        """Give these pulses with each acquisition from the next start on; None: none."""
        self._train = train

    def _begin(self, run: Run) -> None:
        assert self._settings is not None
        if self._task is None:
            # The last one died with an error; a board that was lost may be back.
            self._task = InputTask(self._api, self._settings)
        self._end_pulses()
        if self._train is not None:
            # Who counts the sample clock must listen before it begins.
            self._counter = CounterTask(self._api, self._train)
        run.start_s = self._clock.now_s()
        try:
            self._task.start(run)
        except CosmicError:
            self._drop_task()
            raise
        if not run.clocked:
            run.start_s = 0.5 * (run.start_s + self._clock.now_s())

    def _check_heard(self, run: Run, task: InputTask) -> None:
        """Ask the driver whether it still acquires, when it has been silent for long."""
        assert self._settings is not None
        silence_s = max(1.0, 4.0 * self._settings.chunk_samples / task.rate_hz)
        if WALL.now_s() - self._heard_s < silence_s:
            return
        self._heard_s = WALL.now_s()
        logger.warning("%s: no samples for %g s", self._info.name, silence_s)
        try:
            task.check_alive()
        except CosmicError:
            if self._run is not run:
                return
            self._give_up(run)
            raise

    def _give_up(self, run: Run) -> None:
        with self._lock:
            if self._run is run:
                run.over = True
                self._run = None
                self._drop_task()

    def _end_pulses(self) -> None:
        counter, self._counter = self._counter, None
        if counter is not None:
            counter.close()

    def _drop_task(self) -> None:
        self._end_pulses()
        task, self._task = self._task, None
        if task is not None:
            task.close()

    def _check_idle(self, call: str) -> None:
        if self._closed:
            raise self._error(f"{call}: it was closed; open it again", DeviceFault.STATE)
        if self._run is not None:
            raise self._error(f"{call}: it is acquiring; stop it first", DeviceFault.STATE)

    def _check_wiring(self, inputs: Sequence[InputSettings]) -> None:
        # Boards with differential inputs only have no pairs.
        paired = any(TerminalConfiguration.RSE in modes for modes in self._wiring.values())
        check_inputs(self._info, inputs, paired=paired)
        for each in inputs:
            possible = [
                mode for mode, term in TERMINALS.items() if term in self._wiring[each.input]
            ]
            if each.mode not in possible:
                raise self._error(
                    f"{each.input} cannot be wired {each.mode}; it can: {', '.join(possible)}",
                    DeviceFault.PARAMETER,
                )

    def _error(self, text: str, fault: DeviceFault) -> DeviceError:
        return DeviceError(f"{self._info.name}: {text}", fault=fault)
