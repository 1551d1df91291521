"""The column TOOL: one tool is chosen, and moved by a pad, by targets, to poses, or back."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import (
    QButtonGroup,
    QGridLayout,
    QLabel,
    QLineEdit,
    QPushButton,
    QSizePolicy,
    QToolButton,
    QVBoxLayout,
    QWidget,
)

from cosmic.app.panels.gripper_row import GripperRow
from cosmic.app.panels.pose_choice import PoseChoice
from cosmic.app.panels.target_row import TargetRow
from cosmic.frame.errors import CosmicError, NotAvailable
from cosmic.frame.gui.build import named, push_button, styled, tight_row, tipped
from cosmic.frame.gui.quantity_field import QuantityField
from cosmic.frame.gui.relay import Relay
from cosmic.frame.gui.theme import STEP_PX, State, state_look
from cosmic.frame.operation import Progress
from cosmic.frame.overrides import override
from cosmic.frame.units import DISPLAY, with_micro_signs
from cosmic.frame.verdict import MoveVerdict, Reason
from cosmic.mico.api.axis import Axis
from cosmic.mico.core.motion.positioner import PositionerState
from cosmic.mico.gui.detour_request import Goal
from cosmic.mico.gui.key_names import key_text
from cosmic.mico.gui.mico_widget import MicoWidget
from cosmic.mico.gui.move_row import StepField
from cosmic.mico.gui.poses_box import ReplacedPose
from cosmic.mico.gui.state_feed import StateFeed
from cosmic.mico.hw.interface import PositionerKind

USUAL_STEP_UM: Final = 10.0
USUAL_STEP_DEG: Final = 1.0
SAFE_SIDE: Final = 0.1
"""How far before the place that a refusal names an axis is sent, in its unit."""
NOTHING_TO_UNDO: Final = (
    "Not available: you have made no move to undo; what an operation did is undone on its card"
)
_DIRECTIONS: Final = ("x", "y", "z")
_PLACES: Final = {"left": (1, 0), "right": (1, 2), "up": (0, 1), "down": (2, 1)}
_Z_PLACES: Final = {1: (0, 3), -1: (2, 3)}
_ARROWS: Final = {"left": "←", "right": "→", "up": "↑", "down": "↓"}
Shown = Mapping[tuple[str, int], str]
"""Where on the picture a part of a tool goes, forwards (1) or backwards (-1): "left", "up", ..."""
USUAL: Final[Shown] = {("x", -1): "left", ("x", 1): "right", ("y", 1): "up", ("y", -1): "down"}
_SIGNS: Final = {
    ("z", 1): "⤒",
    ("z", -1): "⤓",
    ("rotation", 1): "↺",
    ("rotation", -1): "↻",
}


@dataclass(frozen=True, slots=True)
class Tool:
    """What is moved as one.

    Attributes
    ----------
    name : str
        The first part of the names of its axes, such as "left".
    axes : dict of str to str
        Names of its axes by the part behind the point, such as "x" or "gripper".
    """

    name: str
    axes: Mapping[str, str]


def tools_of(names: list[str]) -> list[Tool]:
    """Return the tools that the names of axes tell of, in their order."""
    found: dict[str, dict[str, str]] = {}
    for name in names:
        tool, _, part = name.partition(".")
        found.setdefault(tool, {})[part or tool] = name
    return [Tool(name, axes) for name, axes in found.items()]


class ToolPanel(QWidget):
    """Moves the chosen tool; every command is that of the axis' card, and so passes the gate.

    Parameters
    ----------
    gui : MicoWidget
        Whose axes are moved; questions and refusals are shown as its own.

    Signals
    -------
    tool_chosen(str)
        Another tool is in use.
    close_gently_requested(str)
        The jaws of that tool are to close slowly, until they hold.
    """

    tool_chosen = Signal(str)
    close_gently_requested = Signal(str)

    def __init__(self, gui: MicoWidget, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("toolPanel")
        self._gui = gui
        self._mico = gui.mico
        self._tools = {each.name: each for each in tools_of(list(self._mico.names))}
        self._tool = next(iter(self._tools), "")
        self._rows: dict[str, TargetRow] = {}
        self._grippers: dict[str, GripperRow] = {}
        self._closes_gently = False
        self._steps: dict[str, float] = {}
        self._stopped = ""
        self._verdict: MoveVerdict | None = None
        self._replacing = ReplacedPose(self._mico, "Enter")
        self._last: tuple[str, Callable[[], None]] | None = None
        self._shown: Shown = USUAL
        self._detour_by_click: Callable[[], None] | None = None
        self._feed = StateFeed(self._mico, self)
        self._relay = Relay(self._on_progressed)
        self._make_widgets()
        self._arrange()
        self._gui.refreshed.connect(self._on_refreshed)
        self._gui.verdict_given.connect(self._on_refused)
        self._gui.refusal_over.connect(self._on_refusal_over)
        self._gui.undoing.available.connect(self._on_undo_available)
        self._gui.undoing.said.connect(self._on_said)
        self._gui.undoing.show_available()
        self._build_tool()

    # Putting it together

    def _make_widgets(self) -> None:
        self._group = QButtonGroup(self)
        self.choices: dict[str, QToolButton] = {}
        for name in self._tools:
            button = named(tipped(QToolButton(), f"Move the {name} from here on"), "toolButton")
            button.setText(name)
            button.setCheckable(True)
            button.setChecked(name == self._tool)
            button.clicked.connect(self._on_tool)
            self._group.addButton(button)
            self.choices[name] = button
        self.step = named(StepField("um", value=USUAL_STEP_UM, name="Step of the pad"), "padStep")
        self.smaller = styled(push_button("÷10", "Divide the step size by 10"), "narrow")
        self.larger = styled(push_button("×10", "Multiply the step size by 10"), "narrow")
        self.smaller.clicked.connect(lambda: self._scale_step(0.1))
        self.larger.clicked.connect(lambda: self._scale_step(10.0))
        self.go = named(push_button("Go to", "Move to all targets, together"), "toolGo")
        styled(self.go, "narrow")
        self.step.setMinimumWidth(9 * STEP_PX)
        self.go.clicked.connect(self.go_to_targets)
        self.undo = styled(named(push_button("Undo", ""), "toolUndo"), "narrow")
        self.undo.clicked.connect(self._gui.undoing.undo)
        self.stop = styled(
            named(push_button("■", "Stop this tool; the others go on"), "stopAxis"), "narrow"
        )
        self.stop.clicked.connect(self._on_halt)
        self.poses = PoseChoice(self._mico)
        self.go_pose = named(push_button("Go", "Move to the pose, all its axes together"), "goPose")
        styled(self.go_pose, "narrow")
        self.keep = styled(push_button("Keep", "Keep where this tool stands as a pose"), "narrow")
        self.pose_name = named(tipped(QLineEdit(), "Name of the pose; Enter keeps it"), "poseName")
        self.pose_name.setPlaceholderText("name, then Enter")
        self.pose_name.hide()
        self.go_pose.clicked.connect(self._on_go_pose)
        self.keep.clicked.connect(self._on_keep)
        self.pose_name.returnPressed.connect(self._on_pose_named)
        self._make_exits()
        self.line = named(QLabel(), "toolLine")
        self.line.setWordWrap(True)
        self.line.setTextFormat(Qt.TextFormat.PlainText)
        self.line.setAlignment(Qt.AlignmentFlag.AlignTop)
        self.line.setMinimumHeight(4 * STEP_PX)
        self.line.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Preferred)

    def _make_exits(self) -> None:
        """Make what a refusal leaves to be done, each by one button."""
        self.nearest = named(push_button("", "Go as far as the gate allows"), "toolNearest")
        self.detour = named(
            push_button("Detour", "Plan a path around what is in between"), "detour"
        )
        for button in (self.nearest, self.detour):
            styled(button, "narrow")
            button.hide()
        self.nearest.clicked.connect(self._on_nearest)
        self.detour.clicked.connect(self._on_detour)

    def _arrange(self) -> None:
        choices = QGridLayout()
        choices.setSpacing(STEP_PX // 2)
        for number, button in enumerate(self.choices.values()):
            choices.addWidget(button, number // 4, number % 4)
            button.setSizePolicy(
                button.sizePolicy().Policy.Expanding, button.sizePolicy().Policy.Fixed
            )
        step, row = tight_row(STEP_PX // 2)
        row.addWidget(self.smaller)
        row.addWidget(self.step, 1)
        row.addWidget(self.larger)
        last, row = tight_row(STEP_PX // 2)
        row.addWidget(self.go, 1)
        row.addWidget(self.undo, 1)
        row.addWidget(self.stop)
        poses, row = tight_row(STEP_PX // 2)
        row.addWidget(self.poses, 1)
        row.addWidget(self.go_pose)
        row.addWidget(self.keep)
        self._body = QWidget()
        self._column = QVBoxLayout(self)
        self._column.setContentsMargins(STEP_PX // 2, STEP_PX // 2, STEP_PX // 2, STEP_PX // 2)
        self._column.setSpacing(STEP_PX // 2)
        self._column.addLayout(choices)
        self._column.addWidget(self._body)
        exits, row = tight_row(STEP_PX // 2)
        row.addWidget(self.nearest, 1)
        row.addWidget(self.detour, 1)
        for widget in (step, last, poses, self.pose_name, exits, self.line):
            self._column.addWidget(widget)
        self._column.addStretch(1)

    def _build_tool(self) -> None:
        """Make pad and targets of the chosen tool."""
        old, self._body = self._body, QWidget()
        self._feed.clear()
        self._rows, self._grippers = {}, {}
        body = QVBoxLayout(self._body)
        body.setContentsMargins(0, 0, 0, 0)
        body.setSpacing(STEP_PX // 2)
        body.addWidget(self._make_pad())
        targets, grid = QWidget(), QGridLayout()
        targets.setLayout(grid)
        grid.setContentsMargins(0, 0, 0, 0)
        grid.setSpacing(STEP_PX // 2)
        for part, name in self._tools[self._tool].axes.items():
            axis = self._mico[name]
            if axis.kind is PositionerKind.OPEN_LOOP:
                body.addWidget(self._make_gripper(axis))
                continue
            row = TargetRow(axis, part[0].upper(), self._mover(name))
            number = len(self._rows)
            for column, widget in enumerate((row.caption, row.position, row.target)):
                grid.addWidget(widget, number, column)
            grid.setColumnStretch(2, 1)
            self._rows[name] = row
            self._feed.add(name, row)
        body.insertWidget(1, targets)
        self._column.replaceWidget(old, self._body)
        old.hide()
        old.deleteLater()
        self._body.show()
        self._show_step()
        self.refresh_poses()

    def _make_pad(self) -> QWidget:
        pad, grid = QWidget(), QGridLayout()
        pad.setLayout(grid)
        grid.setContentsMargins(0, 0, 0, 0)
        grid.setSpacing(STEP_PX // 4)
        self.pad: dict[tuple[str, int], QPushButton] = {}
        for part, name in self._tools[self._tool].axes.items():
            if self._mico[name].kind is PositionerKind.OPEN_LOOP:
                continue
            for direction in (-1, 1):
                button = self._pad_button(part, name, direction)
                grid.addWidget(button, *self._pad_place(part, direction))
                self.pad[part, direction] = button
        return pad

    def _pad_place(self, part: str, direction: int) -> tuple[int, int]:
        if part == "z":
            return _Z_PLACES[direction]
        shown = self._shown.get((part, direction))
        if shown is not None:
            return _PLACES[shown]
        return (1, 0) if direction > 0 else (1, 2)

    def show_directions(self, shown: Shown) -> None:
        """Have the pad point as the picture shows it; where nothing is calibrated, as usual."""
        if dict(shown) != dict(self._shown):
            self._shown = dict(shown)
            self._build_tool()

    def _pad_button(self, part: str, name: str, direction: int) -> QPushButton:
        settings = self._gui.cards[name].settings
        text = settings.forward_text if direction > 0 else settings.backward_text
        key = key_text(settings.forward_key if direction > 0 else settings.backward_key)
        shown = self._shown.get((part, direction))
        sign = _ARROWS[shown] if shown else _SIGNS.get((part, direction), text)
        where = f", {shown} in the picture" if shown else ""
        held = f"; hold the key {key} to keep moving" if key else ""
        short = key if len(key) == 1 else ""
        button = named(push_button(f"{sign} {short}".strip(), ""), "padButton")
        tipped(button, f"Move {name} {text}{where} by the step{held}")
        button.setAccessibleName(f"{name} {text}")
        button.clicked.connect(lambda: self.move_once(name, direction))
        return button

    def _make_gripper(self, axis: Axis) -> QWidget:
        name, tool = axis.key, self._tool
        row = GripperRow(
            axis,
            lambda direction: self.move_once(name, direction),
            lambda there, field: self.open_to(name, there, field),
            lambda: self.close_gently_requested.emit(tool),
            lambda: self._gui.cards[name].halt() if name in self._gui.cards else None,
        )
        row.gently.setEnabled(self._closes_gently)
        self._grippers[name] = row
        self._feed.add(name, row)
        return row

    def offer_gently(self) -> None:
        """Offer to close grippers gently: somebody carries that out."""
        self._closes_gently = True
        for row in self._grippers.values():
            row.gently.setEnabled(True)

    def open_to(self, name: str, there_um: float, field: QuantityField) -> None:
        """Open or close a gripper to a width, as far as its steps tell; uncertain as these are."""
        card = self._gui.cards.get(name)
        here_um = card.axis.details.shown_position if card is not None else None
        if card is None or here_um is None:
            field.refuse("the opening is unknown; initialise first")
            return
        size_um = card.settings.step_um or 1.0
        count = round((there_um - here_um) / size_um)
        if count == 0:
            return
        defaults = self._mico.settings.defaults
        card.commands.issue(
            "make steps",
            lambda consent: card.axis.steps(
                count,
                amplitude_v=defaults.amplitude_v,
                frequency_hz=defaults.frequency_hz,
                wait=False,
                consent=consent,
            ),
            field,
        )

    # What is chosen

    @property
    def tool(self) -> Tool:
        """What is moved."""
        return self._tools[self._tool]

    @property
    def axes(self) -> tuple[str, ...]:
        """Names of the axes of the chosen tool."""
        return tuple(self.tool.axes.values())

    def choose(self, name: str) -> None:
        """Move another tool from here on."""
        if name not in self._tools:
            return
        self.choices[name].setChecked(True)
        if name != self._tool:
            self._tool = name
            self._build_tool()
            self.tool_chosen.emit(name)

    def _on_tool(self) -> None:
        self.choose(next(name for name, each in self.choices.items() if each.isChecked()))

    @property
    def _unit(self) -> str:
        units = {self._mico[name].unit for name in self.axes}
        return "deg" if units == {"deg"} else "um"

    def _scale_step(self, factor: float) -> None:
        if self.step.commit():
            self.step.set_value(round(self.step.value() * factor, 4))
            self._steps[self._unit] = self.step.value()

    def _show_step(self) -> None:
        usual = USUAL_STEP_DEG if self._unit == "deg" else USUAL_STEP_UM
        self.step.setAccessibleName(f"Step of the pad in {DISPLAY[self._unit]}")
        self.step.set_unit(self._unit, self._steps.get(self._unit, usual))

    # Commanding

    def move_once(self, name: str, direction: int) -> None:
        """Move one axis of the tool by the step, forwards (1) or backwards (-1)."""
        card = self._gui.cards.get(name)
        if card is None or not self.step.commit():
            return
        self.say("")
        self._last = (name, lambda: self.move_once(name, direction))
        axis, amount = card.axis, self.step.value()
        self._steps[self._unit] = amount
        defaults = self._mico.settings.defaults
        if axis.kind is PositionerKind.OPEN_LOOP:
            size_um = card.settings.step_um or 1.0
            count = max(1, round(amount / size_um))
            card.commands.issue(
                "make steps",
                lambda consent: axis.steps(
                    direction * count,
                    amplitude_v=defaults.amplitude_v,
                    frequency_hz=defaults.frequency_hz,
                    wait=False,
                    consent=consent,
                ),
                self.step,
            )
            return
        state = axis.details
        here = state.shown_position
        goal = None if here is None else self._goal(state, here + direction * amount)
        card.commands.issue(
            "move by a distance",
            lambda consent: axis.move_by(direction * amount, wait=False, consent=consent),
            self.step,
            goal=goal,
        )

    @staticmethod
    def _goal(state: PositionerState, shown: float) -> Goal:
        return Goal(target=shown + state.zero, shown=shown, unit=state.unit)

    def _mover(self, name: str) -> Callable[[], None]:
        return lambda: self.move_to_target(name)

    def move_to_target(self, name: str) -> None:
        """Move one axis to the target in its field."""
        row, card = self._rows[name], self._gui.cards.get(name)
        if card is None or not row.target.commit():
            return
        self.say("")
        self._last = (name, lambda: self.move_to_target(name))
        there = row.target.value()
        card.commands.issue(
            "move to a position",
            lambda consent: row.axis.move_to(there, wait=False, consent=consent),
            row.target,
            goal=self._goal(row.axis.details, there),
        )

    def go_to_targets(self) -> None:
        """Move all axes whose target is elsewhere there, together."""
        checked = [row.target.commit() for row in self._rows.values()]  # each shows its reason
        if not all(checked):
            return
        wanted = {
            name: row.target.value()
            for name, row in self._rows.items()
            if abs(row.target.value() - (row.axis.details.shown_position or 0.0)) > 0.06
        }
        if len(wanted) == 1:
            self.move_to_target(next(iter(wanted)))
        elif wanted and self._gui.busy:
            self._refuse(self._gui.busy)
        elif wanted:
            self.say("")
            try:
                self._mico.move(wanted, wait=False)
            except CosmicError as exc:
                self._refuse(str(exc))

    def _on_halt(self) -> None:
        for name in self.axes:
            card = self._gui.cards.get(name)
            if card is not None:
                card.halt()

    # Poses

    def refresh_poses(self) -> None:
        """Show the poses there are now."""
        self.poses.refresh()
        self.go_pose.setEnabled(self.poses.count() > 0)

    def _on_go_pose(self) -> None:
        try:
            if why := self._gui.busy:
                raise NotAvailable(why)
            task = self._mico.poses.go(self.poses.currentText(), wait=False)
        except CosmicError as exc:
            self._refuse(str(exc))
            return
        self.say("")
        task.subscribe(self._relay)

    def _on_progressed(self, progress: Progress) -> None:
        if progress.done and progress.error:
            self._refuse(progress.error)

    def _on_keep(self) -> None:
        self._replacing.forget()
        self.pose_name.setVisible(not self.pose_name.isVisible())
        self.pose_name.setFocus()

    def _on_pose_named(self) -> None:
        name = self.pose_name.text().strip()
        if question := self._replacing.question(name):
            self._refuse(question)
            return
        try:
            self._mico.poses.teach(name, list(self.axes))
        except CosmicError as exc:
            self._refuse(str(exc))
            return
        self.pose_name.clear()
        self.pose_name.hide()
        self.refresh_poses()
        self.poses.setCurrentText(name)
        self.say(f"Pose {name} kept")

    # What is said

    def show_stopped(self, reason: str | None) -> None:
        """Show that the stop is latched, and why; None: no longer."""
        self._stopped = f"■ STOPPED: {reason}; Reset allows movements again" if reason else ""
        self.say("")

    def say(self, text: str) -> None:
        """Say one line below the tool; what a refusal offered is gone. Empty takes it away."""
        self._verdict = None
        shown = with_micro_signs(self._stopped or text)
        for button in (self.nearest, self.detour):
            button.hide()
        self.line.setText(shown)
        self.line.setToolTip(shown)

    def _refuse(self, reason: str) -> None:
        look = state_look(State.REFUSED)
        self.say(f"{look.glyph} {reason}")

    def _on_refused(self, verdict: MoveVerdict) -> None:
        if verdict.axis and verdict.axis not in self.axes:
            return
        self._refuse(str(verdict))
        self._verdict, self._detour_by_click = verdict, None
        reachable = verdict.limit is not None and bool(verdict.axis)
        if reachable and verdict.limit is not None:
            self.nearest.setText(f"Go to {verdict.limit:.0f}")
        self.nearest.setVisible(reachable)
        again = self._last is not None and self._last[0] == verdict.axis
        self.detour.setVisible(again and verdict.reason is Reason.COLLISION)

    def _on_refusal_over(self, name: str) -> None:
        """Take away what was told of a refusal, and what it offered: the axis was moved since."""
        if self._verdict is not None and self._verdict.axis == name:
            self.say("")

    def _on_nearest(self) -> None:
        """Move as far as the refusal says that the axis may go, a little less."""
        verdict = self._verdict
        if verdict is None or verdict.limit is None or verdict.axis not in self._gui.cards:
            return
        card = self._gui.cards[verdict.axis]
        state = card.axis.details
        here = state.position if state.position is not None else 0.0
        back = math.copysign(min(SAFE_SIDE, abs(verdict.limit - here)), here - verdict.limit)
        there = verdict.limit + back - state.zero
        self.say("")
        card.commands.issue(
            "move to a position",
            lambda consent: card.axis.move_to(there, wait=False, consent=consent),
            goal=self._goal(state, there),
        )

    def offer_detour(self, begin: Callable[[], None]) -> None:
        """Offer to plan a path to where a click led that was refused."""
        self._detour_by_click = begin
        self.detour.show()

    def _on_detour(self) -> None:
        """Have a path planned to where the refused command led; it is shown before it is driven."""
        begin, self._detour_by_click = self._detour_by_click, None
        if begin is not None:
            begin()
            return
        if self._last is None or self._last[0] not in self._gui.cards:
            return
        name, again = self._last
        commands = self._gui.cards[name].commands
        before, commands.plans_detours = commands.plans_detours, True
        again()
        commands.plans_detours = before

    def _on_said(self, text: str, state: object) -> None:
        glyph = state_look(state).glyph if isinstance(state, State) else ""
        self.say(f"{glyph} {text}".strip())

    def _on_undo_available(self, what: str) -> None:
        self.undo.setEnabled(bool(what))
        self.undo.setToolTip(f"Ctrl+Z: {what}" if what else NOTHING_TO_UNDO)

    def _on_refreshed(self) -> None:
        tools = {each.name: each for each in tools_of(list(self._mico.names))}
        if tools == self._tools:
            self._feed.clear()
            for name, row in self._rows.items():
                self._feed.add(name, row)
            for name, gripper in self._grippers.items():
                self._feed.add(name, gripper)

    @override
    def setVisible(self, visible: bool) -> None:
        super().setVisible(visible)
        if visible:
            self.refresh_poses()
