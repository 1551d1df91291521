"""The main window that hosts the GUI components of applications (thesis 5.3.1)."""

from collections.abc import Sequence
from functools import partial
from typing import Final

from PySide6.QtCore import QObject, QSettings, QSize, Qt, QTimer, Signal
from PySide6.QtGui import (
    QAction,
    QActionGroup,
    QCloseEvent,
    QGuiApplication,
    QKeySequence,
    QResizeEvent,
    QShowEvent,
)
from PySide6.QtWidgets import (
    QApplication,
    QDockWidget,
    QInputDialog,
    QMainWindow,
    QMenu,
    QMenuBar,
    QMessageBox,
    QStatusBar,
    QWidget,
)

from cosmic.frame.gui.application_events import at_one_go
from cosmic.frame.gui.beside import open_beside
from cosmic.frame.gui.dock import PanelDock
from cosmic.frame.gui.drawer import Drawer
from cosmic.frame.gui.keys_dialog import KeyList, KeysDialog
from cosmic.frame.gui.layout_store import LayoutStore
from cosmic.frame.gui.palette import ThemeName
from cosmic.frame.gui.screen_fit import DialogFitter, fit_to_screen, limit_to_least
from cosmic.frame.gui.tab_bars import hide_stale_tab_bars
from cosmic.frame.gui.theme import STEP_PX, apply_theme, current_palette
from cosmic.frame.gui.top_bar import TopBar
from cosmic.frame.gui.wheel_guard import WheelGuard
from cosmic.frame.gui.workspaces import Workspace, Workspaces
from cosmic.frame.overrides import override

LEAST_SIZE: Final = QSize(1024, 600)
"""What the workspaces fit into; buttons lie over each other in less."""
_THEMES: Final = {"dark": "Dark", "light": "Light"}


class LayoutMenu(QObject):
    """View > Layout: the layouts that were kept, by name; GUI thread."""

    def __init__(self, menu: QMenu, owner: QObject) -> None:
        super().__init__(owner)
        self._menu = menu
        self._menu.setToolTipsVisible(True)
        self._menu.menuAction().setVisible(False)
        self._dialog: QInputDialog | None = None

    def follow(self, workspaces: Workspaces, window: QWidget) -> None:
        """Offer the layouts of `workspaces`."""
        self._workspaces, self._window = workspaces, window
        self._menu.menuAction().setVisible(True)
        self._menu.aboutToShow.connect(self._fill)
        self._fill()

    def _fill(self) -> None:
        self._menu.clear()
        for name in self._workspaces.layouts:
            action = self._menu.addAction(name)
            action.setToolTip(f"Lay the panels out as they were kept as {name}")
            action.setCheckable(True)
            action.setChecked(name == self._workspaces.layout_name)
            action.triggered.connect(partial(self._workspaces.use, name))
        self._menu.addSeparator()
        keep = self._menu.addAction("&Keep as…")
        keep.setToolTip("Keep the panels as they are under a name")
        keep.triggered.connect(self._on_keep)

    def _on_keep(self) -> None:
        dialog = QInputDialog(self._window)
        dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        dialog.setWindowTitle("Keep the layout")
        dialog.setLabelText("Name of the layout")
        dialog.textValueSelected.connect(self._on_named)
        open_beside(dialog)

    def _on_named(self, name: str) -> None:
        name = name.strip().replace("/", "-")
        if name:
            self._workspaces.save_as(name)


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
        self.layouts = LayoutMenu(self._view.addMenu("&Layout"), self)
        reset = self._action(self._view, "&Reset layout", "Reset all panels to the default layout")
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
        open_beside(box)


Area = Qt.DockWidgetArea
Run = Qt.Orientation

LOG_TITLE: Final = "Log"
"""A click on the message in the bar brings the panel with this title to the front."""

_BOTTOM_LEAST_PX: Final = 22 * STEP_PX


