"""The parts of a report as HTML that browsers and QTextDocument both read."""

import math
from collections.abc import Iterable, Sequence
from html import escape
from typing import Final

import numpy as np

from cosmic.autonomy.campaign.records import TWIN, FibreRecord, Outcome
from cosmic.autonomy.campaign.report_card import card
from cosmic.autonomy.campaign.report_data import ReportData
from cosmic.autonomy.campaign.report_figures import (
    EI_LABEL,
    FEW,
    distribution_figure,
)
from cosmic.autonomy.campaign.report_markup import ShowPng, ShowSvg, inline_png, inline_svg, table
from cosmic.autonomy.campaign.report_svg import bars
from cosmic.autonomy.campaign.report_words import (
    NONE,
    duration,
    interval,
    mean_words,
    number,
    outcome_words,
    proves,
    stiffness,
    when,
    width_words,
    with_interval,
)

SHORTEST_S: Final = 0.05
"""Of an operation that is drawn."""

LEGEND: Final = (
    "Discs: on the way out; circles: on the way back; lines: the model; each push with the place "
    "of the probe from the tip of the jaws. The slope of the line in the second plot gives the "
    "stiffness, and where it begins is the clamp; a span as a circle was not used."
)


def body(data: ReportData, *, svg: ShowSvg = inline_svg, png: ShowPng = inline_png) -> str:
    """Return the whole report between <body> and </body>."""
    parts = [
        f"<h1>{escape(data.info.name)}: {escape(data.info.procedure)}</h1>",
        f"<p>{escape(data.info.description)}</p>" if data.info.description else "",
        "<h2>Summary</h2>",
        _summary(data),
        "<h2>What this shows, and what it does not</h2>",
        *(f"<p>{escape(each)}</p>" for each in proves(data.info)),
        *_distribution(data, svg),
        "<h2>Fibres</h2>",
        _fibres(data.finished),
        *_failures(data, svg),
        *_operations(data, svg),
        *_calibrations(data),
        "<h2>Each fibre</h2>",
        f"<p>{escape(LEGEND)}</p>",
        *(card(data.whole(each.number), svg, png) for each in data.finished),
        "<h2>Versions</h2>",
        _pairs(sorted(data.info.versions.items())),
        "<h2>Recipe</h2>",
        f"<pre>{escape(data.info.recipe_text)}</pre>",
    ]
    return "\n".join(each for each in parts if each)


def _pairs(rows: Iterable[tuple[str, str]]) -> str:
    lines = "".join(
        f'<tr><th align="left">{escape(name)}</th><td>{escape(value)}</td></tr>'
        for name, value in rows
    )
    return f'<table cellpadding="4" cellspacing="0">{lines}</table>'


def _summary(data: ReportData) -> str:
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
        ("Cut off by an end of the program", str(now.interrupted)),
        ("Good fibres an hour", number(now.good_per_hour)),
        ("Success", f"{number(now.success_percent)} %"),
        ("Median time of a fibre", duration(now.cycle_s)),
        (f"Geometric mean of EI, {EI_LABEL} (95 %)", mean_words(now.mean)),
        ("Spread between fibres", _spread(now.mean.spread_ln)),
        ("Mean length, width, curl", _shape(data.finished)),
    ]
    if info.hardware == TWIN:
        rows.insert(3, ("Seed and rate of the twin", f"{info.seed}; {info.rate:g} times"))
    return _pairs(rows)


def _spread(spread_ln: float) -> str:
    return f"factor {math.exp(spread_ln):.2f}" if math.isfinite(spread_ln) else NONE


def _shape(fibres: Sequence[FibreRecord]) -> str:
    told = []
    for values, digits, unit in (
        ([each.shape.length_um for each in fibres], 0, " µm"),
        ([each.shape.width_um for each in fibres], 0, " µm"),
        ([each.shape.curl for each in fibres], 3, ""),
    ):
        known = [each for each in values if math.isfinite(each)]
        told.append(f"{np.mean(known):.{digits}f}{unit}" if known else NONE)
    return ", ".join(told)


def _distribution(data: ReportData, svg: ShowSvg) -> list[str]:
    results = [
        each.bending
        for each in data.finished
        if each.outcome is Outcome.GOOD and each.bending is not None and each.bending.ei_n_m2 > 0.0
    ]
    if not results:
        return []
    figure = svg(distribution_figure(results, data.progress.mean), 640)
    kind = (
        "each with its 95 % interval"
        if len(results) < FEW
        else "dots; the curve is the lognormal distribution with their mean and spread"
    )
    words = (
        f"The good fibres on a logarithmic axis, {kind}. The line across the top is the 95 % "
        "interval of their geometric mean."
    )
    return ["<h2>Distribution</h2>", figure, f"<p>{words}</p>"]


def _fibres(fibres: Sequence[FibreRecord]) -> str:
    head = (
        "fibre",
        "outcome",
        f"EI, {EI_LABEL}",
        "95 % interval",
        "length, µm (95 %)",
        "width, µm (95 %)",
        "curl (95 %)",
        "peak, µN",
        "time, s",
    )
    return table(head, [_fibre_row(each) for each in fibres], words=2)


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


def _failures(data: ReportData, svg: ShowSvg) -> list[str]:
    causes = data.progress.causes
    if not causes:
        return ["<h2>Failures by cause</h2>", "<p>None.</p>"]
    rows = [(cause, float(count), str(count)) for cause, count in causes.items()]
    return ["<h2>Failures by cause</h2>", svg(bars("Failures by cause", rows), 430)]


def _operations(data: ReportData, svg: ShowSvg) -> list[str]:
    times, done = data.operations, max(data.progress.done, 1)
    if not times:
        return []
    rows = [
        (each.name, each.total_s / done, f"{each.total_s / done:.1f} s")
        for each in times
        if each.total_s / done >= SHORTEST_S
    ]
    head = ("operation", "tries", "failed", "median, s", "95 %, s", "sum, s")
    cells = [
        (
            each.name,
            str(each.tries),
            str(each.failed),
            f"{each.median_s:.2f}",
            f"{each.p95_s:.2f}",
            f"{each.total_s:.0f}",
        )
        for each in times
    ]
    shown = svg(bars("Time of each operation, for one fibre", rows, width=560.0), 560)
    words = "Time of each operation for one fibre, all tries together:"
    return ["<h2>Time of the operations</h2>", f"<p>{words}</p>", shown, table(head, cells)]


def _calibrations(data: ReportData) -> list[str]:
    rows = [
        (each.name, f"{each.residual:.3g} {each.unit.replace('um', 'µm')}", when(each.made))
        for each in data.calibrations
    ]
    shown = table(("calibration", "residual", "made"), rows) if rows else "<p>None was noted.</p>"
    return ["<h2>Calibration</h2>", shown]
