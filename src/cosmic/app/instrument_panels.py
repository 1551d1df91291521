"""Where the panels of vision and acquisition stand at a first start."""

from typing import Final

from PySide6.QtCore import Qt

from cosmic.daqco.gui.main_widget import UDaqMainWidget
from cosmic.frame.gui.server_gui import CosmicServerGui
from cosmic.vico.gui.vico_gui import VicoGui

DAQCO: Final = "DAQCo"
LENS: Final = "Lens and light"
_SHARES: Final = [3, 2]
"""How picture and force share their column."""


def add_vision(window: CosmicServerGui, gui: VicoGui, scene: str, *, low: bool) -> str:
    """Put the first camera beside the scene, the others behind it, the lens below.

    Returns the title of the first camera's panel; "" where there is none.
    """
    first = ""
    for view in gui.cameras.values():
        if not first:
            area = Qt.DockWidgetArea.RightDockWidgetArea
            window.add_panel(view.windowTitle(), view, area, scroll=False)
            first = view.windowTitle()
            if scene:  # the picture stands between the actuators and the scene
                way = Qt.Orientation.Horizontal
                window.splitDockWidget(window.dock(first), window.dock(scene), way)
        else:
            window.add_panel(view.windowTitle(), view, scroll=False, beside=first, tabbed=True)
    if first:
        if scene:
            window.add_panel(LENS, gui.lens, below=scene, tabbed=low)
        else:
            window.add_panel(LENS, gui.lens, beside=first)
            docks = [window.dock(first), window.dock(LENS)]
            window.resizeDocks(docks, [3, 1], Qt.Orientation.Horizontal)
        window.dock(first).raise_()
        if scene:
            window.dock(scene).raise_()
    return first


def add_force(window: CosmicServerGui, gui: UDaqMainWidget, above: str, *, low: bool) -> None:
    """Put the force below the picture; in a tab with it where the screen is low."""
    area = Qt.DockWidgetArea.RightDockWidgetArea
    window.add_panel(DAQCO, gui, area, scroll=False, below=above, tabbed=low and bool(above))
    if above:
        docks = [window.dock(above), window.dock(DAQCO)]
        window.resizeDocks(docks, _SHARES, Qt.Orientation.Vertical)
        window.dock(above).raise_()
    gui.close_requested.connect(window.dock(DAQCO).close)
