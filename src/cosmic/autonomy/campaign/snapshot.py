"""What a window shows of a campaign and of one fibre, as plain values made from the records."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from cosmic.autonomy.bending.result import BendingResult, SpanFit
from cosmic.autonomy.bending.span import Span
from cosmic.autonomy.campaign.formatting import budget_rows
from cosmic.autonomy.campaign.records import FibreImage, FibreRecord, Outcome, Shape
from cosmic.autonomy.campaign.statistics import CampaignProgress, MeanEi, mean_ei
from cosmic.frame.arrays import Floats, Mask

MOST_CONTRIBUTIONS: Final = 4
LEAST_SHARE: Final = 0.03
MOST_CURVE_POINTS: Final = 2000


@dataclass(frozen=True, slots=True)
class MeasuredEi:
    """The stiffness of one fibre with its 95 % interval."""

    number: int
    ei_n_m2: float
    ei_low_n_m2: float
    ei_high_n_m2: float
    trusted: bool


@dataclass(frozen=True, slots=True)
class FibreRow:
    """One fibre in the table of a campaign; nan where something was not measured.

    Attributes
    ----------
    number : int
        Of the fibre in the campaign.
    cause : str
        Why it failed, or why its result is not trusted; empty otherwise.
    attempts : int
        How often it was begun.
    """

    number: int
    outcome: Outcome
    cause: str
    ei: MeasuredEi | None
    shape: Shape
    duration_s: float
    attempts: int


@dataclass(frozen=True, slots=True)
class CampaignSnapshot:
    """A campaign at one moment.

    Attributes
    ----------
    name : str
        Of the campaign.
    state : str
        What it is at, in a word such as "running".
    reason : str
        Why it ended; empty before.
    operation : str
        The operation under way; empty where there is none.
    done, good, doubtful, failed : int
        Fibres that have their end, and how.
    good_per_hour, success_percent : float
        nan before the first fibre.
    elapsed_s, left_s : float
        On the platform's clock; `left_s` is nan where it cannot be told.
    mean : MeanEi
        Of the good fibres.
    measured : tuple of MeasuredEi
        Of all fibres that were measured, for the histogram.
    causes : mapping
        Fibres that failed, by cause, the most frequent first.
    rows : tuple of FibreRow
        All fibres, the first first.
    """

    name: str = ""
    state: str = "ready"
    reason: str = ""
    operation: str = ""
    done: int = 0
    good: int = 0
    doubtful: int = 0
    failed: int = 0
    good_per_hour: float = math.nan
    success_percent: float = math.nan
    elapsed_s: float = 0.0
    left_s: float = math.nan
    mean: MeanEi = field(default_factory=lambda: mean_ei(()))
    measured: tuple[MeasuredEi, ...] = ()
    causes: Mapping[str, int] = field(default_factory=dict)
    rows: tuple[FibreRow, ...] = ()


def snapshot_of(
    name: str,
    state: str,
    fibres: Iterable[FibreRecord],
    progress: CampaignProgress,
    *,
    left_s: float = math.nan,
    operation: str = "",
    reason: str = "",
) -> CampaignSnapshot:
    """Return what the board shows of a campaign with these fibres."""
    rows = tuple(row_of(each) for each in fibres)
    return CampaignSnapshot(
        name=name,
        state=state,
        reason=reason,
        operation=operation,
        done=progress.done,
        good=progress.good,
        doubtful=progress.doubtful,
        failed=progress.failed,
        good_per_hour=progress.good_per_hour,
        success_percent=progress.success_percent,
        elapsed_s=progress.elapsed_s,
        left_s=left_s,
        mean=progress.mean,
        measured=tuple(row.ei for row in rows if row.ei is not None),
        causes=progress.causes,
        rows=rows,
    )


def row_of(record: FibreRecord) -> FibreRow:
    """Return the row of a fibre."""
    result = record.bending
    doubts = "" if result is None or result.trusted else "; ".join(result.reasons)
    return FibreRow(
        number=record.number,
        outcome=record.outcome,
        cause=record.cause or doubts,
        ei=_measured(record.number, result),
        shape=record.shape,
        duration_s=record.duration_s,
        attempts=record.attempts,
    )


def _measured(number: int, result: BendingResult | None) -> MeasuredEi | None:
    if result is None or not result.ei_n_m2 > 0.0:
        return None
    return MeasuredEi(
        number, result.ei_n_m2, result.ei_low_n_m2, result.ei_high_n_m2, result.trusted
    )


@dataclass(frozen=True, slots=True, eq=False)
class SpanCurve:
    """One span, its baseline taken out, counted from the first contact.

    Attributes
    ----------
    place_um : float
        From the tip of the jaws to the probe.
    probe_um, force_un, fitted_un : ndarray, shape (n,), float64
        Push, force, and the model; nan where it was not fitted.
    loading : ndarray, shape (n,), bool
        True on the way out.
    k_un_um, k_std_un_um : float
        Stiffness at the first contact; nan where there is none.
    used : bool
        The result stands on it.
    flags : tuple of str
        What makes it doubtful.
    """

    place_um: float
    probe_um: Floats
    force_un: Floats
    fitted_un: Floats
    loading: Mask
    k_un_um: float = math.nan
    k_std_un_um: float = math.nan
    used: bool = False
    flags: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class FibreCardData:
    """One fibre, for its card.

    Attributes
    ----------
    cause, text : str
        Why it failed, short and in full; empty otherwise.
    clamp_offset_um, clamp_offset_std_um : float
        Nan where it was not measured.
    flags, doubts : tuple of str
        What makes the result doubtful, in a few words and in sentences.
    uncertainty : str
        Where its interval comes from, and whether the scale of the force is verified.
    budget : tuple of tuple of str
        The budget of its stiffness: contribution, kind, uncertainty, sensitivity, share.
    curves : tuple of SpanCurve
        Its spans.
    images : tuple of FibreImage
        What was kept of it, the first first.
    failures : tuple of (str, str)
        Operations that failed on the way, with the cause of each.
    """

    number: int
    outcome: Outcome
    cause: str = ""
    text: str = ""
    ei: MeasuredEi | None = None
    shape: Shape = field(default_factory=Shape)
    clamp_offset_um: float = math.nan
    clamp_offset_std_um: float = math.nan
    peak_force_un: float = math.nan
    duration_s: float = math.nan
    attempts: int = 1
    flags: tuple[str, ...] = ()
    doubts: tuple[str, ...] = ()
    uncertainty: str = ""
    budget: tuple[tuple[str, ...], ...] = ()
    curves: tuple[SpanCurve, ...] = ()
    images: tuple[FibreImage, ...] = ()
    failures: tuple[tuple[str, str], ...] = ()


def card_of(record: FibreRecord) -> FibreCardData:
    """Return the card of a fibre that was read whole."""
    result = record.bending
    return FibreCardData(
        number=record.number,
        outcome=record.outcome,
        cause=record.cause,
        text=record.text,
        ei=_measured(record.number, result),
        shape=record.shape,
        clamp_offset_um=math.nan if result is None else result.clamp_offset_um,
        clamp_offset_std_um=math.nan if result is None else result.clamp_offset_std_um,
        peak_force_un=record.peak_force_un,
        duration_s=record.duration_s,
        attempts=record.attempts,
        flags=() if result is None else tuple(sorted(str(each) for each in result.flags)),
        doubts=() if result is None else result.reasons,
        uncertainty=_uncertainty(result),
        budget=() if result is None else tuple(budget_rows(result)),
        curves=span_curves(record, most_points=MOST_CURVE_POINTS),
        images=record.images,
        failures=tuple((each.name, each.cause) for each in record.operations if each.failed),
    )


def _uncertainty(result: BendingResult | None) -> str:
    if result is None or not result.budget:
        return ""
    largest = ", ".join(
        f"{line.source} {100.0 * line.share:.0f} %"
        for line in result.budget[:MOST_CONTRIBUTIONS]
        if line.share >= LEAST_SHARE
    )
    scale = "verified by a standard" if result.scale_verified else "not verified"
    return f"Interval: {largest}. Force scale {scale}."


def span_curves(record: FibreRecord, *, most_points: int | None = None) -> tuple[SpanCurve, ...]:
    """Return the curves of a fibre's spans, thinned to about so many points; None: all of them."""
    result = record.bending
    fits: tuple[SpanFit | None, ...] = () if result is None else result.spans
    fits = (*fits, *[None] * (len(record.spans) - len(fits)))
    used = () if result is None else result.used
    curves = [
        _curve(
            span, fit if _is_of(span, fit) else None, used=number in used, most_points=most_points
        )
        for number, (span, fit) in enumerate(zip(record.spans, fits, strict=False))
    ]
    return tuple(each for each in curves if each is not None)


