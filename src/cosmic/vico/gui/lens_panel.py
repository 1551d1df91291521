"""`LensPanel`: zoom, focus, light and autofocus."""

from collections.abc import Callable
from typing import Final

from PySide6.QtCore import QSize, QTimer
from PySide6.QtWidgets import QComboBox, QGridLayout, QLabel, QPushButton, QWidget

from cosmic.frame.errors import ConfigError, CosmicError
from cosmic.frame.gui.build import named, push_button, styled, tipped
from cosmic.frame.gui.elided_label import ElidedLabel
from cosmic.frame.gui.flow_layout import FlowLayout
from cosmic.frame.gui.relay import Relay
from cosmic.frame.gui.state_badge import StateBadge
from cosmic.frame.gui.task_bar import TaskBar
from cosmic.frame.gui.theme import STEP_PX, State
from cosmic.frame.operation import Task
from cosmic.frame.overrides import override
from cosmic.vico.api.lens import LensHandle
from cosmic.vico.api.vico import Vico
from cosmic.vico.gui.amount_field import AmountField
from cosmic.vico.gui.slider_field import SliderField
from cosmic.vico.hw.peripherals import LensAxis, LensState

LOOK_MS: Final = 200
FOCUS_STEPS: Final = (-100, -10, 10, 100)
NO_LENS: Final = "There is no motorised lens on this platform"
NO_LIGHT: Final = "There is no lamp on this platform"
NOT_HOMED: Final = "Home the lens first: its position is unknown."


