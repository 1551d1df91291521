"""The model of a pushed cantilever, fitted to spans one by one; each remembers the others."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.special import chdtrc  # scipy.stats takes a second to load

from cosmic.autonomy.bending.branch import (
    CLEAR_SIGMAS,
    Points,
    Rough,
    back_and_forth_percent,
    clear_points,
    lost_while_pushing,
    points_of,
    rough,
    saturated,
    through_highest,
    touched,
)
from cosmic.autonomy.bending.branch import stuck as clings
from cosmic.autonomy.bending.crept import Loads, lost
from cosmic.autonomy.bending.curved import NaturalShape, OutAndBack, PushedCurve, rubbed_of
from cosmic.autonomy.bending.freed import freed_of
from cosmic.autonomy.bending.friction import FRICTIONS_TRIED, GIVES_TRIED, LAID_FRICTION
from cosmic.autonomy.bending.response import straight
from cosmic.autonomy.bending.result import Quality, SpanFit
from cosmic.autonomy.bending.settings import FitSettings
from cosmic.autonomy.bending.span import Span
from cosmic.frame.arrays import Floats, Mask

ROUNDS: Final = 2
ENOUGH: Final = 1e-8
"""Of values and sum of squares: a change that ends a round."""

ALIKE_PART: Final = 1e-20
"""Of a column's square: what is left of one that says nothing new."""

LEAST_OF_A_BRANCH: Final = 3
LEAST_CLEAR: Final = 2
CLOSE_SIGMAS: Final = 2.5
TINY: Final = 1e-4
BRANCH_STDS: Final = (5.0, 1000.0)
BASELINE_STDS: Final = (1000.0, 10.0)
"""How little is known of each value without any point; of ln(uN/um), um, uN and uN/s."""

TYPICAL_PART: Final = 0.6
"""Of the stroke: where curves are compared."""

LESS, MORE = 0.7, 1.3
"""Of the friction that is believed: what curves are compared for."""

TURNING_PART: Final = 0.1
SLIPPED_PART: Final = 0.03
"""Of stroke and highest force: less does no harm."""

STICKS_PART: Final = 0.1
"""Of the stroke: so much farther out contact seems to end where a section askew sticks at first on
the way back. Friction that takes a fifth of what it gives way, half of what would hold it, makes
this."""

SURE_TIMES: Final = 2.0
EXPLAINED_TIMES: Final = 3.0
"""So much worse fits what leaves out something that acts."""

MOST_FRICTION: Final = 0.8
MOST_LOOP: Final = 0.9
"""Of ln(k): by how much friction on a section askew makes both ways differ."""

MODEL_PART: Final = 0.03
"""Of a stiffness: what both ways may differ by besides."""

HIGHEST_LOG: Final = 20.0
"""Of a stiffness: beyond any fibre, and short of an overflow."""

POOR_PROBABILITY: Final = 1e-4
POOR_PART: Final = 0.02
"""Of the highest force: what is left unexplained below this does no harm."""


@dataclass(frozen=True, slots=True, eq=False)
class _Found:
    """Logarithms of stiffness and hinges of each branch, baseline, drift, relaxation."""

    values: Floats
    covariance: Floats
    chi2: float
    freedom: int
    whiten: Floats
    left: Floats
    slopes: Floats


@dataclass(frozen=True, slots=True, eq=False)
class _Pushed:
    """A span that was touched, with a first look at its way out."""

    points: Points
    shape: NaturalShape
    first: Rough
    lever_um: float
    loads: Loads
    """What the fibre bears in it, whatever of that is of no use for its own fit."""

    @classmethod
    def of(
        cls, span: Span, points: Points, shape: NaturalShape, settings: FitSettings
    ) -> "_Pushed":
        first = rough(points, points.loading, points.free_force_un)
        every = points_of(span)
        # Of the way out: a way back that is cut off ends under load.
        free_un = points.free_force_un[0]
        loads = Loads.of_push(every.time_s, np.maximum(every.force_un - free_un, 0.0))
        return cls(points, shape, first, shape.lever_um(settings.offset_um), loads)

    def gives_um3(self, settings: FitSettings) -> list[float]:
        """Return how far probes give way along the fibre, those of `GIVES_TRIED`."""
        ei_un_um2 = max(self.first.k_un_um, 0.0) * self.lever_um**3 / 3.0
        return [part * ei_un_um2 / settings.side_un_um for part in GIVES_TRIED]

    def top_um(self, settings: FitSettings) -> float:
        """Return how far the probe has come from the first contact on where it turns back."""
        highest = float(np.max(self.points.force_un - self.points.free_force_un))
        come = float(np.max(self.points.probe_um)) - self.first.hinge_um
        return max(come - highest / settings.sensor_un_um, 0.0)


