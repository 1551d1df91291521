"""What speaks against a bending stiffness, with its cause.

A check widens the interval, or refuses the value; it never shifts it in silence. What it compares
with follows from noise, stroke and stiffness.
"""

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from cosmic.autonomy.bending.inference import (
    FRICTION,
    UNLIKELY,
    VARIATIONS,
    Readings,
    excess_of,
    fixed_covariance,
    laid_out,
    own_mean,
    varied_covariance,
)
from cosmic.autonomy.bending.population import Assessed
from cosmic.autonomy.bending.result import BendingResult, Quality, SpanFit
from cosmic.autonomy.bending.settings import FitSettings
from cosmic.frame.arrays import Floats

LEAST_SPANS: Final = 2
LEAST_FOR_ONE_OUT: Final = 4
MOST_EXCESS: Final = 12.0
"""Of the variance foreseen: readings that scatter more have a cause that no interval covers."""

SIGMAS: Final = 3.0
DEEP_PART: Final = 0.25
"""Of the shortest span: a clamp deeper than that is told."""

DEEPEST_PART: Final = 0.8
"""Of the deepest clamp that is weighed: what seems to be deeper is at the end of what is known."""

VARIES_FROM: Final = 0.2
MOSTLY: Final = 0.5
UNEVEN: Final = 60.0
"""Of chi-square, where a fibre is foreseen to vary by a tenth: one that varies by half all along
seldom comes to that, and one with a weak place does."""

RELAXES_FROM: Final = 0.04
RELAXES_MOST: Final = 0.16
RUBS_FROM: Final = 0.35
NO_BEAM_POWER: Final = -1.5
BAD: Final = (
    Quality.SATURATED,
    Quality.BROKEN,
    Quality.SLIPPED,
    Quality.SET,
    Quality.HYSTERESIS,
    Quality.NO_CONTACT,
    Quality.POOR_FIT,
)
"""What spoils a span, the surest cause first."""

WORDS: Final = {
    Quality.MOVED: "one span does not lie with the others: the contact moved, or the grip slipped "
    "between spans",
    Quality.HINGE: "spans beyond one place are softer than those before: a weak place, or a kink",
    Quality.NON_UNIFORM: "the spans' stiffnesses do not follow one beam: the fibre is not uniform",
    Quality.NOT_A_FIBRE: "stiffness does not fall with the length of the span: this is not a fibre",
    Quality.RELAXED: "the force relaxes so much that stiffness depends on how long one waits",
}


def checked(
    result: BendingResult,
    readings: Readings,
    assessed: Assessed,
    settings: FitSettings,
    *,
    by_images: Sequence[str] = (),
) -> BendingResult:
    """Return the result with its flags, whether it is trusted, and why not.

    Parameters
    ----------
    by_images : sequence of str
        What images of bent fibres say against it.
    """
    flags, reasons = _spoilt_spans(result, settings)
    half = 50.0 * (result.ei_high_n_m2 - result.ei_low_n_m2) / result.ei_n_m2
    if not half <= settings.soft_percent:
        flags.add(Quality.TOO_SOFT)
        reasons.append(f"the interval is +/-{half:.0f} %, more than {settings.soft_percent:g} %")
    deepest_um = DEEPEST_PART * float(assessed.evidence.depths_um[-1])
    if _deeper(assessed, deepest_um) > 0.5:
        flags.add(Quality.CLAMP_DEEP)
        reasons.append(
            f"the clamp seems to lie more than {deepest_um:.0f} um behind the tip of the jaws, and "
            "the interval ends where depths are not weighed any more: something else may make "
            "short spans soft"
        )
    if by_images:
        flags.add(Quality.SHAPE)
        reasons += by_images
    used = [result.spans[n] for n in result.used]
    cause = _cause(used, readings, assessed, settings)
    if cause is not None:
        flags.add(cause)
        reasons.append(WORDS[cause])
    notes = _notes(result, readings, assessed, settings) | _spoilt(result)
    excess = _excess(assessed)
    if cause is None and excess > 1.0:
        likely = _misfit(used, readings, assessed, settings)
        notes.add(likely)
        reasons.append(f"{WORDS[likely]}; the interval is {math.sqrt(excess):.1f} times wider")
    return replace(
        result,
        flags=frozenset(flags),
        trusted=not flags,
        reasons=tuple(reasons),
        notes=frozenset(notes - flags),
    )


