"""Bending stiffness of a fibre from several spans of one grasp, and how far it may be believed."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from cosmic.autonomy.bending.bent_shape import ShapeFit, fitted_shape, turned_in_jaws
from cosmic.autonomy.bending.budget import budget_of
from cosmic.autonomy.bending.checks import checked
from cosmic.autonomy.bending.curved import NaturalShape
from cosmic.autonomy.bending.friction import Friction, known_friction
from cosmic.autonomy.bending.holds import UNKNOWN_HOLDS, Holds, holds_of
from cosmic.autonomy.bending.inference import (
    DRIFT,
    FRICTION,
    Posterior,
    Readings,
    common_prior,
    off_model,
    readings_of,
)
from cosmic.autonomy.bending.population import Assessed, Population, assess
from cosmic.autonomy.bending.response import (
    Direction,
    Response,
    direction_by_touch,
    response_of,
    straight,
)
from cosmic.autonomy.bending.result import (
    DRIFT_FORM,
    N_M2_PER_UN_UM2,
    UN_UM2_PER_N_M2,
    BendingError,
    BendingResult,
    Quality,
    SpanFit,
)
from cosmic.autonomy.bending.settings import FitSettings
from cosmic.autonomy.bending.span import Span
from cosmic.autonomy.bending.span_fit import fit_spans
from cosmic.autonomy.bending.standards import (
    UNKNOWN_GAIN,
    CheckedStandards,
    ForceScale,
    StandardReading,
    check_standards,
    scale_of,
)
from cosmic.frame.units import TWO_SIDED

NEAR: Final = 0.03
"""Of friction: what spans were fitted about stands for so much more and less."""
GLASS_STD: Final = 0.15
"""Of friction: that of glass less that of fibres (0.3 to 0.6, and 0.2 to 0.4 on steel)."""
NEAR_SLIDING: Final = 0.06
"""The same where contacts never stick: forces are nearly straight lines of it then."""

NEAR_GIVES: Final = 0.2
"""The same of what a probe gives way along the fibre, of its logarithm."""

MET_STD_UM: Final = 1.0
"""Of where the probe met the fibre, by the rise of the force."""
MOST_KEPT: Final = 100
MOST_FRICTIONS: Final = 8
"""So many fibres of before stay fitted, about the last frictions: they may come back."""

AGAIN: Final = 3
"""So often a campaign is fitted again at most, until friction stays."""

LEAST_FRICTION, MOST_FRICTION = 0.02, 0.8
"""Friction that is looked for."""

FARTHEST_LN: Final = 300.0
"""Of a stiffness: what lies beyond is none."""
NO_STIFFNESS: Final = "no stiffness comes of these forces: look at sensor and probe"

SPOILT: Final = frozenset(
    {
        Quality.SLIPPED,
        Quality.BROKEN,
        Quality.SET,
        Quality.HYSTERESIS,
        Quality.SATURATED,
        Quality.POOR_FIT,
        Quality.NO_CONTACT,
    }
)


@dataclass(frozen=True, slots=True)
class Certificate:
    """What is known of a standard.

    Attributes
    ----------
    ei_n_m2 : float
        Its bending stiffness.
    expanded_part : float
        Expanded uncertainty of that, k = 2, as a part of it.
    """

    ei_n_m2: float
    expanded_part: float


@dataclass(frozen=True, slots=True, eq=False)
class MeasuredFibre:
    """One fibre, span by span: what a campaign keeps for its fit.

    Attributes
    ----------
    used : tuple of int
        Spans to stand on: the good ones, else any with a stiffness.
    readings : Readings or None
        None where no span has a stiffness.
    raw : tuple of Span
        What it was measured from.
    settings : FitSettings
        With the width of the fibre.
    part : float
        Of the campaign that was over, 0 to 1.
    certificate : Certificate or None
        Of a standard.
    holds : Holds
        How far sections of the campaign are held, as far as it is known.
    friction_std : float or None
        Of a standard, how well its own friction is known; None: as the settings have it.
    slides : bool
        The probe never sticks to it.
    direction : Direction or None
        In which it leaves the jaws, by these spans.
    """

    spans: tuple[SpanFit, ...]
    used: tuple[int, ...]
    readings: Readings | None
    raw: tuple[Span, ...]
    settings: FitSettings
    part: float = 0.0
    certificate: Certificate | None = None
    holds: Holds = UNKNOWN_HOLDS
    friction_std: float | None = None
    slides: bool = False
    direction: Direction | None = None

    def at(self, part: float) -> "MeasuredFibre":
        """Return the same, measured when another part of the campaign was over."""
        if self.readings is None:
            return replace(self, part=part)
        column = self.readings.to_common.copy()
        column[:, DRIFT] = part
        return replace(self, part=part, readings=replace(self.readings, to_common=column))

    def held(self, holds: Holds) -> "MeasuredFibre":
        """Return the same, where sections of the campaign are held so far."""
        if self.readings is None or self.certificate is not None or holds == self.holds:
            return replace(self, holds=holds)
        return _read(replace(self, holds=holds), self.readings.response)

    def about(
        self, friction: float, *, gives: float = 1.0, slides: bool = False
    ) -> "MeasuredFibre":
        """Return the same, fitted about another friction.

        Parameters
        ----------
        gives : float
            How far the probe gives way along it, as a part of what the settings have.
        slides : bool
            The probe never sticks to it.
        """
        changed = {"side_un_um": self.settings.side_un_um / gives, "slides": slides}
        found = measure_fibre(
            self.raw,
            settings=self.settings.model_copy(update=changed),
            part=self.part,
            certificate=self.certificate,
            friction=friction,
            known=self.readings.response if self.readings is not None else None,
        )
        return found.held(self.holds).rubbed(slides=slides)

    def rubbed(self, *, std: float | None = None, slides: bool) -> "MeasuredFibre":
        """Return the same, where that is known of its friction."""
        found = replace(self, friction_std=std, slides=slides)
        if self.readings is None or (std, slides) == (self.friction_std, self.slides):
            return found
        return _read(found, self.readings.response)


class Refits:
    """Fibres of a campaign under way, fitted about the friction there, each of them only once.

    With every fibre the friction is known a little otherwise: as long as it stays near to that
    about which they were fitted, they stay so, and where it comes back to one of before, they are
    taken as they were. Any thread, one at a time.
    """

    def __init__(self) -> None:
        self._standards: Refits | None = None
        self._about: Friction | None = None
        # By the friction about which they were fitted, that used last at the end.
        self._kept: dict[Friction, dict[int, MeasuredFibre]] = {}

    @property
    def of_standards(self) -> "Refits":
        """Those of its standards: glass rubs otherwise."""
        if self._standards is None:
            self._standards = Refits()
        return self._standards

    def as_before(
        self, fibres: Sequence[MeasuredFibre]
    ) -> tuple[Friction | None, list[MeasuredFibre]]:
        """Return about what fibres were fitted before, and these fitted about it."""
        if self._about is None:
            return None, list(fibres)
        return self._about, self._fitted(fibres, self._about)

    def about(
        self,
        fibres: Sequence[MeasuredFibre],
        friction: float,
        *,
        gives: float = 1.0,
        slides: bool = False,
    ) -> tuple[float, list[MeasuredFibre]]:
        """Return a friction, this one or one near to it, and the fibres fitted about it.

        Parameters
        ----------
        gives, slides : float, bool
            See `MeasuredFibre.about`.
        """
        wanted = Friction(friction, 0.0, gives, slides)
        about = self._about
        if about is None or not _near(about, wanted):
            near = [each for each in self._kept if _near(each, wanted)]
            about = min(near, key=lambda each: abs(each.friction - friction), default=wanted)
        self._about = about
        return about.friction, self._fitted(fibres, about)

    def _fitted(self, fibres: Sequence[MeasuredFibre], about: Friction) -> list[MeasuredFibre]:
        before = self._kept.pop(about, {})
        # Held on to by what was fitted, no other can have the number of its raw spans.
        kept = dict(list(before.items())[-MOST_KEPT:])
        for each in fibres:
            found = before.get(id(each.raw)) or each.about(
                about.friction, gives=about.gives, slides=about.slides
            )
            kept[id(each.raw)] = found
        self._kept = {**dict(list(self._kept.items())[1 - MOST_FRICTIONS :]), about: kept}
        return [kept[id(each.raw)].at(each.part).held(each.holds) for each in fibres]


def _near(one: Friction, other: Friction) -> bool:
    """Return whether what is fitted about one stands for the other as well."""
    return (
        abs(one.friction - other.friction) <= (NEAR_SLIDING if one.slides else NEAR)
        and one.slides == other.slides
        and abs(math.log(one.gives / other.gives)) <= NEAR_GIVES
    )


def measure_fibre(
    spans: Sequence[Span],
    *,
    settings: FitSettings,
    part: float = 0.0,
    certificate: Certificate | None = None,
    friction: float | None = None,
    known: Response | None = None,
) -> MeasuredFibre:
    """Return what the spans of a fibre, or of a standard, say one by one.

    Parameters
    ----------
    part : float
        Of the campaign that was over, 0 to 1.
    friction : float, optional
        About which spans are fitted; that of the settings if None.
    known : Response, optional
        Of the same spans with the same settings: taken where the fit stands on the same of them.

    Raises
    ------
    BendingError
        There is no span, or one of them is not whole.
    """
    if not spans:
        raise BendingError("there is no span to fit: measure at least one")
    positions = positions_um(spans)
    fits = fit_spans(spans, settings=settings, places_um=positions, friction=friction)
    used = usable(fits)
    measured = MeasuredFibre(fits, used, None, tuple(spans), settings, part, certificate)
    shapes = _shapes(measured)
    if not shapes:
        return measured
    if known is None or known.shapes != shapes:
        known = response_of(shapes, depth_um=settings.offset_um)
    return _read(measured, known)


def _shapes(fibre: MeasuredFibre) -> tuple[NaturalShape, ...]:
    """Return the shapes of the spans to stand on."""
    positions = positions_um(fibre.raw)
    return tuple(fibre.raw[n].shape or straight(positions[n]) for n in fibre.used)


def _read(fibre: MeasuredFibre, response: Response) -> MeasuredFibre:
    """Return the same with the readings of its spans."""
    settings, fits = fibre.settings, [fibre.spans[n] for n in fibre.used]
    certified = None
    if fibre.certificate is not None:
        log_ei = math.log(fibre.certificate.ei_n_m2 * UN_UM2_PER_N_M2)
        certified = log_ei, fibre.certificate.expanded_part / 2.0
    direction = fibre.direction or _direction(fibre, response)
    readings = readings_of(
        fits,
        response,
        settings,
        part=fibre.part,
        certified=certified,
        direction=direction,
        slipped=any(Quality.SLIPPED in each.flags for each in fibre.spans),
        holds=fibre.holds,
        friction_std=fibre.friction_std,
        slides=fibre.slides,
    )
    return replace(fibre, readings=readings, direction=direction)


def _direction(fibre: MeasuredFibre, response: Response) -> Direction:
    """Return in which direction a fibre leaves the jaws, by where its spans were met."""
    seen = all(fibre.raw[n].shape is not None for n in fibre.used)
    return direction_by_touch(
        response.shapes if seen else (),
        np.array([fibre.spans[n].hinge_um for n in fibre.used]),
        radius_um=fibre.settings.radius_um,
        noise_um=fibre.settings.touch_std_um,
        prior_rad=math.radians(fibre.settings.direction_std_deg),
    )


def usable(fits: Sequence[SpanFit]) -> tuple[int, ...]:
    """Return the numbers of the spans to stand on: the good ones, else any with a stiffness."""
    good = tuple(n for n, fit in enumerate(fits) if not fit.flags & SPOILT and _has_value(fit))
    return good or tuple(n for n, fit in enumerate(fits) if _has_value(fit))


def _has_value(fit: SpanFit) -> bool:
    return fit.k_loading_un_um > 0.0 and 0.0 < fit.out_std_part < math.inf


def fit_bending(spans: Sequence[Span], *, settings: FitSettings | None = None) -> BendingResult:
    """Return the bending stiffness of a fibre that was pushed as a cantilever, by itself.

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
    settings = settings or FitSettings()
    return fit_campaign([measure_fibre(spans, settings=settings)], settings=settings)[0]


