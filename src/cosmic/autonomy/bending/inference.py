"""Bending stiffness from the stiffnesses of several spans, with all that is not known beside it.

ln(k) of a span, out or back, is ln(EI) plus what the depth of the clamp makes of the geometry, plus
small terms that are linear in what else is not known. Given the depth and how much the stiffness
varies along the fibre, all is Gaussian and EI follows in closed form; depth and variation are
summed over grids. So the interval is no symmetrical one, and a depth below zero does not exist.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from scipy.special import chdtrc, ndtr

from cosmic.autonomy.bending.holds import TWISTED, UNKNOWN_HOLDS, Holds, slides_of
from cosmic.autonomy.bending.response import Direction, LaidOut, Response
from cosmic.autonomy.bending.result import COMMON_SOURCES, SpanFit
from cosmic.autonomy.bending.settings import FitSettings
from cosmic.frame.arrays import Floats

DEPTHS: Final = 36
SHALLOWEST_UM, DEEPEST_UM = 1.5, 240.0
SURE: Final = 0.3
"""Of ln(depth): what is known better than this needs a grid of its own."""

VARIATIONS: Final = np.array([0.0, 0.05, 0.1, 0.17, 0.28, 0.45, 0.65])
"""How much ln(EI) varies along a fibre, one standard deviation: those that are weighed."""

LOW_TAIL, HIGH_TAIL = 0.025, 0.975
EXACT: Final = 1e-15
"""Of ln(EI): how near the ends of an interval are found."""

MOST_TRIES: Final = 1000

WEIGHED: Final = 1e-4
"""Depths and variations that weigh less than this do not count for what a fit leaves."""

UNLIKELY: Final = 1e-3
TURNED_PART: Final = 1.0
TURNED_LEAST: Final = 0.01
"""How far friction that holds a section askew may have turned round on the way back, as a part of
what it did on the way out; and at least, of ln(k), beside how well that is known."""

ANY_HOLD: Final = 1.0
"""Of ln(k): how much friction may hold a fibre, one standard deviation, of which others tell
nothing."""

ALONG: Final = ("friction along, once it let go", "")

LEAST_STD: Final = 0.004
"""Of ln(k): a model is no better than this."""

GAIN, DRIFT, FRICTION, COMPLIANCE, CONTACT, CROSS, ASIDE, SHEAR, SLIDES = range(len(COMMON_SOURCES))

GLASS_SHEAR: Final = (0.5, 0.1)
"""Of a round beam of glass: `FitSettings.shear_part`, and its standard deviation."""


def depth_prior(settings: FitSettings) -> tuple[float, float]:
    """Return median and spread of ln(depth) before anything is measured."""
    spread = math.sqrt(math.log1p((settings.offset_std_um / settings.offset_um) ** 2))
    return math.log(settings.offset_um) - 0.5 * spread**2, spread


def depths_of(settings: FitSettings) -> Floats:
    """Return the depths of the clamp that are weighed, um, evenly on a scale of logarithms."""
    middle, spread = depth_prior(settings)
    if spread < SURE:
        return np.exp(middle + spread * np.linspace(-4.0, 4.0, DEPTHS))
    return np.geomspace(SHALLOWEST_UM, DEEPEST_UM, DEPTHS)


@dataclass(frozen=True, slots=True, eq=False)
class Common:
    """What all fibres of a campaign share, as far as it is known: a Gaussian.

    Attributes
    ----------
    mean : ndarray, shape (9,), float64
        In the order of `COMMON_SOURCES`: error of ln(gain), its change over the campaign, friction
        less that about which spans were fitted, compliance of jaws and sensor less the sensor's
        nominal one (um/uN), place of contact (um), the part of a force along the edge that is read
        as one across, how much more than foreseen the probe gives way along the fibre, as a part,
        how much more than foreseen fibres shear, and how far the probe slides where it should
        stick, 1: at once.
    covariance : ndarray, shape (9, 9), float64
    """

    mean: Floats
    covariance: Floats


def common_prior(
    settings: FitSettings, *, friction: float | None = None, slides: bool = False
) -> Common:
    """Return what is known of the instrument before anything is measured.

    Parameters
    ----------
    friction : float, optional
        About which the spans were fitted; that of the settings if None.
    slides : bool
        The probe never sticks to fibres.
    """
    rubs = 0.0 if friction is None else settings.friction - friction
    sensor = settings.sensor_std_part / settings.sensor_un_um
    jaws = 1.0 / settings.jaw_un_um
    stds = np.array(
        [
            math.hypot(settings.gain_std_part, settings.way_scale_std_part),
            settings.gain_drift_std_part,
            settings.friction_std,
            math.hypot(sensor, settings.jaw_std_part * jaws),
            settings.contact_offset_std_um,
            settings.cross_std_part,
            settings.side_std_part,
            settings.shear_std_part,
            settings.slides_std_part,
        ]
    )
    mean = np.array([0.0, 0.0, rubs, jaws, 0.0, 0.0, 0.0, 0.0, float(slides)])
    return Common(mean, np.diag(np.maximum(stds, 1e-9) ** 2))


_Own = tuple[str, str, Floats, float, float]
"""What is a fibre's own: name, unit, derivatives of ln(k), mean and standard deviation."""