@dataclass(frozen=True, slots=True, eq=False)
class _Laid:
    """Curves out and back of one span.

    Attributes
    ----------
    sticks, slides : OutAndBack
        Of a contact that sticks before it slides, and of one that never sticks.
    less, more, slides_less, slides_more : OutAndBack
        The same with `LESS` and `MORE` of the friction.
    stiffer, softer : OutAndBack
        Of a contact that sticks to probes that give way along the fibre less and more, the first
        and the last of `GIVES_TRIED`.
    tried : tuple of OutAndBack
        Of a contact that sticks, with each of `GIVES_TRIED` and of `FRICTIONS_TRIED`.
    """

    sticks: OutAndBack
    slides: OutAndBack
    less: OutAndBack
    more: OutAndBack
    slides_less: OutAndBack
    slides_more: OutAndBack
    stiffer: OutAndBack
    softer: OutAndBack
    tried: tuple[OutAndBack, ...]

    @classmethod
    def of(cls, pushes: Sequence[_Pushed], settings: FitSettings, friction: float) -> "list[_Laid]":
        """Return the curves of each, laid out together."""
        if not pushes:
            return []
        most = max(friction, LAID_FRICTION)
        rubbed = rubbed_of(
            [(each.shape, each.gives_um3(settings)) for each in pushes],
            depth_um=settings.offset_um,
            radius_um=settings.radius_um,
            friction=most,
        )
        tops = [each.top_um(settings) for each in pushes]
        sides = range(len(GIVES_TRIED))
        nominal = GIVES_TRIED.index(1.0)
        near = [part * friction / most for part in (1.0, LESS, MORE)]
        tried = [each / most for each in FRICTIONS_TRIED]
        sticks = rubbed.curves(tops, parts=[*near, *tried])
        slides = rubbed.sliding(tops, parts=near)
        return [
            cls(
                sticks=sticks[0][n][nominal],
                slides=slides[0][n][nominal],
                less=sticks[1][n][nominal],
                more=sticks[2][n][nominal],
                slides_less=slides[1][n][nominal],
                slides_more=slides[2][n][nominal],
                stiffer=sticks[0][n][0],
                softer=sticks[0][n][-1],
                tried=tuple(each[n][side] for side in sides for each in sticks[len(near) :]),
            )
            for n in range(len(pushes))
        ]


