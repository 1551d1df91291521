"""The row of buttons above the scene: from where to look, and which bodies are shown."""

from collections.abc import Iterable, Sequence

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QAction
from PySide6.QtWidgets import QHBoxLayout, QMenu, QToolButton, QWidget

from cosmic.frame.gui.build import named, set_style_property, tipped
from cosmic.frame.gui.theme import STEP_PX
from cosmic.mico.gui.scene.arms import Preset


class BodiesButton(QToolButton):
    """Opens a list of the bodies in which each is ticked or not.

    Signals
    -------
    hidden_changed(object)
        The names of the bodies that are not to be shown, a frozenset.
    """

    hidden_changed = Signal(object)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setText("Bodies")
        self.setPopupMode(QToolButton.ToolButtonPopupMode.InstantPopup)
        self._menu = QMenu(self)
        self.setMenu(self._menu)
        self._actions: dict[str, QAction] = {}
        self._hidden: frozenset[str] = frozenset()
        self._say()

    @property
    def hidden(self) -> frozenset[str]:
        """The bodies that are not to be shown, those of other models included."""
        return self._hidden

    def set_bodies(self, bodies: Iterable[str]) -> None:
        """List these bodies."""
        self._menu.clear()
        self._actions = {}
        self._menu.addAction("Show all").triggered.connect(self._on_show_all)
        self._menu.addSeparator()
        for body in bodies:
            action = self._menu.addAction(body)
            action.setCheckable(True)
            action.setChecked(body not in self._hidden)
            action.toggled.connect(self._on_toggled)
            self._actions[body] = action
        self._say()

    def set_hidden(self, hidden: Iterable[str]) -> None:
        """Show all but these."""
        self._hidden = frozenset(hidden)
        for body, action in self._actions.items():
            action.blockSignals(True)
            action.setChecked(body not in self._hidden)
            action.blockSignals(False)
        self._say()
        self.hidden_changed.emit(self._hidden)

    def _on_toggled(self) -> None:
        gone = {body for body, action in self._actions.items() if not action.isChecked()}
        self.set_hidden((self._hidden - set(self._actions)) | gone)

    def _on_show_all(self) -> None:
        self.set_hidden(self._hidden - set(self._actions))

    def _say(self) -> None:
        gone = [body for body in self._actions if body in self._hidden]
        tip = "Choose which bodies are shown"
        tipped(self, f"{tip}; hidden: {', '.join(gone)}" if gone else tip)
        self.setText("Bodies *" if gone else "Bodies")
        set_style_property(self, "partial", bool(gone))
        self.setEnabled(bool(self._actions))


class LookBar(QWidget):
    """A button for each side of the working area, a list of the tips, and what is given.

    Signals
    -------
    look_requested(str)
        The name of a preset.
    """

    look_requested = Signal(str)

    def __init__(self, last: QToolButton, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._buttons: list[QToolButton] = []
        self._tips = _button("Tips", "Close-ups of the tips", "sceneTips")
        self._tips.setPopupMode(QToolButton.ToolButtonPopupMode.InstantPopup)
        self._menu = QMenu(self)
        self._menu.setToolTipsVisible(True)
        self._menu.triggered.connect(self._on_triggered)
        self._tips.setMenu(self._menu)
        last.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self._row = QHBoxLayout(self)
        self._row.setContentsMargins(STEP_PX // 2, 0, STEP_PX // 2, 0)
        self._row.setSpacing(STEP_PX // 4)
        self._row.addWidget(self._tips)
        self._row.addStretch(1)
        self._row.addWidget(last)

    def set_presets(self, presets: Sequence[Preset]) -> None:
        """Offer these places to look from."""
        for button in self._buttons:
            self._row.removeWidget(button)
            button.deleteLater()
        self._buttons = []
        self._menu.clear()
        for preset in presets:
            if preset.close:
                action = QAction(preset.text, self._menu)
                action.setToolTip(preset.tip)
                action.setData(preset.name)
                self._menu.addAction(action)
            else:
                button = _button(preset.text, preset.tip, f"sceneLook {preset.name}")
                button.setProperty("preset", preset.name)
                button.clicked.connect(self._on_clicked)
                self._row.insertWidget(len(self._buttons), button)
                self._buttons.append(button)
        self._tips.setVisible(not self._menu.isEmpty())

    def _on_clicked(self) -> None:
        sender = self.sender()
        if sender is not None:
            self.look_requested.emit(str(sender.property("preset")))

    def _on_triggered(self, action: QAction) -> None:
        self.look_requested.emit(str(action.data()))


def _button(text: str, tip: str, name: str) -> QToolButton:
    button = named(tipped(QToolButton(), tip), name)
    button.setText(text)
    button.setFocusPolicy(Qt.FocusPolicy.NoFocus)
    return button
