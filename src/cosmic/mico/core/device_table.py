"""`DeviceTable`: the devices of a platform, and which axis is connected to which."""

from collections.abc import Mapping

from PySide6.QtCore import QObject

from cosmic.frame.errors import NotAvailable, UnknownAxisError
from cosmic.mico.core.data_container import Memory
from cosmic.mico.core.device import Device
from cosmic.mico.core.device_commander import CommanderType, DeviceCommander, join
from cosmic.mico.core.device_inventory import Inventory
from cosmic.mico.core.positioner import Confidence, PositionerState
from cosmic.mico.core.settings import MicoSettings
from cosmic.mico.hw.interface import Channel


class DeviceTable(QObject):
    """Looks up devices and axes by name, and joins commanders to devices; any thread."""

    def __init__(self, settings: MicoSettings, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self.settings = settings
        self._devices: dict[int, Device] = {}
        self._addresses: dict[str, Channel] = {}
        self._missing: tuple[str, ...] = ()

    @property
    def missing(self) -> tuple[str, ...]:
        """What was configured and not found, or was lost, a line each."""
        return self._missing

    @property
    def devices(self) -> Mapping[int, Device]:
        """The devices by index, also those configured and not found."""
        return dict(self._devices)

    def names(self) -> list[str]:
        """Return the names of all axes: those configured, in their order, then any others."""
        configured = [each.name for each in self.settings.positioner]
        return [*configured, *(name for name in self._addresses if name not in configured)]

    def address(self, name: str) -> Channel:
        """Return where an axis is connected.

        Raises
        ------
        UnknownAxisError
            There is none of that name.
        """
        try:
            return self._addresses[name]
        except (KeyError, TypeError):
            raise UnknownAxisError(name, self.names()) from None

    def state(self, name: str) -> PositionerState:
        """Return the state of an axis; raises `UnknownAxisError`."""
        address = self.address(name)
        state = self._devices[address.device].container.state(address.channel)
        return state if state is not None else self._looked_for(name)

    def _looked_for(self, name: str) -> PositionerState:
        """Return the state of a configured axis that has not answered yet."""
        for settings in self.settings.positioner:
            if settings.name == name:
                return PositionerState(
                    name=name,
                    address=settings.address,
                    kind=settings.positioner_kind,
                    unit=settings.unit,
                    limits=settings.limits,
                    error="it is being looked for",
                    present=False,
                )
        raise UnknownAxisError(name, self.names())

    def states(self) -> dict[str, PositionerState]:
        """Return the state of every axis by name."""
        return {
            state.name: state
            for device in list(self._devices.values())
            for state in device.container.states()
        }

    def positions(self) -> dict[str, float] | None:
        """Return the position of every axis in gate coordinates; None while one is unknown."""
        positions: dict[str, float] = {}
        for state in self.states().values():
            if state.position is None or state.confidence is Confidence.UNKNOWN:
                return None
            positions[state.name] = state.position
        return positions

    def device(self, name: str) -> Device:
        """Return the device that drives an axis; raises `UnknownAxisError`."""
        return self._devices[self.address(name).device]

    def connect_device_commander(
        self,
        index: int,
        commander: DeviceCommander,
        kind: CommanderType = CommanderType.INPUT_OUTPUT,
    ) -> None:
        """Join a commander to the device `index`, parting it from any other (Fig. 6.4).

        The connections are direct: a command goes into the device's queue in the caller's
        thread, so that no event loop is needed to make a move.

        Raises
        ------
        NotAvailable
            There is no such device.
        """
        device = self._devices.get(index)
        if device is None:
            raise NotAvailable(f"there is no device {index}")
        join(device, commander, kind)

    def usual_frequency_hz(self, name: str) -> int:
        """Return the closed-loop frequency limit that is set on an axis."""
        found = self.device(name).container.positioner(self.address(name).channel)
        own_hz = None if found is None else found.frequency_hz
        return own_hz or self.settings.defaults.closed_loop_frequency_hz

    def _memories(self) -> dict[str, Memory]:
        """Return what the user has set on each axis, which outlives the search for devices."""
        return {
            name: memory
            for device in self._devices.values()
            for name, memory in device.container.memories().items()
        }

    def _exchange(self, found: Inventory) -> None:
        # Exchanged whole, for other threads look things up meanwhile.
        self._devices, self._addresses = found.devices, found.addresses
        self._missing = found.missing

    def _note_missing(self, reason: str) -> None:
        self._missing = (*self._missing, reason)

    def _note_channels(self, device: Device) -> None:
        """Take in the axes that were found on a device and are not configured."""
        for channel in device.container.channels():
            state = device.container.state(channel)
            if state is not None:
                self._addresses.setdefault(state.name, Channel(device.index, channel))
