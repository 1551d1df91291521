"""The panel that steers by an input device: what is chosen, what it says and what it does."""

from collections.abc import Callable
from typing import Final

from PySide6.QtCore import QObject, QSignalBlocker, Qt, QTimer, Signal
from PySide6.QtGui import QHideEvent, QShowEvent
from PySide6.QtWidgets import (
    QApplication,
    QComboBox,
    QHBoxLayout,
    QLabel,
    QLineEdit,
    QVBoxLayout,
    QWidget,
)

from cosmic.frame.errors import CosmicError
from cosmic.frame.gui.build import named, push_button, wrapped_label
from cosmic.frame.gui.elided_label import ElidedLabel
from cosmic.frame.gui.key_hold import HoldKeys
from cosmic.frame.gui.late_panel import is_seen
from cosmic.frame.gui.theme import STEP_PX, State, state_look
from cosmic.frame.overrides import override
from cosmic.frame.units import with_micro_signs
from cosmic.mico.api.mico import Mico
from cosmic.mico.core.teleoperation.settings import TeleoperationProfileSettings
from cosmic.mico.core.teleoperation.state import TeleoperationPhase, TeleoperationState
from cosmic.mico.gui.input_bars import ForceBar, InputBars
from cosmic.mico.gui.mapping_table import MappingTable
from cosmic.mico.gui.phase_indicator import PhaseIndicator
from cosmic.mico.gui.qt_application import qt_application
from cosmic.mico.hw.input_device import InputKind
from cosmic.mico.hw.keyboard_input import FINE_KEY, KEYS, KeyboardInput


