"""The card of one fibre: image, curves, numbers with their intervals, and what was doubtful."""

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import QPointF, QRect, QRectF, QSize, Qt, Signal
from PySide6.QtGui import QColor, QImage, QPainter, QPaintEvent, QPixmap, QResizeEvent
from PySide6.QtWidgets import (
    QComboBox,
    QGridLayout,
    QHBoxLayout,
    QLabel,
    QScrollArea,
    QSizePolicy,
    QVBoxLayout,
    QWidget,
)

from cosmic.app.panels.campaign.table import OUTCOME_STATES
from cosmic.app.panels.curve_frame import CurveFrame
from cosmic.app.panels.state_indicator import StateIndicator
from cosmic.autonomy.campaign.formatting import (
    EI_LABEL,
    NONE,
    interval,
    length_words,
    number,
    stiffness,
    width_words,
    with_interval,
)
from cosmic.autonomy.campaign.records import FibreImage
from cosmic.autonomy.campaign.snapshot import FibreCardData, SpanCurve
from cosmic.frame.arrays import Floats, Mask
from cosmic.frame.gui.amounts import duration_text
from cosmic.frame.gui.build import named, push_button, tipped
from cosmic.frame.gui.chip import Chip
from cosmic.frame.gui.elided_label import ElidedLabel
from cosmic.frame.gui.painting import painting
from cosmic.frame.gui.palette import OKABE_ITO, ON_IMAGE, Palette
from cosmic.frame.gui.theme import STEP_PX, current_palette, number_font
from cosmic.frame.overrides import override
from cosmic.frame.units import TWO_SIDED, with_micro_signs


