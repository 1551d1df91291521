"""The bar on top of every main window: what is in force, what is wrong, and STOP."""

from collections.abc import Collection, Sequence
from typing import Final

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import (
    QHBoxLayout,
    QLabel,
    QMenu,
    QMenuBar,
    QSizePolicy,
    QStackedWidget,
    QToolButton,
    QVBoxLayout,
    QWidget,
)

from cosmic.frame.gui.build import (
    named,
    push_button,
    restyle,
    set_style_property,
    styled,
    tight_row,
    tipped,
)
from cosmic.frame.gui.chip import Chip
from cosmic.frame.gui.clearance_meter import Clearance, ClearanceMeter
from cosmic.frame.gui.controls_indicator import ControlsIndicator
from cosmic.frame.gui.elided_label import ElidedLabel
from cosmic.frame.gui.state_badge import StateBadge
from cosmic.frame.gui.stop_button import StopButton
from cosmic.frame.gui.theme import LARGE_PX, STEP_PX, State, current_palette, ui_font
from cosmic.frame.units import with_micro_signs

MODES: Final = {
    "MCM": "Manual control: you command every movement",
    "SCM": "Semi-automatic control: recorded trajectories are executed again",
    "ECM": "Enhanced manual control: a detour is planned where the straight path collides",
    "ACM": "Automatic control: whole procedures run without a person",
}


MODE_WORDS: Final = {"MCM": "Manual", "SCM": "Replay", "ECM": "Guided", "ACM": "Automatic"}
"""How the modes of the thesis are called in the window."""


def mode_tip(name: str) -> str:
    """Return what a mode is, with its name in the thesis."""
    return f"{MODES[name]} ({name})"


class ModeSelector(QWidget):
    """Shows the mode in force; a click only asks for another one."""

    mode_requested = Signal(str)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._mode = "MCM"
        self._buttons: dict[str, QToolButton] = {}
        row = QHBoxLayout(self)
        row.setContentsMargins(0, 0, 0, 0)
        row.setSpacing(0)
        for name in MODES:
            button = named(QToolButton(), "modeButton")
            button.setText(MODE_WORDS[name])
            button.setProperty("mode", name)
            button.setCheckable(True)
            button.setFocusPolicy(Qt.FocusPolicy.NoFocus)
            button.clicked.connect(self._on_clicked)
            row.addWidget(button)
            self._buttons[name] = button
            self.set_available(name, "" if name == "MCM" else "not part of this version")
        self._menu = QMenu(self)
        self._menu.setToolTipsVisible(True)
        self._list = named(QToolButton(), "modeList")
        self._list.setMenu(self._menu)
        self._list.setPopupMode(QToolButton.ToolButtonPopupMode.InstantPopup)
        self._list.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        styled(self._list, "menu")
        self._list.hide()
        row.addWidget(self._list)
        self.set_mode("MCM")

    def set_compact(self) -> None:
        """Show the mode in force alone; the others are in its menu."""
        for button in self._buttons.values():
            button.hide()
        self._menu.aboutToShow.connect(self._fill)
        self._list.show()

    def _fill(self) -> None:
        self._menu.clear()
        for name, button in self._buttons.items():
            action = self._menu.addAction(button.text())
            action.setToolTip(button.toolTip())
            action.setEnabled(button.isEnabled())
            action.setCheckable(True)
            action.setChecked(name == self._mode)
            action.triggered.connect(button.click)

    @property
    def mode(self) -> str:
        """The mode in force."""
        return self._mode

    def set_mode(self, name: str) -> None:
        """Show `name` as the mode in force."""
        self._mode = name
        for each, button in self._buttons.items():
            button.setChecked(each == name)
        self._list.setText(f"{self._buttons[name].text()} ▾")
        self._list.setToolTip(f"Control mode. {mode_tip(name)}")

    def set_available(self, name: str, why_not: str = "") -> None:
        """Let `name` be chosen, or say in its tooltip why it cannot be."""
        button = self._buttons[name]
        button.setEnabled(not why_not)
        tip = f"{mode_tip(name)}\nNot available: {why_not}" if why_not else mode_tip(name)
        button.setToolTip(tip)

    def _on_clicked(self) -> None:
        wanted = next(name for name, each in self._buttons.items() if each is self.sender())
        self.set_mode(self._mode)  # the click alone changes nothing: the owner decides
        if wanted != self._mode:
            self.mode_requested.emit(wanted)


