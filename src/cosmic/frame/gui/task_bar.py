"""One line for something that takes a while: what, how far, how long, and a way to end it."""

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QHBoxLayout, QProgressBar, QWidget

from cosmic.frame.gui.amounts import duration_text
from cosmic.frame.gui.build import push_button
from cosmic.frame.gui.elided_label import ElidedLabel
from cosmic.frame.gui.task_watch import TaskWatch
from cosmic.frame.gui.theme import STEP_PX, State, state_look
from cosmic.frame.operation import Progress, Task


class TaskBar(QWidget):
    """Is there while a task runs; keeps how it ended until the next one.

    Parameters
    ----------
    cancel_tip : str
        What ending the task does.
    closable : bool
        Stay away until there is something to say; afterwards the operator can close it.

    Signals
    -------
    ended(Progress)
        The task is over.
    """

    ended = Signal(object)

    def __init__(
        self,
        parent: QWidget | None = None,
        *,
        cancel_tip: str = "Cancel it now",
        closable: bool = False,
    ) -> None:
        super().__init__(parent)
        self._closable = closable
        self.text = ElidedLabel()
        self.bar = QProgressBar()
        self.bar.setRange(0, 1000)
        self.bar.setTextVisible(False)
        self.bar.setFixedWidth(10 * STEP_PX)
        self.cancel = push_button("Cancel", cancel_tip)
        self.cancel.clicked.connect(self._on_cancel)
        row = QHBoxLayout(self)
        row.setContentsMargins(0, 0, 0, 0)
        row.setSpacing(STEP_PX)
        row.addWidget(self.text, 1)
        row.addWidget(self.bar)
        row.addWidget(self.cancel)
        self.watch = TaskWatch(self)
        self.watch.progressed.connect(self._on_progressed)
        self._show_running(running=False)
        self.setHidden(closable)

    def follow(self, task: Task) -> None:
        """Show how far `task` is."""
        self.show()
        self._show_running(running=True)
        self.watch.follow(task)

    def say(self, text: str, *shorter: str, refused: bool = False) -> None:
        """Show one line without a task; of `shorter` the first that fits where it does not."""
        self.show()
        glyph = f"{state_look(State.REFUSED).glyph} " if refused else ""
        self.text.set_text(glyph + text, *(glyph + each for each in shorter))

    def _show_running(self, *, running: bool) -> None:
        # Only the height is kept, so that nothing moves: how it ended has the whole width.
        self.setMinimumHeight(self.cancel.sizeHint().height())
        self.bar.setVisible(running)
        self.cancel.setVisible(running or self._closable)
        if self._closable:
            self.cancel.setText("Cancel" if running else "Close")

    def _on_progressed(self, progress: Progress) -> None:
        self._show_running(running=not progress.done)
        if progress.done:
            # In a narrow column how it ended is said before what has ended.
            end = progress.error or progress.text or "done"
            self.say(f"{progress.title}: {end}", end, refused=bool(progress.error))
            self.ended.emit(progress)
            return
        left = "" if progress.left_s is None else f", {duration_text(progress.left_s)} left"
        self.say(f"{progress.title}: {progress.text}{left}")
        self.bar.setValue(round(1000 * progress.fraction))

    def _on_cancel(self) -> None:
        if self.watch.task is not None and self.watch.busy:
            self.watch.task.cancel()
        else:
            self.hide()
