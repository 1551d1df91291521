"""A board of LabJack, streamed through the LJM library."""

import logging
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from queue import Empty, SimpleQueue
from threading import RLock
from typing import Any, Final

import numpy as np
from typing_extensions import override

from cosmic.daqco.hw.board_checks import (
    BUFFER_S,
    check_chunk,
    check_inputs,
    check_rate,
    range_in_force,
)
from cosmic.daqco.hw.interface import (
    Board,
    BoardChunk,
    BoardInfo,
    InputMode,
    InputSettings,
    OverrunError,
    Volts,
)
from cosmic.daqco.hw.labjack_connection import Connection
from cosmic.daqco.hw.labjack_errors import LATE, board_error
from cosmic.frame.clock import WALL, Clock
from cosmic.frame.errors import CosmicError, DeviceError, DeviceFault, LimitError
from cosmic.frame.verdict import Reason, refuse

logger = logging.getLogger(__name__)

SKIPPED_V: Final = -9999.0
"""What LJM puts where the board had to skip scans (LJM_DUMMY_VALUE)."""
SINGLE_ENDED: Final = 199
NOT_RUNNING: Final = (1303, 2620)
"""LJM and the board say that no stream runs."""
_HIGH_V: Final = ("ai0", "ai1", "ai2", "ai3")
"""Inputs of a T4 for 10 V; its others take 0 to 2.5 V."""

Item = tuple[int, float, Volts] | BaseException | None


@dataclass(frozen=True, slots=True)
class _Setup:
    inputs: tuple[InputSettings, ...]
    rate_hz: float
    chunk_samples: int
    asked_hz: float

    @property
    def most(self) -> int:
        """How many chunks may wait to be taken."""
        return max(4, math.ceil(BUFFER_S * self.rate_hz / self.chunk_samples))


@dataclass(eq=False)
class _Run:
    """What comes between one start and the stop.

    Attributes
    ----------
    items : SimpleQueue
        Number of the first sample, its time and volts; or what went wrong; or None: stopped.
    start_s : float
        Platform time of sample 0.
    over : bool
        Nothing more is put in.
    """

    handle: int
    setup: _Setup
    start_s: float = math.inf
    next_sample: int = 0
    over: bool = False
    items: SimpleQueue[Item] = field(default_factory=SimpleQueue)

    def end(self, item: BaseException | None) -> None:
        """Put the last item in, once; any thread."""
        if not self.over:
            self.over = True
            self.items.put(item)


