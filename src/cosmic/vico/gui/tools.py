"""What the left mouse button does over the image, once a tool is chosen."""

from collections.abc import Callable
from typing import Final

from PySide6.QtCore import QObject, QPointF, QRectF, Qt, Signal
from PySide6.QtGui import QPainter

from cosmic.frame.overrides import override
from cosmic.vico.api.coordinate_transform import Pixel
from cosmic.vico.gui.image_view import CameraImageView, Layer, Tool
from cosmic.vico.gui.ink import HALO, SKY, label, pen
from cosmic.vico.gui.measures import Measure, MeasureLayer

LEAST_PX: Final = 2.0
LEAST_ROI_PX: Final = 8


class DistanceTool(Tool):
    """Press, drag, let go: a distance."""

    def __init__(self, layer: MeasureLayer, scale: Callable[[], float | None]) -> None:
        self.cursor = Qt.CursorShape.CrossCursor
        self._layer, self._scale = layer, scale
        self._open: Measure | None = None

    @override
    def press(self, point_px: Pixel) -> None:
        self._open = Measure([point_px, point_px], self._scale())
        self._layer.add(self._open)

    @override
    def press_again(self, point_px: Pixel) -> None:
        """Do nothing: the first press of a double click says all."""

    @override
    def move(self, point_px: Pixel) -> None:
        if self._open is not None:
            self._open.points[1] = point_px

    @override
    def release(self, point_px: Pixel) -> None:
        self.move(point_px)
        if self._open is None:
            return
        (x0, y0), (x1, y1) = self._open.points
        if abs(x1 - x0) + abs(y1 - y0) < LEAST_PX:
            self._layer.remove(self._open)
        self._open = None

    @override
    def cancel(self) -> None:
        self._layer.remove(self._open)
        self._open = None


class AngleTool(Tool):
    """Three clicks: one arm, the vertex, the other arm."""

    def __init__(self, layer: MeasureLayer, scale: Callable[[], float | None]) -> None:
        self.cursor = Qt.CursorShape.CrossCursor
        self._layer, self._scale = layer, scale
        self._open: Measure | None = None

    @override
    def press(self, point_px: Pixel) -> None:
        if self._open is None:
            self._open = Measure([point_px, point_px], self._scale())
            self._layer.add(self._open)
            return
        self._open.points[-1] = point_px
        if len(self._open.points) == 3:
            self._open = None
        else:
            self._open.points.append(point_px)

    @override
    def press_again(self, point_px: Pixel) -> None:
        """Do nothing: the first press of a double click says all."""

    @override
    def move(self, point_px: Pixel) -> None:
        if self._open is not None:
            self._open.points[-1] = point_px

    @override
    def release(self, point_px: Pixel) -> None: ...

    @override
    def cancel(self) -> None:
        self._layer.remove(self._open)
        self._open = None


class RoiTool(QObject):
    """Press, drag, let go: the part of the image that is to be read.

    Signals
    -------
    chosen(int, int, int, int)
        x, y, width and height in pixels of the image shown.
    """

    chosen = Signal(int, int, int, int)

    def __init__(self, view: CameraImageView, parent: QObject) -> None:
        super().__init__(parent)
        self.cursor = Qt.CursorShape.CrossCursor
        self._view = view
        self._begin: Pixel | None = None
        self._end: Pixel | None = None

    def press(self, point_px: Pixel) -> None:
        """Begin a corner."""
        self._begin = self._end = self._inside(point_px)

    def press_again(self, point_px: Pixel) -> None:
        """Do nothing: the first press of a double click says all."""

    def move(self, point_px: Pixel) -> None:
        """Draw the other corner along."""
        if self._begin is not None:
            self._end = self._inside(point_px)

    def release(self, point_px: Pixel) -> None:
        """Choose what lies between."""
        self.move(point_px)
        box = self.box
        self.cancel()
        if box is not None and min(box[2:]) >= LEAST_ROI_PX:
            self.chosen.emit(*box)

    def cancel(self) -> None:
        """Forget the corner."""
        self._begin = self._end = None

    @property
    def box(self) -> tuple[int, int, int, int] | None:
        """x, y, width and height as they are now."""
        if self._begin is None or self._end is None:
            return None
        (x0, x1), (y0, y1) = (sorted(pair) for pair in zip(self._begin, self._end, strict=True))
        left, top = round(x0 + 0.5), round(y0 + 0.5)
        return left, top, round(x1 + 0.5) - left, round(y1 + 0.5) - top

    def _inside(self, point_px: Pixel) -> Pixel:
        width, height = self._view.size_px
        x, y = point_px
        return min(max(x, -0.5), width - 0.5), min(max(y, -0.5), height - 0.5)


class RoiLayer(Layer):
    """Shows the part that is being chosen."""

    def __init__(self, tool: RoiTool) -> None:
        self._tool = tool

    @override
    def paint(self, painter: QPainter, view: CameraImageView) -> None:
        if self._tool.box is None:
            return
        x, y, width, height = self._tool.box
        box = view.to_screen.mapRect(QRectF(x - 0.5, y - 0.5, width, height))
        painter.setBrush(Qt.BrushStyle.NoBrush)
        for made in (pen(HALO, 3.0), pen(SKY, 1.5, dashed=True)):
            painter.setPen(made)
            painter.drawRect(box)
        point = QPointF(box.left(), box.top())
        label(painter, point, f"{width} × {height} px", SKY, QRectF(view.rect()), gap=0.0)


class ClickTool(QObject):
    """A click, or a drag: the point where the button is let go.

    Signals
    -------
    aimed(object)
        The pixel that is pointed at with the button down, x and y; None: no longer.
    clicked(object)
        The pixel where the button was let go.
    """

    aimed = Signal(object)
    clicked = Signal(object)

    def __init__(self, parent: QObject) -> None:
        super().__init__(parent)
        self.cursor = Qt.CursorShape.PointingHandCursor
        self._down = False

    def press(self, point_px: Pixel) -> None:
        """Begin to aim."""
        self._down = True
        self.aimed.emit(point_px)

    def press_again(self, point_px: Pixel) -> None:
        """Do nothing: the first press of a double click says all."""

    def move(self, point_px: Pixel) -> None:
        """Aim at another point."""
        if self._down:
            self.aimed.emit(point_px)

    def release(self, point_px: Pixel) -> None:
        """Tell the point."""
        if self._down:
            self.cancel()
            self.clicked.emit(point_px)

    def cancel(self) -> None:
        """Aim no longer; nothing was told."""
        if self._down:
            self._down = False
            self.aimed.emit(None)
