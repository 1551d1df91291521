"""The live board of a campaign: how it stands, the stiffnesses, the failures, the fibres."""

from typing import Final

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QHBoxLayout, QLabel, QVBoxLayout, QWidget

from cosmic.app.campaign_causes import CauseList
from cosmic.app.campaign_histogram import EiHistogram
from cosmic.app.campaign_table import FibreTable
from cosmic.app.procedure_tree_sign import StateSign
from cosmic.autonomy.campaign.board import BoardState
from cosmic.autonomy.campaign.report_figures import EI_LABEL
from cosmic.autonomy.campaign.report_words import duration, mean_words, number
from cosmic.frame.gui.build import named, tipped
from cosmic.frame.gui.chip import Chip
from cosmic.frame.gui.elided_label import ElidedLabel
from cosmic.frame.gui.flow_layout import FlowLayout
from cosmic.frame.gui.theme import LARGE_PX, STEP_PX, State, number_font

_SIGNS: Final = {
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
    """Shows a `BoardState`; GUI thread.

    Signals
    -------
    fibre_chosen(int)
        The number of a fibre that the operator wants to see; connect it to a `FibreCard`.
    """

    fibre_chosen = Signal(int)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("CampaignBoard")
        self._shown: BoardState | None = None
        self.sign = StateSign()
        self.state = Chip("no campaign", tip="What the campaign is at")
        self.title = named(ElidedLabel(), "campaignTitle")
        self.reason = named(ElidedLabel(), "campaignReason")
        self.fibres = Fact("fibres", "Fibres that have their end, and how many of them are good")
        self.success = Fact("success", "Good ones of the fibres that have their end")
        self.rate = Fact("good an hour", "Good fibres an hour of the platform's clock")
        self.elapsed = Fact("elapsed", "Time on the platform's clock")
        self.left = Fact("left", "Until the first rule for the end is met, by the pace so far")
        self.mean = Fact(
            f"mean stiffness, {EI_LABEL}",
            "Mean of the good fibres, on the scale of logarithms, with its 95 % interval",
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
        for widget in (self.sign, self.state):
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

    def set_state(self, board: BoardState) -> None:
        """Show a campaign as it is now; what did not change is not drawn anew."""
        if board == self._shown:
            return
        self._shown = board
        self.sign.set_state(_SIGNS.get(board.state))
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


def _counts(board: BoardState) -> str:
    parts = [f"{board.good} good"]
    if board.doubtful:
        parts.append(f"{board.doubtful} doubtful")
    if board.failed:
        parts.append(f"{board.failed} failed")
    return ", ".join(parts) if board.done else "0"
