"""Workspaces: one window, laid out by task; each keeps the panels as the operator left them."""

import zlib
from dataclasses import dataclass
from functools import partial
from typing import Final

from PySide6.QtCore import QByteArray, QObject, QSettings, QSize, Qt, QTimer, Signal
from PySide6.QtGui import QAction
from PySide6.QtWidgets import QDockWidget, QMainWindow

from cosmic.frame.gui.application_events import at_one_go
from cosmic.frame.gui.tab_bars import is_in_front

Area = Qt.DockWidgetArea
_GROUP: Final = "workspaces"
_LAYOUT: Final = f"{_GROUP}/layout"
_SHOWN: Final = f"{_GROUP}/shown"
_PANELS: Final = " panels"
USUAL: Final = "usual"
"""The layout that a window opens with until another one was named."""


@dataclass(frozen=True, slots=True)
class PanelPlacement:
    """Where a panel stands in a workspace at a first start.

    Attributes
    ----------
    title : str
        The panel's.
    area : Qt.DockWidgetArea
        The side of the window.
    below, tabbed : str
        Title of a panel that it stands below, or shares its place with.
    share : float
        Part of the window's width, 0 to 1; 0 leaves it to Qt.
    least_px, most_px : int
        Bounds of that width. One that shares its place makes it as wide as its `least_px` while it
        is in front, where the window has room for that.
    height_px : int
        Its height; 0 leaves it to Qt.
    shown : bool
        It is there at a first start; else it comes when it is asked for.
    """

    title: str
    area: Area = Area.LeftDockWidgetArea
    below: str = ""
    tabbed: str = ""
    share: float = 0.0
    least_px: int = 0
    most_px: int = 10_000
    height_px: int = 0
    shown: bool = True

    def width_px(self, window_px: int) -> int:
        """Return how wide it is in a window of that width."""
        return min(self.most_px, max(self.least_px, round(self.share * window_px)))


@dataclass(frozen=True, slots=True)
class Workspace:
    """What one task needs.

    Attributes
    ----------
    name : str
        Stands on its button.
    tip : str
        What it is for.
    placements : tuple of PanelPlacement
        Its panels; those of a shared place: the first is in front.
    middle : bool
        The middle of the window, with image and scene, is part of it.
    """

    name: str
    tip: str
    placements: tuple[PanelPlacement, ...]
    middle: bool = False


@dataclass(frozen=True, slots=True)
class _Kept:
    """A workspace as the operator left it: Qt's state, and the panels that have a place in it.

    Qt gives every panel a place that its state does not name, and shows it.
    """

    state: QByteArray
    panels: tuple[str, ...]


MOST_PART: Final = 2.6
"""Times as wide as a panel the window is at least where that is given more room."""


