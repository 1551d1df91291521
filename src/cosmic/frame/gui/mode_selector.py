"""The four control modes side by side: the one in force, and why others cannot be chosen."""

from typing import Final

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QHBoxLayout, QToolButton, QWidget

from cosmic.frame.gui.build import named

MODES: Final = {
    "MCM": "Manual control: you command every movement",
    "SCM": "Semi-automatic control: recorded trajectories are executed again",
    "ECM": "Enhanced manual control: a way around is planned where the straight one collides",
    "ACM": "Automatic control: whole procedures run without a person",
}


class ModeSelector(QWidget):
    """Shows the mode in force; a click only asks for another one."""

    mode_requested = Signal(str)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._mode = "MCM"
        self._buttons: dict[str, QToolButton] = {}
        row = QHBoxLayout(self)
        row.setContentsMargins(0, 0, 0, 0)
        row.setSpacing(0)
        for name in MODES:
            button = named(QToolButton(), "modeButton")
            button.setText(name)
            button.setCheckable(True)
            button.setFocusPolicy(Qt.FocusPolicy.NoFocus)
            button.clicked.connect(self._on_clicked)
            row.addWidget(button)
            self._buttons[name] = button
            self.set_available(name, "" if name == "MCM" else "not part of this version")
        self.set_mode("MCM")

    @property
    def mode(self) -> str:
        """The mode in force."""
        return self._mode

    def set_mode(self, name: str) -> None:
        """Show `name` as the mode in force."""
        self._mode = name
        for each, button in self._buttons.items():
            button.setChecked(each == name)

    def set_available(self, name: str, why_not: str = "") -> None:
        """Let `name` be chosen, or say in its tooltip why it cannot be."""
        button = self._buttons[name]
        button.setEnabled(not why_not)
        tip = f"{MODES[name]}\nNot available: {why_not}" if why_not else MODES[name]
        button.setToolTip(tip)

    def _on_clicked(self) -> None:
        wanted = next(name for name, each in self._buttons.items() if each is self.sender())
        self.set_mode(self._mode)  # the click alone changes nothing: the owner decides
        if wanted != self._mode:
            self.mode_requested.emit(wanted)
