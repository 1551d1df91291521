"""What is made of a campaign besides its records: report and table."""

import os
import sys
from pathlib import Path
from typing import Final

from PySide6.QtCore import QCoreApplication
from PySide6.QtGui import QGuiApplication

from cosmic.app.report_pdf import write_pdf
from cosmic.autonomy.campaign.recipe import OutputSettings
from cosmic.autonomy.campaign.report import write_report
from cosmic.autonomy.campaign.report_table import write_table
from cosmic.autonomy.campaign.store_read import CampaignReader

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


def gui_application() -> QCoreApplication:
    """Return the Qt application that prints need; one without a display is made where none is."""
    existing = QCoreApplication.instance()
    if existing is not None:
        return existing
    os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
    return QGuiApplication(sys.argv[:1])
