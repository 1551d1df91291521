"""Brings the states of all axes to their cards, no more often than the eye can follow."""

from typing import Final, Protocol

from PySide6.QtCore import QObject, QTimer, Signal

from cosmic.frame.gui.relay import Relay
from cosmic.mico.api.axis import Axis
from cosmic.mico.api.mico import Mico
from cosmic.mico.core.motion.positioner import PositionerState

PERIOD_MS: Final = 33


class StateView(Protocol):
    """What shows the state of one axis."""

    def show_state(self, state: PositionerState) -> None:
        """Show `state`."""


class StateFeed(QObject):
    """Collects states as they come and shows only the newest of each axis; GUI thread.

    Axes publish in the threads that hear of them; the relay queues the call into the GUI thread,
    where it costs one entry in a dictionary.

    Parameters
    ----------
    period_ms : int
        The least time between two looks.

    Signals
    -------
    flushed()
        The views were shown what had come in.
    """

    flushed = Signal()

    def __init__(
        self, mico: Mico, parent: QObject | None = None, *, period_ms: int = PERIOD_MS
    ) -> None:
        super().__init__(parent)
        self._mico = mico
        self._views: dict[str, list[StateView]] = {}
        self._newest: dict[str, PositionerState] = {}
        self._followed: dict[str, Axis] = {}
        self._relay = Relay(self._on_state_changed)
        self._paused = False
        self._timer = QTimer(self, interval=period_ms, singleShot=True)
        self._timer.timeout.connect(self.flush)

    def clear(self) -> None:
        """Forget all views, before they are made anew."""
        self._views.clear()
        self._newest.clear()
        self._timer.stop()

    def add(self, name: str, view: StateView) -> None:
        """Show the states of the axis `name` in `view`, beginning now."""
        self._views.setdefault(name, []).append(view)
        axis = self._mico[name]
        if self._followed.get(name) is not axis:
            self._followed[name] = axis
            self._relay.follow(axis.subscribe)
        view.show_state(axis.details)

    def _on_state_changed(self, state: PositionerState) -> None:
        self._newest[state.name] = state
        if not self._paused and not self._timer.isActive():
            self._timer.start()

    def set_paused(self, paused: bool) -> None:
        """Show nothing while nobody looks; the newest states are kept for afterwards."""
        self._paused = paused
        if paused:
            self._timer.stop()
        elif self._newest:
            self.flush()

    def flush(self) -> None:
        """Show what has come in."""
        newest, self._newest = self._newest, {}
        for name, state in newest.items():
            for view in self._views.get(name, ()):
                view.show_state(state)
        if newest:
            self.flushed.emit()
