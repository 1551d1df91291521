"""The live board of a campaign: how it stands, the stiffnesses, the failures, the fibres."""

from collections.abc import Mapping
from typing import Final

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QGridLayout, QHBoxLayout, QLabel, QProgressBar, QVBoxLayout, QWidget

from cosmic.app.panels.campaign.histogram import EiHistogram
from cosmic.app.panels.campaign.table import FibreTable
from cosmic.app.panels.state_indicator import StateIndicator
from cosmic.autonomy.campaign.formatting import EI_LABEL, duration, mean_words, number
from cosmic.autonomy.campaign.snapshot import CampaignSnapshot
from cosmic.frame.gui.build import named, styled, tipped
from cosmic.frame.gui.chip import Chip
from cosmic.frame.gui.elided_label import ElidedLabel
from cosmic.frame.gui.flow_layout import FlowLayout
from cosmic.frame.gui.theme import LARGE_PX, STEP_PX, State, number_font

MOST: Final = 6
_OTHERS: Final = "others"


class CauseList(QWidget):
    """Shows how many fibres failed by each cause, the most frequent first."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._grid = QGridLayout(self)
        self._grid.setContentsMargins(0, 0, 0, 0)
        self._grid.setHorizontalSpacing(STEP_PX)
        self._grid.setVerticalSpacing(STEP_PX // 2)
        self._grid.setColumnStretch(0, 1)
        title = QLabel("Failed by")
        title.setProperty("role", "dim")
        self._grid.addWidget(title, 0, 0, 1, 3)
        self._lines = [self._line(row) for row in range(1, MOST + 1)]
        self._grid.setRowStretch(MOST + 1, 1)
        self.setMinimumWidth(24 * STEP_PX)
        self.show_causes({})

    def _line(self, row: int) -> tuple[ElidedLabel, QProgressBar, QLabel]:
        text, bar, count = ElidedLabel(), styled(QProgressBar(), "bar"), QLabel()
        bar.setTextVisible(False)
        bar.setFixedSize(8 * STEP_PX, STEP_PX)
        count.setFont(number_font())
        count.setAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
        count.setMinimumWidth(count.fontMetrics().horizontalAdvance("0000"))
        for column, widget in enumerate((text, bar, count)):
            self._grid.addWidget(widget, row, column)
        return text, bar, count

    def show_causes(self, causes: Mapping[str, int]) -> None:
        """Show these; what does not fit is added up."""
        listed = list(causes.items())
        if len(listed) > MOST:
            rest = sum(count for _, count in listed[MOST - 1 :])
            listed = [*listed[: MOST - 1], (_OTHERS, rest)]
        if not listed:
            listed = [("nothing so far", 0)]
        most = max([1, *(count for _, count in listed)])
        for place, (text, bar, count) in enumerate(self._lines):
            there = place < len(listed)
            for widget in (text, bar, count):
                widget.setVisible(there)
            if there:
                name, times = listed[place]
                text.set_text(name)
                count.setText(str(times) if times else "")
                bar.setRange(0, most)
                bar.setValue(times)
                bar.setVisible(times > 0)

    def texts(self) -> list[tuple[str, str]]:
        """Return what is shown."""
        return [
            (text.text(), count.text()) for text, _, count in self._lines if not text.isHidden()
        ]


_STATES: Final = {
    "running": State.BUSY,
    "pausing": State.BUSY,
    "paused": State.REFUSED,
    "ending": State.REFUSED,
    "ended": State.OK,
    "stopped": State.REFUSED,
    "failed": State.ERROR,
}


class Fact(QWidget):
    """A large number with its name above."""

    def __init__(self, title: str, tip: str, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        caption = QLabel(title)
        caption.setProperty("role", "dim")
        self.value = QLabel("–")
        self.value.setFont(number_font(LARGE_PX, bold=True))
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, STEP_PX, 0)
        column.setSpacing(0)
        column.addWidget(caption)
        column.addWidget(self.value)
        tipped(self, tip)

    def set_text(self, text: str) -> None:
        """Show `text`."""
        if text != self.value.text():
            self.value.setText(text)
            self.updateGeometry()


class CampaignBoard(QWidget):
    """Shows a `CampaignSnapshot`; GUI thread.

    Signals
    -------
    fibre_chosen(int)
        The number of a fibre that the operator wants to see; connect it to a `FibreCard`.
    """

    fibre_chosen = Signal(int)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("CampaignBoard")
        self._shown: CampaignSnapshot | None = None
        self.indicator = StateIndicator()
        self.state = Chip("no campaign", tip="State of the campaign")
        self.title = named(ElidedLabel(), "campaignTitle")
        self.reason = named(ElidedLabel(), "campaignReason")
        self.fibres = Fact("fibres", "Completed fibres (good / total)")
        self.success = Fact("success", "Share of the completed fibres that are good")
        self.rate = Fact("good an hour", "Good fibres per hour of platform time")
        self.elapsed = Fact("elapsed", "Time on the platform's clock")
        self.left = Fact("left", "Time until the first stop rule is met, at the present rate")
        self.mean = Fact(
            f"mean stiffness, {EI_LABEL}",
            "Geometric mean of the good fibres, with its 95 % interval",
        )
        self.histogram = EiHistogram()
        self.causes = CauseList()
        self.table = FibreTable()
        self.table.setToolTip("Double click a fibre to see its card")
        self.table.fibre_chosen.connect(self.fibre_chosen)
        self._build()

    def _build(self) -> None:
        head = QHBoxLayout()
        head.setSpacing(STEP_PX)
        for widget in (self.indicator, self.state):
            head.addWidget(widget)
        head.addWidget(self.title, 1)
        facts = QWidget()
        flow = FlowLayout(STEP_PX, facts)
        for fact in (self.fibres, self.success, self.rate, self.elapsed, self.left, self.mean):
            flow.addWidget(fact)
        middle = QHBoxLayout()
        middle.setSpacing(2 * STEP_PX)
        middle.addWidget(self.histogram, 3)
        middle.addWidget(self.causes, 2)
        column = QVBoxLayout(self)
        column.setContentsMargins(STEP_PX, STEP_PX, STEP_PX, STEP_PX)
        column.setSpacing(STEP_PX)
        column.addLayout(head)
        column.addWidget(self.reason)
        column.addWidget(facts)
        column.addLayout(middle, 2)
        column.addWidget(self.table, 3)
        self.reason.hide()

    def set_state(self, board: CampaignSnapshot) -> None:
        """Show a campaign as it is now; what did not change is not drawn anew."""
        if board == self._shown:
            return
        self._shown = board
        self.indicator.set_state(_STATES.get(board.state))
        self.state.setText(board.state)
        self.title.set_text(f"{board.name}: {board.operation}" if board.operation else board.name)
        self.reason.set_text(board.reason)
        self.reason.setVisible(bool(board.reason))
        self.fibres.set_text(_counts(board))
        self.success.set_text(f"{number(board.success_percent)} %" if board.done else "–")
        self.rate.set_text(number(board.good_per_hour))
        self.elapsed.set_text(duration(board.elapsed_s))
        self.left.set_text(duration(board.left_s))
        self.mean.set_text(mean_words(board.mean))
        self.histogram.show_values(board.measured, board.mean)
        self.causes.show_causes(board.causes)
        self.table.rows.set_rows(board.rows)


def _counts(board: CampaignSnapshot) -> str:
    parts = [f"{board.good} good"]
    if board.doubtful:
        parts.append(f"{board.doubtful} doubtful")
    if board.failed:
        parts.append(f"{board.failed} failed")
    return ", ".join(parts) if board.done else "0"
