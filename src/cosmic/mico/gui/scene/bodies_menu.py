"""The list "Bodies": which are shown."""

from collections.abc import Iterable

from PySide6.QtCore import Signal
from PySide6.QtGui import QAction
from PySide6.QtWidgets import QMenu, QToolButton, QWidget

from cosmic.frame.gui.build import set_style_property, tipped


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
    def actions_by_body(self) -> dict[str, QAction]:
        """The entries of the list."""
        return dict(self._actions)

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
