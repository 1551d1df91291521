"""What is drawn over the bodies: nearest pair, contact, paths, names, legend, scale."""

import math
from collections.abc import Callable, Sequence
from typing import Final

import numpy as np
from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QBrush, QColor, QFontMetricsF, QPainter, QPen, QPolygonF

from cosmic.frame.gui.palette import OKABE_ITO, Palette
from cosmic.frame.gui.theme import STEP_PX, number_font, ui_font
from cosmic.mico.core.collision.model import Floats
from cosmic.mico.gui.scene.content import Pair, SceneContent, Tracks

Project = Callable[[Floats], Floats]
"""Points in the world, shape (n, 3), mm, to the picture, shape (n, 2), px; NaN where unseen."""

PLANNED: Final = OKABE_ITO["bluish green"]
RECORDED: Final = OKABE_ITO["reddish purple"]
_SMALL_PX: Final = 12


def distance_text(distance_um: float) -> str:
    """Return a distance as figures without a unit, um."""
    return f"{distance_um:.1f}" if distance_um < 9.95 else f"{distance_um:.0f}"


def draw_annotations(
    painter: QPainter, content: SceneContent, project: Project, palette: Palette
) -> None:
    """Draw everything that has a place in the scene but no surface."""
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    _draw_tracks(painter, content.recorded, project, QColor(RECORDED), dashed=False)
    _draw_tracks(painter, content.planned, project, QColor(PLANNED), dashed=True)
    if content.nearest is not None:
        _draw_nearest(painter, content.nearest, project, palette)
    if content.refused is not None:
        _draw_contact(painter, content.refused, project, palette)


def draw_measured(
    painter: QPainter,
    content: SceneContent,
    project: Project,
    axes: Floats,
    px_mm: float,
    palette: Palette,
) -> None:
    """Draw the directions and the scale, then what has a place: no veil lies over its number."""
    draw_axes(painter, axes, palette)
    draw_scale(painter, px_mm, palette)
    draw_annotations(painter, content, project, palette)


def _draw_tracks(
    painter: QPainter, tracks: Tracks, project: Project, colour: QColor, *, dashed: bool
) -> None:
    pen = QPen(colour, 2.5)
    pen.setJoinStyle(Qt.PenJoinStyle.RoundJoin)
    if dashed:
        pen.setDashPattern([4.0, 2.0])
    for track in tracks:
        seen = [QPointF(*point) for point in project(track) if np.isfinite(point).all()]
        if not seen:
            continue
        painter.setPen(pen)
        painter.setBrush(Qt.BrushStyle.NoBrush)
        painter.drawPolyline(QPolygonF(seen))
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(colour)
        painter.drawEllipse(seen[-1], 4.0, 4.0)


def _draw_nearest(painter: QPainter, pair: Pair, project: Project, palette: Palette) -> None:
    points = project(pair.points_mm)
    if not np.isfinite(points).all():
        return
    inside = pair.approach.distance_um <= pair.approach.margin_um
    colour = QColor(palette.refused if inside else palette.accent)
    one, other = (QPointF(*point) for point in points)
    for width, ink in ((5.0, QColor(palette.panel)), (2.5, colour)):
        painter.setPen(QPen(ink, width))
        painter.drawLine(one, other)
    painter.setPen(QPen(QColor(palette.panel), 1.5))
    painter.setBrush(colour)
    for point in (one, other):
        painter.drawEllipse(point, 4.5, 4.5)
    text = f"{distance_text(pair.approach.distance_um)} µm"
    draw_plate(painter, (one + other) / 2.0 + QPointF(14.0, -22.0), text, palette, colour)


def _draw_contact(painter: QPainter, pair: Pair, project: Project, palette: Palette) -> None:
    point = project(np.atleast_2d(pair.points_mm.mean(axis=0)))[0]
    if not np.isfinite(point).all():
        return
    place, colour = QPointF(*point), QColor(palette.refused)
    painter.setBrush(Qt.BrushStyle.NoBrush)
    for width, ink in ((6.0, QColor(palette.panel)), (3.0, colour)):
        painter.setPen(QPen(ink, width))
        painter.drawEllipse(place, 11.0, 11.0)
        for across in (QPointF(5.0, 5.0), QPointF(5.0, -5.0)):
            painter.drawLine(place - across, place + across)
    word = "contact" if pair.approach.distance_um <= 0.0 else "too close"
    draw_plate(painter, place + QPointF(18.0, 8.0), word, palette, colour)


def draw_plate(
    painter: QPainter, place: QPointF, text: str, palette: Palette, edge: QColor
) -> None:
    """Write `text` on a ground of its own, its top left corner at `place`, kept in the picture.

    Where there is no room for all of it nothing is written: a part of a number is another number.
    """
    if not QRectF(painter.window()).adjusted(-40, -40, 40, 40).contains(place):
        return  # what it is about is out of sight
    painter.setFont(number_font(_SMALL_PX, bold=True))
    metrics = QFontMetricsF(painter.font())
    box = QRectF(place.x(), place.y(), metrics.horizontalAdvance(text) + 12, metrics.height() + 4)
    room = QRectF(painter.window())
    if painter.hasClipping():
        room &= painter.clipBoundingRect()
    room.adjust(2, 2, -2, -2)
    if box.width() > room.width() or box.height() > room.height():
        return
    box.moveLeft(max(room.left(), min(box.left(), room.right() - box.width())))
    box.moveTop(max(room.top(), min(box.top(), room.bottom() - box.height())))
    ground = QColor(palette.raised)
    ground.setAlphaF(0.9)
    painter.setPen(QPen(edge, 1.0))
    painter.setBrush(ground)
    painter.drawRoundedRect(box, 4.0, 4.0)
    painter.setPen(QColor(palette.text))
    painter.drawText(box, Qt.AlignmentFlag.AlignCenter, text)


