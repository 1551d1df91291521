"""Section ``[alarms]`` of platform.toml: when the operator is warned, and whether by a sound."""

from typing import Self

from pydantic import Field, model_validator

from cosmic.frame.config import StrictModel


class AlarmLevels(StrictModel):
    """When one quantity raises an alarm; a level that is left out raises none."""

    warning: float | None = None
    critical: float | None = None
    rate_warning: float | None = Field(default=None, gt=0)
    rate_critical: float | None = Field(default=None, gt=0)


class RisingLevels(AlarmLevels):
    """Of a quantity that is bad when it is large."""

    @model_validator(mode="after")
    def _rises(self) -> Self:
        both = None not in (self.warning, self.critical)
        if both and not (self.warning or 0.0) <= (self.critical or 0.0):
            raise ValueError("warning must not lie above critical")
        return self


class FallingLevels(AlarmLevels):
    """Of a quantity that is bad when it is small."""

    @model_validator(mode="after")
    def _falls(self) -> Self:
        both = None not in (self.warning, self.critical)
        if both and not (self.critical or 0.0) <= (self.warning or 0.0):
            raise ValueError("critical must not lie above warning")
        return self


class AlarmSettings(StrictModel):
    """When there is an alarm; of a force, levels are shares of its limit."""

    sound: bool = False
    force: RisingLevels = RisingLevels(warning=0.8, critical=0.95)
    clearance_um: FallingLevels = FallingLevels()
    processor: RisingLevels = RisingLevels(warning=1.5)
    memory: RisingLevels = RisingLevels(warning=0.9, critical=0.97)
    temperature_degc: RisingLevels = RisingLevels(warning=85.0, critical=95.0)
    disk_gb: FallingLevels = FallingLevels(warning=5.0, critical=1.0)
