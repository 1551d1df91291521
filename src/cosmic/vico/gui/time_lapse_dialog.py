"""How often, and how many: before a time-lapse begins."""

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QIcon, QKeyEvent
from PySide6.QtWidgets import QDialog, QDialogButtonBox, QFormLayout, QLabel, QWidget

from cosmic.frame.gui.amounts import duration_text
from cosmic.frame.gui.theme import STEP_PX
from cosmic.frame.overrides import override
from cosmic.vico.gui.amount_field import AmountField


class TimeLapseDialog(QDialog):
    """Asks for interval and number of images.

    Signals
    -------
    agreed(float, int)
        Interval in seconds, number of images.
    """

    agreed = Signal(float, int)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setWindowTitle("Time-lapse")
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self.interval = AmountField("Time between images", "s", low=0.1, high=86400.0, value=10.0)
        self.count = AmountField(
            "Number of images", "", low=1.0, high=1e6, value=60.0, integers=True
        )
        self.total = QLabel()
        buttons = QDialogButtonBox(QDialogButtonBox.StandardButton.Cancel)
        self.begin = buttons.addButton("Begin", QDialogButtonBox.ButtonRole.AcceptRole)
        for each in buttons.buttons():
            each.setIcon(QIcon())
        form = QFormLayout(self)
        form.setSpacing(STEP_PX)
        form.addRow("One image every", self.interval)
        form.addRow("Images", self.count)
        form.addRow("Takes", self.total)
        form.addRow(buttons)
        buttons.accepted.connect(self._on_begin)
        buttons.rejected.connect(self.reject)
        for field in (self.interval, self.count):
            field.committed.connect(self._show_total)
        self._show_total()

    def _show_total(self) -> None:
        interval_s, count = self.interval.value(), self.count.value()
        if interval_s is not None and count is not None:
            self.total.setText(duration_text(interval_s * max(0.0, count - 1.0)))

    def _on_begin(self) -> None:
        judged = [field.commit() for field in (self.interval, self.count)]
        interval_s, count = self.interval.value(), self.count.value()
        if all(judged) and interval_s is not None and count is not None:
            self.agreed.emit(interval_s, round(count))
            self.accept()

    @override
    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.key() in (Qt.Key.Key_Return, Qt.Key.Key_Enter):
            event.accept()  # Enter judges a field here; a dialog would begin at once
            return
        super().keyPressEvent(event)
