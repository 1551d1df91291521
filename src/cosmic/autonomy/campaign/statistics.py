"""How a campaign stands: rate, success, mean stiffness, and how long it will take."""

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.special import stdtrit  # scipy.stats takes a second to load

from cosmic.autonomy.campaign.records import FINISHED, FibreRecord, Outcome

SECONDS_AN_HOUR: Final = 3600.0
CONFIDENCE: Final = 0.975


@dataclass(frozen=True, slots=True)
class MeanEi:
    """Mean stiffness of the pulp on the scale of logarithms: the median of its fibres.

    Attributes
    ----------
    spread_ln : float
        Standard deviation of ln(EI) between fibres; nan of one.
    """

    count: int
    ei_n_m2: float
    ei_low_n_m2: float
    ei_high_n_m2: float
    spread_ln: float

    @property
    def precision_percent(self) -> float:
        """Half of the 95 % interval; infinite of fewer than two fibres."""
        if self.count < 2:
            return math.inf
        return 50.0 * (self.ei_high_n_m2 - self.ei_low_n_m2) / self.ei_n_m2


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

    @property
    def good_per_hour(self) -> float:
        """Good fibres an hour; nan before any time has gone by."""
        return self.good / self.elapsed_s * SECONDS_AN_HOUR if self.elapsed_s > 0.0 else math.nan

    @property
    def success_percent(self) -> float:
        """Good ones of those that have their end; nan before the first."""
        return 100.0 * self.good / self.done if self.done else math.nan


def mean_ei(values_n_m2: Iterable[float]) -> MeanEi:
    """Return the mean of stiffnesses with its 95 % interval, both of the logarithms."""
    logs = np.log([each for each in values_n_m2 if each > 0.0])
    count = len(logs)
    if count == 0:
        return MeanEi(0, math.nan, math.nan, math.nan, math.nan)
    middle = float(np.mean(logs))
    if count == 1:
        return MeanEi(1, math.exp(middle), 0.0, math.inf, math.nan)
    spread = float(np.std(logs, ddof=1))
    half = float(stdtrit(count - 1, CONFIDENCE)) * spread / math.sqrt(count)
    ends = math.exp(middle - half), math.exp(middle + half)
    return MeanEi(count, math.exp(middle), *ends, spread)


def progress(fibres: Sequence[FibreRecord], elapsed_s: float) -> CampaignProgress:
    """Return how a campaign with these fibres stands."""
    finished = [each for each in fibres if each.outcome in FINISHED]
    counts = Counter(each.outcome for each in fibres)
    good = [each for each in finished if each.outcome is Outcome.GOOD]
    causes = Counter(each.cause or "unknown" for each in finished if each not in good)
    return CampaignProgress(
        done=len(finished),
        good=len(good),
        doubtful=counts[Outcome.DOUBTFUL],
        failed=counts[Outcome.FAILED],
        interrupted=counts[Outcome.INTERRUPTED],
        elapsed_s=elapsed_s,
        cycle_s=float(np.median([each.duration_s for each in finished])) if finished else math.nan,
        mean=mean_ei(each.bending.ei_n_m2 for each in good if each.bending is not None),
        causes=dict(causes.most_common()),
    )
