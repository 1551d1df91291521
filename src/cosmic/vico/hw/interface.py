"""What ViCo asks of a camera, whatever bus it sits on (thesis 3.3.2, 5.2)."""

import re
from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Final, Protocol

import numpy as np
from typing_extensions import override

from cosmic.frame.arrays import Pixels as Pixels
from cosmic.frame.clock import Clock
from cosmic.frame.plugins import Backend

if TYPE_CHECKING:
    from cosmic.twin.scene import Scene


class PixelFormat(StrEnum):
    """How an image is coded; names are GenICam's."""

    MONO8 = "Mono8"
    MONO10 = "Mono10"
    MONO12 = "Mono12"
    MONO16 = "Mono16"
    RGB8 = "RGB8"

    @property
    def full_scale(self) -> int:
        """The largest value of a pixel: that of one that is over-exposed."""
        return _FULL_SCALE[self]


_FULL_SCALE: Final = {
    PixelFormat.MONO8: 255,
    PixelFormat.MONO10: 1023,
    PixelFormat.MONO12: 4095,
    PixelFormat.MONO16: 65535,
    PixelFormat.RGB8: 255,
}


class Trigger(StrEnum):
    """What starts an exposure."""

    FREE_RUN = "free run"
    SOFTWARE = "software"
    HARDWARE = "hardware"


class FrameStatus(StrEnum):
    """Whether an image can be trusted."""

    COMPLETE = "complete"
    INCOMPLETE = "incomplete"


@dataclass(frozen=True, slots=True)
class Roi:
    """The part of the sensor that is read; in binned pixels, from the upper left corner."""

    x_px: int
    y_px: int
    width_px: int
    height_px: int


@dataclass(frozen=True, slots=True)
class Range:
    """What a feature accepts: from `low` to `high`, in steps of `step` (0: any value)."""

    low: float
    high: float
    step: float = 0.0


@dataclass(frozen=True, slots=True)
class CameraInfo:
    """Which camera.

    Attributes
    ----------
    key : str
        What `CameraLibrary.open` takes; the same at every start where the bus has such a thing.
    sensor_px : (int, int)
        Width and height, unbinned; (0, 0) where only opening it tells.
    """

    key: str
    vendor: str
    model: str
    serial: str
    simulated: bool = False
    sensor_px: tuple[int, int] = (0, 0)


_DEVICE: Final = re.compile(r"(?:/dev/)?video(\d+)")


class Kind(StrEnum):
    """What a source is."""

    DEVICE = "USB camera"
    FILM = "video file"
    IMAGES = "folder of images"
    ADDRESS = "network address"


@dataclass(frozen=True, slots=True)
class VideoSource:
    """One source of images.

    Attributes
    ----------
    address : str
        ``video0`` for a device by its number, the path of a video file, of a folder of images
        (in the order of their names), or an address such as ``http://192.168.0.7/video.mjpg``.
    rate_hz : float
        At which films and images are played; 0 is the film's own, or 15 for images.
    loop : bool
        Begin anew at the end; otherwise the last image is the last.
    paced : bool
        False: a film gives its images as fast as they are asked for.
    size_px : (int, int) or None
        What a USB camera is asked to send; None is what it sends by itself.
    """

    address: str
    rate_hz: float = 0.0
    loop: bool = False
    paced: bool = True
    size_px: tuple[int, int] | None = None

    @property
    def kind(self) -> Kind:
        """What the address names."""
        if "://" in self.address:
            return Kind.ADDRESS
        if _DEVICE.fullmatch(self.address):
            return Kind.DEVICE
        return Kind.IMAGES if Path(self.address).is_dir() else Kind.FILM

    @property
    def device(self) -> int:
        """Number of the device."""
        found = _DEVICE.fullmatch(self.address)
        return int(found[1]) if found else -1

    @property
    def is_there(self) -> bool:
        """False when its file is not; a device or an address is asked only when opened."""
        return self.kind in (Kind.DEVICE, Kind.ADDRESS) or Path(self.address).exists()

    @property
    def info(self) -> CameraInfo:
        """The camera that it looks like."""
        name = self.address if self.kind is Kind.ADDRESS else Path(self.address).name
        return CameraInfo(key=self.address, vendor="OpenCV", model=str(self.kind), serial=name)


