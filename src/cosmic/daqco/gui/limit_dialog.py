"""Sets the force limit of a channel: crossing it stops every actuator."""

from collections.abc import Callable

from PySide6.QtWidgets import (
    QCheckBox,
    QComboBox,
    QDialogButtonBox,
    QFormLayout,
    QLabel,
    QVBoxLayout,
    QWidget,
)

from cosmic.daqco.api.daqco import Daqco, DaqLimit
from cosmic.daqco.core.settings import LimitSettings
from cosmic.daqco.gui.asking import Asking
from cosmic.daqco.gui.dialog import FieldDialog, button_box
from cosmic.daqco.gui.value_field import ValueField
from cosmic.frame.errors import CosmicError
from cosmic.frame.gui.build import push_button, tipped
from cosmic.frame.gui.theme import STEP_PX

Button = QDialogButtonBox.StandardButton


class LimitDialog(FieldDialog):
    """Low, high, hysteresis and armed, for one channel at a time; OK puts them in force."""

    def __init__(self, daqco: Daqco, channel: str = "", parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setWindowTitle("Limits")
        self._daqco = daqco
        self.channel = tipped(QComboBox(), "The channel that is watched")
        self.channel.addItems([each.name for each in daqco.settings.channel if each.active])
        self.low, self.high = (
            ValueField("Low limit", empty=True),
            ValueField("High limit", empty=True),
        )
        self.hysteresis = ValueField("Hysteresis: how far the value must return before a reset")
        self.armed = tipped(QCheckBox("Armed"), "Crossing the limit stops every actuator at once")
        self.remove = push_button("Remove limit", "Disarm the limit of this channel")
        self.message = QLabel()
        self.message.setWordWrap(True)
        self.buttons = button_box(Button.Ok | Button.Cancel)
        self._asking = Asking(daqco, self)
        self._build()
        self.channel.setCurrentText(channel)
        self._show()

    def _build(self) -> None:
        form = QFormLayout()
        form.setVerticalSpacing(STEP_PX)
        form.addRow("Channel", self.channel)
        form.addRow("Low limit", self.low)
        form.addRow("High limit", self.high)
        form.addRow("Hysteresis", self.hysteresis)
        form.addRow("", self.armed)
        column = QVBoxLayout(self)
        column.addLayout(form)
        column.addWidget(self.message)
        column.addWidget(self.buttons)
        self.buttons.addButton(self.remove, QDialogButtonBox.ButtonRole.ActionRole)
        self.channel.currentTextChanged.connect(self._show)
        self.remove.clicked.connect(self._on_remove)
        self.buttons.accepted.connect(self._on_ok)
        self.buttons.rejected.connect(self.reject)

    def _limit(self) -> DaqLimit | None:
        name = self.channel.currentText()
        return next((each for each in self._daqco.limits if each.settings.channel == name), None)

    def _show(self) -> None:
        name, scales = self.channel.currentText(), self._daqco.settings.scales()
        units = {each.name: scales[each.scale].unit for each in self._daqco.settings.channel}
        limit = self._limit()
        given = limit.settings if limit else None
        for field in (self.low, self.high, self.hysteresis):
            field.set_unit(units.get(name, ""))
        self.low.set_value(given.low if given else None)
        self.high.set_value(given.high if given else None)
        self.hysteresis.set_value(given.hysteresis if given else 0.0)
        self.armed.setChecked(given.armed if given else True)
        self.remove.setEnabled(limit is not None)
        self.message.setText(f"◆ {limit.reason}" if limit and limit.reason else "")

    def _read(self) -> LimitSettings | None:
        taken = [field.take() for field in (self.low, self.high, self.hysteresis)]
        if not all(taken):
            return None
        low, high = self.low.optional(), self.high.optional()
        if low is None and high is None:
            self.high.refuse("give a low limit, a high limit or both")
            return None
        if low is not None and high is not None and not low < high:
            self.high.refuse(f"the high limit must lie above the low one, {low:g}")
            return None
        if not self.hysteresis.value() >= 0.0:
            self.hysteresis.refuse("give 0 or more")
            return None
        return LimitSettings(
            channel=self.channel.currentText(),
            low=low,
            high=high,
            hysteresis=self.hysteresis.value(),
            armed=self.armed.isChecked(),
        )

    def _on_ok(self) -> None:
        wanted = self._read()
        if wanted is not None:
            self._ask(lambda: self._daqco.set_limit(wanted))

    def _on_remove(self) -> None:
        channel = self.channel.currentText()
        self._ask(lambda: self._daqco.remove_limit(channel))

    def _ask(self, action: Callable[[], None]) -> None:
        self.buttons.setEnabled(False)
        self._asking.ask(action, self._on_answered)

    def _on_answered(self, _result: object, error: CosmicError | None) -> None:
        self.buttons.setEnabled(True)
        if error is None:
            self.accept()
        else:
            self.message.setText(f"◆ REFUSED: {error}")
