"""The report of a campaign on paper."""

import re
from dataclasses import replace
from pathlib import Path

import pytest
from PySide6.QtPdf import QPdfDocument
from pytestqt.qtbot import QtBot

from cosmic.app.panels.campaign.output import write_pdf
from cosmic.autonomy.bending.result import Contribution, Kind, Quality
from cosmic.autonomy.campaign.records import CampaignError
from cosmic.autonomy.campaign.store import CampaignStore
from cosmic.autonomy.campaign.store_read import CampaignReader
from unit.autonomy.campaign.sample_records import INFO, failed, good, image


def test_a_campaign_is_printed_with_its_figures(tmp_path: Path, qtbot: QtBot) -> None:
    with CampaignStore.create(tmp_path / "run", INFO) as store:
        write_pdf(store, tmp_path / "empty.pdf")
        store.finish_fibre(good(store.begin_fibre(time_s=0.0)))
        store.finish_fibre(failed(store.begin_fibre(time_s=30.0), began_s=30.0))
        write_pdf(store, tmp_path / "report.pdf")
    empty, whole = ((tmp_path / name).read_bytes() for name in ("empty.pdf", "report.pdf"))
    assert whole.startswith(b"%PDF-")
    assert b"bend test" in whole or "bend test".encode("utf-16-be") in whole
    assert whole.count(b"/Type /Page\n") > empty.count(b"/Type /Page\n") >= 1
    assert whole.count(b"/Subtype /Image") > empty.count(b"/Subtype /Image")


def test_no_page_ends_with_a_heading(tmp_path: Path, qtbot: QtBot) -> None:
    with CampaignStore.create(tmp_path / "run", INFO) as store:
        for number in range(1, 4):
            store.finish_fibre(good(store.begin_fibre(time_s=0.0), seed=number))
        write_pdf(store, tmp_path / "report.pdf")
    document = QPdfDocument()
    document.load(str(tmp_path / "report.pdf"))
    headings = {"Distribution", "Fibres", "Time of the operations", "Calibration", "Made with"}
    last = [
        document.getAllText(page).text().strip().split("\r\n")[-1]
        for page in range(document.pageCount())
    ]
    assert len(last) > 4
    assert not headings.intersection(last)


BUDGET = tuple(
    Contribution(f"source {number}", Kind.B, 0.1, "", 0.3, share=0.08 if number < 12 else 0.01 / 4)
    for number in range(16)
)


def test_each_fibre_has_one_page_with_two_images_and_its_whole_budget(
    tmp_path: Path, qtbot: QtBot
) -> None:
    with CampaignStore.create(tmp_path / "run", INFO) as store:
        for number in range(1, 4):
            fibre = good(store.begin_fibre(time_s=0.0), seed=number)
            images = (image(number, (960, 1280)), image(number + 1, (960, 1280)))
            assert fibre.bending is not None
            bending = replace(
                fibre.bending,
                spans=(*fibre.bending.spans, *fibre.bending.spans)[:5],
                budget=BUDGET,
                notes=frozenset({Quality.FRICTION}),
            )
            store.finish_fibre(replace(fibre, images=images, bending=bending))
        write_pdf(store, tmp_path / "report.pdf")
    document = QPdfDocument()
    document.load(str(tmp_path / "report.pdf"))
    texts = [document.getAllText(page).text().strip() for page in range(document.pageCount())]
    begin = [page for page, text in enumerate(texts) if re.search(r"^Fibre \d+: ", text, re.M)]
    assert len(begin) == 3
    assert begin == list(range(begin[0], begin[0] + 3))
    assert all("all others" in texts[page] for page in begin)


def test_a_path_that_cannot_be_written_is_reported(tmp_path: Path, qtbot: QtBot) -> None:
    CampaignStore.create(tmp_path / "run", INFO).close()
    with pytest.raises(CampaignError, match="cannot be written"):
        write_pdf(CampaignReader(tmp_path / "run"), tmp_path / "nowhere" / "report.pdf")