class _Model:
    """Force over way of one span, both ways; the fibre relaxes, and rubs on the probe."""

    def __init__(
        self,
        pushed: _Pushed,
        settings: FitSettings,
        friction: float,
        laid: _Laid,
        others: Loads,
    ) -> None:
        points = self._points = pushed.points
        self._settings, self.friction = settings, friction
        self._first, self.length_um = pushed.first, pushed.lever_um
        self.stroke_part = (
            max(float(np.max(points.probe_um)) - pushed.first.hinge_um, 0.0) / self.length_um
        )
        self.curves, self._laid = laid.slides if settings.slides else laid.sticks, laid
        self._elapsed_s = points.time_s - points.time_s[0]
        self._lost, self.others = lost(points.time_s), others
        self._lost_of_others_un = others.lost_un(points.time_s)
        # A way back that never touches says where the baseline is, and nothing of the fibre.
        clear = clear_points(points, ~points.loading)
        self.branches = [points.loading, ~points.loading] if clear else [points.loading]
        # One point cannot tell stiffness and contact apart: the stiffness is that of the way out.
        self.tied = 0 < clear < LEAST_CLEAR

    def contact(self, values: Floats, curves: OutAndBack | None = None) -> Floats:
        force = np.zeros(len(self._points.probe_um))
        for number, branch in enumerate(self.branches):
            log_k, hinge_um = values[2 * number], values[2 * number + 1]
            ahead = self._points.probe_um[branch] - hinge_um
            force[branch] = self._force(ahead, log_k, (curves or self.curves)[number])
        # What has crept stands back from the probe: it is left sooner, and never pulls.
        lost_un = self._lost @ force + self._lost_of_others_un
        left_un = np.maximum(force - values[-1] * lost_un, 0.0)
        return np.asarray(np.where(force > 0.0, left_un, 0.0))

    def _force(self, ahead_um: Floats, log_k: float, curve: PushedCurve) -> Floats:
        return curve.force_un(
            ahead_um,
            k_un_um=math.exp(min(log_k, HIGHEST_LOG)),
            lever_um=self.length_um,
            sensor_un_um=self._settings.sensor_un_um,
        )

    def slopes(self, values: Floats) -> Floats:
        """Return the derivatives of the force to each value, shape (points, values)."""
        count = 2 * len(self.branches)
        force = np.zeros(len(self._points.probe_um))
        by_value = np.zeros((len(values), len(force)))
        for number, branch in enumerate(self.branches):
            curve, (log_k, hinge_um) = self.curves[number], values[2 * number : 2 * number + 2]
            probe = self._points.probe_um[branch]
            ahead, nearer = probe - hinge_um, probe - (hinge_um + TINY)
            here, there = self._force(np.stack([ahead, nearer]), log_k, curve)
            stiffer = self._force(ahead, log_k + TINY, curve)
            force[branch] = here
            by_value[2 * number, branch] = (stiffer - here) / TINY
            by_value[2 * number + 1, branch] = (there - here) / TINY
        lost_un = self._lost @ force + self._lost_of_others_un
        by_value[:count] -= values[-1] * (by_value[:count] @ self._lost.T)
        by_value[-1] = -lost_un
        by_value *= (force > values[-1] * lost_un) & (force > 0.0)
        by_value[-3], by_value[-2] = 1.0, self._elapsed_s
        return by_value.T

    def total(self, values: Floats, curves: OutAndBack | None = None) -> Floats:
        return np.asarray(self.contact(values, curves) + self.baseline(values), dtype=np.float64)

    def baseline(self, values: Floats) -> Floats:
        return np.asarray(values[-3] + values[-2] * self._elapsed_s, dtype=np.float64)

    def by_friction(self) -> tuple[float, float]:
        """Return how ln(k) of the ways out and back changes with friction."""
        return self._by_friction(self._laid.more, self._laid.less)

    def by_friction_sliding(self) -> tuple[float, float]:
        """Return the same where the contact never sticks."""
        return self._by_friction(self._laid.slides_more, self._laid.slides_less)

    def _by_friction(self, more: OutAndBack, less: OutAndBack) -> tuple[float, float]:
        if not self.friction > 0.0:
            return 0.0, 0.0
        out, back = self._apart(more, less)
        changed = (MORE - LESS) * self.friction
        return out / changed, back / changed

    def by_side(self) -> tuple[float, float]:
        """Return how ln(k) of the ways out and back changes with what the probe gives way aside.

        For all that it is taken to give way.
        """
        out, back = self._apart(self._laid.softer, self._laid.stiffer)
        apart = GIVES_TRIED[-1] - GIVES_TRIED[0]
        return out / apart, back / apart

    def by_sliding(self) -> tuple[float, float]:
        """Return how ln(k) of the ways out and back changes where the contact never sticks."""
        return self._apart(self._laid.slides, self._laid.sticks)

    def _apart(self, ones: OutAndBack, others: OutAndBack) -> tuple[float, float]:
        """Return how far ln(k) of two curves is apart, out and back."""
        pairs = zip(ones, others, strict=True)
        out, back = (math.log(self._typical(one) / self._typical(other)) for one, other in pairs)
        return out, back

    def tie(self) -> Floats:
        """Return what holds both ways' stiffnesses together, shape (values,)."""
        row = np.zeros(2 * len(self.branches) + 3)
        if self.tied:
            out, back = self.by_friction()
            differ = math.hypot(MOST_FRICTION * (out - back), MODEL_PART)
            row[[0, 2]] = -1.0 / differ, 1.0 / differ
        return row

    def _typical(self, curve: PushedCurve) -> float:
        reach = min(TYPICAL_PART * self.stroke_part, float(curve.deflection[-1]))
        reach = max(reach, float(curve.deflection[1]))
        return float(np.interp(reach, curve.deflection, curve.pushed))

    def single_std(self, values: Floats) -> Floats:
        """Return the noise foreseen of each reading by itself: the sensor's, and the stage's."""
        points, slope = self._points, np.zeros(len(self._points.probe_um))
        for number, branch in enumerate(self.branches):
            # Just before the hinge too: there, a stage a little ahead has touched already. It grows
            # by and by, or rounding would decide about a point that lies where it begins.
            ahead = points.probe_um - values[2 * number + 1]
            sigmas = ahead / max(self._settings.way_std_um, TINY)
            pressed = np.clip(sigmas + CLOSE_SIGMAS + 0.5, 0.0, 1.0)
            of_branch = pressed * math.exp(min(values[2 * number], HIGHEST_LOG))
            slope[branch] = of_branch[branch]
        return np.hypot(points.std_un, slope * self._settings.way_std_um)

    def stage_std_un(self, values: Floats) -> float:
        """Return what the force of the way out is off by the noise of the stage."""
        return math.exp(min(float(values[0]), HIGHEST_LOG)) * self._settings.way_std_um

    def covariance(self, values: Floats) -> Floats:
        """Return the noise foreseen: of single readings, and the zero's random walk."""
        single = self.single_std(values) ** 2
        if len(self.branches) == 2:
            single = single + self._turning(values) ** 2
        walk = np.minimum(self._elapsed_s[:, None], self._elapsed_s[None, :])
        walked = self._settings.drift_un_sqrt_s**2 * np.maximum(walk, 0.0)
        return np.asarray(np.diag(single) + walked, dtype=np.float64)

    def chi2_by_friction(self, found: "_Found") -> tuple[float, ...]:
        """Return what is left with each side and friction tried, and last if it never sticks.

        All else is sought anew, as if forces were straight lines of it.
        """
        fitted = self.contact(found.values)
        basis, _ = np.linalg.qr(found.slopes)

        def left(curves: OutAndBack) -> float:
            changed = found.left.copy()
            changed[: len(fitted)] -= found.whiten @ (self.contact(found.values, curves) - fitted)
            changed -= basis @ (basis.T @ changed)
            return float(changed @ changed)

        return tuple(left(each) for each in (*self._laid.tried, self._laid.slides))

    def _turning(self, values: Floats) -> Floats:
        """Return what is not known while the friction turns round, at the begin of the way back."""
        points, back = self._points, self.branches[1]
        ahead = points.probe_um[back] - values[3]
        both = [
            self._force(ahead, values[2 * branch], curve)
            for branch, curve in enumerate(self._laid.slides)
        ]
        top = float(np.max(points.probe_um))
        stroke = max(top - values[1], 1.0)
        found = np.zeros(len(points.probe_um))
        gone = (top - points.probe_um[back]) / (TURNING_PART * stroke)
        found[back] = np.abs(both[0] - both[1]) * np.exp(-gone)
        return found

    def fit(self) -> _Found:
        points, settings = self._points, self._settings
        baseline = points.free_force_un
        from scipy.optimize import leastsq  # half a second, at the first fit

        start: list[float] = []
        for branch in self.branches:
            first = rough(points, branch, baseline) if start else self._first
            if start and self.tied:
                first = through_highest(points, branch, baseline, math.exp(start[0]))
            start += [math.log(max(first.k_un_um, 1e-4)), first.hinge_um]
        values = np.array([*start, baseline[0], 0.0, settings.relaxation_part])
        relaxed_std = max(settings.relaxation_std_part, TINY)
        known = np.zeros(len(values))
        known[-1] = 1.0 / relaxed_std
        tie = self.tie()
        jacobian = np.eye(len(values))
        whiten, left, chi2 = jacobian, values, 0.0
        for _ in range(ROUNDS):
            root = np.linalg.cholesky(self.covariance(values))
            whiten = np.asarray(np.linalg.inv(root), dtype=np.float64)

            def misfit(tried: Floats, whiten: Floats = whiten) -> Floats:
                away = (settings.relaxation_part - tried[-1]) / relaxed_std
                left = whiten @ (points.force_un - self.total(tried))
                return np.concatenate([left, [away, -tie @ tried]])

            def slopes(tried: Floats, whiten: Floats = whiten) -> Floats:
                return np.vstack([-whiten @ self.slopes(tried), -known, -tie])

            values, _, found, _, _ = leastsq(
                misfit,
                values,
                Dfun=slopes,
                full_output=True,
                ftol=ENOUGH,
                xtol=ENOUGH,
                gtol=ENOUGH,
                maxfev=200,
            )
            jacobian, left = slopes(values), found["fvec"]
            chi2 = float((found["fvec"][:-2] ** 2).sum())
        weak = np.array([*BRANCH_STDS * len(self.branches), *BASELINE_STDS, 1.0]) ** -2.0
        information = jacobian.T @ jacobian + np.diag(weak)
        covariance = np.asarray(np.linalg.inv(information), dtype=np.float64)
        freedom = len(points.probe_um) - len(values) + 1 + int(self.tied)
        return _Found(values, covariance, chi2, freedom, whiten, left, jacobian)


