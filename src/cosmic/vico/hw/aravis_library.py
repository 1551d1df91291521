"""The cameras that Aravis finds: GigE Vision and USB3 Vision, of all makers, on Linux."""

import logging
import threading
from typing import Final

from typing_extensions import override

from cosmic.frame.clock import WALL, Clock
from cosmic.frame.errors import DeviceError, DeviceFault, NotConnectedError
from cosmic.vico.hw.aravis_calls import AravisCalls
from cosmic.vico.hw.aravis_camera import AravisCamera
from cosmic.vico.hw.aravis_ctypes import load_library
from cosmic.vico.hw.interface import CameraInfo, CameraLibrary

logger = logging.getLogger(__name__)

_FAKE: Final = b"Fake"
_NOT_REAL: Final = frozenset({"Aravis"})  # the maker that Aravis' own fake cameras name


class AravisLibrary(CameraLibrary):
    """Aravis 0.8; any thread.

    Parameters
    ----------
    clock : Clock
        Stamps the frames: the platform's.
    packet_bytes : int
        Size of GigE Vision's packets; 0 leaves what the camera has, and lets Aravis make it
        smaller where the network does not carry it. 8000 and more needs jumbo frames.
    fake : bool
        Also offer the fake camera that Aravis has inside, Fake_1, without a network.
    library : ctypes.CDLL or object
        What tests put in Aravis' place.

    Raises
    ------
    NotConnectedError
        Aravis is not installed; the text says which package it is in.
    """

    def __init__(
        self,
        clock: Clock = WALL,
        *,
        packet_bytes: int = 0,
        fake: bool = False,
        library: object = None,
    ) -> None:
        self._clock = clock
        self._packet_bytes = packet_bytes
        self._calls = AravisCalls(load_library() if library is None else library)
        self._lock = threading.Lock()
        self._cameras: list[AravisCamera] = []
        self._fake = fake
        if fake:
            self._calls.plain("arv_enable_interface", _FAKE)

    @property
    @override
    def name(self) -> str:
        parts = [self._calls.plain(f"arv_get_{part}_version") for part in _VERSION]
        return f"Aravis {'.'.join(str(part) for part in parts)}"

    @override
    def cameras(self) -> tuple[CameraInfo, ...]:
        return tuple(info for info, _ in self._found())

    @override
    def open(self, key: str) -> AravisCamera:
        with self._lock:
            found = {info.key: (info, address) for info, address in self._found()}
            if key not in found:
                raise NotConnectedError(
                    f"Aravis finds no camera {key!r}; it finds: {', '.join(found) or 'none'}. "
                    f"Check cable, power and, with GigE Vision, the network addresses",
                    fault=DeviceFault.COMMUNICATION,
                )
            camera = self._opened(*found[key])
            self._cameras.append(camera)
        logger.info("camera %s opened", key)
        return camera

    @override
    def close(self) -> None:
        with self._lock:
            cameras, self._cameras = self._cameras, []
            for camera in cameras:
                camera.close()
            if self._fake:
                self._fake = False
                self._calls.plain("arv_disable_interface", _FAKE)

    def _opened(self, info: CameraInfo, address: str) -> AravisCamera:
        whom = f"camera {info.key}"
        try:
            handle = self._calls.checked(whom, "arv_camera_new", info.key.encode())
        except DeviceError as exc:
            raise NotConnectedError(str(exc), fault=exc.fault, code=exc.code) from exc
        if not handle:
            raise NotConnectedError(f"{whom} cannot be opened", fault=DeviceFault.COMMUNICATION)
        try:
            if self._calls.plain("arv_camera_is_gv_device", handle):
                self._take(whom, handle)
        except DeviceError:
            self._calls.plain("g_object_unref", handle)
            raise
        return AravisCamera(self._calls, handle, info, address, self._clock)

    def _take(self, whom: str, handle: int) -> None:
        """Make sure that a camera on the network is ours, and set its packets."""
        device = self._calls.plain("arv_camera_get_device", handle)
        if not self._calls.plain("arv_gv_device_is_controller", device):
            raise NotConnectedError(
                f"{whom} is controlled by another program or computer; close it there",
                fault=DeviceFault.OVERRIDDEN,
            )
        if self._packet_bytes:
            name = "arv_camera_gv_set_packet_size"
            self._calls.checked(whom, name, handle, self._packet_bytes)

    def _found(self) -> list[tuple[CameraInfo, str]]:
        with _discovery:
            self._calls.plain("arv_update_device_list")
            count = self._calls.plain("arv_get_n_devices")
            return [self._described(index) for index in range(count)]

    def _described(self, index: int) -> tuple[CameraInfo, str]:
        protocol = self._text("protocol", index)
        vendor = self._text("vendor", index)
        info = CameraInfo(
            key=self._text("id", index),
            vendor=vendor,
            model=self._text("model", index),
            serial=self._text("serial_nbr", index),
            simulated=protocol == "Fake" or vendor in _NOT_REAL,
        )
        return info, self._text("address", index) if protocol == "GigEVision" else ""

    def _text(self, what: str, index: int) -> str:
        found: bytes | None = self._calls.plain(f"arv_get_device_{what}", index)
        return (found or b"").decode(errors="replace")


_VERSION: Final = ("major", "minor", "micro")
# The list of devices is one for the whole process.
_discovery: Final = threading.Lock()
