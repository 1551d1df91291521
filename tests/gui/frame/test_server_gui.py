import pytest
from PySide6.QtCore import QByteArray, QSettings, QSize, Qt
from PySide6.QtGui import QAction
from PySide6.QtWidgets import (
    QAbstractButton,
    QApplication,
    QComboBox,
    QLabel,
    QLineEdit,
    QMenuBar,
    QPushButton,
    QScrollArea,
    QTabBar,
    QVBoxLayout,
    QWidget,
)
from pytestqt.qtbot import QtBot

from cosmic.frame.failure import FailurePolicy
from cosmic.frame.gui.console_panel import ConsolePanel
from cosmic.frame.gui.keys_dialog import KeysDialog
from cosmic.frame.gui.log_panel import LogPanel
from cosmic.frame.gui.quantity_field import QuantityField
from cosmic.frame.gui.server_gui import CosmicServerGui
from cosmic.frame.gui.stop_button import StopButton
from cosmic.frame.log import RingBufferHandler

LEFT = Qt.MouseButton.LeftButton
AREA = Qt.DockWidgetArea


def panel(rows: int = 3) -> QWidget:
    panel = QWidget()
    column = QVBoxLayout(panel)
    for _ in range(rows):
        column.addWidget(QuantityField("um", name="target"))
    return panel


def fill(gui: CosmicServerGui) -> None:
    gui.add_panel("MiCo", panel(30))
    gui.add_panel("Picture", QLabel("live"), AREA.RightDockWidgetArea, scroll=False)
    gui.add_panel("Log", LogPanel(RingBufferHandler()), AREA.BottomDockWidgetArea, scroll=False)


def show(qtbot: QtBot, gui: CosmicServerGui, size: tuple[int, int] = (1366, 768)) -> None:
    gui.resize(*size)
    with qtbot.waitExposed(gui):
        gui.show()


def action(gui: CosmicServerGui, text: str) -> QAction:
    return next(a for a in gui.findChildren(QAction) if a.text().replace("&", "") == text)


def test_panels_are_hosted_in_docks_that_the_view_menu_toggles(
    qtbot: QtBot, gui: CosmicServerGui
) -> None:
    fill(gui)
    show(qtbot, gui)
    assert gui.dock("MiCo").isVisible()
    action(gui, "MiCo").trigger()
    assert not gui.dock("MiCo").isVisible()
    gui.raise_panel("MiCo")
    assert gui.dock("MiCo").isVisible()


@pytest.mark.parametrize("size", [(1366, 768), (1280, 720), (1920, 1080)])
def test_nothing_is_clipped(qtbot: QtBot, gui: CosmicServerGui, size: tuple[int, int]) -> None:
    fill(gui)
    gui.top_bar.set_rate(20.0, 18.7)
    gui.top_bar.set_message("a very long message " * 30)
    show(qtbot, gui, size)
    assert gui.minimumSizeHint().width() <= size[0]
    assert gui.minimumSizeHint().height() <= size[1]
    assert gui.size() == QSize(*size)
    for label in gui.top_bar.findChildren(QAbstractButton):
        if label.isVisible():
            assert label.width() >= label.sizeHint().width()
    area = gui.dock("MiCo").findChildren(QScrollArea)[0]
    assert area.viewport().width() >= gui.dock("MiCo").panel.minimumSizeHint().width()


def test_stop_is_in_the_bar_and_in_every_panel_that_floats(
    qtbot: QtBot, gui: CosmicServerGui
) -> None:
    fill(gui)
    show(qtbot, gui)
    bar_stop = gui.top_bar.findChildren(StopButton)[0]
    with qtbot.waitSignal(gui.stop_requested):
        qtbot.mousePress(bar_stop, LEFT)
    dock = gui.dock("MiCo")
    stop = dock.findChildren(StopButton)[0]
    assert not stop.isVisible()
    dock.setFloating(True)
    assert stop.isVisible()
    assert stop.height() >= 48
    with qtbot.waitSignal(gui.stop_requested):
        qtbot.mousePress(stop, LEFT)
    dock.setFloating(False)
    assert not stop.isVisible()


def test_the_layout_and_the_theme_are_back_at_the_next_start(
    qtbot: QtBot, settings: QSettings
) -> None:
    first = CosmicServerGui(settings)
    qtbot.addWidget(first)
    fill(first)
    show(qtbot, first, (790, 640))
    first.addDockWidget(AREA.RightDockWidgetArea, first.dock("MiCo"))
    first.dock("Log").hide()
    first.set_theme("light")
    first.close()

    second = CosmicServerGui(QSettings(settings.fileName(), QSettings.Format.IniFormat))
    qtbot.addWidget(second)
    fill(second)
    with qtbot.waitExposed(second):
        second.show()
    assert second.theme == "light"
    assert second.dockWidgetArea(second.dock("MiCo")) == AREA.RightDockWidgetArea
    assert not second.dock("Log").isVisible()
    assert second.size() == QSize(790, 640)
    action(second, "Reset layout").trigger()
    assert second.dockWidgetArea(second.dock("MiCo")) == AREA.LeftDockWidgetArea
    assert second.dock("Log").isVisible()