class LensPanel(QWidget):
    """What looks through the microscope: buttons for zoom steps, sliders for focus and light.

    Parameters
    ----------
    vico : Vico
        The application; lens and lamp may be missing.
    """

    def __init__(self, vico: Vico, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setWindowTitle("Lens and light")
        self._vico = vico
        self._offered: tuple[str, ...] = ()
        self.badge, self.name = StateBadge(State.UNKNOWN), ElidedLabel()
        self.zoom = AmountField("Zoom", "x")
        self.steps: dict[str, QPushButton] = {}
        self.focus = SliderField("Focus", "counts")
        self.focus_steps = {
            step: push_button(f"{step:+d}".replace("-", "−"), f"Focus by {step:+d} counts")
            for step in FOCUS_STEPS
        }
        self.home = named(push_button("Home", ""), "home")
        self.abort = named(push_button("Abort", "Stop both motors now"), "abort")
        self.autofocus = named(push_button("Autofocus", ""), "autofocus")
        self.camera = tipped(QComboBox(), "Camera to focus")
        self.light = SliderField("Light", "%")
        self.light.set_range(0.0, 100.0)
        self.tasks = TaskBar()
        self._step_row, self._step_flow = QWidget(), FlowLayout(STEP_PX // 2)
        self._build()
        self._connect()
        self._look = QTimer(self, interval=LOOK_MS)
        self._look.timeout.connect(self.refresh)
        self._look.start()
        self._relay = Relay(self.refresh, least_ms=LOOK_MS).follow(vico.on_change)
        self.refresh()

    # Putting it together

    def _build(self) -> None:
        self._step_row.setLayout(self._step_flow)
        head = _flow(self.badge, self.home, self.abort)
        for button in (*self.focus_steps.values(), self.home, self.abort, self.autofocus):
            styled(button, "narrow")
        by_steps = _flow(*self.focus_steps.values())
        sharp = _flow(self.autofocus, self.camera)
        self.focus.field.setMinimumWidth(10 * STEP_PX)
        grid = QGridLayout(self)
        grid.setContentsMargins(STEP_PX // 2, STEP_PX // 2, STEP_PX // 2, STEP_PX // 2)
        grid.setHorizontalSpacing(STEP_PX)
        grid.setVerticalSpacing(STEP_PX // 2)
        rows: tuple[tuple[str, QWidget], ...] = (
            ("", head),
            ("", self.name),
            ("Zoom", self.zoom),
            ("", self._step_row),
            ("Focus", self.focus),
            ("", by_steps),
            ("", sharp),
            ("Light", self.light),
            ("", self.tasks),
        )
        for row, (caption, widget) in enumerate(rows):
            if caption:
                label = QLabel(caption)
                label.setProperty("role", "dim")
                grid.addWidget(label, row, 0)
            grid.addWidget(widget, row, 1 if caption else 0, 1, 1 if caption else 2)
        grid.setColumnStretch(1, 1)
        grid.setRowStretch(len(rows), 1)

    def _connect(self) -> None:
        self.zoom.committed.connect(self._on_zoom)
        self.focus.committed.connect(self._on_focus)
        self.light.committed.connect(self._on_light)
        self.home.clicked.connect(self._on_home)
        self.abort.clicked.connect(self._on_abort)
        self.autofocus.clicked.connect(self._on_autofocus)
        for step, button in self.focus_steps.items():
            button.clicked.connect(lambda _=False, step=step: self._on_focus_step(step))

    # Showing

    def refresh(self) -> None:
        """Show where the motors are and what may be done."""
        self._show_cameras()
        self._show_light()
        lens = self._vico.lens
        if lens is None:
            self.name.set_text(NO_LENS)
            self._allow(NO_LENS, NO_LENS)
            return
        self.name.set_text(lens.name)
        self._offer_steps(lens)
        states = [lens.state(axis) for axis in LensAxis]
        homed = all(state is not None and state.homed for state in states)
        self._show_state(lens, states, homed=homed)
        self._allow(lens.problem, lens.problem or ("" if homed else NOT_HOMED))
        self._show_zoom_range(lens)
        self.zoom.set_value(None if lens.zoom is None or not homed else round(lens.zoom, 2))
        for step in lens.steps:
            here = homed and lens.zoom is not None and abs(lens.zoom / step.zoom - 1.0) < 0.01
            self.steps[step.name].setChecked(here)
        focus = lens.state(LensAxis.FOCUS)
        if focus is not None and focus.limit_counts > 0:
            self.focus.set_range(0.0, float(focus.limit_counts), 1.0)
            self.focus.set_value(float(focus.position_counts) if focus.homed else None)

    def _show_zoom_range(self, lens: LensHandle) -> None:
        """Accept the magnifications of the table; without one nothing can be typed."""
        try:
            self.zoom.set_range(*lens.zoom_range)
        except ConfigError as exc:
            self.zoom.set_usable(lens.problem or str(exc))

    def _show_state(self, lens: LensHandle, states: list[LensState | None], *, homed: bool) -> None:
        moving = any(state is not None and state.moving for state in states)
        if lens.problem:
            self.badge.set_state(State.ERROR, lens.problem)
            self.name.set_text(lens.problem)
        elif moving or self.tasks.watch.busy:
            self.badge.set_state(State.BUSY, "a motor is moving")
        elif homed:
            self.badge.set_state(State.OK)
        else:
            self.badge.set_state(State.UNKNOWN, NOT_HOMED)

    def _show_light(self) -> None:
        lamp = self._vico.light
        reason = NO_LIGHT if lamp is None else lamp.problem
        self.light.set_usable(reason)
        if lamp is not None:
            self.light.set_value(lamp.percent)

    def _show_cameras(self) -> None:
        names = list(self._vico.cameras)
        if [self.camera.itemText(row) for row in range(self.camera.count())] != names:
            self.camera.clear()
            self.camera.addItems(names)
        self.camera.setVisible(len(names) > 1)

    def _offer_steps(self, lens: LensHandle) -> None:
        offered = tuple(step.name for step in lens.steps)
        if offered == self._offered:
            return
        self._offered = offered
        for old in self.steps.values():
            self._step_flow.removeWidget(old)
            old.deleteLater()
        self.steps = {}
        for step in lens.steps:
            button = push_button(step.name, f"Zoom to {step.zoom:g} x")
            button.setCheckable(True)
            styled(button, "narrow")
            button.clicked.connect(lambda _=False, zoom=step.zoom: self._on_zoom(zoom))
            self._step_flow.addWidget(button)
            self.steps[step.name] = button

    def _allow(self, gone: str, unknown: str) -> None:
        """Enable what can be used; what needs a homed lens has a reason of its own."""
        _enable(self.home, gone, "Home both motors")
        _enable(self.abort, gone, "Stop both motors now")
        nothing = unknown or ("" if self._vico.cameras else "There is no camera")
        _enable(self.autofocus, nothing, "Autofocus: find the sharpest image")
        self.focus.set_usable(unknown)
        self.zoom.set_usable(unknown)
        for name, button in self.steps.items():
            _enable(button, unknown, f"Zoom to {name}")
        for step, button in self.focus_steps.items():
            _enable(button, unknown, f"Focus by {step:+d} counts")

    # Commands

    def _begin(self, begin: Callable[[LensHandle], Task], refuse: Callable[[str], None]) -> None:
        lens = self._vico.lens
        if lens is None:
            return
        try:
            self.tasks.follow(begin(lens))
        except CosmicError as exc:
            refuse(str(exc))
        self.refresh()

    def _say(self, reason: str) -> None:
        self.tasks.say(reason, refused=True)

    def _on_zoom(self, zoom: float) -> None:
        field = self.zoom if self.sender() is self.zoom else None
        self._begin(lambda lens: lens.zoom_to(zoom), field.refuse if field else self._say)

    def _on_focus(self, counts: float) -> None:
        self._begin(lambda lens: lens.seek_focus(round(counts)), self.focus.refuse)

    def _on_focus_step(self, step: int) -> None:
        state = None if self._vico.lens is None else self._vico.lens.state(LensAxis.FOCUS)
        if state is None:
            return
        target = state.position_counts + step
        if not 0 <= target <= state.limit_counts:
            self._say(f"focus {target} lies outside 0 to {state.limit_counts} counts")
            return
        self._begin(lambda lens: lens.seek_focus(target), self._say)

    def _on_home(self) -> None:
        self._begin(lambda lens: lens.home(), self._say)

    def _on_autofocus(self) -> None:
        self._begin(lambda lens: lens.autofocus(self.camera.currentText()), self._say)

    def _on_abort(self) -> None:
        if self._vico.lens is not None:
            self._vico.lens.abort()
        task = self.tasks.watch.task
        if task is not None and not task.done:
            task.cancel()

    def _on_light(self, percent: float) -> None:
        if self._vico.light is None:
            return
        try:
            self._vico.light.set_percent(percent)
        except CosmicError as exc:
            self.light.refuse(str(exc))

    @override
    def sizeHint(self) -> QSize:
        return QSize(44 * STEP_PX, super().sizeHint().height())


def _flow(*widgets: QWidget) -> QWidget:
    """Return widgets side by side, in further lines where it is narrow."""
    row = QWidget()
    flow = FlowLayout(STEP_PX // 2, row)
    for widget in widgets:
        flow.addWidget(widget)
    return row


def _enable(button: QWidget, reason: str, tip: str) -> None:
    button.setEnabled(not reason)
    if button.toolTip() != (reason or tip):
        button.setToolTip(reason or tip)
