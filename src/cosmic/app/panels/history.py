"""What moved last, and what Undo takes back."""

from PySide6.QtWidgets import QHBoxLayout, QListWidget, QVBoxLayout, QWidget

from cosmic.frame.gui.build import named, push_button
from cosmic.frame.gui.theme import STEP_PX
from cosmic.mico.core.motion.undo import undo_text
from cosmic.mico.gui.mico_widget import MicoWidget


class HistoryPanel(QWidget):
    """Lists the movements that can be taken back, newest first; GUI thread."""

    def __init__(self, gui: MicoWidget, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._gui = gui
        self.list = named(QListWidget(), "historyList")
        self.undo = named(push_button("Undo", "Take the newest movement back"), "historyUndo")
        self.undo.clicked.connect(gui.undoing.undo)
        row = QHBoxLayout()
        row.addWidget(self.undo)
        row.addStretch(1)
        column = QVBoxLayout(self)
        column.setContentsMargins(STEP_PX, STEP_PX // 2, STEP_PX, STEP_PX // 2)
        column.setSpacing(STEP_PX // 2)
        column.addWidget(self.list, 1)
        column.addLayout(row)
        gui.undoing.available.connect(self.refresh)
        self.refresh()

    def refresh(self, _newest: str = "") -> None:
        """Show what can be taken back now."""
        mico = self._gui.mico
        states = mico.states()
        self.list.clear()
        for entry in mico.undo_entries:
            self.list.addItem(f"{entry.group}: back to where {undo_text(entry, states)}")
        self.undo.setEnabled(self.list.count() > 0)