class LabjackBoard(Board):
    """One board; made by its library.

    Parameters
    ----------
    api : module
        ``labjack.ljm``.
    owners : dict of str to LabjackBoard
        Of the library: who has configured each board; nobody else can until it is closed.

    Notes
    -----
    The first scan comes one period after the stream was started; when that was, is known to about
    a millisecond over USB and Ethernet (T-series data sheet, A-1).
    """

    def __init__(
        self,
        api: Any,
        info: BoardInfo,
        connection: Connection,
        clock: Clock,
        *,
        owners: "dict[str, LabjackBoard]",
        resolution_index: int = 0,
    ) -> None:
        self._api = api
        self._info = info
        self._connection = connection
        self._clock = clock
        self._owners = owners
        self._resolution_index = resolution_index
        # Orders configure, start, stop and close; LJM's thread never takes it.
        self._lock = RLock()
        self._setup: _Setup | None = None
        self._run: _Run | None = None
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
            self._setup = None
            check_inputs(self._info, inputs)
            self._check_ranges(inputs)
            check_rate(self._info, len(inputs), rate_hz)
            check_chunk(self._info, chunk_samples)
            handle = self._taken()
            setup = _Setup(tuple(inputs), rate_hz, chunk_samples, rate_hz)
            # What rate it makes, and whether it can, the board tells only when it starts.
            made_hz = self._tried(handle, setup)
            self._setup = _Setup(setup.inputs, made_hz, chunk_samples, rate_hz)
            logger.debug("%s: %d inputs at %g Hz", self._info.name, len(inputs), made_hz)
            return made_hz

    @override
    def start(self) -> None:
        with self._lock:
            self._check_idle("start")
            if self._setup is None:
                raise self._error("start: it was not configured", DeviceFault.STATE)
            setup = self._setup
            run = _Run(self._taken(), setup)
            try:
                self._write_settings(run.handle, setup)
                made_hz = self._stream(run.handle, setup)
                run.start_s = self._clock.now_s() + 1.0 / made_hz
                self._run = run
                self._heard_s = WALL.now_s()
                self._api.setStreamCallback(run.handle, lambda _handle: self._on_scans(run))
            except self._api.LJMError as exc:
                self._run = None
                self._release()
                raise self._as_device_error(board_error(exc, "start", self._info.name)) from exc
            if made_hz != setup.rate_hz:
                self.stop()
                raise self._error(
                    f"start: it makes {made_hz:g} Hz now, not the {setup.rate_hz:g} Hz that it told"
                    f"; configure it again",
                    DeviceFault.STATE,
                )

    @override
    def receive(self, timeout_s: float) -> BoardChunk | None:
        run = self._run
        if run is None:
            return None
        try:
            item = run.items.get(timeout=max(timeout_s, 0.0))
        except Empty:
            self._check_heard(run)
            return None
        if item is None or self._run is not run:
            return None
        if isinstance(item, BaseException):
            error = self._translated(item)
            self._give_up(run)
            raise error from (None if error is item else item)
        self._heard_s = WALL.now_s()
        first, time_s, volts = item
        return BoardChunk(first, time_s, volts)

    @override
    def stop(self) -> None:
        with self._lock:
            run, self._run = self._run, None
            if run is None:
                return
            run.end(None)
            if not self._end_stream(run.handle):
                self._release()

    @override
    def close(self) -> None:
        with self._lock:
            self.stop()
            self._connection.leave(self)
            if self._owners.get(self._info.name) is self:
                del self._owners[self._info.name]
            self._closed = True

    # Settings

    def _taken(self) -> int:
        if self._owners.setdefault(self._info.name, self) is not self:
            raise self._error(
                "configure: another program uses the board; close it, then try again",
                DeviceFault.STATE,
            )
        return self._connection.take(self)

    def _tried(self, handle: int, setup: _Setup) -> float:
        try:
            self._write_settings(handle, setup)
            made_hz = self._stream(handle, setup)
        except self._api.LJMError as exc:
            self._release()
            raise board_error(exc, "configure", self._info.name) from exc
        self._end_stream(handle)
        return made_hz

    def _write_settings(self, handle: int, setup: _Setup) -> None:
        settings: dict[str, float] = {"STREAM_RESOLUTION_INDEX": self._resolution_index}
        if self._info.product != "T4":
            settings |= {"STREAM_TRIGGER_INDEX": 0, "STREAM_CLOCK_SOURCE": 0}
        if self._info.product != "T8":
            settings["STREAM_SETTLING_US"] = 0
        for each in setup.inputs:
            settings |= self._settings_of(each)
        self._api.eWriteNames(handle, len(settings), list(settings), list(settings.values()))

    def _settings_of(self, each: InputSettings) -> dict[str, float]:
        if self._info.product == "T4":
            return {}
        name = _register(each.input)
        settings = {f"{name}_RANGE": range_in_force(self._info, each)[1]}
        if self._info.product == "T7":
            negative = dict(self._info.pairs or ())[each.input] if _is_pair(each) else ""
            number = int(negative.removeprefix("ai")) if negative else SINGLE_ENDED
            settings[f"{name}_NEGATIVE_CH"] = number
        return settings

    def _check_ranges(self, inputs: Sequence[InputSettings]) -> None:
        if self._info.product != "T4":
            return
        for each in inputs:
            low_v, high_v = (-10.0, 10.0) if each.input in _HIGH_V else (0.0, 2.5)
            if not low_v <= each.low_v <= each.high_v <= high_v:
                text = (
                    f"{self._info.name}/{each.input}: {each.low_v:g} to {each.high_v:g} V asked; "
                    f"this input of a T4 takes {low_v:g} to {high_v:g} V"
                )
                verdict = refuse(Reason.LIMIT, text, value=each.high_v, limit=high_v, unit="V")
                raise LimitError(verdict)

    # The stream

    def _stream(self, handle: int, setup: _Setup) -> float:
        """Start to stream and return the rate made, Hz."""
        self._end_stream(handle)  # one that a killed program left on the board
        names = [_register(each.input) for each in setup.inputs]
        addresses, _ = self._api.namesToAddresses(len(names), names)
        return float(
            self._api.eStreamStart(
                handle, setup.chunk_samples, len(names), addresses, setup.asked_hz
            )
        )

    def _end_stream(self, handle: int) -> bool:
        """End to stream; False when the handle is of no more use."""
        try:
            self._api.eStreamStop(handle)
        except self._api.LJMError as exc:
            if exc.errorCode in NOT_RUNNING:
                return True
            logger.warning("%s: stop: %s", self._info.name, exc)
            return False
        return True

    def _on_scans(self, run: _Run) -> None:
        """Fetch one chunk; LJM's thread, where an exception would be lost."""
        if run.over:
            return
        try:
            self._fetch(run)
        except BaseException as exc:  # noqa: BLE001
            run.end(exc)

    def _fetch(self, run: _Run) -> None:
        setup = run.setup
        count = setup.chunk_samples
        data, board_backlog, backlog = self._api.eStreamRead(run.handle)
        scans = np.array(data).reshape(count, len(setup.inputs))
        skipped = int((scans == SKIPPED_V).any(axis=1).sum())
        if skipped:
            raise OverrunError(
                f"{self._info.name}: read: {skipped} samples of each channel were skipped by the "
                f"board after sample {run.next_sample}: {LATE}",
                lost=skipped,
            )
        if run.items.qsize() >= setup.most:
            raise self._too_slow(run, backlog)
        if not run.next_sample:
            # When it was started is known too late rather than too early.
            age_s = (count - 1 + backlog + board_backlog) / setup.rate_hz
            run.start_s = min(run.start_s, self._clock.now_s() - age_s)
        time_s = run.start_s + run.next_sample / setup.rate_hz
        run.items.put((run.next_sample, time_s, np.ascontiguousarray(scans.T)))
        run.next_sample += count

    def _too_slow(self, run: _Run, backlog: int) -> OverrunError:
        lost = run.setup.chunk_samples + backlog
        return OverrunError(
            f"{self._info.name}: CoSMic did not take its samples for {BUFFER_S:g} s; all after "
            f"sample {run.next_sample} were lost ({lost} of each channel so far); close what slows "
            f"the computer, or lower the rate, and start again",
            lost=lost,
        )

    def _check_heard(self, run: _Run) -> None:
        """Ask the board whether it still streams, when it has been silent for long."""
        silence_s = max(1.0, 4.0 * run.setup.chunk_samples / run.setup.rate_hz)
        if WALL.now_s() - self._heard_s < silence_s:
            return
        self._heard_s = WALL.now_s()
        logger.warning("%s: no samples for %g s", self._info.name, silence_s)
        try:
            streams = bool(self._api.eReadName(run.handle, "STREAM_ENABLE"))
        except self._api.LJMError as exc:
            if self._run is run:
                self._give_up(run)
                raise board_error(exc, "acquire", self._info.name) from exc
            return
        if not streams and self._run is run:
            self._give_up(run)
            raise self._error(
                "the acquisition ended by itself; check the board in Kipling, then start again",
                DeviceFault.COMMUNICATION,
            )

    def _translated(self, exc: BaseException) -> BaseException:
        if isinstance(exc, self._api.LJMError):
            return board_error(exc, "read", self._info.name)
        return exc

    def _give_up(self, run: _Run) -> None:
        with self._lock:
            if self._run is run:
                run.over = True
                self._run = None
                self._end_stream(run.handle)
                self._release()

    def _release(self) -> None:
        """Let go of a handle that has failed; a board that was lost may be back."""
        self._connection.renew()

    def _as_device_error(self, error: CosmicError) -> DeviceError:
        if isinstance(error, DeviceError):
            return error
        return self._error(f"start: {error}", DeviceFault.PARAMETER)

    def _check_idle(self, call: str) -> None:
        if self._closed:
            raise self._error(f"{call}: it was closed; open it again", DeviceFault.STATE)
        if self._run is not None:
            raise self._error(f"{call}: it is acquiring; stop it first", DeviceFault.STATE)

    def _error(self, text: str, fault: DeviceFault) -> DeviceError:
        return DeviceError(f"{self._info.name}: {text}", fault=fault)


def _register(name: str) -> str:
    """Return LabJack's name of an input: "AIN3" for "ai3"."""
    return f"AIN{name.removeprefix('ai')}"


def _is_pair(each: InputSettings) -> bool:
    return each.mode is InputMode.DIFFERENTIAL
