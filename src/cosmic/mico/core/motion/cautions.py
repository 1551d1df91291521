"""What speaks against moving without looking first: something may be held, or was touched."""

from collections.abc import Callable
from threading import Lock
from typing import Final

from PySide6.QtCore import QObject, Qt, SignalInstance

from cosmic.frame.units import format_quantity
from cosmic.mico.core.motion.positioner import PositionerState
from cosmic.mico.hw.interface import PositionerKind

Doubt = Callable[[], str]
"""Returns in words what speaks against it now; empty where nothing does. Any thread, at once."""

_CLOSED_UM: Final = 1.0
"""Closing by less is no grasp."""


class Cautions:
    """Collects doubts of every subsystem that has any; any thread."""

    def __init__(self) -> None:
        self._doubts: tuple[Doubt, ...] = ()
        self._touched: tuple[Callable[[str], object], ...] = ()
        self._lock = Lock()

    def add(self, doubt: Doubt) -> None:
        """Ask `doubt`, too, from now on."""
        with self._lock:
            self._doubts = (*self._doubts, doubt)

    def reasons(self) -> tuple[str, ...]:
        """Return what speaks against moving now without looking first."""
        return tuple(text for text in (doubt() for doubt in self._doubts) if text)

    def on_touch(self, listener: Callable[[str], object]) -> None:
        """Call `listener(text)` at each touch, in the thread that felt it; it returns at once."""
        with self._lock:
            self._touched = (*self._touched, listener)

    def touched(self, text: str) -> None:
        """Tell that something was touched, in words, though it may be over soon."""
        for each in self._touched:
            each(text)


class ClosedGrippers(QObject):
    """Watches actuators without sensor, which are grippers: closed ones may hold something.

    What counts is the widest opening seen since the start; one that was opened as wide again holds
    nothing. The opening is counted from steps, so this errs towards asking.

    Parameters
    ----------
    state_changed : SignalInstance
        Emits the `PositionerState` of every axis that changed.
    """

    def __init__(self, state_changed: SignalInstance, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._widest: dict[str, float] = {}
        self._now: dict[str, float] = {}
        state_changed.connect(self._on_state_changed, Qt.ConnectionType.DirectConnection)

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
