"""The part of a card that says whether its axis is checked for collisions, and switches that."""

from typing import Final

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QHideEvent
from PySide6.QtWidgets import QHBoxLayout, QLabel, QPushButton, QVBoxLayout, QWidget

from cosmic.frame.gui.build import named, push_button, set_style_property, styled, tipped
from cosmic.frame.gui.theme import STEP_PX
from cosmic.frame.overrides import override
from cosmic.mico.gui.overlay import Overlay

NO_MODEL_TIP: Final = (
    "No collision model: movements within the limits are made without a check for collisions"
)
UNWATCHED_TEXT: Final = "▲ taken out of collision detection: its movements are NOT checked"
_QUESTION_PX: Final = 40 * STEP_PX


class CollisionSwitch(QPushButton):
    """Says "CD on" or, loudly, "CD OFF"; asks before it takes an axis out, never to take it in.

    Parameters
    ----------
    axis : str
        Name of the axis.

    Signals
    -------
    wanted(bool)
        The operator wants the axis checked, or taken out.
    """

    wanted = Signal(bool)

    def __init__(self, axis: str, parent: QWidget | None = None) -> None:
        super().__init__("CD OFF", parent)
        self._axis = axis
        self._model = False
        self._watched = True
        styled(self, "narrow")
        self.setFixedWidth(self.fontMetrics().horizontalAdvance("CD OFF") + 2 * STEP_PX + 2)
        self.setFocusPolicy(Qt.FocusPolicy.TabFocus)
        self.indicator = QLabel("▲")
        self.indicator.setFixedWidth(self.indicator.fontMetrics().horizontalAdvance("▲") + 2)
        self.clicked.connect(self._on_clicked)
        self.show_detection(model=False, watched=True)

    @property
    def question(self) -> "TakeOutQuestion | None":
        """The question that waits for an answer in this window, if it is about this axis."""
        found = self.window().findChild(
            TakeOutQuestion, options=Qt.FindChildOption.FindDirectChildrenOnly
        )
        if isinstance(found, TakeOutQuestion) and found.anchor is self:
            return found
        return None

    def show_detection(self, *, model: bool, watched: bool) -> None:
        """Show whether there is a collision model, and whether the axis is checked with it."""
        self._model, self._watched = model, watched
        self.setEnabled(model)
        self.setText("CD OFF" if model and not watched else "CD on" if model else "CD off")
        self.setAccessibleName(f"{self._axis} collision detection {'on' if watched else 'off'}")
        set_style_property(self, "watched", watched or not model)
        if not model:
            tip, meaning = f"Not available: {NO_MODEL_TIP.lower()}", "no collision model"
        elif watched:
            tip = f"{self._axis} is checked for collisions; press to take it out"
            meaning = "checked for collisions"
        else:
            tip = f"{self._axis} is NOT checked for collisions; press to check it again"
            meaning = "not checked for collisions"
        self.setToolTip(tip)
        calm = model and watched
        self.indicator.setText("" if calm else "▲")
        self.indicator.setAccessibleName(meaning)
        tipped(self.indicator, tip if model else NO_MODEL_TIP)

    def _on_clicked(self) -> None:
        if not self._watched:
            self.wanted.emit(True)
            return
        if self.question is not None:
            self.question.close()
            return
        question = TakeOutQuestion(self._axis, self)
        question.agreed.connect(self._on_agreed)
        question.open_below(question.cancel)

    def _on_agreed(self) -> None:
        self.wanted.emit(False)

    @override
    def hideEvent(self, event: QHideEvent) -> None:
        super().hideEvent(event)
        if self.question is not None:
            self.question.close()


class TakeOutQuestion(Overlay):
    """Asks once more, below the switch; whatever else takes the focus is taken for a no.

    Signals
    -------
    agreed()
        Take it out.
    """

    agreed = Signal()

    def __init__(self, axis: str, switch: CollisionSwitch) -> None:
        super().__init__(switch)
        self.setObjectName("takeOutQuestion")
        text = QLabel(f"Take {axis} out of collision detection? It can then collide with anything.")
        text.setWordWrap(True)
        text.setFixedWidth(_QUESTION_PX - 2 * STEP_PX)
        self.cancel = named(push_button("Cancel", "Leave it checked"), "cancelTakeOut")
        self.take_out = named(
            push_button("Take out", f"Move {axis} unchecked until CD is switched on again"),
            "takeOut",
        )
        buttons = QHBoxLayout()
        buttons.addStretch(1)
        buttons.addWidget(self.take_out)
        buttons.addWidget(self.cancel)
        column = QVBoxLayout(self)
        column.setContentsMargins(STEP_PX, STEP_PX, STEP_PX, STEP_PX)
        column.setSpacing(STEP_PX)
        column.addWidget(text)
        column.addLayout(buttons)
        self.cancel.clicked.connect(self.close)
        self.take_out.clicked.connect(self._on_take_out)

    def _on_take_out(self) -> None:
        self.agreed.emit()
        self.close()
