"""What machine vision found, drawn over the image: fibres, their ends, tips."""

from typing import Final

import numpy as np
from PySide6.QtCore import QPointF, QRectF
from PySide6.QtGui import QPainter, QPainterPath, QPolygonF

from cosmic.frame.overrides import override
from cosmic.vico.api.camera_shown import Seen
from cosmic.vico.core.vision.fibre import Fibre
from cosmic.vico.core.vision.tool_tips import HeldSeen, TipSeen
from cosmic.vico.gui.image_view import CameraImageView, Layer
from cosmic.vico.gui.ink import GREEN, HALO, ORANGE, SKY, WHITE, label, pen, stroke
from cosmic.vico.gui.texts import length_text

NOT_SURE: Final = "not sure"
OUT_OF_SIGHT: Final = "goes on out of the image"
BEHIND: Final = "runs into something wider"
MOST_POINTS: Final = 150


def fibre_text(fibre: Fibre, scale_um_px: float | None) -> str:
    """Return the label of a fibre: length, width, curl, and whether that is certain."""
    length = length_text(fibre.length_px, scale_um_px)
    width = length_text(fibre.width_px, scale_um_px)
    cut_off = "" if fibre.certain else _cut_off(fibre)
    if cut_off:
        return f"over {length}, width {width}\n{cut_off}"
    words = f"{length}, width {width}\ncurl {fibre.curl:.3f}"
    return words if fibre.certain else f"{words}, {NOT_SURE}"


def _cut_off(fibre: Fibre) -> str:
    """Return what hides an end of a fibre; empty where both are seen."""
    # Not at the top: it loads scipy, which a window without fibres need not.
    from cosmic.vico.core.vision.ends import EndKind

    for kind, words in ((EndKind.BORDER, OUT_OF_SIGHT), (EndKind.BODY, BEHIND)):
        if kind.value in fibre.doubts:
            return words
    return ""


class SeenLayer(Layer):
    """Draws the newest analysis; what is not certain is dashed and says so."""

    def __init__(self) -> None:
        self.shown = True
        self.analysis: Seen | None = None
        self.labels: list[tuple[QRectF, str]] = []
        """Where labels stand on the screen, and what to say there."""

    @override
    def paint(self, painter: QPainter, view: CameraImageView) -> None:
        self.labels = []
        found = self.analysis
        if not self.shown or found is None or not self._fits(view, found):
            return
        scale = found.image.circumstances.scale_um_px
        for fibre in found.fibres:
            self._paint_fibre(painter, view, fibre, scale)
        for held in found.held:
            self._paint_held(painter, view, held)
        for tip in found.tips:
            self._paint_tip(painter, view, tip)

    @override
    def tip(self, point: QPointF, view: CameraImageView) -> str:
        return next((text for box, text in self.labels if box.contains(point)), "")

    @property
    def _taken(self) -> list[QRectF]:
        return [box for box, _ in self.labels]

    @staticmethod
    def _fits(view: CameraImageView, found: Seen) -> bool:
        """Tell whether it was found in an image of the size shown."""
        return found.image.size_px == view.size_px

    def _paint_fibre(
        self, painter: QPainter, view: CameraImageView, fibre: Fibre, scale: float | None
    ) -> None:
        colour = GREEN if fibre.certain else ORANGE
        path = _path(fibre.centre_line_px, view)
        stroke(painter, path, pen(colour, 2.0, dashed=not fibre.certain))
        to = view.to_screen
        painter.setPen(pen(HALO, 1.0))
        painter.setBrush(colour)
        for x, y in np.asarray(fibre.ends_px, float):
            painter.drawEllipse(to.map(QPointF(x, y)), 4.5, 4.5)
        line_px = np.asarray(fibre.centre_line_px, float)
        if not len(line_px):
            return
        middle = line_px[len(line_px) // 2]
        text = fibre_text(fibre, scale)
        point = to.map(QPointF(*middle))
        box = label(painter, point, text, colour, QRectF(view.rect()), gap=14.0, taken=self._taken)
        said = "certain" if fibre.certain else f"{NOT_SURE}: " + "; ".join(fibre.doubts)
        self.labels.append((box, f"Fibre, {said}"))

    def _paint_held(self, painter: QPainter, view: CameraImageView, held: HeldSeen) -> None:
        colour = SKY if held.certain else ORANGE
        stroke(painter, _path(held.line_px, view), pen(colour, 2.0, dashed=not held.certain))
        length = length_text(held.length_px, held.scale_um_px)
        free = f"{length} free, {held.angle_deg:+.1f}° at the jaws"
        text = f"{held.name}: {free}" if held.certain else f"{held.name}: {free}, {NOT_SURE}"
        point = view.to_screen.map(QPointF(*held.line_px[len(held.line_px) // 2]))
        box = label(painter, point, text, colour, QRectF(view.rect()), gap=14.0, taken=self._taken)
        self.labels.append((box, f"Fibre held by {text}"))

    def _paint_tip(self, painter: QPainter, view: CameraImageView, tip: TipSeen) -> None:
        point = view.to_screen.map(QPointF(*tip.point_px))
        colour = SKY if tip.certain else ORANGE
        path = QPainterPath()
        for dx, dy in ((9.0, 0.0), (0.0, 9.0)):
            path.moveTo(point - QPointF(dx, dy))
            path.lineTo(point + QPointF(dx, dy))
        stroke(painter, path, pen(colour, 2.0))
        text = tip.name if tip.certain else f"{tip.name}, {NOT_SURE}"
        box = label(painter, point, text, WHITE, QRectF(view.rect()), gap=4.0, taken=self._taken)
        self.labels.append((box, f"Tip of {text}"))


def _path(points_px: np.ndarray, view: CameraImageView) -> QPainterPath:
    """Return a line on the screen, with no more points than the eye can tell."""
    points = np.asarray(points_px, float)
    step = max(1, len(points) // MOST_POINTS)
    chosen = np.concatenate([points[:-1:step], points[-1:]])
    path = QPainterPath()
    path.addPolygon(view.to_screen.map(QPolygonF([QPointF(x, y) for x, y in chosen])))
    return path
