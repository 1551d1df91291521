"""The bar above the scene that offers a way round: what it is like, Go, and Cancel."""

import math
from enum import StrEnum
from typing import Final

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QHBoxLayout, QLabel, QProgressBar, QVBoxLayout, QWidget

from cosmic.frame.gui.build import named, push_button
from cosmic.frame.gui.elided_label import ElidedLabel
from cosmic.frame.gui.state_badge import StateBadge
from cosmic.frame.gui.theme import STEP_PX, State, ui_font
from cosmic.frame.overrides import override
from cosmic.mico.api.ways import Way

_ENTER: Final = (Qt.Key.Key_Return, Qt.Key.Key_Enter)
_MILLIMETRE_UM: Final = 1000.0
_TENTHS_BELOW_S: Final = 10.0


class Stage(StrEnum):
    """What the bar is at."""

    NONE = "none"
    SEARCHING = "searching"
    FOUND = "found"
    GOING = "going"
    ENDED = "ended"


class WayBar(QWidget):
    """Says what becomes of a move that something stands in the way of; it decides nothing.

    It takes no focus by itself: Enter presses Go only after the operator went there.

    Signals
    -------
    go_requested()
        The operator wants to go the way shown.
    cancel_requested()
        The operator does not want it, or read why there is none.
    """

    go_requested = Signal()
    cancel_requested = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("wayBar")
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setAccessibleName("Way round")
        self._stage = Stage.NONE
        self._badge = StateBadge(State.BUSY)
        self._head = named(ElidedLabel(), "wayHead")
        self._head.setFont(ui_font(bold=True))
        self._words = named(QLabel(), "wayWords")
        self._words.setTextFormat(Qt.TextFormat.PlainText)
        self._words.setWordWrap(True)
        self._words.setAlignment(Qt.AlignmentFlag.AlignTop)
        self._progress = named(QProgressBar(), "wayProgress")
        self._progress.setAccessibleName("Progress on the way round")
        self._go = named(push_button("Go", "Go this way, part by part"), "wayGo")
        self._cancel = named(push_button("Cancel", ""), "wayCancel")
        self._go.clicked.connect(self.go_requested)
        self._cancel.clicked.connect(self.cancel_requested)
        self._arrange()
        self.clear()

    def _arrange(self) -> None:
        first = QHBoxLayout()
        first.setSpacing(STEP_PX)
        first.addWidget(self._badge)
        first.addWidget(self._head, 1)
        last = QHBoxLayout()
        last.setSpacing(STEP_PX)
        last.addWidget(self._progress, 1)
        last.addStretch(0)
        last.addWidget(self._go)
        last.addWidget(self._cancel)
        for button in (self._go, self._cancel):
            button.setMinimumWidth(10 * STEP_PX)
        column = QVBoxLayout(self)
        column.setContentsMargins(STEP_PX, STEP_PX, STEP_PX, STEP_PX)
        column.setSpacing(STEP_PX // 2)
        column.addLayout(first)
        column.addWidget(self._words)
        column.addLayout(last)

    @property
    def stage(self) -> Stage:
        """What it is at."""
        return self._stage

    @property
    def text(self) -> str:
        """What it says; empty when there is nothing to say."""
        parts = (self._head.text(), self._words.text())
        return "" if self._stage is Stage.NONE else "\n".join(part for part in parts if part)

    def clear(self) -> None:
        """Have nothing to say."""
        self._stage = Stage.NONE
        self.hide()

    def show_search(self, what: str, why: str) -> None:
        """Say that a way is looked for, and why the straight one will not do."""
        self._show(Stage.SEARCHING, State.BUSY, f"Looking for a way for {what}", why)
        self._progress.setRange(0, 0)

    def show_found(self, what: str, way: Way) -> None:
        """Offer a way."""
        words = f"{way_text(way)}. Nothing moves before you press Go."
        self._show(Stage.FOUND, State.OK, f"Way found for {what}", words)

    def show_going(self, what: str) -> None:
        """Say that the way is being gone."""
        self._show(Stage.GOING, State.BUSY, f"Going round: {what}", "")
        self._progress.setRange(0, 100)
        self._progress.setValue(0)

    def show_progress(self, fraction: float, text: str) -> None:
        """Say how far it is."""
        if self._stage is Stage.GOING:
            self._progress.setValue(round(100 * fraction))
            self._words.setText(text)

    def show_end(self, head: str, why: str) -> None:
        """Say why there is no way, or why it was left."""
        self._show(Stage.ENDED, State.REFUSED, head, why)

    def say(self, words: str) -> None:
        """Say something else of what is shown."""
        self._words.setText(words)

    def _show(self, stage: Stage, state: State, head: str, words: str) -> None:
        self._stage = stage
        self._badge.set_state(state)
        self._head.set_text(head)
        self._words.setText(words)
        self._words.ensurePolished()  # room for two lines always: the scene below keeps its place
        self._words.setMinimumHeight(2 * self._words.fontMetrics().lineSpacing() + 2)
        self._go.setVisible(stage is Stage.FOUND)
        self._progress.setVisible(stage in (Stage.SEARCHING, Stage.GOING))
        self._cancel.setText("Close" if stage is Stage.ENDED else "Cancel")
        self._cancel.setToolTip(_CANCEL_TIPS[stage])
        self.show()

    @override
    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.key() not in _ENTER or event.isAutoRepeat():
            super().keyPressEvent(event)
        elif self._cancel.hasFocus():
            self._cancel.click()
        elif self._stage is Stage.FOUND:
            self._go.click()


_CANCEL_TIPS: Final = {
    Stage.SEARCHING: "Look no further",
    Stage.FOUND: "Leave everything where it is",
    Stage.GOING: "Stop here and leave the way",
    Stage.ENDED: "Take this note away",
}


def way_text(way: Way) -> str:
    """Return what a way is like, such as "detour, 9.2 mm instead of 4.0 mm, about 3 s, 5 parts"."""
    count = len(way.waypoints)
    lengths = f"{_length_text(way.length)} instead of {_length_text(way.straight_length)}"
    parts = [way.method, lengths]
    if math.isfinite(way.duration_s):
        digits = 1 if way.duration_s < _TENTHS_BELOW_S else 0
        parts.append(f"about {way.duration_s:.{digits}f} s")
    parts.append(f"{count} part{'' if count == 1 else 's'}")
    return ", ".join(parts)


def _length_text(length_um: float) -> str:
    if length_um < _MILLIMETRE_UM:
        return f"{length_um:.0f} µm"
    return f"{length_um / _MILLIMETRE_UM:.1f} mm"