def fit_spans(
    spans: Sequence[Span],
    *,
    settings: FitSettings,
    places_um: Sequence[float],
    friction: float | None = None,
) -> tuple[SpanFit, ...]:
    """Fit the spans of one grasp, one by one: the fibre comes back from the others meanwhile.

    Parameters
    ----------
    places_um : sequence of float
        Their positions along the fibre, as told in the results.
    friction : float, optional
        About which the fit is laid out; that of the settings if None.

    Raises
    ------
    BendingError
        A span is not whole, or the fibre slopes too much at the probe.
    """
    usable = [_usable(span, settings) for span in spans]
    pushed = {
        number: _Pushed.of(span, points, span.shape or straight(place_um), settings)
        for number, (span, points, place_um) in enumerate(
            zip(spans, usable, places_um, strict=True)
        )
        if touched(points, settings.drift_un_sqrt_s)
    }
    rub = settings.friction if friction is None else friction
    models = {
        number: _Model(
            each,
            settings,
            rub,
            laid,
            Loads.of_others(
                [(one.loads, one.lever_um) for one in pushed.values() if one is not each],
                each.lever_um,
            ),
        )
        for (number, each), laid in zip(
            pushed.items(), _Laid.of(list(pushed.values()), settings, rub), strict=True
        )
    }
    return tuple(
        _fitted(span, points, models.get(number), settings, place_um)
        for number, (span, points, place_um) in enumerate(
            zip(spans, usable, places_um, strict=True)
        )
    )


