"""What devices there are: those found, and those that are only configured."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from PySide6.QtCore import Qt

from cosmic.frame.clock import Clock
from cosmic.frame.failure import FailurePolicy
from cosmic.mico.core.data_container import NO_DEVICE, DeviceDataContainer, Memory
from cosmic.mico.core.device import Device
from cosmic.mico.core.gate import Gate
from cosmic.mico.core.messages import DeviceLost
from cosmic.mico.core.settings import MicoSettings
from cosmic.mico.hw.interface import Channel, Controller


@dataclass(frozen=True, slots=True)
class Inventory:
    """The devices by index, where each axis is connected, and what is not there, a line each."""

    devices: dict[int, Device]
    addresses: dict[str, Channel]
    missing: tuple[str, ...]


class DeviceMaker:
    """Makes the devices with all that they need.

    Parameters
    ----------
    on_lost : callable
        Method of a QObject, called in the thread of a device that cannot be reached any more.
    """

    def __init__(
        self,
        controller: Controller,
        *,
        gate: Gate,
        clock: Clock,
        settings: MicoSettings,
        policy: FailurePolicy,
        on_lost: Callable[[DeviceLost], None],
    ) -> None:
        self._controller = controller
        self._gate = gate
        self._clock = clock
        self._settings = settings
        self._policy = policy
        self._on_lost = on_lost

    def inventory(
        self,
        library_index: Mapping[int, int],
        memories: Mapping[str, Memory],
        *,
        searched: bool,
    ) -> Inventory:
        """Make containers and devices for what is present and for what is only configured.

        Parameters
        ----------
        library_index : mapping of int
            The library's index of each device that is present, by its number in the configuration.
        memories : mapping of Memory
            What the user has set on each axis, which outlives the search for devices.
        searched : bool
            The hardware was looked for, so that what is not present is missing.
        """
        positioners, hold_s = self._settings.positioner, self._settings.defaults.hold
        devices: dict[int, Device] = {}
        addresses: dict[str, Channel] = {}
        missing: list[str] = []
        for number in sorted({each.device for each in positioners} | set(library_index)):
            here = {each.channel: each for each in positioners if each.device == number}
            at = library_index.get(number, number)
            container = DeviceDataContainer(number, here, hold_s, library_index=at)
            container.remember(memories)
            if number not in library_index:
                for channel in here:
                    container.settle(channel, None, NO_DEVICE)
                if searched:
                    names = ", ".join(each.name for each in here.values())
                    missing.append(f"device {number} was not found ({names})")
            devices[number] = self._make(container)
            for positioner in here.values():
                addresses[positioner.name] = positioner.address
        return Inventory(devices, addresses, tuple(missing))

    def _make(self, container: DeviceDataContainer) -> Device:
        device = Device(
            self._controller,
            container,
            gate=self._gate,
            clock=self._clock,
            settings=self._settings,
            policy=self._policy,
        )
        device.lost.connect(self._on_lost, Qt.ConnectionType.DirectConnection)
        return device
