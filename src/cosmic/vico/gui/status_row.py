"""How a camera is doing: state, rate, what became of the frames, light and sharpness.

The numbers have fixed widths, so that nothing moves when they change.
"""

from collections import deque
from typing import Final

from PySide6.QtCore import QRectF, QSize, Qt
from PySide6.QtGui import QColor, QPaintEvent
from PySide6.QtWidgets import QSizePolicy, QWidget

from cosmic.frame.clock import WALL
from cosmic.frame.gui.flow_layout import FlowLayout
from cosmic.frame.gui.painting import painting
from cosmic.frame.gui.palette import INK, OKABE_ITO
from cosmic.frame.gui.state_badge import StateBadge
from cosmic.frame.gui.theme import STEP_PX, State, current_palette, number_font
from cosmic.frame.overrides import override
from cosmic.vico.api.camera import CameraHandle
from cosmic.vico.gui.levels import Histogram
from cosmic.vico.gui.texts import measure_text

BARS: Final = 24
_MIDDLE: Final = int(Qt.AlignmentFlag.AlignVCenter | Qt.AlignmentFlag.AlignLeft)


class Reading(QWidget):
    """A number between its name and its unit, both dimmed; as wide as `widest` needs.

    Parameters
    ----------
    before, after : str
        Name and unit.
    widest : str
        The longest number.
    """

    def __init__(
        self, before: str, widest: str, after: str, tip: str, parent: QWidget | None = None
    ) -> None:
        super().__init__(parent)
        self._before, self._after, self._number = before, after, "–"
        self._alarm = False
        self.setFont(number_font())
        self.setToolTip(tip)
        self.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Fixed)
        metrics = self.fontMetrics()
        parts = [text for text in (before, widest, after) if text]
        width = sum(metrics.horizontalAdvance(text) + STEP_PX // 2 for text in parts)
        self.setFixedSize(width + STEP_PX, metrics.height() + 2)

    def text(self) -> str:
        """Return the whole of it."""
        return " ".join(part for part in (self._before, self._number, self._after) if part)

    def show_number(self, number: str, *, alarm: bool = False) -> None:
        """Show another number; `alarm` colours the ground, for one that should be 0."""
        if (number, alarm) == (self._number, self._alarm):
            return
        self._number, self._alarm = number, alarm
        self.setAccessibleName(self.text())
        self.update()

    @override
    def paintEvent(self, event: QPaintEvent) -> None:
        colours = current_palette()
        with painting(self) as painter:
            if self._alarm:
                painter.fillRect(self.rect(), QColor(OKABE_ITO["orange"]))
            dim, ink = (INK, INK) if self._alarm else (colours.dim, colours.text)
            x = STEP_PX // 2
            for text, colour in ((self._before, dim), (self._number, ink), (self._after, dim)):
                if text:
                    painter.setPen(QColor(colour))
                    width = self.fontMetrics().horizontalAdvance(text)
                    painter.drawText(x, 0, width + 1, self.height(), _MIDDLE, text)
                    x += width + STEP_PX // 2


class FocusBars(QWidget):
    """The last values of a measure, the newest on the right; a full bar is the best seen."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.values: deque[float] = deque(maxlen=BARS)
        self.best = 0.0
        self.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Fixed)
        self.setToolTip(
            "Sharpness over the last seconds; a full bar is the best seen\nClick to start again"
        )
        self.setAccessibleName("Sharpness over the last seconds")

    def add(self, value: float) -> None:
        """Take over the newest value."""
        self.values.append(value)
        self.best = max(self.best, value)
        self.update()

    def clear(self) -> None:
        """Forget what was best."""
        self.values.clear()
        self.best = 0.0
        self.update()

    @override
    def sizeHint(self) -> QSize:
        return QSize(BARS * 3 + 2, 2 * STEP_PX + 2)

    @override
    def mousePressEvent(self, event: object) -> None:
        self.clear()

    @override
    def paintEvent(self, event: QPaintEvent) -> None:
        colours = current_palette()
        with painting(self) as painter:
            painter.fillRect(self.rect(), QColor(colours.field))
            painter.setPen(Qt.PenStyle.NoPen)
            room = self.height() - 2.0
            first = BARS - len(self.values)
            for number, value in enumerate(self.values):
                height = room * value / self.best if self.best > 0.0 else 0.0
                newest = number == len(self.values) - 1
                painter.setBrush(QColor(colours.accent if newest else colours.dim))
                painter.drawRect(QRectF(1 + 3 * (first + number), 1 + room - height, 2, height))


RATE_OVER_S: Final = 1.0


class StatusRow(QWidget):
    """Readings side by side; they go on in a new line where it is narrow."""

    def __init__(self, camera: CameraHandle, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._camera = camera
        self._since_s, self._since_count = WALL.now_s(), camera.counters.completed
        self._rate_hz: float | None = None
        self.badge = StateBadge(State.UNKNOWN)
        self.rate = Reading("", "000.0", "Hz", "Images received per second")
        self.completed = Reading("", "00000000", "whole", "Complete images")
        self.failed = Reading("failed", "00000", "", "Incomplete images; they are not shown")
        self.lost = Reading(
            "lost", "00000", "", "Lost images, counted by gaps in the frame numbers"
        )
        self.dropped = Reading(
            "dropped", "00000", "", "Images dropped because this computer was too slow"
        )
        self.over = Reading("over-exposed", "00.00", "%", "Share of over-exposed pixels")
        self.focus = Reading(
            "focus", "000000.0", "", "Sharpness of the newest image; larger is sharper"
        )
        self.bars = FocusBars()
        flow = FlowLayout(STEP_PX // 2, self)
        for widget in self.readings:
            flow.addWidget(widget)

    @property
    def readings(self) -> tuple[QWidget, ...]:
        """All that is shown, in order."""
        counted = (self.completed, self.failed, self.lost, self.dropped)
        return (self.badge, self.rate, *counted, self.over, self.focus, self.bars)

    def show_state(self, state: State, detail: str) -> None:
        """Say how the camera is."""
        self.badge.set_state(state, detail)

    def refresh(self, histogram: Histogram | None) -> None:
        """Show the numbers as they are now."""
        counters = self._camera.counters
        self._measure_rate(counters.completed)
        self.rate.show_number("–" if self._rate_hz is None else f"{self._rate_hz:.1f}")
        self.completed.show_number(f"{counters.completed}")
        for reading, count in (
            (self.failed, counters.failed),
            (self.lost, counters.lost),
            (self.dropped, counters.underrun),
        ):
            reading.show_number(f"{count}", alarm=count > 0)
        over = 0.0 if histogram is None else 100.0 * histogram.over
        self.over.show_number(f"{over:.2f}")
        focus = self._camera.focus
        self.focus.show_number("–" if focus is None else measure_text(focus))
        if focus is not None:
            self.bars.add(focus)

    def _measure_rate(self, count: int) -> None:
        now_s = WALL.now_s()
        if count < self._since_count or not self._camera.running:
            self._since_s, self._since_count, self._rate_hz = now_s, count, None
        elif now_s - self._since_s >= RATE_OVER_S:
            self._rate_hz = (count - self._since_count) / (now_s - self._since_s)
            self._since_s, self._since_count = now_s, count