class FibreImageView(QWidget):
    """Shows a `FibreImage` with a bar that tells its scale; GUI thread."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._pixmap = QPixmap()
        self._scale_um_px = float("nan")
        self._words = ""
        self.setMinimumSize(24 * STEP_PX, 18 * STEP_PX)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)

    @property
    def shown(self) -> QSize:
        """Size of the image in its own pixels; empty where there is none."""
        return self._pixmap.size()

    def show_image(self, image: FibreImage | None, words: str = "no image was saved") -> None:
        """Show `image`, or `words` where there is none."""
        self._words = words
        if image is None:
            self._pixmap = QPixmap()
        else:
            self._pixmap = QPixmap.fromImage(_qimage(image))
            self._scale_um_px = image.scale_um_px
            self.setAccessibleName(image.name)
        self.update()

    @override
    def sizeHint(self) -> QSize:
        return QSize(40 * STEP_PX, 30 * STEP_PX)

    @override
    def paintEvent(self, event: QPaintEvent) -> None:
        with painting(self) as painter:
            palette = current_palette()
            painter.fillRect(self.rect(), QColor(palette.field))
            if self._pixmap.isNull():
                painter.setPen(QColor(palette.dim))
                painter.drawText(self.rect(), int(Qt.AlignmentFlag.AlignCenter), self._words)
                return
            painter.setRenderHint(QPainter.RenderHint.SmoothPixmapTransform)
            size = self._pixmap.size().scaled(self.size(), Qt.AspectRatioMode.KeepAspectRatio)
            place = QRect(
                (self.width() - size.width()) // 2,
                (self.height() - size.height()) // 2,
                size.width(),
                size.height(),
            )
            painter.drawPixmap(place, self._pixmap)
            self._paint_bar(painter, place)

    def _paint_bar(self, painter: QPainter, place: QRect) -> None:
        """Draw a bar of a round length, light on dark, which any image shows."""
        width_um = self._scale_um_px * self._pixmap.width()
        if not 0.0 < width_um < 1e7:
            return
        length_um = round_below(0.35 * width_um)
        length_px = round(length_um / width_um * place.width())
        left, bottom = place.left() + STEP_PX, place.bottom() - STEP_PX
        words = f"{length_um:g} µm"
        height = painter.fontMetrics().height()
        box_px = max(length_px, painter.fontMetrics().horizontalAdvance(words)) + STEP_PX
        ground = QRect(left - 4, bottom - height - 8, box_px, height + 12)
        painter.fillRect(ground, QColor(ON_IMAGE["rim"]))
        painter.fillRect(left, bottom - 3, length_px, 3, QColor(ON_IMAGE["ink"]))
        painter.setPen(QColor(ON_IMAGE["ink"]))
        painter.drawText(left, bottom - 7, words)


def round_below(value: float) -> float:
    """Return the largest of 1, 2 and 5 times a power of ten that is not above `value`."""
    size = 10.0 ** np.floor(np.log10(value))
    return float(next(digit for digit in (5.0, 2.0, 1.0) if digit * size <= value) * size)


def _qimage(image: FibreImage) -> QImage:
    pixels = image.pixels
    eight_bit = (pixels >> 8).astype(np.uint8) if pixels.dtype == np.uint16 else pixels
    grey = np.ascontiguousarray(eight_bit)
    height, width = grey.shape[:2]
    shown = QImage(grey.data, width, height, grey.strides[0], QImage.Format.Format_Grayscale8)
    return shown.copy()  # the array may go


_OUT: Final = OKABE_ITO["sky blue"]
_BACK: Final = OKABE_ITO["orange"]
_POINT_PX: Final = 6
_AXIS_PX: Final = 52
_GAP_PX: Final = 2.0


class FibreCurves(CurveFrame):
    """Draws `SpanCurve`s: full points out, hollow ones back, lines for the model; GUI thread."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(_AXIS_PX, parent)
        self.box, _ = self._add_field("force, µN", 3)
        self.left, _ = self._add_field("less model, µN")
        self.left.setXLink(self.box)
        self._add_axis_below("push beyond the first contact, µm")
        self.setMinimumSize(36 * STEP_PX, 28 * STEP_PX)
        self.setToolTip(
            "Force over push beyond the first contact: full points loading, hollow ones "
            "unloading, lines of the model; one set per position along the fibre. Below: what "
            "the model leaves of the force"
        )
        self._curves: tuple[SpanCurve, ...] = ()
        self.labels: list[pg.TextItem] = []
        self._ends: list[QPointF] = []
        self.box.sigTransformChanged.connect(self._place_labels)
        self._restyle()

    @override
    def sizeHint(self) -> QSize:
        return QSize(48 * STEP_PX, 36 * STEP_PX)  # the plot's own is that of all it may draw

    def show_curves(self, curves: Sequence[SpanCurve]) -> None:
        """Draw the spans of a fibre."""
        self._curves = tuple(curves)
        self._draw()

    def _draw(self) -> None:
        for box in (self.box, self.left):
            for item in list(box.addedItems):
                box.removeItem(item)
        self.labels, self._ends = [], []
        palette = current_palette()
        for curve in self._curves:
            back = ~curve.loading
            for branch in (curve.loading, back):
                fitted = branch & np.isfinite(curve.fitted_un)
                order = np.argsort(curve.probe_um[fitted])
                line = pg.PlotCurveItem(
                    curve.probe_um[fitted][order], curve.fitted_un[fitted][order]
                )
                line.setPen(pg.mkPen(palette.dim, width=1))
                self.box.addItem(line)
            self.box.addItem(_points(curve, back, _BACK, hollow=True))
            self.box.addItem(_points(curve, curve.loading, _OUT, hollow=False))
            self.left.addItem(_residuals(curve, back, _BACK, hollow=True))
            self.left.addItem(_residuals(curve, curve.loading, _OUT, hollow=False))
            self._label(curve, palette.text)
        if self._curves:
            self.left.addItem(pg.InfiniteLine(0.0, 0, pen=pg.mkPen(palette.dim, width=1)))
            self.box.autoRange(padding=0.12)
            self.left.autoRange(padding=0.12)
            self._place_labels()

    def _label(self, curve: SpanCurve, colour: str) -> None:
        last = int(np.argmax(curve.probe_um))
        text = f"{curve.place_um:.0f} µm" + ("" if curve.used else ", not used")
        label = pg.TextItem(text, color=colour, anchor=(1.0, 1.0))
        label.setFont(number_font(11))
        end = QPointF(float(curve.probe_um[last]), float(curve.force_un[last]))
        label.setPos(end)
        self.labels.append(label)
        self._ends.append(end)
        self.box.addItem(label, ignoreBounds=True)

    def _place_labels(self) -> None:
        """Move each label so far to the left of its curve's end that it covers no other one."""
        pixel = QPointF(*self.box.viewPixelSize())
        if not (pixel.x() > 0.0 and pixel.y() > 0.0):
            return
        placed: list[QRectF] = []
        for label, end in sorted(
            zip(self.labels, self._ends, strict=True), key=lambda each: -each[1].x()
        ):
            size = label.boundingRect().size()
            right_px, bottom_px = end.x() / pixel.x(), -end.y() / pixel.y()
            place = QRectF(
                right_px - size.width(), bottom_px - size.height(), size.width(), size.height()
            )
            while covered := next((each for each in placed if place.intersects(each)), None):
                place.moveRight(covered.left() - _GAP_PX)
            placed.append(place)
            label.setPos(place.right() * pixel.x(), end.y())

    @override
    def _colour(self, palette: Palette) -> None:
        self._draw()


