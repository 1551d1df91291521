"""The card of one fibre: picture, curves, numbers with their intervals, and what was doubtful."""

import math
from typing import Final

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import (
    QComboBox,
    QGridLayout,
    QHBoxLayout,
    QLabel,
    QScrollArea,
    QVBoxLayout,
    QWidget,
)

from cosmic.app.campaign_table import SIGNS
from cosmic.app.fibre_curves import FibreCurves
from cosmic.app.fibre_picture import FibrePicture
from cosmic.app.procedure_tree_sign import StateSign
from cosmic.autonomy.campaign.board import CardCurve, CardData
from cosmic.autonomy.campaign.report_figures import EI_LABEL
from cosmic.autonomy.campaign.report_words import (
    NONE,
    TWO_SIDED,
    interval,
    number,
    stiffness,
    width_words,
    with_interval,
)
from cosmic.frame.gui.amounts import duration_text
from cosmic.frame.gui.build import named, push_button, tipped
from cosmic.frame.gui.chip import Chip
from cosmic.frame.gui.theme import STEP_PX, number_font
from cosmic.frame.overrides import override

_WIDE_PX: Final = 90 * STEP_PX
"""From this width on picture and curves stand side by side."""


class FibreCard(QWidget):
    """Shows a `CardData`; GUI thread.

    Signals
    -------
    replay_requested(int)
        The operator wants to see the movements of this fibre again.
    """

    replay_requested = Signal(int)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("FibreCard")
        self._card: CardData | None = None
        self._wide = True
        self.sign = StateSign()
        self.title = named(QLabel("no fibre chosen"), "cardTitle")
        self.title.setFont(number_font(bold=True))
        self.outcome = Chip("", tip="How its treatment ended")
        self.replay = named(
            push_button("Replay", "Show its movements again in the 3D view; nothing moves"),
            "cardReplay",
        )
        self.replay.clicked.connect(self._on_replay)
        self.text = _words("cardText")
        self.picture = FibrePicture()
        self.pictures = named(tipped(QComboBox(), "Which picture is shown"), "cardPictures")
        self.pictures.currentIndexChanged.connect(self._on_picture_chosen)
        self.curves = FibreCurves()
        self.numbers = QGridLayout()
        self.spans = QGridLayout()
        self.doubts = _words("cardDoubts")
        self.failures = _words("cardFailures")
        self._build()
        self.clear()

    def _build(self) -> None:
        head = QHBoxLayout()
        head.setSpacing(STEP_PX)
        for widget in (self.sign, self.title, self.outcome):
            head.addWidget(widget)
        head.addStretch(1)
        head.addWidget(self.replay)
        seen = QVBoxLayout()
        seen.setSpacing(STEP_PX // 2)
        seen.addWidget(self.pictures)
        seen.addWidget(self.picture, 1)
        self._figures = QGridLayout()
        self._figures.setSpacing(STEP_PX)
        self._seen = QWidget()
        self._seen.setLayout(seen)
        seen.setContentsMargins(0, 0, 0, 0)
        for grid in (self.numbers, self.spans):
            grid.setHorizontalSpacing(2 * STEP_PX)
            grid.setVerticalSpacing(STEP_PX // 2)
        inside = named(QWidget(), "dockBody")
        column = QVBoxLayout(inside)
        column.setContentsMargins(STEP_PX, STEP_PX, STEP_PX, STEP_PX)
        column.setSpacing(STEP_PX)
        column.addLayout(head)
        column.addWidget(self.text)
        column.addLayout(self._figures, 1)
        for layout in (self.numbers, self.spans):
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
    def card(self) -> CardData | None:
        """What is shown."""
        return self._card

    def set_card(self, card: CardData) -> None:
        """Show a fibre."""
        self._card = card
        self.sign.set_state(SIGNS[card.outcome])
        self.title.setText(f"Fibre {card.number}")
        self.outcome.setText(f"{card.outcome}: {card.cause}" if card.cause else str(card.outcome))
        self.outcome.show()
        self.replay.setEnabled(True)
        _say(self.text, card.text)
        self.pictures.clear()
        self.pictures.addItems([each.name for each in card.pictures])
        self.pictures.setVisible(len(card.pictures) > 1)
        self._on_picture_chosen(0)
        self.curves.show_curves(card.curves)
        self.curves.setVisible(bool(card.curves))
        _fill(self.numbers, [[name, text] for name, text in _numbers(card)])
        _fill(self.spans, _span_rows(card.curves))
        flags = f"Doubtful: {', '.join(card.flags)}." if card.flags else ""
        _say(self.doubts, "\n".join(part for part in (flags, *card.doubts) if part))
        failed = [f"{name}: {cause}" for name, cause in card.failures]
        _say(self.failures, "Failed on the way: " + ", ".join(failed) if failed else "")

    def clear(self) -> None:
        """Show that none is chosen."""
        self._card = None
        self.sign.set_state(None)
        self.title.setText("no fibre chosen")
        self.outcome.hide()
        self.replay.setEnabled(False)
        self.pictures.clear()
        self.pictures.hide()
        self.picture.show_picture(None, "")
        self.curves.show_curves(())
        self.curves.hide()
        for label in (self.text, self.doubts, self.failures):
            _say(label, "")
        for grid in (self.numbers, self.spans):
            _fill(grid, [])

    def _on_picture_chosen(self, place: int) -> None:
        if self._card is None:
            return
        pictures = self._card.pictures
        self.picture.show_picture(pictures[place] if 0 <= place < len(pictures) else None)

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
    label.setText(text)
    label.setVisible(bool(text))


def _numbers(card: CardData) -> list[tuple[str, str]]:
    """Return name and value of what is known of a fibre."""
    shape, ei = card.shape, card.ei
    rows = []
    if ei is not None:
        told = interval(ei.ei_low_n_m2, ei.ei_high_n_m2)
        trusted = "" if ei.trusted else ", not trusted"
        words = f"{stiffness(ei.ei_n_m2)} ({told}) {EI_LABEL}{trusted}"
        rows.append(("stiffness (95 %)", words))
    rows += [
        ("length (95 %)", f"{with_interval(shape.length_um, shape.length_std_um)} µm"),
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
    rows.append(("time", took if card.attempts == 1 else f"{took}, begun {card.attempts} times"))
    return rows


def _span_rows(curves: tuple[CardCurve, ...]) -> list[list[str]]:
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
