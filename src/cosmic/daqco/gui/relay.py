"""Brings what the application tells, in any thread, to a widget in the GUI thread."""

from collections.abc import Callable

from PySide6.QtCore import QObject, Signal
from PySide6.QtWidgets import QWidget

from cosmic.daqco.gui.ports import DaqPort, Unsubscribe


class PortRelay(QObject):
    """Belongs to a widget; stops listening when the widget goes.

    Signals
    -------
    changed()
        Anything but samples and counters changed; connect a method of the widget.
    """

    changed = Signal()

    def __init__(self, port: DaqPort, widget: QWidget) -> None:
        super().__init__(widget)
        self._ends: list[Unsubscribe] = []
        self.keep(port.on_change(self.changed.emit))
        widget.destroyed.connect(_ender(self._ends))

    def keep(self, unsubscribe: Unsubscribe) -> None:
        """Call this as well when the widget goes."""
        self._ends.append(unsubscribe)

    def end(self) -> None:
        """Stop listening now; harmless the second time."""
        _end_all(self._ends)


def _ender(ends: list[Unsubscribe]) -> Callable[[], None]:
    return lambda: _end_all(ends)  # must not hold the widget, which is gone by then


def _end_all(ends: list[Unsubscribe]) -> None:
    while ends:
        ends.pop()()
