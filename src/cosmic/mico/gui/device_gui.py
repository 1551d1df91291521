"""`DeviceGUI`: a group of positioner cards under one title that folds it away."""

from typing import Final

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QHBoxLayout, QSizePolicy, QToolButton, QVBoxLayout, QWidget

from cosmic.frame.gui.build import named, styled, tipped
from cosmic.frame.gui.state_badge import StateBadge
from cosmic.frame.gui.theme import STEP_PX, State, ui_font
from cosmic.mico.core.motion.positioner import PositionerState
from cosmic.mico.gui.positioner_gui import STATES, PositionerBaseGUI

_GRAVITY: Final = (State.OK, State.BUSY, State.UNKNOWN, State.ERROR)


class DeviceGUI(QWidget):
    """The components of one device, or of one assembly as the configuration arranges it.

    The title keeps the gravest state of the group in sight when the cards are folded away.
    """

    def __init__(self, title: str, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName(f"group {title}")
        self.title = title
        self._cards: dict[str, PositionerBaseGUI] = {}
        self._states: dict[str, State] = {}
        self._fold = styled(named(QToolButton(), "fold"), "heading")
        self._fold.setText(title)
        self._fold.setFont(ui_font(bold=True))
        self._fold.setCheckable(True)
        self._fold.setChecked(True)
        self._fold.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextBesideIcon)
        self._fold.setArrowType(Qt.ArrowType.DownArrow)
        self._fold.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        tipped(self._fold, f"Fold or unfold {title}")
        self._fold.toggled.connect(self._on_fold)
        self._badge = StateBadge(State.OK)
        self._body = QWidget()
        self._arrange()

    def _arrange(self) -> None:
        head = QHBoxLayout()
        head.setSpacing(STEP_PX)
        head.addWidget(self._fold)
        head.addStretch(1)
        head.addWidget(self._badge)
        self._column = QVBoxLayout(self._body)
        self._column.setContentsMargins(0, 0, 0, 0)
        self._column.setSpacing(STEP_PX // 2)
        whole = QVBoxLayout(self)
        whole.setContentsMargins(0, 0, 0, 0)
        whole.setSpacing(STEP_PX // 2)
        whole.addLayout(head)
        whole.addWidget(self._body)
        self.setSizePolicy(QSizePolicy.Policy.Preferred, QSizePolicy.Policy.Fixed)

    @property
    def cards(self) -> dict[str, PositionerBaseGUI]:
        """The cards by the name of their axis."""
        return dict(self._cards)

    @property
    def state(self) -> State:
        """The gravest state of the group."""
        return self._badge.state

    def add(self, card: PositionerBaseGUI) -> None:
        """Append a card."""
        self._cards[card.settings.name] = card
        self._column.addWidget(card)

    def show_state(self, state: PositionerState) -> None:
        """Take the state of one axis into account for the title."""
        badge = STATES[state.status]
        if self._states.get(state.name) is badge:
            return
        self._states[state.name] = badge
        gravest = max(self._states.values(), key=_GRAVITY.index)
        names = [name for name, each in self._states.items() if each is gravest]
        if gravest is State.OK:
            names = []
        self._badge.set_state(gravest, ", ".join(names))

    def set_folded(self, folded: bool) -> None:
        """Fold the cards away or show them."""
        self._fold.setChecked(not folded)

    def _on_fold(self, shown: bool) -> None:
        self._body.setVisible(shown)
        arrow = Qt.ArrowType.DownArrow if shown else Qt.ArrowType.RightArrow
        self._fold.setArrowType(arrow)
