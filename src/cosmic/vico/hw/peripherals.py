"""What ViCo asks of a motorised lens and of a lamp, whoever made them (thesis 3.3.2)."""

from abc import abstractmethod
from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol


class LensAxis(StrEnum):
    """A motor of the lens."""

    ZOOM = "zoom"
    FOCUS = "focus"


@dataclass(frozen=True, slots=True)
class LensState:
    """Where one motor of the lens is, as its controller counts.

    Attributes
    ----------
    position_counts : int
        Means nothing before `homed`.
    limit_counts : int
        The far end; the near end is 0.
    at_home, at_limit : bool
        The stop there is felt.
    """

    position_counts: int
    limit_counts: int
    moving: bool
    homed: bool
    at_home: bool = False
    at_limit: bool = False


class Lens(Protocol):
    """A lens with motors for zoom and focus. Calls return within one exchange on the line."""

    @property
    @abstractmethod
    def name(self) -> str:
        """What the operator reads, such as "Navitar, generation 1"."""

    @abstractmethod
    def state(self, axis: LensAxis) -> LensState:
        """Ask where a motor is; raises `DeviceError` or `ProtocolError`."""

    @abstractmethod
    def home(self, axis: LensAxis) -> None:
        """Begin to run to the near end, where counting begins."""

    @abstractmethod
    def seek(self, axis: LensAxis, target_counts: int) -> None:
        """Begin to move there.

        Raises
        ------
        NotAvailable
            The motor has not been homed.
        ConfigError
            The target lies outside 0 to the limit.
        """

    @abstractmethod
    def abort(self) -> None:
        """Stop both motors."""

    @abstractmethod
    def close(self) -> None:
        """Give the line back; harmless the second time."""


class Light(Protocol):
    """A lamp that can be dimmed."""

    @property
    @abstractmethod
    def name(self) -> str:
        """What the operator reads, such as "BrightLight"."""

    @abstractmethod
    def percent(self) -> float:
        """Ask how bright it is, 0 to 100; raises `DeviceError` or `ProtocolError`."""

    @abstractmethod
    def set_percent(self, percent: float) -> None:
        """Make it so bright; raises `ConfigError` outside 0 to 100."""

    @abstractmethod
    def close(self) -> None:
        """Give the line back; harmless the second time."""
