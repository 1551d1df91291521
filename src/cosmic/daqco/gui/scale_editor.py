"""The custom scale editor (DAQSI.13) and the view of one scale (DAQSI.12)."""

from collections.abc import Mapping, Sequence
from typing import Final

from PySide6.QtCore import Signal
from PySide6.QtWidgets import (
    QDialogButtonBox,
    QGridLayout,
    QHBoxLayout,
    QLabel,
    QLineEdit,
    QListWidget,
    QVBoxLayout,
    QWidget,
)

from cosmic.daqco.core.scale import LARGEST_DEGREE, VOLTS
from cosmic.daqco.core.settings import ScaleSettings
from cosmic.daqco.gui.dialog import FieldDialog, button_box
from cosmic.daqco.gui.polynomial import checked, coefficient_problem
from cosmic.daqco.gui.scale_plot import ScalePlot
from cosmic.daqco.gui.value_field import ValueField
from cosmic.frame.errors import ConfigError
from cosmic.frame.gui.build import named, push_button, tipped
from cosmic.frame.gui.refusal import show_refusal
from cosmic.frame.gui.theme import STEP_PX

_RAISED: Final = "⁰¹²³⁴⁵⁶⁷⁸⁹"
Button = QDialogButtonBox.StandardButton


class ScaleView(FieldDialog):
    """Shows the structure of one scale."""

    def __init__(self, scale: ScaleSettings, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setWindowTitle(f"Scale {scale.name}")
        self.plot = ScalePlot()
        self.plot.show_scale(scale)
        buttons = button_box(Button.Close)
        buttons.rejected.connect(self.reject)
        column = QVBoxLayout(self)
        column.addWidget(self.plot, 1)
        column.addWidget(buttons)


class ScaleEditor(FieldDialog):
    """Lists the named polynomials; adds, edits and removes them. OK hands them over.

    Parameters
    ----------
    used : mapping of str to str
        Scales that channels have, and the names of those channels.

    Signals
    -------
    scales_accepted(object, object)
        All scales, tuple of `ScaleSettings`, and new names by old ones, dict.
    """

    scales_accepted = Signal(object, object)

    def __init__(
        self,
        scales: Sequence[ScaleSettings],
        used: Mapping[str, str],
        parent: QWidget | None = None,
        *,
        chosen: str = "",
    ) -> None:
        super().__init__(parent)
        self.setWindowTitle("Custom scale editor")
        self._scales, self._used = list(scales), dict(used)
        self._first_names: list[str] = [each.name for each in scales]
        self._row = -1
        self.list = QListWidget()
        self.list.setAccessibleName("Scales")
        self.add = push_button("Add", "Add a scale")
        self.remove = push_button("Remove", "Remove the scale chosen")
        self.name = named(tipped(QLineEdit(), "Name of the scale"), "scaleName")
        self.unit = tipped(QLineEdit(), 'Unit of its values, such as "uN" or "mN"')
        self.coefficients = [
            ValueField(f"Coefficient of V{_RAISED[power]}", empty=True)
            for power in range(LARGEST_DEGREE + 1)
        ]
        self.plot = ScalePlot()
        self.message = QLabel()
        self.message.setWordWrap(True)
        self.buttons = button_box(Button.Ok | Button.Cancel)
        self._build()
        self._connect()
        self._fill(self._first_names.index(chosen) if chosen in self._first_names else 0)

    def _build(self) -> None:
        left = QVBoxLayout()
        self.list.setFixedWidth(22 * STEP_PX)
        left.addWidget(self.list, 1)
        under = QHBoxLayout()
        under.addWidget(self.add)
        under.addWidget(self.remove)
        left.addLayout(under)
        grid = QGridLayout()
        grid.addWidget(QLabel("Name"), 0, 0)
        grid.addWidget(self.name, 0, 1, 1, 3)
        grid.addWidget(QLabel("Unit"), 1, 0)
        grid.addWidget(self.unit, 1, 1, 1, 3)
        half = (len(self.coefficients) + 1) // 2
        for power, field in enumerate(self.coefficients):
            row, column = 2 + power % half, 2 * (power // half)
            text = "constant" if power == 0 else "V" if power == 1 else f"V{_RAISED[power]}"
            grid.addWidget(QLabel(text), row, column)
            grid.addWidget(field, row, column + 1)
        right = QVBoxLayout()
        right.addLayout(grid)
        right.addWidget(self.plot, 1)
        body = QHBoxLayout()
        body.addLayout(left)
        body.addLayout(right, 1)
        column_ = QVBoxLayout(self)
        column_.addLayout(body, 1)
        column_.addWidget(self.message)
        column_.addWidget(self.buttons)

    def _connect(self) -> None:
        self.add.clicked.connect(self._on_add)
        self.remove.clicked.connect(self._on_remove)
        self.list.currentRowChanged.connect(self._on_row_changed)
        self.buttons.accepted.connect(self._on_accepted)
        self.buttons.rejected.connect(self.reject)
        for field in (self.name, self.unit, *self.coefficients):
            field.editingFinished.connect(self._preview)

    # The scale being edited

    def _fill(self, row: int) -> None:
        """List the scales anew and show the one at `row`."""
        self.list.blockSignals(True)
        self.list.clear()
        self.list.addItems([each.name for each in self._scales])
        self._row = min(row, len(self._scales) - 1)
        self.list.setCurrentRow(self._row)
        self.list.blockSignals(False)
        self._show_current()

    def _show_current(self) -> None:
        scale = self._scales[self._row] if self._row >= 0 else None
        given = scale.coefficients if scale else ()
        self.name.setText(scale.name if scale else "")
        self.unit.setText(scale.unit if scale else "")
        for power, field in enumerate(self.coefficients):
            field.set_value(given[power] if power < len(given) else None)
        for widget in (self.name, self.unit, *self.coefficients):
            widget.setEnabled(scale is not None)
        self._say("", None)
        self.plot.show_scale(scale)
        users = self._used.get(self._first_names[self._row], "") if scale else ""
        self.remove.setEnabled(scale is not None and not users)
        self.remove.setToolTip(
            f"Used by {users}" if users else "Remove the scale chosen" if scale else "There is none"
        )

    def _say(self, reason: str, field: QLineEdit | None) -> None:
        self.message.setText(f"◆ {reason}" if reason else "")
        for each in (self.name, self.unit):
            show_refusal(each, reason if each is field else "")

    def _read(self) -> ScaleSettings | None:
        """Return what the fields say; None when it was refused, and they then say why."""
        taken = [field.take() for field in self.coefficients]  # each says what is wrong with it
        if not all(taken):
            self.message.setText("◆ a coefficient is not a number")
            return None
        for field in self.coefficients:
            field.refuse(coefficient_problem(field.value()))
            if field.reason:
                self.message.setText(f"◆ {field.reason}")
                return None
        values = [field.optional() for field in self.coefficients]
        while values and values[-1] is None:
            values.pop()
        given = tuple(0.0 if value is None else value for value in values)
        name, unit = self.name.text().strip(), self.unit.text().strip()
        others = [each.name for i, each in enumerate(self._scales) if i != self._row]
        if name in (*others, VOLTS.name):
            self._say(f"there is a scale {name!r} already", self.name)
            return None
        try:
            scale = checked(name, unit, given)
        except ConfigError as exc:
            self._say(str(exc), self.name if not name else self.unit if not unit else None)
            return None
        self._say("", None)
        return scale

    def _take(self) -> bool:
        if self._row < 0:
            return True
        scale = self._read()
        if scale is None:
            return False
        self._scales[self._row] = scale
        item = self.list.item(self._row)
        if item is not None:
            item.setText(scale.name)
        return True

    def _preview(self) -> None:
        if self._row >= 0:
            self.plot.show_scale(self._read())

    # Reactions

    def _on_row_changed(self, row: int) -> None:
        if row == self._row:
            return
        if self._take():
            self._row = row
            self._show_current()
        else:
            self.list.blockSignals(True)
            self.list.setCurrentRow(self._row)
            self.list.blockSignals(False)

    def _on_add(self) -> None:
        if not self._take():
            return
        taken = {each.name for each in self._scales}
        name = next(n for i in range(1, 10_000) if (n := f"Scale {i}") not in taken)
        self._scales.append(ScaleSettings(name=name, unit="V", coefficients=(0.0, 1.0)))
        self._first_names.append("")
        self._fill(len(self._scales) - 1)
        self.name.setFocus()
        self.name.selectAll()

    def _on_remove(self) -> None:
        del self._scales[self._row], self._first_names[self._row]
        self._fill(max(0, self._row - 1))

    def _on_accepted(self) -> None:
        if not self._take():
            return
        pairs = zip(self._first_names, self._scales, strict=True)
        renamed = {old: new.name for old, new in pairs if old and old != new.name}
        self.scales_accepted.emit(tuple(self._scales), renamed)
        self.accept()
