"""What both generations of Navitar's controllers have in common: numbered registers."""

from abc import abstractmethod
from typing import Final, Protocol

TRIES: Final = 3
"""So often is a question asked before the line is given up."""


class Registers(Protocol):
    """A controller as numbered registers, whatever its bytes; one thread at a time.

    Every call is one exchange, repeated at most `TRIES` times. All raise `ProtocolError` for
    answers that make no sense, `DeviceTimeout` for none, and `DeviceError` when the port is gone.
    """

    @property
    @abstractmethod
    def name(self) -> str:
        """The line, for texts."""

    @abstractmethod
    def read(self, register: int) -> int:
        """Return the value of a register, signed."""

    @abstractmethod
    def write(self, register: int, value: int) -> None:
        """Write a register."""

    @abstractmethod
    def close(self) -> None:
        """Give the line back; harmless the second time."""
