"""What is made of a campaign besides its records: report and table."""

import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Final

from PySide6.QtCore import QCoreApplication
from PySide6.QtGui import QGuiApplication

from cosmic.app.report_pdf import write_pdf
from cosmic.autonomy.campaign.recipe import OutputSettings
from cosmic.autonomy.campaign.report import write_report
from cosmic.autonomy.campaign.report_table import write_table
from cosmic.autonomy.campaign.store_read import CampaignReader
from cosmic.frame.errors import CosmicError
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.overrides import override
from cosmic.frame.threads import WorkerThread

HTML: Final = "report.html"
PDF: Final = "report.pdf"
TABLE: Final = "fibres.csv"


def write_output(folder: Path, wanted: OutputSettings) -> list[Path]:
    """Write what a recipe wants of a campaign, in its folder, and return the files.

    Raises
    ------
    CampaignError
        The campaign cannot be read, or a file not be written.
    """
    reader = CampaignReader(folder)
    written = []
    if wanted.html:
        write_report(reader, folder / HTML)
        written.append(folder / HTML)
    if wanted.pdf:
        write_pdf(reader, folder / PDF)
        written.append(folder / PDF)
    if wanted.table:
        write_table(folder, folder / TABLE)
        written.append(folder / TABLE)
    return written


class OutputThread(WorkerThread):
    """Writes the output of a campaign in a thread of its own: the stop of a window cannot wait.

    Parameters
    ----------
    told : callable
        Called at the end, in this thread, with what was written or why it was not, and with
        whether all went well.
    """

    def __init__(
        self,
        folder: Path,
        wanted: OutputSettings,
        policy: FailurePolicy,
        told: Callable[[str, bool], object],
    ) -> None:
        super().__init__("campaign report", policy)
        self._folder = folder
        self._wanted = wanted
        self._told = told

    @override
    def run_body(self) -> None:
        try:
            written = write_output(self._folder, self._wanted)
        except CosmicError as exc:
            self._told(str(exc), False)
        else:
            self._told(f"written: {', '.join(str(each) for each in written)}", True)


def gui_application() -> QCoreApplication:
    """Return the Qt application that prints need; one without a display is made where none is."""
    existing = QCoreApplication.instance()
    if existing is not None:
        return existing
    os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
    return QGuiApplication(sys.argv[:1])
