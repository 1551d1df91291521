"""Constants of the twin's motorised lens and of its lamp, as config/twin.toml states them."""

from typing import Literal, Self

from pydantic import Field, model_validator

from cosmic.frame.config import StrictModel


class LensMotorSettings(StrictModel):
    """One motor of the lens; it has no switch at either end, only hard stops.

    Attributes
    ----------
    limit_counts : int
        The far stop; the near one is 0.
    start_counts : float
        Where it stands when the platform is found warm.
    initial_speed_counts_s, top_speed_counts_s, acceleration_counts_s2 : float
        A ramp from the first speed to the second and back.
    backlash_counts : int
        Play between motor and lens; the controller takes it up at the end of a way back.
    home_margin_counts : int
        How much further than the whole travel the controller runs to be sure of the stop.
    """

    limit_counts: int = Field(gt=0, lt=2**31)
    start_counts: float = Field(ge=0.0)
    initial_speed_counts_s: float = Field(gt=0.0)
    top_speed_counts_s: float = Field(gt=0.0)
    acceleration_counts_s2: float = Field(gt=0.0)
    backlash_counts: int = Field(ge=0)
    home_margin_counts: int = Field(ge=0)

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        if not self.start_counts <= self.limit_counts:
            raise ValueError("start_counts lies beyond limit_counts")
        if not self.initial_speed_counts_s <= self.top_speed_counts_s:
            raise ValueError("initial_speed_counts_s lies above top_speed_counts_s")
        return self


class LensSettings(StrictModel):
    """Both motors of the lens and their controller.

    Attributes
    ----------
    generation : int
        The protocol that the simulated controller speaks: 1 in seven bytes, 2 in text.
    """

    generation: Literal[1, 2] = 1
    zoom: LensMotorSettings
    focus: LensMotorSettings


class LightSettings(StrictModel):
    """The lamp.

    Attributes
    ----------
    start_percent : float
        How bright it is when it is switched on.
    fading_per_h : float
        Part of its light that it loses in an hour.
    """

    start_percent: float = Field(ge=0.0, le=100.0)
    fading_per_h: float = Field(default=0.0, ge=0.0, lt=1.0)
