"""How a camera is doing: state, rate, what became of the frames, light and sharpness."""

from typing import Final

from PySide6.QtWidgets import QWidget

from cosmic.frame.clock import WALL
from cosmic.frame.gui.flow_layout import FlowLayout
from cosmic.frame.gui.state_badge import StateBadge
from cosmic.frame.gui.theme import STEP_PX, State
from cosmic.vico.api.camera import CameraHandle
from cosmic.vico.gui.levels import Histogram
from cosmic.vico.gui.readings import FocusBars, Reading
from cosmic.vico.gui.texts import measure_text

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
