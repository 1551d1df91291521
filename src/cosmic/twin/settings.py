"""Constants of the twin, as config/twin.toml states them."""

from functools import cache
from typing import Final, Literal, Self

from pydantic import Field, model_validator

from cosmic.frame.config import StrictModel, load_model, shipped_config_dir
from cosmic.frame.units import AxisUnit
from cosmic.twin.force_settings import (
    ClimateSettings,
    ContactSettings,
    FibreSettings,
    ForceSensorSettings,
    GeometrySettings,
    PlateSettings,
    StandardSettings,
)
from cosmic.twin.handling_settings import HandlingSettings
from cosmic.twin.lens_settings import LensSettings, LightSettings
from cosmic.twin.optics.settings import OpticsSettings
from cosmic.twin.sample_settings import SampleSettings

SCU_CHANNELS: Final = 3


class StageKind(StrictModel):
    """Physics of one kind of stick-slip stage; lengths in `unit`.

    Attributes
    ----------
    low, high : float
        Hard stops.
    power_up_low, power_up_high : float
        Where a stage may stand when nobody knows where it stands.
    step_at_100v : float
        Size of one forward step at 100 V.
    threshold_v : float
        Amplitude at and below which a step has no length.
    step_noise : float
        Standard deviation of one step as a part of it.
    scale_error : float
        Standard deviation of what a stage really goes for one unit of its sensor, less one.
    reversal : float
        Play that no sensor sees: so much is lost when the direction changes.
    yaw_um : float
        How far the guideway leads a tool's tip aside over the whole travel, um.
    lag_part, lag_s : float
        Part of a way by which the tip lags behind the sensor, and how fast it creeps after.
    """

    unit: AxisUnit
    sensor: bool
    positioner_type: int = Field(ge=0)
    low: float
    high: float
    power_up_low: float
    power_up_high: float
    reference_mark: float
    coded_mark_way: float = Field(gt=0.0)
    step_at_100v: float = Field(gt=0.0)
    threshold_v: float = Field(ge=0.0, lt=15.0)
    backward_factor: float = Field(gt=0.0, le=2.0)
    step_noise: float = Field(ge=0.0, lt=0.5)
    slow_zone: float = Field(ge=0.0)
    slow_factor: float = Field(gt=0.0, le=1.0)
    target_threshold: float = Field(gt=0.0)
    reference_repeatability: float = Field(ge=0.0)
    calibration_span: float = Field(gt=0.0)
    drift_per_min_low: float = Field(ge=0.0)
    drift_per_min_high: float = Field(ge=0.0)
    scale_error: float = Field(default=0.0, ge=0.0, lt=0.1)
    reversal: float = Field(default=0.0, ge=0.0)
    yaw_um: float = Field(default=0.0, ge=0.0)
    lag_part: float = Field(default=0.0, ge=0.0, lt=0.1)
    lag_s: float = Field(default=2.0, gt=0.0)

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        if not self.low <= self.power_up_low <= self.power_up_high <= self.high:
            raise ValueError("low, power_up_low, power_up_high and high must rise")
        if not self.drift_per_min_low <= self.drift_per_min_high:
            raise ValueError("drift_per_min_low lies above drift_per_min_high")
        return self


class StageSettings(StrictModel):
    """One stage of the platform: its kind and where it stands when found warm.

    Attributes
    ----------
    safe_direction : str
        Which way it looks for its reference, as the controller's memory has it.
    power_up_low, power_up_high : float or None
        Where it may stand at power-up, when that differs from others of its kind.
    """

    kind: str
    start: float
    safe_direction: Literal["backward", "forward"] = "backward"
    power_up_low: float | None = None
    power_up_high: float | None = None

    def at_power_up(self, kind: StageKind) -> tuple[float, float]:
        """Return where it may stand at power-up, in its unit."""
        low = kind.power_up_low if self.power_up_low is None else self.power_up_low
        return low, kind.power_up_high if self.power_up_high is None else self.power_up_high


class ControllerSettings(StrictModel):
    """How the simulated SmarAct controllers and their library behave.

    `_dv` is 0.1 V, the library's own unit of amplitude.
    """

    first_serial: int = Field(ge=1, le=4_000_000_000)
    library_version: str = Field(pattern=r"^\d+\.\d+\.\d+$")
    firmware_version: str = Field(pattern=r"^\d+\.\d+\.\d+$")
    hardware_version: int
    closed_loop_frequency_hz: int = Field(ge=1, le=18500)
    amplitude_dv: int = Field(ge=150, le=1000)
    p_gain: int = Field(ge=1, le=127)
    p_gain_divisor: int = Field(ge=0, le=10)
    temperature_deg_c: int
    temperature_hot_deg_c: int
    rail_dv: int
    rail_fault_dv: int
    packet_latency_low_s: float = Field(ge=0.0)
    packet_latency_high_s: float = Field(ge=0.0)
    call_latency_low_s: float = Field(ge=0.0)
    call_latency_high_s: float = Field(ge=0.0)
    amplitude_setting_s: float = Field(ge=0.0)
    settle_low_s: float = Field(ge=0.0)
    settle_high_s: float = Field(ge=0.0)
    stall_s: float = Field(ge=0.0)
    stop_finish_s: float = Field(ge=0.0)
    reference_speed_factor: float = Field(gt=0.0, le=1.0)
    calibration_speed_factor: float = Field(gt=0.0, le=1.0)
    double_completed_share: float = Field(ge=0.0, le=1.0)
    queue_capacity: int = Field(ge=100)


