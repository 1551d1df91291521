"""Images, settings and recorders for the tests of recordings."""

from collections.abc import Iterator
from types import MappingProxyType

import numpy as np

from cosmic.frame.clock import WALL
from cosmic.vico.core.image import CameraImage, Circumstances
from cosmic.vico.hw.interface import CameraSettings, Frame, FrameStatus, PixelFormat, Roi

AXES = {"left.x": "um", "table.rotation": "deg"}
BITS = {PixelFormat.MONO10: 10, PixelFormat.MONO12: 12, PixelFormat.MONO16: 16}


def noise(
    pixel_format: PixelFormat = PixelFormat.MONO8,
    width: int = 37,
    height: int = 23,
    seed: int = 0,
) -> np.ndarray:
    """Return an image in which every value of a pixel occurs, as nothing is harder to code."""
    shape = (height, width, 3) if pixel_format is PixelFormat.RGB8 else (height, width)
    high = 1 << BITS.get(pixel_format, 8)
    dtype = np.uint16 if pixel_format in BITS else np.uint8
    data = np.random.default_rng(seed).integers(0, high, shape).astype(dtype)
    data.flat[0], data.flat[-1] = 0, high - 1
    data.flags.writeable = False
    return data


def settings(
    pixel_format: PixelFormat = PixelFormat.MONO8,
    width: int = 37,
    height: int = 23,
    rate_hz: float = 20.0,
) -> CameraSettings:
    """Return what is in force at a camera."""
    return CameraSettings(0.01, 0.0, rate_hz, Roi(0, 0, width, height), pixel_format=pixel_format)


def image(number: int = 0, data: np.ndarray | None = None, **how: object) -> CameraImage:
    """Return image `number` of a camera with 20 frames a second; `how` overrides parts."""
    status = how.pop("status", FrameStatus.COMPLETE)
    pixel_format = how.pop("pixel_format", PixelFormat.MONO8)
    time_s = how.pop("time_s", 100.0 + number / 20.0)
    if data is None:
        data = noise(pixel_format, seed=number)
    frame = Frame(
        data=data,
        frame_id=how.pop("frame_id", number),
        time_s=time_s,
        exposed_s=time_s - 0.0123456789,
        device_ns=how.pop("device_ns", 2**61 + number * 50_000_000),
        status=status,
        pixel_format=pixel_format,
    )
    around = Circumstances(
        exposure_s=0.01,
        gain_db=3.5,
        zoom_counts=1200.0,
        focus_counts=None,
        light_percent=40.0,
        scale_um_px=how.pop("scale_um_px", 0.8),
        positions=MappingProxyType({"left.x": 10.0 + number, "table.rotation": -1.5}),
    )
    return CameraImage("cam", frame, around, how.pop("lost_before", 0))


def images(count: int, **how: object) -> Iterator[CameraImage]:
    """Yield images in their order."""
    for number in range(count):
        yield image(number, **how)


def wait_until(condition, timeout_s: float = 10.0) -> None:
    """Wait for what another thread brings about."""
    until_s = WALL.now_s() + timeout_s
    while not condition():
        assert WALL.now_s() < until_s, "it did not come true in time"
        WALL.sleep(0.005)
