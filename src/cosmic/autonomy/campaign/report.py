"""The report of a campaign: one HTML file that holds everything it shows.

What it tells stands in `templates/report_body.html`; here are the data and the figures.
"""

import base64
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np
import numpy.typing as npt
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup, escape

from cosmic.autonomy.bending.budget import combined_std_ln
from cosmic.autonomy.bending.result import BendingResult
from cosmic.autonomy.bending.standards import ForceScale
from cosmic.autonomy.campaign.analysis import scale_in
from cosmic.autonomy.campaign.formatting import (
    EI_LABEL,
    NONE,
    budget_rows,
    duration,
    interval,
    length_words,
    mean_words,
    number,
    outcome_words,
    scale_words,
    stiffness,
    when,
    width_words,
    with_interval,
)
from cosmic.autonomy.campaign.provenance import read_provenance
from cosmic.autonomy.campaign.rates import CampaignRates, rates_of, seen_fibres
from cosmic.autonomy.campaign.records import (
    FINISHED,
    STANDARD,
    TWIN,
    CalibrationNote,
    CampaignError,
    CampaignInfo,
    FibreImage,
    FibreRecord,
    Outcome,
)
from cosmic.autonomy.campaign.report_figures import (
    FEW,
    OperationTime,
    distribution_figure,
    force_figure,
    operation_bars,
    operation_times,
    residual_figure,
    shape_figure,
    stiffness_figure,
)
from cosmic.autonomy.campaign.selection import Selection, selection_of
from cosmic.autonomy.campaign.statistics import (
    CampaignProgress,
    MeanEi,
    fibres_needed,
    progress,
    share_interval,
)
from cosmic.autonomy.campaign.store import CampaignStore, write_whole
from cosmic.autonomy.campaign.store_read import CampaignReader
from cosmic.autonomy.campaign.svg_plot import bars
from cosmic.frame.units import TWO_SIDED, with_micro_signs

ShowSvg = Callable[[str, int], str]
"""Returns the element that shows an SVG, so many pixels wide."""

ShowPng = Callable[[bytes, int, str], str]
"""Returns the element that shows a PNG, so many pixels wide, with words for who cannot see it."""

TEMPLATES: Final = Path(__file__).parent / "templates"
IMAGE_PX: Final = 360
ASPECT: Final = 4.0 / 3.0
ROOM: Final = 1.5
"""How much more of the image is shown than what it is about."""
PRECISIONS_PERCENT: Final = (5.0, 10.0, 20.0)


@dataclass(frozen=True, slots=True)
class ReportData:
    """Everything of a report.

    Attributes
    ----------
    finished, standards : tuple of FibreRecord
        Fibres, and measurements of the standard, without curves and images.
    analysis : mapping
        What the final analysis was done with; empty where there was none.
    whole : callable
        Returns a fibre with them, by its number: they are not all held at once.
    """

    info: CampaignInfo
    ended: tuple[str, str]
    progress: CampaignProgress
    rates: CampaignRates
    selection: Selection
    finished: tuple[FibreRecord, ...]
    standards: tuple[FibreRecord, ...]
    analysis: Mapping[str, Any]
    calibrations: tuple[CalibrationNote, ...]
    operations: tuple[OperationTime, ...]
    scale: ForceScale | None
    runs: tuple[dict[str, Any], ...]
    raw: Mapping[int, tuple[Path, str]]
    folder: Path
    whole: Callable[[int], FibreRecord]


def write_report(campaign: CampaignStore | CampaignReader, path: str | Path) -> None:
    """Write the report of a campaign as one HTML file, which needs no other file.

    The campaign may still be running, and be written by another process.

    Raises
    ------
    CampaignError
        The campaign cannot be read, or the file not be written.
    """
    reader = campaign.reader if isinstance(campaign, CampaignStore) else campaign
    page = _render("report.html", report_data(reader), svg=_inline_svg, png=_inline_png)
    write_whole(Path(path), page.encode())


def report_body(data: ReportData, *, svg: ShowSvg, png: ShowPng) -> str:
    """Return the whole report between <body> and </body>, in HTML that QTextDocument reads."""
    return _render("report_body.html", data, svg=svg, png=png)


