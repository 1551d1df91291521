"""Says who commands the movements, and lets the operator take or give that right."""

from collections.abc import Sequence
from dataclasses import dataclass

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QHBoxLayout, QPushButton, QWidget

from cosmic.frame.gui.build import named, push_button
from cosmic.frame.gui.chip import Chip
from cosmic.frame.gui.theme import STEP_PX


@dataclass(frozen=True, slots=True)
class ControlAction:
    """What the operator can do about who commands.

    Attributes
    ----------
    name : str
        What `action_requested` says.
    text, tip : str
        What stands on the button, and what it does.
    """

    name: str
    text: str
    tip: str


class ControlsIndicator(QWidget):
    """A chip with a button for each thing that can be done about it; decides nothing itself."""

    action_requested = Signal(str)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._chip = Chip("", "quiet")
        self._actions: tuple[ControlAction, ...] = ()
        self._buttons: list[QPushButton] = []
        self._row = QHBoxLayout(self)
        self._row.setContentsMargins(0, 0, 0, 0)
        self._row.setSpacing(STEP_PX // 2)
        self._row.addWidget(self._chip)

    @property
    def text(self) -> str:
        """What is said."""
        return self._chip.text()

    @property
    def buttons(self) -> dict[str, QPushButton]:
        """The buttons by the name of what they ask for."""
        return {
            each.name: button for each, button in zip(self._actions, self._buttons, strict=True)
        }

    def show_holder(self, who: str, *, warn: bool = False, tip: str = "") -> None:
        """Say who commands; `warn` where it is not this window."""
        self._chip.setText(f"controls: {who}")
        self._chip.setToolTip(tip or f"Motion is controlled by {who}")
        self._chip.set_tone("warning" if warn else "quiet")

    def set_actions(self, actions: Sequence[ControlAction]) -> None:
        """Offer `actions`, each with a button."""
        if tuple(actions) == self._actions:
            return
        self._actions = tuple(actions)
        for button in self._buttons:
            self._row.removeWidget(button)
            button.hide()
            button.deleteLater()
        self._buttons = [self._button(each) for each in self._actions]
        for button in self._buttons:
            self._row.addWidget(button)

    def _button(self, action: ControlAction) -> QPushButton:
        button = named(push_button(action.text, action.tip), f"control {action.name}")
        button.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        button.clicked.connect(lambda: self.action_requested.emit(action.name))
        return button
