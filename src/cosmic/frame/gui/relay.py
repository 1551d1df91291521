"""Brings what an application tells, in any thread, to a widget in the GUI thread."""

from abc import abstractmethod
from collections.abc import Callable
from typing import Protocol

from PySide6.QtCore import QObject, Signal
from PySide6.QtWidgets import QWidget

Unsubscribe = Callable[[], None]


class TellsChanges(Protocol):
    """What an application offers to its widgets, as far as it matters here."""

    @abstractmethod
    def on_change(self, listener: Callable[[], object]) -> Unsubscribe:
        """Call `listener()`, in any thread, when something changed."""


class PortRelay(QObject):
    """Belongs to a widget; stops listening when the widget goes.

    Signals
    -------
    changed()
        Anything changed that the port tells of; connect a method of the widget.
    """

    changed = Signal()

    def __init__(self, port: TellsChanges, widget: QWidget) -> None:
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
