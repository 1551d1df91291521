"""What is written over the scene is written whole or not at all."""

import numpy as np
import pytest
from PySide6.QtCore import QPointF, QRect
from PySide6.QtGui import QColor, QImage, QPainter
from pytestqt.qtbot import QtBot

from cosmic.frame.gui.palette import DARK
from cosmic.mico.core.collision.answer import Approach
from cosmic.mico.gui.scene.annotations import draw_annotations, draw_measured, draw_plate
from cosmic.mico.gui.scene.content import Pair, SceneContent


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


@pytest.mark.parametrize("corner", [(30.0, 120.0), (150.0, 125.0)], ids=["directions", "scale"])
def test_the_number_of_the_nearest_pair_lies_over_directions_and_scale(
    qtbot: QtBot, corner: tuple[float, float]
) -> None:
    places = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0))
    pair = Approach(("left", "plate"), 312.0, places, margin_um=50.0)
    content = SceneContent()
    content.nearest = Pair.of(pair)

    def project(points: np.ndarray) -> np.ndarray:
        return np.array([corner] * len(points))

    alone, whole = (QImage(190, 140, QImage.Format.Format_RGB32) for _ in range(2))
    box = QRect(int(corner[0]) + 17, int(corner[1]) - 20, 20, 14)  # within its plate
    for image in (alone, whole):
        image.fill(QColor("black"))
        painter = QPainter(image)
        if image is whole:
            draw_measured(painter, content, project, np.eye(3), 10.0, DARK)
        else:
            draw_annotations(painter, content, project, DARK)
        painter.end()
    near = [
        abs(QColor(alone.pixel(x, y)).lightness() - QColor(whole.pixel(x, y)).lightness())
        for x in range(box.left(), box.right())
        for y in range(box.top(), min(box.bottom(), 139))
    ]
    assert max(near) < 40, "only what shines through its ground differs"
