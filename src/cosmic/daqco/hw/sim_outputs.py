"""The outputs of a simulated board, and what comes in where one is wired to an input."""

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from threading import Lock
from typing import Final

import numpy as np
import numpy.typing as npt
from typing_extensions import override

from cosmic.daqco.hw.interface import BoardInfo, Source
from cosmic.daqco.hw.outputs import AnalogOutput, BoardOutputs, OutputsInfo, Waveform
from cosmic.daqco.hw.sim_faults import BoardFaults
from cosmic.frame.clock import Clock
from cosmic.frame.errors import (
    DeviceError,
    DeviceFault,
    LimitError,
    NotAvailable,
    NotConnectedError,
)
from cosmic.frame.verdict import Reason, refuse

MAX_RATE_HZ: Final = 833e3
"""NI 622x specification: one channel."""
RANGE_V: Final = (-10.0, 10.0)
_REMEMBERED: Final = 64


class Terminals:
    """The trigger terminals of the boards of one library; any thread."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._waiting: dict[str, list[Callable[[float], object]]] = {}

    def once(self, terminal: str, listener: Callable[[float], object]) -> None:
        """Call `listener(time_s)` at the next rising edge."""
        with self._lock:
            self._waiting.setdefault(terminal, []).append(listener)

    def rise(self, terminal: str, time_s: float) -> None:
        """Let a terminal rise at a platform time that has come."""
        with self._lock:
            waiting = self._waiting.pop(terminal, [])
        for listener in waiting:
            listener(time_s)


@dataclass(slots=True)
class _Piece:
    """What an output gives from some moment on: a value, or a waveform."""

    start_s: float
    volts: npt.NDArray[np.float64]
    rate_hz: float = 0.0
    repeat: bool = False
    before_v: float = 0.0
    """Until the trigger comes."""

    def at(self, times_s: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        if not self.rate_hz:
            return np.full(times_s.shape, self.volts[0])
        if math.isinf(self.start_s):
            return np.full(times_s.shape, self.before_v)
        # A hair of rounding must not show the value before the one that was due.
        steps = np.floor((times_s - self.start_s) * self.rate_hz + 1e-6).astype(np.int64)
        last = self.volts.size - 1
        wanted = steps % self.volts.size if self.repeat else np.minimum(steps, last)
        return np.where(steps < 0, self.before_v, self.volts[np.maximum(wanted, 0)])

    def over(self, now_s: float) -> bool:
        """Whether a waveform has been given to its end."""
        if not self.rate_hz:
            return True
        return not self.repeat and now_s >= self.start_s + self.volts.size / self.rate_hz


class OutputLevel(Source):
    """What one analogue output gives at any moment of late; any thread."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._pieces: deque[tuple[float, _Piece]] = deque(maxlen=_REMEMBERED)
        self._pieces.append((-math.inf, _Piece(-math.inf, np.zeros(1))))

    @override
    def volts(self, times_s: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        with self._lock:
            pieces = list(self._pieces)
        found = pieces[0][1].at(times_s)
        for from_s, piece in pieces[1:]:
            later = times_s >= from_s
            if later.any():
                found[later] = piece.at(times_s[later])
        return found

    def at(self, time_s: float) -> float:
        """Return what it gives at a moment, V."""
        return float(self.volts(np.array([time_s]))[0])

    def put(self, now_s: float, piece: _Piece) -> None:
        """Give something else from now on."""
        piece.before_v = self.at(now_s)
        with self._lock:
            self._pieces.append((now_s, piece))

    def over(self, now_s: float) -> bool:
        """Whether no waveform is given, or awaited, any more."""
        with self._lock:
            return self._pieces[-1][1].over(now_s)


class SimulatedOutputs(BoardOutputs):
    """Two analogue outputs and one port of eight lines; made by its library.

    Parameters
    ----------
    levels : dict of str to OutputLevel
        By output; they stay when this is closed, as the voltages of a real board do.
    lines : dict of str to bool
        By line; one that rises is an edge at the terminal of its name.
    """

    def __init__(
        self,
        info: BoardInfo,
        clock: Clock,
        faults: BoardFaults,
        terminals: Terminals,
        *,
        levels: dict[str, OutputLevel],
        lines: dict[str, bool],
    ) -> None:
        self._board = info.name
        self._clock = clock
        self._faults = faults
        self._terminals = terminals
        self._levels = levels
        self._lines = lines
        self._playing = ""
        self._closed = False

    @property
    @override
    def info(self) -> OutputsInfo:
        low_v, high_v = RANGE_V
        return OutputsInfo(
            self._board, tuple(self._levels), tuple(self._lines), low_v, high_v, MAX_RATE_HZ
        )

    @override
    def write(self, output: AnalogOutput, volts: float) -> None:
        level = self._level(output.output, "write")
        self._check_range(output, volts, volts)
        if self._playing == output.output:
            self._playing = ""
        now_s = self._clock.now_s()
        level.put(now_s, _Piece(now_s, np.array([float(volts)])))

    @override
    def write_line(self, line: str, *, high: bool) -> None:
        self._check_there("write")
        if line not in self._lines:
            raise self._no_output(line)
        rises = high and not self._lines[line]
        self._lines[line] = high
        if rises:
            self._terminals.rise(f"/{self._board}/{line}", self._clock.now_s())

    @override
    def play(self, output: AnalogOutput, waveform: Waveform) -> float:
        level = self._level(output.output, "play")
        if self.playing:
            raise NotAvailable(f"{self._board}: a waveform is played on {self.playing}; end it")
        if not 0.0 < waveform.rate_hz <= MAX_RATE_HZ:
            raise _limit(
                f"{self._board}: a waveform at {waveform.rate_hz:g} Hz asked; up to "
                f"{MAX_RATE_HZ:g} Hz",
                waveform.rate_hz,
                MAX_RATE_HZ,
                "Hz",
            )
        self._check_range(output, float(waveform.volts.min()), float(waveform.volts.max()))
        now_s = self._clock.now_s()
        start_s = math.inf if waveform.trigger else now_s
        piece = _Piece(start_s, waveform.volts.copy(), waveform.rate_hz, waveform.repeat)
        level.put(now_s, piece)
        self._playing = output.output
        if waveform.trigger:
            self._terminals.once(waveform.trigger, lambda at_s: _begin(piece, at_s))
        return waveform.rate_hz

    @property
    @override
    def playing(self) -> str:
        if self._playing and self._levels[self._playing].over(self._clock.now_s()):
            self._playing = ""
        return self._playing

    @override
    def end_waveform(self) -> None:
        if self.playing:
            level, now_s = self._levels[self._playing], self._clock.now_s()
            level.put(now_s, _Piece(now_s, np.array([level.at(now_s)])))
        self._playing = ""

    @override
    def close(self) -> None:
        self.end_waveform()
        self._closed = True

    def _level(self, output: str, call: str) -> OutputLevel:
        self._check_there(call)
        if output not in self._levels:
            raise self._no_output(output)
        return self._levels[output]

    def _check_range(self, output: AnalogOutput, low_v: float, high_v: float) -> None:
        bottom_v, top_v = RANGE_V
        if not bottom_v <= low_v <= high_v <= top_v:
            text = (
                f"{self._board}/{output.output}: {low_v:g} to {high_v:g} V asked; the board gives "
                f"{bottom_v:g} to {top_v:g} V"
            )
            raise _limit(text, high_v, top_v, "V")

    def _check_there(self, call: str) -> None:
        if self._closed:
            raise DeviceError(f"{self._board}: {call}: it was closed", fault=DeviceFault.STATE)
        if self._faults.hit("unplugged", self._board) or self._faults.hit("no_driver", ""):
            raise NotConnectedError(
                f"{self._board}: {call}: the board is gone; check its cable and power",
                fault=DeviceFault.COMMUNICATION,
            )

    def _no_output(self, output: str) -> DeviceError:
        there = ", ".join((*self._levels, *self._lines))
        return DeviceError(
            f"{self._board}: there is no output {output!r}; there are {there}",
            fault=DeviceFault.NO_CHANNEL,
        )


def _begin(piece: _Piece, at_s: float) -> None:
    piece.start_s = at_s


def _limit(text: str, value: float, limit: float, unit: str) -> LimitError:
    return LimitError(refuse(Reason.LIMIT, text, value=value, limit=limit, unit=unit))
