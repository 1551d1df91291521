"""The fibres found on one image, to be corrected by an operator: add, cut, join, delete, move."""

from collections.abc import Callable
from typing import Final

import numpy as np
import numpy.typing as npt
from PySide6.QtCore import QPointF, Qt, QTimer
from PySide6.QtGui import (
    QCloseEvent,
    QKeySequence,
    QPainter,
    QPainterPath,
    QPolygonF,
    QShortcut,
    QShowEvent,
)
from PySide6.QtWidgets import (
    QButtonGroup,
    QHBoxLayout,
    QLabel,
    QMessageBox,
    QToolButton,
    QVBoxLayout,
    QWidget,
)

from cosmic.frame.errors import CosmicError
from cosmic.frame.gui.beside import open_beside
from cosmic.frame.gui.build import named, tipped
from cosmic.frame.gui.screen_fit import fit_to_screen
from cosmic.frame.overrides import override
from cosmic.vico.api.coordinate_transform import Pixel
from cosmic.vico.core.image import CameraImage, Circumstances
from cosmic.vico.core.measuring.corrections import Corrections, Line
from cosmic.vico.core.vision.grey import grey_image
from cosmic.vico.gui.image_view import CameraImageView, Layer, Tool
from cosmic.vico.gui.ink import GREEN, HALO, ORANGE, SKY, WHITE, label, pen, stroke
from cosmic.vico.hw.interface import Frame

EDITS: Final = {
    "add": ("Add", "Click along a fibre; click its last point again to end it"),
    "cut": ("Cut", "Click where a fibre is to be cut in two"),
    "join": ("Join", "Click one fibre, then another: their nearest ends are joined"),
    "delete": ("Delete", "Click a fibre to delete it"),
    "move end": ("Move end", "Press at an end of a fibre, drag it, release"),
}
SAME_POINT_PX: Final = 6.0


