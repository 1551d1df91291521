"""What DAQCo asks of the outputs of a board: a value now, a waveform, a line."""

from abc import abstractmethod
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from cosmic.daqco.hw.interface import BoardLibrary, Volts
from cosmic.daqco.hw.joined_boards import JoinedLibrary
from cosmic.frame.errors import NotAvailable


@dataclass(frozen=True, slots=True)
class OutputsInfo:
    """The outputs of a board.

    Attributes
    ----------
    analog : tuple of str
        "ao0" and so on.
    lines : tuple of str
        Digital lines, "port0/line0" and so on.
    low_v, high_v : float
        What the analogue outputs can give.
    max_rate_hz : float
        Highest rate of a waveform; 0: the board plays none.
    """

    board: str
    analog: tuple[str, ...]
    lines: tuple[str, ...]
    low_v: float
    high_v: float
    max_rate_hz: float


@dataclass(frozen=True, slots=True)
class AnalogOutput:
    """An analogue output and the voltages that whatever hangs on it may get."""

    output: str
    low_v: float
    high_v: float


@dataclass(frozen=True, slots=True, eq=False)
class Waveform:
    """Voltages to be given one after the other.

    Attributes
    ----------
    volts : ndarray, shape (n,), float64, V
    rate_hz : float
        Of the values.
    repeat : bool
        Begin anew at the end, until it is ended.
    trigger : str
        Terminal whose rising edge begins it, such as "/Dev1/PFI0" or "/Dev1/ai/StartTrigger";
        empty: it begins at once.
    """

    volts: Volts
    rate_hz: float
    repeat: bool = False
    trigger: str = ""


class BoardOutputs(Protocol):
    """The outputs of one board; calls come one at a time, from any thread.

    Who calls has checked limits and names; what the board itself cannot do is refused here.
    """

    @property
    @abstractmethod
    def info(self) -> OutputsInfo:
        """Which outputs there are."""

    @abstractmethod
    def write(self, output: AnalogOutput, volts: float) -> None:
        """Give `volts` from now on; a waveform of this output ends.

        Raises
        ------
        DeviceError
            The board is gone, taken, or refused.
        """

    @abstractmethod
    def write_line(self, line: str, *, high: bool) -> None:
        """Set a digital line; raises `DeviceError`."""

    @abstractmethod
    def play(self, output: AnalogOutput, waveform: Waveform) -> float:
        """Give the values of a waveform by the board's own clock; return its real rate, Hz.

        Afterwards the output keeps the last value.

        Raises
        ------
        LimitError
            The board does not make this rate.
        NotAvailable
            It plays no waveforms, or one already.
        DeviceError
            It is gone, taken, or refused.
        """

    @property
    @abstractmethod
    def playing(self) -> str:
        """The output whose waveform is played or waits for its trigger; empty for none."""

    @abstractmethod
    def end_waveform(self) -> None:
        """End the waveform that is played; its output keeps what it gives then. Never raises."""

    @abstractmethod
    def close(self) -> None:
        """Give the board back; outputs keep what they give. Harmless the second time."""


@runtime_checkable
class OutputLibrary(Protocol):
    """A driver whose boards have outputs; a `BoardLibrary` may be one."""

    @abstractmethod
    def open_outputs(self, board: str) -> BoardOutputs:
        """Return the outputs of a board; raises `NotConnectedError` where there is none."""


def open_outputs(library: BoardLibrary, board: str) -> BoardOutputs:
    """Return the outputs of a board of `library`.

    Raises
    ------
    NotAvailable
        The driver of this board has none.
    NotConnectedError
        There is no such board.
    """
    own = library.library_of(board) if isinstance(library, JoinedLibrary) else library
    if not isinstance(own, OutputLibrary):
        raise NotAvailable(f"{board}: {own.name} has no outputs")
    return own.open_outputs(board)
