"""The card on the picture of one operation on a fibre: what it is at, and what came of it."""

from typing import TYPE_CHECKING, Final

from PySide6.QtCore import Qt, QTimer, Signal
from PySide6.QtWidgets import (
    QFrame,
    QGridLayout,
    QLabel,
    QProgressBar,
    QSizePolicy,
    QVBoxLayout,
    QWidget,
)

from cosmic.autonomy.procedures.run import OVER, ProcedureRun, RunState
from cosmic.autonomy.procedures.tree import ENDS, OPERATION, RUNNING_STATES, NodeView
from cosmic.daqco.gui.value_field import ValueField
from cosmic.frame.gui.build import click_once, named, push_button, styled, tight_row
from cosmic.frame.gui.elided_label import ElidedLabel
from cosmic.frame.gui.key_focus import set_shown
from cosmic.frame.gui.state_badge import StateBadge
from cosmic.frame.gui.theme import STEP_PX, State, number_font
from cosmic.frame.units import with_micro_signs

if TYPE_CHECKING:
    from cosmic.autonomy.handling.context import HandlingContext
    from cosmic.autonomy.shipped.single_operation import OperationResult

CARD_PX: Final = 38 * STEP_PX
LOOK_MS: Final = 150
_MOST_VALUES: Final = 4


def share_done(view: NodeView) -> float:
    """Return how much of a procedure is behind it, 0 to 1, by its operations."""
    parts = [each for each in view.walk() if each.kind == OPERATION]
    behind = sum(each.state in ENDS for each in parts)
    return behind / len(parts) if parts else 0.0


def at_work(view: NodeView) -> str:
    """Return the operation that is carried out now, as it is read; empty for none."""
    running = (each.name for each in view.walk() if each.kind == OPERATION)
    states = {each.name: each.state for each in view.walk() if each.kind == OPERATION}
    found = next((name for name in running if states[name] in RUNNING_STATES), "")
    return with_micro_signs(found)


