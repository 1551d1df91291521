"""A label stands beside what it names, and covers no other."""

from collections.abc import Iterator

import pytest
from PySide6.QtCore import QPointF, QRectF
from PySide6.QtGui import QImage, QPainter
from pytestqt.qtbot import QtBot

from cosmic.vico.gui.ink import WHITE, label

ROOM = QRectF(0.0, 0.0, 600.0, 430.0)
TEXT = "over 2026 um, width 101.1 um\ngoes on out of the image"


@pytest.fixture
def painter(qtbot: QtBot) -> Iterator[QPainter]:
    image = QImage(600, 430, QImage.Format.Format_RGB32)
    made = QPainter(image)
    yield made
    made.end()


def away(box: QRectF, point: QPointF) -> float:
    """Return how far a label is from what it names."""
    nearest = QPointF(
        min(max(point.x(), box.left()), box.right()), min(max(point.y(), box.top()), box.bottom())
    )
    off = nearest - point
    return float((off.x() ** 2 + off.y() ** 2) ** 0.5)


def test_labels_of_fibres_close_together_stay_at_their_fibres(painter: QPainter) -> None:
    points = [QPointF(560.0, 200.0 + 36.0 * row) for row in range(4)] + [QPointF(400.0, 185.0)]
    boxes: list[QRectF] = []
    for point in points:
        boxes.append(label(painter, point, TEXT, WHITE, ROOM, gap=14.0, taken=tuple(boxes)))
    assert max(away(*each) for each in zip(boxes, points, strict=True)) < 60.0
    for index, box in enumerate(boxes):
        assert ROOM.contains(box)
        assert not any(box.intersects(other) for other in boxes[:index])


def test_a_label_alone_stands_above_and_right_of_its_point(painter: QPainter) -> None:
    box = label(painter, QPointF(100.0, 200.0), "left", WHITE, ROOM)
    assert box.left() > 100.0
    assert box.bottom() < 200.0