class CosmicServerGui(QMainWindow):
    """Hosts panels in docks under a fixed bar; knows nothing of what they control.

    Add the panels before the first `show`: the layout of the last run is restored then.

    Parameters
    ----------
    settings : QSettings
        Where layout and theme are kept from one start to the next.
    title : str
        Name of the program or of the station.
    stop_key : str
        The key of STOP as it is written on the keyboard.
    theme : str
        The theme of the first start: "dark" or "light".
    """

    stop_requested = Signal()
    """STOP was pressed, in this window or in a panel that floats."""
    rescan_requested = Signal(str)
    """The operator wants the application with this title started anew."""
    theme_changed = Signal(str)
    closing = Signal()
    """The window is about to close: save, stop and release now."""

    def __init__(
        self,
        settings: QSettings,
        *,
        title: str = "CoSMic",
        stop_key: str = "F12",
        theme: ThemeName = "dark",
        parent: QWidget | None = None,
    ) -> None:
        super().__init__(parent)
        self.setObjectName("CosmicServerGui")
        self.setWindowTitle(title)
        self.setDockNestingEnabled(True)
        self.setAnimated(False)
        self.setFocusPolicy(Qt.FocusPolicy.ClickFocus)
        self._store = LayoutStore(settings)
        self._stop_key = stop_key
        self._docks: dict[str, PanelDock] = {}
        self._keys: KeyList = ()
        self._keys_dialog: KeysDialog | None = None
        self._shares: list[tuple[tuple[str, ...], tuple[int, ...], Run]] = []
        self._restored = False
        self._settings = settings
        self._workspaces: Workspaces | None = None
        self._drawer: Drawer | None = None
        self._bar = TopBar(title, stop_key=stop_key)
        self._menus = ServerMenus(self)
        self._bar.set_menu_bar(self._menus.bar)
        self.setMenuWidget(self._bar)
        self.setCorner(Qt.Corner.BottomLeftCorner, Area.BottomDockWidgetArea)
        self.setCorner(Qt.Corner.BottomRightCorner, Area.BottomDockWidgetArea)
        self._connect()
        self.set_theme(self._store.theme() or theme)
        self.resize(230 * STEP_PX, 125 * STEP_PX)  # less where the screen is smaller

    def _connect(self) -> None:
        self._bar.stop_requested.connect(self.stop_requested)
        self._bar.theme_requested.connect(self._on_theme_requested)
        self._bar.message_clicked.connect(self._on_message_clicked)
        self._menus.quit_requested.connect(self.close)
        self._menus.keys_requested.connect(self.show_keys)
        self._menus.theme_requested.connect(self.set_theme)
        self._menus.reset_layout_requested.connect(self.reset_layout)

    @property
    def top_bar(self) -> TopBar:
        """The bar with mode, messages and STOP."""
        return self._bar

    @property
    def theme(self) -> ThemeName:
        """The theme in force."""
        return current_palette().name

    def dock(self, title: str) -> PanelDock:
        """Return the dock of the panel `title`."""
        return self._docks[title]

    def add_panel(
        self,
        title: str,
        panel: QWidget,
        area: Area = Area.LeftDockWidgetArea,
        *,
        scroll: bool = True,
        beside: str = "",
        below: str = "",
        tabbed: bool = False,
    ) -> PanelDock:
        """Host `panel` in a dock, and in the View menu.

        Parameters
        ----------
        area : Qt.DockWidgetArea
            Where it stands at a first start.
        scroll : bool
            Let the panel scroll where there is too little room.
        beside, below : str
            Title of a panel that it stands beside or below, or is tabbed with.
        tabbed : bool
            Share the place of that panel instead of dividing it.
        """
        dock = PanelDock(title, panel, scroll=scroll, stop_key=self._stop_key, parent=self)
        dock.stop_requested.connect(self.stop_requested)
        dock.rescan_requested.connect(self.rescan_requested)
        self._docks[title] = dock
        self._menus.add_dock(dock)
        neighbour = self._docks.get(beside or below)
        if neighbour is None:
            self.addDockWidget(area, dock)
        elif tabbed:
            self.tabifyDockWidget(neighbour, dock)
        else:
            direction = Qt.Orientation.Vertical if below else Qt.Orientation.Horizontal
            self.splitDockWidget(neighbour, dock, direction)
        if self._restored:
            self.restoreDockWidget(dock)
        return dock

    def use_workspaces(self, workspaces: Sequence[Workspace], middle: QWidget) -> Workspaces:
        """Lay the panels out by task, around `middle`; call it when all panels were added.

        What is not a panel but opens over the picture is added to `drawer` afterwards.
        """
        made = Workspaces(self, self._settings)
        self._workspaces = made
        self.setCentralWidget(middle)
        for dock in self._docks.values():
            made.add_dock(dock)
        for each in workspaces:
            made.add(each)
        self._bar.set_workspaces([(each.name, each.tip) for each in workspaces])
        self._bar.workspace_requested.connect(made.choose)
        made.chosen.connect(self._bar.show_workspace)
        self._menus.layouts.follow(made, self)
        return made

    @property
    def workspaces(self) -> Workspaces | None:
        """What lays the panels out by task; None where the window does one task only."""
        return self._workspaces

    @property
    def drawer(self) -> Drawer:
        """The line at the bottom, made now if need be."""
        if self._drawer is None:
            self._drawer = Drawer(self)
            bar = QStatusBar()
            bar.setSizeGripEnabled(False)
            bar.setContentsMargins(0, 0, 0, 0)
            bar.addWidget(self._drawer, 1)
            self.setStatusBar(bar)
        return self._drawer

    def share_out(self, titles: Sequence[str], shares: Sequence[int], direction: Run) -> None:
        """Have panels that stand in a row or a column share its length so at a first start."""
        self._shares.append((tuple(titles), tuple(shares), direction))

    def set_failed(self, title: str, reason: str, *, rescan: bool = True) -> None:
        """Grey the panel `title`, say why and offer a rescan where that may help."""
        self._docks[title].set_failed(reason, rescan=rescan)

    def clear_failed(self, title: str) -> None:
        """Let the panel `title` be used again."""
        self._docks[title].clear_failed()

    def raise_panel(self, title: str) -> None:
        """Show the panel `title` and bring it to the front."""
        if self._drawer is not None and title in self._drawer.titles:
            self._drawer.show_page(title)
            return
        if self._workspaces is not None:
            self._workspaces.bring(title)
            return
        dock = self._docks[title]
        dock.show()
        dock.raise_()

    def set_keys(self, keys: KeyList) -> None:
        """Give the list that F1 shows: key and what it does."""
        self._keys = tuple(keys)
        if self._keys_dialog is not None:
            self._keys_dialog.set_keys(self._keys)

    def show_keys(self) -> None:
        """Show the list of keys."""
        if self._keys_dialog is None:
            self._keys_dialog = KeysDialog(self._keys, stop_key=self._stop_key, parent=self)
            self._keys_dialog.stop_requested.connect(self.stop_requested)
        self._keys_dialog.show()
        self._keys_dialog.raise_()
        self._keys_dialog.activateWindow()

    @property
    def keys_dialog(self) -> KeysDialog | None:
        """The list of keys, once it was shown."""
        return self._keys_dialog

    def set_about(self, text: str) -> None:
        """Give the text that Help > About shows."""
        self._menus.set_about(text)

    def set_theme(self, name: str) -> None:
        """Give all windows the theme `name`, now and at the next start."""
        app = QApplication.instance()
        if not isinstance(app, QApplication):
            return
        with at_one_go(self):
            apply_theme(app, "light" if name == "light" else "dark")
            self._store.save_theme(self.theme)
            self._menus.show_theme(self.theme)
            self.theme_changed.emit(self.theme)

    def reset_layout(self) -> None:
        """Put all panels back to where they are at a first start."""
        if self._workspaces is not None:
            self._workspaces.reset()
            return
        self._store.reset(self)
        hide_stale_tab_bars(self)

    def _on_message_clicked(self) -> None:
        in_drawer = self._drawer is not None and LOG_TITLE in self._drawer.titles
        if in_drawer or LOG_TITLE in self._docks:
            self.raise_panel(LOG_TITLE)

    def _size_panels(self) -> None:
        """Give log and console a sixth of the height, and the others what was asked for."""
        bottom = {
            dock: self.dockWidgetArea(dock) == Area.BottomDockWidgetArea
            for dock in self._docks.values()
        }
        height = max(_BOTTOM_LEAST_PX, self.height() // 6)
        # Those above are named, too: Qt shares out anew only among the docks it is given.
        heights = [height if below else self.height() - height for below in bottom.values()]
        self.resizeDocks(list(bottom), heights, Qt.Orientation.Vertical)
        for titles, shares, direction in self._shares:
            room = self.height() - height if direction is Run.Vertical else self.width()
            lengths = [room * share // sum(shares) for share in shares]
            self.resizeDocks([self._docks[title] for title in titles], lengths, direction)

    def _on_theme_requested(self) -> None:
        self.set_theme("light" if self.theme == "dark" else "dark")

    @override
    def showEvent(self, event: QShowEvent) -> None:
        if not self._restored:
            self._restored = True
            app = QApplication.instance()
            if isinstance(app, QApplication):  # not before: making the panels makes many events
                self._guards = (WheelGuard(app, self), DialogFitter(app, self))
            fit_to_screen(self)
            if self._workspaces is not None:
                self._store.restore_geometry(self)
                self._workspaces.restore()
            else:
                self._size_panels()
                self._store.remember_default(self)
                self._store.restore(self)
            fit_to_screen(self)
            QTimer.singleShot(0, self, self._after_first_show)
        super().showEvent(event)

    def _after_first_show(self) -> None:
        hide_stale_tab_bars(self)
        self._fit()  # now that the desktop has put its frame round it
        self.windowHandle().screenChanged.connect(self._on_screen_changed)
        for screen in QGuiApplication.screens():
            screen.availableGeometryChanged.connect(self._on_screen_changed)

    def _on_screen_changed(self) -> None:
        QTimer.singleShot(0, self, self._fit)  # Qt places it there first

    def _fit(self) -> None:
        if self._workspaces is not None:
            limit_to_least(self, LEAST_SIZE)
        fit_to_screen(self)

    @override
    def focusNextPrevChild(self, next: bool) -> bool:
        """Go on to what is in sight: Qt takes panels behind others for visible."""
        met = {QApplication.focusWidget()}
        while super().focusNextPrevChild(next):
            now = QApplication.focusWidget()
            if now in met or now is None or not self._is_behind(now):
                return True
            met.add(now)
        return False

    def _is_behind(self, widget: QWidget) -> bool:
        holder: QWidget | None = widget
        while holder is not None and not isinstance(holder, QDockWidget):
            holder = holder.parentWidget()
        return holder is not None and holder.visibleRegion().isEmpty()

    @override
    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        if self._workspaces is not None and self._restored:
            QTimer.singleShot(0, self._workspaces, self._workspaces.fit)

    @override
    def closeEvent(self, event: QCloseEvent) -> None:
        self._store.save(self, self.theme)
        if self._workspaces is not None:
            self._workspaces.save()
        self.closing.emit()
        super().closeEvent(event)