@dataclass(frozen=True, slots=True)
class CameraSettings:
    """How a camera takes its images."""

    exposure_s: float
    gain_db: float
    rate_hz: float
    roi: Roi
    binning: int = 1
    pixel_format: PixelFormat = PixelFormat.MONO8
    trigger: Trigger = Trigger.FREE_RUN

    @override
    def __str__(self) -> str:
        return (
            f"{1000.0 * self.exposure_s:g} ms, {self.gain_db:g} dB, {self.rate_hz:g} Hz, "
            f"{self.roi.width_px} x {self.roi.height_px} px, binning {self.binning}, "
            f"{self.pixel_format}, {self.trigger}"
        )


def array_of(settings: CameraSettings) -> tuple[tuple[int, ...], type[np.uint8] | type[np.uint16]]:
    """Return shape and type that the pixels of a frame have with `settings`."""
    roi, pixel_format = settings.roi, settings.pixel_format
    layers = (3,) if pixel_format is PixelFormat.RGB8 else ()
    eight = pixel_format in (PixelFormat.MONO8, PixelFormat.RGB8)
    return (roi.height_px, roi.width_px, *layers), np.uint8 if eight else np.uint16


@dataclass(frozen=True, slots=True)
class CameraRanges:
    """What a camera accepts with its present ROI and binning; None where it has no such feature."""

    exposure_s: Range | None
    gain_db: Range | None
    rate_hz: Range | None
    width_px: Range
    height_px: Range
    binnings: tuple[int, ...] = (1,)
    pixel_formats: tuple[PixelFormat, ...] = (PixelFormat.MONO8,)
    triggers: tuple[Trigger, ...] = (Trigger.FREE_RUN,)


