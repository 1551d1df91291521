"""The menus of the main window."""

from typing import Final

from PySide6.QtCore import QObject, Qt, Signal
from PySide6.QtGui import QAction, QActionGroup, QKeySequence
from PySide6.QtWidgets import QDockWidget, QMenu, QMenuBar, QMessageBox, QWidget

_THEMES: Final = {"dark": "Dark", "light": "Light"}


class ServerMenus(QObject):
    """File, View and Help; each entry only asks, its window acts."""

    quit_requested = Signal()
    keys_requested = Signal()
    theme_requested = Signal(str)
    reset_layout_requested = Signal()

    def __init__(self, window: QWidget) -> None:
        super().__init__(window)
        self._window = window
        self._about = window.windowTitle()
        self.bar = QMenuBar()
        self.bar.setNativeMenuBar(False)  # it shares its row with the messages
        file = self._menu("&File")
        self._view = self._menu("&View")
        help_ = self._menu("&Help")
        quit_ = self._action(file, "&Quit", "Stop, release the hardware and close", "Ctrl+Q")
        quit_.triggered.connect(self.quit_requested)
        self._separator = self._view.addSeparator()
        self._themes = self._make_themes()
        reset = self._action(self._view, "&Reset layout", "Put all panels back to their places")
        reset.triggered.connect(self.reset_layout_requested)
        keys = self._action(help_, "&Keys", "List every key and what it does", "F1")
        keys.setShortcutContext(Qt.ShortcutContext.ApplicationShortcut)
        keys.triggered.connect(self.keys_requested)
        about = self._action(help_, "&About", "Version and origin of this program")
        about.triggered.connect(self._on_about)

    def _menu(self, title: str) -> QMenu:
        menu = self.bar.addMenu(title)
        menu.setToolTipsVisible(True)
        return menu

    def _action(self, menu: QMenu, text: str, tip: str, shortcut: str = "") -> QAction:
        action = menu.addAction(text)
        action.setToolTip(tip)
        if shortcut:
            action.setShortcut(QKeySequence(shortcut))
        return action

    def _make_themes(self) -> dict[str, QAction]:
        menu = self._view.addMenu("&Theme")
        menu.setToolTipsVisible(True)
        group = QActionGroup(menu)
        actions: dict[str, QAction] = {}
        for name, text in _THEMES.items():
            action = self._action(menu, text, f"Use the {name} theme")
            action.setCheckable(True)
            action.setData(name)
            group.addAction(action)
            actions[name] = action
        group.triggered.connect(self._on_theme)
        return actions

    def add_dock(self, dock: QDockWidget) -> None:
        """Let the View menu show and hide `dock`."""
        action = dock.toggleViewAction()
        action.setToolTip(f"Show or hide the panel {dock.windowTitle()}")
        self._view.insertAction(self._separator, action)

    def show_theme(self, name: str) -> None:
        """Tick the theme in force."""
        self._themes[name].setChecked(True)

    def set_about(self, text: str) -> None:
        """Give the text of Help > About."""
        self._about = text

    def _on_theme(self, action: QAction) -> None:
        self.theme_requested.emit(str(action.data()))

    def _on_about(self) -> None:
        box = QMessageBox(
            QMessageBox.Icon.NoIcon,
            f"About {self._window.windowTitle()}",
            self._about,
            QMessageBox.StandardButton.Close,
            self._window,
        )
        box.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        box.open()
