"""How far an export is, how long it takes, and a way to end it."""

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QHBoxLayout, QProgressBar, QWidget

from cosmic.daqco.gui.amounts import duration_text
from cosmic.frame.gui.build import push_button
from cosmic.frame.gui.elided_label import ElidedLabel
from cosmic.frame.gui.theme import STEP_PX
from cosmic.frame.task import Progress, Task


class ExportBar(QWidget):
    """One line that is there while a task runs, and says how it ended."""

    _progressed = Signal(object)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._task: Task | None = None
        self.text = ElidedLabel()
        self.bar = QProgressBar()
        self.bar.setRange(0, 1000)
        self.bar.setFixedWidth(20 * STEP_PX)
        self.cancel = push_button("Cancel", "End the export; what is written is deleted")
        self.cancel.clicked.connect(self._on_cancel)
        row = QHBoxLayout(self)
        row.setContentsMargins(STEP_PX, 0, STEP_PX, 0)
        row.addWidget(self.text, 1)
        row.addWidget(self.bar)
        row.addWidget(self.cancel)
        self._progressed.connect(self._on_progressed)
        self.hide()

    def follow(self, task: Task) -> None:
        """Show how far `task` is."""
        self._task = task
        self.show()
        task.subscribe(self._progressed.emit)

    def say(self, text: str) -> None:
        """Show one line without a task."""
        self._task = None
        self.text.set_text(text)
        self.bar.hide()
        self.cancel.setText("Close")
        self.show()

    def _on_progressed(self, progress: Progress) -> None:
        if progress.done:
            self.say(f"◆ {progress.error}" if progress.error else f"{progress.title}: done")
            return
        left = "" if progress.left_s is None else f", {duration_text(progress.left_s)} left"
        self.text.set_text(f"{progress.title}: {progress.text}{left}")
        self.bar.setValue(round(1000 * progress.fraction))
        self.bar.show()
        self.cancel.setText("Cancel")

    def _on_cancel(self) -> None:
        if self._task is not None and not self._task.done:
            self._task.cancel()
        else:
            self.hide()
