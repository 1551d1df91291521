"""STOP is on the screen, however small that is and whatever was kept from a larger one."""

from collections.abc import Callable

import pytest
from PySide6.QtCore import QPoint, QRect, QSettings, QSize, Qt
from PySide6.QtWidgets import QApplication, QDialog, QDockWidget, QScrollArea, QToolButton, QWidget
from pytestqt.qtbot import QtBot

from cosmic.frame.gui import screen_fit
from cosmic.frame.gui.server_gui import CosmicServerGui
from cosmic.frame.gui.stop_button import StopButton
from gui.app.windows import Make, mico
from gui.mico.panels import part

SMALL = QRect(0, 0, 1024, 600)
Screen = Callable[[QRect], None]


@pytest.fixture
def screen(monkeypatch: pytest.MonkeyPatch) -> Screen:
    """Give the room that windows may cover, in logical pixels."""

    def be(room: QRect) -> None:
        monkeypatch.setattr(screen_fit, "room_for", lambda _window: room)

    return be


def on(room: QRect, window: QWidget) -> bool:
    """Return whether a window, with its frame, is on the screen."""
    return room.contains(window.frameGeometry())


def stop_is_seen(window: QWidget, room: QRect) -> bool:
    bar = window.top_bar if isinstance(window, CosmicServerGui) else window
    stop = bar.findChild(StopButton)
    place = QRect(stop.mapToGlobal(QPoint(0, 0)), stop.size())
    return stop.isVisible() and room.contains(place) and not stop.visibleRegion().isEmpty()


@pytest.mark.parametrize(
    "room",
    [QRect(0, 0, 1280, 720), QRect(0, 0, 1366, 768), SMALL],
    ids=["1920x1080 at 150 %", "1366x768", "1024x600"],
)
def test_the_window_opens_no_larger_than_the_screen_and_shows_stop(
    make: Make, qtbot: QtBot, screen: Screen, room: QRect
) -> None:
    screen(room)
    window = make(applications=("mico", "daqco", "vico"), hardware=False, size=(2040, 1137))
    qtbot.waitUntil(lambda: on(room, window), timeout=5000)
    assert stop_is_seen(window, room)


def test_the_workspaces_are_made_no_smaller_than_they_fit_into(
    make: Make, qtbot: QtBot, screen: Screen
) -> None:
    screen(QRect(0, 0, 1920, 1080))
    window = make(applications=("mico", "daqco", "vico"), hardware=False, size=(1366, 768))
    qtbot.waitUntil(lambda: window.minimumSize() == QSize(1024, 600), timeout=5000)
    window.resize(600, 300)
    assert window.size() == QSize(1024, 600)
    tiny = QRect(0, 0, 900, 500)
    screen(tiny)  # another resolution: STOP is seen on that one, too
    window.screen().availableGeometryChanged.emit(tiny)
    qtbot.waitUntil(lambda: on(tiny, window), timeout=5000)
    assert stop_is_seen(window, tiny)


@pytest.mark.parametrize("application", ["mico", "daqco", "vico"])
def test_a_stand_alone_window_fits_a_small_screen(
    make: Make, qtbot: QtBot, screen: Screen, application: str
) -> None:
    screen(SMALL)
    window = make(applications=(application,), hardware=False, size=(2040, 1137))
    qtbot.waitUntil(lambda: on(SMALL, window), timeout=5000)
    assert stop_is_seen(window, SMALL)


def test_on_a_small_screen_every_card_shows_the_button_that_halts_its_axis(
    make: Make, qtbot: QtBot, screen: Screen
) -> None:
    screen(SMALL)
    window = make(hardware=False, size=(2040, 1137))
    qtbot.waitUntil(lambda: on(SMALL, window), timeout=5000)
    dock = window.dock("Axes")
    areas = [each for each in dock.findChildren(QScrollArea) if each.isVisible()]
    qtbot.waitUntil(lambda: not any(each.horizontalScrollBar().maximum() for each in areas))
    for card in mico(window).cards.values():
        halt = part(card, "stopAxis", QToolButton)
        for area in areas:
            left_px = halt.mapTo(area.viewport(), QPoint(0, 0)).x()
            assert 0 <= left_px <= area.viewport().width() - halt.width(), card.objectName()


def test_a_kept_layout_of_a_larger_screen_is_fitted_with_what_floats(
    make: Make, qtbot: QtBot, screen: Screen, stored: QSettings
) -> None:
    large = QRect(0, 0, 3840, 2160)
    screen(large)
    before = make(hardware=False, size=(2800, 1700))
    before.move(900, 300)
    dock = before.dock("Scene")
    dock.setFloating(True)
    dock.setGeometry(2500, 1500, 1200, 600)
    QApplication.processEvents()
    before.close()
    screen(SMALL)
    window = make(hardware=False, size=(2800, 1700))
    scene = window.dock("Scene")
    assert scene.isFloating()
    for each in (window, scene):
        qtbot.waitUntil(lambda each=each: on(SMALL, each), timeout=5000)
        assert stop_is_seen(each, SMALL)


def test_a_dialog_opens_inside_the_screen(qtbot: QtBot, screen: Screen, stored: QSettings) -> None:
    screen(SMALL)
    window = CosmicServerGui(stored)
    qtbot.addWidget(window)
    window.show()
    dialog = QDialog(window)
    dialog.resize(1500, 900)
    dialog.move(800, 500)
    dialog.show()
    qtbot.waitUntil(lambda: on(SMALL, dialog), timeout=5000)


def test_stop_keeps_its_position_when_the_bar_has_much_to_say(
    qtbot: QtBot, screen: Screen, stored: QSettings
) -> None:
    screen(SMALL)
    window = CosmicServerGui(stored)
    qtbot.addWidget(window)
    bar = window.top_bar
    bar.set_unwatched([f"left.axis_with_a_long_name_{number}" for number in range(5)])
    bar.set_contacts([f"grip_a_fibre_with_the_left_{number}" for number in range(5)])
    bar.set_message("something went wrong " * 20)
    bar.set_latched("the force of the probe crossed its limit " * 10)
    window.show()
    qtbot.waitUntil(lambda: on(SMALL, window), timeout=5000)
    assert stop_is_seen(window, SMALL)


def test_no_panel_forces_the_window_beyond_a_small_screen(make: Make) -> None:
    window = make(applications=("mico", "daqco", "vico"), hardware=False)
    least = window.minimumSizeHint()
    assert least.width() <= 1024
    assert least.height() <= 568
    for dock in window.findChildren(QDockWidget):
        dock.show()
        dock.raise_()
    window.set_failed("Axes", "a long reason why the device cannot be reached " * 5)
    QApplication.processEvents()
    assert window.minimumSizeHint().width() <= 1024
    assert all(each.minimumSizeHint().height() <= 568 for each in window.findChildren(QDockWidget))
    assert Qt.DockWidgetArea.LeftDockWidgetArea == window.dockWidgetArea(window.dock("Axes"))