@dataclass(frozen=True, slots=True, eq=False)
class Readings:
    """Stiffnesses of one fibre, both ways of each span in one row after the other.

    Attributes
    ----------
    log_k : ndarray, shape (m,), float64
        Of force and travel in uN and um.
    noise : ndarray, shape (m, m), float64
        Their covariance by the scatter of readings.
    span : ndarray, shape (m,), int
        Which span a row belongs to.
    to_common : ndarray, shape (m, 9), float64
        Derivatives to what is common.
    own : tuple of (str, str, ndarray, float, float)
        What is each fibre's own beside clamp and variation; see `_Own`.
    repeat : ndarray, shape (m, m), float64
        Covariance by places of contact that do not repeat.
    askew : ndarray, shape (m, m), float64
        Covariance by friction that holds a section that stands askew; a standard is round.
    slipped : bool
        It slipped in a span, also one that is not among these: how deep others are clamped tells
        nothing of it any more.
    """

    log_k: Floats
    noise: Floats
    span: np.ndarray
    to_common: Floats
    own: tuple[_Own, ...]
    repeat: Floats
    askew: Floats
    response: Response
    longest: int
    certified: tuple[float, float] | None = None
    slipped: bool = False


def readings_of(
    fits: Sequence[SpanFit],
    response: Response,
    settings: FitSettings,
    *,
    direction: Direction,
    part: float = 0.0,
    certified: tuple[float, float] | None = None,
    slipped: bool = False,
    holds: Holds = UNKNOWN_HOLDS,
    friction_std: float | None = None,
    slides: bool = False,
) -> Readings:
    """Return the readings of the spans of one fibre.

    Parameters
    ----------
    direction : Direction
        In which the fibre leaves the jaws.
    part : float
        Of the campaign that was over, 0 to 1: the gain drifts.
    certified : tuple of float, optional
        Of a standard: ln(EI), EI in uN um2, and its standard uncertainty.
    slipped, holds : bool, Holds
        See `Readings`; and how far sections of the campaign are held.
    friction_std : float, optional
        Of a standard, how well its own friction is known; as the settings have it if None.
    slides : bool
        The probe never sticks to the fibre.
    """
    rows = _rows(fits, slides=slides)
    span = np.array([each.span for each in rows])
    k = np.array([each.k_un_um for each in rows])
    friction = np.array([each.by_friction for each in rows])
    glass = certified is not None
    softer, by_shear, shear = _sheared(response.by_square[span], settings, glass=glass)
    to_common = _to_common(fits, rows, friction, response, by_shear, part)
    own = (*_own(response, span, settings, direction), shear)
    if glass:
        std = friction_std or settings.friction_std
        own = (*own, *_of_glass(to_common, friction, settings, friction_std=std, slides=slides))
        # Glass rubs and shears otherwise than fibres do.
        to_common[:, [FRICTION, SHEAR, SLIDES]] = 0.0
    # The direction was found as if all contacts lay where they are told to.
    to_common[:, CONTACT] += direction.by_contact * response.by_direction[span]
    shift, askew, let_go = _with_holds(fits, rows, settings, holds, glass=glass)
    return Readings(
        log_k=np.log(k) + shift + softer,
        noise=_noise(fits, rows, settings),
        span=span,
        to_common=to_common,
        own=(*own, *let_go),
        repeat=_repeated(response, span, settings),
        askew=askew,
        response=response,
        longest=_longest(response),
        certified=certified,
        slipped=slipped,
    )


