"""Distances and angles that the operator measures on the image."""

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

from PySide6.QtCore import QPointF, QRectF
from PySide6.QtGui import QPainter, QPainterPath

from cosmic.frame.overrides import override
from cosmic.vico.api.coordinate_transform import Pixel
from cosmic.vico.gui.image_view import CameraImageView, Layer
from cosmic.vico.gui.ink import HALO, PINK, YELLOW, label, pen, stroke
from cosmic.vico.gui.texts import length_text

NEAR_PX: Final = 9.0


@dataclass(slots=True, eq=False)
class Measure:
    """Two points for a distance; three, the middle one the vertex, for an angle.

    Attributes
    ----------
    scale_um_px : float or None
        Of the image it was measured on.
    """

    points: list[Pixel]
    scale_um_px: float | None

    @property
    def text(self) -> str:
        """The distance in um, or px where no scale is known; or the angle in degrees."""
        if len(self.points) == 3:
            return f"{angle_deg(*self.points):.2f}°"
        if len(self.points) < 2:
            return ""
        return length_text(math.dist(*self.points[:2]), self.scale_um_px)


def angle_deg(first: Pixel, vertex: Pixel, last: Pixel) -> float:
    """Return the angle at `vertex`, 0 to 180 degrees."""
    directions = [math.atan2(y - vertex[1], x - vertex[0]) for x, y in (first, last)]
    between = abs(math.degrees(directions[0] - directions[1])) % 360.0
    return min(between, 360.0 - between)


class MeasureLayer(Layer):
    """Draws the measurements; those taken at another scale than the image's are dashed."""

    def __init__(self) -> None:
        self.measures: list[Measure] = []
        self.chosen: Measure | None = None

    def add(self, measure: Measure) -> None:
        """Begin to show a measurement, and choose it."""
        self.measures.append(measure)
        self.chosen = measure

    def remove(self, measure: Measure | None) -> None:
        """Take a measurement away; None takes none."""
        if measure in self.measures:
            self.measures.remove(measure)
        if measure is self.chosen:
            self.chosen = self.measures[-1] if self.measures else None

    def clear(self) -> None:
        """Take them all away."""
        self.measures, self.chosen = [], None

    def at(self, point: QPointF, view: CameraImageView) -> Measure | None:
        """Return the measurement that is drawn near a point on the screen."""
        here = (point.x(), point.y())
        for measure in reversed(self.measures):
            ends = [view.to_screen.map(QPointF(*each)).toTuple() for each in measure.points]
            if any(_distance(here, begin, end) < NEAR_PX for begin, end in pairwise(ends)):
                return measure
        return None

    @override
    def paint(self, painter: QPainter, view: CameraImageView) -> None:
        if view.image is None:
            return
        scale = view.image.circumstances.scale_um_px
        for measure in self.measures:
            self._paint_one(painter, view, measure, other=measure.scale_um_px != scale)

    def _paint_one(
        self, painter: QPainter, view: CameraImageView, measure: Measure, *, other: bool
    ) -> None:
        to = view.to_screen
        points = [to.map(QPointF(*each)) for each in measure.points]
        colour = YELLOW if measure is self.chosen else PINK
        path = QPainterPath(points[0])
        for each in points[1:]:
            path.lineTo(each)
        stroke(painter, path, pen(colour, 2.0, dashed=other))
        painter.setPen(pen(HALO, 1.0))
        painter.setBrush(colour)
        for each in points:
            painter.drawEllipse(each, 3.5, 3.5)
        if measure.text:
            point = points[1] if len(points) == 3 else (points[0] + points[1]) / 2.0
            text = f"{measure.text} (other scale)" if other else measure.text
            label(painter, point, text, colour, QRectF(view.rect()))


def _distance(here: Pixel, begin: Pixel, end: Pixel) -> float:
    """Return how far `here` is from a line between two points."""
    (x, y), (x0, y0), (x1, y1) = here, begin, end
    length_2 = (x1 - x0) ** 2 + (y1 - y0) ** 2
    share = ((x - x0) * (x1 - x0) + (y - y0) * (y1 - y0)) / length_2 if length_2 else 0.0
    share = min(max(share, 0.0), 1.0)
    return math.hypot(x - x0 - share * (x1 - x0), y - y0 - share * (y1 - y0))