def fit_campaign(
    fibres: Sequence[MeasuredFibre],
    *,
    standards: Sequence[MeasuredFibre] = (),
    settings: FitSettings | None = None,
) -> tuple[BendingResult, ...]:
    """Return the bending stiffness of all fibres of a campaign, assessed together.

    Parameters
    ----------
    standards : sequence of MeasuredFibre
        Measured with their certificates; without any the sensor's certificate is in the intervals.
    """
    return assess_campaign(fibres, standards=standards, settings=settings).fibres


@dataclass(frozen=True, slots=True, eq=False)
class CampaignFit:
    """All of a campaign, assessed together.

    Attributes
    ----------
    fibres : tuple of BendingResult
        In the order they were handed over.
    standards : tuple of BendingResult
        The same of the standards, each by itself: whether it is a good measurement.
    scale : ForceScale
        How the scale of the force is known.
    friction : float
        About which the spans were fitted in the end.
    """

    fibres: tuple[BendingResult, ...]
    standards: tuple[BendingResult, ...]
    scale: ForceScale
    friction: float


def assess_campaign(
    fibres: Sequence[MeasuredFibre],
    *,
    standards: Sequence[MeasuredFibre] = (),
    settings: FitSettings | None = None,
    refits: Refits | None = None,
) -> CampaignFit:
    """Return what `fit_campaign` does, with what the standards say of the scale of the force.

    Parameters
    ----------
    standards : sequence of MeasuredFibre
        Measured with their certificates; without any the sensor's certificate is in the intervals.
    refits : Refits, optional
        Of the same campaign, assessed again and again while fibres come in: then not all are
        fitted again each time.
    """
    settings = settings or FitSettings()
    refits = refits or Refits()
    given = [*fibres, *standards]
    about, fibres, rub = _about_friction(fibres, settings, refits)
    like = rub._replace(friction=about)
    standards = _about_their_own(standards, like, settings, refits.of_standards)
    alone, found = _read_by(standards, settings)
    every, assessed = _together(fibres, standards, found, rub, about)
    if rub.slides and assessed:
        # How far the loops are open tells then, and that is no straight line: it is taken again
        # about where it lies.
        rubs = min(
            max(about + float(assessed.common.mean[FRICTION]), LEAST_FRICTION), MOST_FRICTION
        )
        about, again = refits.about(given, rubs, slides=True)
        fibres, standards = again[: len(fibres)], again[len(fibres) :]
        alone, found = _read_by(standards, settings)
        every, assessed = _together(fibres, standards, found, rub, about)
    settings, verified = found.settings, bool(found.used)
    results = _results(every[: len(fibres)], assessed, settings, verified=verified)
    common = assessed.common if assessed else common_prior(settings)
    return CampaignFit(results, alone, scale_of(common, found, verified=verified), about)