def _with_holds(
    fits: Sequence[SpanFit],
    rows: Sequence["_Row"],
    settings: FitSettings,
    holds: Holds,
    *,
    glass: bool,
) -> tuple[Floats, Floats, tuple[_Own, ...]]:
    """Return what sections askew add to ln(k), its covariance, and friction along that let go."""
    span = np.array([each.span for each in rows])
    sign = np.array([each.sign for each in rows])
    freed = None if glass else _freed(fits, rows, holds)
    if freed is not None:
        # The friction along the fibre may have let go as well.
        std = holds.along_std if math.isfinite(holds.along_std) else 0.5 * settings.friction
        friction = np.array([each.by_friction for each in rows])
        return *freed, ((*ALONG, np.where(sign > 0.0, friction, 0.0), 0.0, std),)
    shift = -_between_branches(span, np.log([each.k_un_um for each in rows]))
    same = span[:, None] == span[None, :]
    askew = np.zeros_like(same, dtype=float) if glass else _askew(sign, same, settings)
    return shift, askew, ()


def _of_glass(
    to_common: Floats,
    by_friction: Floats,
    settings: FitSettings,
    *,
    friction_std: float,
    slides: bool,
) -> tuple[_Own, _Own]:
    """Return how friction on a standard differs from that on fibres, and whether it sticks."""
    # Where it slides, how much friction there is tells of all.
    slides_std = 0.0 if slides else settings.slides_std_part
    mean = float(slides and not settings.slides)
    return (
        ("friction", "", by_friction, 0.0, friction_std),
        ("the probe slides on glass", "", to_common[:, SLIDES].copy(), mean, slides_std),
    )


def _repeated(response: Response, span: np.ndarray, settings: FitSettings) -> Floats:
    """Return the covariance of ln(k) by where the probe touches, the same both ways of a span."""
    contact = settings.contact_std_um * response.by_contact[span]
    return np.asarray(np.outer(contact, contact) * (span[:, None] == span[None, :]))


def _sheared(
    by_square: Floats, settings: FitSettings, *, glass: bool
) -> tuple[Floats, Floats, "_Own"]:
    """Return what is to be added to ln(k), its derivative, and how each fibre differs in it."""
    part, std, name = settings.shear_part, settings.shear_own_part, "shear of this fibre alone"
    std *= part
    if glass:
        (part, std), name = GLASS_SHEAR, "shear"
    sheared = settings.fibre_width_um**2 * by_square
    slope = np.asarray(-sheared / (1.0 + part * sheared))
    return np.asarray(np.log1p(part * sheared)), slope, (name, "", slope, 0.0, std)


def _to_common(
    fits: Sequence[SpanFit],
    rows: Sequence["_Row"],
    friction: Floats,
    response: Response,
    by_shear: Floats,
    part: float,
) -> Floats:
    """Return what the readings answer to the common parameters, a row for each reading."""
    span = np.array([each.span for each in rows])
    k = np.array([each.k_un_um for each in rows])
    return np.column_stack(
        [
            np.ones(len(k)),
            np.full(len(k), part),
            friction,
            -k,
            response.by_contact[span],
            response.slopes[span],
            np.array([_aside(fits[each.span], each.sign) for each in rows]),
            by_shear,
            np.array([_sliding(fits[each.span], each.sign) for each in rows]),
        ]
    )


def _askew(sign: Floats, same: np.ndarray, settings: FitSettings) -> Floats:
    """Return the covariance of ln(k) by what friction takes of it out, and adds back."""
    each = settings.askew_std**2 * (1.0 + TWISTED**2 * same)
    return np.asarray(each * np.outer(sign, sign))


def _freed(
    fits: Sequence[SpanFit], rows: Sequence["_Row"], holds: Holds
) -> tuple[Floats, Floats] | None:
    """Return what is to be added to ln(k), and its covariance; None: friction never let go.

    Of a fibre that was not slid it did so in others, if in any: no more is known of it then than
    how far those lie apart.

    On the way out a section askew was as much too stiff as the force fell once friction let go, and
    as in the other spans, but for twist, and as in the other fibres as far as those are alike. What
    is not known of all spans together tells nothing of the clamp. On the way back it may have
    turned round, by any part of that: how far depends on the section.
    """
    if not (len(slides_of(fits).logs) or math.isfinite(holds.std)):
        return None
    logs, of_span = _held(fits, holds)
    span = np.array([each.span for each in rows])
    out = np.array([each.sign > 0.0 for each in rows])
    of_out = of_span[span[:, None], span] * np.outer(out, out)
    same = span[:, None] == span[None, :]
    most = np.hypot(TURNED_PART * np.hypot(logs, np.sqrt(np.diag(of_span))), TURNED_LEAST)
    turned = np.where(out, 0.0, most[span])
    back = np.outer(turned, turned) * (0.5 + 0.5 * same)
    return logs[span] * out, np.asarray(of_out + back)


