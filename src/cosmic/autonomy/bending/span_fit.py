"""The model of a pushed cantilever, fitted to one span."""

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.special import chdtrc  # scipy.stats takes a second to load

from cosmic.autonomy.bending.branch import (
    CLEAR_SIGMAS,
    Mask,
    Points,
    back_and_forth_percent,
    free_force_un,
    lost_while_pushing,
    points_of,
    rises,
    rough,
    saturated,
    touched,
)
from cosmic.autonomy.bending.branch import stuck as clings
from cosmic.autonomy.bending.curved import PushedCurve
from cosmic.autonomy.bending.elastica import force_un
from cosmic.autonomy.bending.result import Floats, Quality, SpanFit
from cosmic.autonomy.bending.settings import FitSettings
from cosmic.autonomy.bending.span import Span

ROUNDS: Final = 2
LEAST_OF_A_BRANCH: Final = 3
CLOSE_SIGMAS: Final = 2.5
TINY: Final = 1e-4
BRANCH_STDS: Final = (5.0, 1000.0)
BASELINE_STDS: Final = (1000.0, 10.0)
"""How little is known of each value without any point; of ln(uN/um), um, uN and uN/s."""

HIGHEST_LOG: Final = 20.0
"""Of a stiffness: beyond any fibre, and short of an overflow."""

POOR_PROBABILITY: Final = 1e-4
POOR_PART: Final = 0.02
"""Of the highest force: what is left unexplained below this does no harm."""


@dataclass(frozen=True, slots=True, eq=False)
class _Found:
    """Logarithms of stiffness and hinges of each branch, baseline, drift; with covariance."""

    values: Floats
    covariance: Floats
    chi2: float
    freedom: int


class _Model:
    """Force over way of one span, both ways."""

    def __init__(
        self,
        points: Points,
        settings: FitSettings,
        length_um: float,
        curved: PushedCurve | None,
    ) -> None:
        self._points = points
        self._curved = curved
        self._settings = settings
        self._length_um = length_um
        self._elapsed_s = points.time_s - points.time_s[0]
        # A way back that never touches says where the baseline is, and nothing of the fibre.
        back = [~points.loading] if rises(points, ~points.loading) else []
        self.branches = [points.loading, *back]

    def contact(self, values: Floats) -> Floats:
        force = np.zeros(len(self._points.way_um))
        for number, branch in enumerate(self.branches):
            force[branch] = self._branch(branch, values[2 * number], values[2 * number + 1])
        return force

    def _branch(self, branch: Mask, log_k: float, hinge_um: float) -> Floats:
        return force_un(
            self._points.way_um[branch] - hinge_um,
            k_un_um=math.exp(min(log_k, HIGHEST_LOG)),
            span_um=self._length_um,
            radius_um=self._settings.radius_um,
            sensor_un_um=self._settings.sensor_un_um,
            curved=self._curved,
        )

    def slopes(self, values: Floats) -> Floats:
        """Return the derivatives of the force to each value, shape (points, values)."""
        found = np.zeros((len(self._points.way_um), len(values)))
        for number, branch in enumerate(self.branches):
            log_k, hinge = values[2 * number], values[2 * number + 1]
            here = self._branch(branch, log_k, hinge)
            stiffer = self._branch(branch, log_k + TINY, hinge)
            later = self._branch(branch, log_k, hinge + TINY)
            found[branch, 2 * number] = (stiffer - here) / TINY
            found[branch, 2 * number + 1] = (later - here) / TINY
        found[:, -2], found[:, -1] = 1.0, self._elapsed_s
        return found

    def total(self, values: Floats) -> Floats:
        return np.asarray(self.contact(values) + self.baseline(values), dtype=np.float64)

    def baseline(self, values: Floats) -> Floats:
        return np.asarray(values[-2] + values[-1] * self._elapsed_s, dtype=np.float64)

    def covariance(self, values: Floats) -> Floats:
        """Return the noise foreseen: readings, stage times slope, and the zero's random walk."""
        slope = np.zeros(len(self._points.way_um))
        for number, branch in enumerate(self.branches):
            # Just before the hinge too: there, a stage a little ahead has touched already.
            ahead = self._points.way_um - values[2 * number + 1]
            pressed = ahead > -CLOSE_SIGMAS * self._settings.way_std_um
            slope[branch & pressed] = math.exp(min(values[2 * number], HIGHEST_LOG))
        single = self._points.std_un**2 + (slope * self._settings.way_std_um) ** 2
        walk = np.minimum(self._elapsed_s[:, None], self._elapsed_s[None, :])
        walked = self._settings.drift_un_sqrt_s**2 * np.maximum(walk, 0.0)
        return np.asarray(np.diag(single) + walked, dtype=np.float64)

    def fit(self) -> _Found:
        points = self._points
        baseline = free_force_un(points)
        from scipy.optimize import least_squares  # half a second, at the first fit

        start: list[float] = []
        for branch in self.branches:
            first = rough(points, branch, baseline)
            start += [math.log(max(first.k_un_um, 1e-4)), first.hinge_um]
        values = np.array([*start, baseline[0], 0.0])
        chi2, jacobian = 0.0, np.eye(len(values))
        for _ in range(ROUNDS):
            root = np.linalg.cholesky(self.covariance(values))
            whiten = np.asarray(np.linalg.inv(root), dtype=np.float64)

            def misfit(tried: Floats, whiten: Floats = whiten) -> Floats:
                return np.asarray(whiten @ (points.force_un - self.total(tried)))

            def slopes(tried: Floats, whiten: Floats = whiten) -> Floats:
                return np.asarray(-whiten @ self.slopes(tried))

            found = least_squares(
                misfit, values, jac=slopes, method="lm", x_scale="jac", max_nfev=400
            )
            values, chi2, jacobian = found.x, 2.0 * float(found.cost), found.jac
        weak = np.array([*BRANCH_STDS * len(self.branches), *BASELINE_STDS]) ** -2.0
        information = jacobian.T @ jacobian + np.diag(weak)
        covariance = np.asarray(np.linalg.inv(information), dtype=np.float64)
        return _Found(values, covariance, chi2, len(points.way_um) - len(values))


