"""`UDaqConfigureDialog`: rates, channels and scales (thesis, Table F.3)."""

from collections.abc import Callable
from typing import Final

from PySide6.QtCore import Qt
from PySide6.QtWidgets import (
    QDialogButtonBox,
    QGridLayout,
    QHBoxLayout,
    QLabel,
    QMenu,
    QPushButton,
    QVBoxLayout,
    QWidget,
)

from cosmic.daqco.api.daqco import Daqco
from cosmic.daqco.core.scale import VOLTS
from cosmic.daqco.core.settings import HIGHEST_RATE_HZ, LOWEST_RATE_HZ
from cosmic.daqco.gui.asking import Asking
from cosmic.daqco.gui.channel_form import ChannelForm
from cosmic.daqco.gui.channel_tree import ChannelTree
from cosmic.daqco.gui.dialog import FieldDialog, button_box
from cosmic.daqco.gui.draft import Draft
from cosmic.daqco.gui.scale_editor import ScaleEditor, ScaleView
from cosmic.frame.errors import CosmicError
from cosmic.frame.gui.beside import open_beside
from cosmic.frame.gui.build import named, push_button
from cosmic.frame.gui.elided_label import ElidedLabel
from cosmic.frame.gui.quantity_field import QuantityField
from cosmic.frame.gui.relay import Relay
from cosmic.frame.gui.theme import STEP_PX

REFRESH_HZ: Final = (1.0, 300.0)
_RECORDING: Final = "A recording is running: rate, channels and their ranges stay until it ends"
Button = QDialogButtonBox.StandardButton


