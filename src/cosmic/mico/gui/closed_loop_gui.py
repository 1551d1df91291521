"""`ClosedLoopGUI`: the card of a positioner with sensor (fields MiCoCL.1 to MiCoCL.13)."""

from collections.abc import Callable, Mapping, Sequence
from typing import ClassVar

from PySide6.QtCore import QObject, Qt, Signal
from PySide6.QtGui import QAction
from PySide6.QtWidgets import QHBoxLayout, QLabel, QMenu, QToolButton, QVBoxLayout, QWidget

from cosmic.frame.errors import CosmicError, MoveRefused
from cosmic.frame.gui.build import named, push_button, styled, tipped
from cosmic.frame.gui.quantity_field import QuantityField
from cosmic.frame.gui.theme import STEP_PX
from cosmic.frame.overrides import override
from cosmic.frame.units import format_quantity
from cosmic.mico.core.motion.positioner import PositionerState
from cosmic.mico.gui.link_switch import LinkSwitch
from cosmic.mico.gui.move_row import MoveFields
from cosmic.mico.gui.positioner_gui import PositionerBaseGUI
from cosmic.mico.hw.interface import Direction


class AxisMenu(QObject):
    """What an axis with sensor can be asked besides moving; each entry only asks, the card acts.

    Signals
    -------
    more_toggled(bool)
        The part with steps and speed shall be shown or hidden.
    """

    zero_set = Signal()
    zero_cleared = Signal()
    reference_requested = Signal()
    calibrate_requested = Signal()
    end_stop_requested = Signal(str)
    more_toggled = Signal(bool)

    def __init__(self, axis_name: str, forward: str, backward: str, parent: QObject) -> None:
        super().__init__(parent)
        self.button = named(QToolButton(), "axisMenu")
        self.button.setText("⋯")
        tipped(
            self.button, f"Zero, reference, calibration, end stops, steps and speed: {axis_name}"
        )
        self.button.setPopupMode(QToolButton.ToolButtonPopupMode.InstantPopup)
        self.menu = QMenu(self.button)
        self.menu.setToolTipsVisible(True)
        self.button.setMenu(self.menu)
        styled(self.button, "menu")
        self.button.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextOnly)
        self._add(
            "Set zero here",
            "Count positions from here; limits stay where they are",
            self.zero_set.emit,
        )
        self._add("Clear zero", "Count positions as the controller does", self.zero_cleared.emit)
        self.menu.addSeparator()
        self._add(
            "Find reference",
            "Find the reference; may sweep the whole travel",
            self.reference_requested.emit,
        )
        self._add(
            "Calibrate sensor",
            "Moves millimetres in both directions",
            self.calibrate_requested.emit,
        )
        self._add(
            f"To the end stop: {forward}", "Drive forwards until the travel ends", self._on_forward
        )
        self._add(
            f"To the end stop: {backward}",
            "Drive backwards until the travel ends",
            self._on_backward,
        )
        self.menu.addSeparator()
        self.more = self._add(
            "Show steps and speed", "Move by steps or in several steps, and set the speed", None
        )
        self.more.setCheckable(True)
        self.more.toggled.connect(self.more_toggled)

    def _add(self, text: str, tip: str, act: Callable[[], None] | None) -> QAction:
        action = self.menu.addAction(text)
        action.setToolTip(tip)
        if act is not None:
            action.triggered.connect(act)
        return action

    def _on_forward(self) -> None:
        self.end_stop_requested.emit("forward")

    def _on_backward(self) -> None:
        self.end_stop_requested.emit("backward")

    def action(self, text: str) -> QAction:
        """Return the entry that begins with `text`."""
        return next(each for each in self.menu.actions() if each.text().startswith(text))


