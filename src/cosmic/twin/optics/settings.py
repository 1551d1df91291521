"""Constants of the twin's cameras and of how things look in their images."""

from typing import Self

from pydantic import Field, model_validator

from cosmic.frame.config import StrictModel


class SensorSettings(StrictModel):
    """The camera behind each view.

    Attributes
    ----------
    rate_hz : float
        At the full sensor.
    black_grey : float
        Grey level without light, of 255.
    noise_grey : float
        Standard deviation in the dark at 0 dB, of 255.
    shot_grey : float
        Variance that each grey level of light adds at 0 dB, of 255.
    readout_s, transfer_s : float
        From the end of the exposure until the whole frame has left the sensor, and from then
        until it is complete in the computer.
    clock_offset_s, clock_drift_ppm : float
        How far the camera's own clock is ahead at the start, and by how much it runs fast.
    """

    width_px: int = Field(gt=0)
    height_px: int = Field(gt=0)
    pixel_um: float = Field(gt=0.0)
    rate_hz: float = Field(gt=0.0)
    black_grey: float = Field(ge=0.0, lt=64.0)
    noise_grey: float = Field(ge=0.0, lt=16.0)
    shot_grey: float = Field(ge=0.0, lt=1.0)
    readout_s: float = Field(ge=0.0)
    transfer_s: float = Field(ge=0.0)
    clock_offset_s: float = Field(ge=0.0)
    clock_drift_ppm: float


class ViewSettings(StrictModel):
    """How one camera looks at the platform, from straight above.

    Attributes
    ----------
    lens : bool
        It looks through the motorised lens; otherwise zoom and focus stand at their low ends.
    rotation_deg : float
        By which the camera is turned against the platform, counter-clockwise from above.
    centre_x_um, centre_y_um : float
        Point on the plate in the middle of the image at the lowest zoom.
    zoom_shift_x_px, zoom_shift_y_px : float
        How far the image wanders on the sensor from the lowest to the highest zoom.
    magnification_low, magnification_high : float
        At the ends of the zoom; between them it grows by equal factors.
    aperture_low, aperture_high : float
        Numerical aperture there.
    dimming : float
        The image darkens with the magnification to this power.
    working_distance_um : float
        From the lens to the plate: what lies higher looks larger.
    focus_low_um, focus_high_um : float
        Height above the plate that is sharp, at the ends of the focus.
    distortion : float
        By how much the corners are moved outwards, as a part of their way from the middle.
    focus_shift_um : float
        How far the focus moves up from the lowest to the highest zoom.
    zoom_scale, zoom_shift_um, zoom_focus_um : float
        How far scale, place and focus differ from one run of the zoom to the next; standard
        deviations.
    """

    lens: bool
    rotation_deg: float
    centre_x_um: float
    centre_y_um: float
    zoom_shift_x_px: float
    zoom_shift_y_px: float
    magnification_low: float = Field(gt=0.0)
    magnification_high: float = Field(gt=0.0)
    aperture_low: float = Field(gt=0.0, lt=1.0)
    aperture_high: float = Field(gt=0.0, lt=1.0)
    dimming: float = Field(ge=0.0)
    working_distance_um: float = Field(gt=10_000.0)
    focus_low_um: float
    focus_high_um: float
    distortion: float = Field(default=0.0, gt=-0.1, lt=0.1)
    focus_shift_um: float = 0.0
    zoom_scale: float = Field(default=0.0, ge=0.0, lt=0.1)
    zoom_shift_um: float = Field(default=0.0, ge=0.0)
    zoom_focus_um: float = Field(default=0.0, ge=0.0)

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        if not self.magnification_low <= self.magnification_high:
            raise ValueError("magnification_low lies above magnification_high")
        if not self.aperture_low <= self.aperture_high:
            raise ValueError("aperture_low lies above aperture_high")
        if not self.focus_low_um <= self.focus_high_um:
            raise ValueError("focus_low_um lies above focus_high_um")
        return self


class ImageSettings(StrictModel):
    """How things look; brightness as a part of the bare plate's.

    Attributes
    ----------
    ground_grey : float
        Grey level of the bare plate, of 255, with the light at `full_percent`, an exposure of
        `full_exposure_s`, 0 dB and a magnification of 1.
    stray : float
        Light that comes from elsewhere, as a part of the lamp's at `full_percent`.
    wavelength_um : float
    wall, lumen : float
        Walls of a fibre and its hollow middle.
    wall_part : float
        How much of a fibre's width its two walls take.
    contrast : float
        Fibres darken the ground by that part of what `wall` and `lumen` say.
    steel, silicon : float
        Grippers and probe, each darker at its rim.
    hidden : tuple of str
        Links of the URDF that cameras do not see.
    uneven : float
        How much darker the corners of the image are.
    slanted : float
        How much darker the right side is than the left.
    dust_per_mm2 : float
        Specks on the plate.
    dust_um : float
        Median radius of a speck.
    scratches : int
        On the plate.
    sensor_specks : int
        Out of focus, on the glass before the sensor.
    """

    ground_grey: float = Field(gt=0.0, lt=255.0)
    full_percent: float = Field(gt=0.0, le=100.0)
    full_exposure_s: float = Field(gt=0.0)
    stray: float = Field(ge=0.0, lt=1.0)
    wavelength_um: float = Field(gt=0.0)
    wall: float = Field(ge=0.0, le=1.0)
    lumen: float = Field(ge=0.0, le=1.0)
    wall_part: float = Field(gt=0.0, lt=1.0)
    contrast: float = Field(default=1.0, gt=0.0, le=1.5)
    steel: float = Field(ge=0.0, le=1.0)
    silicon: float = Field(ge=0.0, le=1.0)
    hidden: tuple[str, ...] = Field(strict=False)
    uneven: float = Field(ge=0.0, lt=0.9)
    slanted: float = Field(ge=0.0, lt=0.9)
    dust_per_mm2: float = Field(ge=0.0, le=20.0)
    dust_um: float = Field(gt=0.0)
    scratches: int = Field(ge=0, le=200)
    sensor_specks: int = Field(ge=0, le=50)


class OpticsSettings(StrictModel):
    """Cameras, how they look at the platform, and how it looks to them."""

    camera: SensorSettings
    views: dict[str, ViewSettings]
    picture: ImageSettings
