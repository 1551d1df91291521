"""What a GenTL camera's node map offers, in CoSMic's units (GenICam SFNC names)."""

import logging
from dataclasses import replace
from typing import Any, Final

from cosmic.vico.hw.camera_checks import Sensor
from cosmic.vico.hw.interface import (
    CameraRanges,
    CameraSettings,
    PixelFormat,
    Range,
    Roi,
    Trigger,
)

logger = logging.getLogger(__name__)

EXPOSURE: Final = ("ExposureTime", "ExposureTimeAbs")
GAIN: Final = ("Gain",)
RATE: Final = ("AcquisitionFrameRate", "AcquisitionFrameRateAbs")
BINNING: Final = ("BinningHorizontal", "BinningVertical")

# What a camera may call a format that CoSMic has; the first that it has is taken.
CODES: Final = {
    PixelFormat.MONO8: ("Mono8",),
    PixelFormat.MONO10: ("Mono10",),
    PixelFormat.MONO12: ("Mono12",),
    PixelFormat.MONO16: ("Mono16",),
    PixelFormat.RGB8: ("RGB8", "RGB8Packed", "BGR8", "BGR8Packed", "RGBa8", "BGRa8"),
}
# Cameras that choose exposure and gain themselves refuse to be told.
_PREPARE: Final = (
    ("ExposureAuto", "Off"),
    ("GainAuto", "Off"),
    ("AcquisitionMode", "Continuous"),
    ("TriggerSelector", "FrameStart"),
    ("AcquisitionFrameRateEnable", True),
)