def _usable(span: Span, settings: FitSettings) -> Points:
    points = points_of(span)
    points = points.but(clings(points, settings.drift_un_sqrt_s))
    return points.but(_alone(points))


def _fitted(
    span: Span, points: Points, model: _Model | None, settings: FitSettings, place_um: float
) -> SpanFit:
    """Return the fit of one span; without a model it was not touched."""
    if model is None:
        peak = float(np.max(points.force_un - points.free_force_un))
        return _without_contact(span, place_um, peak)
    found = model.fit()
    fit = _span_result(span, points, model, found, place_um)
    flags = _flags(span, fit, points, settings, model, found.values)
    if flags & {Quality.SLIPPED, Quality.BROKEN, Quality.SET, Quality.HYSTERESIS}:
        # Only the way out still says something about the fibre.
        fit = replace(
            fit,
            k_un_um=fit.k_loading_un_um,
            k_std_un_um=fit.k_loading_un_um * fit.out_std_part,
        )
    return replace(fit, flags=flags)


def _alone(points: Points) -> Mask:
    """Return the points of a branch that has too few of them for a line."""
    halves = (points.loading, ~points.loading)
    return next(
        (half for half in halves if 0 < half.sum() < LEAST_OF_A_BRANCH),
        points.loading & False,
    )


def _without_contact(span: Span, place_um: float, peak_un: float) -> SpanFit:
    nan = math.nan
    return SpanFit(
        place_um=place_um,
        k_un_um=nan,
        k_std_un_um=nan,
        k_loading_un_um=nan,
        k_unloading_un_um=nan,
        hinge_um=nan,
        hinge_back_um=nan,
        baseline_un=float(np.nanmean(span.force_un)),
        drift_un_s=0.0,
        hysteresis_percent=nan,
        peak_un=peak_un,
        chi2=0.0,
        freedom=0,
        fitted_un=np.full(len(span.probe_um), nan),
        flags=frozenset({Quality.NO_CONTACT}),
    )


