"""The axes of the scripted API by name, and the commanders that they share."""

from collections.abc import Iterator
from threading import Lock

from PySide6.QtCore import Qt

from cosmic.frame.arguments import checked_class
from cosmic.mico.api.axis import Axis
from cosmic.mico.core.motion.device_commander import DeviceCommander
from cosmic.mico.core.ports import DevicePort, ManagerPort


@checked_class
class Axes:
    """Each axis by its name; any thread.

    Parameters
    ----------
    source : str
        Who commands through them, for the log: "script", "window", "key".
    """

    def __init__(self, manager: ManagerPort, source: str) -> None:
        self._manager = manager
        self._source = source
        self._commanders: dict[int, DeviceCommander] = {}
        self._axes: dict[str, Axis] = {}
        self._joined: dict[int, DevicePort] = {}
        self._joining = Lock()
        self._connect()
        # Direct, because a script has no event loop that a queued call could arrive in.
        manager.changed.connect(self._connect, Qt.ConnectionType.DirectConnection)

    def _connect(self) -> None:
        """Join the commanders to the devices there are now."""
        token = self._manager.lease.local_token
        with self._joining:
            for index, device in self._manager.devices.items():
                commander = self._commanders.get(index)
                if commander is None:
                    commander = self._commanders[index] = DeviceCommander(token, self._source)
                if self._joined.get(index) is not device:
                    self._joined[index] = device
                    self._manager.connect_device_commander(index, commander)

    @property
    def simulated(self) -> bool:
        """True when no hardware moves."""
        return self._manager.controller.simulated

    @property
    def names(self) -> list[str]:
        """Names of all axes, in the order of the configuration."""
        return self._manager.names()

    @property
    def missing(self) -> tuple[str, ...]:
        """What was configured and is not there, a line each."""
        return self._manager.missing

    def __getitem__(self, name: str) -> Axis:
        """Return an axis; raises `UnknownAxisError`, a `CosmicError` and `KeyError`."""
        address = self._manager.address(name)
        axis = self._axes.get(name)
        if axis is None:
            if address.device not in self._commanders:
                self._connect()  # it was told of just now, and `changed` is on its way
            axis = Axis(name, self._manager, self._commanders[address.device])
            self._axes[name] = axis
        return axis

    def __contains__(self, name: object) -> bool:
        return name in self.names

    def __iter__(self) -> Iterator[Axis]:
        return (self[name] for name in self.names)

    def __len__(self) -> int:
        return len(self.names)