class FibreLayer(Layer):
    """Draws the fibres as they stand; what an operator changed in another colour."""

    def __init__(self, corrections: Corrections) -> None:
        self._corrections = corrections
        self.open_line: list[Pixel] = []
        self.chosen: int | None = None

    @override
    def paint(self, painter: QPainter, view: CameraImageView) -> None:
        for each in self._corrections.lines:
            colour = ORANGE if each.by_operator else GREEN
            width = 4.0 if each.number == self.chosen else 2.0
            stroke(painter, _path(each.line_px, view), pen(colour, width))
            painter.setPen(pen(HALO, 1.0))
            painter.setBrush(colour)
            for x, y in each.line_px[[0, -1]]:
                painter.drawEllipse(view.to_screen.map(QPointF(x, y)), 4.5, 4.5)
            middle = view.to_screen.map(QPointF(*each.line_px[len(each.line_px) // 2]))
            label(painter, middle, str(each.number), WHITE, view.rect().toRectF(), gap=8.0)
        if self.open_line:
            stroke(painter, _path(np.array(self.open_line), view), pen(SKY, 2.0, dashed=True))


class EditTool(Tool):
    """What a click on the image does to the fibres, once an edit is chosen."""

    def __init__(
        self,
        corrections: Corrections,
        layer: FibreLayer,
        do: Callable[[Callable[[], None]], None],
        report: Callable[[str], None],
    ) -> None:
        self.cursor = Qt.CursorShape.CrossCursor
        self.edit = ""
        self._corrections, self._layer = corrections, layer
        self._do, self._report = do, report
        self._from: Pixel | None = None

    @override
    def press(self, point_px: Pixel) -> None:
        if self.edit == "add":
            self._add(point_px)
            return
        line = self._corrections.nearest(point_px)
        if line is None:
            self._report("No fibre is near that point.")
        elif self.edit == "delete":
            self._do(lambda: self._corrections.delete(line.number))
        elif self.edit == "cut":
            self._do(lambda: self._corrections.cut(line.number, point_px))
        elif self.edit == "join":
            self._join(line)
        elif self.edit == "move end":
            self._layer.chosen, self._from = line.number, point_px

    @override
    def press_again(self, point_px: Pixel) -> None:
        if self.edit == "add":  # a second fibre must not be cut or deleted in haste
            self._add(point_px)

    @override
    def move(self, point_px: Pixel) -> None:
        if self._from is not None:
            self._layer.open_line = [self._from, point_px]

    @override
    def release(self, point_px: Pixel) -> None:
        number, start = self._layer.chosen, self._from
        if start is None or number is None:
            return
        self.cancel()
        self._do(lambda: self._corrections.move_end(number, start, point_px))

    @override
    def cancel(self) -> None:
        self._from = self._layer.chosen = None
        self._layer.open_line = []

    def _add(self, point_px: Pixel) -> None:
        points = self._layer.open_line
        if points and np.hypot(*np.subtract(points[-1], point_px)) < SAME_POINT_PX:
            self._end_line()
            return
        if not self._corrections.contains(point_px):
            # Here: at the end it would cost all points clicked.
            self._report("That point is outside the image; click on it.")
            return
        self._layer.open_line = [*points, point_px]

    def _end_line(self) -> None:
        points = self._layer.open_line
        self.cancel()
        self._do(lambda: self._corrections.add(points))

    def finish(self) -> None:
        """Add the fibre that was clicked and not ended; nothing where it is a point yet."""
        if self.edit == "add" and len(self._layer.open_line) > 1:
            self._end_line()

    def _join(self, line: Line) -> None:
        first = self._layer.chosen
        if first is None or first == line.number:
            self._layer.chosen = line.number
            return
        self.cancel()
        self._do(lambda: self._corrections.join(first, line.number))


class FibreEditor(QWidget):
    """One image with its fibres and the buttons that change them.

    Parameters
    ----------
    image : ndarray
        As `find_fibres` takes it.
    save : callable
        Keeps the corrections; returns what to say about it, or raises `CosmicError`.
    """

    def __init__(
        self,
        image: npt.NDArray[np.generic],
        corrections: Corrections,
        save: Callable[[], str],
        parent: QWidget | None = None,
    ) -> None:
        super().__init__(parent)
        self.corrections = corrections
        self._save = save
        self._kept = corrections.edits
        self.question: QMessageBox | None = None
        self.view = CameraImageView()
        self.view.setMinimumSize(320, 240)
        self.view.show_image(_as_camera_image(image))
        self.note = named(QLabel(""), "note")
        self.note.setWordWrap(True)
        self._layer = FibreLayer(corrections)
        self.view.layers.append(self._layer)
        self._tool = EditTool(corrections, self._layer, self._edited, self.note.setText)
        self.view.cancel_requested.connect(self._on_cancel)
        self.edits = {name: _button(text, tip) for name, (text, tip) in EDITS.items()}
        self._group = QButtonGroup(self)
        for name, button in self.edits.items():
            button.setCheckable(True)
            button.setObjectName(name)
            self._group.addButton(button)
        self._group.buttonClicked.connect(self._on_edit)
        self.undo = _button("Undo", "Undo the last edit (Ctrl+Z)")
        self.redo = _button("Redo", "Do it again (Ctrl+Shift+Z)")
        self.save = _button("Save", "Keep the corrections beside the image (Ctrl+S)")
        for button, act, keys in (
            (self.undo, self._on_undo, QKeySequence.StandardKey.Undo),
            (self.redo, self._on_redo, QKeySequence.StandardKey.Redo),
            (self.save, self._on_save, QKeySequence.StandardKey.Save),
        ):
            button.clicked.connect(act)
            QShortcut(QKeySequence(keys), self, act)
        self._lay_out()
        self._refresh()

    def _lay_out(self) -> None:
        row = QHBoxLayout()
        for button in (*self.edits.values(), self.undo, self.redo, self.save):
            row.addWidget(button)
        row.addStretch(1)
        column = QVBoxLayout(self)
        column.addLayout(row)
        column.addWidget(self.view, 1)
        column.addWidget(self.note)

    def _on_edit(self, button: QToolButton) -> None:
        self._tool.finish()
        self._tool.cancel()
        self._tool.edit = button.objectName()
        self.view.set_tool(self._tool)
        self.note.setText(EDITS[self._tool.edit][1] + ".")
        self.view.redraw()

    def _on_cancel(self) -> None:
        self._tool.cancel()
        self.view.redraw()

    def _on_undo(self) -> None:
        self._edited(self.corrections.undo)

    def _on_redo(self) -> None:
        self._edited(self.corrections.redo)

    def _on_save(self) -> None:
        self._tool.finish()
        try:
            self.note.setText(self._save())
        except CosmicError as exc:
            self.note.setText(str(exc))
        else:
            self._kept = self.corrections.edits

    @override
    def showEvent(self, event: QShowEvent) -> None:
        super().showEvent(event)
        QTimer.singleShot(0, self, lambda: fit_to_screen(self))

    @override
    def closeEvent(self, event: QCloseEvent) -> None:
        """Ask first while edits are not kept: nothing brings them back."""
        self._tool.finish()
        if self.corrections.edits == self._kept:
            super().closeEvent(event)
            return
        event.ignore()
        if self.question is None:
            buttons = QMessageBox.StandardButton
            box = QMessageBox(self)
            box.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
            box.setWindowTitle("Close")
            box.setText("Save the corrections before the window closes?")
            box.setStandardButtons(buttons.Save | buttons.Discard | buttons.Cancel)
            box.finished.connect(self._on_answered)
            self.question = box
            open_beside(box)

    def _on_answered(self, answer: int) -> None:
        self.question = None
        if answer == QMessageBox.StandardButton.Save:
            self._on_save()
        elif answer == QMessageBox.StandardButton.Discard:
            self._kept = self.corrections.edits
        if answer != QMessageBox.StandardButton.Cancel and self.corrections.edits == self._kept:
            self.close()

    def _edited(self, act: Callable[[], None]) -> None:
        """Change something; what is refused is shown and changes nothing."""
        try:
            act()
        except CosmicError as exc:
            self.note.setText(str(exc))
        else:
            self.note.setText("")
        self._refresh()

    def _refresh(self) -> None:
        self.undo.setEnabled(self.corrections.can_undo)
        self.redo.setEnabled(self.corrections.can_redo)
        self.view.redraw()


def _button(text: str, tip: str) -> QToolButton:
    button = QToolButton()
    button.setText(text)
    return tipped(button, tip)


def _as_camera_image(image: npt.NDArray[np.generic]) -> CameraImage:
    return CameraImage("", Frame(grey_image(image), 0, 0.0, 0.0), Circumstances())


def _path(points_px: npt.NDArray[np.float64], view: CameraImageView) -> QPainterPath:
    path = QPainterPath()
    path.addPolygon(view.to_screen.map(QPolygonF([QPointF(x, y) for x, y in points_px])))
    return path