def _span_result(
    span: Span, points: Points, model: _Model, found: _Found, place_um: float
) -> SpanFit:
    values, both = found.values, len(model.branches) == 2
    # A scatter beyond the noise foreseen is noise that was not.
    excess = max(1.0, found.chi2 / max(found.freedom, 1))
    covariance = found.covariance * excess
    logs = values[[0, 2]] if both else values[[0]]
    spread = covariance[np.ix_([0, 2], [0, 2])] if both else covariance[:1, :1]
    weights = np.linalg.pinv(spread) @ np.ones(len(logs))
    std = math.sqrt(1.0 / weights.sum()) if weights.sum() > 0.0 else math.inf
    k = math.exp(min(float(weights @ logs / weights.sum()), HIGHEST_LOG))
    baseline, by_friction = model.baseline(values), model.by_friction()
    fitted = np.full(len(span.probe_um), math.nan)
    fitted[points.kept] = model.total(values)
    baseline_un = values[-3] + values[-2] * (span.time_s - points.time_s[0])
    freed = freed_of(
        span, baseline_un, values[-1], model.others, stage_std_un=model.stage_std_un(values)
    )
    out, back = (values[:2], values[2:4]) if both else (values[:2], (math.nan, math.nan))
    stds = np.sqrt(np.diag(covariance))
    shift = covariance[1, 1] + covariance[3, 3] - 2.0 * covariance[1, 3] if both else math.nan
    return SpanFit(
        place_um=place_um,
        k_un_um=k,
        k_std_un_um=k * std,
        k_loading_un_um=math.exp(min(out[0], HIGHEST_LOG)),
        k_unloading_un_um=math.exp(min(back[0], HIGHEST_LOG)),
        hinge_um=float(out[1]),
        hinge_back_um=float(back[1]),
        baseline_un=float(values[-3]),
        drift_un_s=float(values[-2]),
        hysteresis_percent=back_and_forth_percent(points, baseline),
        peak_un=float(np.max(points.force_un - baseline)),
        chi2=found.chi2,
        freedom=found.freedom,
        fitted_un=fitted,
        flags=frozenset(),
        out_std_part=float(stds[0]),
        back_std_part=float(stds[2]) if both else math.nan,
        branches_correlation=float(covariance[0, 2] / (stds[0] * stds[2])) if both else 0.0,
        friction=model.friction,
        by_friction=0.5 * (by_friction[0] - by_friction[1]),
        by_friction_both=0.5 * (by_friction[0] + by_friction[1]),
        by_side_out=model.by_side()[0],
        by_side_back=model.by_side()[1],
        by_friction_sliding=model.by_friction_sliding(),
        chi2_by_friction=model.chi2_by_friction(found),
        by_sliding_out=model.by_sliding()[0],
        by_sliding_back=model.by_sliding()[1],
        shift_um=float(back[1] - out[1]),
        shift_std_um=math.sqrt(shift) if shift > 0.0 else math.nan,
        relaxation_part=float(values[-1]),
        relaxation_std_part=float(stds[-1]),
        freed_log=freed[0],
        freed_std_part=freed[1],
    )


def _flags(
    span: Span,
    fit: SpanFit,
    points: Points,
    settings: FitSettings,
    model: _Model,
    values: Floats,
) -> frozenset[Quality]:
    flags = set()
    if saturated(span, settings.range_un):
        flags.add(Quality.SATURATED)
    if lost_while_pushing(points, settings.way_std_um):
        flags.add(Quality.BROKEN)
    yielded = _yielded(fit, points, settings, model, values)
    if yielded is not None:
        flags.add(yielded)
    if _differs(fit):
        flags.add(Quality.HYSTERESIS)
    if fit.k_std_un_um > fit.k_un_um * settings.soft_percent / 100.0:
        flags.add(Quality.TOO_SOFT)
    # A section askew sticks to the probe for a part of the way back, which is no line then.
    out = points.kept & span.loading
    away = span.force_un[out] - fit.fitted_un[out]
    unlikely = chdtrc(max(fit.freedom, 1), fit.chi2) < POOR_PROBABILITY
    if unlikely and float(np.sqrt(np.mean(away**2))) > POOR_PART * fit.peak_un:
        flags.add(Quality.POOR_FIT)
    return frozenset(flags)


