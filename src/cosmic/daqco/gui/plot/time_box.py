"""The view box: time along x, everything from 0 (bottom) to 1 (top) along y."""

from typing import Final

import pyqtgraph as pg
from PySide6.QtCore import QPointF, Qt, Signal
from PySide6.QtWidgets import QGraphicsSceneWheelEvent

from cosmic.frame.overrides import override

ZOOM_A_NOTCH: Final = 0.8
_NOTCH: Final = 120.0


class TimeBox(pg.ViewBox):  # type: ignore[misc]
    """Tells what the mouse asks for, and leaves it to the chart to do it.

    Places are parts of the image, 0 to 1, from the left and from the bottom.
    """

    time_zoom_requested = Signal(float, float)
    """Factor of the new width to the old, and the place that stays."""
    value_zoom_requested = Signal(float, float)
    time_pan_requested = Signal(float)
    """How far the image is pulled to the right."""
    live_requested = Signal()

    def __init__(self) -> None:
        super().__init__(enableMenu=False, enableMouse=False, defaultPadding=0.0)
        self.disableAutoRange()
        self.setYRange(0.0, 1.0, padding=0.0)

    def _place(self, point: QPointF) -> tuple[float, float]:
        width, height = max(1.0, self.width()), max(1.0, self.height())
        return point.x() / width, 1.0 - point.y() / height

    @override
    def wheelEvent(self, ev: QGraphicsSceneWheelEvent, axis: int | None = None) -> None:
        x, y = self._place(ev.pos())
        factor = ZOOM_A_NOTCH ** (ev.delta() / _NOTCH)
        if ev.modifiers() & Qt.KeyboardModifier.ControlModifier:
            self.value_zoom_requested.emit(factor, y)
        else:
            self.time_zoom_requested.emit(factor, x)
        ev.accept()

    @override
    def mouseDragEvent(self, ev: object, axis: int | None = None) -> None:
        event: pg.GraphicsScene.mouseEvents.MouseDragEvent = ev
        if event.button() != Qt.MouseButton.LeftButton:
            event.ignore()
            return
        event.accept()
        before, now = self.mapFromScene(event.lastScenePos()), self.mapFromScene(event.scenePos())
        self.time_pan_requested.emit(self._place(now)[0] - self._place(before)[0])

    @override
    def mouseDoubleClickEvent(self, event: object) -> None:
        self.live_requested.emit()
