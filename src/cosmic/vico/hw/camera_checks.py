"""What every camera refuses, before its driver is asked."""

from dataclasses import dataclass

from cosmic.frame.errors import ConfigError, DeviceError, DeviceFault
from cosmic.vico.hw.interface import CameraRanges, CameraSettings, Range, Roi

# An exposure of exactly one period is accepted, whatever the last digit of 1 / rate.
_ROUNDING = 1e-6


@dataclass(frozen=True, slots=True)
class Sensor:
    """Where a ROI may lie.

    Attributes
    ----------
    width_px, height_px : int
        Of the whole sensor with the binning asked for.
    x_step_px, y_step_px : int
        A ROI's corner lies on multiples of these.
    """

    width_px: int
    height_px: int
    x_step_px: int = 1
    y_step_px: int = 1


def check_settings(
    name: str,
    asked: CameraSettings,
    in_force: CameraSettings,
    ranges: CameraRanges,
    sensor: Sensor,
    *,
    running: bool = False,
) -> None:
    """Refuse settings that a camera does not accept; what it cannot change must stay as it is.

    Parameters
    ----------
    name : str
        Of the camera, for the text.
    running : bool
        It takes pictures: only exposure, gain and rate may differ from those in force.

    Raises
    ------
    ConfigError
        A value is refused.
    DeviceError
        `DeviceFault.BUSY`: it must be stopped first.
    """
    _check_value(name, "exposure", "s", asked.exposure_s, in_force.exposure_s, ranges.exposure_s)
    _check_value(name, "gain", "dB", asked.gain_db, in_force.gain_db, ranges.gain_db)
    _check_value(name, "rate", "Hz", asked.rate_hz, in_force.rate_hz, ranges.rate_hz)
    _check_choice(name, "binning", asked.binning, ranges.binnings)
    _check_choice(name, "pixel format", asked.pixel_format, ranges.pixel_formats)
    _check_choice(name, "trigger", asked.trigger, ranges.triggers)
    check_roi(name, asked.roi, ranges, sensor)
    _check_period(name, asked, ranges)
    if running:
        _check_unchanged(name, asked, in_force)


def check_roi(name: str, roi: Roi, ranges: CameraRanges, sensor: Sensor) -> None:
    """Refuse a ROI off the sensor, too small, or between the steps; raises `ConfigError`."""
    sides = (
        ("x", roi.x_px, roi.width_px, sensor.width_px, sensor.x_step_px, ranges.width_px),
        ("y", roi.y_px, roi.height_px, sensor.height_px, sensor.y_step_px, ranges.height_px),
    )
    for axis, start, size, whole, start_step, sizes in sides:
        side = (
            f"{name}: ROI: {'width' if axis == 'x' else 'height'} {size!r} px at {axis} {start!r}"
        )
        if not sizes.low <= size <= whole:
            raise ConfigError(f"{side}: the camera takes {sizes.low:g} to {whole} px")
        if not 0 <= start <= whole - size:
            raise ConfigError(
                f"{side} reaches off the sensor of {sensor.width_px} x {sensor.height_px} px: "
                f"{axis} may lie between 0 and {whole - size}"
            )
        if start % start_step:
            raise ConfigError(f"{side}: {axis} must be a multiple of {start_step}")
        if sizes.step and (size - sizes.low) % sizes.step:
            raise ConfigError(
                f"{side}: the size goes from {sizes.low:g} px up in steps of {sizes.step:g}"
            )


def _check_value(
    name: str, what: str, unit: str, asked: float, in_force: float, allowed: Range | None
) -> None:
    if allowed is None:
        if asked != in_force:
            raise ConfigError(
                f"{name}: {what} {asked:g} {unit}: this camera's {what} cannot be set; "
                f"leave it at {in_force:g}"
            )
    elif not allowed.low <= asked <= allowed.high:
        raise ConfigError(
            f"{name}: {what} {asked:g} {unit}: the camera takes "
            f"{allowed.low:g} to {allowed.high:g} {unit}"
        )


def _check_choice(name: str, what: str, asked: object, choices: tuple[object, ...]) -> None:
    if asked not in choices:
        raise ConfigError(
            f"{name}: {what} {asked}: the camera has {', '.join(str(each) for each in choices)}"
        )


def _check_period(name: str, asked: CameraSettings, ranges: CameraRanges) -> None:
    if ranges.exposure_s is None or ranges.rate_hz is None:
        return
    if not asked.exposure_s * asked.rate_hz <= 1.0 + _ROUNDING:
        raise ConfigError(
            f"{name}: exposure {asked.exposure_s:g} s is longer than the frame period of "
            f"{1.0 / asked.rate_hz:g} s: expose shorter, or lower the rate of {asked.rate_hz:g} Hz"
        )


def _check_unchanged(name: str, asked: CameraSettings, in_force: CameraSettings) -> None:
    fixed = (
        ("ROI", asked.roi, in_force.roi),
        ("binning", asked.binning, in_force.binning),
        ("pixel format", asked.pixel_format, in_force.pixel_format),
        ("trigger", asked.trigger, in_force.trigger),
    )
    for what, wanted, present in fixed:
        if wanted != present:
            raise DeviceError(
                f"{name}: the {what} cannot change while pictures are taken; stop it first",
                fault=DeviceFault.BUSY,
            )
