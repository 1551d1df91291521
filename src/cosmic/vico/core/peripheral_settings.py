"""What platform.toml says about the motorised lens and the lamp."""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from cosmic.frame.config import StrictModel
from cosmic.frame.errors import ConfigError
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

    backend: Literal["simulated", "navitar", "none"] = "simulated"
    port: str = ""
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

    backend: Literal["simulated", "brightlight", "none"] = "simulated"
    port: str = ""

    @model_validator(mode="after")
    def _has_a_port(self) -> Self:
        if self.backend == "brightlight" and not self.port:
            raise ValueError('backend "brightlight" needs a port, such as "/dev/ttyUSB0" or "COM3"')
        return self