def report_data(reader: CampaignReader) -> ReportData:
    """Return what a report tells.

    Raises
    ------
    CampaignError
        The campaign cannot be read.
    """
    reader.check()
    fibres, finished = reader.fibres(), reader.finished()
    standards = tuple(each for each in reader.fibres(STANDARD) if each.outcome in FINISHED)
    stands = progress(fibres, reader.elapsed_s())
    return ReportData(
        info=reader.info(),
        ended=reader.ended(),
        progress=stands,
        rates=rates_of(reader),
        selection=selection_of(
            seen_fibres(reader.sightings(), fibres),
            [each for each in finished if each.outcome is Outcome.GOOD],
            common_std_ln=stands.mean.common_std_ln,
        ),
        finished=finished,
        standards=standards,
        analysis=reader.analysis(),
        calibrations=reader.calibrations(),
        operations=operation_times(finished),
        scale=scale_in(reader.analysis()),
        runs=read_provenance(reader.folder),
        raw=reader.raw_files(),
        folder=reader.folder,
        whole=lambda number: _whole(reader, number, (*finished, *standards)),
    )


def _whole(reader: CampaignReader, number: int, finished: Sequence[FibreRecord]) -> FibreRecord:
    """Return a fibre with what can be read of it: a lost file costs no report."""
    try:
        return reader.fibre(number)
    except CampaignError as exc:
        record = next(each for each in finished if each.number == number)
        return replace(record, text=f"{record.text} {exc}".strip())


