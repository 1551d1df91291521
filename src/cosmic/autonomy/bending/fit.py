"""Bending stiffness of a fibre from several spans of one grasp, and how far it may be believed."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from scipy.special import chdtrc  # scipy.stats takes a second to load

from cosmic.autonomy.bending.lever import Lever, fit_lever
from cosmic.autonomy.bending.result import (
    N_M2_PER_UN_UM2,
    BendingError,
    BendingResult,
    Quality,
    SpanFit,
)
from cosmic.autonomy.bending.settings import FitSettings
from cosmic.autonomy.bending.span import Span
from cosmic.autonomy.bending.span_fit import fit_span

LEAST_SPANS: Final = 2
POOR_PROBABILITY: Final = 1e-3
SPOILT: Final = frozenset(
    {
        Quality.SLIPPED,
        Quality.BROKEN,
        Quality.HYSTERESIS,
        Quality.SATURATED,
        Quality.POOR_FIT,
        Quality.NO_CONTACT,
    }
)


def usable(fits: Sequence[SpanFit]) -> tuple[int, ...]:
    """Return the numbers of the spans to stand on: the good ones, else any with a stiffness."""
    good = tuple(n for n, fit in enumerate(fits) if not fit.flags & SPOILT and _has_value(fit))
    return good or tuple(n for n, fit in enumerate(fits) if _has_value(fit))


def _has_value(fit: SpanFit) -> bool:
    return math.isfinite(fit.k_un_um) and 0.0 < fit.k_std_un_um < math.inf


def with_quality(result: BendingResult, settings: FitSettings) -> BendingResult:
    """Return the result with its flags, whether it is trusted, and why not."""
    flags, reasons = set(result.flags), []
    for number, fit in enumerate(result.spans):
        if spoilt := fit.flags & SPOILT:
            words = ", ".join(sorted(spoilt))
            reasons.append(f"span {number + 1} at {fit.place_um:.0f} um: {words}")
    good = [n for n in result.used if not result.spans[n].flags & SPOILT]
    if len(good) < LEAST_SPANS:
        flags.add(Quality.TOO_FEW_SPANS)
        reasons.append(f"{len(good)} good spans, and {LEAST_SPANS} are needed to find the clamp")
        flags |= {flag for fit in result.spans for flag in fit.flags & SPOILT}
    half = half_width_percent(result)
    if half > settings.soft_percent:
        flags.add(Quality.TOO_SOFT)
        reasons.append(f"the interval is +/-{half:.0f} %, more than {settings.soft_percent:g} %")
    if result.freedom > 0 and _unlikely(result):
        flags.add(Quality.POOR_FIT)
        reasons.append(
            "the spans' stiffnesses do not lie on one line: the grip slipped between spans, or "
            "the fibre is not uniform"
        )
    return replace(result, flags=frozenset(flags), trusted=not flags, reasons=tuple(reasons))


def _unlikely(result: BendingResult) -> bool:
    return float(chdtrc(result.freedom, result.chi2)) < POOR_PROBABILITY


def half_width_percent(result: BendingResult) -> float:
    """Return half of the 95 % interval, as a part of the value; nan where there is none."""
    if not result.ei_n_m2 > 0.0:
        return math.nan
    return 50.0 * (result.ei_high_n_m2 - result.ei_low_n_m2) / result.ei_n_m2


NEAR_PART: Final = 0.05
"""Of a span: an offset that is off by less changes its curve by nothing that counts."""


def fit_bending(spans: Sequence[Span], *, settings: FitSettings | None = None) -> BendingResult:
    """Return the bending stiffness of a fibre that was pushed as a cantilever.

    Parameters
    ----------
    spans : sequence of Span
        All of one grasp, in any order. One alone gives a wide interval.
    settings : FitSettings, optional
        The instrument; that of the simulated platform if None.

    Raises
    ------
    BendingError
        There is no span, or one of them is not whole.
    """
    if not spans:
        raise BendingError("there is no span to fit: measure at least one")
    settings = settings or FitSettings()
    positions = positions_um(spans)
    offset = settings.offset_um
    fits, lever, used = _once(spans, positions, offset, settings)
    if lever is not None and abs(lever.offset_um - offset) > NEAR_PART * min(positions):
        fits, lever, used = _once(spans, positions, lever.offset_um, settings)
    if lever is None:
        return with_quality(_nothing(fits, settings), settings)
    low, high = _interval(fits, used, lever, settings)
    scale = N_M2_PER_UN_UM2
    return with_quality(
        BendingResult(
            ei_n_m2=lever.ei_un_um2 * scale,
            ei_low_n_m2=low * scale,
            ei_high_n_m2=high * scale,
            clamp_offset_um=lever.offset_um,
            clamp_offset_std_um=lever.offset_std_um,
            spans=fits,
            used=used,
            chi2=lever.chi2,
            freedom=len(used) - 1,
            flags=frozenset(),
            trusted=True,
            reasons=(),
        ),
        settings,
    )


def positions_um(spans: Sequence[Span]) -> tuple[float, ...]:
    """Return where each span lies: exact to each other, with an offset common to all.

    The fibre may point either way along the axes; the nominal positions tell which.
    """
    read = [span.probe_x_um - span.hold_x_um for span in spans]
    nominal = [span.nominal_um for span in spans]
    middle, among = sum(read) / len(read), sum(nominal) / len(nominal)
    along = sum((x - middle) * (a - among) for x, a in zip(read, nominal, strict=True))
    sign = -1.0 if along < 0.0 else 1.0
    return tuple(among + sign * (x - middle) for x in read)


def _once(
    spans: Sequence[Span], positions: Sequence[float], offset_um: float, settings: FitSettings
) -> tuple[tuple[SpanFit, ...], Lever | None, tuple[int, ...]]:
    fits = tuple(
        fit_span(
            span, settings=settings, place_um=position, length_um=max(position + offset_um, 10.0)
        )
        for span, position in zip(spans, positions, strict=True)
    )
    used = usable(fits)
    return fits, (fit_lever([fits[n] for n in used], settings) if used else None), used


def _interval(
    fits: Sequence[SpanFit], used: Sequence[int], lever: Lever, settings: FitSettings
) -> tuple[float, float]:
    """Return the 95 % interval: the profile's, and what all spans have wrong in common."""
    systematic = math.hypot(
        settings.gain_std_part,
        settings.way_scale_std_part,
        _sensor_part([fits[n] for n in used], lever, settings),
    )
    best = math.log(lever.ei_un_um2)
    below, above = best - math.log(lever.low_un_um2), math.log(lever.high_un_um2) - best
    common = 1.96 * systematic
    return math.exp(best - math.hypot(below, common)), math.exp(best + math.hypot(above, common))


def _sensor_part(fits: Sequence[SpanFit], lever: Lever, settings: FitSettings) -> float:
    """Return how much EI changes with one standard deviation of the sensor's stiffness."""
    softer = settings.sensor_un_um * (1.0 - settings.sensor_std_part / 2.0)
    change = 1.0 / softer - 1.0 / settings.sensor_un_um
    moved = [fit.k_un_um / max(1.0 - fit.k_un_um * change, 0.1) for fit in fits]
    other = fit_lever(fits, settings, stiffnesses=moved)
    return 2.0 * abs(math.log(other.ei_un_um2 / lever.ei_un_um2))


def _nothing(fits: tuple[SpanFit, ...], settings: FitSettings) -> BendingResult:
    return BendingResult(
        ei_n_m2=math.nan,
        ei_low_n_m2=math.nan,
        ei_high_n_m2=math.nan,
        clamp_offset_um=settings.offset_um,
        clamp_offset_std_um=settings.offset_std_um,
        spans=fits,
        used=(),
        chi2=0.0,
        freedom=0,
        flags=frozenset({Quality.NO_CONTACT}),
        trusted=False,
        reasons=(),
    )
