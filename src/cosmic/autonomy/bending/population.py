"""What the fibres of a campaign say together of clamp, probe, sensor and each other.

The scale of the force, friction, what gives way and the place of the probe's edge are common to
all fibres; how deep the jaws clamp and how much the stiffness varies along a fibre are drawn for
each from spreads that are common. All of it is learned from all fibres and standards, and each
fibre is then assessed by what the others say.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce
from operator import add
from typing import Final

import numpy as np

from cosmic.autonomy.bending.inference import (
    VARIATIONS,
    Common,
    Evidence,
    Posterior,
    Readings,
    common_prior,
    depth_prior,
    evidence_of,
    fixed_covariance,
    laid_out,
    own_mean,
    posterior_of,
    varied_covariance,
)
from cosmic.autonomy.bending.settings import FitSettings
from cosmic.frame.arrays import Floats

MIDDLES: Final = 13
SPREADS: Final = np.array([0.2, 0.3, 0.45, 0.65, 0.9])
"""Of ln(depth) between fibres, as a part of what is not known beforehand: a sixth at least, by size
all as likely. In jaws that give way the depth goes by the fourth root of EI over the stiffness of
the wall across, and fibres of which one is twice as stiff as the other differ by so much."""

REACH: Final = 2.5
MIDDLE_PART: Final = 0.8
ROUNDS: Final = 4
TAILS: Final = 3.0
"""Degrees of freedom of Student's distribution that stands for what is known of the instrument
beforehand: where readings show that it is far from that, they are believed."""

VARIES: Final = 0.2
VARIES_SPREAD: Final = 0.7
"""Median of how much the stiffness of a kind of fibres varies along them, and spread of its
logarithm. Of paper: 10 to 30 % between places 50 to 300 um apart, weak places every 30 to 100 um.
"""

VARIES_MIDDLES: Final = np.array([0.03, 0.05, 0.08, 0.12, 0.17, 0.24, 0.33, 0.45, 0.6])
VARIES_APART: Final = np.array([0.25, 0.5, 0.9])
"""Of ln(variation): kinds of fibres that are weighed, and how unlike fibres of one kind are."""

LEAST_VARIATION: Final = 0.02
"""What varies less is taken to vary by so much where logarithms are compared."""

MOST_TAUGHT: Final = 60
"""So many fibres teach at most, of all together: what drifts errs alike in those of a day."""

LEAST_PROBABILITY: Final = 1e-3
"""Fibres that the model fits worse teach nothing."""


@dataclass(frozen=True, slots=True, eq=False)
class Assessed:
    """One fibre, with what the others say, and friction about which its spans were fitted."""

    posterior: Posterior
    evidence: Evidence
    common: Common
    friction: float


@dataclass(frozen=True, slots=True, eq=False)
class Population:
    """A campaign as it is known.

    Attributes
    ----------
    common : Common
        From all fibres and standards.
    fibres : tuple of Assessed
        In the order they were handed over; standards too.
    """

    common: Common
    fibres: tuple[Assessed, ...]


def depth_weights(settings: FitSettings, depths_um: Floats) -> tuple[Floats, Floats]:
    """Return the spreads of depth there may be: prior of each, and its weights of the depths.

    Shapes (h,) and (h, depths).
    """
    middle, spread = depth_prior(settings)
    middles = np.linspace(-REACH, REACH, MIDDLES) * MIDDLE_PART * spread
    of_middle = np.exp(-0.5 * (middles / (MIDDLE_PART * spread)) ** 2)
    logs = np.log(depths_um)
    priors, weights = [], []
    for away, weight in zip(middles, of_middle, strict=True):
        for part in SPREADS:
            each = np.exp(-0.5 * ((logs - middle - away) / (part * spread)) ** 2)
            total = float(each.sum())
            if total > 0.0:
                priors.append(weight * part)
                weights.append(each / total)
    prior = np.array(priors)
    return prior / prior.sum(), np.array(weights)


def variation_weights() -> tuple[Floats, Floats]:
    """Return the kinds of fibres there may be: prior of each, and its weights of the variations.

    Shapes (h,) and (h, variations).
    """
    logs = np.log(np.maximum(VARIATIONS, LEAST_VARIATION))
    wide = np.gradient(logs)
    priors, weights = [], []
    for middle in np.log(VARIES_MIDDLES):
        for apart in VARIES_APART:
            each = wide * np.exp(-0.5 * ((logs - middle) / apart) ** 2)
            priors.append(math.exp(-0.5 * ((middle - math.log(VARIES)) / VARIES_SPREAD) ** 2))
            weights.append(each / each.sum())
    prior = np.array(priors)
    return prior / prior.sum(), np.array(weights)


def assess(
    readings: Sequence[Readings],
    settings: FitSettings,
    *,
    friction: float | None = None,
    slides: bool = False,
) -> Population:
    """Return what the fibres of a campaign, its standards among them, say together.

    Parameters
    ----------
    friction : float, optional
        About which the spans were fitted; that of the settings if None.
    slides : bool
        The probe never sticks to fibres.
    """
    prior = common_prior(settings, friction=friction, slides=slides)
    known = [prior] * len(readings)
    variations = [_foreseen()] * len(readings)
    common, believed, assessed = prior, prior, []
    for number in range(ROUNDS):
        evidence = [
            evidence_of(each, of, settings) for each, of in zip(readings, known, strict=True)
        ]
        depths = _depths(evidence, readings, settings, variations)
        variations = _variations(evidence, readings, depths)
        weights = [
            depth[:, None] * varied for depth, varied in zip(depths, variations, strict=True)
        ]
        posteriors = [
            posterior_of(each, weight) for each, weight in zip(evidence, weights, strict=True)
        ]
        about = settings.friction if friction is None else friction
        assessed = [
            Assessed(*each, about) for each in zip(posteriors, evidence, known, strict=True)
        ]
        if number == ROUNDS - 1:
            break
        common, known = _shared(readings, assessed, weights, believed, settings)
        believed = _less_sure(prior, common)
    return Population(common, tuple(assessed))


def _less_sure(prior: Common, found: Common) -> Common:
    """Return what is known beforehand, less sure where something else was found."""
    squared = (found.mean - prior.mean) ** 2 / np.diag(prior.covariance)
    wider = np.sqrt(np.maximum((TAILS + squared) / (TAILS + 1.0), 1.0))
    return Common(prior.mean, np.asarray(prior.covariance * np.outer(wider, wider)))


def _teaches(assessed: Assessed) -> bool:
    return assessed.posterior.probability > LEAST_PROBABILITY


def _foreseen() -> Floats:
    """Return the weights of the variations of a fibre of which others tell nothing."""
    prior, of_kind = variation_weights()
    return np.asarray(prior @ of_kind)


def _depths(
    evidence: Sequence[Evidence],
    readings: Sequence[Readings],
    settings: FitSettings,
    variations: Sequence[Floats],
) -> list[Floats]:
    """Return for each fibre the weights of depths that the others speak for."""
    said = [
        np.exp(each.log_likelihood - each.log_likelihood.max()) @ varied[: each.chi2.shape[1]]
        for each, varied in zip(evidence, variations, strict=True)
    ]
    # A grip that gave way has its own depth now; a standard has it anyhow.
    alone = [each.slipped or each.certified is not None for each in readings]
    return _by_others(
        evidence, readings, said, depth_weights(settings, evidence[0].depths_um), alone
    )


def _variations(
    evidence: Sequence[Evidence], readings: Sequence[Readings], depths: Sequence[Floats]
) -> list[Floats]:
    """Return for each fibre the weights of variations that the others speak for."""
    said = [
        depth @ np.exp(each.log_likelihood - each.log_likelihood.max())
        for each, depth in zip(evidence, depths, strict=True)
    ]
    alone = [each.certified is not None for each in readings]
    return _by_others(evidence, readings, said, variation_weights(), alone)


def _by_others(
    evidence: Sequence[Evidence],
    readings: Sequence[Readings],
    said: Sequence[Floats],
    kinds: tuple[Floats, Floats],
    alone: Sequence[bool],
) -> list[Floats]:
    """Return for each fibre the weights of values that follow from what all others say of them.

    Parameters
    ----------
    said : sequence of ndarray
        How likely each value is by a fibre's readings.
    kinds : (ndarray, ndarray)
        Prior of each way the values may be spread, and its weights of the values.
    alone : sequence of bool
        What has nothing to do with the others.
    """
    prior, weights = kinds
    logs = np.zeros((len(readings), len(prior)))
    for number, (each, read) in enumerate(zip(evidence, readings, strict=True)):
        fits = each.chi2.min() < 4.0 * max(each.freedom, 1) + 10.0
        if read.certified is None and fits and len(readings) > 1:
            logs[number] = np.log(weights @ said[number] + 1e-300)
    logs = logs * _counts(int(np.count_nonzero(logs.any(axis=1))))
    total = logs.sum(axis=0) + np.log(prior)
    found = []
    for own, by_itself in zip(logs, alone, strict=True):
        left = np.log(prior) if by_itself else total - own
        kind = np.exp(left - left.max())
        found.append((kind / kind.sum()) @ weights)
    return found


def _counts(fibres: int) -> float:
    """Return as how much of a fibre each of so many counts."""
    return min(1.0, MOST_TAUGHT / max(fibres, 1))


def _shared(
    readings: Sequence[Readings],
    assessed: Sequence[Assessed],
    weights: Sequence[Floats],
    prior: Common,
    settings: FitSettings,
) -> tuple[Common, list[Common]]:
    """Return what is common by all, and by all but each."""
    precision = np.linalg.inv(prior.covariance)
    total, pulled = precision, precision @ prior.mean
    of_each = [(np.zeros_like(total), np.zeros_like(pulled))] * len(readings)
    groups = _with_one_error(readings, assessed)
    fibres = _counts(sum(math.isinf(std) for _, std in groups))
    for numbers, std in groups:
        said = [_Said.of(readings[n], assessed[n], weights[n], settings) for n in numbers]
        own, pull = reduce(add, said).with_unknown(std)
        if math.isinf(std):
            own, pull = own * fibres, pull * fibres
        total, pulled = total + own, pulled + pull
        for at, number in enumerate(numbers):
            of_each[number] = own, pull
            if others := said[:at] + said[at + 1 :]:
                left, rest = reduce(add, others).with_unknown(std)
                of_each[number] = own - left, pull - rest

    # In units of what is known beforehand: a compliance in um/uN is small beside a place in um.
    unit = np.sqrt(np.diag(prior.covariance))

    def without(own: Floats, pull: Floats) -> Common:
        scaled = np.linalg.inv((total - own) * np.outer(unit, unit))
        covariance = np.asarray(scaled * np.outer(unit, unit), dtype=np.float64)
        return Common(np.asarray(covariance @ (pulled - pull)), covariance)

    none = np.zeros_like(total), np.zeros_like(pulled)
    return without(*none), [without(*each) for each in of_each]


def _with_one_error(
    readings: Sequence[Readings], assessed: Sequence[Assessed]
) -> list[tuple[list[int], float]]:
    """Return the numbers of those whose ln(EI) is off by one and the same, and by how much it may.

    Standards with one certificate are; nothing is known of that of a fibre.
    """
    found: dict[tuple[float, float], list[int]] = {}
    alone: list[tuple[list[int], float]] = []
    for number, (read, one) in enumerate(zip(readings, assessed, strict=True)):
        if read.certified is not None:
            found.setdefault(read.certified, []).append(number)
        elif _teaches(one):
            alone.append(([number], math.inf))
    return [*alone, *((numbers, std) for (_, std), numbers in found.items())]


def said_alone(read: Readings, settings: FitSettings) -> tuple[Floats, Floats]:
    """Return what one fibre, or standard, says by itself of what is common.

    Precision and precision times mean, without what is known beforehand.
    """
    prior = common_prior(settings)
    evidence = evidence_of(read, prior, settings)
    (depth,) = _depths([evidence], [read], settings, [_foreseen()])
    weight = depth[:, None] * _foreseen()
    posterior = posterior_of(evidence, weight)
    assessed = Assessed(posterior, evidence, prior, settings.friction)
    std = math.inf if read.certified is None else read.certified[1]
    return _Said.of(read, assessed, weight, settings).with_unknown(std)


@dataclass(frozen=True, slots=True, eq=False)
class _Said:
    """What readings say of what is common, if ln(EI) were known exactly.

    Attributes
    ----------
    precision, pull : ndarray, shapes (9, 9) and (9,)
        Precision, and precision times mean.
    by_ei, ei_precision, ei_pull : ndarray, shape (9,), and float
        The same of an error of ln(EI), and what both have to do with each other.
    """

    precision: Floats
    pull: Floats
    by_ei: Floats
    ei_precision: float
    ei_pull: float

    @classmethod
    def of(
        cls, read: Readings, assessed: Assessed, weight: Floats, settings: FitSettings
    ) -> "_Said":
        """Return what one fibre says, about the depth of its clamp that is the most probable."""
        depths = assessed.evidence.depths_um
        posterior = assessed.posterior
        here = int(np.abs(np.log(depths / posterior.depth_um)).argmin())
        here = min(max(here, 1), len(depths) - 2)
        geometry = laid_out(read, settings).log_stiffness[here - 1 : here + 2, read.span]
        step = float(np.log(depths[here + 1] / depths[here - 1]))
        by_depth = (geometry[2] - geometry[0]) / step
        of_depth = weight.sum(axis=1) / weight.sum()
        logs = np.log(depths)
        middle = float(of_depth @ logs)
        variance = float(of_depth @ (logs - middle) ** 2)
        whole = fixed_covariance(read) + variance * np.outer(by_depth, by_depth)
        whole = whole + varied_covariance(read, settings)[here] * posterior.variation**2
        # A standard that the model does not fit says as much less of what is common.
        whole = whole * posterior.excess
        away = read.log_k - own_mean(read) - geometry[1] - by_depth * (middle - logs[here])
        if read.certified is not None:
            away = away - read.certified[0]
        root = np.linalg.inv(whole)
        column, by_ei = read.to_common, root.sum(axis=0)
        return cls(
            column.T @ root @ column,
            column.T @ root @ away,
            column.T @ by_ei,
            float(by_ei.sum()),
            float(by_ei @ away),
        )

    def __add__(self, other: "_Said") -> "_Said":
        """Return what both say where the error of ln(EI) is one and the same."""
        return _Said(
            self.precision + other.precision,
            self.pull + other.pull,
            self.by_ei + other.by_ei,
            self.ei_precision + other.ei_precision,
            self.ei_pull + other.ei_pull,
        )

    def with_unknown(self, std: float) -> tuple[Floats, Floats]:
        """Return precision, and precision times mean, where ln(EI) is not known so well."""
        precision = self.ei_precision + std**-2 if std > 0.0 else math.inf
        left = self.precision - np.outer(self.by_ei, self.by_ei) / precision
        return np.asarray(left), np.asarray(self.pull - self.by_ei * self.ei_pull / precision)