def _read_by(
    standards: Sequence[MeasuredFibre], settings: FitSettings
) -> tuple[tuple[BendingResult, ...], CheckedStandards]:
    """Return standards each by itself, and what they say of the scale of the force."""
    alone = tuple(_by_itself(each, settings) for each in standards)
    found = check_standards(
        [
            (each.readings, each.part, () if result.trusted else result.reasons)
            for each, result in zip(standards, alone, strict=True)
        ],
        settings,
    )
    read = zip(standards, alone, found.readings, strict=True)
    return tuple(_as_read(result, each.certificate, by) for each, result, by in read), found


def _together(
    fibres: Sequence[MeasuredFibre],
    standards: Sequence[MeasuredFibre],
    found: CheckedStandards,
    rub: Friction,
    about: float,
) -> tuple[list[MeasuredFibre], Population | None]:
    """Return fibres and then the standards that count, with what all of them say together."""
    every = [*_held(fibres), *(standards[n] for n in found.used)]
    every = _unsure(every, found.jump_part)
    return every, _assessed(every, found.settings, rub, friction=about)


def _fits_of(fibres: Sequence[MeasuredFibre]) -> list[SpanFit]:
    return [fit for each in fibres for fit in each.spans]


def _about_friction(
    fibres: Sequence[MeasuredFibre],
    settings: FitSettings,
    refits: Refits,
    *,
    like: Friction | None = None,
) -> tuple[float, list[MeasuredFibre], Friction]:
    """Return a friction, fibres fitted about it, and what the shapes of their curves say of it.

    Parameters
    ----------
    like : Friction, optional
        What others show that rub on the same probe: it gives way the same, and sticks as well.
    """
    before, every = refits.as_before(fibres)
    about = before or Friction(settings.friction, 0.0)
    if like and not before:
        about = like._replace(friction=refits.about(fibres, like.friction, gives=like.gives)[0])
        _, every = refits.as_before(fibres)
    rub = about
    for _ in range(AGAIN):
        gave = math.log(about.gives / (like.gives if like else 1.0))
        rub = known_friction(_fits_of(every), settings, gives_log=gave, may_slide=not like)
        rub = rub._replace(gives=rub.gives * about.gives)
        if rub.slides or _near(rub, about):
            break
        friction, every = refits.about(fibres, rub.friction, gives=rub.gives)
        about = rub._replace(friction=friction)
    return about.friction, [each.rubbed(slides=rub.slides) for each in every], rub