class Features:
    """Reads and writes a node map; what a camera has not is left out.

    Parameters
    ----------
    node_map : object
        The camera's.
    errors : tuple of exception types
        What it raises.
    """

    def __init__(self, node_map: Any, errors: tuple[type[Exception], ...]) -> None:
        self._map = node_map
        self._errors: tuple[type[Exception], ...] = (*errors, AttributeError)
        for name, value in _PREPARE:
            self._try_set(name, value)
        self._codes = self._find_codes()
        self.sensor_px = self._sensor_px()

    def settings(self) -> CameraSettings:
        """Read what is in force; exposure, gain and rate are 0 where the camera cannot tell."""
        return CameraSettings(
            exposure_s=self._number(EXPOSURE) * 1e-6,
            gain_db=self._number(GAIN),
            rate_hz=self._number(RATE),
            roi=Roi(
                x_px=int(self._number(("OffsetX",))),
                y_px=int(self._number(("OffsetY",))),
                width_px=int(self._number(("Width",))),
                height_px=int(self._number(("Height",))),
            ),
            binning=self.binning(),
            pixel_format=self._pixel_format(),
            trigger=self._trigger(),
        )

    def ranges(self) -> CameraRanges:
        """Read what the camera accepts now."""
        exposure_us = self._range(EXPOSURE)
        return CameraRanges(
            exposure_s=exposure_us
            and Range(exposure_us.low * 1e-6, exposure_us.high * 1e-6, exposure_us.step * 1e-6),
            gain_db=self._range(GAIN),
            rate_hz=self._range(RATE),
            width_px=self._size("Width", self.sensor_px[0] // self.binning()),
            height_px=self._size("Height", self.sensor_px[1] // self.binning()),
            binnings=self._binnings(),
            pixel_formats=tuple(self._codes) or (PixelFormat.MONO8,),
            triggers=self._triggers(),
        )

    def sensor(self, binning: int) -> Sensor:
        """Return where a ROI may lie with `binning`."""
        width_px, height_px = self.sensor_px
        steps = [self._range((name,)) for name in ("OffsetX", "OffsetY")]
        # Without an offset only the corner itself is left.
        x_step, y_step = (int(each.step) or 1 if each else 2**31 for each in steps)
        scale = max(binning, 1)
        return Sensor(width_px // scale, height_px // scale, x_step, y_step)

    def apply(self, wanted: CameraSettings) -> None:
        """Write settings that were checked, what differs only; raises the package's errors."""
        now = self.settings()
        if wanted.binning != now.binning:
            self._clear_offsets()
            for name in BINNING:
                self._set(name, wanted.binning)
            now = self.settings()
        if wanted.roi != now.roi:
            self._clear_offsets()
            self._set("Width", wanted.roi.width_px)
            self._set("Height", wanted.roi.height_px)
            for name, value in (("OffsetX", wanted.roi.x_px), ("OffsetY", wanted.roi.y_px)):
                if value:
                    self._set(name, value)
        if wanted.pixel_format is not now.pixel_format:
            self._set("PixelFormat", self._codes[wanted.pixel_format])
        if wanted.trigger is not now.trigger:
            self._set_trigger(wanted.trigger)
        # The slower rate comes before the longer exposure, and the other way round.
        rate = (RATE, wanted.rate_hz, now.rate_hz)
        exposure = (EXPOSURE, wanted.exposure_s * 1e6, now.exposure_s * 1e6)
        order = (exposure, rate) if wanted.rate_hz > now.rate_hz else (rate, exposure)
        gain = (GAIN, wanted.gain_db, now.gain_db)
        for names, number, before in (*order, gain):
            if number != before:
                self._set(self._first(names), number)

    def fire(self) -> None:
        """Take one picture, with the software trigger."""
        self._map.TriggerSoftware.execute()

    def binning(self) -> int:
        """Return the binning in force."""
        return int(self._number(BINNING[:1])) or 1

    def _first(self, names: tuple[str, ...]) -> str:
        return next((each for each in names if self._value(each) is not None), names[0])

    def _value(self, name: str) -> Any:
        try:
            return getattr(self._map, name).value
        except self._errors:
            return None

    def _number(self, names: tuple[str, ...]) -> float:
        return float(self._value(self._first(names)) or 0.0)

    def _range(self, names: tuple[str, ...]) -> Range | None:
        try:
            node = getattr(self._map, self._first(names))
            low, high = float(node.min), float(node.max)
        except self._errors:
            return None
        try:
            step = float(node.inc)
        except self._errors:  # many numbers have none
            step = 0.0
        return Range(low, high, step)

    def _size(self, name: str, whole: int) -> Range:
        found = self._range((name,)) or Range(whole, whole, 1.0)
        return replace(found, high=float(whole))

    def _set(self, name: str, value: object) -> None:
        logger.debug("GenTL: %s = %s", name, value)
        getattr(self._map, name).value = value

    def _try_set(self, name: str, value: object) -> None:
        try:
            self._set(name, value)
        except self._errors:
            logger.debug("GenTL: %s is not there or fixed", name)

    def _clear_offsets(self) -> None:
        for name in ("OffsetX", "OffsetY"):
            if self._value(name):
                self._set(name, 0)

    def _symbols(self, name: str) -> tuple[str, ...]:
        try:
            return tuple(str(each) for each in getattr(self._map, name).symbolics)
        except self._errors:
            return ()

    def _find_codes(self) -> dict[PixelFormat, str]:
        there = self._symbols("PixelFormat")
        found = {
            pixel_format: next((code for code in codes if code in there), "")
            for pixel_format, codes in CODES.items()
        }
        return {each: code for each, code in found.items() if code}

    def _pixel_format(self) -> PixelFormat:
        now = self._value("PixelFormat")
        for pixel_format, codes in CODES.items():
            if now in codes:
                return pixel_format
        if not self._codes:
            return PixelFormat.MONO8
        # A camera wakes up in a format that CoSMic does not read, such as a Bayer one.
        first = next(iter(self._codes))
        self._set("PixelFormat", self._codes[first])
        return first

    def _sensor_px(self) -> tuple[int, int]:
        whole = (self._value("SensorWidth"), self._value("SensorHeight"))
        if all(whole):
            return int(whole[0]), int(whole[1])
        binning = self.binning()
        width_px, height_px = (
            int(self._value(f"{side}Max") or self._highest(side)) for side in ("Width", "Height")
        )
        return width_px * binning, height_px * binning

    def _highest(self, name: str) -> float:
        found = self._range((name,))
        return found.high if found else 0.0

    def _binnings(self) -> tuple[int, ...]:
        found = [self._range((name,)) for name in BINNING]
        if found[0] is None or found[1] is None:
            return (1,)
        highest = int(min(found[0].high, found[1].high))
        step = int(found[0].step) or 1
        return tuple(range(1, highest + 1, step)) or (1,)

    def _triggers(self) -> tuple[Trigger, ...]:
        sources = self._symbols("TriggerSource")
        triggers = [Trigger.FREE_RUN]
        if "On" in self._symbols("TriggerMode"):
            if "Software" in sources and hasattr(self._map, "TriggerSoftware"):
                triggers.append(Trigger.SOFTWARE)
            if any(each.startswith("Line") for each in sources):
                triggers.append(Trigger.HARDWARE)
        return tuple(triggers)

    def _trigger(self) -> Trigger:
        if self._value("TriggerMode") != "On":
            return Trigger.FREE_RUN
        software = self._value("TriggerSource") == "Software"
        return Trigger.SOFTWARE if software else Trigger.HARDWARE

    def _set_trigger(self, trigger: Trigger) -> None:
        if trigger is Trigger.FREE_RUN:
            self._set("TriggerMode", "Off")
            return
        lines = [each for each in self._symbols("TriggerSource") if each.startswith("Line")]
        self._set("TriggerSource", "Software" if trigger is Trigger.SOFTWARE else lines[0])
        self._set("TriggerMode", "On")