class DeviceWiring(StrictModel):
    """What is plugged into one controller; "" where nothing is.

    Attributes
    ----------
    make : str
        "scu3d" with three channels, or "smaractctl" (MCS2) with up to 18.
    """

    channels: tuple[str, ...] = Field(strict=False, min_length=1, max_length=18)
    make: Literal["scu3d", "smaractctl"] = "scu3d"

    @model_validator(mode="after")
    def _as_many_as_it_has(self) -> Self:
        if self.make == "scu3d" and len(self.channels) != SCU_CHANNELS:
            raise ValueError(f"an SCU has {SCU_CHANNELS} channels, not {len(self.channels)}")
        return self


class TwinSettings(StrictModel):
    """The whole of twin.toml.

    Attributes
    ----------
    world : str
        Which world it is unless one is asked for; see `cosmic.twin.world`.
    """

    world: str = "plain"
    kinds: dict[str, StageKind]
    controller: ControllerSettings
    devices: tuple[DeviceWiring, ...] = Field(strict=False, min_length=1)
    stages: dict[str, StageSettings]
    geometry: GeometrySettings
    contact: ContactSettings
    fibres: tuple[FibreSettings, ...] = Field(default=(), strict=False)
    standards: dict[str, StandardSettings] = Field(default_factory=dict)
    plate: PlateSettings = PlateSettings()
    climate: ClimateSettings = ClimateSettings()
    handling: HandlingSettings = HandlingSettings()
    samples: dict[str, SampleSettings] = Field(default_factory=dict)
    force_sensors: dict[str, ForceSensorSettings]
    sensor_wiring: dict[str, str] = Field(default_factory=dict)
    camera_wiring: dict[str, str] = Field(default_factory=dict)
    optics: OpticsSettings
    lens: LensSettings
    light: LightSettings

    @model_validator(mode="after")
    def _tools_fit_together(self) -> Self:
        joints, grippers = self.geometry.joints, self.geometry.grippers
        used = {f"geometry.joints.{name}": drive.stage for name, drive in joints.items()}
        used |= {f"geometry.grippers.{name}": each.stage for name, each in grippers.items()}
        for key, stage in used.items():
            if stage not in self.stages:
                raise ValueError(f"{key} names {stage!r}, which is not a stage")
        for number, fibre in enumerate(self.fibres):
            if fibre.held_by and fibre.held_by not in grippers:
                raise ValueError(
                    f"fibres[{number}] is held by {fibre.held_by!r}, which is not a gripper; "
                    f"known: {', '.join(grippers)}"
                )
            if fibre.bonded_to is not None and not fibre.bonded_to < number:
                raise ValueError(f"fibres[{number}].bonded_to must be the number of one before it")
        for channel, name in self.sensor_wiring.items():
            if name not in self.force_sensors:
                raise ValueError(f"sensor_wiring.{channel}: there is no force sensor {name!r}")
        for name, sensor in self.force_sensors.items():
            if sensor.mounted_on not in ("probe", ""):
                raise ValueError(f'force_sensors.{name}.mounted_on must be "probe" or ""')
        return self

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        for name, stage in self.stages.items():
            kind = self.kinds.get(stage.kind)
            if kind is None:
                known = ", ".join(self.kinds)
                raise ValueError(f"stage {name} is of unknown kind {stage.kind!r}; known: {known}")
            if not kind.low <= stage.start <= kind.high:
                raise ValueError(
                    f"stage {name} starts at {stage.start} {kind.unit}, "
                    f"outside its travel {kind.low} to {kind.high}"
                )
            low, high = stage.at_power_up(kind)
            if not kind.low <= low <= high <= kind.high:
                raise ValueError(
                    f"stage {name}: power_up_low and power_up_high must rise inside its travel"
                )
        makes = [device.make for device in self.devices]
        if makes != sorted(makes):
            raise ValueError('devices: those of make "scu3d" come before those of "smaractctl"')
        wired = [name for device in self.devices for name in device.channels if name]
        for name in wired:
            if name not in self.stages:
                raise ValueError(f"a device is wired to {name!r}, which is not a stage")
            if wired.count(name) > 1:
                raise ValueError(f"stage {name} is wired twice")
        return self


@cache
def shipped_settings() -> TwinSettings:
    """Return the constants that ship with CoSMic.

    Raises
    ------
    ConfigError
        The shipped file was changed and is broken.
    """
    return load_model(shipped_config_dir() / "twin.toml", TwinSettings)
