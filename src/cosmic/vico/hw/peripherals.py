"""What ViCo asks of a motorised lens and of a lamp, whoever made them (thesis 3.3.2)."""

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import TYPE_CHECKING, Protocol

from cosmic.frame.clock import WALL, Clock
from cosmic.frame.plugins import Backend

if TYPE_CHECKING:
    from cosmic.vico.hw.sim_peripherals import SimPeripherals


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


@dataclass(frozen=True, slots=True)
class PeripheralContext:
    """What a platform gives to the driver of its lens or of its lamp.

    Attributes
    ----------
    clock : Clock
        The platform's, which paces simulated ones.
    port : str
        Serial port, such as "/dev/ttyUSB0" or "COM3"; empty where none is named.
    homed : bool
        The lens was homed and kept under power since.
    limits_counts : mapping of LensAxis to int
        Far ends of the lens, in place of those that its controller tells.
    simulation : SimPeripherals or None
        Lens and lamp of the twin; None where there is no twin.
    """

    clock: Clock = WALL
    port: str = ""
    homed: bool = False
    limits_counts: Mapping[LensAxis, int] = field(default_factory=dict)
    simulation: "SimPeripherals | None" = None


LensBackend = Backend[PeripheralContext, Lens]
"""What an entry point of the group ``cosmic.lenses`` leads to; making it opens the lens."""
LightBackend = Backend[PeripheralContext, Light]
"""What an entry point of the group ``cosmic.lights`` leads to; making it opens the lamp."""
