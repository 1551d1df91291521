"""A simulated serial line: an object of pyserial's shape, with a device at its other end."""

import random
from abc import abstractmethod
from threading import Lock
from typing import Final, Protocol

from typing_extensions import override

from cosmic.frame.arguments import check_fault
from cosmic.vico.hw.serial_port import SerialLike

NAMES: Final = ("garbage", "lost_bytes", "silent", "unplugged")
_GARBAGE_BYTES: Final = 3
_LOSES_EVERY: Final = 3


class Speaker(Protocol):
    """A device that hears bytes and answers with bytes."""

    @abstractmethod
    def hear(self, data: bytes) -> bytes:
        """Return what it says to what it heard; it may need to hear more first."""


class LineFaults:
    """Faults of a line in force; any thread.

    Notes
    -----
    - `garbage`: three random bytes come before every answer.
    - `lost_bytes`: of every third exchange one byte is lost, of the question and of the answer
      in turn.
    - `silent`: the device is switched off and hears nothing.
    - `unplugged`: the adapter is gone; every call fails until it is cleared and the line opened
      again.
    """

    def __init__(self) -> None:
        self._active: frozenset[str] = frozenset()
        self._lock = Lock()

    @property
    def active(self) -> frozenset[str]:
        """Names of the faults in force."""
        return self._active

    def inject(self, name: str) -> None:
        """Put the fault `name` in force; raises `ArgumentError`."""
        check_fault(name, NAMES)
        with self._lock:
            self._active |= {name}

    def clear(self, name: str | None = None) -> None:
        """End the fault `name`, or all; raises `ArgumentError`."""
        if name is not None:
            check_fault(name, NAMES)
        with self._lock:
            self._active = self._active - {name} if name else frozenset()


class SimLine:
    """What lies between a computer and a simulated device: the wire and its troubles."""

    def __init__(self, speaker: Speaker, faults: LineFaults, seed: int = 0) -> None:
        self._speaker = speaker
        self.faults = faults
        self._random = random.Random(f"line {seed}")
        self._exchanges = 0

    def exchange(self, data: bytes) -> bytes:
        """Carry bytes there and the answer back.

        Raises
        ------
        OSError
            It is unplugged.
        """
        self.check()
        faults = self.faults.active
        if "silent" in faults:
            return b""
        self._exchanges += 1
        loses = "lost_bytes" in faults and self._exchanges % _LOSES_EVERY == 0
        of_question = loses and self._exchanges % (2 * _LOSES_EVERY) == 0
        answer = self._speaker.hear(self._without_one(data) if of_question else data)
        if loses and not of_question:
            answer = self._without_one(answer)
        if "garbage" in faults and answer:
            answer = self._random.randbytes(_GARBAGE_BYTES) + answer
        return answer

    def check(self) -> None:
        """Raise `OSError` while it is unplugged."""
        if "unplugged" in self.faults.active:
            raise OSError("the adapter is gone")

    def _without_one(self, data: bytes) -> bytes:
        if not data:
            return data
        lost = self._random.randrange(len(data))
        return data[:lost] + data[lost + 1 :]


class SimSerial(SerialLike):
    """The computer's end of a simulated line; a read never waits, for all has come already."""

    def __init__(self, line: SimLine) -> None:
        self._line = line
        self._arrived = b""
        self._lost = False

    @property
    @override
    def in_waiting(self) -> int:
        self._check()
        return len(self._arrived)

    @override
    def read(self, size: int = 1) -> bytes:
        self._check()
        data, self._arrived = self._arrived[:size], self._arrived[size:]
        return data

    @override
    def write(self, data: bytes, /) -> int:
        self._check()
        self._arrived += self._line.exchange(data)
        return len(data)

    @override
    def close(self) -> None:
        self._lost = True

    def _check(self) -> None:
        """Stay lost once it was unplugged: an adapter comes back as a new port."""
        try:
            self._line.check()
        except OSError:
            self._lost = True
        if self._lost:
            raise OSError("the port is gone")
