"""All widgets of ViCo together: docks, sizes, themes, and what they leave behind."""

import pytest
from PySide6.QtCore import QSettings
from PySide6.QtWidgets import (
    QAbstractButton,
    QApplication,
    QLineEdit,
    QScrollArea,
    QSlider,
    QSplitter,
)

from cosmic.frame.clock import WALL
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.gui.server_gui import CosmicServerGui
from cosmic.frame.gui.theme import apply_theme
from cosmic.vico.api.application import VicoApplication
from cosmic.vico.core.settings import CameraConfig, VicoSettings
from cosmic.vico.gui.vico_gui import VicoGui, make_vico_gui
from gui.vico.fake_vico import FakeVico, Found, Seen, fibre_image


@pytest.mark.parametrize("theme", ["dark", "light"])
def test_cameras_and_lens_become_docks_of_the_window(own, tmp_path, theme):
    port = FakeVico(tmp_path, ("top", "side"))
    store = QSettings(str(tmp_path / "layout.ini"), QSettings.Format.IniFormat)
    window = CosmicServerGui(store, theme=theme)
    own(window)
    gui = VicoGui(port)
    for name, view in gui.cameras.items():
        window.add_panel(f"Camera {name}", view)
    window.add_panel("Lens", gui.lens)
    window.resize(1366, 768)
    window.show()
    images = {name: port.camera(name).push() for name in gui.cameras}
    for name, view in gui.cameras.items():
        view.window().raise_()
        view.look()
        assert view.view.image is images[name]
    assert gui.lens.camera.isVisibleTo(gui.lens)  # which camera is to become sharp


def test_two_cameras_of_one_title_have_different_panels(own):
    cameras = tuple(CameraConfig(name=name, title="Microscope") for name in ("top", "side"))
    application = VicoApplication(
        lambda _: None,
        lambda: None,
        lambda: None,
        VicoSettings(camera=cameras),
        clock=WALL,
        policy=FailurePolicy(),
    )
    gui = make_vico_gui(application)
    for widget in (*gui.cameras.values(), gui.lens):
        own(widget)
    titles = [view.windowTitle() for view in gui.cameras.values()]
    assert titles == ["Microscope (top)", "Microscope (side)"]


@pytest.mark.parametrize("size", [(900, 700), (560, 400), None])
@pytest.mark.parametrize("opened", [False, True])
def test_nothing_is_clipped_in_a_small_window(qtbot, shown, size, opened):
    if opened:
        shown.recorder.more.click()
    for _ in range(2):
        shown.resize(*size) if size else shown.resize(shown.minimumSizeHint())
        QApplication.processEvents()
    kinds = (QAbstractButton, QLineEdit, QSlider)
    widgets = [each for kind in kinds for each in shown.findChildren(kind) if each.isVisible()]
    assert shown.recorder.snap in widgets
    for widget in (*widgets, *shown.status.readings):
        corner = widget.mapTo(shown, widget.rect().bottomRight())
        assert shown.rect().contains(corner), widget
        assert widget.width() >= widget.minimumSizeHint().width()
    assert shown.view.height() >= 100


def test_in_a_low_dock_the_image_shrinks_before_anything_scrolls(own, shown):
    dock = QScrollArea()
    own(dock)
    dock.setWidgetResizable(True)
    dock.setWidget(shown)
    dock.resize(900, 320)
    dock.show()
    QApplication.processEvents()
    assert dock.verticalScrollBar().maximum() == 0
    shown.row.more.click()
    QApplication.processEvents()
    assert dock.verticalScrollBar().maximum() == 0
    dock.takeWidget()


def test_the_drawer_takes_its_room_from_the_image_and_gives_it_back(qtbot, shown):
    width = shown.view.width()
    shown.row.more.click()
    QApplication.processEvents()
    assert shown.view.width() < width
    assert shown.drawer.widget().sizeHint().width() <= shown.drawer.viewport().width()
    shown.row.more.click()
    QApplication.processEvents()
    assert shown.view.width() == width


def test_the_theme_can_change_under_an_image(qtbot, qapp, shown, camera):
    image = camera.push(fibre_image(800, 600))
    camera.analysis = Found(image, (Seen(),))
    qtbot.waitUntil(lambda: shown.view.image is image)
    dark = shown.grab().toImage()
    apply_theme(qapp, "light")
    QApplication.processEvents()
    light = shown.grab().toImage()
    assert light.pixelColor(2, 2).lightness() > dark.pixelColor(2, 2).lightness() + 100


def test_widgets_that_go_stop_listening(qtbot, port):
    gui, widget = VicoGui(port), QSplitter()
    qtbot.addWidget(widget)
    for each in (*gui.cameras.values(), gui.lens):
        widget.addWidget(each)
    assert port.listened
    widget.deleteLater()
    with qtbot.waitSignal(widget.destroyed):
        pass
    assert port.listened == 0
