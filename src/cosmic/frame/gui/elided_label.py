"""A label for one line of any length: what does not fit is elided and stands in the tooltip."""

from PySide6.QtCore import QSize, Qt, Signal
from PySide6.QtGui import QColor, QFont, QFontMetrics, QMouseEvent, QPaintEvent, QPalette
from PySide6.QtWidgets import QLabel, QSizePolicy, QStyle, QStyleOption, QWidget

from cosmic.frame.gui.painting import painting
from cosmic.frame.gui.theme import current_palette
from cosmic.frame.overrides import override
from cosmic.frame.units import with_micro_signs


class ElidedLabel(QLabel):
    """Shows as much of its one line as fits; never asks the layout for more room.

    Parameters
    ----------
    hint : str
        Second line of the tooltip: what a click does, for instance.
    """

    clicked = Signal()

    def __init__(self, text: str = "", *, hint: str = "", parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._hint = hint
        self._whole: str | None = None
        self._shorter: tuple[str, ...] = ()
        self._tight: QFont | None = None
        self._dim = False
        self.setTextFormat(Qt.TextFormat.PlainText)
        self.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Preferred)
        self.set_text(text)

    def set_text(self, text: str, *shorter: str) -> None:
        """Show `text` with its micro signs; line ends become spaces, the tooltip has them all.

        Of `shorter` the first that has room is shown where the whole has none: a number that is
        cut off is another number.
        """
        if shorter != self._shorter:
            self._shorter = shorter
            self.update()
        text = with_micro_signs(text)
        if text == self._whole:  # cards repeat their line at every state that comes
            return
        self._whole = text
        line = " ".join(text.split())
        self.setToolTip("\n".join(part for part in (text, self._hint) if part))
        self.setAccessibleName(line)
        self.setText(line)

    def set_dim(self, dim: bool) -> None:
        """Write in the colour of what matters less; costs a repaint, not a new style."""
        if dim != self._dim:
            self._dim = dim
            self.update()

    def set_tight_font(self, font: QFont) -> None:
        """Write the whole text in this smaller font before a shorter one is shown."""
        self._tight = font
        self.update()

    @override
    def sizeHint(self) -> QSize:
        return QSize(
            self.fontMetrics().horizontalAdvance(self.text()) + 2, super().sizeHint().height()
        )

    @override
    def minimumSizeHint(self) -> QSize:
        return QSize(self.fontMetrics().averageCharWidth() * 4, super().sizeHint().height())

    @override
    def paintEvent(self, event: QPaintEvent) -> None:
        option = QStyleOption()
        option.initFrom(self)
        with painting(self) as painter:
            style = self.style()
            style.drawPrimitive(QStyle.PrimitiveElement.PE_Widget, option, painter, self)
            room = self.contentsRect()
            text, font = self._fitting(room.width())
            painter.setFont(font)
            if self._dim:
                painter.setPen(QColor(current_palette().dim))
            style.drawItemText(
                painter,
                room,
                int(self.alignment()),
                option.palette,
                self.isEnabled(),
                text,
                QPalette.ColorRole.NoRole if self._dim else self.foregroundRole(),
            )

    def _fitting(self, room_px: int) -> tuple[str, QFont]:
        """Return what is written into so much room, and in which font."""
        usual = self.font()
        texts = (self.text(), *self._shorter)
        written = [(each, usual) for each in texts]
        if self._tight is not None:
            written.insert(1, (texts[0], self._tight))
        for text, font in written:
            if QFontMetrics(font).horizontalAdvance(text) <= room_px:
                return text, font
        elide = Qt.TextElideMode.ElideRight
        return QFontMetrics(usual).elidedText(texts[-1], elide, room_px), usual

    @property
    def shown_text(self) -> str:
        """What is written in the room there is."""
        return self._fitting(self.contentsRect().width())[0]

    @override
    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        super().mouseReleaseEvent(event)
        if event.button() == Qt.MouseButton.LeftButton and self.text():
            self.clicked.emit()
