"""What platform.toml says about ViCo: cameras, tools, the motorised lens and the lamp."""

from collections import Counter
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from cosmic.frame.config import StrictModel
from cosmic.frame.errors import ConfigError
from cosmic.vico.core.tool_settings import ToolSettings
from cosmic.vico.core.zoom_scale import ZoomPoint, ZoomScale
from cosmic.vico.hw.peripherals import LensAxis


class ZoomStepSettings(StrictModel):
    """One position of the zoom whose scale is known."""

    name: str = ""
    counts: int = Field(ge=0)
    zoom: float = Field(gt=0.0)
    scale_um_px: float = Field(gt=0.0)


class MotorLensSettings(StrictModel):
    """Section ``[vico.lens]`` of platform.toml.

    Attributes
    ----------
    homed : bool
        The controller was homed and kept under power since; it cannot be asked.
    zoom_limit_counts, focus_limit_counts : int or None
        Far ends, in place of those that the controller tells.
    timeout_s : float
        A movement that has not ended by then has failed.
    """

    backend: str = Field(default="simulated", min_length=1)
    port: str = ""
    options: dict[str, object] = Field(default_factory=dict)
    homed: bool = False
    zoom_limit_counts: int | None = Field(default=None, gt=0)
    focus_limit_counts: int | None = Field(default=None, gt=0)
    timeout_s: float = Field(default=60.0, gt=0.0)
    step: Annotated[tuple[ZoomStepSettings, ...], Field(strict=False)] = ()

    @property
    def limits_counts(self) -> dict[LensAxis, int]:
        """Far ends that are given."""
        given = {LensAxis.ZOOM: self.zoom_limit_counts, LensAxis.FOCUS: self.focus_limit_counts}
        return {axis: limit for axis, limit in given.items() if limit is not None}

    def zoom_scale(self) -> ZoomScale:
        """Return the table of the steps; raises `ConfigError`."""
        return ZoomScale(
            [ZoomPoint(each.counts, each.zoom, each.scale_um_px, each.name) for each in self.step]
        )

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        if self.backend == "navitar" and not self.port:
            raise ValueError('backend "navitar" needs a port, such as "/dev/ttyUSB0" or "COM3"')
        names = [each.name for each in self.step if each.name]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ValueError(f"two steps are named {twice[0]!r}")
        try:
            self.zoom_scale()
        except ConfigError as exc:
            raise ValueError(str(exc)) from None
        return self


class LampSettings(StrictModel):
    """Section ``[vico.light]`` of platform.toml."""

    backend: str = Field(default="simulated", min_length=1)
    port: str = ""
    options: dict[str, object] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _has_a_port(self) -> Self:
        if self.backend == "brightlight" and not self.port:
            raise ValueError('backend "brightlight" needs a port, such as "/dev/ttyUSB0" or "COM3"')
        return self


class CameraConfig(StrictModel):
    """One camera of the platform: where to find it and how it begins.

    Attributes
    ----------
    key : str
        Which camera of its backend, as `CameraInfo.key`; empty: the first that nobody else has.
    behind_lens : bool
        It looks through the motorised lens, so that its scale belongs to the zoom.
    scale_um_px : float or None
        Of an unbinned pixel, for a camera with a lens of its own.
    exposure_s, gain_db, rate_hz : float or None
        None: as the camera has it.
    trigger : str or None
        What starts an exposure; None: as the camera has it.
    algorithms : tuple of str
        Links of the chain of machine vision that are on at the start.
    """

    name: str = Field(pattern=r"^[a-z][a-z0-9_]*$")
    title: str = ""
    backend: str = Field(default="simulated", min_length=1)
    key: str = ""
    behind_lens: bool = False
    scale_um_px: float | None = Field(default=None, gt=0.0)
    exposure_s: float | None = Field(default=None, gt=0.0)
    gain_db: float | None = None
    rate_hz: float | None = Field(default=None, gt=0.0)
    binning: int = Field(default=1, ge=1, le=16)
    pixel_format: Literal["Mono8", "Mono10", "Mono12", "Mono16", "RGB8"] = "Mono8"
    trigger: Literal["free run", "software", "hardware"] | None = None
    algorithms: Annotated[tuple[str, ...], Field(strict=False)] = ("focus",)

    @property
    def shown(self) -> str:
        """What the operator reads."""
        return self.title or self.name


class VicoSettings(StrictModel):
    """Section ``[vico]`` of platform.toml.

    Attributes
    ----------
    directory : str
        Where images go; empty: where the program was started.
    calibration : str
        Folder that calibrations are kept in, beside the platform file; empty: until the end.
    plate_um : float
        Height of the sample plate in platform coordinates.
    table_axis : str
        Positioner that turns the plate; empty: none does.
    sources : tuple of str
        Films, folders of images and addresses, for the backend "opencv".
    producers : tuple of str
        GenTL producers (.cti files), for the backend "harvesters"; empty: those installed.
    options : dict of str to dict
        Settings of backends of their own, by backend.
    analysis : dict of str to dict
        Settings of algorithms of machine vision of their own, by name.
    """

    directory: str = ""
    calibration: str = ""
    plate_um: float = 0.0
    table_axis: str = ""
    sources: Annotated[tuple[str, ...], Field(strict=False)] = ()
    producers: Annotated[tuple[str, ...], Field(strict=False)] = ()
    options: dict[str, dict[str, object]] = Field(default_factory=dict)
    analysis: dict[str, dict[str, object]] = Field(default_factory=dict)
    camera: Annotated[tuple[CameraConfig, ...], Field(strict=False)] = ()
    tool: Annotated[tuple[ToolSettings, ...], Field(strict=False)] = ()
    lens: MotorLensSettings = Field(default_factory=lambda: MotorLensSettings(backend="none"))
    light: LampSettings = Field(default_factory=lambda: LampSettings(backend="none"))

    @model_validator(mode="after")
    def _names_differ(self) -> Self:
        for name, count in Counter(each.name for each in self.camera).items():
            if count > 1:
                raise ValueError(f"two cameras are named {name!r}")
        names: dict[tuple[str, str], str] = {}
        for each in self.camera:
            if each.key and (each.backend, each.key) in names:
                other = names[each.backend, each.key]
                raise ValueError(
                    f"{other!r} and {each.name!r} are the same camera, {each.key!r} of "
                    f"{each.backend!r}"
                )
            names[each.backend, each.key] = each.name
        for name, count in Counter(each.name for each in self.tool).items():
            if count > 1:
                raise ValueError(f"two tools are named {name!r}")
        return self