def _is_of(span: Span, fit: SpanFit | None) -> bool:
    """Return whether a fit is of these points: earlier programs kept those of a later push."""
    return fit is not None and len(fit.fitted_un) == len(span.probe_um)


def _curve(
    span: Span, fit: SpanFit | None, *, used: bool, most_points: int | None
) -> SpanCurve | None:
    kept = np.isfinite(span.probe_um) & np.isfinite(span.force_un)
    if not kept.any():
        return None
    step = 1 if most_points is None else 1 + int(kept.sum()) // most_points
    every = slice(None, None, step)
    if fit is None or not math.isfinite(fit.hinge_um):
        level = np.full(len(kept), float(np.median(span.force_un[kept][:3])))
        hinge_um, fitted = float(np.min(span.probe_um[kept])), np.full(len(kept), np.nan)
    else:
        level = fit.baseline_un + fit.drift_un_s * (span.time_s - span.time_s[0])
        hinge_um, fitted = fit.hinge_um, fit.fitted_un
    return SpanCurve(
        place_um=span.nominal_um if fit is None else fit.place_um,
        probe_um=(span.probe_um - hinge_um)[kept][every],
        force_un=(span.force_un - level)[kept][every],
        fitted_un=(fitted - level)[kept][every],
        loading=span.loading[kept][every],
        k_un_um=math.nan if fit is None else fit.k_un_um,
        k_std_un_um=math.nan if fit is None else fit.k_std_un_um,
        used=used,
        flags=() if fit is None else tuple(sorted(str(each) for each in fit.flags)),
    )
