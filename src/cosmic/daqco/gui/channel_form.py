"""The fields for one channel (DAQSI.4 to DAQSI.14)."""

import re
from collections.abc import Sequence
from typing import Final

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QColor, QIcon
from PySide6.QtWidgets import (
    QCheckBox,
    QColorDialog,
    QComboBox,
    QGridLayout,
    QLabel,
    QLineEdit,
    QWidget,
)

from cosmic.daqco.core.settings import EXTREMES_V, ChannelSettings
from cosmic.daqco.gui.colours import colour_name, readable, swatch
from cosmic.frame.gui.beside import open_beside
from cosmic.frame.gui.build import named, push_button, tipped
from cosmic.frame.gui.palette import OKABE_ITO
from cosmic.frame.gui.quantity_field import QuantityField
from cosmic.frame.gui.refusal import show_refusal
from cosmic.frame.gui.theme import STEP_PX

LONGEST: Final = 60
_NAME: Final = re.compile(r"[a-z][a-z0-9_]*(\.[a-z][a-z0-9_]*)?")


def channel_name_problem(name: str, others: Sequence[str]) -> str:
    """Return why a channel cannot be called that; empty when it can."""
    if not name:
        return "type a name, such as force"
    if not _NAME.fullmatch(name):
        return (
            "a name begins with a small letter and has small letters, digits and _ "
            "(and one dot at most), such as probe.force"
        )
    if len(name) > LONGEST:
        return f"the name is longer than {LONGEST} letters"
    return f"another channel is called {name!r}" if name in others else ""


_MODES: Final = {
    "rse": "against ground (RSE)",
    "nrse": "against AI SENSE (NRSE)",
    "differential": "differential",
}
_OTHER: Final = "Other…"


