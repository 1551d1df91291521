"""`CameraImageView`: an image that can be panned and zoomed, with layers drawn over it."""

from abc import abstractmethod
from collections.abc import Callable
from typing import Protocol

import pyqtgraph as pg
from PySide6.QtCore import QEvent, QPointF, QRectF, QSize, Qt, Signal
from PySide6.QtGui import (
    QColor,
    QContextMenuEvent,
    QHelpEvent,
    QKeyEvent,
    QMouseEvent,
    QPainter,
    QResizeEvent,
    QTransform,
    QWheelEvent,
)
from PySide6.QtWidgets import QToolTip, QWidget

from cosmic.frame.gui.painting import saved
from cosmic.frame.gui.theme import current_palette
from cosmic.frame.overrides import override
from cosmic.vico.api.coordinate_transform import Pixel
from cosmic.vico.core.image import CameraImage
from cosmic.vico.gui.levels import (
    Levels,
    colour_image,
    index_table,
    indices,
    palette,
)
from cosmic.vico.hw.interface import Pixels

_PLAIN = Levels(0.0, 255.0)
_NOTCH = 120
"""Of a wheel, in Qt's eighths of a degree."""


class CameraImageItem:
    """Drives pyqtgraph's item; grey images go there as bytes with a palette.

    Attributes
    ----------
    item : ImageItem
        For the scene.
    full : int
        Brightness of an over-exposed pixel.
    """

    def __init__(self) -> None:
        self.item = pg.ImageItem(axisOrder="row-major", autoLevels=False)
        self.item.setPos(-0.5, -0.5)  # the middle of a pixel is where its number says
        self.full = 255
        self.levels = _PLAIN
        self._marks = self._greyed = False
        self._index = index_table(255)
        self._data: Pixels | None = None

    def set_levels(self, levels: Levels) -> None:
        """Change the contrast."""
        if levels != self.levels:
            self.levels = levels
            self._look_changed()

    def set_marks(self, marks: bool) -> None:
        """Colour pixels that are over-exposed or quite black, or not."""
        self._marks = marks
        self._look_changed()

    def set_greyed(self, greyed: bool) -> None:
        """Show that the image is old."""
        if greyed != self._greyed:
            self._greyed = greyed
            self._look_changed()

    def show(self, image: CameraImage) -> bool:
        """Show an image; True when it has another shape than the one before."""
        before, self._data = self._data, image.data
        reshaped = before is None or before.shape != image.data.shape
        full = image.frame.pixel_format.full_scale
        if full != self.full:
            share = full / self.full
            self.full, self._index = full, index_table(full)
            self.levels = Levels(self.levels.low * share, self.levels.high * share)
            self._look_changed()
        elif reshaped:
            self._look_changed()
        else:
            self._put(image.data)
        return reshaped

    def _look_changed(self) -> None:
        if self._data is None:
            return
        if self._data.ndim == 2:
            table = palette(self.levels, self.full, marks=self._marks, greyed=self._greyed)
            self.item.setLookupTable(table, update=False)
        self._put(self._data)

    def _put(self, data: Pixels) -> None:
        if data.ndim == 2:
            shown: Pixels = data if self._index is None else indices(self._index, data)
        elif self.levels == _PLAIN and not self._marks and not self._greyed:
            shown = data
        else:
            shown = colour_image(data, self.levels, marks=self._marks, greyed=self._greyed)
        self.item.setImage(shown, autoLevels=False)


class Layer(Protocol):
    """Something drawn over the image; it never takes a click."""

    @abstractmethod
    def paint(self, painter: QPainter, view: "CameraImageView") -> None:
        """Draw, in coordinates of the screen; `view.to_screen` brings pixels there."""

    def tip(self, point: QPointF, view: "CameraImageView") -> str:  # noqa: ARG002 - for those who say
        """Return what to say when the operator points there; empty for nothing."""
        return ""


class Tool(Protocol):
    """Takes the left mouse button while it is chosen."""

    cursor: Qt.CursorShape

    @abstractmethod
    def press(self, point_px: Pixel) -> None:
        """Take the button going down there."""

    @abstractmethod
    def press_again(self, point_px: Pixel) -> None:
        """Take the second press of a double click, where it means something."""

    @abstractmethod
    def move(self, point_px: Pixel) -> None:
        """Take the mouse coming there, with the button down or not."""

    @abstractmethod
    def release(self, point_px: Pixel) -> None:
        """Take the button being let go there."""

    @abstractmethod
    def cancel(self) -> None:
        """Forget what is half done."""