class ClosedLoopGUI(PositionerBaseGUI):
    """Adds moves to and by a position, in one or in parts, and what belongs to the sensor.

    Signals
    -------
    link_wanted(str, float)
        The operator wants the axis linked with another one, at that ratio.
    unlink_wanted()
        The operator wants it linked with none.
    """

    link_wanted = Signal(str, float)
    unlink_wanted = Signal()

    state_name: ClassVar[str] = "MiCoCL_1"
    title_name: ClassVar[str] = "MiCoCL_4"
    position_name: ClassVar[str] = "MiCoCL_5"
    forward_name: ClassVar[str] = "MiCoCL_6"
    backward_name: ClassVar[str] = "MiCoCL_7"
    indicator_name: ClassVar[str] = "MiCoCL_2"
    switch_name: ClassVar[str] = "MiCoCL_13"

    # Putting it together

    @override
    def _make_common(self) -> None:
        self._others: tuple[str, ...] = ()
        super()._make_common()
        self._move = MoveFields(self.axis, self._defaults)
        self._move.go_to.clicked.connect(self._on_go_to)
        self._make_indicators()
        self._make_menu()
        self._make_speed()

    def _make_indicators(self) -> None:
        self._link = named(LinkSwitch(self.settings.name), "MiCoCL_12")
        self._linked = named(self._link.indicator, "MiCoCL_3")
        self._link.opened.connect(self._on_link_opened)
        self._link.link_wanted.connect(self.link_wanted)
        self._link.unlink_wanted.connect(self.unlink_wanted)

    def _make_menu(self) -> None:
        name, settings = self.settings.name, self.settings
        self._menu = AxisMenu(name, settings.forward_text, settings.backward_text, self)
        self._menu.zero_set.connect(self._on_zero_set)
        self._menu.zero_cleared.connect(self._on_zero_cleared)
        self._menu.reference_requested.connect(self._on_reference)
        self._menu.calibrate_requested.connect(self._on_calibrate)
        self._menu.end_stop_requested.connect(self._on_end_stop)
        self._menu.more_toggled.connect(self._on_more)

    def _make_speed(self) -> None:
        low, high = self.axis.details.frequency_range_hz
        usual = float(min(max(self._defaults.closed_loop_frequency_hz, low), high))
        self._speed = named(
            QuantityField(
                "Hz", low=low, high=high, value=usual, integers=True, name="Speed limit of moves"
            ),
            "speed",
        )
        self._speed.setMaximumWidth(14 * STEP_PX)
        self._speed.value_committed.connect(self._on_speed)

    @override
    def _first_row(self) -> Sequence[QWidget]:
        indicators = (self._linked, self._link)
        return *super()._first_row()[:-1], *indicators, self._stop

    @override
    def _second_row(self) -> Sequence[QWidget]:
        move = self._move
        buttons = (self._backward, move.distance, self._forward)
        return *buttons, _gap(), move.target, move.go_to, self._menu.button

    @override
    def _more_row(self) -> QWidget:
        name = self.settings.name
        back = named(push_button("− steps", f"Step {name} backwards, without sensor"), "MiCoOL_4")
        ahead = named(push_button("+ steps", f"Step {name} forwards, without sensor"), "MiCoOL_3")
        back.clicked.connect(self._on_steps_backward)
        ahead.clicked.connect(self._on_steps_forward)
        self._step_buttons = (back, ahead)
        self._more = named(QWidget(), "more")
        column = QVBoxLayout(self._more)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(STEP_PX // 2)
        caption = QLabel("speed")
        caption.setProperty("role", "dim")
        move = self._move
        for widgets in (
            (back, self._steps, ahead),
            (move.split, move.largest, _gap(), caption, self._speed),
        ):
            row = QHBoxLayout()
            row.setSpacing(STEP_PX // 2)
            for widget in widgets:
                row.addWidget(widget)
            row.addStretch(1)
            column.addLayout(row)
        self._more.hide()
        return self._more

    @override
    def _list_inputs(self) -> Sequence[QWidget]:
        move = self._move
        own = (move.distance, move.target, move.go_to, move.split, self._menu.button, self._speed)
        return *super()._list_inputs(), *own, *self._step_buttons

    # Showing

    @override
    def show_state(self, state: PositionerState) -> None:
        series = self.commands.series
        if series is not None and series.planned > 1:
            self._note = f"part {series.begun} of {series.planned}"
        self._move.begin_at(state.shown_position)
        super().show_state(state)

    def show_links(self, linked: Mapping[str, float], others: Sequence[str]) -> None:
        """Show what the axis is linked with, and remember what it could be linked with."""
        self._others = tuple(others)
        self._link.show_links(linked)

    def say_refused(self, reason: str) -> None:
        """Show why something that was wanted cannot be."""
        self._on_refused(None, reason)

    @override
    def _usual_line(self, state: PositionerState) -> str:
        limits = state.shown_limits
        if limits is None:
            return ""
        low, high = limits
        span = f"±{high:g}" if low == -high else f"{low:g} to {high:g}"
        unit = format_quantity(high, state.unit).split(" ")[-1]
        zero = f", zero at {format_quantity(state.zero, state.unit)}" if state.zero else ""
        return f"{span} {unit} travel{zero}"  # what is cut off in a narrow window is the word

    # Commanding

    def _on_link_opened(self) -> None:
        self._link.offer(self._others)

    @override
    def move_once(self, direction: int) -> None:
        if self._move.commit_step():
            self.commands.issue(
                "move by a distance",
                lambda consent: self._move.move_by(direction, consent=consent),
                self._move.distance,
                goal=self._move.goal_by(direction),
            )

    def _on_go_to(self) -> None:
        if self._move.commit_target():
            self.commands.issue(
                "move to a position",
                lambda consent: self._move.move_to(consent=consent),
                self._move.target,
                goal=self._move.goal_to(),
            )

    def _on_steps_forward(self) -> None:
        self.make_steps(1)

    def _on_steps_backward(self) -> None:
        self.make_steps(-1)

    def _on_reference(self) -> None:
        self.commands.issue(
            "find the reference",
            lambda consent: self.axis.reference(wait=False, consent=consent),
        )

    def _on_calibrate(self) -> None:
        self.commands.issue(
            "calibrate the sensor",
            lambda consent: self.axis.calibrate(wait=False, consent=consent),
        )

    def _on_end_stop(self, direction: str) -> None:
        self.commands.issue(
            f"drive {direction} to the end stop",
            lambda consent: self.axis.move_to_end_stop(
                Direction(direction), wait=False, consent=consent
            ),
        )

    def _on_zero_set(self) -> None:
        self._change_zero(self.axis.set_zero)

    def _on_zero_cleared(self) -> None:
        self._change_zero(self.axis.clear_zero)

    def _change_zero(self, change: Callable[[], None]) -> None:
        try:
            change()
        except CosmicError as exc:
            self._on_refused(None, str(exc))

    def _on_speed(self, hertz: float) -> None:
        try:
            self.axis.set_closed_loop_frequency(hertz)
        except MoveRefused as exc:
            self._speed.refuse(str(exc))

    def _on_more(self, shown: bool) -> None:
        self._more.setVisible(shown)


def _gap() -> QWidget:
    gap = QWidget()
    gap.setFixedWidth(STEP_PX // 2)
    return gap
