"""What to try first, shown until it is dismissed once."""

from typing import Final

from PySide6.QtCore import QSettings, Qt
from PySide6.QtWidgets import QHBoxLayout, QLabel, QWidget

from cosmic.frame.gui.build import named, push_button
from cosmic.frame.gui.theme import STEP_PX
from cosmic.mico.core.settings import MicoSettings
from cosmic.mico.gui.key_names import key_text
from cosmic.mico.hw.interface import PositionerKind

_KEY: Final = "hint/dismissed"


def first_steps(settings: MicoSettings, stop_key: str) -> str:
    """Return what to try first, in the words and keys of this platform."""
    steps: list[str] = []
    for each in settings.positioner:
        if each.forward_key:
            steps.append(
                f"hold {key_text(each.forward_key)} to move {each.name}, release it to stop"
            )
            break
    if any(each.positioner_kind is not PositionerKind.OPEN_LOOP for each in settings.positioner):
        steps.append("type 0.2 mm into a field and press Go to")
    steps.append(f"press {stop_key} to stop everything, then Reset")
    return f"First steps: {'; '.join(steps)}. F1 lists all keys."


class HintBar(QWidget):
    """One line of advice with a button that takes it away for good.

    Parameters
    ----------
    text : str
        The advice.
    settings : QSettings
        Remembers that it was dismissed.
    """

    def __init__(self, text: str, settings: QSettings, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("hintBar")
        self._settings = settings
        label = QLabel(text)
        label.setWordWrap(True)
        label.setTextFormat(Qt.TextFormat.PlainText)
        dismiss = named(push_button("Got it", "Hide this line for good"), "gotIt")
        dismiss.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        dismiss.clicked.connect(self._on_dismissed)
        row = QHBoxLayout(self)
        row.setContentsMargins(STEP_PX, STEP_PX, STEP_PX, 0)
        row.setSpacing(STEP_PX)
        row.addWidget(label, 1)
        row.addWidget(dismiss)
        self.setVisible(not self._dismissed())

    def _dismissed(self) -> bool:
        return str(self._settings.value(_KEY, "")).lower() == "true"

    def _on_dismissed(self) -> None:
        self._settings.setValue(_KEY, "true")
        self._settings.sync()
        self.hide()