def _about_their_own(
    standards: Sequence[MeasuredFibre], like: Friction, settings: FitSettings, refits: Refits
) -> list[MeasuredFibre]:
    """Return standards fitted about what they show together: glass rubs otherwise than fibres."""
    if like.slides:
        return [each.rubbed(slides=True) for each in standards]
    known = {"friction": like.friction, "friction_std": math.hypot(like.std, GLASS_STD)}
    settings = settings.model_copy(update=known)
    _, every, rub = _about_friction(standards, settings, refits, like=like)
    return [each.rubbed(std=rub.std, slides=False) for each in every]


def _held(fibres: Sequence[MeasuredFibre]) -> list[MeasuredFibre]:
    """Return the same, held as their slides say together."""
    holds = holds_of([[each.spans[n] for n in each.used] for each in fibres])
    return [each.held(holds) for each in fibres]


def _results(
    fibres: Sequence[MeasuredFibre],
    assessed: Population | None,
    settings: FitSettings,
    *,
    verified: bool,
) -> tuple[BendingResult, ...]:
    """Return the results of fibres, checked one by one and by what images say of all of them."""
    each_assessed = iter(assessed.fibres if assessed else ())
    pairs = [(each, None if each.readings is None else next(each_assessed)) for each in fibres]
    seen = [{} if one is None else _seen_bent(each, one.posterior) for each, one in pairs]
    jaws = turned_in_jaws([shape for shapes in seen for shape in shapes.values()])
    return tuple(
        _nothing(each, settings)
        if each.readings is None or one is None
        else _concluded(
            each,
            each.readings,
            one,
            settings,
            verified=verified,
            by_images=[*_problems(shapes), *filter(None, [jaws])],
        )
        for (each, one), shapes in zip(pairs, seen, strict=True)
    )


