"""`PositionerBaseGUI`: the card of a positioner without sensor, and the base of all others."""

from collections.abc import Sequence
from typing import ClassVar, Final

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QHBoxLayout, QPushButton, QToolButton, QVBoxLayout, QWidget
from shiboken6 import isValid

from cosmic.frame.errors import CosmicError
from cosmic.frame.gui.build import named, push_button, tipped
from cosmic.frame.gui.elided_label import ElidedLabel
from cosmic.frame.gui.quantity_field import QuantityField
from cosmic.frame.gui.state_badge import StateBadge
from cosmic.frame.gui.theme import STEP_PX, State, number_font, state_look, ui_font
from cosmic.mico.api.axis import Axis
from cosmic.mico.core.motion.movement import Movement
from cosmic.mico.core.motion.positioner import Confidence, PositionerState, Status
from cosmic.mico.core.motion.settings import MotionDefaults, PositionerSettings
from cosmic.mico.gui.axis_commands import AxisCommands
from cosmic.mico.gui.card import Card, ConfidenceMark, PositionDisplay
from cosmic.mico.gui.collision_switch import UNWATCHED_TEXT, CollisionSwitch
from cosmic.mico.gui.key_names import key_text

_REFUSED: Final = f"{state_look(State.REFUSED).glyph} {state_look(State.REFUSED).word}: "


