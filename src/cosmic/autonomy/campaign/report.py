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

from cosmic.autonomy.bending.result import BendingResult
from cosmic.autonomy.bending.standards import ForceScale
from cosmic.autonomy.campaign.analysis import scale_in
from cosmic.autonomy.campaign.formatting import (
    EI_LABEL,
    EI_UNIT,
    NONE,
    duration,
    interval,
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
from cosmic.autonomy.campaign.records import (
    TWIN,
    CalibrationNote,
    CampaignError,
    CampaignInfo,
    FibreImage,
    FibreRecord,
    Outcome,
)
from cosmic.autonomy.campaign.snapshot import SpanCurve, span_curves
from cosmic.autonomy.campaign.statistics import CampaignProgress, MeanEi, progress
from cosmic.autonomy.campaign.store import CampaignStore, write_whole
from cosmic.autonomy.campaign.store_read import CampaignReader
from cosmic.autonomy.campaign.svg_plot import BLUE, GREY, INK, ORANGE, Axis, Plot, around, bars

ShowSvg = Callable[[str, int], str]
"""Returns the element that shows an SVG, so many pixels wide."""

ShowPng = Callable[[bytes, int, str], str]
"""Returns the element that shows a PNG, so many pixels wide, with words for who cannot see it."""

TEMPLATES: Final = Path(__file__).parent / "templates"
IMAGE_PX: Final = 360
ASPECT: Final = 4.0 / 3.0
ROOM: Final = 1.5
"""How much more of the image is shown than what it is about."""
PALE: Final = "#9dbfdc"
FEW: Final = 8
"""Fewer fibres are drawn one by one."""
LEAST_SHARE: Final = 0.005
SHORTEST_S: Final = 0.05
"""Of an operation that is drawn."""


@dataclass(frozen=True, slots=True)
class OperationTime:
    """How long an operation takes, over all its tries."""

    name: str
    tries: int
    failed: int
    median_s: float
    p95_s: float
    total_s: float


@dataclass(frozen=True, slots=True)
class ReportData:
    """Everything of a report.

    Attributes
    ----------
    finished : tuple of FibreRecord
        Without curves and images.
    whole : callable
        Returns a fibre with them, by its number: they are not all held at once.
    """

    info: CampaignInfo
    ended: tuple[str, str]
    progress: CampaignProgress
    finished: tuple[FibreRecord, ...]
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
    return ReportData(
        info=reader.info(),
        ended=reader.ended(),
        progress=progress(fibres, reader.elapsed_s()),
        finished=finished,
        calibrations=reader.calibrations(),
        operations=operation_times(finished),
        scale=scale_in(reader.analysis()),
        runs=read_provenance(reader.folder),
        raw=reader.raw_files(),
        folder=reader.folder,
        whole=lambda number: _whole(reader, number, finished),
    )


def _whole(reader: CampaignReader, number: int, finished: Sequence[FibreRecord]) -> FibreRecord:
    """Return a fibre with what can be read of it: a lost file costs no report."""
    try:
        return reader.fibre(number)
    except CampaignError as exc:
        record = next(each for each in finished if each.number == number)
        return replace(record, text=f"{record.text} {exc}".strip())


def operation_times(fibres: Sequence[FibreRecord]) -> tuple[OperationTime, ...]:
    """Return the time of each operation, in the order of their first appearance."""
    took: dict[str, list[float]] = {}
    failed: dict[str, int] = {}
    for fibre in fibres:
        for each in fibre.operations:
            took.setdefault(each.name, []).append(each.ended_s - each.began_s)
            failed[each.name] = failed.get(each.name, 0) + each.failed
    return tuple(
        OperationTime(
            name=name,
            tries=len(times),
            failed=failed[name],
            median_s=float(np.median(times)),
            p95_s=float(np.quantile(times, 0.95)),
            total_s=float(np.sum(times)),
        )
        for name, times in took.items()
    )


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
        "EI_LABEL": EI_LABEL,
        "interval": interval,
        "outcome_words": outcome_words,
        "stiffness": stiffness,
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
            failures=drawn(bars("Failures by cause", causes) if causes else "", 430),
            operation_bars=drawn(_operation_bars(data), 560),
            operation_rows=[_operation_row(each) for each in data.operations],
            record_rows=_record_rows(data),
            file_rows=_file_rows(data),
            standard_rows=_standard_rows(data.scale),
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
        ("Good fibres an hour", number(now.good_per_hour)),
        ("Success", f"{number(now.success_percent)} %"),
        ("Median time of a fibre", duration(now.cycle_s)),
        (f"Geometric mean of EI, {EI_LABEL} (95 %)", mean_words(now.mean)),
        ("Spread between fibres", _spread(now.mean.spread_ln)),
        ("Scale of the force", _scale_words(data)),
        ("Mean length, width, curl", _shape(data.finished)),
    ]
    if info.hardware == TWIN:
        rows.insert(3, ("Seed and rate of the twin", f"{info.seed}; {info.rate:g} times"))
        if info.world:
            rows.insert(4, ("World of the twin", info.world))
    return rows


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
    return [
        ("Runs", str(len(data.runs))),
        ("Climate", ", ".join(air) or "not read"),
        ("Force sensor", ", ".join(named) or "not named"),
        ("Commit", str(software.get("commit") or "unknown")),
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


def budget_rows(result: BendingResult) -> list[tuple[str, ...]]:
    """Return the budget of a stiffness as rows of text; contributions too small to see in one."""
    shown = [line for line in result.budget if line.share >= LEAST_SHARE]
    rows: list[tuple[str, ...]] = [
        (
            line.source,
            line.kind.value,
            f"{number(line.std, 3)} {line.unit.replace('um', 'µm').replace('uN', 'µN')}".strip(),
            f"{line.sensitivity:.3g}",
            f"{100.0 * line.share:.1f}",
        )
        for line in shown
    ]
    rest = sum(line.share for line in result.budget) - sum(line.share for line in shown)
    if result.budget and len(shown) < len(result.budget):
        rows.append(("all others", "", "", "", f"{100.0 * max(rest, 0.0):.1f}"))
    return rows


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
            f"{number(100.0 * each.off_part, 1)} ± {number(200.0 * each.off_std_part, 1)} %",
            each.refused or "used",
        )
        for order, each in enumerate(scale.standards, 1)
    ]


