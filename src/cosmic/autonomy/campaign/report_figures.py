"""The figures of a report."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from cosmic.autonomy.bending.result import BendingResult
from cosmic.autonomy.campaign.records import FibreRecord, Floats
from cosmic.autonomy.campaign.report_svg import (
    BLUE,
    GREY,
    INK,
    ORANGE,
    Axis,
    Plot,
    around,
)
from cosmic.autonomy.campaign.statistics import MeanEi

Mask = npt.NDArray[np.bool_]

EI_UNIT: Final = 1e-12
EI_LABEL: Final = "10⁻¹² N m²"
PALE: Final = "#9dbfdc"
FEW: Final = 8
"""Fewer fibres are drawn one by one."""


@dataclass(frozen=True, slots=True, eq=False)
class _Curve:
    """One span with its baseline taken out, counted from the first contact."""

    way_um: Floats
    force_un: Floats
    fitted_un: Floats
    loading: Mask
    place_um: float


def force_figure(record: FibreRecord) -> str:
    """Return force over push of all spans of a fibre: measured out and back, and fitted."""
    curves = [curve for number in range(len(record.spans)) if (curve := _curve(record, number))]
    if not curves:
        return ""
    ways = np.concatenate([each.way_um for each in curves])
    forces = np.concatenate([each.force_un for each in curves])
    x = Axis("push beyond the first contact, µm", *around(float(ways.min()), float(ways.max())))
    y = Axis("force, µN", *around(float(forces.min()), float(forces.max())))
    plot = Plot(x, y, f"Force over push of fibre {record.number}")
    for curve in curves:
        _draw(plot, curve)
    return plot.svg()


def _draw(plot: Plot, curve: _Curve) -> None:
    way, force, fitted = curve.way_um, curve.force_un, curve.fitted_un
    for branch in (curve.loading, ~curve.loading):
        shown = branch & np.isfinite(fitted)
        order = np.argsort(way[shown])
        if shown.any():
            plot.line(way[shown][order].tolist(), fitted[shown][order].tolist(), GREY)
    back = ~curve.loading
    plot.points(way[back].tolist(), force[back].tolist(), ORANGE, hollow=True)
    plot.points(way[curve.loading].tolist(), force[curve.loading].tolist(), BLUE)
    last = int(np.argmax(way))
    plot.note(float(way[last]), float(force[last]), f"{curve.place_um:.0f} µm", end=True)


def _curve(record: FibreRecord, number: int) -> _Curve | None:
    span = record.spans[number]
    kept = np.isfinite(span.way_um) & np.isfinite(span.force_un)
    if not kept.any():
        return None
    fits = record.bending.spans if record.bending is not None else ()
    fit = fits[number] if number < len(fits) else None
    if fit is None or not math.isfinite(fit.hinge_um):
        level = np.full(len(kept), float(np.median(span.force_un[kept][:3])))
        hinge, fitted = float(np.min(span.way_um[kept])), np.full(len(kept), np.nan)
    else:
        level = fit.baseline_un + fit.drift_un_s * (span.time_s - span.time_s[0])
        hinge, fitted = fit.hinge_um, fit.fitted_un
    return _Curve(
        way_um=(span.way_um - hinge)[kept],
        force_un=(span.force_un - level)[kept],
        fitted_un=(fitted - level)[kept],
        loading=span.loading[kept],
        place_um=span.nominal_um if fit is None else fit.place_um,
    )


def stiffness_figure(record: FibreRecord) -> str:
    """Return k^(-1/3) over the place, with the line whose slope is the bending stiffness."""
    result = record.bending
    if result is None:
        return ""
    fits = [each for each in result.spans if each.k_un_um > 0.0]
    if not fits or not result.ei_n_m2 > 0.0:
        return ""
    places = [each.place_um for each in fits]
    roots = [each.k_un_um ** (-1.0 / 3.0) for each in fits]
    slope = (3.0 * result.ei_n_m2 * 1e18) ** (-1.0 / 3.0)
    begin, end = -result.clamp_offset_um, max(places) * 1.05
    x = Axis("place of the probe from the tip of the jaws, µm", *around(min(begin, 0.0), end))
    y = Axis("k^(-1/3), (µN/µm)^(-1/3)", 0.0, 1.1 * max(*roots, slope * (end - begin)))
    plot = Plot(x, y, f"Stiffness of the spans of fibre {record.number}")
    plot.line([begin, end], [0.0, slope * (end - begin)], GREY)
    for number, (place, root) in enumerate(zip(places, roots, strict=True)):
        plot.points([place], [root], BLUE, hollow=number not in result.used)
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
        for place, each in enumerate(results, 1):
            ends = _inside(x, each.ei_low_n_m2, each.ei_high_n_m2)
            plot.line(ends, [float(place)] * 2, BLUE)
            plot.points([each.ei_n_m2 / EI_UNIT], [float(place)], BLUE)
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