def _points(curve: SpanCurve, which: Mask, colour: str, *, hollow: bool) -> pg.ScatterPlotItem:
    return _dots(curve.probe_um[which], curve.force_un[which], colour, hollow=hollow)


def _residuals(curve: SpanCurve, which: Mask, colour: str, *, hollow: bool) -> pg.ScatterPlotItem:
    shown = which & np.isfinite(curve.fitted_un)
    away_un = curve.force_un[shown] - curve.fitted_un[shown]
    return _dots(curve.probe_um[shown], away_un, colour, hollow=hollow)


def _dots(x: Floats, y: Floats, colour: str, *, hollow: bool) -> pg.ScatterPlotItem:
    return pg.ScatterPlotItem(
        x,
        y,
        size=_POINT_PX,
        pen=pg.mkPen(colour, width=1.2) if hollow else pg.mkPen(None),
        brush=None if hollow else QColor(colour),
    )


_BUDGET_HEAD: Final = ["contribution", "kind", "uncertainty", "d ln(EI)", "share, %"]
_WIDE_PX: Final = 90 * STEP_PX
"""From this width on image and curves stand side by side."""


class FibreCard(QWidget):
    """Shows a `FibreCardData`; GUI thread.

    Signals
    -------
    replay_requested(int)
        The operator wants to see the movements of this fibre again.
    """

    replay_requested = Signal(int)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("FibreCard")
        self._card: FibreCardData | None = None
        self._wide = True
        self.indicator = StateIndicator()
        self.title = named(QLabel("no fibre chosen"), "cardTitle")
        self.title.setFont(number_font(bold=True))
        self.outcome = Chip("", tip="Outcome of the treatment")
        self.value = named(ElidedLabel(), "cardValue")
        self.value.setFont(number_font(bold=True))
        self.replay = named(
            push_button("Replay", "Replay its movements in the 3D view. Nothing moves."),
            "cardReplay",
        )
        self.replay.clicked.connect(self._on_replay)
        self.text = _words("cardText")
        self.image = FibreImageView()
        self.images = named(tipped(QComboBox(), "Image that is shown"), "cardImages")
        self.images.currentIndexChanged.connect(self._on_image_chosen)
        self.curves = FibreCurves()
        self.numbers = QGridLayout()
        self.spans = QGridLayout()
        self.budget = QGridLayout()
        self.doubts = _words("cardDoubts")
        self.failures = _words("cardFailures")
        self._build()
        self.clear()

    def _build(self) -> None:
        head = QHBoxLayout()
        head.setSpacing(STEP_PX)
        for widget in (self.indicator, self.title, self.outcome):
            head.addWidget(widget)
        head.addWidget(self.value, 1)
        head.addWidget(self.replay)
        seen = QVBoxLayout()
        seen.setSpacing(STEP_PX // 2)
        seen.addWidget(self.images)
        seen.addWidget(self.image, 1)
        self._figures = QGridLayout()
        self._figures.setSpacing(STEP_PX)
        self._seen = QWidget()
        self._seen.setLayout(seen)
        seen.setContentsMargins(0, 0, 0, 0)
        for grid in (self.numbers, self.spans, self.budget):
            grid.setHorizontalSpacing(2 * STEP_PX)
            grid.setVerticalSpacing(STEP_PX // 2)
        inside = named(QWidget(), "dockBody")
        column = QVBoxLayout(inside)
        column.setContentsMargins(STEP_PX, STEP_PX, STEP_PX, STEP_PX)
        column.setSpacing(STEP_PX)
        column.addLayout(head)
        column.addWidget(self.text)
        column.addLayout(self._figures, 1)
        for layout in (self.numbers, self.spans, self.budget):
            row = QHBoxLayout()
            row.addLayout(layout)
            row.addStretch(1)
            column.addLayout(row)
        column.addWidget(self.doubts)
        column.addWidget(self.failures)
        scroll = QScrollArea(widgetResizable=True)
        scroll.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAsNeeded)
        scroll.setWidget(inside)
        whole = QVBoxLayout(self)
        whole.setContentsMargins(0, 0, 0, 0)
        whole.addWidget(scroll)
        self._arrange(wide=True)

    def _arrange(self, *, wide: bool) -> None:
        self._wide = wide
        self._figures.addWidget(self._seen, 0, 0)
        self._figures.addWidget(self.curves, 0 if wide else 1, 1 if wide else 0)
        self._figures.setColumnStretch(0, 1)
        self._figures.setColumnStretch(1, 1 if wide else 0)

    # What is shown

    @property
    def card(self) -> FibreCardData | None:
        """What is shown."""
        return self._card

    def set_card(self, card: FibreCardData) -> None:
        """Show a fibre."""
        self._card = card
        self.indicator.set_state(OUTCOME_STATES[card.outcome])
        self.title.setText(f"Fibre {card.number}")
        self.outcome.setText(f"{card.outcome}: {card.cause}" if card.cause else str(card.outcome))
        self.outcome.show()
        self.value.set_text(*_values(card))
        self.replay.setEnabled(True)
        _say(self.text, card.text)
        self.images.clear()
        self.images.addItems([each.name for each in card.images])
        self.images.setVisible(len(card.images) > 1)
        self._on_image_chosen(0)
        self.curves.show_curves(card.curves)
        self.curves.setVisible(bool(card.curves))
        _fill(self.numbers, [[name, text] for name, text in _numbers(card)])
        _fill(self.spans, _span_rows(card.curves))
        _fill(self.budget, [_BUDGET_HEAD, *map(list, card.budget)] if card.budget else [])
        flags = f"Doubtful: {', '.join(card.flags)}." if card.flags else ""
        parts = (flags, *card.doubts, card.uncertainty)
        _say(self.doubts, "\n".join(part for part in parts if part))
        failed = [f"{name}: {cause}" for name, cause in card.failures]
        _say(self.failures, "Failed operations: " + ", ".join(failed) if failed else "")

    def clear(self) -> None:
        """Show that none is chosen."""
        self._card = None
        self.indicator.set_state(None)
        self.title.setText("no fibre chosen")
        self.outcome.hide()
        self.value.set_text("")
        self.replay.setEnabled(False)
        self.images.clear()
        self.images.hide()
        self.image.show_image(None, "")
        self.curves.show_curves(())
        self.curves.hide()
        for label in (self.text, self.doubts, self.failures):
            _say(label, "")
        for grid in (self.numbers, self.spans, self.budget):
            _fill(grid, [])

    def _on_image_chosen(self, place: int) -> None:
        if self._card is None:
            return
        images = self._card.images
        self.image.show_image(images[place] if 0 <= place < len(images) else None)

    def _on_replay(self) -> None:
        if self._card is not None:
            self.replay_requested.emit(self._card.number)

    @override
    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        wide = self.width() >= _WIDE_PX
        if wide != self._wide:
            self._arrange(wide=wide)


def _words(name: str) -> QLabel:
    label = named(QLabel(), name)
    label.setTextFormat(Qt.TextFormat.PlainText)
    label.setWordWrap(True)
    return label


def _say(label: QLabel, text: str) -> None:
    label.setText(with_micro_signs(text))
    label.setVisible(bool(text))


def _values(card: FibreCardData) -> tuple[str, ...]:
    """Return what was measured with its interval, and shorter; an empty text where nothing was."""
    ei = card.ei
    if ei is None:
        return ("",)
    value, trusted = stiffness(ei.ei_n_m2), "" if ei.trusted else ", not trusted"
    bounds = interval(ei.ei_low_n_m2, ei.ei_high_n_m2)
    return f"{value} ({bounds}) {EI_LABEL}{trusted}", f"{value} ({bounds})"


def _numbers(card: FibreCardData) -> list[tuple[str, str]]:
    """Return name and value of what is known of a fibre."""
    shape = card.shape
    rows = []
    if card.ei is not None:
        rows.append(("stiffness (95 %)", _values(card)[0]))
    rows += [
        ("length (95 %)", length_words(shape)),
        ("width (95 %)", f"{width_words(shape)} µm"),
        ("curl (95 %)", with_interval(shape.curl, shape.curl_std, 3)),
    ]
    if math.isfinite(card.clamp_offset_um):
        spread = number(TWO_SIDED * card.clamp_offset_std_um, 1)
        offset = f"{number(card.clamp_offset_um, 1)} ± {spread} µm"
        rows.append(("clamp offset (95 %)", offset))
    if math.isfinite(card.peak_force_un):
        rows.append(("highest force", f"{number(card.peak_force_un, 1)} µN"))
    took = duration_text(card.duration_s) if card.duration_s >= 0.0 else NONE
    rows.append(("time", took if card.attempts == 1 else f"{took}, {card.attempts} attempts"))
    return rows


def _span_rows(curves: tuple[SpanCurve, ...]) -> list[list[str]]:
    """Return the table of the spans, its head first."""
    if not curves:
        return []
    rows = [["span, µm", "stiffness (95 %), µN/µm", "notes"]]
    for curve in curves:
        k_un_um, spread = number(curve.k_un_um, 3), number(TWO_SIDED * curve.k_std_un_um, 3)
        notes = [*curve.flags, *([] if curve.used else ["not used"])]
        rows.append(
            [
                number(curve.place_um, 1),
                k_un_um if k_un_um == NONE else f"{k_un_um} ± {spread}",
                ", ".join(notes),
            ]
        )
    return rows


def _fill(grid: QGridLayout, rows: list[list[str]]) -> None:
    """Write a table; its first column and, where there are three, its head are dim."""
    while (item := grid.takeAt(0)) is not None:
        widget = item.widget()
        if widget is not None:
            widget.hide()
            widget.deleteLater()
    for place, row in enumerate(rows):
        for column, text in enumerate(row):
            label = QLabel(text)
            label.setTextFormat(Qt.TextFormat.PlainText)
            label.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
            label.setFont(number_font())
            if (len(row) == 2 and column == 0) or (len(row) > 2 and place == 0):
                label.setProperty("role", "dim")
            grid.addWidget(label, place, column)
