"""What is made of a campaign besides its records: the report as page and PDF, and the table."""

import os
import sys
from html import escape
from pathlib import Path
from typing import Final

from PySide6.QtCore import (
    QBuffer,
    QByteArray,
    QCoreApplication,
    QIODevice,
    QMarginsF,
    QRectF,
    QSizeF,
    Qt,
    QUrl,
)
from PySide6.QtGui import (
    QFont,
    QGuiApplication,
    QImage,
    QPageLayout,
    QPageSize,
    QPdfWriter,
    QTextBlock,
    QTextBlockFormat,
    QTextCursor,
    QTextDocument,
    QTextFormat,
)
from PySide6.QtSvg import QSvgRenderer

from cosmic.autonomy.campaign.recipe import OutputSettings
from cosmic.autonomy.campaign.records import CampaignError
from cosmic.autonomy.campaign.report import report_body, report_data, write_report
from cosmic.autonomy.campaign.report_table import write_table
from cosmic.autonomy.campaign.store import CampaignStore, write_whole
from cosmic.autonomy.campaign.store_read import CampaignReader
from cosmic.frame.gui.painting import painting
from cosmic.frame.gui.stylesheet import PRINTED

FINE: Final = 3
"""Pixels of a drawn figure for one of the page."""

FIGURE_PX: Final = 300
"""Widest of two beside each other, so that a fibre has room on one page."""

WIDE_PX: Final = 430
"""What is wider stands alone."""

MOST_BREAKS: Final = 20
"""Headings that are put on the next page; more would take long to lay out."""

IMAGE_PX: Final = 216
"""Widest image of a fibre: two stand beside each other."""

NUMBER_PX: Final = 10
MARGINS_MM: Final = (15.0, 15.0, 15.0, 15.0)
WIDTH_PX: Final = 680.0
HEIGHT_PX: Final = 976.0
"""Of the text on a page of A4, in the pixels that the report counts in."""


class _Figures:
    """Puts figures into a document under names of their own."""

    def __init__(self, document: QTextDocument) -> None:
        self._document = document
        self._count = 0

    def svg(self, svg: str, width_px: int) -> str:
        drawing = QSvgRenderer(QByteArray(svg.encode()))
        size = drawing.defaultSize()
        width_px = width_px if width_px > WIDE_PX else min(width_px, FIGURE_PX)
        height_px = round(width_px * size.height() / size.width())
        image = QImage(FINE * width_px, FINE * height_px, QImage.Format.Format_RGB32)
        image.fill(0xFFFFFFFF)
        with painting(image) as painter:
            drawing.render(painter)
        return f"<p>{self._keep(image, width_px, height_px, 'figure')}</p>"

    def png(self, data: bytes, width_px: int, words: str) -> str:
        image = QImage.fromData(data)
        width_px = min(width_px, IMAGE_PX)
        height_px = round(width_px * image.height() / max(image.width(), 1))
        return self._keep(image, width_px, height_px, words)

    def _keep(self, image: QImage, width_px: int, height_px: int, words: str) -> str:
        self._count += 1
        name = f"cosmic:figure/{self._count}"
        kind = QTextDocument.ResourceType.ImageResource
        self._document.addResource(kind.value, QUrl(name), image)
        return (
            f'<img src="{name}" width="{width_px}" height="{height_px}" '
            f'alt="{escape(words, quote=True)}">'
        )


def write_pdf(campaign: CampaignStore | CampaignReader, path: str | Path) -> None:
    """Write the report of a campaign as PDF, A4.

    There must be a `QGuiApplication`, of any Qt platform; it shows nothing.

    Raises
    ------
    CampaignError
        The campaign cannot be read, or the file not be written.
    """
    if QGuiApplication.instance() is None:
        raise CampaignError("a report can only be printed by a program with a Qt application")
    reader = campaign.reader if isinstance(campaign, CampaignStore) else campaign
    data = report_data(reader)
    document = QTextDocument()
    figures = _Figures(document)
    document.setDefaultStyleSheet(PRINTED)
    document.setHtml(f"<body>{report_body(data, svg=figures.svg, png=figures.png)}</body>")
    held = QBuffer()
    held.open(QIODevice.OpenModeFlag.WriteOnly)
    writer = QPdfWriter(held)
    writer.setPageSize(QPageSize(QPageSize.PageSizeId.A4))
    writer.setPageMargins(QMarginsF(*MARGINS_MM), QPageLayout.Unit.Millimeter)
    writer.setTitle(f"{data.info.name}: {data.info.procedure}")
    writer.setCreator("CoSMic")
    _print(document, writer)
    write_whole(Path(path), bytes(held.data().data()))


def _print(document: QTextDocument, writer: QPdfWriter) -> None:
    """Print page by page, with their numbers."""
    document.setDocumentMargin(0.0)
    document.setPageSize(QSizeF(WIDTH_PX, HEIGHT_PX))
    _keep_headings(document)
    with painting(writer) as painter:
        scale = writer.width() / WIDTH_PX
        font = QFont(document.defaultFont())
        font.setPixelSize(NUMBER_PX)  # a size in points would be scaled twice
        painter.setFont(font)
        count = document.pageCount()
        for page in range(count):
            if page:
                writer.newPage()
            painter.save()
            painter.scale(scale, scale)
            painter.drawText(
                QRectF(0.0, HEIGHT_PX + 10.0, WIDTH_PX, 18.0),
                Qt.AlignmentFlag.AlignRight,
                f"{page + 1} / {count}",
            )
            painter.translate(0.0, -page * HEIGHT_PX)
            document.drawContents(painter, QRectF(0.0, page * HEIGHT_PX, WIDTH_PX, HEIGHT_PX))
            painter.restore()


def _keep_headings(document: QTextDocument) -> None:
    """Begin a page with each heading that would stand at the end of one without its text."""
    for _ in range(MOST_BREAKS):
        alone = _alone(document)
        if alone is None:
            return
        broken = QTextBlockFormat()
        broken.setPageBreakPolicy(QTextFormat.PageBreakFlag.PageBreak_AlwaysBefore)
        QTextCursor(alone).mergeBlockFormat(broken)
        # What stands behind it is laid out anew only with another size of the page.
        document.setPageSize(QSizeF(WIDTH_PX, 2.0 * HEIGHT_PX))
        document.setPageSize(QSizeF(WIDTH_PX, HEIGHT_PX))


def _alone(document: QTextDocument) -> QTextBlock | None:
    """Return the first heading whose text begins on the next page."""
    block = document.begin()
    while block.isValid():
        text = block.next()
        if block.blockFormat().headingLevel():
            while text.isValid() and not text.text().strip():
                text = text.next()
            if text.isValid() and _page(document, block) < _page(document, text):
                return block
        block = block.next()
    return None


def _page(document: QTextDocument, block: QTextBlock) -> int:
    """Return the page on which the first line of a block ends."""
    top = document.documentLayout().blockBoundingRect(block).top()
    layout = block.layout()
    if layout is not None and layout.lineCount():
        line = layout.lineAt(0)
        top += line.y() + line.height()
    return int(top // HEIGHT_PX)


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
