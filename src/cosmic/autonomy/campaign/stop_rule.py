"""When a campaign is at its end, and how long it takes until then."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

from pydantic import Field, model_validator

from cosmic.autonomy.campaign.statistics import CampaignProgress
from cosmic.frame.config import StrictModel


class StopSettings(StrictModel):
    """Rules of which the first that is met ends the campaign.

    Attributes
    ----------
    count : int
        Fibres that have their end, well or not.
    good : int
        Good fibres.
    time_s : float
        On the platform's clock.
    precision_percent : float
        Half of the 95 % interval of the mean stiffness.
    least : int
        Good fibres before `precision_percent` is looked at.
    """

    count: int | None = Field(None, ge=1)
    good: int | None = Field(None, ge=1)
    time_s: float | None = Field(None, gt=0.0)
    precision_percent: float | None = Field(None, gt=0.0, le=100.0)
    least: int = Field(10, ge=2)

    @model_validator(mode="after")
    def _one_at_least(self) -> Self:
        rules = (self.count, self.good, self.time_s, self.precision_percent)
        if all(each is None for each in rules):
            raise ValueError(
                "give at least one of count, good, time_s and precision_percent: without any the "
                "campaign would end with the last fibre only"
            )
        return self


@dataclass(frozen=True, slots=True)
class StopRule:
    """Looks at a campaign's progress."""

    settings: StopSettings

    def reason(self, now: CampaignProgress) -> str:
        """Return which rule is met, in words; empty: go on."""
        rules = self.settings
        if rules.count is not None and now.done >= rules.count:
            return f"{now.done} fibres done"
        if rules.good is not None and now.good >= rules.good:
            return f"{now.good} good fibres"
        if rules.time_s is not None and now.elapsed_s >= rules.time_s:
            return f"{now.elapsed_s:.0f} s have passed"
        found = now.mean.precision_percent
        precise = rules.precision_percent is not None and found <= rules.precision_percent
        if precise and now.mean.count >= rules.least:
            return f"mean stiffness known to +/-{found:.1f} %"
        return ""

    def left_s(self, now: CampaignProgress) -> float:
        """Return the time until the first rule is met, as far as can be told; nan: it cannot."""
        rules, times = self.settings, []
        cycle = now.elapsed_s / now.done if now.done else math.nan
        good_cycle = now.elapsed_s / now.good if now.good else math.nan
        if rules.count is not None:
            times.append(max(rules.count - now.done, 0) * cycle)
        if rules.good is not None:
            times.append(max(rules.good - now.good, 0) * good_cycle)
        if rules.time_s is not None:
            times.append(max(rules.time_s - now.elapsed_s, 0.0))
        if rules.precision_percent is not None:
            wanted = max(_needed(now, rules.precision_percent), rules.least)
            times.append(max(wanted - now.good, 0.0) * good_cycle)
        known_s = [each for each in times if not math.isnan(each)]
        return min(known_s) if known_s else math.nan


BEGIN, MIDDLE, END = "begin", "middle", "end"


class StandardSchedule:
    """When the standard is due; each start of the program begins anew.

    Parameters
    ----------
    at : sequence of str
        Of "begin", "middle" and "end", those that are wanted.
    """

    def __init__(self, at: Sequence[str]) -> None:
        self._left = list(at)

    def due(self, share: float, *, ending: bool) -> str:
        """Return what is due when a part of the campaign is over; empty: nothing."""
        if BEGIN in self._left:
            return BEGIN
        if ending:
            return END if END in self._left else ""
        return MIDDLE if MIDDLE in self._left and share >= 0.5 else ""

    def done(self, due: str) -> None:
        """Note that it was measured, or tried."""
        self._left.remove(due)


def _needed(now: CampaignProgress, precision_percent: float) -> float:
    """Return how many good fibres make the mean so precise, by the spread so far."""
    half = math.log1p(precision_percent / 100.0)
    return math.ceil((1.96 * now.mean.spread_ln / half) ** 2) if now.mean.count >= 2 else math.nan
