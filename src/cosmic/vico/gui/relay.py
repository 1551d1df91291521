"""Brings what the application and its tasks tell, in any thread, to widgets in the GUI thread."""

from collections.abc import Callable

from PySide6.QtCore import QObject, Signal
from PySide6.QtWidgets import QWidget
from shiboken6 import isValid

from cosmic.frame.task import Progress, Task
from cosmic.vico.gui.ports import Unsubscribe, VicoPort


class PortRelay(QObject):
    """Belongs to a widget; stops listening when the widget goes.

    Signals
    -------
    changed()
        Anything but pictures and counters changed; connect a method of the widget.
    """

    changed = Signal()

    def __init__(self, port: VicoPort, widget: QWidget) -> None:
        super().__init__(widget)
        self._ends: list[Unsubscribe] = [port.on_change(self.changed.emit)]
        widget.destroyed.connect(_ender(self._ends))

    def end(self) -> None:
        """Stop listening now; harmless the second time."""
        _end_all(self._ends)


def _ender(ends: list[Unsubscribe]) -> Callable[[], None]:
    return lambda: _end_all(ends)  # must not hold the widget, which is gone by then


def _end_all(ends: list[Unsubscribe]) -> None:
    while ends:
        ends.pop()()


class TaskWatch(QObject):
    """Follows one task after the other; of an older one nothing is told any more.

    Signals
    -------
    progressed(Progress)
        How far the task is, its end included; in the GUI thread.
    """

    progressed = Signal(object)
    _told = Signal(object, object)

    def __init__(self, parent: QObject) -> None:
        super().__init__(parent)
        self.task: Task | None = None
        self._told.connect(self._on_told)

    @property
    def busy(self) -> bool:
        """A task goes on."""
        return self.task is not None and not self.task.done

    def follow(self, task: Task) -> None:
        """Tell of `task` from now on."""
        self.task = task

        def tell(progress: Progress) -> None:
            if isValid(self):  # the widget may go while its task goes on
                self._told.emit(task, progress)

        task.subscribe(tell)

    def _on_told(self, task: Task, progress: Progress) -> None:
        if task is self.task:
            self.progressed.emit(progress)
