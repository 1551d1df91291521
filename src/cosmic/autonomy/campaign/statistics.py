"""How a campaign stands: rate, success, mean stiffness, and how long it will take."""

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.special import stdtrit  # scipy.stats takes a second to load

from cosmic.autonomy.bending.budget import combined_std_ln
from cosmic.autonomy.bending.result import BendingResult
from cosmic.autonomy.campaign.records import FINISHED, FibreRecord, Outcome
from cosmic.frame.units import TWO_SIDED

MANY: Final = 10_000
"""Fibres from which on their spread is as good as known."""

SECONDS_AN_HOUR: Final = 3600.0
CONFIDENCE: Final = 0.975


@dataclass(frozen=True, slots=True)
class MeanEi:
    """Mean stiffness of the pulp on the scale of logarithms: the median of its fibres.

    Attributes
    ----------
    ei_low_n_m2, ei_high_n_m2 : float
        Its 95 % interval: by the spread between fibres, and by what all of them have in common.
    spread_ln : float
        Standard deviation of ln(EI) between fibres; nan of one.
    common_std_ln : float
        Standard uncertainty of ln(EI) that all share, such as that of the scale of the force: no
        number of fibres makes it smaller.
    """

    count: int
    ei_n_m2: float
    ei_low_n_m2: float
    ei_high_n_m2: float
    spread_ln: float
    common_std_ln: float = 0.0

    @property
    def precision_percent(self) -> float:
        """Half of the 95 % interval; infinite of fewer than two fibres."""
        if self.count < 2:
            return math.inf
        return 50.0 * (self.ei_high_n_m2 - self.ei_low_n_m2) / self.ei_n_m2

    @property
    def shared_percent(self) -> float:
        """By how much the mean may be off, upwards, by what all fibres share; with 95 %."""
        return 100.0 * math.expm1(TWO_SIDED * self.common_std_ln)


@dataclass(frozen=True, slots=True)
class CampaignProgress:
    """How a campaign stands.

    Attributes
    ----------
    done, good, doubtful, failed : int
        Fibres that have their end, and how.
    interrupted : int
        Fibres whose treatment was cut off; not among `done`.
    elapsed_s : float
        On the platform's clock, all runs together.
    cycle_s : float
        Median time of a fibre; nan before the first.
    causes : mapping
        How often fibres failed, by cause, the most frequent first.
    plates : int
        Plates on which no fibre is left that can be taken.
    """

    done: int
    good: int
    doubtful: int
    failed: int
    interrupted: int
    elapsed_s: float
    cycle_s: float
    mean: MeanEi
    causes: Mapping[str, int]
    plates: int = 0

    @property
    def good_per_hour(self) -> float:
        """Good fibres an hour; nan before any time has gone by."""
        return self.good / self.elapsed_s * SECONDS_AN_HOUR if self.elapsed_s > 0.0 else math.nan

    @property
    def success_percent(self) -> float:
        """Good ones of those that have their end; nan before the first."""
        return 100.0 * self.good / self.done if self.done else math.nan


def mean_ei(
    values_n_m2: Iterable[float],
    *,
    weights: Iterable[float] | None = None,
    common_std_ln: float = 0.0,
) -> MeanEi:
    """Return the mean of stiffnesses with its 95 % interval, both of the logarithms.

    Parameters
    ----------
    weights : iterable of float, optional
        What each value counts; all the same if None.
    common_std_ln : float
        Standard uncertainty of ln(EI) that all values share.
    """
    values = np.array([*values_n_m2], dtype=np.float64)
    counts = np.ones(len(values)) if weights is None else np.array([*weights], dtype=np.float64)
    logs, counts = np.log(values[values > 0.0]), counts[values > 0.0]
    count = len(logs)
    if count == 0:
        return MeanEi(0, math.nan, math.nan, math.nan, math.nan, common_std_ln)
    parts = counts / counts.sum()
    middle = float(parts @ logs)
    if count == 1:
        return MeanEi(1, math.exp(middle), 0.0, math.inf, math.nan, common_std_ln)
    more = count / (count - 1)
    spread = math.sqrt(float(parts @ (logs - middle) ** 2) * more)
    std = math.sqrt(float(parts**2 @ (logs - middle) ** 2) * more)
    half = math.hypot(float(stdtrit(count - 1, CONFIDENCE)) * std, TWO_SIDED * common_std_ln)
    ends = math.exp(middle - half), math.exp(middle + half)
    return MeanEi(count, math.exp(middle), *ends, spread, common_std_ln)


def common_std_ln(results: Iterable[BendingResult]) -> float:
    """Return the standard uncertainty of ln(EI) that the fibres of a campaign share, by budgets.

    It is the median of what the contributions of scale, drift and the like are in each.
    """
    stds = [combined_std_ln(each.budget, common=True) for each in results if each.budget]
    return float(np.median(stds)) if stds else 0.0


def share_interval(good: int, of: int) -> tuple[float, float]:
    """Return the 95 % interval of a share in per cent, by Wilson's score."""
    part, z2 = good / of, TWO_SIDED**2
    middle = (part + z2 / (2.0 * of)) / (1.0 + z2 / of)
    half = TWO_SIDED / (1.0 + z2 / of) * math.sqrt(part * (1.0 - part) / of + z2 / (4.0 * of**2))
    return 100.0 * max(middle - half, 0.0), 100.0 * min(middle + half, 1.0)


def fibres_needed(mean: MeanEi, precision_percent: float) -> float:
    """Return how many good fibres make the mean so precise, by the spread so far.

    Infinite where what all share is as uncertain already; nan before there are two fibres.
    """
    if mean.count < 2:
        return math.nan
    half, shared = math.log1p(precision_percent / 100.0), TWO_SIDED * mean.common_std_ln
    left = half**2 - shared**2
    if shared >= half or left == 0.0:  # as of a half width whose square is no number any more
        return math.inf
    least = (TWO_SIDED * mean.spread_ln) ** 2 / left
    if not math.isfinite(least):
        return math.inf
    needed, room = max(math.ceil(least), 2), math.sqrt(left)
    # The fewer there are the less is known of their spread: as `mean_ei` counts it.
    while needed < MANY and (
        float(stdtrit(needed - 1, CONFIDENCE)) * mean.spread_ln > room * math.sqrt(needed)
    ):
        needed += 1
    return needed


def progress(fibres: Sequence[FibreRecord], elapsed_s: float, plates: int = 0) -> CampaignProgress:
    """Return how a campaign with these fibres stands."""
    finished = [each for each in fibres if each.outcome in FINISHED]
    counts = Counter(each.outcome for each in fibres)
    good = [each for each in finished if each.outcome is Outcome.GOOD]
    results = [each.bending for each in good if each.bending is not None]
    causes = Counter(each.cause or "unknown" for each in finished if each not in good)
    return CampaignProgress(
        done=len(finished),
        good=len(good),
        doubtful=counts[Outcome.DOUBTFUL],
        failed=counts[Outcome.FAILED],
        interrupted=counts[Outcome.INTERRUPTED],
        elapsed_s=elapsed_s,
        cycle_s=float(np.median([each.duration_s for each in finished])) if finished else math.nan,
        mean=mean_ei((each.ei_n_m2 for each in results), common_std_ln=common_std_ln(results)),
        causes=dict(causes.most_common()),
        plates=plates,
    )
