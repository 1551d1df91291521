"""The figures of a report, as SVG."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from cosmic.autonomy.bending.bent_shape import bent_um
from cosmic.autonomy.bending.result import BendingResult
from cosmic.autonomy.campaign.formatting import EI_LABEL, EI_UNIT
from cosmic.autonomy.campaign.records import FibreRecord
from cosmic.autonomy.campaign.snapshot import SpanCurve, span_curves
from cosmic.autonomy.campaign.statistics import MeanEi
from cosmic.autonomy.campaign.svg_plot import BLUE, GREY, INK, ORANGE, Axis, Plot, around, bars

PALE: Final = "#9dbfdc"
FEW: Final = 8
"""Fewer fibres are drawn one by one."""
BEFORE_PART: Final = 0.3
"""How much of a push before contact is drawn, of the longest push after it."""
APART_PART: Final = 0.07
"""Of the forces: how far labels stand from each other, and from the upper end."""
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


def force_figure(record: FibreRecord) -> str:
    """Return force over push of all spans of a fibre: measured out and back, and fitted."""
    curves = span_curves(record)
    if not curves:
        return ""
    probes = np.concatenate([each.probe_um for each in curves])
    forces = np.concatenate([each.force_un for each in curves])
    first = max(float(probes.min()), -BEFORE_PART * max(float(probes.max()), 1.0))
    x = Axis("push beyond the first contact, µm", *around(first, float(probes.max())))
    low, high = around(float(forces.min()), float(forces.max()))
    labels = _apart(curves, APART_PART * (high - low))
    # The labels of pushes that end at about the same force stand above each other.
    above = max(at_un for _, at_un, _ in labels) + APART_PART * (high - low)
    y = Axis("force, µN", low, max(high, above))
    plot = Plot(x, y, f"Force over push of fibre {record.number}")
    for curve in curves:
        _draw(plot, curve, first)
    for at_um, at_un, words in labels:
        plot.note(at_um, at_un, words, end=True)
    return plot.svg()


def _apart(curves: Sequence[SpanCurve], least_un: float) -> list[tuple[float, float, str]]:
    """Return where the labels of the spans stand, none upon another."""
    ends = sorted(
        (float(each.force_un[last]), float(each.probe_um[last]), f"{each.place_um:.0f} µm")
        for each in curves
        for last in (int(np.argmax(each.probe_um)),)
    )
    placed: list[tuple[float, float, str]] = []
    for force, probe, words in ends:
        free = max([force, *(before + least_un for _, before, _ in placed[-1:])])
        placed.append((probe, free, words))
    return placed


def operation_bars(operations: Sequence[OperationTime], fibres: int) -> str:
    """Return how long each operation takes for one of so many fibres."""
    done = max(fibres, 1)
    rows = [
        (each.name, each.total_s / done, f"{each.total_s / done:.1f} s")
        for each in operations
        if each.total_s / done >= SHORTEST_S
    ]
    return bars("Time of each operation, for one fibre", rows, width=560.0) if operations else ""


def _draw(plot: Plot, curve: SpanCurve, first_um: float) -> None:
    inside = curve.probe_um >= first_um
    probe, force, fitted = (
        each[inside] for each in (curve.probe_um, curve.force_un, curve.fitted_un)
    )
    loading = curve.loading[inside]
    for branch in (loading, ~loading):
        shown = branch & np.isfinite(fitted)
        order = np.argsort(probe[shown])
        if shown.any():
            plot.line(probe[shown][order].tolist(), fitted[shown][order].tolist(), GREY)
    plot.points(probe[~loading].tolist(), force[~loading].tolist(), ORANGE, hollow=True)
    plot.points(probe[loading].tolist(), force[loading].tolist(), BLUE)


def residual_figure(record: FibreRecord) -> str:
    """Return what the model leaves of the force over the push, of all spans of a fibre."""
    curves = [each for each in span_curves(record) if np.isfinite(each.fitted_un).any()]
    if not curves:
        return ""
    left = [each.force_un - each.fitted_un for each in curves]
    highest = max(float(np.nanmax(np.abs(each))) for each in left)
    pushes = np.concatenate([each.probe_um for each in curves])
    first = max(float(pushes.min()), -BEFORE_PART * max(float(pushes.max()), 1.0))
    x = Axis("push beyond the first contact, µm", *around(first, float(pushes.max())))
    y = Axis("force less model, µN", -1.1 * highest - 1e-6, 1.1 * highest + 1e-6)
    plot = Plot(x, y, f"Residuals of fibre {record.number}", height=180.0)
    plot.line([x.low, x.high], [0.0, 0.0], GREY)
    for curve, away in zip(curves, left, strict=True):
        for branch, colour in ((curve.loading, BLUE), (~curve.loading, ORANGE)):
            shown = branch & np.isfinite(away) & (curve.probe_um >= first)
            plot.points(
                curve.probe_um[shown].tolist(),
                away[shown].tolist(),
                colour,
                hollow=colour == ORANGE,
            )
    return plot.svg()


def shape_figure(record: FibreRecord) -> str:
    """Return how far an image shows a fibre bent at the end of its longest push, and the model.

    The model is an even beam that is clamped as the spans say and bent as far as the probe went.
    """
    result = record.bending
    pairs = zip(record.spans, result.spans, strict=False) if result is not None else ()
    for span, fit in pairs:
        bent, shape = span.bent, span.shape
        if result is None or bent is None or shape is None or not len(bent.ahead_um):
            continue
        pushed = bent.probe_um - fit.hinge_um
        if not pushed > 0.0:
            return ""
        places = np.linspace(1.0, shape.at_um, 40)
        model = bent_um(shape, places, pushed_um=pushed, depth_um=result.clamp_offset_um)
        aside = bent.aside_um
        low, high = min(0.0, float(aside.min())), max(pushed, float(aside.max()))
        x = Axis("place from the tip of the jaws, µm", *around(0.0, shape.at_um))
        y = Axis("pushed aside, µm", *around(low, high))
        plot = Plot(x, y, f"Bent shape of fibre {record.number} in the image", height=180.0)
        plot.line(places.tolist(), model.tolist(), GREY)
        plot.points(bent.ahead_um.tolist(), aside.tolist(), BLUE)
        plot.points([shape.at_um], [pushed], ORANGE)
        plot.note(shape.at_um, pushed, "probe", end=True)
        return plot.svg()
    return ""


def stiffness_figure(record: FibreRecord) -> str:
    """Return k^(-1/3) over the position, with the line whose slope is the bending stiffness.

    Circles as it was read, discs what the fit makes of it.
    """
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
    plot.points(positions, roots, GREY, hollow=True)
    for each in fits:
        if math.isfinite(each.off_model_log):
            root = slope * (each.place_um - begin) * math.exp(-each.off_model_log / 3.0)
            plot.points([each.place_um], [root], BLUE)
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