class StepsPart(QWidget):
    """How many steps, how fast and how large; used by every kind of positioner."""

    def __init__(self, axis: Axis, defaults: MotionDefaults, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._axis = axis
        can = axis.details  # the ranges of its controller, which was asked for them
        most = (0, can.most_steps)
        self.steps = _whole("MiCoOL_5", "steps", most, defaults.steps, "Steps per click")
        self.frequency = _whole(
            "MiCoOL_6", "Hz", can.frequency_range_hz, defaults.frequency_hz, "Steps per second"
        )
        low, high = can.amplitude_range_v
        shown_v = min(max(defaults.amplitude_v, low), high)
        self.amplitude = named(
            QuantityField("V", low=low, high=high, value=shown_v, name="Amplitude of a step"),
            "MiCoOL_7",
        )
        row = QHBoxLayout(self)
        row.setContentsMargins(0, 0, 0, 0)
        row.setSpacing(STEP_PX // 2)
        for field in self.fields:
            field.setMaximumWidth(15 * STEP_PX)
            row.addWidget(field, 1)

    @property
    def fields(self) -> tuple[QuantityField, QuantityField, QuantityField]:
        """Steps, frequency and amplitude."""
        return self.steps, self.frequency, self.amplitude

    def commit(self) -> bool:
        """Check all three entries; False when one was refused."""
        accepted = [field.commit() for field in self.fields]  # each shows its own reason
        return all(accepted)

    def make(self, direction: int, *, consent: bool) -> Movement:
        """Make the steps in `direction`, 1 or -1."""
        return self._axis.steps(
            direction * self.steps.value(),
            amplitude_v=self.amplitude.value(),
            frequency_hz=self.frequency.value(),
            wait=False,
            consent=consent,
        )


def _whole(
    object_name: str, unit: str, span: tuple[int, int], value: int, name: str
) -> QuantityField:
    low, high = span
    shown = float(min(max(value, low), high))
    field = QuantityField(unit, low=low, high=high, value=shown, integers=True, name=name)
    return named(field, object_name)


STATES: Final = {
    Status.OK: State.OK,
    Status.BUSY: State.BUSY,
    Status.ERROR: State.ERROR,
    Status.UNKNOWN: State.UNKNOWN,
}
_SMALL_PX: Final = 11
_TITLE_PX: Final = 10 * STEP_PX


class PositionerBaseGUI(Card):
    """Shows and commands one positioner that makes steps (fields MiCoOL.1 to MiCoOL.7).

    A card for another kind derives from it, overrides the `_make_` and `_show_` methods it needs
    and is entered in `registry.POSITIONER_GUIS`. It decides nothing: each click is one call on
    `Axis`, and what the gate says comes back to the field it came from.

    Parameters
    ----------
    axis : Axis
        What it commands.
    settings : PositionerSettings
        Texts and keys.
    defaults : MotionDefaults
        What stands in the fields at first.

    Signals
    -------
    consent_wanted(ConsentRequest)
        A movement waits for the operator's decision.
    status_changed()
        The line at its foot says something else.
    """

    consent_wanted = Signal(object)
    status_changed = Signal()

    state_name: ClassVar[str] = "MiCoOL_1"
    title_name: ClassVar[str] = "MiCoOL_2"
    forward_name: ClassVar[str] = "MiCoOL_3"
    backward_name: ClassVar[str] = "MiCoOL_4"
    position_name: ClassVar[str] = "position"
    indicator_name: ClassVar[str] = "collisionSign"
    switch_name: ClassVar[str] = "collisionSwitch"

    def __init__(
        self,
        axis: Axis,
        settings: PositionerSettings,
        defaults: MotionDefaults,
        parent: QWidget | None = None,
    ) -> None:
        super().__init__(parent)
        self.setObjectName(f"card {settings.name}")
        self.axis = axis
        self.settings = settings
        self.commands = AxisCommands(settings.name, self)
        self._defaults = defaults
        self._note = ""
        self._refused: QuantityField | None = None
        self._watched = True
        self._stopped = ""
        self._state: PositionerState | None = None
        self._shown: tuple[State, str, State] | None = None
        self._inputs: list[QWidget] = []
        self._usual_tips: dict[QWidget, str] = {}
        self._make_common()
        self._steps = StepsPart(axis, defaults)
        self._arrange()
        self._inputs += self._list_inputs()
        self.commands.begun.connect(self._on_begun)
        self.commands.refused.connect(self._on_refused)
        self.commands.refusal_over.connect(self._on_refusal_over)
        self.commands.ended.connect(self._on_ended)
        self.commands.noted.connect(self._set_note)
        self.commands.consent_wanted.connect(self.consent_wanted)

    # Putting it together

    def _make_common(self) -> None:
        settings = self.settings
        title = settings.title or settings.name
        self._badge = named(StateBadge(State.UNKNOWN), self.state_name)
        self._title = named(ElidedLabel(title, hint=f"Axis {settings.name}"), self.title_name)
        self._title.setFont(ui_font(bold=True))
        wanted = self._title.fontMetrics().horizontalAdvance(title) + 2
        self._title.setMinimumWidth(min(wanted, _TITLE_PX))
        self._position = PositionDisplay(settings.unit, self.position_name)
        self._confidence = ConfidenceMark()
        self._detection = named(CollisionSwitch(settings.name), self.switch_name)
        self._detection.indicator.setObjectName(self.indicator_name)
        self._detection.wanted.connect(self._on_detection_wanted)
        self._stop = named(QToolButton(), "stopAxis")
        self._stop.setText("■")
        tipped(self._stop, f"Stop {settings.name}; the other axes go on")
        self._stop.clicked.connect(self.halt)
        self._forward = self._direction_button(settings.forward_text, settings.forward_key, "+")
        self._forward.setObjectName(self.forward_name)
        self._forward.clicked.connect(self._on_forward)
        self._backward = self._direction_button(settings.backward_text, settings.backward_key, "-")
        self._backward.setObjectName(self.backward_name)
        self._backward.clicked.connect(self._on_backward)
        self._line = named(ElidedLabel(), "status")
        self._line.setFont(number_font(_SMALL_PX))
        self._line.setFixedHeight(2 * STEP_PX)

    def _direction_button(self, text: str, key: str, sign: str) -> QPushButton:
        key = key_text(key)
        name = self.settings.name
        held = f"; hold the key {key} to move continuously" if key else ""
        heading = "forwards" if sign == "+" else "backwards"
        button = push_button(
            f"{text} [{key}]" if key else text, f"Move {name} {heading} once{held}"
        )
        button.setAccessibleName(f"{name} {text}")
        button.setMinimumWidth(12 * STEP_PX)
        return button

    def _arrange(self) -> None:
        column = QVBoxLayout(self)
        column.setContentsMargins(STEP_PX + 2, STEP_PX - 2, STEP_PX, STEP_PX // 2)
        column.setSpacing(STEP_PX // 2)
        column.addWidget(_row(self._first_row(), stretch=self._title))
        column.addWidget(_row(self._second_row()))
        more = self._more_row()
        if more is not None:
            column.addWidget(more)
        column.addWidget(self._line)

    def _first_row(self) -> Sequence[QWidget]:
        detection = (self._detection.indicator, self._detection)
        return self._badge, self._title, self._position, self._confidence, *detection, self._stop

    def _second_row(self) -> Sequence[QWidget]:
        return self._backward, self._steps, self._forward

    def _more_row(self) -> QWidget | None:
        """Return the part that is hidden at first, or None."""
        return None

    def _list_inputs(self) -> Sequence[QWidget]:
        """Return what cannot be used while the axis is absent."""
        return self._forward, self._backward, self._stop, *self._steps.fields

    # Showing

    def show_state(self, state: PositionerState) -> None:
        """Show the newest state of the axis."""
        self._state = state
        self.commands.note_state(state)
        self._show_badge(STATES[state.status], state.error or self._activity_text(state))
        known = state.confidence is not Confidence.UNKNOWN
        self._position.show_position(state.shown_position, known=known)
        self._confidence.set_confidence(state.confidence, state.std)
        self._show_usable(state)
        self._show_line(state)

    def show_detection(self, *, model: bool, watched: bool) -> None:
        """Show whether there is a collision model, and whether this axis is checked with it."""
        self._detection.show_detection(model=model, watched=watched)
        self._watched = watched
        self.set_loud(model and not watched)
        if self._state is not None:
            self._show_line(self._state)

    def show_stopped(self, reason: str | None) -> None:
        """Show that the stop is latched, and why; None: movements are allowed again."""
        was_stopped = bool(self._stopped)
        self._stopped = f"■ STOPPED: {reason}; Reset allows movements again" if reason else ""
        if reason:
            self._note = ""  # of before; what the stop ends says so afterwards
        elif was_stopped:
            self.commands.refusal_over.emit()
        if self._state is not None:
            self._show_badge(
                STATES[self._state.status], self._state.error or self._activity_text(self._state)
            )
            self._show_line(self._state)

    def _show_badge(self, badge: State, detail: str) -> None:
        edge = State.ERROR if self._stopped else badge
        if (badge, detail, edge) != self._shown:  # most states differ in the position alone
            self._shown = (badge, detail, edge)
            self.put_on(self._badge, badge, detail)
            self.set_edge(edge)

    def put_on(self, badge: StateBadge, state: State, detail: str) -> None:
        """Show the state of the axis on a badge: while stopped, none says that all is well."""
        if self._stopped and state is State.OK:
            badge.set_state(State.REFUSED, detail, word="STOPPED")
        else:
            badge.set_state(state, detail)

    @staticmethod
    def _activity_text(state: PositionerState) -> str:
        return str(state.activity) if state.present else ""

    def _show_usable(self, state: PositionerState) -> None:
        usable = state.present
        if usable == self._forward.isEnabled():
            return
        why = state.error or "its device does not answer"
        for widget in self._inputs:
            widget.setEnabled(usable)
            if usable:
                widget.setToolTip(self._usual_tips.pop(widget, widget.toolTip()))
            else:
                self._usual_tips[widget] = widget.toolTip()
                widget.setToolTip(f"Not available: {why}")
        self.setToolTip("" if usable else why)

    def _show_line(self, state: PositionerState) -> None:
        if state.error:
            look = state_look(State.UNKNOWN if not state.present else State.ERROR)
            text = f"{look.glyph} {state.error}"
        else:
            text = self._note or self._stopped or ("" if self._watched else UNWATCHED_TEXT)
        loud = bool(text)
        before = self._line.text()
        self._line.set_text(text or self._usual_line(state))
        self._line.set_dim(not loud)
        if self._line.text() != before:
            self.status_changed.emit()

    @property
    def status_text(self) -> str:
        """What the line at the foot of the card says."""
        return self._line.text()

    def _usual_line(self, state: PositionerState) -> str:  # noqa: ARG002 - other kinds look at it
        return "no sensor: the position is counted from steps"

    def _set_note(self, note: str) -> None:
        self._note = note
        if self._state is not None:
            self._show_line(self._state)

    # Commanding

    def _on_forward(self) -> None:
        self.move_once(1)

    def _on_backward(self) -> None:
        self.move_once(-1)

    def move_once(self, direction: int) -> None:
        """Move once forwards (1) or backwards (-1), as the buttons do."""
        self.make_steps(direction)

    def make_steps(self, direction: int) -> None:
        """Make the steps that stand in the fields."""
        if self._steps.commit():
            self.commands.issue(
                "make steps",
                lambda consent: self._steps.make(direction, consent=consent),
                self._steps.steps,
            )

    def halt(self) -> None:
        """Stop this axis alone, as the button does."""
        self.commands.abandon_series()
        self.axis.halt()

    def _on_detection_wanted(self, on: bool) -> None:
        try:
            self.axis.collision_detection = on
        except CosmicError as exc:
            self._on_refused(None, str(exc))

    def _on_begun(self) -> None:
        self._set_note("")

    def _on_refused(self, field: object, reason: str) -> None:
        self._set_note(f"{_REFUSED}{reason}")
        self.commands.note_refusal(self.axis.details)
        if isinstance(field, QuantityField):
            self._refused = field
            field.refuse(reason)

    def _on_refusal_over(self) -> None:
        field, self._refused = self._refused, None
        if field is not None and isValid(field):  # that of a tool goes with the tool
            field.end_refusal()
        if self._note.startswith(_REFUSED):
            self._set_note("")

    def _on_ended(self, why: str) -> None:
        self._set_note(f"{state_look(State.ERROR).glyph} {why}" if why else "")


def _row(widgets: Sequence[QWidget], stretch: QWidget | None = None) -> QWidget:
    """Return the widgets side by side; `stretch` takes the room that is left."""
    row = QWidget()
    row.setAttribute(Qt.WidgetAttribute.WA_NoSystemBackground)
    layout = QHBoxLayout(row)
    layout.setContentsMargins(0, 0, 0, 0)
    layout.setSpacing(STEP_PX // 2)
    for widget in widgets:
        layout.addWidget(widget, 1 if widget is stretch else 0)
    if stretch is None:
        layout.addStretch(1)
    return row
