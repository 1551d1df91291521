"""Tab bars that Qt leaves behind when docks change their places before the window is shown."""

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QDockWidget, QMainWindow, QTabBar


def hide_stale_tab_bars(window: QMainWindow) -> None:
    """Hide the tab bars that belong to no group of docks as it is now.

    Qt 6 keeps the bar of an earlier arrangement visible, over or below the one in use. Of several
    for one group the one made last is in use.
    """
    docks = window.findChildren(QDockWidget)
    wanted = {
        frozenset(each.windowTitle() for each in (dock, *window.tabifiedDockWidgets(dock)))
        for dock in docks
    }
    bars = window.findChildren(QTabBar, options=Qt.FindChildOption.FindDirectChildrenOnly)
    for bar in reversed(bars):
        group = frozenset(bar.tabText(index).replace("&", "") for index in range(bar.count()))
        if group in wanted:
            wanted.remove(group)
        else:
            bar.hide()
