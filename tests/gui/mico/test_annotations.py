"""What is written over the scene is written whole or not at all."""

import pytest
from PySide6.QtCore import QPointF, QRect
from PySide6.QtGui import QColor, QImage, QPainter
from pytestqt.qtbot import QtBot

from cosmic.frame.gui.palette import DARK
from cosmic.mico.gui.scene.annotations import draw_plate


@pytest.mark.parametrize(("width", "written"), [(40, False), (120, True)])
def test_a_number_that_would_be_cut_off_is_left_out(
    qtbot: QtBot, width: int, written: bool
) -> None:
    image = QImage(300, 100, QImage.Format.Format_RGB32)
    image.fill(QColor("black"))
    before = image.copy()
    painter = QPainter(image)
    painter.setClipRect(QRect(100, 0, width, 100))
    draw_plate(painter, QPointF(90.0, 30.0), "114 µm", DARK, QColor("white"))
    painter.end()
    assert (image != before) is written