def draw_ground(painter: QPainter, box: QRectF, palette: Palette) -> None:
    """Lay a light veil under words, so that they are read over any body; sets the pen for them."""
    veil = QColor(palette.window)
    veil.setAlphaF(0.72)
    painter.setPen(Qt.PenStyle.NoPen)
    painter.setBrush(veil)
    painter.drawRoundedRect(box.adjusted(-5, -2, 5, 2), 4.0, 4.0)
    painter.setPen(QColor(palette.text))


def _legend(
    content: SceneContent, palette: Palette, notes: Sequence[str]
) -> list[tuple[str, QBrush | None]]:
    lines: list[tuple[str, QBrush | None]] = []
    if content.unwatched:
        hatch = QBrush(QColor(palette.warning), Qt.BrushStyle.BDiagPattern)
        names = ", ".join(sorted(content.unwatched))
        lines.append((f"Not watched for collisions: {names}", hatch))
    if content.refused is not None:
        lines.append(("refused movement", QBrush(QColor(palette.refused))))
    if content.planned:
        lines.append(("planned path", QBrush(QColor(PLANNED))))
    if content.recorded:
        lines.append(("recorded path", QBrush(QColor(RECORDED))))
    return lines + [(note, None) for note in notes]


def draw_legend(
    painter: QPainter,
    content: SceneContent,
    room: QRectF,
    palette: Palette,
    notes: Sequence[str] = (),
) -> None:
    """Say in the top left corner of `room` what the colours mean, and `notes`."""
    top, left = room.top() + STEP_PX, room.left() + STEP_PX
    for text, swatch in _legend(content, palette, notes):
        hatched = swatch is not None and swatch.style() == Qt.BrushStyle.BDiagPattern
        painter.setFont(ui_font(_SMALL_PX, bold=hatched))
        metrics = painter.fontMetrics()
        start = left + (20.0 if swatch is not None else 0.0)
        wide = int(room.right() - start - STEP_PX)
        short = metrics.elidedText(text, Qt.TextElideMode.ElideRight, wide)
        end = start + metrics.horizontalAdvance(short)
        draw_ground(painter, QRectF(left, top, end - left, metrics.height()), palette)
        painter.drawText(QPointF(start, top + metrics.ascent()), short)
        if swatch is not None:
            painter.setPen(QPen(QColor(palette.border_strong), 1.0))
            painter.setBrush(swatch)
            painter.drawRect(QRectF(left, top + 3.0, 14.0, metrics.height() - 6.0))
        top += metrics.height() + 4.0


def round_length(largest: float) -> float:
    """Return the largest of 1, 2, 5 times a power of ten that is not above `largest`."""
    power = 10.0 ** math.floor(math.log10(largest))
    return next(step * power for step in (5.0, 2.0, 1.0) if step * power <= largest * 1.0000001)


def length_text(length_mm: float) -> str:
    """Return a length with the unit that suits it."""
    return f"{length_mm:g} mm" if length_mm >= 1.0 else f"{length_mm * 1e3:g} µm"


def draw_scale(painter: QPainter, px_mm: float, palette: Palette) -> None:
    """Draw a bar of a round length into the lower right corner."""
    window = painter.window()
    length_mm = round_length(0.25 * window.width() / px_mm)
    right, bottom = window.width() - 1.5 * STEP_PX, window.height() - 1.5 * STEP_PX
    left = right - length_mm * px_mm
    text_left = min(left, right - 50.0)
    draw_ground(painter, QRectF(text_left, bottom - 22.0, right - text_left, 27.0), palette)
    painter.setPen(QPen(QColor(palette.text), 2.0))
    painter.drawLine(QPointF(left, bottom), QPointF(right, bottom))
    for end in (left, right):
        painter.drawLine(QPointF(end, bottom - 4.0), QPointF(end, bottom + 4.0))
    painter.setFont(number_font(_SMALL_PX))
    box = QRectF(right - 120.0, bottom - 24.0, 120.0, 18.0)
    painter.drawText(box, Qt.AlignmentFlag.AlignRight, length_text(length_mm))


def draw_axes(painter: QPainter, axes: Floats, palette: Palette) -> None:
    """Draw the directions x, y, z into the lower left corner.

    Parameters
    ----------
    axes : ndarray, shape (3, 3)
        Right, up and towards the eye as rows, in the world.
    """
    centre = QPointF(4.5 * STEP_PX, painter.window().height() - 4.5 * STEP_PX)
    painter.setFont(ui_font(_SMALL_PX, bold=True))
    draw_ground(painter, QRectF(centre.x() - 27.0, centre.y() - 30.0, 54.0, 60.0), palette)
    for number in np.argsort(axes[2]):
        right, up = axes[0, number], axes[1, number]
        end = centre + QPointF(24.0 * right, -24.0 * up)
        painter.setPen(QPen(QColor(palette.accent), 2.0))
        painter.drawLine(centre, end)
        if math.hypot(right, up) > 0.15:
            place = centre + QPointF(33.0 * right - 8.0, -33.0 * up - 9.0)
            painter.setPen(QColor(palette.text))
            box = QRectF(place.x(), place.y(), 16.0, 18.0)
            painter.drawText(box, Qt.AlignmentFlag.AlignCenter, "xyz"[number])
