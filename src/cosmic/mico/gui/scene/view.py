"""What the 3D view and the projections have in common."""

from PySide6.QtCore import QEvent, QPointF, QSize, Qt, Signal
from PySide6.QtGui import QColor, QMouseEvent, QPainter
from PySide6.QtWidgets import QSizePolicy, QWidget

from cosmic.frame.gui.palette import Palette
from cosmic.frame.gui.theme import STEP_PX, current_palette
from cosmic.frame.overrides import override
from cosmic.mico.gui.scene.annotations import draw_plate
from cosmic.mico.gui.scene.camera import Sight
from cosmic.mico.gui.scene.content import SceneContent
from cosmic.mico.gui.scene.picking import Ray


class SceneView(QWidget):
    """Shows a `SceneContent`; GUI thread.

    Drag with the left button turns, with the middle or right button shifts, the wheel zooms. While
    `moving` is on, the left button aims a tool instead.

    Signals
    -------
    hovered(str)
        The body under the cursor; empty when there is none.
    failed(str)
        It cannot draw any more, and why.
    aimed(object)
        The line of sight, a `Ray`, that the left button is held on while `moving`; None: no longer.
    placed(object)
        The one on which it was let go.
    """

    hovered = Signal(str)
    failed = Signal(str)
    aimed = Signal(object)
    placed = Signal(object)

    def __init__(self, content: SceneContent, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.content = content
        self.frames = 0
        self._hovered = ""
        self._cursor = QPointF()
        self._dragged_from = QPointF()
        self._moving = self._aiming = False
        self.setMouseTracking(True)
        # Nothing shines through: a live image below it does not have it painted anew.
        self.setAttribute(Qt.WidgetAttribute.WA_OpaquePaintEvent)
        # Keys belong to what jogs the axes: this view never takes them.
        self.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.setMinimumSize(12 * STEP_PX, 9 * STEP_PX)

    def rebuild(self) -> None:
        """Take over another model."""
        raise NotImplementedError

    def refresh(self) -> None:
        """Take over what changed in the content."""
        raise NotImplementedError

    def look(self, sight: Sight) -> None:
        """Look at something."""
        raise NotImplementedError

    def release(self) -> None:
        """Give back what is held of the graphics system; painting afterwards takes it again."""

    def body_at(self, place: QPointF) -> str:
        """Return the body seen at `place`, px; empty when there is none."""
        raise NotImplementedError

    def ray_at(self, place: QPointF) -> Ray | None:
        """Return the line of sight at `place`, px; None where nothing is looked at."""
        raise NotImplementedError

    def set_moving(self, on: bool) -> None:
        """Have the left button aim a tool, or turn what is seen."""
        self._moving, self._aiming = on, False
        shape = Qt.CursorShape.PointingHandCursor if on else Qt.CursorShape.ArrowCursor
        self.setCursor(shape)

    def drag(self, before: QPointF, now: QPointF, *, turn: bool) -> None:
        """Turn or shift what is seen."""
        raise NotImplementedError

    @property
    def hovered_body(self) -> str:
        """The body under the cursor."""
        return self._hovered

    def draw_hovered(self, painter: QPainter, palette: Palette) -> None:
        """Write the name of the body under the cursor beside it."""
        if self._hovered:
            place = self._cursor + QPointF(14.0, 14.0)
            draw_plate(painter, place, self._hovered, palette, QColor(palette.border_strong))

    def _hover(self, body: str) -> None:
        if body != self._hovered:
            self._hovered = body
            self.hovered.emit(body)
            self.update()
        elif body:
            self.update()

    @override
    def sizeHint(self) -> QSize:
        return QSize(60 * STEP_PX, 44 * STEP_PX)

    @override
    def mousePressEvent(self, event: QMouseEvent) -> None:
        self._dragged_from = event.position()
        self._hover("")
        if self._moving and event.button() == Qt.MouseButton.LeftButton:
            self._aiming = True
            self.aimed.emit(self.ray_at(event.position()))

    @override
    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        if not self._aiming or event.button() != Qt.MouseButton.LeftButton:
            super().mouseReleaseEvent(event)
            return
        self._aiming = False
        ray = self.ray_at(event.position())
        self.aimed.emit(None)
        if ray is not None:
            self.placed.emit(ray)

    @override
    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        now = event.position()
        if self._aiming:
            self.aimed.emit(self.ray_at(now))
            return
        if event.buttons() == Qt.MouseButton.NoButton:
            self._cursor = now
            self._hover(self.body_at(now))
            return
        left = bool(event.buttons() & Qt.MouseButton.LeftButton)
        shift = bool(event.modifiers() & Qt.KeyboardModifier.ControlModifier)
        self.drag(self._dragged_from, now, turn=left and not shift)
        self._dragged_from = now

    @override
    def leaveEvent(self, event: QEvent) -> None:
        super().leaveEvent(event)
        self._hover("")

    @override
    def changeEvent(self, event: QEvent) -> None:
        super().changeEvent(event)
        if event.type() == QEvent.Type.PaletteChange:
            self.refresh()

    @staticmethod
    def theme() -> Palette:
        """Return the colours in force."""
        return current_palette()
