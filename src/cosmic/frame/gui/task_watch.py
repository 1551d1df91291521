"""Brings how far a task is, told in any thread, to a widget in the GUI thread."""

from functools import partial

from PySide6.QtCore import QObject, Signal

from cosmic.frame.gui.relay import Relay
from cosmic.frame.operation import Progress, Task


class TaskWatch(QObject):
    """Follows one task after the other; of an older one nothing is told any more.

    Signals
    -------
    progressed(Progress)
        How far the task is, its end included; in the GUI thread.
    """

    progressed = Signal(object)

    def __init__(self, parent: QObject) -> None:
        super().__init__(parent)
        self.task: Task | None = None
        self._relay = Relay(self._on_progressed)

    @property
    def busy(self) -> bool:
        """A task goes on."""
        return self.task is not None and not self.task.done

    def follow(self, task: Task) -> None:
        """Tell of `task` from now on."""
        self.task = task
        task.subscribe(partial(self._relay, task))

    def _on_progressed(self, task: Task, progress: Progress) -> None:
        if task is self.task:
            self.progressed.emit(progress)
