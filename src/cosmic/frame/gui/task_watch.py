"""Brings how far a task is, told in any thread, to a widget in the GUI thread."""

from PySide6.QtCore import QObject, Signal
from shiboken6 import isValid

from cosmic.frame.task import Progress, Task


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