class FineRow(QWidget):
    """Shows the pace of a profile and takes another.

    Signals
    -------
    edited(object, str)
        The operator has changed something: the share, text where it is no number, and the button.
    """

    edited = Signal(object, str)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.share = named(QLineEdit(), "fineShare")
        self.button = named(QLineEdit(), "fineButton")
        self.pace = QLabel("coarse")
        self._shown = ("", "")
        tips = (
            (self.share, "fine share", "Speed in fine mode, as a part of full speed, 0 to 1"),
            (self.button, "fine button", "Button that changes between fine and coarse"),
        )
        for edit, name, tip in tips:
            edit.setAccessibleName(name)
            edit.setToolTip(tip)
            edit.editingFinished.connect(self._on_edited)
        self.share.setFixedWidth(7 * STEP_PX)
        self.button.setFixedWidth(17 * STEP_PX)
        self.pace.setFixedWidth(self.pace.fontMetrics().horizontalAdvance("coarse") + STEP_PX)
        row = QHBoxLayout(self)
        row.setContentsMargins(0, 0, 0, 0)
        row.setSpacing(STEP_PX // 2)
        for widget in (self.pace, QLabel("fine:"), self.share, QLabel("by"), self.button):
            row.addWidget(widget)

    def show_profile(self, profile: TeleoperationProfileSettings) -> None:
        """Show what a profile says."""
        self._shown = (f"{profile.fine_share:g}", profile.fine_button)
        self.share.setText(self._shown[0])
        self.button.setText(self._shown[1])

    def show_pace(self, *, fine: bool) -> None:
        """Show how it is steered now."""
        self.pace.setText("fine" if fine else "coarse")

    def _on_edited(self) -> None:
        said = (self.share.text().strip(), self.button.text().strip())
        if said != self._shown:
            self.edited.emit(_number(said[0]), said[1])


def _number(text: str) -> float | str:
    try:
        return float(text)
    except ValueError:
        return text


BEAT_MS: Final = 20


class SteeringKeys(QObject):
    """Tells a `KeyboardInput` which keys are held, and by a timer that the window is alive.

    A window that hangs beats no more, so that the input counts as frozen.
    """

    def __init__(self, app: QApplication, keyboard: KeyboardInput, parent: QObject) -> None:
        super().__init__(parent)
        self._keyboard = keyboard
        keys = [key for pair in KEYS.values() for key in pair]
        self._hold = HoldKeys(app, [*keys, FINE_KEY], self)
        self._hold.set_enabled(False)
        self._hold.hold_started.connect(self._on_changed)
        self._hold.hold_ended.connect(self._on_changed)
        self._timer = QTimer(self, interval=BEAT_MS)
        self._timer.timeout.connect(keyboard.beat)
        self._enabled = False
        keyboard.plug(plugged=True)

    def set_enabled(self, enabled: bool) -> None:
        """Let the keys steer, or leave them to others."""
        if enabled != self._enabled:
            self._enabled = enabled
            self._hold.set_enabled(enabled)
            self._keyboard.hold(())

    def unplug(self) -> None:
        """Listen no more."""
        self.set_enabled(False)
        self._timer.stop()
        self._keyboard.plug(plugged=False)

    def _on_changed(self, _key: str) -> None:
        held = self._hold.held
        self._keyboard.hold(held)
        if held:
            self._timer.start()
        else:
            self._timer.stop()


REFRESH_MS: Final = 40
LOOK_MS: Final = 1000
_RUNNING: Final = (
    TeleoperationPhase.CENTRE,
    TeleoperationPhase.ARMED,
    TeleoperationPhase.STEERING,
    TeleoperationPhase.PAUSED,
)


class TeleoperationPanel(QWidget):
    """Chooses, starts, shows and edits; `Teleoperation` decides. GUI thread.

    It tells `Teleoperation` when the program's windows lose the operator's attention.

    Signals
    -------
    phase_changed(str)
        What it is at, in words, such as "stopped: unplugged".
    """

    phase_changed = Signal(str)

    def __init__(self, mico: Mico, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("TeleoperationPanel")
        self._teleoperation = mico.teleoperation
        self._app = qt_application()
        settings = mico.settings
        self.devices = named(QComboBox(), "teleoperationDevice")
        self.profiles = named(QComboBox(), "teleoperationProfile")
        self.start = named(push_button("Start", ""), "teleoperationStart")
        self.as_configured = named(
            push_button("As configured", "Take this profile as the platform file has it"),
            "profileAsConfigured",
        )
        self.indicator = PhaseIndicator()
        self.rates = ElidedLabel()
        self.bars = InputBars()
        self.force = ForceBar()
        self.table = MappingTable({each.name: each.kind for each in settings.positioner})
        self.fine = FineRow()
        self.fine_share = self.fine.share
        self.message = named(wrapped_label(), "teleoperationMessage")
        self.keys = SteeringKeys(self._app, self._teleoperation.sources.keys.keyboard, self)
        self._words = self._missing = ""
        self._arrange()
        self._connect()
        self._show_profiles()
        self.look_for_devices()
        self.refresh()

    # Putting it together

    def _arrange(self) -> None:
        self.devices.setAccessibleName("input device")
        self.profiles.setAccessibleName("profile")
        self.rates.setProperty("role", "dim")
        for box in (self.devices, self.profiles):
            box.setSizeAdjustPolicy(
                QComboBox.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon
            )
            box.setMinimumContentsLength(8)
        choice = QHBoxLayout()
        choice.setSpacing(STEP_PX)
        choice.addWidget(self.devices, 3)
        choice.addWidget(self.profiles, 2)
        choice.addWidget(self.start)
        rates = QHBoxLayout()
        rates.setSpacing(STEP_PX // 2)
        rates.addWidget(self.rates, 1)
        rates.addWidget(self.as_configured)
        column = QVBoxLayout(self)
        column.setContentsMargins(STEP_PX, STEP_PX, STEP_PX, STEP_PX)
        column.setSpacing(STEP_PX)
        column.addLayout(choice)
        column.addWidget(self.indicator)
        column.addWidget(self.force)
        column.addWidget(self.fine)
        column.addLayout(rates)
        column.addWidget(self.message)
        column.addWidget(self.bars)
        column.addWidget(self.table, 1)
        self.message.hide()

    def _connect(self) -> None:
        self.start.clicked.connect(self._on_start)
        self.as_configured.clicked.connect(lambda: self._edit(self._teleoperation.reset_profile))
        self.devices.activated.connect(self._on_device_chosen)
        self.profiles.currentIndexChanged.connect(self._on_profile_chosen)
        self.table.changed.connect(self._on_table_changed)
        self.table.refused.connect(self._say)
        self.fine.edited.connect(self._on_fine_edited)
        self._app.applicationStateChanged.connect(self._on_attention)
        self._refresh_timer = QTimer(self, interval=REFRESH_MS)
        self._refresh_timer.timeout.connect(self._on_refresh_timer)
        self._look_timer = QTimer(self, interval=LOOK_MS)
        self._look_timer.timeout.connect(self._on_look_timer)

    # Choosing

    def look_for_devices(self) -> None:
        """Show what is plugged in now; what was chosen stays chosen while it is there."""
        if self._running(self._teleoperation.state):
            return
        found = self._teleoperation.devices()
        entries = [(f"{info.title} ({info.kind})", info.key) for info in found]
        shown = [
            (self.devices.itemText(number), self.devices.itemData(number))
            for number in range(self.devices.count())
        ]
        if entries != shown:
            chosen, title = self.devices.currentData(), self.devices.currentText() or self._missing
            with QSignalBlocker(self.devices):
                self.devices.clear()
                for text, key in entries:
                    self.devices.addItem(text, key)
                self.devices.setCurrentIndex(self._same_device(chosen, title))
        self._allow()

    def _same_device(self, key: str | None, title: str) -> int:
        """Return where a device is now, by its key or else its title; -1 while it is missing.

        Nothing takes its place by itself: Start would begin to steer with another one.
        """
        at = max(self.devices.findData(key), self.devices.findText(title) if title else 0)
        self._missing = title if at < 0 else ""
        return at

    def _on_device_chosen(self) -> None:
        self._missing = ""
        self._allow()

    def _show_what_runs(self, state: TeleoperationState) -> None:
        """Choose what a script has started: what the panel shows is what is steered."""
        device = state.device
        if not self._running(state) or device is None:
            return
        if self.devices.currentData() != device.key:
            if self.devices.findData(device.key) < 0:
                self.devices.addItem(f"{device.title} ({device.kind})", device.key)
            self.devices.setCurrentIndex(self.devices.findData(device.key))
        self.profiles.setCurrentText(state.profile)

    def _on_look_timer(self) -> None:
        if is_seen(self):
            self.look_for_devices()

    def _show_profiles(self) -> None:
        with QSignalBlocker(self.profiles):
            for profile in self._teleoperation.profiles:
                self.profiles.addItem(profile.name)
        self._on_profile_chosen()

    def _profile(self) -> TeleoperationProfileSettings | None:
        name = self.profiles.currentText()
        return self._teleoperation.profile(name) if name else None

    def _on_profile_chosen(self) -> None:
        profile = self._profile()
        self.table.show_profile(profile)
        if profile is not None:
            self.fine.show_profile(profile)
        self._allow()

    def _allow(self) -> None:
        running = self._running(self._teleoperation.state)
        self.start.setText("Stop" if running else "Start")
        self.devices.setEnabled(not running)
        self.profiles.setEnabled(not running)
        ready = bool(self.devices.currentIndex() >= 0 and self.profiles.count())
        self.start.setEnabled(running or ready)
        if running:
            tip = "End the steering: everything it moves stops"
        elif ready:
            tip = "Start steering. Release all sticks; motion starts afterwards"
        elif not self.profiles.count():
            tip = "Not available: the platform file has no teleoperation profile"
        elif self._missing:
            tip = f"Not available: plug in {self._missing}, or choose another device"
        else:
            tip = "Not available: no input device is plugged in"
        self.start.setToolTip(tip)

    @staticmethod
    def _running(state: TeleoperationState) -> bool:
        return state.phase in _RUNNING

    # Running

    def _on_start(self) -> None:
        self.message.hide()
        if self._running(self._teleoperation.state):
            self._teleoperation.stop()
        else:
            try:
                self._on_attention()
                device, profile = self.devices.currentData(), self.profiles.currentText()
                self._teleoperation.check_inputs(device, profile)
                self._teleoperation.start(device, profile)
            except CosmicError as exc:
                self._say(str(exc))
        self.refresh()

    def _on_attention(self) -> None:
        active = self._app.applicationState() == Qt.ApplicationState.ApplicationActive
        self._teleoperation.set_focus(active)

    def _on_refresh_timer(self) -> None:
        # Unseen it goes on while it steers: what is steered has to be paused when asked.
        state = self._teleoperation.state
        if self._running(state) or state.words != self._words or is_seen(self):
            self.refresh()

    def refresh(self) -> None:
        """Show how it is now."""
        self._on_attention()
        state = self._teleoperation.state
        self.indicator.show_phase(state.phase, state.words)
        running = self._running(state)
        self.bars.show_inputs(state.inputs if running else None)
        self.force.show_force(*((state.force, state.slowed) if running else (0.0, 1.0)))
        self.fine.show_pace(fine=state.fine)
        self.table.show_state(state)
        rates = f"read {state.poll_hz:.0f} Hz, sent {state.command_hz:.0f} Hz"
        self.rates.set_text(rates if running else "")
        device = state.device
        by_keys = device is not None and device.kind is InputKind.KEYBOARD
        self.keys.set_enabled(running and by_keys)
        if state.words != self._words:
            self._words = state.words
            self._show_what_runs(state)
            self._allow()
            self.phase_changed.emit(state.words)

    # Editing

    def _on_table_changed(self, row: int, key: str, value: object) -> None:
        self._edit(lambda name: self._teleoperation.edit_axis(name, row, **{key: value}))

    def _on_fine_edited(self, share: object, button: str) -> None:
        if self._profile() is not None:
            self._edit(
                lambda name: self._teleoperation.edit_profile(
                    name, fine_share=share, fine_button=button
                )
            )

    def _edit(self, action: Callable[[str], object]) -> None:
        self.message.hide()
        try:
            action(self.profiles.currentText())
        except CosmicError as exc:
            self._say(str(exc))
        self._on_profile_chosen()

    def _say(self, text: str) -> None:
        shown = with_micro_signs(f"{state_look(State.REFUSED).glyph} {text}")
        self.message.setText(shown)
        self.message.setToolTip(shown)
        self.message.show()

    # Coming and going

    @override
    def showEvent(self, event: QShowEvent) -> None:
        super().showEvent(event)
        self.look_for_devices()
        self._refresh_timer.start()
        self._look_timer.start()

    @override
    def hideEvent(self, event: QHideEvent) -> None:
        super().hideEvent(event)
        self._look_timer.stop()

    def shut_down(self) -> None:
        """End the steering and listen to no key any more; before the window goes."""
        self._refresh_timer.stop()
        self._look_timer.stop()
        self._teleoperation.stop()
        self.keys.unplug()


def make_teleoperation_panel(mico: Mico) -> TeleoperationPanel:
    """Return the panel that steers by an input device."""
    return TeleoperationPanel(mico)
