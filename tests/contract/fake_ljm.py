"""A stand-in for labjack.ljm over imaginary T-series boards that do what LabJack documents.

Pass a `FakeLjm` where the program expects the module. It has no time: a test says how many scans
the boards take (`take`), and the callbacks then run on a thread of the library, as in LJM. Input
AINk carries k * 0.1 V plus a microvolt for each scan since the start. It shares no code with the
simulated boards.
"""

import re
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

DUMMY: Final = -9999.0
MICROVOLT: Final = 1e-6
MODBUS_ADDRESS, MODBUS_VALUE = 1202, 1203
NOT_OPEN, NOT_FOUND, TAKEN, RECONNECT_FAILED = 1224, 1227, 1230, 1239
BUFFER_FULL, STREAM_NOT_RUNNING, NO_NAME = 1301, 1303, 1294
STREAM_ACTIVE, TOO_FAST, ALREADY_OFF, OUT_BUFFER_FULL, OUT_TARGET = 2605, 2608, 2620, 2613, 2614
CORE_HZ: Final = 80e6
BUFFER_S: Final = 20.0
"""LJM_STREAM_BUFFER_MAX_NUM_SECONDS, as it is delivered."""
TYPES: Final = {"T4": 4, "T7": 7, "T8": 8}
FASTEST_HZ: Final = {"T4": 50e3, "T7": 100e3, "T8": 400e3}
AIN = re.compile(r"AIN(\d+)(_RANGE|_NEGATIVE_CH)?")
DIO = re.compile(r"(FIO|EIO|CIO)(\d)")
SETTINGS: Final = (
    "STREAM_RESOLUTION_INDEX",
    "STREAM_SETTLING_US",
    "STREAM_TRIGGER_INDEX",
    "STREAM_CLOCK_SOURCE",
)
NOT_ON: Final = {
    "T4": ("STREAM_TRIGGER_INDEX", "STREAM_CLOCK_SOURCE"),
    "T8": ("STREAM_SETTLING_US",),
}


class LJMError(Exception):
    """As the package's, with number and text."""

    def __init__(self, code: int | None = None, said: str = "in LJM's words") -> None:
        super().__init__(f"LJM library error code {code} {said}")
        self.errorCode = code
        self.errorString = said


@dataclass
class FakeStream:
    scans_per_read: int
    addresses: Sequence[int]
    rate_hz: float
    taken: int = 0
    told: int = 0
    read: int = 0
    skipped: set[int] = field(default_factory=set)
    failure: int = 0
    callback: Callable[[int], object] | None = None


@dataclass
class FakeBoard:
    """One board.

    Attributes
    ----------
    written : dict
        What every register was set to.
    stream_left_on : bool
        A program that was killed left its stream running.
    """

    serial: int
    kind: str = "T7"
    ways: tuple[int, ...] = (1,)
    plugged: bool = True
    taken: bool = False
    stream_left_on: bool = False
    silent: bool = False
    written: dict[str, float] = field(default_factory=dict)
    order: list[tuple[str, float]] = field(default_factory=list)
    stream: FakeStream | None = None

    @property
    def name(self) -> str:
        return f"{self.kind}_{self.serial}"

    def unplug(self) -> None:
        self.plugged = False
        if self.stream is not None:
            self.stream.failure = RECONNECT_FAILED
            tell(self.stream, self.serial)


