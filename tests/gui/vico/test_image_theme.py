"""What lies beside the image has the colour of the theme, after it was changed as well."""

from PySide6.QtGui import QColor
from PySide6.QtWidgets import QApplication
from pytestqt.qtbot import QtBot

from cosmic.frame.gui.palette import DARK, LIGHT
from cosmic.frame.gui.theme import apply_theme
from cosmic.vico.gui.image_view import CameraImageView


def beside(view: CameraImageView) -> QColor:
    return view.viewport().grab().toImage().pixelColor(3, 3)


def test_the_ground_beside_the_image_follows_the_theme(qtbot: QtBot, qapp: QApplication) -> None:
    apply_theme(qapp, "dark")
    view = CameraImageView()
    qtbot.addWidget(view)
    view.resize(300, 200)
    with qtbot.waitExposed(view):
        view.show()
    assert beside(view) == QColor(DARK.field)
    apply_theme(qapp, "light")
    qtbot.waitUntil(lambda: beside(view) == QColor(LIGHT.field), timeout=1000)
    apply_theme(qapp, "dark")
    qtbot.waitUntil(lambda: beside(view) == QColor(DARK.field), timeout=1000)
    qapp.setStyleSheet("")
