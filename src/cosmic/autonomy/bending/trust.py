"""Which spans a result may stand on, and whether it may be believed."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from scipy.special import chdtrc  # scipy.stats takes a second to load

from cosmic.autonomy.bending.result import BendingResult, Quality, SpanFit
from cosmic.autonomy.bending.settings import FitSettings

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


def judged(result: BendingResult, settings: FitSettings) -> BendingResult:
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