class Workspaces(QObject):
    """Lays the docks of a window out for the task in hand; GUI thread.

    A layout is named: what is docked, floats and is hidden in every workspace. The one in use is
    kept for the next start.

    Parameters
    ----------
    window : QMainWindow
        Whose docks they are; its central widget is the middle.
    settings : QSettings
        Where layouts are kept.

    Signals
    -------
    chosen(str)
        Another workspace is shown.
    """

    chosen = Signal(str)

    def __init__(self, window: QMainWindow, settings: QSettings) -> None:
        super().__init__(window)
        self._window = window
        self._settings = settings
        self._known: dict[str, Workspace] = {}
        self._docks: dict[str, QDockWidget] = {}
        self._states: dict[str, _Kept] = {}
        self._fronts: dict[str, tuple[str, ...]] = {}
        self._altered = False
        self._laying = False
        self._current = ""
        self._layout = str(settings.value(_LAYOUT, USUAL)) or USUAL

    def add_dock(self, dock: QDockWidget) -> None:
        """Take a panel in; it is shown where a workspace has a place for it."""
        self._docks[dock.windowTitle()] = dock
        self._window.removeDockWidget(dock)
        action: QAction = dock.toggleViewAction()
        action.triggered.connect(self._on_toggled)
        dock.topLevelChanged.connect(self._on_altered)
        dock.dockLocationChanged.connect(self._on_altered)
        dock.visibilityChanged.connect(self._on_seen)

    def add(self, workspace: Workspace) -> None:
        """Add a workspace; the order is that of the buttons."""
        self._known[workspace.name] = workspace

    @property
    def all(self) -> tuple[Workspace, ...]:
        """All of them, in order."""
        return tuple(self._known.values())

    @property
    def current(self) -> str:
        """Name of the one that is shown; empty before the first."""
        return self._current

    def holder_of(self, title: str) -> str:
        """Return the workspace that has a place for a panel: the one shown, if it has."""
        names = [self._current, *self._known] if self._current else list(self._known)
        for name in names:
            if any(placement.title == title for placement in self._known[name].placements):
                return name
        return ""

    def choose(self, name: str) -> None:
        """Show a workspace; the one before keeps its panels as they are."""
        if name == self._current or name not in self._known:
            return
        self._keep()
        with at_one_go(self._window):
            self._show(name)
            self.chosen.emit(name)
            self.fit()

    def bring(self, title: str) -> None:
        """Show a panel in front, in the workspace that has a place for it."""
        dock = self._docks.get(title)
        if dock is None:
            return
        holder = self.holder_of(title)
        if not dock.isFloating() and holder != self._current and self._is_placed(dock):
            holder = ""  # the operator put it here
        if holder:
            self.choose(holder)
        self._place_lost(dock)
        dock.show()
        dock.raise_()

    def _is_placed(self, dock: QDockWidget) -> bool:
        return self._window.dockWidgetArea(dock) != Area.NoDockWidgetArea

    def restore(self) -> None:
        """Show what was shown last."""
        self._load()
        last = str(self._settings.value(_SHOWN, ""))
        self._current = ""
        self._show(last if last in self._known else next(iter(self._known)))
        self.chosen.emit(self._current)

    def save(self) -> None:
        """Keep the layout in use for the next start."""
        self._keep()
        self._store(self._layout)
        self._settings.setValue(_SHOWN, self._current)
        self._settings.sync()

    def reset(self) -> None:
        """Put the panels of every workspace back to where they are at a first start.

        What was kept under a name stays, and can be used again.
        """
        self._states.clear()
        self._fronts.clear()
        self._layout = USUAL
        self._settings.setValue(_LAYOUT, USUAL)
        self._settings.remove(f"{_GROUP}/layouts/{USUAL}")
        name, self._current = self._current, ""
        self._show(name)

    # Layouts by name

    @property
    def layouts(self) -> tuple[str, ...]:
        """Names of the layouts that were kept."""
        self._settings.beginGroup(f"{_GROUP}/layouts")
        names = (name for name in self._settings.childGroups() if name != USUAL)
        self._settings.endGroup()
        return (USUAL, *names)

    @property
    def layout_name(self) -> str:
        """Name of the layout in use."""
        return self._layout

    def save_as(self, name: str) -> None:
        """Keep the layout in use under a name, and use that from now on."""
        self._keep()
        self._layout = name
        self._store(name)
        self._settings.setValue(_LAYOUT, name)

    def use(self, name: str) -> None:
        """Lay the panels out as they were kept under a name."""
        self._keep()
        self._store(self._layout)
        self._layout = name
        self._settings.setValue(_LAYOUT, name)
        self._load()
        shown, self._current = self._current, ""
        self._show(shown)

    def _store(self, layout: str) -> None:
        self._settings.setValue(f"{_GROUP}/layouts/{layout}/kept", True)  # as at a first start, too
        for name, kept in self._states.items():
            key = f"{_GROUP}/layouts/{layout}/{name}"
            self._settings.setValue(key, kept.state)
            self._settings.setValue(key + _PANELS, "\n".join(kept.panels))

    def _load(self) -> None:
        self._states.clear()
        self._fronts.clear()
        for name in self._known:
            key = f"{_GROUP}/layouts/{self._layout}/{name}"
            state, panels = self._settings.value(key), self._settings.value(key + _PANELS)
            if isinstance(state, QByteArray) and isinstance(panels, str):
                self._states[name] = _Kept(state, tuple(panels.split("\n")))

    # Laying out

    def _keep(self) -> None:
        """Keep which panels are in front, and all as they are where the operator moved some."""
        if self._current:
            self._fronts[self._current] = tuple(
                name for name, dock in self._docks.items() if is_in_front(self._window, dock)
            )
        if self._current and (self._altered or self._missing()):
            panels = tuple(name for name, dock in self._docks.items() if self._is_placed(dock))
            self._states[self._current] = _Kept(self._window.saveState(self._version), panels)

    def _missing(self) -> bool:
        """Tell whether a panel was hidden that has its place here."""
        docks = (self._docks.get(each.title) for each in self._known[self._current].placements)
        placed = [dock for dock in docks if dock is not None and self._is_placed(dock)]
        return any(dock.isHidden() for dock in placed)

    def _on_altered(self) -> None:
        if not self._laying:
            self._altered = True

    @property
    def _version(self) -> int:
        """A number for the panels there are: an old layout tears them apart from a new one."""
        names = "\n".join(sorted(self._docks))
        return zlib.crc32(names.encode()) & 0x7FFFFFFF

    def _show(self, name: str) -> None:
        window, workspace, docks = self._window, self._known[name], self._docks.values()
        size = window.size()
        window.setUpdatesEnabled(False)
        self._laying = True
        self._current = name
        for dock in docks:
            if not dock.isFloating():
                window.removeDockWidget(dock)
            else:
                dock.hide()
        middle = window.centralWidget()
        if middle is not None:
            middle.setVisible(workspace.middle)
        kept = self._states.get(name)
        # Qt brings a layout back at the size it was kept at, and makes the window as large; it
        # may be larger than the screen by now.
        self._altered = kept is not None and window.restoreState(kept.state, self._version)
        for title, dock in self._docks.items():
            if kept is not None and title not in kept.panels and not dock.isFloating():
                window.removeDockWidget(dock)
            if not dock.isFloating() and not self._is_placed(dock):
                dock.hide()
        if not self._altered or not _within(window.minimumSizeHint(), window.size()):
            self._altered = False
            self._arrange(workspace)
        self._laying = False
        self._lay_out()  # else the least size is still that of the layout kept
        window.resize(size)
        window.setUpdatesEnabled(True)
        QTimer.singleShot(0, self, self.fit)

    def _lay_out(self) -> None:
        layout = self._window.layout()
        if layout is not None:
            layout.invalidate()
            layout.activate()

    def _arrange(self, workspace: Workspace) -> None:
        window, docks = self._window, self._docks
        for dock in docks.values():
            dock.setFloating(False)
            window.removeDockWidget(dock)
        fronts: list[QDockWidget] = []
        for placement in workspace.placements:
            if placement.title not in docks or not placement.shown:
                continue
            dock = docks[placement.title]
            if placement.tabbed in docks:
                window.tabifyDockWidget(docks[placement.tabbed], dock)
            elif placement.below in docks:
                window.splitDockWidget(docks[placement.below], dock, Qt.Orientation.Vertical)
            else:
                window.addDockWidget(placement.area, dock)
            if not placement.tabbed:
                fronts.append(dock)
            dock.show()
        kept = (docks[title] for title in self._fronts.get(workspace.name, ()))
        for dock in (*fronts, *(dock for dock in kept if self._is_placed(dock))):
            dock.raise_()
        self._size(workspace)

    def _size(self, workspace: Workspace) -> None:
        sized = [each for each in workspace.placements if each.share and each.title in self._docks]
        self._window.resizeDocks(
            [self._docks[each.title] for each in sized],
            [self._width_px(each, workspace) for each in sized],
            Qt.Orientation.Horizontal,
        )
        high = [
            each for each in workspace.placements if each.height_px and each.title in self._docks
        ]
        self._window.resizeDocks(
            [self._docks[each.title] for each in high],
            [each.height_px for each in high],
            Qt.Orientation.Vertical,
        )

    def _width_px(self, placement: PanelPlacement, workspace: Workspace) -> int:
        """Return how wide a place is: as the panel in front of it needs, where there is room."""
        room_px = self._window.width()
        width_px = placement.width_px(room_px)
        for each in workspace.placements:
            dock = self._docks.get(each.title)
            fits = each.tabbed == placement.title and room_px >= MOST_PART * each.least_px
            if fits and dock is not None and is_in_front(self._window, dock):
                width_px = max(width_px, each.least_px)
        return width_px

    def fit(self) -> None:
        """Give the columns the width that they have in a window of this size."""
        workspace = self._known.get(self._current)
        if workspace is not None:
            self._size(workspace)

    def _place_lost(self, dock: QDockWidget) -> None:
        """Give a panel that no side of the window has its place, or one at the right."""
        if dock.isFloating() or self._is_placed(dock):
            return
        placements = self._known[self._current].placements if self._current else ()
        placement = next((each for each in placements if each.title == dock.windowTitle()), None)
        beside = self._docks.get(placement.tabbed) if placement is not None else None
        if beside is not None and self._is_placed(beside):
            self._window.tabifyDockWidget(beside, dock)
        else:
            area = placement.area if placement is not None else Area.RightDockWidgetArea
            self._window.addDockWidget(area, dock)

    def _on_seen(self, seen: bool) -> None:
        """Give a panel that comes to the front of its place room, once it is laid out."""
        dock = self.sender()
        if seen and not self._laying and isinstance(dock, QDockWidget):
            QTimer.singleShot(0, self, partial(self._make_room, dock.windowTitle()))

    def _make_room(self, title: str) -> None:
        workspace, dock = self._known.get(self._current), self._docks[title]
        placements = workspace.placements if workspace is not None else ()
        placement = next((each for each in placements if each.title == title), None)
        if placement is None or dock.isFloating() or not dock.isVisible():
            return
        beside = [each.least_px for each in placements if each.tabbed == title and each.least_px]
        too_wide = not placement.tabbed and beside and dock.width() >= min(beside)
        if too_wide or dock.width() < placement.least_px:
            self.fit()

    def _on_toggled(self, shown: bool) -> None:
        self._altered = True
        action = self.sender()
        for dock in self._docks.values():
            if shown and dock.toggleViewAction() is action:
                self._place_lost(dock)
                dock.raise_()
                QTimer.singleShot(0, self, self.fit)


def _within(least: QSize, room: QSize) -> bool:
    return least.width() <= room.width() and least.height() <= room.height()
