"""The tab bars of docks that share a place."""

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QDockWidget, QMainWindow, QTabBar


def hide_stale_tab_bars(window: QMainWindow) -> None:
    """Hide the tab bars that belong to no group of docks as it is now.

    Qt 6 keeps the bar of an earlier arrangement visible, over or below the one in use. Of several
    for one group the one made last is in use.
    """
    placed = [
        dock
        for dock in window.findChildren(QDockWidget)
        if window.dockWidgetArea(dock) != Qt.DockWidgetArea.NoDockWidgetArea
    ]
    wanted = {
        frozenset(each.windowTitle() for each in (dock, *beside))
        for dock in placed
        if (beside := window.tabifiedDockWidgets(dock))
    }
    for bar in reversed(_bars(window)):
        group = frozenset(_titles(bar))
        if group in wanted:
            wanted.remove(group)
        else:
            bar.hide()


def is_in_front(window: QMainWindow, dock: QDockWidget) -> bool:
    """Tell whether a panel is the one that is seen of those that share its place."""
    if not dock.isVisible():
        return False
    title = dock.windowTitle()
    bars = [bar for bar in _bars(window) if bar.isVisible() and title in _titles(bar)]
    return not bars or _titles(bars[-1])[bars[-1].currentIndex()] == title


def _bars(window: QMainWindow) -> list[QTabBar]:
    found: list[QTabBar] = window.findChildren(
        QTabBar, options=Qt.FindChildOption.FindDirectChildrenOnly
    )
    return found


def _titles(bar: QTabBar) -> list[str]:
    return [bar.tabText(index).replace("&", "") for index in range(bar.count())]
