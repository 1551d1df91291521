"""Fine and coarse steering: what fine leaves of the speed, and the button that changes it."""

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QHBoxLayout, QLabel, QLineEdit, QWidget

from cosmic.frame.gui.build import named
from cosmic.frame.gui.theme import STEP_PX
from cosmic.mico.core.teleoperation.settings import TeleoperationProfileSettings


class FineRow(QWidget):
    """Shows the pace of a profile and takes another.

    Signals
    -------
    edited(object, str)
        The operator has changed something: the share, text where it is no number, and the button.
    """

    edited = Signal(object, str)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.share = named(QLineEdit(), "fineShare")
        self.button = named(QLineEdit(), "fineButton")
        self.pace = QLabel("coarse")
        self._shown = ("", "")
        tips = (
            (self.share, "fine share", "Part of the speed that fine leaves, 0 to 1"),
            (self.button, "fine button", "Button that changes between fine and coarse"),
        )
        for edit, name, tip in tips:
            edit.setAccessibleName(name)
            edit.setToolTip(tip)
            edit.editingFinished.connect(self._on_edited)
        self.share.setFixedWidth(7 * STEP_PX)
        self.button.setFixedWidth(17 * STEP_PX)
        self.pace.setFixedWidth(self.pace.fontMetrics().horizontalAdvance("coarse") + STEP_PX)
        row = QHBoxLayout(self)
        row.setContentsMargins(0, 0, 0, 0)
        row.setSpacing(STEP_PX // 2)
        for widget in (self.pace, QLabel("fine:"), self.share, QLabel("by"), self.button):
            row.addWidget(widget)

    def show_profile(self, profile: TeleoperationProfileSettings) -> None:
        """Show what a profile says."""
        self._shown = (f"{profile.fine_share:g}", profile.fine_button)
        self.share.setText(self._shown[0])
        self.button.setText(self._shown[1])

    def show_pace(self, *, fine: bool) -> None:
        """Show how it is steered now."""
        self.pace.setText("fine" if fine else "coarse")

    def _on_edited(self) -> None:
        said = (self.share.text().strip(), self.button.text().strip())
        if said != self._shown:
            self.edited.emit(_number(said[0]), said[1])


def _number(text: str) -> float | str:
    try:
        return float(text)
    except ValueError:
        return text
