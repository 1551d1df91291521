"""What DAQCo asks of an acquisition board, whoever made it (thesis 4.3, 6.2)."""

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Protocol

import numpy as np
import numpy.typing as npt

from cosmic.frame.clock import Clock
from cosmic.frame.errors import DeviceError, DeviceFault
from cosmic.frame.plugins import Backend
from cosmic.twin.trigger_line import TriggerLine

Volts = npt.NDArray[np.float64]


class OverrunError(DeviceError):
    """Samples were lost because they were not fetched in time; the board has stopped.

    Attributes
    ----------
    lost : int or None
        How many of each channel, where the driver knows.
    """

    def __init__(self, text: str, *, lost: int | None = None, code: int | None = None) -> None:
        super().__init__(text, fault=DeviceFault.OVERRUN, code=code)
        self.lost = lost


class InputMode(StrEnum):
    """How an input is wired; names and meaning are NI's."""

    RSE = "rse"
    NRSE = "nrse"
    DIFFERENTIAL = "differential"


@dataclass(frozen=True, slots=True)
class BoardInfo:
    """What a board is and what it can do.

    Attributes
    ----------
    name : str
        What the driver calls it, such as "Dev1".
    product : str
        Such as "PCI-6229".
    inputs : tuple of str
        Single-ended inputs in order, "ai0" and so on. On boards of National Instruments the first
        eight of each block of sixteen can be wired differentially, ai0 with ai8 and so on.
    max_single_rate_hz, max_multi_rate_hz : float
        Highest rate of one input alone, and the sum of the rates of several.
    ranges_v : tuple of (float, float)
        Input ranges, the widest first.
    modes : tuple of InputMode
        How inputs can be wired at all; a board may refuse one for some of its inputs.
    pairs : tuple of (str, str), or None
        Positive and negative input of each differential pair; None is that of National
        Instruments, as above. Empty: a differential input has two terminals of its own.
    """

    name: str
    product: str
    simulated: bool
    serial: int
    inputs: tuple[str, ...]
    max_single_rate_hz: float
    max_multi_rate_hz: float
    ranges_v: tuple[tuple[float, float], ...]
    modes: tuple[InputMode, ...] = tuple(InputMode)
    pairs: tuple[tuple[str, str], ...] | None = None

    def highest_rate_hz(self, active: int) -> float:
        """Return the highest sampling rate a channel with `active` channels at once."""
        if active <= 1:
            return self.max_single_rate_hz
        return min(self.max_single_rate_hz, self.max_multi_rate_hz / active)


@dataclass(frozen=True, slots=True)
class InputSettings:
    """One input to acquire: which, how it is wired, and the voltages expected there."""

    input: str
    mode: InputMode
    low_v: float
    high_v: float


@dataclass(frozen=True, slots=True)
class BoardChunk:
    """Samples of one board, in one piece.

    Attributes
    ----------
    first_sample : int
        Number of the first sample since the start; no gaps between chunks.
    time_s : float
        Platform time of that sample.
    volts : ndarray, shape (inputs, n), float64, V
        In the order configured; fresh for each chunk, and the receiver's.
    """

    first_sample: int
    time_s: float
    volts: Volts


class Board(Protocol):
    """One acquisition board.

    Order of calls: `configure`, `start`, `receive` again and again, `stop`; then `configure` or
    `start` again; at last `close`. One thread receives; any thread may stop.
    """

    @property
    @abstractmethod
    def info(self) -> BoardInfo:
        """What the board is and can do."""

    @abstractmethod
    def configure(
        self, inputs: Sequence[InputSettings], rate_hz: float, chunk_samples: int
    ) -> float:
        """Prepare to acquire and return the rate that the board really makes, Hz.

        Raises
        ------
        LimitError
            A rate, range or number of inputs that the board does not have.
        DeviceError
            The board is gone or taken by another program.
        """

    @abstractmethod
    def start(self) -> None:
        """Begin to acquire; sample 0 is taken now.

        Raises
        ------
        DeviceError
            The board is gone, taken, or was not configured.
        """

    @abstractmethod
    def receive(self, timeout_s: float) -> BoardChunk | None:
        """Return the next chunk, or None after `timeout_s` of wall time.

        Raises
        ------
        DeviceError
            `OverrunError` when samples were lost, with how many in the text; the board is gone, or
            failed. After it nothing more comes before the next `start`.
        """

    @abstractmethod
    def stop(self) -> None:
        """End acquiring; harmless when nothing runs. A `receive` that waits returns None."""

    @abstractmethod
    def close(self) -> None:
        """Give the board back; harmless the second time."""


class Source(Protocol):
    """Something that makes a voltage at an input."""

    @abstractmethod
    def volts(self, times_s: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """Return the voltage at each of `times_s`, V; called with increasing times.

        Parameters
        ----------
        times_s : ndarray, shape (n,), float64, s
            Platform time, not after now.
        """


class BoardLibrary(Protocol):
    """The driver behind some boards."""

    @property
    @abstractmethod
    def name(self) -> str:
        """What the operator reads, such as "NI-DAQmx 26.8"."""

    @abstractmethod
    def list_boards(self) -> tuple[BoardInfo, ...]:
        """Return the boards there are.

        Raises
        ------
        NotConnectedError
            The driver is not installed; the text says what to install.
        """

    @abstractmethod
    def open(self, name: str) -> Board:
        """Return a board by name.

        Raises
        ------
        NotConnectedError
            There is none of that name.
        """


@dataclass(frozen=True, slots=True)
class BoardContext:
    """What a platform gives to the driver of its boards.

    Attributes
    ----------
    clock : Clock
        The platform's, which paces simulated boards and stamps the samples of real ones.
    clock_sources : mapping of str to str
        Terminals from which boards take their sample clock, by board, such as
        ``{"Dev2": "/Dev1/ai/SampleClock"}``.
    start_triggers : mapping of str to str
        Terminals whose rising edge starts a board, which waits for it: ``{"Dev1": "/Dev1/PFI0"}``.
    scene_sources : mapping of (str, str) to Source, or None
        What the twin connects to each board and input; None where there is no twin.
    trigger_lines : mapping of str to TriggerLine
        What the twin connects to counters of simulated boards, such as "Dev1/ctr0".
    seed : int
        Of what is random in simulated boards.
    """

    clock: Clock
    clock_sources: Mapping[str, str] = field(default_factory=dict)
    scene_sources: Mapping[tuple[str, str], Source] | None = None
    seed: int = 0
    start_triggers: Mapping[str, str] = field(default_factory=dict)
    trigger_lines: Mapping[str, TriggerLine] = field(default_factory=dict)


BoardBackend = Backend[BoardContext, BoardLibrary]
"""What an entry point of the group ``cosmic.boards`` leads to."""
