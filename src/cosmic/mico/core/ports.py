"""What code that commands axes needs of the devices, whether they are here or at a station."""

from abc import abstractmethod
from collections.abc import Mapping
from typing import Protocol

from PySide6.QtCore import SignalInstance

from cosmic.frame.clock import Clock
from cosmic.frame.operation import Task
from cosmic.frame.verdict import MoveVerdict
from cosmic.mico.core.collision.exemptions import Exemptions
from cosmic.mico.core.motion.device_commander import Commanded, CommanderType, DeviceCommander
from cosmic.mico.core.motion.lease import Lease
from cosmic.mico.core.motion.links import LinkTable
from cosmic.mico.core.motion.messages import Order
from cosmic.mico.core.motion.movement import Movement
from cosmic.mico.core.motion.orders import Motion
from cosmic.mico.core.motion.positioner import PositionerBase, PositionerState
from cosmic.mico.core.motion.stop_latch import StopLatch
from cosmic.mico.core.settings import MicoSettings
from cosmic.mico.hw.interface import Channel, Direction


class PositionersPort(Protocol):
    """The positioners of one device."""

    @abstractmethod
    def positioner(self, channel: int) -> PositionerBase | None:
        """Return what is known of a channel; None where there is nothing."""


class DevicePort(Commanded, Protocol):
    """One device: a `Device` here, or its counterpart of another process."""

    @property
    @abstractmethod
    def container(self) -> PositionersPort:
        """Its positioners."""

    @property
    @abstractmethod
    def movement_begun(self) -> SignalInstance:
        """See `Device`."""

    @abstractmethod
    def set_zero(self, channel: int, zero: float) -> None:
        """Show the positions of one channel relative to `zero`, in gate coordinates."""

    @abstractmethod
    def set_estimate(self, channel: int, position: float, std: float) -> None:
        """Say where an axis without sensor stands; see `Device.set_estimate`."""

    @abstractmethod
    def set_up(self, channel: int, change: int | Direction) -> Task:
        """Begin to store a positioner type or a safe direction; see `Device.set_up`."""


class ControllerPort(Protocol):
    """What is asked of the controller itself."""

    @property
    @abstractmethod
    def name(self) -> str:
        """Name of the library."""

    @property
    @abstractmethod
    def simulated(self) -> bool:
        """True when no hardware moves."""


class ManagerPort(Protocol):
    """The axes of a platform: a `DeviceManager` here, or its counterpart of another process."""

    @property
    @abstractmethod
    def changed(self) -> SignalInstance:
        """See `DeviceManager`, as the other signals."""

    @property
    @abstractmethod
    def device_lost(self) -> SignalInstance:
        """A device cannot be reached any more."""

    @property
    @abstractmethod
    def group_refused(self) -> SignalInstance:
        """Movements that were to begin together were refused."""

    @property
    @abstractmethod
    def group_started(self) -> SignalInstance:
        """Several axes were started back to back."""

    @property
    @abstractmethod
    def links_changed(self) -> SignalInstance:
        """Axes were linked, or are linked no more."""

    @property
    @abstractmethod
    def controller(self) -> ControllerPort:
        """The controller."""

    @property
    @abstractmethod
    def settings(self) -> MicoSettings:
        """What the platform file says."""

    @property
    @abstractmethod
    def clock(self) -> Clock:
        """The platform's clock, or one that goes as fast."""

    @property
    @abstractmethod
    def latch(self) -> StopLatch:
        """Whether motion is stopped."""

    @property
    @abstractmethod
    def lease(self) -> Lease:
        """Who may move."""

    @property
    @abstractmethod
    def links(self) -> LinkTable:
        """The axes that move together."""

    @property
    @abstractmethod
    def exemptions(self) -> Exemptions | None:
        """What is left out of the collision check; None without a collision model."""

    @property
    @abstractmethod
    def missing(self) -> tuple[str, ...]:
        """What was configured and is not there, a line each."""

    @property
    @abstractmethod
    def ready(self) -> bool:
        """True while axes can be moved."""

    @property
    @abstractmethod
    def devices(self) -> Mapping[int, DevicePort]:
        """The devices by index."""

    @abstractmethod
    def names(self) -> list[str]:
        """Return the names of all axes."""

    @abstractmethod
    def address(self, name: str) -> Channel:
        """Return where an axis is connected; raises `UnknownAxisError`."""

    @abstractmethod
    def state(self, name: str) -> PositionerState:
        """Return the state of an axis; raises `UnknownAxisError`."""

    @abstractmethod
    def states(self) -> dict[str, PositionerState]:
        """Return the state of every axis by name."""

    @abstractmethod
    def positions(self) -> dict[str, float] | None:
        """Return the position of every axis in gate coordinates; None while one is unknown."""

    @abstractmethod
    def device(self, name: str) -> DevicePort:
        """Return the device that drives an axis; raises `UnknownAxisError`."""

    @abstractmethod
    def connect_device_commander(
        self,
        index: int,
        commander: DeviceCommander,
        kind: CommanderType = CommanderType.INPUT_OUTPUT,
    ) -> None:
        """Join a commander to the device `index`; see `DeviceManager`."""

    @abstractmethod
    def check(self, motions: Mapping[str, Motion], *, consent: bool = False) -> MoveVerdict:
        """Return what the gate says to all of `motions` together, without moving anything."""

    @abstractmethod
    def order_together(
        self,
        motions: Mapping[str, Motion],
        *,
        source: str,
        consent: bool = False,
        linked: bool = True,
        match_arrival: bool = False,
        follows: Mapping[str, Movement] | None = None,
    ) -> dict[str, Order]:
        """Decide `motions` together and start them back to back, or none of them.

        Parameters
        ----------
        linked : bool
            Axes linked to those named move with them; False moves those named only.
        match_arrival : bool
            Slow the axes down to the one that takes longest, so that all arrive together.
        follows : mapping of Movement
            By axis, what must be the newest movement there; otherwise this one is void.

        Raises
        ------
        MoveRefused
            The gate refused; nothing moved.
        UnknownAxisError
            One axis does not exist; nothing moved.
        """

    @abstractmethod
    def stop(self, reason: str = "stop") -> None:
        """Stop every channel now and stay stopped until `reset_stop`; any thread."""

    @abstractmethod
    def reset_stop(self) -> None:
        """Allow motion again."""