def _held(fits: Sequence[SpanFit], holds: Holds) -> tuple[Floats, Floats]:
    """Return how much friction holds each span, as ln of the force, and its covariance."""
    known = np.array([math.isfinite(fit.freed_log + fit.freed_std_part) for fit in fits])
    slides = slides_of(fits)
    freed, weights = slides.logs + holds.along * slides.by_friction, slides.stds**-2.0
    precision = float(weights.sum()) + holds.std**-2.0
    mean = (float(weights @ freed) + holds.mean * holds.std**-2.0) / precision
    twisted = math.hypot(holds.twisted_part * mean, holds.twisted)
    twisted = max(twisted, _between(freed, weights))
    alike = min(holds.std, ANY_HOLD) ** 2
    before = alike + np.diag(np.full(len(fits), twisted**2))
    gain = np.linalg.solve(before[np.ix_(known, known)] + np.diag(slides.stds**2), before[known]).T
    logs = holds.mean + gain @ (freed - holds.mean)
    of_span = before - gain @ before[known]
    if not math.isfinite(holds.std):
        # Nothing but the way back would speak against what all spans of a fibre have in common, and
        # that is no better: alone it counts as if each had its own.
        of_span = np.diag(np.diag(of_span))
    return np.asarray(logs), np.asarray(of_span)


def _between(values: Floats, weights: Floats) -> float:
    """Return by how much values differ beyond what their weights allow, one standard deviation.

    After DerSimonian and Laird.
    """
    if not len(values):
        return 0.0
    total = float(weights.sum())
    mean = float(weights @ values) / total
    beyond = float(weights @ (values - mean) ** 2) - (len(values) - 1)
    free = total - float(weights @ weights) / total
    return math.sqrt(beyond / free) if beyond > 0.0 and free > 0.0 else 0.0


def _between_branches(span: np.ndarray, log_k: Floats) -> Floats:
    """Return how far the mean ln(k) of both ways of a span lies above that of its mean compliance.

    Friction that holds a section that stands askew takes as much compliance away on the way out
    as it adds on the way back.
    """
    found = np.zeros(len(log_k))
    for number in set(span.tolist()):
        both = span == number
        if both.sum() == 2:
            found[both] = math.log(math.cosh(0.5 * float(np.ptp(log_k[both]))))
    return found


class _Row(NamedTuple):
    """One stiffness of one span; `sign` is 1 on the way out and -1 on the way back."""

    span: int
    k_un_um: float
    std_part: float
    sign: float
    by_friction: float


def _rows(fits: Sequence[SpanFit], *, slides: bool) -> list[_Row]:
    """Return what was read of each span: on the way out, then on the way back if there is one."""
    rows: list[_Row] = []
    for number, fit in enumerate(fits):
        both = fit.by_friction_both
        out, back = both + fit.by_friction, both - fit.by_friction
        if slides:
            out, back = fit.by_friction_sliding
        rows.append(_Row(number, fit.k_loading_un_um, fit.out_std_part, 1.0, out))
        if fit.k_unloading_un_um > 0.0 and math.isfinite(fit.back_std_part):
            rows.append(_Row(number, fit.k_unloading_un_um, fit.back_std_part, -1.0, back))
    return rows


def _noise(fits: Sequence[SpanFit], rows: Sequence[_Row], settings: FitSettings) -> Floats:
    """Return the covariance of the logarithms of what was read, by noise alone."""
    # Friction is taken to be linear; what that leaves out is about its square.
    bent = np.array(
        [0.5 * (fits[each.span].by_friction * settings.friction_std) ** 2 for each in rows]
    )
    stds = np.sqrt(np.array([each.std_part for each in rows]) ** 2 + LEAST_STD**2 + bent**2)
    noise = np.diag(stds**2)
    for i, row in enumerate(rows):
        if row.sign < 0.0:  # the way out stands before it
            both = fits[row.span].branches_correlation * stds[i] * stds[i - 1]
            noise[i, i - 1] = noise[i - 1, i] = both
    return noise


