"""What platform.toml says about teleoperation: profiles, and what an input moves in each."""

from collections import Counter
from collections.abc import Mapping
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from cosmic.frame.config import StrictModel, not_there

Text = Annotated[str, Field(min_length=1)]
Above0 = Annotated[float, Field(gt=0)]

SPEED_KEYS = {"linear": "speed_um_s", "rotary": "speed_deg_s", "open-loop": "frequency_hz"}
TRAVEL_KEYS = {"linear": "travel_um", "rotary": "travel_deg"}


class TeleoperationAxisSettings(StrictModel):
    """What one input moves, and how."""

    input: Text
    positioner: Text
    mode: Literal["speed", "position"] = "speed"
    dead_zone: float = Field(default=0.15, ge=0, le=0.9)
    scale: float = Field(default=1.0, gt=0, le=10)
    direction: Literal[-1, 1] = 1
    speed_um_s: Above0 | None = None
    speed_deg_s: Above0 | None = None
    frequency_hz: Annotated[float, Field(gt=0)] | None = None
    travel_um: Above0 | None = None
    travel_deg: Above0 | None = None

    @property
    def speed(self) -> float | None:
        """Speed limit in the positioner's unit per second, or Hz; None: that of jogging."""
        return self.speed_um_s or self.speed_deg_s or self.frequency_hz

    @property
    def travel(self) -> float | None:
        """How far the positioner goes for a full deflection, where it follows a position."""
        return self.travel_um or self.travel_deg

    @model_validator(mode="after")
    def _travel_fits(self) -> Self:
        if (self.mode == "position") != (self.travel is not None):
            raise ValueError(
                f"{self.positioner}: travel_um or travel_deg belongs to the mode position, and only"
                " there"
            )
        return self

    def mistakes(self, kinds: Mapping[str, str]) -> list[str]:
        """Return what does not fit the positioners there are, whose kinds are given by name."""
        kind = kinds.get(self.positioner)
        if kind is None:
            return [not_there("positioner", self.positioner, kinds)]
        allowed = {SPEED_KEYS[kind], TRAVEL_KEYS.get(kind, "")}
        return [
            f"{self.positioner}: {key} does not fit, the axis is {kind}"
            for key in (*SPEED_KEYS.values(), *TRAVEL_KEYS.values())
            if getattr(self, key) is not None and key not in allowed
        ]


class TeleoperationProfileSettings(StrictModel):
    """What the inputs of a device move, under a name that the operator chooses."""

    name: Text
    fine_share: float = Field(default=0.1, gt=0, le=1)
    fine_button: str = ""
    hold_button: str = ""
    stop_button: str = ""
    axis: Annotated[tuple[TeleoperationAxisSettings, ...], Field(strict=False)]

    @model_validator(mode="after")
    def _once(self) -> Self:
        position = [each.positioner for each in self.axis if each.mode == "position"]
        wrong = [
            f"{name} follows a position, so nothing else can move it"
            for name, count in Counter(each.positioner for each in self.axis).items()
            if count > 1 and name in position
        ]
        if wrong:
            raise ValueError(f"profile {self.name!r}: {'; '.join(wrong)}")
        return self

    def mistakes(self, kinds: Mapping[str, str]) -> list[str]:
        """Return what does not fit the positioners there are, whose kinds are given by name."""
        return [
            f"teleoperation profile {self.name!r}: {text}"
            for each in self.axis
            for text in each.mistakes(kinds)
        ]


class TeleoperationSettings(StrictModel):
    """How input devices steer; all times count on the wall clock."""

    poll_hz: float = Field(default=500.0, ge=300, le=1000)
    command_hz: float = Field(default=200.0, ge=100, le=300)
    dead_man_s: float = Field(default=0.06, ge=0.03, le=0.08)
    quiet_s: float = Field(default=3.0, ge=0.1, le=60)
    force_channel: str = ""
    force_axis: Text = "y"
    force_direction: Literal[-1, 1] = 1
    feedback_un: float = Field(default=100.0, gt=0)
    soft_force_un: float = Field(default=60.0, gt=0)
    hard_force_un: float = Field(default=140.0, gt=0)
    profiles: str = "profiles.toml"
    inputs: Annotated[tuple[str, ...], Field(strict=False)] = ()
    input: dict[str, dict[str, object]] = Field(default_factory=dict)
    profile: Annotated[tuple[TeleoperationProfileSettings, ...], Field(strict=False)] = ()

    @model_validator(mode="after")
    def _fits(self) -> Self:
        wrong = [
            f"profile name {name!r} is used {count} times"
            for name, count in Counter(each.name for each in self.profile).items()
            if count > 1
        ]
        if not self.soft_force_un < self.hard_force_un:
            wrong.append("soft_force_un must lie below hard_force_un")
        if wrong:
            raise ValueError("; ".join(wrong))
        return self

    def mistakes(self, kinds: Mapping[str, str]) -> list[str]:
        """Return what does not fit the positioners there are, whose kinds are given by name."""
        return [text for each in self.profile for text in each.mistakes(kinds)]
