"""Says what teleoperation is at, by colour, by shape and by words."""

from typing import Final

from PySide6.QtCore import QRectF, QSize, Qt
from PySide6.QtGui import QColor, QFontMetricsF, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QSizePolicy, QWidget

from cosmic.frame.gui.painting import painting
from cosmic.frame.gui.state_badge import shape_path
from cosmic.frame.gui.theme import STEP_PX, State, state_look, ui_font
from cosmic.frame.overrides import override
from cosmic.mico.core.teleoperation.state import TeleoperationPhase

LOOKS: Final = {
    TeleoperationPhase.OFF: State.UNKNOWN,
    TeleoperationPhase.CENTRE: State.REFUSED,
    TeleoperationPhase.ARMED: State.OK,
    TeleoperationPhase.STEERING: State.BUSY,
    TeleoperationPhase.PAUSED: State.REFUSED,
    TeleoperationPhase.STOPPED: State.ERROR,
}
_SHAPE_PX: Final = 12.0


class PhaseIndicator(QWidget):
    """A wide sign; words too long for it are elided, and whole in the tooltip."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._phase = TeleoperationPhase.OFF
        self._words = ""
        self.setFont(ui_font(bold=True))
        self.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Fixed)
        self.show_phase(TeleoperationPhase.OFF, str(TeleoperationPhase.OFF))

    @property
    def words(self) -> str:
        """What it says."""
        return self._words

    def show_phase(self, phase: TeleoperationPhase, words: str) -> None:
        """Show another phase."""
        if (phase, words) != (self._phase, self._words):
            self._phase, self._words = phase, words
            self.setToolTip(words)
            self.setAccessibleName(f"teleoperation {words}")
            self.update()

    @override
    def sizeHint(self) -> QSize:
        metrics = QFontMetricsF(self.font())
        return QSize(24 * STEP_PX, int(metrics.height()) + STEP_PX)

    @override
    def minimumSizeHint(self) -> QSize:
        return QSize(12 * STEP_PX, self.sizeHint().height())

    @override
    def paintEvent(self, event: QPaintEvent) -> None:
        look = state_look(LOOKS[self._phase])
        with painting(self) as painter:
            painter.setRenderHint(QPainter.RenderHint.Antialiasing)
            box = QRectF(self.rect()).adjusted(0.5, 0.5, -0.5, -0.5)
            painter.setPen(QColor(look.colour))
            painter.setBrush(QColor(look.fill))
            painter.drawRoundedRect(box, 4.0, 4.0)
            place = QRectF(STEP_PX, (self.height() - _SHAPE_PX) / 2.0, _SHAPE_PX, _SHAPE_PX)
            colour = QColor(look.text if look.fill == look.colour else look.colour)
            hollow = self._phase is TeleoperationPhase.OFF
            painter.setPen(QPen(colour, 2.0) if hollow else Qt.PenStyle.NoPen)
            painter.setBrush(Qt.BrushStyle.NoBrush if hollow else colour)
            painter.drawPath(shape_path(LOOKS[self._phase], place))
            painter.setPen(QColor(look.text))
            room = box.adjusted(2.0 * STEP_PX + _SHAPE_PX, 0.0, -0.5 * STEP_PX, 0.0)
            words = painter.fontMetrics().elidedText(
                self._words, Qt.TextElideMode.ElideRight, int(room.width())
            )
            painter.drawText(room, int(Qt.AlignmentFlag.AlignVCenter), words)
