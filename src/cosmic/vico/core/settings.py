"""What platform.toml says about ViCo."""

from collections import Counter
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from cosmic.frame.config import StrictModel
from cosmic.vico.core.peripheral_settings import LampSettings, MotorLensSettings
from cosmic.vico.core.tool_settings import ToolSettings

Backend = Literal["simulated", "aravis", "opencv", "dc1394", "harvesters"]


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
    algorithms : tuple of str
        Links of the chain of machine vision that are on at the start.
    """

    name: str = Field(pattern=r"^[a-z][a-z0-9_]*$")
    title: str = ""
    backend: Backend = "simulated"
    key: str = ""
    behind_lens: bool = False
    scale_um_px: float | None = Field(default=None, gt=0.0)
    exposure_s: float | None = Field(default=None, gt=0.0)
    gain_db: float | None = None
    rate_hz: float | None = Field(default=None, gt=0.0)
    binning: int = Field(default=1, ge=1, le=16)
    pixel_format: Literal["Mono8", "Mono10", "Mono12", "Mono16", "RGB8"] = "Mono8"
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
    """

    directory: str = ""
    calibration: str = ""
    plate_um: float = 0.0
    table_axis: str = ""
    sources: Annotated[tuple[str, ...], Field(strict=False)] = ()
    producers: Annotated[tuple[str, ...], Field(strict=False)] = ()
    camera: Annotated[tuple[CameraConfig, ...], Field(strict=False)] = ()
    tool: Annotated[tuple[ToolSettings, ...], Field(strict=False)] = ()
    lens: MotorLensSettings = Field(default_factory=lambda: MotorLensSettings(backend="none"))
    light: LampSettings = Field(default_factory=lambda: LampSettings(backend="none"))

    @model_validator(mode="after")
    def _names_differ(self) -> Self:
        for name, count in Counter(each.name for each in self.camera).items():
            if count > 1:
                raise ValueError(f"two cameras are named {name!r}")
        for name, count in Counter(each.name for each in self.tool).items():
            if count > 1:
                raise ValueError(f"two tools are named {name!r}")
        return self
