"""What a simulated camera accepts: guesses after the data sheet of the XCD-U100."""

from dataclasses import replace
from typing import Final

from cosmic.twin.optics.settings import SensorSettings
from cosmic.vico.hw.camera_checks import Sensor
from cosmic.vico.hw.interface import CameraRanges, CameraSettings, PixelFormat, Range, Trigger

HIGHEST_RATE_HZ: Final = 120.0
BINNINGS: Final = (1, 2)
X_STEP_PX: Final = 8
Y_STEP_PX: Final = 2
SMALLEST_PX: Final = 16


def sensor_of(camera: SensorSettings, binning: int) -> Sensor:
    """Return where a ROI may lie."""
    known = binning if binning in BINNINGS else 1
    return Sensor(camera.width_px // known, camera.height_px // known, X_STEP_PX, Y_STEP_PX)


def slowed(
    camera: SensorSettings, asked: CameraSettings, in_force: CameraSettings
) -> CameraSettings:
    """Return settings at a rate that a larger ROI allows, unless another rate was asked for."""
    if asked.rate_hz != in_force.rate_hz or asked.roi == in_force.roi:
        return asked
    if not SMALLEST_PX <= asked.roi.height_px <= camera.height_px:
        return asked
    return replace(asked, rate_hz=min(asked.rate_hz, _highest_hz(camera, asked)))


def _highest_hz(camera: SensorSettings, settings: CameraSettings) -> float:
    rows = max(settings.roi.height_px, SMALLEST_PX)
    return min(camera.rate_hz * camera.height_px / rows, HIGHEST_RATE_HZ)


def ranges_of(camera: SensorSettings, settings: CameraSettings) -> CameraRanges:
    """Return what it accepts with the ROI and binning of `settings`: fewer rows are read faster."""
    sensor = sensor_of(camera, settings.binning)
    return CameraRanges(
        exposure_s=Range(20e-6, 10.0),
        gain_db=Range(0.0, 18.0),
        rate_hz=Range(0.1, _highest_hz(camera, settings)),
        width_px=Range(SMALLEST_PX, sensor.width_px, X_STEP_PX),
        height_px=Range(SMALLEST_PX, sensor.height_px, Y_STEP_PX),
        binnings=BINNINGS,
        pixel_formats=(PixelFormat.MONO8, PixelFormat.MONO16),
        triggers=(Trigger.FREE_RUN, Trigger.SOFTWARE),
    )