def _own(
    response: Response,
    span: np.ndarray,
    settings: FitSettings,
    direction: Direction,
) -> tuple[_Own, ...]:
    """Return what is each fibre's own; see `Readings.own`."""
    turned, turned_std = direction.turned_rad, direction.std_rad
    at_um = np.array([each.at_um for each in response.shapes])[span]
    by_scale = response.by_contact[span] * at_um
    return (
        ("direction of the fibre", "rad", response.by_direction[span], turned, turned_std),
        ("scale of the stage", "", by_scale, 0.0, settings.way_scale_std_part),
    )


def _aside(fit: SpanFit, sign: float) -> float:
    return fit.by_side_out if sign > 0.0 else fit.by_side_back


def _sliding(fit: SpanFit, sign: float) -> float:
    return fit.by_sliding_out if sign > 0.0 else fit.by_sliding_back


def _longest(response: Response) -> int:
    return int(np.argmax([each.at_um for each in response.shapes]))


@dataclass(frozen=True, slots=True, eq=False)
class Evidence:
    """What the readings of a fibre say for each depth of the clamp and each variation.

    Attributes
    ----------
    log_likelihood, log_ei, variance, chi2 : ndarray, shape (depths, variations), float64
        ln(EI) in uN um2, and what is not known of it with both given.
    """

    depths_um: Floats
    log_likelihood: Floats
    log_ei: Floats
    variance: Floats
    chi2: Floats
    freedom: int


def evidence_of(readings: Readings, common: Common, settings: FitSettings) -> Evidence:
    """Return the evidence of a fibre's readings."""
    span = readings.span
    depths = depths_of(settings)
    laid = laid_out(readings, settings)
    geometry = laid.log_stiffness[:, span]
    known = readings.to_common @ common.mean + own_mean(readings)
    away = readings.log_k - geometry - known
    total = fixed_covariance(readings, common)
    varied = laid.variation[:, span[:, None], span]
    variations = VARIATIONS if readings.certified is None else VARIATIONS[:1]
    whole = total + varied[:, None] * (variations**2)[None, :, None, None]
    ones = np.ones(len(span))
    root = np.linalg.inv(whole)[laid.nearest]
    each = root @ ones
    weight = each @ ones
    if readings.certified is not None:
        log_ei, std = readings.certified
        off = away[:, None, :] - log_ei
        whole = whole + std**2
        root = np.linalg.inv(whole)[laid.nearest]
        chi2 = np.einsum(
            "dvi,dvij,dvj->dv",
            np.broadcast_to(off, root.shape[:3]),
            root,
            np.broadcast_to(off, root.shape[:3]),
        )
        best, extra = np.full(chi2.shape, log_ei), np.zeros(chi2.shape)
        variance = np.full(chi2.shape, std**2)
    else:
        best = np.einsum("dvi,di->dv", each, away) / weight
        off = away[:, None, :] - best[:, :, None]
        chi2 = np.einsum("dvi,dvij,dvj->dv", off, root, off)
        extra, variance = np.log(weight), 1.0 / weight
    likely = -0.5 * (chi2 + np.linalg.slogdet(whole)[1][laid.nearest] + extra)
    return Evidence(depths, np.asarray(likely), best, variance, chi2, len(span) - 1)


def own_mean(readings: Readings) -> Floats:
    """Return what each fibre's own small terms add to ln(k), by what is known beforehand."""
    total = np.zeros(len(readings.log_k))
    for _, _, column, mean, _ in readings.own:
        total = total + column * mean
    return total


def fixed_covariance(readings: Readings, common: Common | None = None) -> Floats:
    """Return the covariance of the readings that no depth and no variation changes."""
    whole = readings.noise + readings.repeat + readings.askew
    if common is not None:
        whole = whole + readings.to_common @ common.covariance @ readings.to_common.T
    for _, _, column, _, std in readings.own:
        whole = whole + std**2 * np.outer(column, column)
    return np.asarray(whole)


def laid_out(readings: Readings, settings: FitSettings) -> LaidOut:
    """Return what the spans answer at each depth of the clamp that is weighed."""
    return readings.response.laid_out(
        depths_of(settings), settings.ei_length_um, readings.longest, every=DEPTHS // 3
    )


