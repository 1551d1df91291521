"""What platform.toml says about DAQCo."""

from collections import Counter
from typing import Annotated, Final, Literal, Self

from pydantic import Field, model_validator

from cosmic.daqco.core.scale import VOLTS, Scale
from cosmic.daqco.hw.interface import InputMode
from cosmic.frame.config import StrictModel, not_there
from cosmic.frame.errors import ConfigError

LOWEST_RATE_HZ: Final = 10.0
HIGHEST_RATE_HZ: Final = 15_000.0
EXTREMES_V: Final = (-10.0, 10.0)
# Okabe and Ito's colours, for those who see few of them.
COLOURS: Final = ("#E69F00", "#56B4E9", "#009E73", "#F0E442", "#0072B2", "#D55E00", "#CC79A7")


class ScaleSettings(StrictModel):
    """A named polynomial from volts to the physical unit."""

    name: str = Field(min_length=1)
    unit: str = Field(min_length=1)
    coefficients: Annotated[tuple[float, ...], Field(strict=False, min_length=1, max_length=10)]

    def scale(self) -> Scale:
        """Return it as the program uses it; raises `ConfigError`."""
        return Scale(self.name, self.unit, self.coefficients)


class ChannelSettings(StrictModel):
    """One channel: which input of which board, how it is shown, and its scale."""

    name: str = Field(pattern=r"^[a-z][a-z0-9_]*(\.[a-z][a-z0-9_]*)?$")
    board: str = Field(min_length=1)
    input: str = Field(pattern=r"^ai\d+$")
    mode: Literal["rse", "nrse", "differential"] = "rse"
    active: bool = True
    low_v: float = Field(default=-10.0, ge=-10.0, le=10.0)
    high_v: float = Field(default=10.0, ge=-10.0, le=10.0)
    colour: str = Field(default=COLOURS[0], pattern=r"^#[0-9A-Fa-f]{6}$")
    scale: str = VOLTS.name

    @property
    def input_mode(self) -> InputMode:
        """How it is wired, as the hardware layer names it."""
        return InputMode(self.mode)

    @model_validator(mode="after")
    def _rises(self) -> Self:
        if not self.low_v < self.high_v:
            raise ValueError(f"{self.name}: low_v must lie below high_v")
        return self


class LimitSettings(StrictModel):
    """A force limit: crossing it stops every actuator."""

    channel: str
    low: float | None = None
    high: float | None = None
    hysteresis: float = Field(default=0.0, ge=0.0)
    armed: bool = False

    @model_validator(mode="after")
    def _says_something(self) -> Self:
        if self.low is None and self.high is None:
            raise ValueError(f"limit of {self.channel}: give low, high or both")
        if self.low is not None and self.high is not None and not self.low < self.high:
            raise ValueError(f"limit of {self.channel}: low must lie below high")
        return self


class OutputSettings(StrictModel):
    """One output that may be used: no other is ever written to."""

    name: str = Field(pattern=r"^[a-z][a-z0-9_]*(\.[a-z][a-z0-9_]*)?$")
    board: str = Field(min_length=1)
    output: str = Field(pattern=r"^(ao\d+|port\d+/line\d+)$")
    low_v: float | None = Field(default=None, ge=-10.0, le=10.0)
    high_v: float | None = Field(default=None, ge=-10.0, le=10.0)
    safe_v: float = Field(default=0.0, ge=-10.0, le=10.0)
    safe_high: bool = False
    stops: bool = True

    @property
    def analog(self) -> bool:
        """It gives a voltage; False for a digital line."""
        return self.output.startswith("ao")

    @model_validator(mode="after")
    def _has_limits(self) -> Self:
        if not self.analog:
            if self.low_v is not None or self.high_v is not None or self.safe_v:
                raise ValueError(f"{self.name}: a digital line has no voltages; give safe_high")
        elif self.low_v is None or self.high_v is None:
            raise ValueError(f"{self.name}: give low_v and high_v, the limits of what it may get")
        elif not self.low_v < self.high_v:
            raise ValueError(f"{self.name}: low_v must lie below high_v")
        elif not self.low_v <= self.safe_v <= self.high_v:
            raise ValueError(f"{self.name}: safe_v must lie within low_v and high_v")
        elif self.safe_high:
            raise ValueError(f"{self.name}: safe_high is for digital lines; give safe_v")
        return self