def _unsure(measured: Sequence[MeasuredFibre], jump_part: float) -> list[MeasuredFibre]:
    """Return the same where the scale changed by a part between begin and end, but not known when.

    A jump anywhere between is off the even drift that is followed by so much.
    """
    return [
        each
        if each.readings is None or not jump_part
        else replace(each, readings=_with_jump(each.readings, each.part, jump_part))
        for each in measured
    ]


def _with_jump(readings: Readings, part: float, jump_part: float) -> Readings:
    std = jump_part * math.sqrt(max(part * (1.0 - part), 0.0))
    line = (DRIFT_FORM, "", np.ones(len(readings.log_k)), 0.0, std)
    return replace(readings, own=(*readings.own, line))


def _as_read(
    result: BendingResult, certificate: Certificate | None, reading: StandardReading
) -> BendingResult:
    """Return the stiffness that the sensor, by its own scale, has read of a standard."""
    if certificate is None or not math.isfinite(reading.off_part):
        return result
    ei, std = certificate.ei_n_m2 * math.exp(reading.off_part), TWO_SIDED * reading.off_std_part
    return replace(
        result, ei_n_m2=ei, ei_low_n_m2=ei * math.exp(-std), ei_high_n_m2=ei * math.exp(std)
    )


def _by_itself(standard: MeasuredFibre, settings: FitSettings) -> BendingResult:
    doubtful = {"gain_std_part": max(settings.gain_std_part, UNKNOWN_GAIN)}
    settings = settings.model_copy(update=doubtful)
    assessed = _assessed([standard], settings)
    if assessed is None or standard.readings is None:
        return _nothing(standard, settings)
    (one,) = assessed.fibres
    return _concluded(standard, standard.readings, one, settings, verified=False)


def _assessed(
    fibres: Sequence[MeasuredFibre],
    settings: FitSettings,
    rub: Friction | None = None,
    *,
    friction: float | None = None,
) -> Population | None:
    """Return what they say together, fitted about a friction, where it is known as `rub` says."""
    laid_sliding = all(each.settings.slides for each in fibres if each.certificate is None)
    slides = rub is not None and rub.slides and not laid_sliding
    if rub is not None:
        known_too = {"friction": rub.friction, "friction_std": rub.std}
        settings = settings.model_copy(update=known_too)
    known = [each.readings for each in fibres if each.readings is not None]
    return assess(known, settings, friction=friction, slides=slides) if known else None