class ChannelForm(QWidget):
    """Shows one channel and reads it back; refuses at the field that is wrong."""

    view_requested = Signal(str)
    edit_requested = Signal(str)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._channel: ChannelSettings | None = None
        self.address = tipped(QLineEdit(), "Physical address of the channel selected")
        self.address.setReadOnly(True)
        self.name = named(tipped(QLineEdit(), "Name of the channel, such as force"), "channelName")
        self.colour_shown = tipped(QLineEdit(), "Colour of its curve")
        self.colour_shown.setReadOnly(True)
        self._swatch = self.colour_shown.addAction(
            QIcon(), QLineEdit.ActionPosition.LeadingPosition
        )
        self.colour = tipped(QComboBox(), "Choose a colour for its curve")
        for name, value in OKABE_ITO.items():
            self.colour.addItem(swatch(value), name, value)
        self.colour.addItem(_OTHER)
        low, high = EXTREMES_V
        self.low = QuantityField("V", low=low, high=high, decimals=2, name="Lowest voltage there")
        self.high = QuantityField("V", low=low, high=high, decimals=2, name="Highest voltage there")
        self.mode = tipped(QComboBox(), "How the input is wired")
        for value, text in _MODES.items():
            self.mode.addItem(text, value)
        self.scale_shown = tipped(QLineEdit(), "Custom scale of the channel")
        self.scale_shown.setReadOnly(True)
        self.scale = tipped(QComboBox(), "Choose a custom scale")
        self.view = push_button("View", "Show the structure of the scale")
        self.edit = push_button("Edit…", "Open the custom scale editor")
        self.active = tipped(QCheckBox("Task active"), "Acquire, show and record this channel")
        self._build()
        self.colour.activated.connect(self._on_colour)
        self.scale.activated.connect(lambda: self.scale_shown.setText(self.scale.currentText()))
        self.view.clicked.connect(lambda: self.view_requested.emit(self.scale_shown.text()))
        self.edit.clicked.connect(lambda: self.edit_requested.emit(self.scale_shown.text()))
        self.name.textEdited.connect(lambda: show_refusal(self.name, ""))

    def _build(self) -> None:
        grid = QGridLayout(self)
        grid.setContentsMargins(0, 0, 0, 0)
        grid.setHorizontalSpacing(STEP_PX)
        grid.setVerticalSpacing(STEP_PX // 2)
        rows: Sequence[tuple[str, Sequence[QWidget]]] = (
            ("Selected channel", (self.address,)),
            ("Assigned name", (self.name,)),
            ("Assigned colour", (self.colour_shown, self.colour)),
            ("Output min", (self.low,)),
            ("Output max", (self.high,)),
            ("Wiring", (self.mode,)),
            ("Custom scale", (self.scale_shown, self.scale, self.view, self.edit)),
        )
        for number, (text, widgets) in enumerate(rows):
            label = QLabel(text)
            label.setBuddy(widgets[0])
            grid.addWidget(label, number, 0)
            for column, widget in enumerate(widgets):
                grid.addWidget(widget, number, 1 + column)
        grid.addWidget(self.active, len(rows), 1)
        grid.setColumnStretch(1, 1)
        grid.setColumnStretch(2, 1)

    # One channel

    def show_channel(self, channel: ChannelSettings | None, scales: Sequence[str]) -> None:
        """Show a channel, or that none is selected."""
        self._channel = channel
        self.setEnabled(channel is not None)
        self.scale.clear()
        self.scale.addItems(list(scales))
        show_refusal(self.name, "")
        if channel is None:
            for field in (self.address, self.name, self.colour_shown, self.scale_shown):
                field.setText("")
            return
        self.address.setText(f"{channel.board}/{channel.input}")
        self.name.setText(channel.name)
        self._show_colour(channel.colour)
        for quantity, value in ((self.low, channel.low_v), (self.high, channel.high_v)):
            quantity.set_value(value)
            quantity.revert()
        self.mode.setCurrentIndex(self.mode.findData(channel.mode))
        self.scale.setCurrentText(channel.scale)
        self.scale_shown.setText(channel.scale)
        self.active.setChecked(channel.active)

    def lock(self, reason: str) -> None:
        """Keep what a running recording depends on as it is; an empty reason unlocks it."""
        for widget in (self.name, self.low, self.high, self.mode, self.active):
            widget.setEnabled(not reason)
            if reason:
                widget.setToolTip(reason)

    def take(self, others: Sequence[str]) -> ChannelSettings | None:
        """Return the channel as the fields have it; None when one was refused and says why."""
        channel = self._channel
        if channel is None:
            return None
        committed = [self.low.commit(), self.high.commit()]
        name = self.name.text().strip()
        wrong = channel_name_problem(name, others)
        show_refusal(self.name, wrong)
        if wrong or not all(committed):
            return None
        if not self.low.value() < self.high.value():
            self.high.refuse(f"output max must lie above output min, {self.low.value():g} V")
            return None
        return ChannelSettings(
            name=name,
            board=channel.board,
            input=channel.input,
            mode=self.mode.currentData(),
            active=self.active.isChecked(),
            low_v=self.low.value(),
            high_v=self.high.value(),
            colour=self.colour_shown.property("colour"),
            scale=self.scale_shown.text(),
        )

    # Colours

    def _show_colour(self, colour: str) -> None:
        self.colour_shown.setProperty("colour", colour)
        self.colour_shown.setText(colour_name(colour))
        self._swatch.setIcon(swatch(readable(colour)))
        known = self.colour.findData(colour.upper(), flags=Qt.MatchFlag.MatchExactly)
        self.colour.setCurrentIndex(known if known >= 0 else self.colour.count() - 1)

    def _on_colour(self) -> None:
        chosen = self.colour.currentData()
        if chosen is not None:
            self._show_colour(chosen)
            return
        dialog = QColorDialog(QColor(self.colour_shown.property("colour")), self)
        dialog.setOption(QColorDialog.ColorDialogOption.DontUseNativeDialog)
        dialog.colorSelected.connect(lambda colour: self._show_colour(colour.name().upper()))
        dialog.finished.connect(lambda: self._show_colour(self.colour_shown.property("colour")))
        dialog.finished.connect(dialog.deleteLater)
        open_beside(dialog)