class CameraTriggerSettings(StrictModel):
    """A camera that exposes on the sample clock of a board."""

    camera: str = Field(min_length=1)
    board: str = Field(min_length=1)
    counter: str = Field(default="ctr0", pattern=r"^ctr\d+$")
    rate_hz: float = Field(gt=0.0, le=1000.0)


class DriverSettings(StrictModel):
    """One more driver, whose boards acquire beside those of the first."""

    backend: str = Field(min_length=1)
    options: dict[str, object] = Field(default_factory=dict)


class DaqcoSettings(StrictModel):
    """Section ``[daqco]`` of platform.toml."""

    backend: str = Field(default="simulated", min_length=1)
    options: dict[str, object] = Field(default_factory=dict)
    rate_hz: float = Field(default=1000.0, ge=LOWEST_RATE_HZ, le=HIGHEST_RATE_HZ)
    refresh_hz: float = Field(default=20.0, ge=1.0, le=300.0)
    chunk_s: float = Field(default=0.002, ge=0.001, le=0.1)
    silence_s: float = Field(default=0.1, ge=0.02, le=1.0)
    directory: str = ""
    clock_sources: dict[str, str] = Field(default_factory=dict)
    start_triggers: dict[str, str] = Field(default_factory=dict)
    clock_ppm: float = Field(default=50.0, ge=0.0, le=1000.0)
    driver: Annotated[tuple[DriverSettings, ...], Field(strict=False)] = ()
    scale: Annotated[tuple[ScaleSettings, ...], Field(strict=False)] = ()
    channel: Annotated[tuple[ChannelSettings, ...], Field(strict=False, min_length=1)]
    limit: Annotated[tuple[LimitSettings, ...], Field(strict=False)] = ()
    output: Annotated[tuple[OutputSettings, ...], Field(strict=False)] = ()

    camera_trigger: CameraTriggerSettings | None = None

    @property
    def drivers(self) -> tuple[DriverSettings, ...]:
        """All drivers, that of ``backend`` first."""
        return DriverSettings(backend=self.backend, options=self.options), *self.driver

    def scales(self) -> dict[str, Scale]:
        """Return all scales by name; raises `ConfigError`."""
        return {VOLTS.name: VOLTS, **{each.name: each.scale() for each in self.scale}}

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        wrong = [
            f"{what} {name!r} is used {count} times"
            for what, names in (
                ("channel", [each.name for each in self.channel]),
                ("scale", [each.name for each in self.scale]),
                ("input", [f"{each.board}/{each.input}" for each in self.channel]),
                ("output", [each.name for each in self.output]),
                ("output", [f"{each.board}/{each.output}" for each in self.output]),
            )
            for name, count in Counter(names).items()
            if count > 1
        ]
        try:
            known = self.scales()
        except ConfigError as exc:
            raise ValueError(str(exc)) from None
        wrong += [
            f"channel {each.name!r}: {not_there('scale', each.scale, known)}"
            for each in self.channel
            if each.scale not in known
        ]
        wrong += [
            f"driver {each.backend!r} is there twice with the same options, and so are its boards"
            for index, each in enumerate(self.drivers)
            if each in self.drivers[:index]
        ]
        channels = [each.name for each in self.channel]
        wrong += [
            f"limit: {not_there('channel', each.channel, channels)}"
            for each in self.limit
            if each.channel not in channels
        ]
        if wrong:
            raise ValueError("; ".join(wrong))
        return self