class WorkspaceButtons(QWidget):
    """One button for each workspace; a click only asks."""

    requested = Signal(str)

    def __init__(
        self, workspaces: Sequence[tuple[str, str]], parent: QWidget | None = None
    ) -> None:
        super().__init__(parent)
        self._buttons: dict[str, QToolButton] = {}
        row = QHBoxLayout(self)
        row.setContentsMargins(0, 0, 0, 0)
        row.setSpacing(0)
        for number, (name, tip) in enumerate(workspaces, start=1):
            key = f"Ctrl+{number}"
            button = named(tipped(QToolButton(), f"{tip} ({key})"), "workspaceButton")
            button.setText(name)
            button.setCheckable(True)
            button.setShortcut(key)
            button.setFocusPolicy(Qt.FocusPolicy.TabFocus)
            button.setMinimumWidth(button.fontMetrics().horizontalAdvance(name) + 2 * STEP_PX)
            button.clicked.connect(self._on_clicked)
            row.addWidget(button)
            self._buttons[name] = button

    @property
    def buttons(self) -> dict[str, QToolButton]:
        """The buttons by the name of their workspace."""
        return dict(self._buttons)

    def show_current(self, name: str) -> None:
        """Show which one is in front."""
        for each, button in self._buttons.items():
            button.setChecked(each == name)

    def _on_clicked(self) -> None:
        wanted = next(name for name, each in self._buttons.items() if each is self.sender())
        self._buttons[wanted].setChecked(True)
        self.requested.emit(wanted)


NO_COLLISION_MODEL = "no collision model"
_NAMES_SHOWN: Final = 2


SLOW_PART: Final = 0.95
"""A clock that runs slower than this part of its rate is shown, in real time too."""


