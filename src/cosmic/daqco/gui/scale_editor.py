"""The custom scale editor (DAQSI.13) and the view of one scale (DAQSI.12)."""

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
import pyqtgraph as pg
from pydantic import ValidationError
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

from cosmic.daqco.core.scale import LARGEST_COEFFICIENT, LARGEST_DEGREE, VOLTS, Scale
from cosmic.daqco.core.settings import EXTREMES_V, ScaleSettings
from cosmic.daqco.gui.dialog import FieldDialog, button_box
from cosmic.daqco.gui.plot.units import display_unit
from cosmic.daqco.gui.value_field import ValueField
from cosmic.frame.errors import ConfigError
from cosmic.frame.gui.build import named, push_button, tipped
from cosmic.frame.gui.elided_label import ElidedLabel
from cosmic.frame.gui.quantity_field import QuantityField
from cosmic.frame.gui.refusal import show_refusal
from cosmic.frame.gui.theme import STEP_PX, current_palette, number_font

POINTS = 401
_RAISED: Final = "⁰¹²³⁴⁵⁶⁷⁸⁹"
Button = QDialogButtonBox.StandardButton


def formula(coefficients: tuple[float, ...], unit: str) -> str:
    """Return a polynomial as text, such as "value in µN = 0.5 + 20 V − 0.1 V²"."""
    terms: list[str] = []
    for power, coefficient in enumerate(coefficients):
        if coefficient == 0.0 and len(coefficients) > 1:
            continue
        sign = "−" if coefficient < 0.0 else "+" if terms else ""
        volts = "" if power == 0 else " V" if power == 1 else f" V{_RAISED[power]}"
        gap = " " if terms else ""
        terms.append(f"{sign}{gap}{abs(coefficient):g}{volts}")
    return f"value in {display_unit(unit)} = {' '.join(terms) or '0'}"


def oddity(scale: ScaleSettings) -> str:
    """Return what the operator may not have meant; empty when there is nothing."""
    values = scale.scale().apply(np.linspace(*EXTREMES_V, POINTS))
    steps = np.diff(values)
    if not np.any(values != values[0]):
        return "every voltage gives the same value"
    if np.any(steps > 0.0) and np.any(steps < 0.0):
        return "the scale is not monotonic: two voltages give the same value"
    return ""


class ScalePlot(QWidget):
    """Formula, curve, and the value of a voltage that the operator types."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._scale: ScaleSettings | None = None
        self.formula = ElidedLabel()
        self.formula.setFont(number_font())
        self._draw_axes()
        self.volts = QuantityField(
            "V", low=EXTREMES_V[0], high=EXTREMES_V[1], value=1.0, decimals=3, name="Try a voltage"
        )
        self.result, self.hint = QLabel("–"), ElidedLabel()
        self.result.setFont(number_font(bold=True))
        self.hint.setProperty("role", "dim")
        row = QHBoxLayout()
        for widget in (QLabel("Try"), self.volts, QLabel("→"), self.result):
            row.addWidget(widget)
        row.addStretch(1)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.addWidget(self.formula)
        column.addWidget(self.plot, 1)
        column.addLayout(row)
        column.addWidget(self.hint)
        self.volts.value_committed.connect(self._try)

    def _draw_axes(self) -> None:
        palette = current_palette()
        self.plot = pg.GraphicsView(background=palette.field)
        self.plot.setMinimumSize(36 * STEP_PX, 22 * STEP_PX)
        self.plot.setAccessibleName("Curve of the scale")
        layout = pg.GraphicsLayout()
        self.plot.setCentralItem(layout)
        # A PlotItem would make menus that outlive it.
        box = pg.ViewBox(enableMenu=False, enableMouse=False)
        self._left = pg.AxisItem("left")
        below = pg.AxisItem("bottom")
        for axis in (self._left, below):
            axis.linkToView(box)
            axis.setPen(palette.border_strong)
            axis.setTextPen(palette.text)
            axis.enableAutoSIPrefix(False)
            axis.setGrid(60)
        below.setLabel("input, V", color=palette.dim)
        layout.addItem(self._left, row=0, col=0)
        layout.addItem(box, row=0, col=1)
        layout.addItem(below, row=1, col=1)
        self.curve = pg.PlotCurveItem(pen=pg.mkPen(palette.accent, width=2))
        self.point = pg.ScatterPlotItem(
            size=9, brush=pg.mkBrush(palette.refused), pen=pg.mkPen(palette.field)
        )
        box.addItem(self.curve)
        box.addItem(self.point)
        box.setXRange(*EXTREMES_V)

    def show_scale(self, scale: ScaleSettings | None) -> None:
        """Draw a scale; None draws nothing."""
        self._scale = scale
        if scale is None:
            self.formula.set_text("")
            self.hint.set_text("")
            self.curve.setData([], [])
        else:
            volts = np.linspace(*EXTREMES_V, POINTS)
            self.curve.setData(volts, scale.scale().apply(volts))
            self.formula.set_text(formula(scale.coefficients, scale.unit))
            odd = oddity(scale)
            self.hint.set_text(f"◆ {odd}" if odd else "")
            label = f"{scale.name}, {display_unit(scale.unit)}"
            self._left.setLabel(label, color=current_palette().dim)
        self._try()

    def _try(self) -> None:
        scale, volts = self._scale, self.volts.value()
        if scale is None:
            self.result.setText("–")
            self.point.setData([], [])
            return
        value = float(scale.scale().apply([volts])[0])
        self.result.setText(f"{value:.6g} {display_unit(scale.unit)}")
        self.point.setData([volts], [value])


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


def checked(name: str, unit: str, coefficients: tuple[float, ...]) -> ScaleSettings:
    """Return a scale that the program can use.

    Raises
    ------
    ConfigError
        It has no name, no unit or no coefficients, or one that is not finite or far too large.
    """
    Scale(name, unit, coefficients)
    if not unit.strip():
        raise ConfigError(f"scale {name!r}: say in which unit its values are")
    try:
        return ScaleSettings(name=name.strip(), unit=unit.strip(), coefficients=coefficients)
    except ValidationError as exc:
        raise ConfigError(f"scale {name!r}: {exc.errors()[0]['msg']}") from None


def coefficient_problem(value: float) -> str:
    """Return why a number cannot be a coefficient; empty when it can."""
    if abs(value) <= LARGEST_COEFFICIENT:
        return ""
    return f"give a number up to {LARGEST_COEFFICIENT:g}"