def test_a_layout_of_other_panels_is_not_used(qtbot: QtBot, settings: QSettings) -> None:
    first = CosmicServerGui(settings)
    qtbot.addWidget(first)
    fill(first)
    show(qtbot, first)
    first.addDockWidget(AREA.RightDockWidgetArea, first.dock("MiCo"))
    first.close()

    second = CosmicServerGui(QSettings(settings.fileName(), QSettings.Format.IniFormat))
    qtbot.addWidget(second)
    fill(second)
    second.add_panel("New", QLabel("of this version"), beside="MiCo", tabbed=True)
    show(qtbot, second)
    assert second.dockWidgetArea(second.dock("MiCo")) == AREA.LeftDockWidgetArea
    assert second.tabifiedDockWidgets(second.dock("MiCo")) == [second.dock("New")]


@pytest.mark.parametrize(
    "damaged", [QByteArray(b"garbage"), "text", 42, QByteArray(), ["a", "list"]], ids=repr
)
def test_a_damaged_layout_is_ignored(qtbot: QtBot, settings: QSettings, damaged: object) -> None:
    for key in ("window/geometry", "window/docks", "window/theme"):
        settings.setValue(key, damaged)
    settings.sync()
    gui = CosmicServerGui(QSettings(settings.fileName(), QSettings.Format.IniFormat))
    qtbot.addWidget(gui)
    fill(gui)
    show(qtbot, gui)
    assert gui.theme == "dark"
    assert gui.dock("MiCo").isVisible()
    assert gui.dockWidgetArea(gui.dock("Log")) == AREA.BottomDockWidgetArea


def test_the_window_notifies_before_it_closes(qtbot: QtBot, gui: CosmicServerGui) -> None:
    show(qtbot, gui)
    visible: list[bool] = []
    gui.closing.connect(lambda: visible.append(gui.isVisible()))
    action(gui, "Quit").trigger()
    assert visible == [True]
    assert not gui.isVisible()


def test_a_failed_application_is_greyed_says_why_and_can_be_rescanned(
    qtbot: QtBot, gui: CosmicServerGui
) -> None:
    fill(gui)
    show(qtbot, gui)
    gui.set_failed("MiCo", "device 1 is not there: plugged in and powered?")
    dock = gui.dock("MiCo")
    assert not dock.panel.isEnabled()
    texts = [label.text() for label in dock.findChildren(QLabel) if label.isVisible()]
    assert "device 1 is not there: plugged in and powered?" in texts
    rescan = next(b for b in dock.findChildren(QPushButton) if b.text() == "Rescan")
    with qtbot.waitSignal(gui.rescan_requested) as signal:
        qtbot.mouseClick(rescan, LEFT)
    assert signal.args == ["MiCo"]
    gui.clear_failed("MiCo")
    assert dock.panel.isEnabled()
    assert not rescan.isVisible()


def test_f1_lists_the_keys(qtbot: QtBot, gui: CosmicServerGui) -> None:
    gui.set_keys([("F12", "Stop everything"), ("Left", "left.x down while held")])
    show(qtbot, gui)
    gui.activateWindow()
    qtbot.keyClick(gui, Qt.Key.Key_F1)
    dialog = gui.findChildren(KeysDialog)[0]
    assert dialog.isVisible()
    assert dialog.rows()[1] == ("Left", "left.x down while held")
    with qtbot.waitSignal(gui.stop_requested):
        qtbot.mousePress(dialog.findChildren(StopButton)[0], LEFT)
    dialog.close()


def test_a_click_on_the_message_opens_the_log(qtbot: QtBot, gui: CosmicServerGui) -> None:
    fill(gui)
    show(qtbot, gui)
    gui.dock("Log").hide()
    gui.top_bar.message_clicked.emit()
    assert gui.dock("Log").isVisible()


def test_every_interactive_widget_has_a_tooltip(qtbot: QtBot, gui: CosmicServerGui) -> None:
    fill(gui)
    console = ConsolePanel(FailurePolicy())
    gui.add_panel("Console", console, AREA.BottomDockWidgetArea, beside="Log", tabbed=True)
    show(qtbot, gui)
    kinds = (QAbstractButton, QLineEdit, QComboBox)
    widgets = [widget for kind in kinds for widget in gui.findChildren(kind)]
    silent = [w for w in widgets if not w.toolTip() and not w.objectName().startswith("qt_")]
    assert [f"{type(w).__name__} {w.objectName()}" for w in silent if _is_ours(w)] == []
    console.shut_down()


def _is_ours(widget: QWidget) -> bool:
    """Tell Qt's own parts, such as the button that empties a line, from what we put there."""
    parent = widget.parentWidget()
    return not isinstance(parent, (QLineEdit, QComboBox, QMenuBar, QTabBar))


def test_the_theme_button_changes_all_windows(
    qtbot: QtBot, gui: CosmicServerGui, qapp: QApplication
) -> None:
    show(qtbot, gui)
    before = qapp.palette().window().color()
    with qtbot.waitSignal(gui.theme_changed) as signal:
        gui.top_bar.theme_requested.emit()
    assert signal.args == ["light"]
    assert qapp.palette().window().color() != before
    assert action(gui, "Light").isChecked()