class CameraImageView(pg.GraphicsView):  # type: ignore[misc]
    """Shows the image it was given last; the view stays when the next one comes.

    Attributes
    ----------
    pixels : CameraImageItem
        Draws the image: its contrast, its marks, and whether it is old.

    Signals
    -------
    pointed(object)
        The mouse is at that pixel (x, y), or None: outside.
    zoom_changed()
        Another part is shown, or at another size.
    delete_requested(), cancel_requested()
        Delete and Escape were pressed.
    menu_requested(QPointF)
        The right button was clicked there, on the screen.
    height_wheeled(int)
        The wheel was turned with Ctrl while a tool is chosen: notches up, or down.
    """

    pointed = Signal(object)
    zoom_changed = Signal()
    delete_requested = Signal()
    cancel_requested = Signal()
    menu_requested = Signal(QPointF)
    height_wheeled = Signal(int)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent, useOpenGL=False, background=None)
        self.layers: list[Layer] = []
        self.paints = 0
        self.tool: Tool | None = None
        self.image: CameraImage | None = None
        self._fitted = True
        self._wheeled = 0
        self.pixels = CameraImageItem()
        self.box = pg.ViewBox(lockAspect=True, invertY=True, enableMenu=False, defaultPadding=0)
        self.box.disableAutoRange()
        self.setCentralItem(self.box)
        self.box.addItem(self.pixels.item)
        self.box.sigRangeChangedManually.connect(self._on_moved_by_hand)
        self.box.sigTransformChanged.connect(self.zoom_changed)
        self.setMouseTracking(True)
        self.setAccessibleName("Live image")

    @override
    def sizeHint(self) -> QSize:
        # A dock would rather scroll than make it smaller than its hint.
        return QSize(self.minimumWidth(), self.minimumHeight())

    # What is shown

    def show_image(self, image: CameraImage) -> None:
        """Show `image` instead of the one before."""
        self.image = image
        if self.pixels.show(image) and self._fitted:
            self.fit()
        self.redraw()  # the layers lie over the margins as well

    # Which part is shown

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height of the image shown; (0, 0) before the first."""
        return (0, 0) if self.image is None else self.image.data.shape[1::-1]

    @property
    def to_screen(self) -> QTransform:
        """From pixels of the image to those of the widget."""
        self.box.updateMatrix()  # else as it was when last painted
        inner: QTransform = self.box.childGroup.sceneTransform()
        outer: QTransform = self.viewportTransform()
        return inner * outer

    @property
    def zoom(self) -> float:
        """Pixels of the screen for one of the image."""
        return abs(self.to_screen.m11()) * float(self.devicePixelRatioF())

    def pixel_at(self, point: QPointF) -> Pixel:
        """Return the pixel below a point of the widget; it may lie outside the image."""
        inverse, _ = self.to_screen.inverted()
        there = inverse.map(point)
        return there.x(), there.y()

    def is_inside(self, point_px: Pixel) -> bool:
        """Tell whether the image has such a pixel."""
        width, height = self.size_px
        x, y = point_px
        return -0.5 <= x < width - 0.5 and -0.5 <= y < height - 0.5

    def fit(self) -> None:
        """Show all of the image, and keep to it when the window changes."""
        self._fitted = True
        width, height = self.size_px
        if width:
            self.box.setRange(QRectF(-0.5, -0.5, width, height), padding=0.0)

    def one_to_one(self) -> None:
        """Show a pixel of the image by one of the screen, around the middle of the view."""
        self._fitted = False
        middle = self.pixel_at(QPointF(self.width() / 2, self.height() / 2))
        if not self.is_inside(middle):
            middle = (self.size_px[0] / 2, self.size_px[1] / 2)
        self._show_around(middle, 1.0 / float(self.devicePixelRatioF()))

    def _show_around(self, middle: Pixel, scale: float) -> None:
        """Show a pixel in the middle of the view, at `scale` pixels of the widget for one."""
        width, height = self.width() / scale, self.height() / scale
        corner = QPointF(middle[0] - width / 2.0, middle[1] - height / 2.0)
        self.box.setRange(QRectF(corner.x(), corner.y(), width, height), padding=0.0)

    def _on_moved_by_hand(self) -> None:
        self._fitted = False

    @override
    def resizeEvent(self, event: QResizeEvent) -> None:
        if getattr(self, "image", None) is None:  # pyqtgraph calls it while it is being made
            super().resizeEvent(event)
            return
        before = event.oldSize()
        middle = self.pixel_at(QPointF(before.width() / 2.0, before.height() / 2.0))
        scale = abs(self.to_screen.m11())
        super().resizeEvent(event)
        if self._fitted:
            self.fit()
        else:
            self._show_around(middle, scale)

    @override
    def close(self) -> bool:
        return QWidget.close(self)  # pyqtgraph's own takes the viewport apart under Qt's feet

    # Layers

    @override
    def drawForeground(self, painter: QPainter, rect: QRectF) -> None:
        self.paints += 1
        with saved(painter):
            painter.resetTransform()
            painter.setRenderHint(QPainter.RenderHint.Antialiasing)
            for layer in self.layers:
                with saved(painter):
                    layer.paint(painter, self)

    @override
    def drawBackground(self, painter: QPainter, rect: QRectF) -> None:
        painter.fillRect(rect, QColor(current_palette().field))

    @override
    def changeEvent(self, event: QEvent) -> None:
        super().changeEvent(event)
        if event.type() == QEvent.Type.PaletteChange:
            self.resetCachedContent()  # pyqtgraph has the background kept, in the theme of before
            self.viewport().update()

    def redraw(self) -> None:
        """Draw the layers anew."""
        self.viewport().update()

    @override
    def viewportEvent(self, event: QEvent) -> bool:
        if event.type() == QEvent.Type.ToolTip and isinstance(event, QHelpEvent):
            point = QPointF(event.pos())
            tips = (layer.tip(point, self) for layer in reversed(self.layers))
            QToolTip.showText(event.globalPos(), next((text for text in tips if text), ""), self)
            return True
        return bool(super().viewportEvent(event))

    # Mouse and keys

    def set_tool(self, tool: Tool | None) -> None:
        """Give the left button to `tool`; None gives it back to panning."""
        if self.tool is not None:
            self.tool.cancel()
        self.tool = tool
        self.viewport().setCursor(Qt.CursorShape.ArrowCursor if tool is None else tool.cursor)
        self.redraw()

    def _with_tool(self, act: Callable[[Pixel], None], event: QMouseEvent) -> None:
        act(self.pixel_at(event.position()))
        event.accept()
        self.redraw()

    @override
    def mousePressEvent(self, event: QMouseEvent) -> None:
        if self.tool is not None and event.button() == Qt.MouseButton.LeftButton:
            self.setFocus(Qt.FocusReason.MouseFocusReason)
            self._with_tool(self.tool.press, event)
        elif event.button() == Qt.MouseButton.RightButton:
            event.accept()  # its menu swallows the release: pyqtgraph took the next drag for its
        else:
            super().mousePressEvent(event)

    @override
    def mouseDoubleClickEvent(self, event: QMouseEvent) -> None:
        if self.tool is not None and event.button() == Qt.MouseButton.LeftButton:
            self._with_tool(self.tool.press_again, event)
        else:
            super().mouseDoubleClickEvent(event)

    @override
    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        here = self.pixel_at(event.position())
        self.pointed.emit(here if self.is_inside(here) else None)
        if self.tool is not None:
            self._with_tool(self.tool.move, event)
        elif not event.buttons() & Qt.MouseButton.RightButton:
            super().mouseMoveEvent(event)

    @override
    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        if self.tool is not None and event.button() == Qt.MouseButton.LeftButton:
            self._with_tool(self.tool.release, event)
        elif event.button() != Qt.MouseButton.RightButton:
            super().mouseReleaseEvent(event)

    @override
    def wheelEvent(self, event: QWheelEvent) -> None:
        held = bool(event.modifiers() & Qt.KeyboardModifier.ControlModifier)
        if self.tool is None or not held:
            super().wheelEvent(event)
            return
        self._wheeled += event.angleDelta().y()
        notches = int(self._wheeled / _NOTCH)
        if notches:
            self._wheeled -= notches * _NOTCH
            self.height_wheeled.emit(notches)
        event.accept()

    @override
    def leaveEvent(self, event: QEvent) -> None:
        super().leaveEvent(event)
        self.pointed.emit(None)

    @override
    def contextMenuEvent(self, event: QContextMenuEvent) -> None:
        self.menu_requested.emit(QPointF(event.pos()))
        event.accept()

    @override
    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.key() in (Qt.Key.Key_Delete, Qt.Key.Key_Backspace):
            self.delete_requested.emit()
        elif event.key() == Qt.Key.Key_Escape and self.tool is not None:
            self.cancel_requested.emit()
        else:
            event.ignore()
