"""What speaks against moving without looking first: something held, or a force that is felt."""

from collections.abc import Callable
from threading import Lock
from typing import Final

from PySide6.QtCore import QObject, Qt

from cosmic.frame.units import format_quantity
from cosmic.mico.core.device import Device
from cosmic.mico.core.device_manager import DeviceManager
from cosmic.mico.core.positioner import PositionerState
from cosmic.mico.hw.interface import PositionerKind

Doubt = Callable[[], str]
"""Returns in words what speaks against it now; empty where nothing does. Any thread, at once."""

_CLOSED_UM: Final = 1.0
"""Closing by less is no grasp."""


class Cautions:
    """Collects doubts of every subsystem that has any; any thread."""

    def __init__(self) -> None:
        self._doubts: tuple[Doubt, ...] = ()
        self._lock = Lock()

    def add(self, doubt: Doubt) -> None:
        """Ask `doubt`, too, from now on."""
        with self._lock:
            self._doubts = (*self._doubts, doubt)

    def reasons(self) -> tuple[str, ...]:
        """Return what speaks against moving now without looking first."""
        return tuple(text for text in (doubt() for doubt in self._doubts) if text)


class ClosedGrippers(QObject):
    """Watches actuators without sensor, which are grippers: closed ones may hold something.

    What counts is the widest opening seen since the start; one that was opened as wide again holds
    nothing. The opening is counted from steps, so this errs towards asking.
    """

    def __init__(self, manager: DeviceManager, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._manager = manager
        self._widest: dict[str, float] = {}
        self._now: dict[str, float] = {}
        self._joined: dict[int, Device] = {}
        self._join_devices()
        manager.changed.connect(self._join_devices, Qt.ConnectionType.DirectConnection)

    def _join_devices(self) -> None:
        for index, device in self._manager.devices.items():
            if self._joined.get(index) is not device:
                self._joined[index] = device
                device.state_changed.connect(
                    self._on_state_changed, Qt.ConnectionType.DirectConnection
                )

    def _on_state_changed(self, state: PositionerState) -> None:
        position = state.position
        if state.kind is not PositionerKind.OPEN_LOOP or position is None:
            return
        self._now[state.name] = position
        self._widest[state.name] = max(position, self._widest.get(state.name, position))

    def doubt(self) -> str:
        """Return which grippers were closed, and how far."""
        closed = {
            name: self._widest[name] - now
            for name, now in list(self._now.items())
            if self._widest[name] - now > _CLOSED_UM
        }
        return "; ".join(
            f"{name} was closed by {format_quantity(by_um, 'um')} and may hold something"
            for name, by_um in sorted(closed.items())
        )
