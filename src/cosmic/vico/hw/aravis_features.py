"""Settings and ranges of a camera that Aravis drives."""

import ctypes
from typing import Any, Final

from cosmic.frame.errors import ConfigError, DeviceError, DeviceFault
from cosmic.vico.hw import aravis_ctypes as arv
from cosmic.vico.hw.aravis_calls import AravisCalls, as_refusal
from cosmic.vico.hw.camera_checks import Sensor
from cosmic.vico.hw.interface import (
    CameraRanges,
    CameraSettings,
    PixelFormat,
    Range,
    Roi,
    Trigger,
)

_US_PER_S: Final = 1e6
# How cameras of before 2012 call a format.
_OLDER_NAMES: Final = {"RGB8Packed": PixelFormat.RGB8}


class AravisFeatures:
    """What can be set at one camera; one thread at a time.

    Parameters
    ----------
    camera : int
        Address of the ArvCamera; the caller keeps it alive.
    whom : str
        The camera, for texts.

    Raises
    ------
    DeviceError
        The camera fails, or has no pixel format that is understood.
    """

    def __init__(self, calls: AravisCalls, camera: int, whom: str) -> None:
        self._calls = calls
        self._camera = camera
        self._whom = whom
        self._trigger = Trigger.FREE_RUN
        self._has = {
            name: bool(self._get(f"arv_camera_is_{name}_available"))
            for name in ("exposure_time", "gain", "frame_rate", "binning", "region_offset")
        }
        self._formats = self._pixel_formats()
        self._hardware_line = self._find_hardware_line()
        self._has_software = bool(self._get("arv_camera_is_software_trigger_supported"))
        self._prepare()
        self.sensor_px = self._sensor_size()

    def settings(self) -> CameraSettings:
        """Read what is in force."""
        binning = self._pair("arv_camera_get_binning")[0] if self._has["binning"] else 1
        return CameraSettings(
            exposure_s=self._float("exposure_time") / _US_PER_S,
            gain_db=self._float("gain"),
            rate_hz=self._float("frame_rate"),
            roi=self._roi(),
            binning=max(1, binning),
            pixel_format=self._format() or PixelFormat.MONO8,
            trigger=self._trigger,
        )

    def ranges(self, binning: int) -> CameraRanges:
        """Read what the camera accepts now."""
        sensor = self.sensor(binning)
        exposure = self._bounds("exposure_time")
        return CameraRanges(
            exposure_s=exposure
            and Range(exposure.low / _US_PER_S, exposure.high / _US_PER_S, exposure.step),
            gain_db=self._bounds("gain"),
            rate_hz=self._bounds("frame_rate"),
            width_px=self._size("width", sensor.width_px),
            height_px=self._size("height", sensor.height_px),
            binnings=self._binnings(),
            pixel_formats=tuple(self._formats),
            triggers=self._triggers(),
        )

    def sensor(self, binning: int) -> Sensor:
        """Return where a ROI may lie with a binning, which need not be one that it has."""
        binning = max(1, binning)
        width, height = self.sensor_px
        steps = (1, 1)
        if self._has["region_offset"]:
            steps = (
                max(1, self._get("arv_camera_get_x_offset_increment")),
                max(1, self._get("arv_camera_get_y_offset_increment")),
            )
        return Sensor(width // binning, height // binning, *steps)

    def write(self, asked: CameraSettings, present: CameraSettings) -> None:
        """Put settings in force; on a refusal those in force before are put back.

        Raises
        ------
        ConfigError
            The camera does not accept a value.
        DeviceError
            The camera fails.
        """
        try:
            self._write(asked, present)
        except DeviceError as exc:
            refusal = as_refusal(exc)
            if isinstance(refusal, ConfigError):
                self._write(present, asked, everything=True)
            raise refusal from exc

    def _write(
        self, asked: CameraSettings, present: CameraSettings, *, everything: bool = False
    ) -> None:
        if self._has["binning"] and (everything or asked.binning != present.binning):
            self._call("arv_camera_set_binning", asked.binning, asked.binning)
        if everything or asked.pixel_format != present.pixel_format:
            self._set_format(asked.pixel_format)
        if everything or asked.roi != present.roi or asked.binning != present.binning:
            roi = asked.roi
            self._call("arv_camera_set_region", roi.x_px, roi.y_px, roi.width_px, roi.height_px)
        rate_changes = everything or asked.rate_hz != present.rate_hz
        # A longer exposure needs the lower rate first, and the other way round.
        if rate_changes and asked.rate_hz < present.rate_hz:
            self._set("frame_rate", asked.rate_hz)
        if everything or asked.exposure_s != present.exposure_s:
            self._set("exposure_time", asked.exposure_s * _US_PER_S)
        if rate_changes and not asked.rate_hz < present.rate_hz:
            self._set("frame_rate", asked.rate_hz)
        if everything or asked.gain_db != present.gain_db:
            self._set("gain", asked.gain_db)
        # Setting the rate makes Aravis switch triggers off at some cameras.
        if asked.trigger != self._trigger or (rate_changes and asked.trigger != Trigger.FREE_RUN):
            self._set_trigger(asked.trigger)

    def _set_trigger(self, trigger: Trigger) -> None:
        if trigger is Trigger.FREE_RUN:
            self._call("arv_camera_clear_triggers")
        else:
            source = "Software" if trigger is Trigger.SOFTWARE else self._hardware_line
            self._call("arv_camera_set_trigger", source.encode())
        self._trigger = trigger

    def _prepare(self) -> None:
        self._call("arv_camera_set_acquisition_mode", arv.ARV_ACQUISITION_MODE_CONTINUOUS)
        if self._has["exposure_time"] and self._get("arv_camera_is_exposure_auto_available"):
            self._call("arv_camera_set_exposure_time_auto", arv.ARV_AUTO_OFF)
        if self._has["gain"] and self._get("arv_camera_is_gain_auto_available"):
            self._call("arv_camera_set_gain_auto", arv.ARV_AUTO_OFF)
        if self._hardware_line or self._has_software:
            self._call("arv_camera_clear_triggers")
        if self._format() is None:
            self._set_format(next(iter(self._formats)))

    def _pixel_formats(self) -> dict[PixelFormat, str]:
        name = "arv_camera_dup_available_pixel_formats_as_strings"
        found = self._calls.strings(self._whom, name, self._camera)
        understood = {_understood(each): each for each in found}
        formats = {each: understood[each] for each in PixelFormat if each in understood}
        if not formats:
            raise DeviceError(
                f"{self._whom}: none of its pixel formats is understood: it has "
                f"{', '.join(found) or 'none'}; understood are {', '.join(PixelFormat)}",
                fault=DeviceFault.UNSUPPORTED,
            )
        return formats

    def _find_hardware_line(self) -> str:
        if not self._get_feature("TriggerSource"):
            return ""
        name = "arv_camera_dup_available_trigger_sources"
        sources = self._calls.strings(self._whom, name, self._camera)
        return next((each for each in sorted(sources) if each.startswith("Line")), "")

    def _triggers(self) -> tuple[Trigger, ...]:
        found = [Trigger.FREE_RUN]
        if self._has_software:
            found.append(Trigger.SOFTWARE)
        if self._hardware_line:
            found.append(Trigger.HARDWARE)
        return tuple(found)

    def _sensor_size(self) -> tuple[int, int]:
        width, height = self._pair("arv_camera_get_sensor_size")
        if width > 0 and height > 0:
            return width, height
        roi = self._roi()
        return (
            self._pair("arv_camera_get_width_bounds")[1] + roi.x_px,
            self._pair("arv_camera_get_height_bounds")[1] + roi.y_px,
        )

    def _roi(self) -> Roi:
        parts = [ctypes.c_int() for _ in range(4)]
        self._call("arv_camera_get_region", *(ctypes.byref(part) for part in parts))
        return Roi(*(part.value for part in parts))

    def _size(self, side: str, whole: int) -> Range:
        low, _ = self._pair(f"arv_camera_get_{side}_bounds")
        step = max(1, self._get(f"arv_camera_get_{side}_increment"))
        return Range(max(1, low), whole, step)

    def _binnings(self) -> tuple[int, ...]:
        if not self._has["binning"]:
            return (1,)
        both = []
        for axis in ("x", "y"):
            low, high = self._pair(f"arv_camera_get_{axis}_binning_bounds")
            step = max(1, self._get(f"arv_camera_get_{axis}_binning_increment"))
            both.append(set(range(max(1, low), high + 1, step)))
        return tuple(sorted(both[0] & both[1])) or (1,)

    def _format(self) -> PixelFormat | None:
        answer: bytes = self._get("arv_camera_get_pixel_format_as_string") or b""
        return _understood(answer.decode())

    def _set_format(self, pixel_format: PixelFormat) -> None:
        name = self._formats[pixel_format].encode()
        self._call("arv_camera_set_pixel_format_from_string", name)

    def _bounds(self, feature: str) -> Range | None:
        if not self._has[feature]:
            return None
        name = f"arv_camera_get_{feature}_bounds"
        low, high = self._calls.pair(self._whom, name, self._camera, ctypes.c_double)
        return Range(low, high)

    def _float(self, feature: str) -> float:
        return float(self._get(f"arv_camera_get_{feature}")) if self._has[feature] else 0.0

    def _set(self, feature: str, value: float) -> None:
        if self._has[feature]:
            self._call(f"arv_camera_set_{feature}", value)

    def _get_feature(self, name: str) -> bool:
        found = self._calls.checked(
            self._whom, "arv_camera_is_feature_available", self._camera, name.encode()
        )
        return bool(found)

    def _get(self, name: str) -> Any:
        return self._calls.checked(self._whom, name, self._camera)

    def _call(self, name: str, *args: object) -> None:
        self._calls.checked(self._whom, name, self._camera, *args)

    def _pair(self, name: str) -> tuple[int, int]:
        return self._calls.pair(self._whom, name, self._camera)


def _understood(name: str) -> PixelFormat | None:
    """Return the format of a GenICam name, None where it is none of ours."""
    if name in set(PixelFormat):
        return PixelFormat(name)
    return _OLDER_NAMES.get(name)
