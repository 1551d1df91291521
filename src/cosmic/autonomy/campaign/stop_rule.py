"""When a campaign is at its end, and how long it takes until then."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

from pydantic import Field, model_validator

from cosmic.autonomy.campaign.statistics import CampaignProgress, fibres_needed
from cosmic.frame.config import StrictModel
from cosmic.frame.units import TWO_SIDED


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
    plates : int
        Plates on which no fibre is left that can be taken: each but the last is changed for the
        next.
    precision_percent : float
        Half of the 95 % interval of the mean stiffness.
    least : int
        Good fibres before `precision_percent` is looked at.
    """

    count: int | None = Field(None, ge=1)
    good: int | None = Field(None, ge=1)
    time_s: float | None = Field(None, gt=0.0)
    plates: int | None = Field(None, ge=1, le=10_000)
    precision_percent: float | None = Field(None, gt=0.0, le=100.0)
    least: int = Field(10, ge=2)

    @model_validator(mode="after")
    def _one_at_least(self) -> Self:
        rules = (self.count, self.good, self.time_s, self.plates, self.precision_percent)
        if all(each is None for each in rules):
            raise ValueError(
                "give at least one of count, good, time_s, plates and precision_percent: without "
                "any the campaign would end with the last fibre only"
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
        if rules.plates is not None and now.plates >= rules.plates:
            return f"{now.plates} {'plate' if now.plates == 1 else 'plates'} worked off"
        found = now.mean.precision_percent
        precise = rules.precision_percent is not None and found <= rules.precision_percent
        if precise and now.mean.count >= rules.least:
            return f"mean stiffness known to +/-{found:.1f} %"
        return ""

    def plan(self, now: CampaignProgress) -> str:
        """Return how many fibres make the mean as precise as wanted, in words; empty: unknown."""
        wanted = self.settings.precision_percent
        if wanted is None or now.mean.count < 2:
            return ""
        needed = fibres_needed(now.mean, wanted)
        if math.isinf(needed):
            shared = 100.0 * TWO_SIDED * now.mean.common_std_ln
            return (
                f"no number of fibres makes the mean known to ±{wanted:g} %: what all share, such "
                f"as the scale of the force, is uncertain by ±{shared:.1f} %"
            )
        return f"about {max(needed, self.settings.least):.0f} good fibres for ±{wanted:g} %"

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
        if rules.plates is not None and now.plates:
            times.append((rules.plates - now.plates) * now.elapsed_s / now.plates)
        if rules.precision_percent is not None:
            wanted = max(fibres_needed(now.mean, rules.precision_percent), rules.least)
            times.append(max(wanted - now.good, 0.0) * good_cycle)
        known_s = [each for each in times if math.isfinite(each)]
        return min(known_s) if known_s else math.nan


BEGIN, MIDDLE, END, PLATE = "begin", "middle", "end", "plate"


class StandardSchedule:
    """When the standard is due; each start of the program begins anew.

    One that could not be measured, as fibres lie too near, is due once more when the plate is
    worked off.

    Parameters
    ----------
    at : sequence of str
        Of "begin", "middle", "end" and "plate", which is each further plate, those that are wanted.
    """

    def __init__(self, at: Sequence[str]) -> None:
        self._left = [each for each in at if each != PLATE]
        self._each_plate = PLATE in at
        self._missed = ""
        self._once_more = False

    def new_plate(self) -> None:
        """Note that another plate is there."""
        self._missed = ""
        if self._each_plate and PLATE not in self._left:
            self._left.append(PLATE)

    def due(self, share: float, *, ending: bool) -> str:
        """Return what is due when a part of the campaign is over; empty: nothing."""
        if BEGIN in self._left:
            return BEGIN
        if ending:
            return END if END in self._left else self._missed
        if PLATE in self._left:
            return PLATE
        return MIDDLE if MIDDLE in self._left and share >= 0.5 else ""

    @property
    def due_once_more(self) -> str:
        """What could not be measured on this plate; empty: nothing."""
        return self._missed

    def done(self, due: str) -> None:
        """Note that it is measured, or tried."""
        self._once_more = due == self._missed
        self._missed = ""
        if due in self._left:
            self._left.remove(due)

    def not_measured(self, due: str) -> None:
        """Note that what was tried last could not be measured."""
        if not self._once_more and due != END:
            self._missed = due