def _concluded(
    fibre: MeasuredFibre,
    readings: Readings,
    assessed: Assessed,
    settings: FitSettings,
    *,
    verified: bool,
    by_images: Sequence[str] = (),
) -> BendingResult:
    posterior, scale = assessed.posterior, N_M2_PER_UN_UM2
    if not -FARTHEST_LN < posterior.log_low <= posterior.log_high < FARTHEST_LN:
        return replace(_nothing(fibre, settings), reasons=(NO_STIFFNESS,))
    chi2 = float(assessed.evidence.chi2.min())
    result = BendingResult(
        ei_n_m2=math.exp(posterior.log_ei) * scale,
        ei_low_n_m2=math.exp(posterior.log_low) * scale,
        ei_high_n_m2=math.exp(posterior.log_high) * scale,
        clamp_offset_um=posterior.depth_um,
        clamp_offset_std_um=posterior.depth_std_um,
        spans=_with_off_model(fibre, readings, assessed, settings),
        used=fibre.used,
        chi2=chi2,
        freedom=assessed.evidence.freedom,
        flags=frozenset(),
        trusted=True,
        reasons=(),
        budget=budget_of(readings, assessed.common, settings, posterior, assessed.evidence),
        scale_verified=verified,
    )
    return checked(result, readings, assessed, settings, by_images=by_images)


def _problems(seen: Mapping[int, ShapeFit]) -> list[str]:
    """Return what images say against single spans."""
    return [f"span {n + 1}: {each.problem}" for n, each in seen.items() if each.problem]


def _seen_bent(fibre: MeasuredFibre, posterior: Posterior) -> dict[int, ShapeFit]:
    """Return what images say of the spans to stand on, by the number of the span."""
    found, settings = {}, fibre.settings
    for number in fibre.used:
        span, bent = fibre.raw[number], fibre.raw[number].bent
        if bent is None or span.shape is None:
            continue
        gives_um = bent.force_un * (1.0 / settings.sensor_un_um + 1.0 / settings.jaw_un_um)
        pushed_um = bent.probe_um - fibre.spans[number].hinge_um - gives_um
        shape = fitted_shape(
            bent,
            span.shape,
            pushed_um=pushed_um,
            pushed_std_um=math.hypot(MET_STD_UM, gives_um),
            depth_um=posterior.depth_um,
            depth_std_um=posterior.depth_std_um,
            variation=posterior.variation,
            length_um=settings.ei_length_um,
        )
        if shape is not None:
            found[number] = shape
    return found


def _with_off_model(
    fibre: MeasuredFibre, readings: Readings, assessed: Assessed, settings: FitSettings
) -> tuple[SpanFit, ...]:
    left = off_model(
        readings, assessed.common, settings, assessed.evidence, assessed.posterior.weights
    )
    of_span = dict(zip(fibre.used, left.tolist(), strict=True))
    return tuple(
        replace(each, off_model_log=of_span.get(number, math.nan))
        for number, each in enumerate(fibre.spans)
    )


def in_time(measured: Sequence[MeasuredFibre], times_s: Sequence[float]) -> list[MeasuredFibre]:
    """Return fibres and standards with the part of the campaign that was over at each.

    Parameters
    ----------
    times_s : sequence of float
        When each was measured, all on one clock; the first is the begin, the last the end.
    """
    first = min(times_s, default=0.0)
    whole = max(times_s, default=0.0) - first
    return [
        each.at((time_s - first) / whole if whole > 0.0 else 0.0)
        for each, time_s in zip(measured, times_s, strict=True)
    ]


def measured_s(spans: Sequence[Span]) -> float:
    """Return when spans were measured: the mean of their times."""
    return float(np.mean(np.concatenate([each.time_s for each in spans])))


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


def half_width_percent(result: BendingResult) -> float:
    """Return half of the 95 % interval, as a part of the value; nan where there is none."""
    if not result.ei_n_m2 > 0.0:
        return math.nan
    return 50.0 * (result.ei_high_n_m2 - result.ei_low_n_m2) / result.ei_n_m2


def _nothing(fibre: MeasuredFibre, settings: FitSettings) -> BendingResult:
    flags = frozenset({Quality.NO_CONTACT, Quality.TOO_FEW_SPANS})
    result = BendingResult(
        ei_n_m2=math.nan,
        ei_low_n_m2=math.nan,
        ei_high_n_m2=math.nan,
        clamp_offset_um=settings.offset_um,
        clamp_offset_std_um=settings.offset_std_um,
        spans=fibre.spans,
        used=(),
        chi2=0.0,
        freedom=0,
        flags=flags,
        trusted=False,
        reasons=("0 good spans, and 2 are needed to find the clamp",),
    )
    return replace(result, flags=flags)