@cache
def _templates() -> Environment:
    environment = Environment(
        loader=FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.globals |= {
        "TWIN": TWIN,
        "with_micro_signs": with_micro_signs,
        "EI_LABEL": EI_LABEL,
        "interval": interval,
        "outcome_words": outcome_words,
        "stiffness": stiffness,
        "length_words": length_words,
        "width_words": width_words,
        "with_interval": with_interval,
    }
    environment.tests["finite"] = math.isfinite
    return environment


def _render(template: str, data: ReportData, *, svg: ShowSvg, png: ShowPng) -> str:
    def drawn(figure: str, width_px: int) -> Markup:
        return Markup(svg(figure, width_px) if figure else "")

    causes = [(cause, float(count), str(count)) for cause, count in data.progress.causes.items()]
    good = _good_results(data)
    return (
        _templates()
        .get_template(template)
        .render(
            data=data,
            summary=_summary(data),
            distribution=drawn(distribution_figure(good, data.progress.mean) if good else "", 640),
            few=len(good) < FEW,
            fibre_rows=[_fibre_row(each) for each in data.finished],
            rate_rows=_rate_rows(data),
            problem_rows=[tuple(map(str, each)) for each in data.selection.problems],
            class_rows=_class_rows(data.selection),
            weighted=mean_words(data.selection.weighted),
            unknown=data.selection.unknown,
            missing=f"{100.0 * data.selection.missing_part:.0f}",
            failures=drawn(bars("Failures by cause", causes) if causes else "", 430),
            operation_bars=drawn(operation_bars(data.operations, data.progress.done), 560),
            operation_rows=[_operation_row(each) for each in data.operations],
            record_rows=_record_rows(data),
            file_rows=_file_rows(data),
            standard_rows=_standard_rows(data.scale),
            standard_words=_standard_words(data),
            calibration_rows=[_calibration_row(each) for each in data.calibrations],
            cards=_cards(data, svg, png),
            versions=sorted(data.info.versions.items()),
        )
    )


def _inline_svg(svg: str, _width_px: int) -> str:
    return f'<div class="figure">{svg}</div>'


def _inline_png(data: bytes, width_px: int, words: str) -> str:
    content = base64.b64encode(data).decode()
    return f'<img width="{width_px}" alt="{escape(words)}" src="data:image/png;base64,{content}">'


# ---------------------------------------------------------------- rows


def _summary(data: ReportData) -> list[tuple[str, str]]:
    info, now = data.info, data.progress
    ended, reason = data.ended
    rows = [
        ("Sample", info.sample or NONE),
        ("Platform", info.hardware),
        ("Operator", info.operator or NONE),
        ("Started", when(info.started)),
        ("Ended", f"{when(ended)}, {reason}" if ended else "not ended"),
        ("Time on the platform's clock", duration(now.elapsed_s)),
        (
            "Fibres done",
            f"{now.done}: {now.good} good, {now.doubtful} measured but not trusted, "
            f"{now.failed} failed",
        ),
        ("Interrupted by a program exit", str(now.interrupted)),
        ("Good of those tried", _part(data.rates, data.rates.tried)),
        ("Good fibres an hour", number(now.good_per_hour)),
        ("Median time of a fibre", duration(now.cycle_s)),
        (f"Geometric mean of EI, {EI_LABEL} (95 %)", mean_words(now.mean)),
        ("Spread between fibres", _spread(now.mean.spread_ln)),
        ("Good fibres for a mean known to", _plan(now.mean)),
        ("Scale of the force", _scale_words(data)),
        ("Mean length, width, curl", _shape(data.finished)),
    ]
    if info.hardware == TWIN:
        rows.insert(3, ("Seed and rate of the twin", f"{info.seed}; {info.rate:g} times"))
        if info.world:
            rows.insert(4, ("World of the twin", info.world))
    return rows


def _part(rates: CampaignRates, of: int) -> str:
    """Return good ones of so many, with the 95 % interval of the share (Wilson's)."""
    if not of:
        return NONE
    low, high = share_interval(rates.good, of)
    return f"{rates.good} of {of}: {100.0 * rates.part(of):.0f} % ({low:.0f} to {high:.0f} %)"


def _plan(mean: MeanEi) -> str:
    if mean.count < 2:
        return NONE
    wanted = ((each, fibres_needed(mean, each)) for each in PRECISIONS_PERCENT)
    words = [f"±{each:g} %: {'no number' if math.isinf(n) else f'{n:.0f}'}" for each, n in wanted]
    shared = f"±{mean.shared_percent:.1f} % is shared by all and does not average out"
    return f"{'; '.join(words)} ({shared})"


def _rate_rows(data: ReportData) -> list[tuple[str, str]]:
    rates = data.rates
    rows = []
    if rates.seen:
        rows = [
            ("Good of the fibres seen on the plates", _part(rates, rates.seen)),
            ("Good of those that could be grasped", _part(rates, rates.graspable)),
        ]
    rows.append(("Good of those tried", _part(rates, rates.tried)))
    return [
        *rows,
        ("Plates", str(rates.plates)),
        ("Treatment of fibres", _share_of_time(rates.fibres_s, rates)),
        ("Standards", _share_of_time(rates.standards_s, rates)),
        ("Preparation, calibration, surveys", _share_of_time(rates.preparation_s, rates)),
        ("Changes of the plate", _share_of_time(rates.plates_s, rates)),
        ("Good an hour, everything counted", number(rates.an_hour)),
        ("Good an hour without changes of the plate", number(rates.an_hour_without_plates)),
        ("Good an hour of treatment alone", number(rates.an_hour_of_treatment)),
    ]


def _share_of_time(part_s: float, rates: CampaignRates) -> str:
    share = 100.0 * part_s / rates.elapsed_s if rates.elapsed_s > 0.0 else math.nan
    return f"{duration(part_s)}, {number(share)} %"


def _class_rows(selection: Selection) -> list[tuple[str, ...]]:
    return [
        (
            f"{each.from_um:.0f} to {each.to_um:.0f}",
            str(each.seen),
            str(each.graspable),
            str(each.good),
            number(each.weight, 2),
        )
        for each in selection.classes
    ]


def _spread(spread_ln: float) -> str:
    return f"factor {math.exp(spread_ln):.2f}" if math.isfinite(spread_ln) else NONE


def _shape(fibres: Sequence[FibreRecord]) -> str:
    means = []
    for values, digits, unit in (
        ([each.shape.length_um for each in fibres], 0, " µm"),
        ([each.shape.width_um for each in fibres], 0, " µm"),
        ([each.shape.curl for each in fibres], 3, ""),
    ):
        known = [each for each in values if math.isfinite(each)]
        means.append(f"{np.mean(known):.{digits}f}{unit}" if known else NONE)
    return ", ".join(means)


def _fibre_row(each: FibreRecord) -> tuple[str, ...]:
    result = each.bending
    return (
        str(each.number),
        outcome_words(each),
        NONE if result is None else stiffness(result.ei_n_m2),
        NONE if result is None else interval(result.ei_low_n_m2, result.ei_high_n_m2),
        with_interval(each.shape.length_um, each.shape.length_std_um),
        width_words(each.shape),
        with_interval(each.shape.curl, each.shape.curl_std, 3),
        number(each.peak_force_un, 1),
        number(each.duration_s),
    )


def _good_results(data: ReportData) -> list[BendingResult]:
    return [
        each.bending
        for each in data.finished
        if each.outcome is Outcome.GOOD and each.bending is not None and each.bending.ei_n_m2 > 0.0
    ]


def _operation_row(each: OperationTime) -> tuple[str, ...]:
    return (
        each.name,
        str(each.tries),
        str(each.failed),
        f"{each.median_s:.2f}",
        f"{each.p95_s:.2f}",
        f"{each.total_s:.0f}",
    )


def _calibration_row(each: CalibrationNote) -> tuple[str, ...]:
    residual = f"{each.residual:.3g} {each.unit.replace('um', 'µm')}"
    return each.name, residual, when(each.made), duration(each.age_s)


def _record_rows(data: ReportData) -> list[tuple[str, str]]:
    """Return what the last run was made with."""
    if not data.runs:
        return []
    last = data.runs[-1]
    climate, sensor = last.get("climate", {}), last.get("sensor", {})
    air = [
        f"{climate[key]:g} {unit}"
        for key, unit in (("temperature_c", "°C"), ("rh_percent", "% relative humidity"))
        if climate.get(key) is not None
    ]
    named = [f"{key} {value}" for key, value in sensor.items() if value]
    software = last.get("software", {})
    commit = str(software.get("commit") or "unknown")
    again = commit == data.info.versions.get("commit")  # it stands there already
    analysis = data.analysis.get("versions", {})
    return [
        ("Runs", str(len(data.runs))),
        (
            "Analysis",
            f"{analysis.get('analysis', 'unknown')}, made {data.analysis.get('made', NONE)}",
        ),
        ("Climate", ", ".join(air) or "not read"),
        ("Force sensor", ", ".join(named) or "not named"),
        *([] if again else [("Commit of the last run", commit)]),
        ("System", str(software.get("system", NONE))),
        (
            "Packages",
            ", ".join(f"{name} {value}" for name, value in software.get("packages", {}).items()),
        ),
    ]


def _file_rows(data: ReportData) -> list[tuple[str, str]]:
    if not data.runs:
        return []
    files = data.runs[-1].get("files", {})
    return [(name, kept["sha256"]) for name, kept in files.items() if "copy" in kept]


def _scale_words(data: ReportData) -> str:
    measured = any(each.bending is not None for each in data.finished)
    return scale_words(data.scale) if measured else NONE


def _standard_rows(scale: ForceScale | None) -> list[tuple[str, ...]]:
    if scale is None:
        return []
    return [
        (
            str(order),
            f"{100.0 * each.part:.0f} %",
            f"{number(each.off_percent, 1)} ± {number(200.0 * each.off_std_part, 1)} %",
            each.refused or "used",
        )
        for order, each in enumerate(scale.standards, 1)
    ]


def _standard_words(data: ReportData) -> str:
    kept = data.analysis.get("standard", {})
    if not kept.get("ei_n_m2"):
        return ""
    number_of = f", certificate {kept['certificate']}" if kept.get("certificate") else ""
    return (
        f"Its certified stiffness is {stiffness(kept['ei_n_m2'])} {EI_LABEL} with an expanded "
        f"uncertainty of {kept['expanded_percent']:g} % (k = 2){number_of}."
    )


def _span_rows(result: BendingResult) -> list[tuple[str, ...]]:
    return [
        (
            f"{fit.place_um:.1f}",
            f"{number(fit.k_un_um, 3)} ± {number(TWO_SIDED * fit.k_std_un_um, 3)}",
            number(fit.k_loading_un_um, 3),
            number(fit.k_unloading_un_um, 3),
            number(100.0 * math.expm1(fit.off_model_log), 1),
            number(fit.hysteresis_percent, 1),
            number(fit.drift_un_s, 3),
            number(fit.peak_un, 1),
            f"{fit.chi2:.0f} / {fit.freedom}",
            ", ".join(sorted(fit.flags)) or ("" if index in result.used else "not used"),
        )
        for index, fit in enumerate(result.spans)
    ]


# ---------------------------------------------------------------- each fibre


@dataclass(frozen=True, slots=True, eq=False)
class _Card:
    """One fibre as the template shows it."""

    record: FibreRecord
    raw: str
    sha256: str
    title: str
    words: str
    combined: str
    figures: list[Markup]
    span_rows: list[tuple[str, ...]]
    budget_rows: list[tuple[str, ...]]


def _cards(data: ReportData, svg: ShowSvg, png: ShowPng) -> Iterator[_Card]:
    titles = {each.number: f"Standard, measurement {n}" for n, each in enumerate(data.standards, 1)}
    for each in (*data.finished, *data.standards):
        record = data.whole(each.number)
        figures = [_shown(image, png) for image in record.images[:2]]
        drawn = (
            force_figure(record),
            stiffness_figure(record),
            residual_figure(record),
            shape_figure(record),
        )
        figures += [Markup(svg(figure, 430)) for figure in drawn if figure]
        rows = [] if record.bending is None else _span_rows(record.bending)
        # Of a standard the stiffness is known, and the scale is what is measured.
        owns = record.bending if record.role != STANDARD else None
        budget = [] if owns is None else budget_rows(owns)
        path, sha256 = data.raw.get(each.number, (None, ""))
        raw = "" if path is None else path.relative_to(data.folder).as_posix()
        yield _Card(
            record=record,
            raw=raw,
            sha256=sha256,
            title=titles.get(record.number, f"Fibre {record.number}"),
            words=_standing(record),
            combined=NONE if owns is None else f"{combined_std_ln(owns.budget):.2g}",
            figures=figures,
            span_rows=rows,
            budget_rows=budget,
        )


def _standing(record: FibreRecord) -> str:
    if record.role == STANDARD:
        return "measured" if record.bending is not None else outcome_words(record)
    return outcome_words(record)


def _shown(image: FibreImage, png: ShowPng) -> Markup:
    pixels = _cut(image)
    if pixels.dtype == np.uint16:
        pixels = (pixels >> 8).astype(np.uint8)
    height, width = pixels.shape[:2]
    if width > IMAGE_PX:
        size = IMAGE_PX, max(1, round(height * IMAGE_PX / width))
        pixels = cv2.resize(pixels, size, interpolation=cv2.INTER_AREA)
    _, data = cv2.imencode(".png", pixels)
    scale = f", {image.scale_um_px * width:.0f} µm wide" if image.scale_um_px > 0.0 else ""
    words = f"{image.name}{scale}"
    shown_px = IMAGE_PX if image.region_px is not None else pixels.shape[1]
    shown = Markup(png(data.tobytes(), shown_px, words))
    return Markup("{}<br><small>{}</small>").format(shown, words)


def _cut(image: FibreImage) -> npt.NDArray[Any]:
    """Return what an image is about, with room around it, as wide as high times 4 / 3."""
    pixels: npt.NDArray[Any] = image.pixels
    if image.region_px is None:
        return pixels
    left, top, width, height = image.region_px
    wide = max(width, height * ASPECT) * ROOM
    high = wide / ASPECT
    x, y = left + width / 2.0 - wide / 2.0, top + height / 2.0 - high / 2.0
    rows = slice(max(0, round(y)), max(1, round(y + high)))
    columns = slice(max(0, round(x)), max(1, round(x + wide)))
    part = pixels[rows, columns]
    return part if part.size else pixels