def _span_rows(result: BendingResult) -> list[tuple[str, ...]]:
    return [
        (
            f"{fit.place_um:.1f}",
            f"{number(fit.k_un_um, 3)} ± {number(1.96 * fit.k_std_un_um, 3)}",
            number(fit.k_loading_un_um, 3),
            number(fit.k_unloading_un_um, 3),
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
    figures: list[Markup]
    span_rows: list[tuple[str, ...]]
    budget_rows: list[tuple[str, ...]]


def _cards(data: ReportData, svg: ShowSvg, png: ShowPng) -> Iterator[_Card]:
    for each in data.finished:
        record = data.whole(each.number)
        figures = [_shown(image, png) for image in record.images[:2]]
        drawn = force_figure(record), stiffness_figure(record), residual_figure(record)
        figures += [Markup(svg(figure, 430)) for figure in drawn if figure]
        rows = [] if record.bending is None else _span_rows(record.bending)
        budget = [] if record.bending is None else budget_rows(record.bending)
        path, sha256 = data.raw.get(each.number, (None, ""))
        raw = "" if path is None else path.relative_to(data.folder).as_posix()
        yield _Card(record, raw, sha256, figures, rows, budget)


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


# ---------------------------------------------------------------- figures


def force_figure(record: FibreRecord) -> str:
    """Return force over push of all spans of a fibre: measured out and back, and fitted."""
    curves = span_curves(record)
    if not curves:
        return ""
    probes = np.concatenate([each.probe_um for each in curves])
    forces = np.concatenate([each.force_un for each in curves])
    x = Axis("push beyond the first contact, µm", *around(float(probes.min()), float(probes.max())))
    y = Axis("force, µN", *around(float(forces.min()), float(forces.max())))
    plot = Plot(x, y, f"Force over push of fibre {record.number}")
    for curve in curves:
        _draw(plot, curve)
    return plot.svg()


def _operation_bars(data: ReportData) -> str:
    done = max(data.progress.done, 1)
    rows = [
        (each.name, each.total_s / done, f"{each.total_s / done:.1f} s")
        for each in data.operations
        if each.total_s / done >= SHORTEST_S
    ]
    return (
        bars("Time of each operation, for one fibre", rows, width=560.0) if data.operations else ""
    )


def _draw(plot: Plot, curve: SpanCurve) -> None:
    probe, force, fitted = curve.probe_um, curve.force_un, curve.fitted_un
    for branch in (curve.loading, ~curve.loading):
        shown = branch & np.isfinite(fitted)
        order = np.argsort(probe[shown])
        if shown.any():
            plot.line(probe[shown][order].tolist(), fitted[shown][order].tolist(), GREY)
    back = ~curve.loading
    plot.points(probe[back].tolist(), force[back].tolist(), ORANGE, hollow=True)
    plot.points(probe[curve.loading].tolist(), force[curve.loading].tolist(), BLUE)
    last = int(np.argmax(probe))
    plot.note(float(probe[last]), float(force[last]), f"{curve.place_um:.0f} µm", end=True)


def residual_figure(record: FibreRecord) -> str:
    """Return what the model leaves of the force over the push, of all spans of a fibre."""
    curves = [each for each in span_curves(record) if np.isfinite(each.fitted_un).any()]
    if not curves:
        return ""
    left = [each.force_un - each.fitted_un for each in curves]
    highest = max(float(np.nanmax(np.abs(each))) for each in left)
    pushes = np.concatenate([each.probe_um for each in curves])
    x = Axis("push beyond the first contact, µm", *around(float(pushes.min()), float(pushes.max())))
    y = Axis("force less model, µN", -1.1 * highest - 1e-6, 1.1 * highest + 1e-6)
    plot = Plot(x, y, f"Residuals of fibre {record.number}", height=180.0)
    plot.line([x.low, x.high], [0.0, 0.0], GREY)
    for curve, away in zip(curves, left, strict=True):
        for branch, colour in ((curve.loading, BLUE), (~curve.loading, ORANGE)):
            shown = branch & np.isfinite(away)
            plot.points(
                curve.probe_um[shown].tolist(),
                away[shown].tolist(),
                colour,
                hollow=colour == ORANGE,
            )
    return plot.svg()


def stiffness_figure(record: FibreRecord) -> str:
    """Return k^(-1/3) over the position, with the line whose slope is the bending stiffness."""
    result = record.bending
    if result is None:
        return ""
    fits = [each for each in result.spans if each.k_un_um > 0.0]
    if not fits or not result.ei_n_m2 > 0.0:
        return ""
    positions = [each.place_um for each in fits]
    roots = [each.k_un_um ** (-1.0 / 3.0) for each in fits]
    slope = (3.0 * result.ei_n_m2 * 1e18) ** (-1.0 / 3.0)
    begin, end = -result.clamp_offset_um, max(positions) * 1.05
    x = Axis("position of the probe from the tip of the jaws, µm", *around(min(begin, 0.0), end))
    y = Axis("k^(-1/3), (µN/µm)^(-1/3)", 0.0, 1.1 * max(*roots, slope * (end - begin)))
    plot = Plot(x, y, f"Stiffness of the spans of fibre {record.number}")
    plot.line([begin, end], [0.0, slope * (end - begin)], GREY)
    for index, (position, root) in enumerate(zip(positions, roots, strict=True)):
        plot.points([position], [root], BLUE, hollow=index not in result.used)
    plot.note(begin + 0.16 * (end - begin), 0.06 * y.high, "clamp, where the line begins")
    return plot.svg()


def distribution_figure(results: Sequence[BendingResult], mean: MeanEi) -> str:
    """Return the distribution of stiffnesses on a logarithmic axis; of few, each with its interval.

    Across the top the 95 % interval of their mean.
    """
    values = np.array([each.ei_n_m2 for each in results]) / EI_UNIT
    logs = np.log(values)
    few = len(values) < FEW
    bins = max(4, min(16, round(1.5 * math.sqrt(len(values)))))
    room = max(0.12, 0.5 * float(np.ptp(logs)) / bins)
    low, high = float(logs.min()) - room, float(logs.max()) + room
    if few and mean.count >= 2:
        # The mean of few is known badly: its interval is shown as far as it does not hide them.
        low = min(low, max(math.log(mean.ei_low_n_m2 / EI_UNIT) - room, low - 1.0))
        high = max(high, min(math.log(mean.ei_high_n_m2 / EI_UNIT) + room, high + 1.0))
    edges = np.linspace(low, high, bins + 1)
    counts, _ = np.histogram(logs, edges)
    top = len(values) + 0.8 if few else 1.15 * float(counts.max())
    x = Axis(f"bending stiffness, {EI_LABEL}", math.exp(edges[0]), math.exp(edges[-1]), log=True)
    y = Axis("good fibres in order" if few else "fibres", 0.0, top, whole=True)
    plot = Plot(x, y, "Distribution of bending stiffness", width=640.0, height=280.0)
    if few:
        for index, each in enumerate(results, 1):
            ends = _inside(x, each.ei_low_n_m2, each.ei_high_n_m2)
            plot.line(ends, [float(index)] * 2, BLUE)
            plot.points([each.ei_n_m2 / EI_UNIT], [float(index)], BLUE)
    else:
        for count, first, last in zip(counts, edges[:-1], edges[1:], strict=True):
            if count:
                plot.box(math.exp(first + 0.01), math.exp(last - 0.01), 0.0, float(count), PALE)
        _bell(plot, mean, len(values) * (edges[1] - edges[0]))
        plot.points(values.tolist(), [0.02 * top] * len(values), BLUE)
    if mean.count >= 2:
        plot.line(_inside(x, mean.ei_low_n_m2, mean.ei_high_n_m2), [0.96 * top] * 2, ORANGE)
    return plot.svg()


def _inside(axis: Axis, low_n_m2: float, high_n_m2: float) -> list[float]:
    return [max(low_n_m2 / EI_UNIT, axis.low), min(high_n_m2 / EI_UNIT, axis.high)]


def _bell(plot: Plot, mean: MeanEi, area: float) -> None:
    """Draw the lognormal distribution with a mean and spread."""
    if not mean.spread_ln > 0.0:
        return
    at = np.linspace(math.log(plot.x.low), math.log(plot.x.high), 120)
    away = (at - math.log(mean.ei_n_m2 / EI_UNIT)) / mean.spread_ln
    high = np.exp(-0.5 * away**2) * area / (mean.spread_ln * math.sqrt(2.0 * math.pi))
    plot.line(np.exp(at).tolist(), np.minimum(high, plot.y.high).tolist(), INK)
