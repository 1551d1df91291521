"""What platform.toml says about axes, their movements, and their links."""

import math
from collections.abc import Iterable, Mapping
from typing import Annotated, Final, Literal, Self

from pydantic import Field, model_validator

from cosmic.frame.config import StrictModel, not_there
from cosmic.frame.units import AxisUnit
from cosmic.mico.hw.interface import Channel, PositionerKind

Range = Annotated[tuple[float, float], Field(strict=False)]
Text = Annotated[str, Field(min_length=1)]

_COUNTED: Final = ("travel_um", "step_std", "end_std_um")
_SEEN: Final = ("repeatability_um", "backlash_um")


class MotionDefaults(StrictModel):
    """What a movement uses where nothing else is said; the gate compares it with the controller."""

    hold_s: Annotated[float, Field(ge=0, le=59.999)] | Literal["forever"] = "forever"
    closed_loop_frequency_hz: int = Field(default=5000, ge=1)
    steps: int = Field(default=100, ge=0)
    frequency_hz: int = Field(default=1000, ge=1)
    amplitude_v: float = Field(default=100.0, gt=0)
    distance_um: float = Field(default=100.0, gt=0)
    distance_deg: float = Field(default=1.0, gt=0)
    nominal_step_um: float = Field(default=1.5, gt=0)
    nominal_step_deg: float = Field(default=0.025, gt=0)
    largest_step_um: float = Field(default=3.0, gt=0)
    largest_step_deg: float = Field(default=0.05, gt=0)
    acceleration_um_s2: float = Field(default=100_000.0, gt=0)
    acceleration_deg_s2: float = Field(default=1_000.0, gt=0)
    approach_um: float = Field(default=20.0, ge=0)
    approach_deg: float = Field(default=0.2, ge=0)
    following_error_um: float = Field(default=20.0, gt=0)
    following_error_deg: float = Field(default=0.02, gt=0)
    line_speed_um_s: float = Field(default=500.0, gt=0)
    line_speed_deg_s: float = Field(default=0.5, gt=0)
    stop_spread_s: float = Field(default=0.05, gt=0, le=1.0)

    def acceleration(self, unit: AxisUnit) -> float:
        """Return how fast an axis picks up speed, in `unit` per second squared."""
        return self.acceleration_deg_s2 if unit == "deg" else self.acceleration_um_s2

    def following_error(self, unit: AxisUnit) -> float:
        """Return how far an axis may lag behind its setpoint, in `unit`."""
        return self.following_error_deg if unit == "deg" else self.following_error_um

    def line_speed(self, unit: AxisUnit) -> float:
        """Return the most speed along a line whose box is not clear, in `unit` per second."""
        return self.line_speed_deg_s if unit == "deg" else self.line_speed_um_s

    def nominal_step(self, unit: AxisUnit) -> float:
        """Return what a step at 100 V goes, in `unit`."""
        return self.nominal_step_deg if unit == "deg" else self.nominal_step_um

    @property
    def hold(self) -> float:
        """Hold time in seconds; inf for ever."""
        return math.inf if self.hold_s == "forever" else self.hold_s


class JogSettings(StrictModel):
    """How jogging moves: as long as a key is held, in short packets."""

    speed_um_s: float = Field(default=200.0, gt=0)
    speed_deg_s: float = Field(default=2.0, gt=0)
    frequency_hz: int = Field(default=200, ge=1)
    packet_s: float = Field(default=0.1, gt=0, le=0.1)
    look_ahead_s: float = Field(default=0.4, ge=0.1, le=5.0)
    dead_man_s: float = Field(default=0.25, ge=0.05, le=1.0)


class UndoSettings(StrictModel):
    """How a movement is taken back, and from which force on that is asked about first."""

    speed_um_s: float = Field(default=200.0, gt=0)
    speed_deg_s: float = Field(default=2.0, gt=0)
    felt_un: float = Field(default=15.0, gt=0)


class WatchSettings(StrictModel):
    """How closely positions are watched; all times but `stall_s` count on the wall clock."""

    poll_hz: float = Field(default=20.0, gt=0, le=100)
    poll_total_hz: float = Field(default=400.0, gt=0, le=2000)
    idle_poll_s: float = Field(default=0.5, ge=0.1, le=10)
    stale_s: float = Field(default=5.0, ge=1, le=60)
    stall_s: float = Field(default=5.0, ge=0.5, le=120)
    answer_s: float = Field(default=5.0, ge=0.5, le=60)
    collision_answer_s: float = Field(default=5.0, ge=0.5, le=10)
    tolerance_um: float = Field(default=2.0, gt=0)
    tolerance_deg: float = Field(default=0.01, gt=0)

    @model_validator(mode="after")
    def _polled_before_stale(self) -> Self:
        if self.stale_s < 2 * self.idle_poll_s:
            raise ValueError("stale_s must be at least twice idle_poll_s")
        return self


