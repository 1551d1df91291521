"""The boards under contract: simulated ones, and real ones over a fake driver."""

from abc import ABC, abstractmethod

import numpy as np
import numpy.typing as npt
from typing_extensions import override

from contract.fake_ljm import FakeLjm
from contract.fake_nidaqmx import FakeNidaqmx
from cosmic.daqco.hw.interface import Board, BoardChunk, BoardLibrary, InputMode, InputSettings
from cosmic.daqco.hw.labjack_library import LabjackLibrary
from cosmic.daqco.hw.nidaqmx_library import NidaqmxLibrary
from cosmic.daqco.hw.sim_library import SimulatedLibrary
from cosmic.frame.clock import ManualClock
from cosmic.frame.errors import DeviceError


class BoardRig(ABC):
    """Two boards, PCI-6229 `Dev1` and `Dev2` by default, whose input aiK carries about K * 0.1 V.

    Time stands still unless a test calls `go_on`.
    """

    library: BoardLibrary
    one, other, product = "Dev1", "Dev2", "PCI-6229"
    count, sum_hz = 32, 250_000.0
    ranges_v: tuple[tuple[float, float], ...] = (
        (-10.0, 10.0),
        (-5.0, 5.0),
        (-1.0, 1.0),
        (-0.2, 0.2),
    )
    single_modes: tuple[InputMode, ...] = (InputMode.RSE, InputMode.NRSE)
    pair, other_pair = ("ai0", "ai8"), ("ai16", "ai24")
    first_after = 0
    """So many periods after the start the first sample is taken."""

    def __init__(self) -> None:
        self.clock = ManualClock()
        self._opened: list[Board] = []

    def open(self, name: str = "") -> Board:
        board = self.library.open(name or self.one)
        self._opened.append(board)
        return board

    def running(
        self, name: str = "", *, inputs: int = 4, rate_hz: float = 1000.0, chunk: int = 10
    ) -> Board:
        board = self.open(name)
        board.configure(some_inputs(inputs), rate_hz, chunk)
        board.start()
        return board

    def close(self) -> None:
        for board in self._opened:
            board.close()

    @abstractmethod
    def go_on(self, samples: int, *, rate_hz: float = 1000.0) -> None:
        """Let the time pass in which running boards take `samples` a channel."""

    @abstractmethod
    def unplug(self, name: str) -> None: ...

    @abstractmethod
    def plug_in(self, name: str) -> None: ...

    @abstractmethod
    def take_away(self, name: str, *, taken: bool) -> None:
        """Let another program have the board, or give it back."""

    @abstractmethod
    def uninstall(self) -> None:
        """Remove the driver."""


class _Level:
    def __init__(self, level_v: float) -> None:
        self._level_v = level_v

    def volts(self, times_s: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        return np.full(times_s.shape, self._level_v)


class SimulatedRig(BoardRig):
    def __init__(self) -> None:
        super().__init__()
        sources = {
            (board, f"ai{number}"): _Level(0.1 * number)
            for board in ("Dev1", "Dev2")
            for number in range(32)
        }
        self.library = self._simulated = SimulatedLibrary(self.clock, sources)

    @override
    def go_on(self, samples: int, *, rate_hz: float = 1000.0) -> None:
        # A little more, so that the last sample is not missed by a rounding.
        self.clock.advance((samples + 0.01) / rate_hz)

    @override
    def unplug(self, name: str) -> None:
        self._simulated.faults.inject("unplugged", board=name)

    @override
    def plug_in(self, name: str) -> None:
        self._simulated.faults.clear("unplugged", board=name)

    @override
    def take_away(self, name: str, *, taken: bool) -> None:
        faults = self._simulated.faults
        (faults.inject if taken else faults.clear)("reserved", board=name)

    @override
    def uninstall(self) -> None:
        self._simulated.faults.inject("no_driver")


class NidaqmxRig(BoardRig):
    def __init__(self) -> None:
        super().__init__()
        self.driver = FakeNidaqmx()
        self.library = NidaqmxLibrary(self.clock, api=self.driver)

    @override
    def close(self) -> None:
        super().close()
        assert not self.driver.tasks, "a task was left open"
        assert set(self.driver.answers) <= {0}, "a callback returned garbage"

    @override
    def go_on(self, samples: int, *, rate_hz: float = 1000.0) -> None:
        self.clock.advance(samples / rate_hz)
        self.driver.take(samples)

    @override
    def unplug(self, name: str) -> None:
        self.driver.unplug(name)

    def unplug_silently(self, name: str) -> None:
        self.driver.unplug(name, announced=False)

    @override
    def plug_in(self, name: str) -> None:
        self.driver.plug_in(name)

    @override
    def take_away(self, name: str, *, taken: bool) -> None:
        self.driver.device(name).taken = taken

    @override
    def uninstall(self) -> None:
        self.driver.installed = False


class LabjackRig(BoardRig):
    one, other, product = "T7_470010001", "T7_470010002", "T7"
    count, sum_hz = 14, 100_000.0
    ranges_v = ((-10.0, 10.0), (-1.0, 1.0), (-0.1, 0.1), (-0.01, 0.01))
    single_modes = (InputMode.RSE,)
    pair, other_pair = ("ai0", "ai1"), ("ai4", "ai5")
    first_after = 1

    def __init__(self) -> None:
        super().__init__()
        self.ljm = FakeLjm()
        self.library = LabjackLibrary(self.clock, api=self.ljm)

    @override
    def close(self) -> None:
        super().close()
        assert not self.ljm.handles, "a handle was left open"

    @override
    def go_on(self, samples: int, *, rate_hz: float = 1000.0) -> None:
        self.clock.advance(samples / rate_hz)
        self.ljm.take(samples)

    @override
    def unplug(self, name: str) -> None:
        self.ljm.device(name).unplug()

    @override
    def plug_in(self, name: str) -> None:
        self.ljm.device(name).plugged = True

    @override
    def take_away(self, name: str, *, taken: bool) -> None:
        self.ljm.device(name).taken = taken

    @override
    def uninstall(self) -> None:
        self.library = LabjackLibrary(self.clock)


def some_inputs(count: int, *, mode: InputMode = InputMode.RSE) -> list[InputSettings]:
    return [InputSettings(f"ai{number}", mode, -10.0, 10.0) for number in range(count)]


def one_input(
    name: str = "ai0", mode: InputMode = InputMode.RSE, low_v: float = -10.0, high_v: float = 10.0
) -> InputSettings:
    return InputSettings(name, mode, low_v, high_v)


def received(board: Board, count: int) -> list[BoardChunk]:
    chunks = [board.receive(0.0) for _ in range(count)]
    assert all(chunk is not None for chunk in chunks), "a chunk is missing"
    return [chunk for chunk in chunks if chunk is not None]


def failure_of(board: Board) -> DeviceError:
    """Return the error with which acquiring ends, after the chunks that came before it."""
    for _ in range(2000):
        try:
            chunk = board.receive(0.0)
        except DeviceError as exc:
            return exc
        assert chunk is not None, "neither a chunk nor an error"
    raise AssertionError("no error came")