class FakeLjm:
    """What `from labjack import ljm` gives, and the boards behind it; a handle is a serial."""

    LJMError = LJMError

    def __init__(self, boards: Sequence[FakeBoard] = ()) -> None:
        self.boards = list(boards) or [FakeBoard(470010001), FakeBoard(470010002)]
        self.handles: set[int] = set()
        self.opened = 0
        self.fail_in: dict[str, int] = {}

    # What a test does

    def device(self, name: str) -> FakeBoard:
        (found,) = (each for each in self.boards if each.name == name)
        return found

    def take(self, scans: int, *, board: str = "") -> None:
        """Let the streams take scans, with a callback for each read that is full."""
        for each in self.boards:
            if each.stream is not None and board in ("", each.name) and not each.silent:
                in_library(lambda each=each: self._take(each, scans))

    def _take(self, board: FakeBoard, scans: int) -> None:
        stream = board.stream
        assert stream is not None
        end = stream.taken + scans
        while board.stream is stream and not stream.failure and stream.taken < end:
            stream.taken = min(end, stream.told + stream.scans_per_read)
            if stream.taken - stream.read > BUFFER_S * stream.rate_hz:
                stream.failure = BUFFER_FULL
            if stream.taken - stream.told >= stream.scans_per_read or stream.failure:
                stream.told = stream.taken
                if stream.callback is not None:
                    stream.callback(board.serial)

    # What the program calls

    def listAllS(self, device_type: str, connection_type: str) -> tuple[Any, ...]:
        self._called("listAllS")
        assert device_type == "ANY" and connection_type in ("ANY", "USB", "ETHERNET", "WIFI")
        wanted = {"ANY": 0, "USB": 1, "ETHERNET": 3, "WIFI": 4}[connection_type]
        found = [
            (TYPES.get(each.kind, 200), way, each.serial, 0)
            for each in self.boards
            for way in each.ways
            if each.plugged and not each.taken and wanted in (0, way)
        ]
        columns = [list(each) for each in zip(*found, strict=True)] or [[], [], [], []]
        return (len(found), *columns)

    def openS(self, device_type: str, connection_type: str, identifier: str) -> int:
        self._called("openS")
        board = self._known(int(identifier))
        if board is None or not board.plugged or board.kind != device_type:
            raise LJMError(NOT_FOUND)
        if board.taken:
            raise LJMError(TAKEN)
        self.opened += board.serial not in self.handles
        self.handles.add(board.serial)
        return board.serial

    def close(self, handle: int) -> None:
        self._board(handle).stream = None
        self.handles.discard(handle)

    def readLibraryConfigS(self, parameter: str) -> float:
        assert parameter == "LJM_LIBRARY_VERSION"
        return 1.2301

    def namesToAddresses(self, num_frames: int, a_names: Sequence[str]) -> tuple[Any, ...]:
        assert num_frames == len(a_names)
        addresses = []
        for name in a_names:
            found = AIN.fullmatch(name)
            if found is None or found[2]:
                raise LJMError(NO_NAME)
            addresses.append(2 * int(found[1]))
        return addresses, [3] * num_frames

    def eWriteNames(
        self, handle: int, num_frames: int, a_names: Sequence[str], a_values: Sequence[float]
    ) -> None:
        assert num_frames == len(a_names) == len(a_values)
        for name, value in zip(a_names, a_values, strict=True):
            self.eWriteName(handle, name, value)

    def eWriteName(self, handle: int, name: str, value: float) -> None:
        self._called("eWriteName")
        board = self._there(handle)
        ranged = AIN.fullmatch(name)
        if name in SETTINGS:
            if name in NOT_ON.get(board.kind, ()):
                raise LJMError(MODBUS_ADDRESS)
        elif ranged is not None:
            if board.kind == "T4" or (board.kind == "T8" and ranged[2] == "_NEGATIVE_CH"):
                raise LJMError(MODBUS_ADDRESS)
        elif not (name in ("DAC0", "DAC1") or DIO.fullmatch(name)):
            raise LJMError(NO_NAME)
        board.written[name] = value
        board.order.append((name, value))

    def eReadName(self, handle: int, name: str) -> float:
        board = self._there(handle)
        assert name == "STREAM_ENABLE"
        return float(board.stream is not None)

    def eStreamStart(
        self,
        handle: int,
        scans_per_read: int,
        num_addresses: int,
        a_scan_list: Sequence[int],
        scan_rate: float,
    ) -> float:
        self._called("eStreamStart")
        board = self._there(handle)
        assert num_addresses == len(a_scan_list) and scans_per_read >= 1
        if board.stream is not None or board.stream_left_on:
            raise LJMError(STREAM_ACTIVE)
        if scan_rate * num_addresses > FASTEST_HZ[board.kind]:
            raise LJMError(TOO_FAST)
        rate_hz = CORE_HZ / round(CORE_HZ / scan_rate)
        board.stream = FakeStream(scans_per_read, tuple(a_scan_list), rate_hz)
        return rate_hz

    def setStreamCallback(self, handle: int, callback: Callable[[int], object] | None) -> None:
        stream = self._there(handle).stream
        assert stream is not None, "it is to be called after eStreamStart"
        stream.callback = callback

    def eStreamRead(self, handle: int) -> tuple[list[float], int, int]:
        self._called("eStreamRead")
        board = self._board(handle)
        stream = board.stream
        if stream is None:
            raise LJMError(STREAM_NOT_RUNNING)
        if stream.failure:
            board.stream = None  # LJM ends a stream that fails
            raise LJMError(stream.failure)
        assert stream.taken - stream.read >= stream.scans_per_read, "it would wait"
        numbers = range(stream.read, stream.read + stream.scans_per_read)
        stream.read += stream.scans_per_read
        data = [
            DUMMY if number in stream.skipped else 0.05 * address + MICROVOLT * number
            for number in numbers
            for address in stream.addresses
        ]
        return data, 0, stream.taken - stream.read

    def eStreamStop(self, handle: int) -> None:
        self._called("eStreamStop")
        board = self._there(handle)
        was_on = board.stream is not None or board.stream_left_on
        board.stream, board.stream_left_on = None, False
        if not was_on:
            raise LJMError(ALREADY_OFF)

    # Inside

    def _called(self, name: str) -> None:
        if name in self.fail_in:
            raise LJMError(self.fail_in[name])

    def _known(self, serial: int) -> FakeBoard | None:
        return next((each for each in self.boards if each.serial == serial), None)

    def _board(self, handle: int) -> FakeBoard:
        if handle not in self.handles:
            raise LJMError(NOT_OPEN)
        board = self._known(handle)
        assert board is not None
        return board

    def _there(self, handle: int) -> FakeBoard:
        board = self._board(handle)
        if not board.plugged:
            raise LJMError(RECONNECT_FAILED)
        return board


def tell(stream: FakeStream, handle: int) -> None:
    """Call the callback, which LJM does when something went wrong as well."""
    callback = stream.callback
    if callback is not None:
        in_library(lambda: callback(handle))


def in_library(what: Callable[[], object]) -> None:
    thread = threading.Thread(target=what, name="LJM")
    thread.start()
    thread.join(20.0)
    assert not thread.is_alive(), "a callback does not come back"
