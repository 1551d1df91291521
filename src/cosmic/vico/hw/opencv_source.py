"""Where OpenCV gets pictures from: a USB camera, a film, a folder of pictures, an address."""

import re
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Final

from cosmic.vico.hw.interface import CameraInfo

SYSFS: Final = Path("/sys/class/video4linux")
_DEVICE: Final = re.compile(r"(?:/dev/)?video(\d+)")


class Kind(StrEnum):
    """What a source is."""

    DEVICE = "USB camera"
    FILM = "video file"
    PICTURES = "folder of pictures"
    ADDRESS = "network address"


@dataclass(frozen=True, slots=True)
class VideoSource:
    """One source of pictures.

    Attributes
    ----------
    address : str
        ``video0`` for a device by its number, the path of a video file, of a folder of pictures
        (in the order of their names), or an address such as ``http://192.168.0.7/video.mjpg``.
    rate_hz : float
        At which films and pictures are played; 0 is the film's own, or 15 for pictures.
    loop : bool
        Begin anew at the end; otherwise the last picture is the last.
    paced : bool
        False: a film gives its pictures as fast as they are asked for.
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
        return Kind.PICTURES if Path(self.address).is_dir() else Kind.FILM

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


def attached_devices(sysfs: Path = SYSFS) -> tuple[CameraInfo, ...]:
    """Return the video devices that Linux knows; none on other systems.

    A camera shows up twice or more, once for its pictures (index 0) and once for its metadata.
    """
    found = []
    for folder in sorted(sysfs.glob("video*"), key=lambda each: (len(each.name), each.name)):
        if _text(folder / "index") not in ("", "0"):
            continue
        usb = folder / "device" / ".."
        found.append(
            CameraInfo(
                key=folder.name,
                vendor=_text(usb / "manufacturer") or "video4linux",
                model=_text(folder / "name") or folder.name,
                serial=_text(usb / "serial"),
            )
        )
    return tuple(found)


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8", errors="replace").strip()
    except OSError:
        return ""
