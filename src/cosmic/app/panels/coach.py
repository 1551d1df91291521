"""The coach: what to do next, in a sentence with one button, from the state of the platform."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

from PySide6.QtCore import QSettings, Qt, QTimer
from PySide6.QtWidgets import (
    QFrame,
    QPushButton,
    QScrollArea,
    QSizePolicy,
    QVBoxLayout,
    QWidget,
)

from cosmic.frame.gui.build import named, push_button, styled, tight_row, wrapped_label
from cosmic.frame.gui.key_focus import set_shown
from cosmic.frame.gui.theme import STEP_PX
from cosmic.frame.units import with_micro_signs

LEAST_LINES: Final = 3
MOST_LINES: Final = 7
LOOK_MS: Final = 400
_KEY: Final = "coach/off"


@dataclass(frozen=True)
class Step:
    """What to do next.

    Attributes
    ----------
    text : str
        One sentence: what, and why.
    button : str
        What stands on the button; empty where there is nothing to press.
    act : callable or None
        What the button does.
    """

    text: str
    button: str = ""
    act: Callable[[], object] | None = None


Rule = Callable[[], Step | None]
"""Looks at the platform, and returns a step where it has one to propose."""


class Coach(QFrame):
    """Asks its rules in order and shows the first step that one of them has; GUI thread.

    Parameters
    ----------
    rules : sequence of callable
        The most urgent first.
    settings : QSettings
        Remembers that it was switched off.
    """

    def __init__(
        self, rules: Sequence[Rule], settings: QSettings, parent: QWidget | None = None
    ) -> None:
        super().__init__(parent)
        self.setObjectName("coach")
        self._rules = tuple(rules)
        self._settings = settings
        self._step: Step | None = None
        self.off = styled(named(push_button("off", "Switch the coach off"), "coachOff"), "narrow")
        self.off.setCheckable(True)
        self.off.setChecked(str(settings.value(_KEY, "")).lower() == "true")
        self.off.clicked.connect(self._on_off)
        self._name_off()
        self.words = named(wrapped_label(), "coachWords")
        line_px = self.words.fontMetrics().lineSpacing()
        # Long words scroll by themselves in a low panel: the button below them is always seen.
        room = named(QScrollArea(), "coachRoom")
        room.setWidgetResizable(True)
        room.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        room.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Expanding)
        room.setMinimumHeight(LEAST_LINES * line_px)
        # No more, so that the button is below the words in a high panel, too, and stays there.
        room.setMaximumHeight(MOST_LINES * line_px)
        room.setWidget(self.words)
        self.button: QPushButton = named(push_button("", ""), "coachButton")
        self.button.clicked.connect(self._on_pressed)
        foot, row = tight_row(STEP_PX)
        row.addWidget(self.button, 1, Qt.AlignmentFlag.AlignTop)
        row.addWidget(self.off, 0, Qt.AlignmentFlag.AlignTop)
        column = QVBoxLayout(self)
        column.setContentsMargins(STEP_PX, STEP_PX // 2, STEP_PX, STEP_PX // 2)
        column.setSpacing(STEP_PX // 2)
        column.addWidget(room, 1)
        column.addWidget(foot)
        kept = self.button.sizePolicy()
        kept.setRetainSizeWhenHidden(True)
        self.button.setSizePolicy(kept)
        self._look = QTimer(self, interval=LOOK_MS)
        self._look.timeout.connect(self.look)
        self._look.start()
        self.look()

    def _name_off(self) -> None:
        is_off = self.off.isChecked()
        self.off.setText("on" if is_off else "off")
        self.off.setToolTip("Switch the coach on" if is_off else "Switch the coach off")

    @property
    def step(self) -> Step | None:
        """What is proposed."""
        return self._step

    def look(self) -> None:
        """Look at the platform again."""
        if self.off.isChecked():
            self._show(None)
            return
        self._show(next((step for step in (rule() for rule in self._rules) if step), None))

    def _show(self, step: Step | None) -> None:
        self._step = step
        text = with_micro_signs(step.text) if step is not None else ""
        if self.words.text() != text:
            self.words.setText(text)
            self.words.setToolTip(text)
        set_shown(self.button, self, shown=step is not None and bool(step.button))
        if step is not None and self.button.text() != step.button:
            self.button.setText(step.button)
            self.button.setToolTip(text)

    def _on_pressed(self) -> None:
        if self._step is not None and self._step.act is not None:
            self._step.act()
            self.look()

    def _on_off(self) -> None:
        self._name_off()
        self._settings.setValue(_KEY, "true" if self.off.isChecked() else "false")
        self.look()