def _spoilt_spans(result: BendingResult, settings: FitSettings) -> tuple[set[Quality], list[str]]:
    """Return what is wrong with single spans, and whether enough are left to find the clamp."""
    flags: set[Quality] = set()
    reasons = [
        f"span {number + 1} at {fit.place_um:.0f} um: {', '.join(sorted(spoilt))}"
        for number, fit in enumerate(result.spans)
        if (spoilt := fit.flags & set(BAD))
    ]
    good = [n for n in result.used if not result.spans[n].flags & set(BAD)]
    if len(good) < LEAST_SPANS:
        flags.add(Quality.TOO_FEW_SPANS)
        reasons.append(f"{len(good)} good spans, and {LEAST_SPANS} are needed to find the clamp")
        flags |= {flag for fit in result.spans for flag in fit.flags & set(BAD)}
    elif not _apart_um(result, good) > SIGMAS * settings.contact_std_um:
        flags.add(Quality.TOO_FEW_SPANS)
        reasons.append(
            f"all good spans lie at {result.spans[good[0]].place_um:.0f} um, and two places are "
            "needed to find the clamp"
        )
    return flags, reasons


def _deeper(assessed: Assessed, depth_um: float) -> float:
    """Return how probable it is that the fibre is clamped deeper than that."""
    beyond = assessed.evidence.depths_um > depth_um
    return float(assessed.posterior.weights[beyond].sum())


def _apart_um(result: BendingResult, good: Sequence[int]) -> float:
    return float(np.ptp([result.spans[n].place_um for n in good]))


def _spoilt(result: BendingResult) -> set[Quality]:
    """Return the causes of the spans that were left out."""
    counts = Counter(flag for fit in result.spans for flag in fit.flags & set(BAD))
    return set(counts)


def _cause(
    fits: Sequence[SpanFit], readings: Readings, assessed: Assessed, settings: FitSettings
) -> Quality | None:
    """Return why the spans do not go together; None: they do."""
    if len(fits) >= LEAST_SPANS and _no_beam(fits, readings):
        return Quality.NOT_A_FIBRE
    relaxed = [fit.relaxation_part - SIGMAS * fit.relaxation_std_part for fit in fits]
    if relaxed and max(relaxed) > RELAXES_MOST:
        return Quality.RELAXED
    if not _excess(assessed) > MOST_EXCESS:
        return None
    return _misfit(fits, readings, assessed, settings)


def _excess(assessed: Assessed) -> float:
    likely = assessed.posterior.probability >= UNLIKELY
    return 1.0 if likely else excess_of(assessed.evidence)


def _no_beam(fits: Sequence[SpanFit], readings: Readings) -> bool:
    levers = np.array([each.lever_um() for each in readings.response.shapes])
    if np.ptp(np.log(levers)) < 0.2:
        return False
    logs = np.log([fit.k_un_um for fit in fits])
    power = float(np.polyfit(np.log(levers), logs, 1)[0])
    return power > NO_BEAM_POWER


def _misfit(
    fits: Sequence[SpanFit], readings: Readings, assessed: Assessed, settings: FitSettings
) -> Quality:
    """Return which single change mends the fit best: one span away, or one weak place."""
    if len(fits) < LEAST_FOR_ONE_OUT:
        return Quality.NON_UNIFORM
    found = _explained(readings, assessed, settings)
    return Quality.MOVED if found.one_away < found.weak else Quality.HINGE


class _Explained(NamedTuple):
    """Chi-square of an even fibre; with one span away; and with one weak place, if it is softer."""

    even: float
    one_away: float
    weak: float
    softer: bool


def _explained(readings: Readings, assessed: Assessed, settings: FitSettings) -> _Explained:
    """Return how well single changes explain the spans."""
    whole, away = _linear(readings, assessed, settings)
    spans, places = readings.span, np.array([each.at_um for each in readings.response.shapes])
    one_out = [_with(away, whole, (spans == n).astype(float))[0] for n in range(len(places))]
    weak = []
    for at in np.linspace(10.0, 0.9 * float(places.max()), 24):
        lever = np.maximum(places - at, 0.0) ** 2 / places**3
        weak.append(_with(away, whole, -lever[spans] * 100.0))
    even, _ = _with(away, whole, np.zeros(len(spans)))
    chi2, softer = min(weak)
    return _Explained(even, min(one_out), chi2, softer > 0.0)


