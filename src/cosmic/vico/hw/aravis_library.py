"""The cameras that Aravis finds: GigE Vision and USB3 Vision, of all makers, on Linux."""

import logging
import threading
import weakref
from typing import Final

from typing_extensions import override

from cosmic.frame.clock import WALL, Clock
from cosmic.frame.errors import DeviceError, DeviceFault, NotConnectedError
from cosmic.vico.hw.aravis_calls import AravisCalls
from cosmic.vico.hw.aravis_camera import AravisCamera
from cosmic.vico.hw.aravis_ctypes import load_library
from cosmic.vico.hw.aravis_gvcp import controlled
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
        self._cameras: list[weakref.ref[AravisCamera]] = []
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
        with _discovery:
            self._calls.plain("arv_update_device_list")
            count = self._calls.plain("arv_get_n_devices")
            return tuple(self._described(index) for index in range(count))

    @override
    def open(self, key: str) -> AravisCamera:
        with self._lock:
            handle = self._handle(key)
            try:
                info, address = self._identity(key, handle)
                self._take(key, handle, address)
            except DeviceError:
                self._calls.release(handle)
                raise
            camera = AravisCamera(self._calls, handle, info, address, self._clock)
            self._cameras.append(weakref.ref(camera))
        logger.info("camera %s opened", key)
        return camera

    @override
    def close(self) -> None:
        with self._lock:
            cameras, self._cameras = self._cameras, []
            for reference in cameras:
                camera = reference()
                if camera is not None:
                    camera.close()
            if self._fake:
                self._fake = False
                self._calls.plain("arv_disable_interface", _FAKE)

    def _handle(self, key: str) -> int:
        """Return a new ArvCamera."""
        # Left to itself Aravis takes the first network card over which the camera answers, which
        # need not be the one that its pictures can come back by; a full list settles that.
        places = self._places()
        if key not in places:
            places = self._places(anew=True)
        text, fault = "", DeviceFault.COMMUNICATION
        if key in places and self._is_free(key, places[key]):
            try:
                with _discovery:
                    return int(self._calls.checked(f"camera {key}", "arv_camera_new", key.encode()))
            except DeviceError as exc:
                text, fault = f" ({exc})", exc.fault
        found = ", ".join(self._places(anew=key in places)) or "none"
        raise NotConnectedError(
            f"Aravis cannot open a camera {key!r}; it finds: {found}. Check cable, power and, "
            f"with GigE Vision, the network addresses{text}",
            fault=fault,
        )

    def _places(self, *, anew: bool = False) -> dict[str, str]:
        """Return the address of each camera, "" where it has none."""
        if anew:
            self.cameras()
        with _discovery:
            count = self._calls.plain("arv_get_n_devices")
            return {
                self._text("id", index): self._text("address", index)
                if self._text("protocol", index) == "GigEVision"
                else ""
                for index in range(count)
            }

    def _is_free(self, key: str, address: str) -> bool:
        """Return whether a camera answers; raises where another program controls it.

        Aravis itself takes five seconds to find out either.
        """
        if not address:
            return True
        taken = controlled(address)
        if taken:
            raise _taken(key)
        return taken is not None

    def _identity(self, key: str, handle: int) -> tuple[CameraInfo, str]:
        """Return which camera it is, and its IP address if it has one."""
        vendor, model, serial = (
            (self._calls.checked(f"camera {key}", name, handle) or b"").decode(errors="replace")
            for name in _IDENTITY
        )
        info = CameraInfo(key, vendor, model, serial, simulated=vendor in _NOT_REAL)
        if not self._calls.plain("arv_camera_is_gv_device", handle):
            return info, ""
        device = self._calls.plain("arv_camera_get_device", handle)
        place = self._calls.plain("arv_gv_device_get_device_address", device)
        inet = self._calls.plain("g_inet_socket_address_get_address", place)
        return info, self._calls.owned_text("g_inet_address_to_string", inet)

    def _take(self, key: str, handle: int, address: str) -> None:
        """Make sure that a camera on the network is ours, and set its packets."""
        if not address:
            return
        device = self._calls.plain("arv_camera_get_device", handle)
        if not self._calls.plain("arv_gv_device_is_controller", device):
            raise _taken(key)
        if self._packet_bytes:
            name = "arv_camera_gv_set_packet_size"
            self._calls.checked(f"camera {key}", name, handle, self._packet_bytes)

    def _described(self, index: int) -> CameraInfo:
        vendor = self._text("vendor", index)
        return CameraInfo(
            key=self._text("id", index),
            vendor=vendor,
            model=self._text("model", index),
            serial=self._text("serial_nbr", index),
            simulated=vendor in _NOT_REAL,
        )

    def _text(self, what: str, index: int) -> str:
        found: bytes | None = self._calls.plain(f"arv_get_device_{what}", index)
        return (found or b"").decode(errors="replace")


def _taken(key: str) -> NotConnectedError:
    return NotConnectedError(
        f"camera {key} is controlled by another program or computer, or was until a few seconds "
        f"ago; close it there",
        fault=DeviceFault.OVERRIDDEN,
    )


_VERSION: Final = ("major", "minor", "micro")
_IDENTITY: Final = (
    "arv_camera_get_vendor_name",
    "arv_camera_get_model_name",
    "arv_camera_get_device_serial_number",
)
# The list of devices is one for the whole process.
_discovery: Final = threading.Lock()