class TopBar(QWidget):
    """Shows what it is told and asks for what is clicked; it decides nothing itself.

    Parameters
    ----------
    title : str
        Name of the program or of the station.
    stop_key : str
        The key of STOP as it is written on the keyboard.
    """

    stop_requested = Signal()
    reset_requested = Signal()
    mode_requested = Signal(str)
    theme_requested = Signal()
    message_clicked = Signal()
    workspace_requested = Signal(str)
    alarms_clicked = Signal()

    def __init__(
        self, title: str = "CoSMic", *, stop_key: str = "F12", parent: QWidget | None = None
    ) -> None:
        super().__init__(parent)
        self.setObjectName("topBar")
        self.setAttribute(Qt.WidgetAttribute.WA_StyledBackground)
        self.setFocusPolicy(Qt.FocusPolicy.ClickFocus)  # a click on it ends typing in a field
        self._latched = False
        self._workspaces: WorkspaceButtons | None = None
        self._nearest: Clearance | None = None
        self._theme_then = current_palette().name
        self._make_widgets(title, stop_key)
        self._arrange()
        self._stop.stop_requested.connect(self.stop_requested)
        self._reset.clicked.connect(self.reset_requested)
        self._modes.mode_requested.connect(self.mode_requested)
        self._theme.clicked.connect(self.theme_requested)
        self._message.clicked.connect(self.message_clicked)

    def _make_widgets(self, title: str, stop_key: str) -> None:
        self._stop = StopButton(stop_key)
        self._title = QLabel(title)
        self._title.setFont(ui_font(LARGE_PX, bold=True))
        self._simulated = Chip("SIMULATED", "simulated", "Simulation: no hardware is driven")
        self._modes = ModeSelector()
        self._controls = ControlsIndicator()
        self._clearance = ClearanceMeter()
        self._no_model = Chip(f"▲ {NO_COLLISION_MODEL}", "warning")
        self._no_model.setToolTip("Movements within the limits are not checked for collisions")
        self._unwatched = Chip("", "alarm")
        self._contacts = Chip("", "warning")
        self._rate = Chip("", "warning", "The platform's clock does not run in real time")
        self._message = ElidedLabel(hint="Click to open the log")
        self._message_state = StateBadge(State.ERROR)
        self._message_state.hide()
        self._theme = named(
            push_button("◐", "Switch between the dark and the light theme"), "themeButton"
        )
        self._theme.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self._latched_text = ElidedLabel()
        self._latched_text.setFont(ui_font(LARGE_PX, bold=True))
        self._latched_text.set_tight_font(ui_font(bold=True))
        reset = push_button("Reset", "Allow movements again; nothing moves by itself")
        self._reset = named(reset, "resetButton")
        self._reset.setFont(ui_font(bold=True))
        self._reset.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self._controls.show_holder("this window")
        self.set_rate(1.0)
        self.set_collision_model(present=False)
        self.set_unwatched(())
        self.set_contacts(())

    def _arrange(self) -> None:
        normal, row = tight_row(STEP_PX)
        self._normal_row = row
        for widget in (self._modes, self._no_model, self._rate):
            row.addWidget(widget)
        row.addWidget(self._clearance, 1)
        row.addStretch(0)
        latched, row = tight_row(STEP_PX)
        row.addWidget(self._latched_text, 1)
        row.addWidget(self._reset)
        self._pages = QStackedWidget()
        self._normal = normal
        self._pages.addWidget(normal)
        self._pages.addWidget(latched)
        self._pages.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self._pages.setFixedHeight(4 * STEP_PX)  # the bar keeps its height when it turns

        self._first_row = QHBoxLayout()
        self._first_row.setSpacing(STEP_PX)
        self._first_row.addWidget(self._message_state)
        self._first_row.addWidget(self._message, 1)
        # Seen while stopped, too. What comes and goes stands left of what is clicked.
        for warning in (self._contacts, self._unwatched, self._controls):
            self._first_row.addWidget(warning)
        self._first_row.addWidget(self._theme)
        second = QHBoxLayout()
        self._second_row = second
        second.setSpacing(2 * STEP_PX)
        second.addWidget(self._title)
        second.addWidget(self._simulated)
        second.addWidget(self._pages, 1)
        warnings = QWidget()
        # Cut off at the right where the window is too narrow: STOP never is.
        warnings.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Preferred)
        rows = QVBoxLayout(warnings)
        rows.setContentsMargins(0, 0, 0, 0)
        rows.setSpacing(STEP_PX // 2)
        rows.addLayout(self._first_row)
        rows.addLayout(second)
        whole = QHBoxLayout(self)
        whole.setContentsMargins(STEP_PX, STEP_PX // 2, STEP_PX, STEP_PX)
        whole.setSpacing(2 * STEP_PX)
        whole.addWidget(warnings, 1)
        whole.addWidget(self._stop)

    def set_workspaces(self, workspaces: Sequence[tuple[str, str]]) -> None:
        """Offer workspaces, by name and what each is for; they take the place of the title."""
        buttons = WorkspaceButtons(workspaces)
        buttons.requested.connect(self.workspace_requested)
        self._workspaces = buttons
        self._alarms = named(QToolButton(), "alarmsButton")
        self._alarms.setFocusPolicy(Qt.FocusPolicy.TabFocus)
        self._alarms.clicked.connect(self.alarms_clicked)
        self.set_alarms(0)
        self._title.hide()
        self._clearance.set_compact()
        self._modes.set_compact()
        self._second_row.setSpacing(STEP_PX)
        self._second_row.insertWidget(self._second_row.indexOf(self._pages), buttons)
        for widget, before in (
            (self._modes, self._theme),
            (self._no_model, self._controls),
            (self._rate, self._controls),
        ):
            self._normal_row.removeWidget(widget)
            self._first_row.insertWidget(self._first_row.indexOf(before), widget)
        self._first_row.insertWidget(self._first_row.indexOf(self._theme), self._alarms)

    @property
    def workspaces(self) -> WorkspaceButtons | None:
        """The buttons of the workspaces; None where the window has none."""
        return self._workspaces

    def show_workspace(self, name: str) -> None:
        """Show which workspace is in front."""
        if self._workspaces is not None:
            self._workspaces.show_current(name)

    def set_alarms(self, count: int, newest: str = "") -> None:
        """Show how many alarms nobody has acknowledged."""
        self._alarms.setText(f"▲ alarms {count}" if count else "alarms 0")
        tip = f"{newest}\n" if newest else ""
        self._alarms.setToolTip(f"{tip}Open the list of alarms")
        set_style_property(self._alarms, "alarming", count > 0)

    def add_indicator(self, indicator: QWidget) -> None:
        """Add what must be seen from everywhere, stopped or not."""
        if self._workspaces is not None:
            self._second_row.addWidget(indicator)
            return
        self._first_row.insertWidget(self._first_row.indexOf(self._theme), indicator)

    def set_menu_bar(self, menu_bar: QMenuBar) -> None:
        """Put `menu_bar` into the first row, at the left."""
        menu_bar.setSizePolicy(QSizePolicy.Policy.Maximum, QSizePolicy.Policy.Fixed)
        menu_bar.setFixedHeight(3 * STEP_PX)  # it wants another one whenever it is styled anew
        self._first_row.insertWidget(0, menu_bar)

    @property
    def latched(self) -> bool:
        """True while the bar says that the stop is latched."""
        return self._latched

    @property
    def message(self) -> str:
        """The line shown."""
        return self._message.text()

    def set_simulated(self, simulated: bool) -> None:
        """Show the SIMULATED sign, or that real hardware is driven."""
        self._simulated.setText("SIMULATED" if simulated else "HARDWARE")
        self._simulated.set_tone("simulated" if simulated else "real")
        self._simulated.setToolTip(
            "Simulation: no hardware is driven" if simulated else "Real hardware is driven"
        )

    def set_mode(self, name: str) -> None:
        """Show the control mode in force: MCM, SCM, ECM or ACM."""
        self._modes.set_mode(name)

    def set_mode_available(self, name: str, why_not: str = "") -> None:
        """Let a mode be chosen, or say why it cannot be."""
        self._modes.set_available(name, why_not)

    @property
    def controls(self) -> ControlsIndicator:
        """Who commands the movements, and what the operator can do about it."""
        return self._controls

    @property
    def clearance_text(self) -> str:
        """What is said of the clearance, in one line; empty without a collision model."""
        return "" if self._clearance.isHidden() else self._clearance.text

    def set_collision_model(self, *, present: bool) -> None:
        """Have a meter for the clearance; without a model say loudly that nothing is checked."""
        self._no_model.setVisible(not present)
        self._clearance.setVisible(present)

    def set_clearance(self, reading: Clearance | None, why_not: str = "") -> None:
        """Show how near the nearest two bodies are; None: it is not known, and why."""
        self._nearest = reading
        if reading is None:
            self._clearance.show_unknown(why_not)
        else:
            self._clearance.show_clearance(reading)

    @property
    def clearance(self) -> Clearance | None:
        """The nearest pair; None while it is not known."""
        return self._nearest

    def set_unwatched(self, axes: Collection[str]) -> None:
        """Say loudly which axes are taken out of collision detection."""
        self._unwatched.setText(f"▲ CD OFF: {_short(axes)}")
        self._unwatched.setToolTip(
            f"Not checked for collisions: {', '.join(axes)}. Their movements can hit "
            "something. Press CD OFF on the card of the axis to watch it again."
        )
        self._unwatched.setVisible(bool(axes))

    def set_contacts(self, operations: Collection[str]) -> None:
        """Say which contacts between bodies are allowed at the moment."""
        self._contacts.setText(f"contact: {_short(operations)}")
        self._contacts.setToolTip(
            f"Allowed to touch at the moment, as the scene describes it: {', '.join(operations)}"
        )
        self._contacts.setVisible(bool(operations))

    def set_rate(self, rate: float, reached: float | None = None) -> None:
        """Show how fast the platform's clock may run, and runs, where it is not real time."""
        text = f"time ×{rate:g}"
        if reached is not None:
            text += f" (reached ×{reached:.1f})"
        self._rate.setText(text)
        slow = reached is not None and reached < SLOW_PART * rate
        self._rate.setVisible(rate != 1.0 or slow)

    def set_message(self, text: str, state: State = State.ERROR) -> None:
        """Show one line, such as the last error; empty takes it away."""
        text = with_micro_signs(text)
        self._message_state.setVisible(bool(text))
        self._message_state.set_state(state, text)
        self._message.set_text(text)

    def set_latched(self, reason: str | None) -> None:
        """Turn the whole bar into the notice that the stop is latched; None ends that."""
        self._latched = reason is not None
        words = f"■ STOPPED: {with_micro_signs(reason)}" if reason else "■ STOPPED"
        self._latched_text.set_text(words, "■ STOPPED", "STOPPED")
        self._pages.setCurrentIndex(1 if self._latched else 0)
        if self.property("latched") == self._latched:
            return
        self.setProperty("latched", self._latched)
        theme = current_palette().name
        # Another theme put on meanwhile has styled what was not seen, too.
        same_theme, self._theme_then = theme == self._theme_then or self._latched, theme
        unseen = set(self._normal.findChildren(QWidget)) if same_theme else set()
        restyle(self, *(each for each in self.findChildren(QWidget) if each not in unseen))


def _short(names: Collection[str]) -> str:
    """Return as many names as the bar has room for; the tooltip has them all."""
    shown = list(names)[:_NAMES_SHOWN]
    more = len(names) - len(shown)
    return ", ".join(shown) + (f" +{more}" if more else "")