class UDaqConfigureDialog(FieldDialog):
    """Edits a draft; Apply and OK put it in force, Cancel forgets what was not applied."""

    def __init__(self, daqco: Daqco, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setWindowTitle("Configure acquisition")
        self._daqco = daqco
        self._draft = Draft(daqco.settings)
        self._row = -1
        draft = self._draft
        self.rate = QuantityField(
            "Hz",
            low=LOWEST_RATE_HZ,
            high=HIGHEST_RATE_HZ,
            value=draft.rate_hz,
            decimals=2,
            name="Sampling frequency",
        )
        self.refresh = QuantityField(
            "Hz",
            low=REFRESH_HZ[0],
            high=REFRESH_HZ[1],
            value=draft.refresh_hz,
            decimals=2,
            name="Refresh rate of the plotter",
        )
        self.highest = QLabel()
        self.tree = ChannelTree()
        self.add = push_button("Add input", "Add an input of a board")
        self.add.setMenu(QMenu(self.add))
        self.remove = push_button("Remove", "Remove this input")
        self.form = ChannelForm()
        self.message = ElidedLabel()
        self.buttons = button_box(Button.Apply | Button.Ok | Button.Cancel)
        self._build()
        self._connect()
        self._asking = Asking(daqco, self)
        self._relay = Relay(self._on_changed).follow(daqco.on_change)
        self._fill(0)

    def _build(self) -> None:
        top = QGridLayout()
        top.setHorizontalSpacing(STEP_PX)
        top.addWidget(QLabel("Sampling frequency"), 0, 0)
        top.addWidget(self.rate, 0, 1)
        top.addWidget(self.highest, 0, 2)
        top.addWidget(QLabel("Plotter refresh rate"), 1, 0)
        top.addWidget(self.refresh, 1, 1)
        top.setColumnStretch(2, 1)
        under = QHBoxLayout()
        under.addWidget(QLabel("Channel settings"))
        under.addStretch(1)
        under.addWidget(self.add)
        under.addWidget(self.remove)
        self.highest.setProperty("role", "dim")
        named(self.button(Button.Apply), "apply")
        column = QVBoxLayout(self)
        column.setSpacing(STEP_PX)
        column.addLayout(top)
        column.addLayout(under)
        column.addWidget(self.tree, 1)
        column.addWidget(self.form)
        column.addWidget(self.message)
        column.addWidget(self.buttons)
        self.resize(92 * STEP_PX, 84 * STEP_PX)

    def _connect(self) -> None:
        self.tree.chosen.connect(self._on_chosen)
        self.remove.clicked.connect(self._on_remove)
        self.form.view_requested.connect(self._on_view)
        self.form.edit_requested.connect(self._on_edit)
        self.form.active.clicked.connect(self._on_active)
        self.button(Button.Apply).clicked.connect(self.apply)
        self.buttons.accepted.connect(self._on_ok)
        self.buttons.rejected.connect(self.reject)

    def button(self, which: Button) -> QPushButton:
        """Return Apply, OK or Cancel."""
        return self.buttons.button(which)

    # Showing

    def _fill(self, row: int) -> None:
        """Show the draft, with one channel selected."""
        draft = self._draft
        self._row = min(row, len(draft.channels) - 1)
        self.tree.fill(self._daqco.boards(), draft.channels, self._row)
        self._show_form()
        self._fill_menu()
        self._show_highest()

    def _show_form(self) -> None:
        channel = self._draft.channels[self._row] if self._row >= 0 else None
        self.form.show_channel(channel, self._draft.scale_names)
        self._lock()

    def _fill_menu(self) -> None:
        menu = self.add.menu()
        menu.clear()
        for info in self._daqco.boards():
            under = menu.addMenu(f"{info.name}, {info.product}")
            free = self._draft.free_inputs(info)
            under.setEnabled(bool(free))
            for input_ in free:
                action = under.addAction(input_)
                action.triggered.connect(
                    lambda _=False, board=info.name, chosen=input_: self.add_input(board, chosen)
                )

    def _show_highest(self) -> None:
        active = self._draft.active
        what = "1 active channel" if active == 1 else f"{active} active channels"
        self.highest.setText(f"highest for {what}: {self._highest_hz():g} Hz")

    def _highest_hz(self) -> float:
        return min(HIGHEST_RATE_HZ, self._daqco.highest_rate_hz(self._draft.channels))

    def _lock(self) -> None:
        reason = _RECORDING if self._daqco.recording.active else ""
        self.form.lock(reason)
        self.rate.setEnabled(not reason)
        for widget, tip in (
            (self.add, "Add an input of a board"),
            (self.remove, "Remove this input"),
        ):
            widget.setEnabled(not reason)
            widget.setToolTip(reason or tip)
        if reason:
            self.message.set_text(reason)
        elif self.message.text() == _RECORDING:
            self.message.set_text("")

    def _on_changed(self) -> None:
        self._lock()

    # Editing

    def _take_form(self) -> bool:
        """Put what the fields have into the draft; False when one was refused."""
        if self._row < 0:
            return True
        draft, row = self._draft, self._row
        others = [each.name for number, each in enumerate(draft.channels) if number != row]
        channel = self.form.take(others)
        if channel is None:
            return False
        if channel != draft.channels[row]:
            draft.replace(row, channel)
            self.tree.fill(self._daqco.boards(), draft.channels, row)
            self._show_highest()
        return True

    def add_input(self, board: str, input_: str) -> None:
        """Add a channel for an input of a board, and select it."""
        if self._take_form():
            self._fill(self._draft.add(board, input_))

    def _on_chosen(self, row: int) -> None:
        if row < 0 or row == self._row:
            self.tree.select(self._row)
        elif self._take_form():
            self._row = row
            self.tree.select(row)
            self._show_form()
        else:
            self.tree.select(self._row)

    def _on_active(self) -> None:
        self._take_form()

    def _on_remove(self) -> None:
        if self._row >= 0:
            self._draft.remove(self._row)
            self._fill(max(0, self._row - 1))

    def _on_view(self, name: str) -> None:
        view = ScaleView(self._draft.scale(name), self)
        view.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        open_beside(view)

    def _on_edit(self, name: str) -> None:
        if not self._take_form():
            return
        editor = ScaleEditor(self._draft.scales, self._draft.scale_users(), self, chosen=name)
        editor.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        editor.scales_accepted.connect(self._on_scales_accepted)
        open_beside(editor)

    def _on_scales_accepted(self, scales: object, renamed: object) -> None:
        assert isinstance(scales, tuple)
        assert isinstance(renamed, dict)
        self._draft.set_scales(scales, {**renamed, VOLTS.name: VOLTS.name})
        self._fill(self._row)

    # Putting it in force

    def _take_rates(self) -> bool:
        if not all([self.rate.commit(), self.refresh.commit()]):
            return False
        highest = self._highest_hz()
        if not self.rate.value() <= highest:
            self.rate.refuse(
                f"{self._draft.active} active channels allow at most {highest:g} Hz: choose a "
                "lower rate or fewer channels"
            )
            return False
        self._draft.rate_hz, self._draft.refresh_hz = self.rate.value(), self.refresh.value()
        return True

    def apply(self) -> None:
        """Put the draft in force; where it is refused, the dialog then says why."""
        self._apply(self._on_applied)

    def _apply(self, on_result: Callable[[object, CosmicError | None], None]) -> None:
        self.message.set_text("")
        if not (self._take_form() and self._take_rates()):
            self.message.set_text("◆ REFUSED: see the field")
            return
        try:
            settings = self._draft.settings()
        except CosmicError as exc:
            on_result(None, exc)
            return
        if settings == self._daqco.settings:
            on_result(None, None)
            return
        self.buttons.setEnabled(False)
        self._asking.ask(lambda: self._daqco.apply(settings), on_result)

    def _on_applied(self, _result: object, error: CosmicError | None) -> None:
        self.buttons.setEnabled(True)
        if error is not None:
            self.message.set_text(f"◆ REFUSED: {error}")
        else:
            self._fill(self._row)

    def _on_ok(self) -> None:
        self._apply(self._on_ok_answered)

    def _on_ok_answered(self, result: object, error: CosmicError | None) -> None:
        self._on_applied(result, error)
        if error is None:
            self.accept()