def _weak_place(readings: Readings, assessed: Assessed, settings: FitSettings) -> bool:
    """Return whether one weak place explains what an even fibre and one span away do not."""
    if len(readings.response.shapes) < LEAST_FOR_ONE_OUT:
        return False
    found = _explained(readings, assessed, settings)
    return found.softer and found.weak < found.one_away and found.even - found.weak > UNEVEN


def _linear(readings: Readings, assessed: Assessed, settings: FitSettings) -> tuple[Floats, Floats]:
    """Return covariance and what is left of the readings at the most likely depth."""
    posterior, depths = assessed.posterior, assessed.evidence.depths_um
    here = int(np.unravel_index(posterior.weights.argmax(), posterior.weights.shape)[0])
    here = min(max(here, 1), len(depths) - 2)
    geometry = laid_out(readings, settings).log_stiffness[here - 1 : here + 2, readings.span]
    by_depth = (geometry[2] - geometry[0]) / float(np.log(depths[here + 1] / depths[here - 1]))
    whole = fixed_covariance(readings, assessed.common) + np.outer(by_depth, by_depth)
    small = float(VARIATIONS[2])
    whole = whole + varied_covariance(readings, settings)[here] * small**2
    away = readings.log_k - geometry[1] - own_mean(readings)
    return whole, away - readings.to_common @ assessed.common.mean


def _with(away: Floats, whole: Floats, column: Floats) -> tuple[float, float]:
    """Return the sum of squares with ln(EI) and one more term free, and that term."""
    matrix = np.column_stack([np.ones(len(away)), column])
    root = np.linalg.inv(whole)
    information = matrix.T @ root @ matrix
    found = np.linalg.pinv(information) @ (matrix.T @ root @ away)
    left = away - matrix @ found
    return float(left @ root @ left), float(found[1])


def _notes(
    result: BendingResult, readings: Readings, assessed: Assessed, settings: FitSettings
) -> set[Quality]:
    """Return what was seen, and is in the interval."""
    notes = set()
    used = [result.spans[n] for n in result.used]
    shortest = min(each.at_um for each in readings.response.shapes)
    if result.clamp_offset_um - result.clamp_offset_std_um > DEEP_PART * shortest:
        notes.add(Quality.CLAMP_DEEP)
    weights = assessed.posterior.weights.sum(axis=0)
    if float(weights[VARIATIONS[: len(weights)] > VARIES_FROM].sum()) > MOSTLY:
        notes.add(Quality.NON_UNIFORM)
        if _weak_place(readings, assessed, settings):
            notes.add(Quality.HINGE)
    relaxed, relaxed_std = _mean([(f.relaxation_part, f.relaxation_std_part) for f in used])
    if relaxed - SIGMAS * relaxed_std > RELAXES_FROM:
        notes.add(Quality.RELAXED)
    if _rubs(used, assessed) > RUBS_FROM:
        notes.add(Quality.FRICTION)
    return notes


def _mean(values: Sequence[tuple[float, float]]) -> tuple[float, float]:
    weights = np.array([1.0 / max(std, 1e-6) ** 2 for _, std in values])
    means = np.array([value for value, _ in values])
    return float(weights @ means / weights.sum()), float(weights.sum() ** -0.5)


def _rubs(fits: Sequence[SpanFit], assessed: Assessed) -> float:
    """Return friction by all fibres or by this one, less two standard deviations."""
    common = assessed.common
    by_all = assessed.friction + float(common.mean[FRICTION])
    by_all -= 2.0 * math.sqrt(float(common.covariance[FRICTION, FRICTION]))
    by_own, std = _friction(fits, assessed.friction)
    return max(by_all, by_own - 2.0 * std)


def _friction(fits: Sequence[SpanFit], base: float) -> tuple[float, float]:
    """Return friction as the difference of both ways tells it, and its standard deviation."""
    found = []
    for fit in fits:
        if fit.k_unloading_un_um > 0.0 and abs(fit.by_friction) > 0.01:
            differs = math.log(fit.k_loading_un_um / fit.k_unloading_un_um)
            both = 2.0 * fit.by_friction
            std = math.hypot(fit.out_std_part, fit.back_std_part) / abs(both)
            found.append((base + differs / both, std))
    return _mean(found) if found else (0.0, math.inf)