def fit_span(span: Span, *, settings: FitSettings, place_um: float, length_um: float) -> SpanFit:
    """Fit one span.

    Parameters
    ----------
    place_um : float
        Its position along the fibre, as told in the result.
    length_um : float
        From the clamp to the middle of the probe, as well as it is known.

    Raises
    ------
    BendingError
        The span is not whole, or the fibre slopes too much at the probe.
    """
    points = points_of(span)
    points = points.but(clings(points, settings.drift_un_sqrt_s))
    points = points.but(_alone(points))
    if not touched(points, settings.drift_un_sqrt_s):
        peak = float(np.max(points.force_un - free_force_un(points)))
        return _without_contact(span, place_um, peak)
    curved = None
    if span.shape is not None:
        curved = span.shape.curve(depth_um=settings.offset_um, radius_um=settings.radius_um)
    model = _Model(points, settings, length_um, curved)
    found = model.fit()
    fit = _result(span, points, model, found, place_um)
    flags = _flags(span, fit, points, settings, found)
    if flags & {Quality.SLIPPED, Quality.BROKEN, Quality.HYSTERESIS}:
        # Only the way out still says something about the fibre.
        fit = replace(
            fit,
            k_un_um=fit.k_loading_un_um,
            k_std_un_um=fit.k_loading_un_um * math.sqrt(found.covariance[0, 0]),
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
        fitted_un=np.full(len(span.way_um), nan),
        flags=frozenset({Quality.NO_CONTACT}),
    )


def _result(span: Span, points: Points, model: _Model, found: _Found, place_um: float) -> SpanFit:
    values, both = found.values, len(model.branches) == 2
    logs = values[[0, 2]] if both else values[[0]]
    spread = found.covariance[np.ix_([0, 2], [0, 2])] if both else found.covariance[:1, :1]
    weights = np.linalg.pinv(spread) @ np.ones(len(logs))
    std = math.sqrt(1.0 / weights.sum()) if weights.sum() > 0.0 else math.inf
    k = math.exp(min(float(weights @ logs / weights.sum()), HIGHEST_LOG))
    baseline = model.baseline(values)
    fitted = np.full(len(span.way_um), math.nan)
    fitted[points.kept] = model.total(values)
    out, back = (values[:2], values[2:4]) if both else (values[:2], (math.nan, math.nan))
    return SpanFit(
        place_um=place_um,
        k_un_um=k,
        k_std_un_um=k * std,
        k_loading_un_um=math.exp(min(out[0], HIGHEST_LOG)),
        k_unloading_un_um=math.exp(min(back[0], HIGHEST_LOG)),
        hinge_um=float(out[1]),
        hinge_back_um=float(back[1]),
        baseline_un=float(values[-2]),
        drift_un_s=float(values[-1]),
        hysteresis_percent=back_and_forth_percent(points, baseline),
        peak_un=float(np.max(points.force_un - baseline)),
        chi2=found.chi2,
        freedom=found.freedom,
        fitted_un=fitted,
        flags=frozenset(),
    )


def _flags(
    span: Span, fit: SpanFit, points: Points, settings: FitSettings, found: _Found
) -> frozenset[Quality]:
    flags = set()
    if saturated(span, settings.range_un):
        flags.add(Quality.SATURATED)
    if lost_while_pushing(points):
        flags.add(Quality.BROKEN)
    if _shifted(fit, settings, found):
        flags.add(Quality.SLIPPED)
    noise = 100.0 * float(np.median(points.std_un)) / fit.peak_un
    if abs(fit.hysteresis_percent) > settings.hysteresis_percent + 2.0 * noise:
        flags.add(Quality.HYSTERESIS)
    if fit.k_std_un_um > fit.k_un_um * settings.soft_percent / 100.0:
        flags.add(Quality.TOO_SOFT)
    away = span.force_un[points.kept] - fit.fitted_un[points.kept]
    unlikely = chdtrc(max(fit.freedom, 1), fit.chi2) < POOR_PROBABILITY
    if unlikely and float(np.sqrt(np.mean(away**2))) > POOR_PART * fit.peak_un:
        flags.add(Quality.POOR_FIT)
    return frozenset(flags)


def _shifted(fit: SpanFit, settings: FitSettings, found: _Found) -> bool:
    """Whether contact ended elsewhere than it began."""
    if len(found.values) < 6:
        return False
    spread = found.covariance
    std = math.sqrt(max(spread[1, 1] + spread[3, 3] - 2.0 * spread[1, 3], 0.0))
    away = abs(fit.hinge_back_um - fit.hinge_um)
    return away > settings.slip_um and away > CLEAR_SIGMAS * std