def _differs(fit: SpanFit) -> bool:
    """Return whether loading and unloading differ by more than any friction makes them.

    A ribbon that stands askew goes up or down as it is pushed, and friction holds it: much stiffer
    on the way out than on the way back, never the other way round.
    """
    if not (
        math.isfinite(fit.back_std_part) and min(fit.k_loading_un_um, fit.k_unloading_un_um) > 0
    ):
        return False
    differs = math.log(fit.k_loading_un_um / fit.k_unloading_un_um)
    variance = fit.out_std_part**2 + fit.back_std_part**2
    variance -= 2.0 * fit.branches_correlation * fit.out_std_part * fit.back_std_part
    allowed = 2.0 * MOST_FRICTION * abs(fit.by_friction) + MODEL_PART
    allowed += CLEAR_SIGMAS * math.sqrt(max(variance, 0.0))
    return not -allowed <= differs <= allowed + MOST_LOOP


def _yielded(
    fit: SpanFit, points: Points, settings: FitSettings, model: _Model, values: Floats
) -> Quality | None:
    """Return whether the fibre slipped in the jaws or stayed bent; None: neither."""
    stroke = max(float(np.max(points.probe_um)) - fit.hinge_um, 1e-3)
    noise = fit.shift_std_um if math.isfinite(fit.shift_std_um) else math.inf
    allowed = math.hypot(CLEAR_SIGMAS * noise, SURE_TIMES * settings.reversal_um)
    at_once_um, slowly, plain = _kinds_of_yielding(points, model, values)
    best = min(at_once_um[0], slowly)
    if plain > EXPLAINED_TIMES * max(best, 1.0):
        if slowly < at_once_um[0]:
            return Quality.SET if fit.shift_um > SLIPPED_PART * stroke else None
        if at_once_um[1] > SLIPPED_PART * stroke:
            return Quality.SLIPPED
    # What gives way as the probe turns back leaves no trace on the way out.
    return Quality.SLIPPED if fit.shift_um > max(allowed, STICKS_PART * stroke) else None


def _kinds_of_yielding(
    points: Points, model: _Model, values: Floats
) -> tuple[tuple[float, float], float, float]:
    """Return how well the way out is explained by a slip at once, by yielding, and by neither.

    Each as a sum of squares for one degree of freedom; the slip with its size, um. What slips in
    the jaws does so between two readings, and what yields does so little by little from some point
    on.
    """
    out = np.flatnonzero(points.loading)
    weight = 1.0 / model.single_std(values)[out]
    base = model.slopes(values)[out][:, [0, 1, -3, -1]]
    left = (points.force_un - model.total(values))[out]
    travel, k = points.probe_um[out], math.exp(min(values[0], HIGHEST_LOG))
    freedom = max(len(out) - base.shape[1] - 2, 1)

    weighed, left = base * weight[:, None], left * weight
    known, sizes, _ = np.linalg.svd(weighed, full_matrices=False)
    known = known[:, sizes > sizes[0] * np.finfo(float).eps * len(out)]
    left = left - known @ (known.T @ left)
    plain = float(left @ left) / freedom

    def explained(more: Floats) -> tuple[float, float]:
        """Return what the best of several columns leaves, and how much of it is needed."""
        columns = more * weight[:, None]
        whole = (columns * columns).sum(axis=0)
        columns = columns - known @ (known.T @ columns)
        own = (columns * columns).sum(axis=0)
        new = own > ALIKE_PART * whole
        size = np.divide(left @ columns, own, out=np.zeros(len(own)), where=new)
        chi2 = np.where(size > 0.0, plain - size**2 * own / freedom, plain)
        best = int(np.argmin(chi2))
        return float(chi2[best]), float(max(size[best], 0.0))

    begins = np.arange(1, len(out) - 1)
    begins = begins[travel[begins] > values[1]]
    if not len(begins):
        return (plain, 0.0), plain, plain
    at_once = -k * (np.arange(len(out))[:, None] >= begins).astype(float)
    slowly = -k * np.maximum(travel[:, None] - travel[begins], 0.0)
    return explained(at_once), explained(slowly)[0], plain