class PositionerSettings(StrictModel):
    """One positioner: where it is connected, what it may do and how the window shows it."""

    name: str = Field(pattern=r"^[a-z][a-z0-9_]*(\.[a-z][a-z0-9_]*)?$")
    title: str = ""
    device: int = Field(ge=0)
    channel: int = Field(ge=0, le=17)
    kind: Literal["linear", "rotary", "open-loop"]
    type: str = ""
    limits_um: Range | None = None
    limits_deg: Range | None = None
    start_um: float | None = None
    start_deg: float | None = None
    start_region_um: Range | None = None
    start_region_deg: Range | None = None
    step_um: Annotated[float, Field(gt=0)] | None = None
    travel_um: Range | None = None
    step_std: Annotated[float, Field(ge=0, le=0.3)] | None = None
    end_std_um: Annotated[float, Field(ge=0)] | None = None
    repeatability_um: Annotated[float, Field(ge=0)] | None = None
    backlash_um: float | None = None
    forward_text: Text = "+"
    backward_text: Text = "-"
    forward_key: str = ""
    backward_key: str = ""

    @property
    def address(self) -> Channel:
        """Device and channel it is connected to."""
        return Channel(self.device, self.channel)

    @property
    def positioner_kind(self) -> PositionerKind:
        """Kind as the hardware layer names it."""
        return PositionerKind(self.kind)

    @property
    def unit(self) -> AxisUnit:
        """Unit of its positions; an open-loop axis is estimated in um."""
        return "deg" if self.kind == "rotary" else "um"

    @property
    def limits(self) -> tuple[float, float] | None:
        """Soft limits in `unit`, None for an open-loop axis."""
        return self.limits_deg if self.kind == "rotary" else self.limits_um

    @property
    def start(self) -> float | None:
        """Start pose in `unit`, None where it has none."""
        return self.start_deg if self.kind == "rotary" else self.start_um

    @property
    def start_region(self) -> tuple[float, float] | None:
        """Where it may stand at power-up, in `unit`; None: anywhere in its travel."""
        return self.start_region_deg if self.kind == "rotary" else self.start_region_um

    @model_validator(mode="after")
    def _units_fit(self) -> Self:
        allowed = {
            "linear": {"limits_um", "start_um", "start_region_um", *_SEEN},
            "rotary": {"limits_deg", "start_deg", "start_region_deg"},
            "open-loop": {"start_um", "step_um", *_COUNTED},
        }[self.kind]
        regions = "start_region_um", "start_region_deg"
        for key in (
            "limits_um",
            "limits_deg",
            "start_um",
            "start_deg",
            "step_um",
            *_COUNTED,
            *_SEEN,
            *regions,
        ):
            if getattr(self, key) is not None and key not in allowed:
                raise ValueError(f"{self.name}: {key} does not fit, the axis is {self.kind}")
        if self.kind != "open-loop" and self.limits is None:
            raise ValueError(f"{self.name}: limits_{self.unit} is missing, the axis is {self.kind}")
        if self.travel_um and not self.travel_um[0] < self.travel_um[1]:
            raise ValueError(f"{self.name}: travel_um must be (low, high) with low < high")
        if self.travel_um and not self.travel_um[0] <= (self.start_um or 0.0) <= self.travel_um[1]:
            raise ValueError(f"{self.name}: start_um lies outside travel_um")
        if self.limits and not self.limits[0] < self.limits[1]:
            raise ValueError(f"{self.name}: limits must be (low, high) with low < high")
        if self.start_region and not self.start_region[0] <= self.start_region[1]:
            raise ValueError(f"{self.name}: start_region must be (low, high) with low <= high")
        if self.limits and self.start is not None:
            low, high = self.limits
            if not low <= self.start <= high:
                raise ValueError(
                    f"{self.name}: start {self.start:g} lies outside {low:g}..{high:g}"
                )
        return self


RATIO: Final = (0.001, 1000.0)
"""Smallest and largest amount of a ratio."""


class LinkSettings(StrictModel):
    """A link that is there from the start."""

    first: str
    second: str
    ratio: float = 1.0

    @model_validator(mode="after")
    def _sensible(self) -> Self:
        text = mistake(self.first, self.second, self.ratio)
        if text:
            raise ValueError(text)
        return self


def mistake(first: str, second: str, ratio: float) -> str:
    """Return what is wrong with a link; empty when nothing is."""
    low, high = RATIO
    if first == second:
        return f"{first} cannot be linked with itself"
    if not low <= abs(ratio) <= high:
        return f"{first} and {second}: the ratio {ratio:g} is not within {low:g} to {high:g}"
    return ""


def link_misfits(links: Iterable[LinkSettings], kinds: Mapping[str, str]) -> list[str]:
    """Return what is wrong with the names in `links`, a line each.

    Parameters
    ----------
    kinds : mapping of str
        "linear", "rotary" or "open-loop" of every positioner, by name.
    """
    wrong: list[str] = []
    joined: dict[str, set[str]] = {}
    for number, link in enumerate(links):
        where = f"link[{number}]"
        for name in (link.first, link.second):
            if name not in kinds:
                wrong.append(f"{where}: {not_there('positioner', name, kinds)}")
            elif kinds[name] == "open-loop":
                wrong.append(f"{where}: {name} has no sensor: it cannot be linked")
        if kinds.get(link.first, "") != kinds.get(link.second, ""):
            wrong.append(f"{where}: {link.first} and {link.second} are not of one kind")
        one, other = (joined.get(name, {name}) for name in (link.first, link.second))
        if link.second in one:
            wrong.append(f"{where}: {link.first} and {link.second} are linked already")
        joined.update(dict.fromkeys(one | other, one | other))
    return wrong