def varied_covariance(readings: Readings, settings: FitSettings) -> Floats:
    """Return the covariance of a variation of 1, for each depth; shape (depths, m, m)."""
    span, laid = readings.span, laid_out(readings, settings)
    return np.asarray(laid.variation[:, span[:, None], span][laid.nearest])


@dataclass(frozen=True, slots=True, eq=False)
class Posterior:
    """What is known of one fibre in the end.

    Attributes
    ----------
    log_ei, log_low, log_high : float
        Median and ends of the 95 % interval, EI in uN um2.
    depth_um, depth_std_um : float
        Of the clamp.
    variation : float
        How much ln(EI) varies along the fibre, one standard deviation.
    probability : float
        That readings miss the best model by more than they do.
    weights : ndarray, shape (depths, variations), float64
    excess : float
        By how much the variance was taken to be more, as readings scatter more than foreseen.
    """

    log_ei: float
    log_low: float
    log_high: float
    depth_um: float
    depth_std_um: float
    variation: float
    probability: float
    weights: Floats
    excess: float = 1.0


def excess_of(evidence: Evidence) -> float:
    """Return by how much readings scatter more than foreseen, as a part of the variance.

    The depth's prior is no reading: the best depth stands for the check.
    """
    return max(1.0, float(evidence.chi2.min()) / max(evidence.freedom - 1, 1))


def posterior_of(evidence: Evidence, prior: Floats) -> Posterior:
    """Return what follows from evidence and prior weights of depths and variations.

    Where readings scatter more than can be chance, the interval is as much wider.
    """
    prior = prior[:, : evidence.chi2.shape[1]]
    probability = float(chdtrc(max(evidence.freedom - 1, 1), evidence.chi2.min()))
    excess = excess_of(evidence) if probability < UNLIKELY else 1.0
    logs = evidence.log_likelihood / excess + np.log(np.maximum(prior, 1e-300))
    weights = np.exp(logs - logs.max())
    weights /= weights.sum()
    stds = np.sqrt(evidence.variance * excess)
    ends = [_quantile(weights, evidence.log_ei, stds, each) for each in (LOW_TAIL, 0.5, HIGH_TAIL)]
    of_depth = weights.sum(axis=1)
    depths = evidence.depths_um
    depth = float(of_depth @ depths)
    variation = VARIATIONS[: weights.shape[1]]
    return Posterior(
        log_ei=ends[1],
        log_low=ends[0],
        log_high=ends[2],
        depth_um=depth,
        depth_std_um=float(np.sqrt(of_depth @ (depths - depth) ** 2)),
        variation=float(weights.sum(axis=0) @ variation),
        probability=probability,
        weights=weights,
        excess=excess,
    )


def _quantile(weights: Floats, means: Floats, stds: Floats, part: float) -> float:
    from scipy.optimize import brentq  # half a second, at the first fit

    low = float((means - 8.0 * stds).min())
    high = float((means + 8.0 * stds).max())

    def more(value: float) -> float:
        return float((weights * ndtr((value - means) / stds)).sum()) - part

    if not low < high or not (np.isfinite(weights).all() and np.isfinite(stds).all()):
        return 0.5 * (low + high)
    return float(brentq(more, low, high, xtol=EXACT, rtol=EXACT, maxiter=MOST_TRIES))


def off_model(
    readings: Readings, common: Common, settings: FitSettings, evidence: Evidence, weights: Floats
) -> Floats:
    """Return what a fit leaves of ln(k) of each span, in the order of the spans.

    Of what the readings are off, noise, places of contact and variation along the fibre make the
    part that goes with their covariances; the rest is taken for what else is not known.
    """
    span, laid = readings.span, laid_out(readings, settings)
    known = readings.to_common @ common.mean + own_mean(readings)
    away = readings.log_k - laid.log_stiffness[:, span] - known
    varied = varied_covariance(readings, settings)
    fixed, scatter = fixed_covariance(readings, common), readings.noise + readings.repeat
    depth, variation = np.nonzero(weights > WEIGHED)
    along = varied[depth] * VARIATIONS[variation, None, None] ** 2
    off = away[depth] - evidence.log_ei[depth, variation][:, None]
    each = (scatter + along) @ np.linalg.solve(fixed + along, off[:, :, None])
    left = np.average(each[:, :, 0], axis=0, weights=weights[depth, variation])
    return np.array([left[span == number].mean() for number in np.unique(span)])
