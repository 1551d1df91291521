"""The report of a campaign: one page that says everything, and a table."""

import itertools
import math
import re
import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from cosmic.app.cli import main
from cosmic.autonomy.bending.bent_shape import BentShape
from cosmic.autonomy.bending.curved import NaturalShape
from cosmic.autonomy.bending.result import Contribution, Kind
from cosmic.autonomy.campaign.formatting import budget_rows, length_words, with_interval
from cosmic.autonomy.campaign.records import (
    CERTAIN,
    CalibrationNote,
    CampaignError,
    Outcome,
    Shape,
)
from cosmic.autonomy.campaign.report import write_report
from cosmic.autonomy.campaign.report_figures import force_figure, shape_figure, stiffness_figure
from cosmic.autonomy.campaign.report_table import COLUMNS, read_campaign, write_table
from cosmic.autonomy.campaign.store import CampaignStore
from cosmic.autonomy.campaign.store_read import CampaignReader
from cosmic.autonomy.campaign.svg_plot import Axis, bars
from cosmic.vico.core.vision import certainty
from unit.autonomy.campaign.sample_records import INFO, failed, good

STIFFNESSES = (3e-11, 5e-11, 9e-11)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a campaign of five fibres, of which one failed and one is not trusted."""
    folder = tmp_path_factory.mktemp("campaign")
    info = replace(INFO, recipe_text='procedure = "bend test" # <b>bold</b>\n')
    with CampaignStore.create(folder, info) as store:
        store.keep_calibrations([CalibrationNote("plate", 0.42, "um", "2026-03-02T09:00:00")])
        now = 0.0
        for seed, ei in enumerate(STIFFNESSES):
            record = good(store.begin_fibre(time_s=now), ei_n_m2=ei, seed=seed, began_s=now)
            store.finish_fibre(record)
            now = record.ended_s
        store.finish_fibre(failed(store.begin_fibre(time_s=now), "jaw adhesion", began_s=now))
        doubtful = good(store.begin_fibre(time_s=now), began_s=now)
        assert doubtful.bending is not None
        alone = replace(
            doubtful.bending, trusted=False, reasons=("1 good spans, at 98 um, and 2 are needed",)
        )
        store.finish_fibre(
            replace(doubtful, outcome=Outcome.DOUBTFUL, cause="not trusted", bending=alone)
        )
        store.end("5 fibres done", time_s=now + 30.0)
    return folder


@pytest.fixture(scope="module")
def page(folder: Path) -> str:
    write_report(CampaignReader(folder), folder / "report.html")
    return (folder / "report.html").read_text(encoding="utf-8")


def test_the_page_needs_no_other_file(page: str) -> None:
    assert page.startswith("<!doctype html>")
    for address in re.findall(r'(?:src|href)="([^"]*)"', page):
        raw = re.fullmatch(
            r"#selection|record|fibres/\d{5}\.h5", address
        )  # beside it, for who wants more
        assert raw or address.startswith("data:image/png;base64,")
    assert "<script" not in page
    assert "@import" not in page
    assert "url(" not in page


def test_what_all_fibres_share_is_as_the_command_for_the_size_of_a_sample_has_it(
    folder: Path, page: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["sample-size", str(folder)]) == 0
    out = capsys.readouterr().out
    found = re.search(r"sd of ln\(EI\) ([\d.]+);", out)
    doubt = re.search(r"that of 3 fibres: it may be ([\d.]+) to ([\d.]+) \(95 %\)", out)
    assert found is not None
    assert doubt is not None
    # The table of chi-square has 7.378 and 0.0506 for two degrees of freedom.
    assert float(doubt[1]) == pytest.approx(float(found[1]) * math.sqrt(2.0 / 7.378), abs=0.01)
    assert float(doubt[2]) == pytest.approx(float(found[1]) * math.sqrt(2.0 / 0.0506), rel=0.01)
    printed = re.search(r"shared by all: (±[\d.]+ %)", out)
    assert printed is not None
    assert f"({printed[1]} is shared by all" in page


@pytest.mark.parametrize(
    "words",
    [
        "quick: bend test",
        "A quick look",
        "three-dry",
        "digital twin",
        "2026-03-02 09:30:00+01:00",
        "5 fibres done",
        "5: 3 good, 1 measured but not trusted, 1 failed",
        "3 of 5: 60 % (23 to 88 %)",
        "is shared by all and does not average out",
        "These fibres were simulated.",
        "It does not show how often real jaws miss",
        "failed: jaw adhesion",
        "measured, not trusted: not trusted",
        "1 good spans, at 98 µm, and 2 are needed",
        "the fibre did not follow the jaws in 4 tries",
        "0.42 µm",
        "before grasp, 2432 µm wide",
        "&lt;b&gt;bold&lt;/b&gt;",
        "numpy",
        "µm behind the tip of the jaws",
        "force scale not verified: the sensor&#39;s certificate is in every interval",
        "depth of the clamp",
        "share, %",
    ],
)
def test_the_page_says(page: str, words: str) -> None:
    assert words in page


def test_every_figure_is_a_drawing_with_units_on_its_axes(page: str) -> None:
    drawings = re.findall(r"<svg.*?</svg>", page, flags=re.DOTALL)
    labels = []
    for each in drawings:
        root = ET.fromstring(each)
        assert root.get("aria-label")
        labels += [text.text for text in root.iter("{http://www.w3.org/2000/svg}text")]
    assert labels.count("force, µN") == 4
    assert labels.count("push beyond the first contact, µm") == 8
    assert labels.count("force less model, µN") == 4
    assert labels.count("bending stiffness, 10⁻¹² N m²") == 1
    assert "jaw adhesion" in labels
    assert "push" in labels, "time of the operations"


def test_no_more_than_two_figures_stand_beside_each_other(page: str) -> None:
    rows = re.findall(r"<tr>(<td valign=\"top\">.*?)</tr>", page)
    assert rows
    assert max(row.count('<td valign="top">') for row in rows) == 2
    assert page.count("Residuals of fibre") == 4


def test_a_report_can_be_written_while_the_campaign_runs(tmp_path: Path) -> None:
    with CampaignStore.create(tmp_path / "run", INFO) as store:
        write_report(store, tmp_path / "empty.html")
        store.begin_fibre(time_s=0.0)
        write_report(store, tmp_path / "first.html")
    for name in ("empty", "first"):
        text = (tmp_path / f"{name}.html").read_text(encoding="utf-8")
        assert "not ended" in text
        assert "0: 0 good" in text


def test_a_lost_file_costs_its_fibre_the_figures_and_no_more(tmp_path: Path) -> None:
    with CampaignStore.create(tmp_path / "run", INFO) as store:
        for _ in range(2):
            store.finish_fibre(good(store.begin_fibre(time_s=0.0)))
        (tmp_path / "run" / "fibres" / "00001.h5").unlink()
        (tmp_path / "run" / "fibres" / "00002-00.png").write_bytes(b"no image")
        write_report(store, tmp_path / "report.html")
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "00001.h5 cannot be read" in text
    assert "00002-00.png is not a readable image" in text
    assert "2: 2 good" in text


def test_a_real_platform_gets_other_words_than_the_twin(tmp_path: Path) -> None:
    with CampaignStore.create(tmp_path / "run", replace(INFO, hardware="FiberStation")) as store:
        write_report(store, tmp_path / "report.html")
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "simulated" not in text
    assert "graspable part of the sample" in text


def test_a_report_that_cannot_be_written_says_so(folder: Path, tmp_path: Path) -> None:
    with pytest.raises(CampaignError, match="cannot be written"):
        write_report(CampaignReader(folder), tmp_path / "nowhere" / "report.html")
    with pytest.raises(CampaignError, match="holds no campaign"):
        write_report(CampaignReader(tmp_path), tmp_path / "report.html")


# ---------------------------------------------------------------------- table


def test_the_table_is_one_for_pandas(folder: Path) -> None:
    frame = pd.DataFrame(read_campaign(folder))
    assert list(frame.columns) == list(COLUMNS)
    assert len(frame) == 5
    assert frame["ei_n_m2"].dtype == float
    best = frame[frame["trusted"]]
    assert (best["ei_low_n_m2"] < best["ei_n_m2"]).all()
    assert (best["ei_n_m2"] < best["ei_high_n_m2"]).all()
    for ei, found in zip(STIFFNESSES, best["ei_n_m2"], strict=True):
        assert found == pytest.approx(ei, rel=0.15)
    assert list(frame["cause"]) == ["", "", "", "jaw adhesion", "not trusted"]
    assert math.isnan(frame["ei_n_m2"][3])


def test_the_written_table_is_read_back_the_same(folder: Path, tmp_path: Path) -> None:
    write_table(folder, tmp_path / "fibres.csv")
    frame = pd.read_csv(tmp_path / "fibres.csv")
    assert list(frame.columns) == list(COLUMNS)
    written = pd.DataFrame(read_campaign(folder))
    assert frame["ei_n_m2"].to_numpy() == pytest.approx(
        written["ei_n_m2"].to_numpy(), rel=1e-6, abs=0.0, nan_ok=True
    )


# ---------------------------------------------------------------------- axes


@pytest.mark.parametrize(
    ("axis", "ticks"),
    [
        (Axis("", 0.0, 10.0), [0, 2, 4, 6, 8, 10]),
        (Axis("", -3.0, 44.0), [0, 10, 20, 30, 40]),
        (Axis("", 0.0, 1.1), [0, 0.5, 1]),
        (Axis("", 25.0, 110.0, log=True), [30, 50, 70, 100]),
        (Axis("", 1.0, 100.0, log=True), [1, 2, 5, 10, 20, 50, 100]),
        (Axis("", 1.0, 1e6, log=True), [1, 10, 100, 1e3, 1e4, 1e5, 1e6]),
    ],
)
def test_ticks_are_round_values(axis: Axis, ticks: list[float]) -> None:
    assert axis.ticks() == pytest.approx(ticks)


@pytest.mark.parametrize(
    ("probability", "words"),
    [
        (math.nan, ""),
        (0.9992, ""),
        (0.9986, " (a whole fibre: 99.8 %)"),
        (0.6, "(a whole fibre: 60 %)"),
    ],
)
def test_a_length_that_may_be_that_of_a_part_says_so(probability: float, words: str):
    text = length_words(Shape(1200.0, 2.0, probability=probability))
    assert text.startswith("1200 ± 4 µm")
    assert text.endswith(words or "µm")


def test_the_table_keeps_how_probable_it_is_that_a_fibre_is_whole(tmp_path: Path):
    with CampaignStore.create(tmp_path / "some", INFO) as store:
        record = good(store.begin_fibre(time_s=0.0))
        store.finish_fibre(replace(record, shape=replace(record.shape, probability=0.75)))
    assert read_campaign(tmp_path / "some")["probability"] == [0.75]


def test_a_small_uncertainty_of_the_budget_keeps_its_digits() -> None:
    result = good(1).bending
    assert result is not None
    line = Contribution("jaws and sensor give way", Kind.B, 4.37e-4, "um/uN", -3.2, 1.0)
    ((_, _, shown, _, _),) = budget_rows(replace(result, budget=(line,)))
    assert shown == "0.000437 µm/µN"


def texts_of(svg: str) -> list[tuple[float, float, float, str]]:
    """Return left and right end, height and words of each text that is not turned."""
    found = []
    for each in ET.fromstring(svg).iter("{http://www.w3.org/2000/svg}text"):
        words, anchor = each.text or "", each.get("text-anchor")
        long = 6.0 * len(words)
        if each.get("transform") is None:
            left = float(each.get("x", 0)) - {"end": long, "middle": long / 2.0}.get(anchor, 0.0)
            found.append((left, left + long, float(each.get("y", 0)), words))
    return found


def test_labels_of_pushes_that_end_at_one_force_stay_on_the_figure() -> None:
    texts = texts_of(force_figure(good(1, ei_n_m2=1.8e-10, seed=5)))
    heights = sorted(height for _, _, height, words in texts if re.fullmatch(r"\d+ µm", words))
    assert len(heights) == 5
    assert heights[0] >= 11.0
    assert min(b - a for a, b in itertools.pairwise(heights)) > 9.0


def test_a_cause_that_is_longer_than_the_figure_is_shortened() -> None:
    causes = [("the fibre stuck to the plate and came off the jaws as they rose again", 3.0, "3")]
    texts = texts_of(bars("Failures by cause", [*causes, ("no contact", 1.0, "1")]))
    assert texts[0][3].endswith("…")
    assert all(left >= 0.0 and right <= 430.0 for left, right, _, _ in texts)


def test_records_and_vision_call_the_same_fibres_certain():
    assert CERTAIN == certainty.CERTAIN


def test_spans_that_are_not_those_of_the_result_cost_no_report(tmp_path: Path) -> None:
    with CampaignStore.create(tmp_path / "run", INFO) as store:
        record = good(store.begin_fibre(time_s=1.0))
        columns = ("probe_um", "force_un", "force_std_un", "time_s", "loading")
        first = record.spans[0]
        cut = replace(first, **{name: getattr(first, name)[:-5] for name in columns})
        store.finish_fibre(replace(record, spans=(cut,)))
        write_report(store, tmp_path / "run" / "report.html")
    assert "Fibre 1" in (tmp_path / "run" / "report.html").read_text("utf-8")


def circles(svg: str) -> list[bool]:
    """Return of each circle whether it is filled."""
    found = ET.fromstring(svg).iter("{http://www.w3.org/2000/svg}circle")
    return [each.get("fill") != "none" for each in found]


def test_the_spans_are_drawn_as_they_were_read_and_as_the_fit_has_them() -> None:
    record = good(1)
    assert record.bending is not None
    spans, used = record.bending.spans, len(record.bending.used)
    assert sorted(circles(stiffness_figure(record))) == [False] * len(spans) + [True] * used
    older = tuple(replace(each, off_model_log=math.nan) for each in spans)
    kept = replace(record, bending=replace(record.bending, spans=older))
    assert circles(stiffness_figure(kept)) == [False] * len(spans)


def test_the_bent_shape_is_drawn_where_an_image_was_taken() -> None:
    record = good(3)
    assert record.bending is not None
    assert shape_figure(record) == ""
    span, fit = record.spans[0], record.bending.spans[0]
    ahead = np.linspace(0.0, 900.0, 91)
    seen = BentShape(
        np.array([70.0, 200.0, 400.0]), np.array([0.5, 4.0, 15.0]), 0.6, fit.hinge_um + 40.0, 20.0
    )
    looked = replace(span, bent=seen, shape=NaturalShape(ahead, np.zeros(91), 600.0))
    drawn = shape_figure(replace(record, spans=(looked, *record.spans[1:])))
    assert "Bent shape of fibre 3 in the image" in drawn
    assert circles(drawn) == [True] * 4
    assert ">probe<" in drawn


@pytest.mark.parametrize(
    ("value", "std", "text"),
    [
        (1.66, 0.0012, "1.660 ± 0.002"),
        (1.66, 0.3, "1.66 ± 0.59"),
        (1.66, 0.0, "1.66 ± 0.00"),
        (1.66, math.nan, "1.66"),
    ],
)
def test_an_interval_is_not_rounded_to_none(value: float, std: float, text: str) -> None:
    assert with_interval(value, std, 2) == text
