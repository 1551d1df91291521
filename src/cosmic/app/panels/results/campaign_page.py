"""A campaign among the results: how it went, its fibres, and the card of one of them."""

from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QHBoxLayout, QTabWidget, QVBoxLayout, QWidget

from cosmic.frame.background import BackgroundJobs
from cosmic.frame.errors import CosmicError
from cosmic.frame.gui.build import named, push_button
from cosmic.frame.gui.elided_label import ElidedLabel
from cosmic.frame.gui.relay import Relay
from cosmic.frame.gui.screen_fit import FittedPanel
from cosmic.frame.gui.theme import STEP_PX

if TYPE_CHECKING:
    from cosmic.app.panels.campaign.board import CampaignBoard
    from cosmic.app.panels.campaign.fibre_card import FibreCard
    from cosmic.autonomy.campaign.snapshot import CampaignSnapshot, FibreCardData


class CampaignPage(QWidget):
    """Shows a campaign from its folder, whoever carried it out; GUI thread.

    Board and card are made with the first campaign: statistics take a second to load.

    Parameters
    ----------
    jobs : BackgroundJobs
        Reads.

    Signals
    -------
    report_requested()
        The report is wanted.
    failed(str)
        What cannot be shown, and why.
    """

    report_requested = Signal()
    failed = Signal(str)

    def __init__(self, jobs: BackgroundJobs, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._jobs = jobs
        self._folder: Path | None = None
        self.board: CampaignBoard | None = None
        self.card: FibreCard | None = None
        self._read = Relay(self._on_read)
        self._card_read = Relay(self._on_card_read)
        self.about = named(ElidedLabel(), "campaignFolder")
        self.about.set_dim(True)
        self.report = named(
            push_button(
                "Open report", "Open the report of this campaign; it is written if need be"
            ),
            "openReport",
        )
        self.report.clicked.connect(self.report_requested)
        self.tabs = QTabWidget()
        self.tabs.hide()
        row = QHBoxLayout()
        row.setSpacing(STEP_PX)
        row.addWidget(self.about, 1)
        row.addWidget(self.report)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(STEP_PX // 2)
        column.addLayout(row)
        column.addWidget(self.tabs, 1)
        column.setAlignment(row, Qt.AlignmentFlag.AlignTop)

    def show_campaign(self, folder: Path) -> None:
        """Have a campaign read and shown; returns at once."""
        if folder != self._folder:
            self.tabs.hide()
            self.tabs.setCurrentIndex(0)
            if self.card is not None:
                self.card.clear()
        self._folder = folder
        self.about.set_text(str(folder))
        self._jobs.do(lambda: (folder, read_board(folder)), self._read)

    def show_fibre(self, number: int) -> None:
        """Have the card of a fibre read and shown; returns at once."""
        folder = self._folder
        if folder is not None:
            self._jobs.do(lambda: (folder, read_card(folder, number)), self._card_read)

    def _on_read(
        self, found: "tuple[Path, CampaignSnapshot] | None", error: CosmicError | None
    ) -> None:
        if found is None:
            self.failed.emit(f"It cannot be shown: {error}")
        elif found[0] == self._folder:  # another may have been chosen meanwhile
            self._made_board().set_state(found[1])
            self.tabs.show()

    def _on_card_read(
        self, found: "tuple[Path, FibreCardData] | None", error: CosmicError | None
    ) -> None:
        if found is None:
            self.failed.emit(f"The fibre cannot be shown: {error}")
        elif found[0] == self._folder and self.card is not None:
            self.card.set_card(found[1])
            self.tabs.setCurrentIndex(1)

    def _made_board(self) -> "CampaignBoard":
        if self.board is None:
            from cosmic.app.panels.campaign.board import CampaignBoard
            from cosmic.app.panels.campaign.fibre_card import FibreCard

            self.board, self.card = CampaignBoard(), FibreCard()
            self.card.replay.hide()  # the scene that it would be seen in is not here
            self.board.fibre_chosen.connect(self.show_fibre)
            self.tabs.addTab(FittedPanel(self.board), "Fibres")
            self.tabs.addTab(FittedPanel(self.card), "Fibre")
        return self.board


def read_board(folder: Path) -> "CampaignSnapshot":
    """Return what the board shows of the campaign in a folder; raises `CampaignError`."""
    from cosmic.autonomy.campaign.snapshot import snapshot_of
    from cosmic.autonomy.campaign.statistics import progress
    from cosmic.autonomy.campaign.store_read import CampaignReader

    reader = CampaignReader(folder)
    reader.check()
    fibres = reader.fibres()
    ended, reason = reader.ended()
    return snapshot_of(
        reader.info().name,
        "over" if ended else "not over",
        fibres,
        progress(fibres, reader.elapsed_s()),
        reason=reason,
    )


def read_card(folder: Path, number: int) -> "FibreCardData":
    """Return what the card shows of a fibre; raises `CampaignError`."""
    from cosmic.autonomy.campaign.snapshot import card_of
    from cosmic.autonomy.campaign.store_read import CampaignReader

    return card_of(CampaignReader(folder).fibre(number))