class OperationCard(QFrame):
    """Shows one operation while it runs and how it ended; GUI thread.

    Signals
    -------
    next_requested()
        The button of the next operation was pressed.
    undo_requested()
        What was done last is to be taken back.
    push_requested(float)
        The fibre is to be pushed to that force, uN.
    resized()
        It needs another place: it shows more, or less.
    """

    next_requested = Signal()
    undo_requested = Signal()
    push_requested = Signal(float)
    resized = Signal()

    def __init__(self, force_un: float, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("operationCard")
        self.setAttribute(Qt.WidgetAttribute.WA_StyledBackground)
        self.setFixedWidth(CARD_PX)
        self._run: ProcedureRun[HandlingContext] | None = None
        self._offered: dict[QWidget, bool] = {}
        self.badge = StateBadge(State.BUSY)
        self.title = named(ElidedLabel(), "operationTitle")
        self.line = named(QLabel(), "operationLine")
        self.line.setWordWrap(True)
        self.line.setAlignment(Qt.AlignmentFlag.AlignTop)
        self.line.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Preferred)
        self.progress = named(QProgressBar(), "operationProgress")
        self.progress.setRange(0, 100)
        self.progress.setAccessibleName("Progress of the operation")
        self.stop = named(
            push_button("End", "End it: moves are cancelled, then the tools are made safe"),
            "operationStop",
        )
        click_once(self.stop)
        self.close_button = styled(push_button("✕", "Close this card"), "narrow")
        self.next = named(push_button("", ""), "operationNext")
        self.undo = named(push_button("Undo", ""), "operationUndo")
        self.force = named(ValueField("Force to push to; Enter pushes", "uN"), "operationForce")
        self.force.set_value(force_un)
        self.push = named(push_button("Push", "Push the fibre to this force"), "operationPush")
        self._values: list[tuple[QLabel, QLabel]] = []
        self._build()
        self._connect()
        self._look = QTimer(self, interval=LOOK_MS)
        self._look.timeout.connect(self.refresh)
        self.hide()

    def _build(self) -> None:
        head, row = tight_row(STEP_PX)
        row.addWidget(self.badge)
        row.addWidget(self.title, 1)
        row.addWidget(self.close_button)
        values, grid = QWidget(), QGridLayout()
        values.setLayout(grid)
        grid.setContentsMargins(0, 0, 0, 0)
        grid.setHorizontalSpacing(STEP_PX)
        grid.setVerticalSpacing(0)
        grid.setColumnStretch(1, 1)
        for number in range(_MOST_VALUES):
            pair = QLabel(), named(QLabel(), "operationValue")
            pair[1].setFont(number_font(bold=True))
            for place, label in enumerate(pair):
                grid.addWidget(label, number, place)
            self._values.append(pair)
        foot, row = tight_row(STEP_PX // 2)
        for each in (self.next, self.force, self.push, self.undo):
            row.addWidget(each)
        self._foot = foot
        column = QVBoxLayout(self)
        column.setContentsMargins(STEP_PX, STEP_PX // 2, STEP_PX, STEP_PX // 2)
        column.setSpacing(STEP_PX // 2)
        for widget in (head, self.line, values, self.progress, self.stop, foot):
            column.addWidget(widget)

    def _connect(self) -> None:
        self.stop.clicked.connect(self._on_stop)
        self.close_button.clicked.connect(self.hide)
        self.next.clicked.connect(self.next_requested)
        self.undo.clicked.connect(self.undo_requested)
        self.push.clicked.connect(self._on_push)
        self.force.returnPressed.connect(self._on_push)

    # What is shown

    def follow(self, title: str, run: "ProcedureRun[HandlingContext]") -> None:
        """Show a run from its begin to its end."""
        self._run = run
        self.title.set_text(title)
        self._show_values(())
        self._look.start()
        self.refresh()
        self._fit()

    def show_result(self, result: "OperationResult") -> None:
        """Show how an operation ended."""
        self._run = None
        self._look.stop()
        self.title.set_text(result.title)
        self._show_outcome(result)
        self.line.setText(with_micro_signs(result.text))
        self._show_values(result.values)
        self._fit()

    def _show_outcome(self, result: "OperationResult") -> None:
        """Show by the badge how it ended; what the operator wanted is no error."""
        if result.good:
            self.badge.set_state(State.OK)
        elif result.interrupted:
            self.badge.set_state(State.REFUSED, word=result.interrupted.upper())
        else:
            self.badge.set_state(State.ERROR)

    def show_refused(self, title: str, why: str) -> None:
        """Show that an operation did not begin, and why."""
        self._run = None
        self._look.stop()
        self.title.set_text(title)
        self.badge.set_state(State.REFUSED)
        self.line.setText(with_micro_signs(why))
        self._show_values(())
        self._fit()

    def offer(self, follow_up: str, *, push: bool, undo: str) -> None:
        """Offer the next operation by its title, a push, and to undo; empty for none."""
        self._offered = {
            self.next: bool(follow_up),
            self.force: push,
            self.push: push,
            self.undo: bool(undo),
        }
        self.next.setText(follow_up)
        self.next.setToolTip(follow_up)
        self.undo.setToolTip(undo)
        self._fit()

    def _show_values(self, values: tuple[tuple[str, str], ...]) -> None:
        if len(values) > _MOST_VALUES:
            more = len(values) - _MOST_VALUES + 1
            values = (*values[: _MOST_VALUES - 1], (f"and {more} more", ""))
        for number, (name, value) in enumerate(self._values):
            shown = number < len(values)
            name.setVisible(shown)
            value.setVisible(shown)
            if shown:
                name.setText(values[number][0])
                value.setText(values[number][1])

    def refresh(self) -> None:
        """Show what the run is at now."""
        run = self._run
        if run is None or run.state in OVER:
            return
        ending = run.state is RunState.ABORTING
        self.badge.set_state(State.BUSY)
        view = run.tree
        text = "ending, and making safe" if ending else at_work(view)
        if text != self.line.text():
            self.line.setText(text)
            self._fit()
        self.progress.setValue(round(100 * share_done(view)))
        if ending and self.stop.hasFocus():
            self.setFocus()
        self.stop.setEnabled(not ending)

    def _fit(self) -> None:
        running = self._run is not None
        set_shown(self.progress, self, shown=running)
        set_shown(self.stop, self, shown=running)
        set_shown(self.close_button, self, shown=not running)
        for widget, wanted in self._offered.items():
            set_shown(widget, self, shown=wanted and not running)
        self._foot.setVisible(not running and any(self._offered.values()))
        self.show()
        column = self.layout()
        if column is not None:  # adjustSize would take the height of another width
            column.activate()
            height = column.totalHeightForWidth(CARD_PX)
            if not column.hasHeightForWidth():  # nothing was said on it yet
                height = column.totalSizeHint().height()
            self.resize(CARD_PX, height)
        self.resized.emit()

    # What the operator does

    def _on_stop(self) -> None:
        if self._run is not None:
            self._run.abort("ended by the operator")

    def _on_push(self) -> None:
        if self.force.take():
            self.push_requested.emit(self.force.value())
