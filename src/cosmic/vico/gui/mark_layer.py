"""The one fibre of those found that is pointed at or worked on, drawn over the image."""

from typing import Final

import numpy as np
from PySide6.QtCore import QPointF
from PySide6.QtGui import QPainter, QPainterPath, QPolygonF

from cosmic.frame.overrides import override
from cosmic.vico.api.camera_shown import Seen
from cosmic.vico.api.coordinate_transform import Pixel
from cosmic.vico.core.vision.fibre import Fibre
from cosmic.vico.gui.image_view import CameraImageView, Layer
from cosmic.vico.gui.ink import YELLOW, pen, stroke

NEAR_PX: Final = 12.0
"""How near to its line on the screen a fibre is pointed at."""


def fibre_at(found: Seen | None, point_px: Pixel, near_px: float) -> Fibre | None:
    """Return the fibre of an analysis that lies nearest to a pixel; None where none is near."""
    best, nearest = None, near_px
    for fibre in found.fibres if found is not None else ():
        line = np.asarray(fibre.centre_line_px, float)
        if len(line):
            away = float(np.hypot(*(line - np.asarray(point_px)).T).min()) - fibre.width_px / 2.0
            if away < nearest:
                best, nearest = fibre, away
    return best


class MarkLayer(Layer):
    """Outlines one fibre."""

    def __init__(self) -> None:
        self.line_px: np.ndarray | None = None

    def show(self, line_px: np.ndarray | None) -> None:
        """Outline a fibre by its centre line, shape (n, 2); None: none."""
        self.line_px = line_px

    @override
    def paint(self, painter: QPainter, view: CameraImageView) -> None:
        if self.line_px is None or not len(self.line_px):
            return
        path = QPainterPath()
        points = [QPointF(x, y) for x, y in self.line_px]
        path.addPolygon(view.to_screen.map(QPolygonF(points)))
        stroke(painter, path, pen(YELLOW, 5.0))
