"""The IIDC cameras on IEEE 1394 that libdc1394 finds; Linux."""

import logging
import threading
import weakref
from ctypes import POINTER, byref
from typing import Any

from typing_extensions import override

from cosmic.frame.clock import WALL, Clock
from cosmic.frame.errors import DeviceFault, NotConnectedError
from cosmic.vico.hw import dc1394_ctypes as dc
from cosmic.vico.hw.dc1394_calls import Dc1394Calls
from cosmic.vico.hw.dc1394_camera import Dc1394Camera
from cosmic.vico.hw.interface import CameraInfo, CameraLibrary

logger = logging.getLogger(__name__)


class Dc1394Library(CameraLibrary):
    """libdc1394 2.2; any thread.

    Parameters
    ----------
    clock : Clock
        Stamps the frames: the platform's.
    shutter_unit_s : float
        Seconds a count of the shutter, for cameras that know no absolute values (their manual
        says it); 0 makes their exposure unavailable.
    library : ctypes.CDLL or object
        What tests put in the library's place.

    Raises
    ------
    NotConnectedError
        libdc1394 is not installed, or finds no FireWire at all.
    """

    def __init__(
        self, clock: Clock = WALL, *, shutter_unit_s: float = 0.0, library: object = None
    ) -> None:
        self._clock = clock
        self._shutter_unit_s = shutter_unit_s
        self._calls = Dc1394Calls(dc.load_library() if library is None else library)
        self._lock = threading.RLock()
        self._known: dict[str, CameraInfo] = {}
        self._cameras: list[weakref.ref[Dc1394Camera]] = []
        self._context: int | None = self._calls.plain("dc1394_new")
        if not self._context:
            raise NotConnectedError(
                "libdc1394 finds no FireWire: is there a card, with its kernel module "
                "firewire-ohci, and may you write to /dev/fw*?",
                fault=DeviceFault.COMMUNICATION,
            )

    @property
    @override
    def name(self) -> str:
        return "libdc1394 2.2"  # the library cannot tell its version

    @override
    def cameras(self) -> tuple[CameraInfo, ...]:
        with self._lock:
            return tuple(self._found().values())

    @override
    def open(self, key: str) -> Dc1394Camera:
        with self._lock:
            found = self._found()
            pointer = self._pointer(key) if key in found else None
            if not pointer:
                raise NotConnectedError(
                    f"libdc1394 cannot open a camera {key!r}; it finds: "
                    f"{', '.join(found) or 'none'}. Check cable, power and the rights to /dev/fw*",
                    fault=DeviceFault.COMMUNICATION,
                )
            camera = Dc1394Camera(
                self._calls,
                pointer,
                found[key],
                self._clock,
                shutter_unit_s=self._shutter_unit_s,
            )
            self._cameras.append(weakref.ref(camera))
        logger.info("camera %s opened", key)
        return camera

    @override
    def close(self) -> None:
        with self._lock:
            context, self._context = self._context, None
            if context is None:
                return
            for reference in self._cameras:
                camera = reference()
                if camera is not None:
                    camera.close()
            self._calls.plain("dc1394_free", context)

    def _found(self) -> dict[str, CameraInfo]:
        """Return the cameras on the bus; one is asked for its name when it is seen first."""
        if self._context is None:
            raise NotConnectedError("libdc1394 was closed", fault=DeviceFault.STATE)
        listed = POINTER(dc.dc1394camera_list_t)()
        name = "dc1394_camera_enumerate"
        self._calls.checked("libdc1394", name, self._context, byref(listed))
        try:
            ids = [listed.contents.ids[index] for index in range(listed.contents.num)]
            keys = [_key(each.guid, each.unit) for each in ids]
        finally:
            self._calls.plain("dc1394_camera_free_list", listed)
        for key in keys:
            if key not in self._known:
                self._known[key] = self._described(key)
        return {key: self._known[key] for key in keys}

    def _described(self, key: str) -> CameraInfo:
        pointer = self._pointer(key)
        if not pointer:
            return CameraInfo(key, vendor="", model="", serial=key)
        try:
            vendor, model = (
                (text or b"").decode(errors="replace").strip()
                for text in (pointer.contents.vendor, pointer.contents.model)
            )
        finally:
            self._calls.plain("dc1394_camera_free", pointer)
        return CameraInfo(key, vendor=vendor, model=model, serial=key)

    def _pointer(self, key: str) -> Any:
        guid, _, unit = key.partition("-")
        name = "dc1394_camera_new_unit"
        return self._calls.plain(name, self._context, int(guid, 16), int(unit or 0)) or None


def _key(guid: int, unit: int) -> str:
    return f"{guid:016x}" + (f"-{unit}" if unit else "")