@dataclass(frozen=True, slots=True)
class CameraCounters:
    """What became of the frames since `start`.

    Attributes
    ----------
    completed : int
        Handed over whole.
    failed : int
        Arrived with parts missing; never handed over as good.
    lost : int
        Never arrived, by the gaps in the frame numbers.
    underrun : int
        The camera was ready, and no buffer was free.
    """

    completed: int = 0
    failed: int = 0
    lost: int = 0
    underrun: int = 0


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """One image as the camera gave it.

    Attributes
    ----------
    data : ndarray, shape (height, width) or (height, width, 3), uint8 or uint16
        Read-only, a copy that no driver writes to again; a simulated camera draws it when it is
        first read, which should be soon. MONO10 and MONO12 count from 0 to 1023
        and 4095. Three layers are red, green, blue.
    frame_id : int
        Counts up by one a frame since `start`, 64 bit: a gap is a loss.
    time_s : float
        Platform time at which it was complete in this computer.
    exposed_s : float
        Platform time at which its exposure began, as well as it can be told; never later than
        the truth by design, so that a frame said to be exposed after a movement was.
    device_ns : int or None
        The camera's own clock.
    """

    data: Pixels
    frame_id: int
    time_s: float
    exposed_s: float
    device_ns: int | None = None
    status: FrameStatus = FrameStatus.COMPLETE
    pixel_format: PixelFormat = PixelFormat.MONO8

    @property
    def ready(self) -> bool:
        """True when `data` need not wait; only a simulated camera's frame may not be."""
        return True

    def prepare(self) -> None:
        """Have `data` made ready, without waiting for it."""

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height, without waiting for `data`."""
        height, width = self.data.shape[:2]
        return width, height


class Camera(Protocol):
    """One open camera.

    Order of calls: `configure`, `start`, `receive` again and again, `stop`; at last `close`.
    One thread receives; any thread may call `stop`, `trigger` and the properties.
    """

    @property
    @abstractmethod
    def info(self) -> CameraInfo:
        """Which camera this is, with its sensor size."""

    @property
    @abstractmethod
    def ranges(self) -> CameraRanges:
        """What it accepts now."""

    @property
    @abstractmethod
    def settings(self) -> CameraSettings:
        """What is in force, read back from the camera."""

    @property
    @abstractmethod
    def counters(self) -> CameraCounters:
        """What became of the frames since `start`."""

    @abstractmethod
    def configure(self, settings: CameraSettings) -> CameraSettings:
        """Put settings in force and return what the camera made of them.

        While it runs only exposure, gain and rate may differ from those in force. Nothing is
        changed when anything is refused.

        Raises
        ------
        ConfigError
            A value that the camera does not accept (not a number, outside its range, a ROI off
            the sensor, a pixel format it does not have, an exposure longer than the frame
            period); the text says what it accepts.
        DeviceError
            The camera is gone, or `DeviceFault.BUSY` for what cannot change while it runs.
        """

    @abstractmethod
    def start(self) -> None:
        """Begin to take images; counters begin anew.

        Raises
        ------
        DeviceError
            The camera is gone or taken by another program, or `DeviceFault.STATE`: it takes
            images already.
        """

    @abstractmethod
    def receive(self, timeout_s: float) -> Frame | None:
        """Return the next frame in order, or None after `timeout_s` of wall time.

        A frame with parts missing is counted and comes with `FrameStatus.INCOMPLETE`. Every frame
        has the shape, the type and the pixel format of `settings`, or it is refused.

        Raises
        ------
        DeviceError
            The camera is gone or failed. After it nothing more comes; close it.
        """

    @abstractmethod
    def trigger(self) -> None:
        """Take one image now, with `Trigger.SOFTWARE`.

        Raises
        ------
        NotAvailable
            Another trigger is in force.
        DeviceError
            The camera is gone.
        """

    @abstractmethod
    def stop(self) -> None:
        """End taking images; harmless when none are. A `receive` that waits returns None."""

    @abstractmethod
    def close(self) -> None:
        """Give the camera back; harmless the second time."""


class CameraLibrary(Protocol):
    """The driver behind some cameras."""

    @property
    @abstractmethod
    def name(self) -> str:
        """What the operator reads, such as "Aravis 0.8.26"."""

    @abstractmethod
    def cameras(self) -> tuple[CameraInfo, ...]:
        """Return the cameras there are now; takes its time on a network.

        Raises
        ------
        DeviceError
            The driver cannot tell.
        """

    @abstractmethod
    def open(self, key: str) -> Camera:
        """Open a camera.

        Raises
        ------
        NotConnectedError
            There is none of that key, or another program has it; the text lists those there are.
        """

    @abstractmethod
    def close(self) -> None:
        """Give everything back; harmless the second time."""


@dataclass(frozen=True, slots=True)
class CameraContext:
    """What a platform gives to the driver of some of its cameras.

    Attributes
    ----------
    clock : Clock
        The platform's, which stamps frames and paces simulated cameras.
    scene : Scene or None
        What simulated cameras see; None where there is no twin.
    sources : sequence of VideoSource, str or Path
        Films, folders of images and addresses, for "opencv".
    producers : sequence of Path or str
        GenTL producers, for "harvesters"; empty: those that are installed.
    packet_bytes : int
        Size of the packets of a GigE camera, for "aravis"; 0 leaves it alone.
    seed : int
        Of what is random in simulated cameras.
    """

    clock: Clock
    scene: "Scene | None" = None
    sources: Sequence[VideoSource | str | Path] = ()
    producers: Sequence[Path | str] = ()
    packet_bytes: int = 0
    seed: int = 0


CameraBackend = Backend[CameraContext, CameraLibrary]
"""What an entry point of the group ``cosmic.cameras`` leads to."""
