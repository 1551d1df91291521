"""What the fibres of a campaign failed by, as a list with bars."""

from collections.abc import Mapping
from typing import Final

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QGridLayout, QLabel, QProgressBar, QWidget

from cosmic.frame.gui.elided_label import ElidedLabel
from cosmic.frame.gui.theme import STEP_PX, number_font

MOST: Final = 6
_OTHERS: Final = "others"


class CauseList(QWidget):
    """Shows how many fibres failed by each cause, the most frequent first."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._grid = QGridLayout(self)
        self._grid.setContentsMargins(0, 0, 0, 0)
        self._grid.setHorizontalSpacing(STEP_PX)
        self._grid.setVerticalSpacing(STEP_PX // 2)
        self._grid.setColumnStretch(0, 1)
        title = QLabel("Failed by")
        title.setProperty("role", "dim")
        self._grid.addWidget(title, 0, 0, 1, 3)
        self._lines = [self._line(row) for row in range(1, MOST + 1)]
        self._grid.setRowStretch(MOST + 1, 1)
        self.setMinimumWidth(24 * STEP_PX)
        self.show_causes({})

    def _line(self, row: int) -> tuple[ElidedLabel, QProgressBar, QLabel]:
        text, bar, count = ElidedLabel(), QProgressBar(), QLabel()
        bar.setTextVisible(False)
        bar.setFixedSize(8 * STEP_PX, STEP_PX)
        bar.setStyleSheet(f"QProgressBar {{ min-height: {STEP_PX}px; border: none; }}")
        count.setFont(number_font())
        count.setAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
        count.setMinimumWidth(count.fontMetrics().horizontalAdvance("0000"))
        for column, widget in enumerate((text, bar, count)):
            self._grid.addWidget(widget, row, column)
        return text, bar, count

    def show_causes(self, causes: Mapping[str, int]) -> None:
        """Show these; what does not fit is added up."""
        listed = list(causes.items())
        if len(listed) > MOST:
            rest = sum(count for _, count in listed[MOST - 1 :])
            listed = [*listed[: MOST - 1], (_OTHERS, rest)]
        if not listed:
            listed = [("nothing so far", 0)]
        most = max([1, *(count for _, count in listed)])
        for place, (text, bar, count) in enumerate(self._lines):
            there = place < len(listed)
            for widget in (text, bar, count):
                widget.setVisible(there)
            if there:
                name, times = listed[place]
                text.set_text(name)
                count.setText(str(times) if times else "")
                bar.setRange(0, most)
                bar.setValue(times)
                bar.setVisible(times > 0)

    def texts(self) -> list[tuple[str, str]]:
        """Return what is shown."""
        return [
            (text.text(), count.text()) for text, _, count in self._lines if not text.isHidden()
        ]
