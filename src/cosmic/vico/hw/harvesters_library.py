"""Cameras of any vendor through a GenTL producer, by the harvesters package (extra `gentl`)."""

import logging
import signal
import threading
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from typing_extensions import override

from cosmic.frame.clock import WALL, Clock
from cosmic.frame.errors import DeviceFault, NotConnectedError
from cosmic.vico.hw.harvesters_camera import HarvestersCamera
from cosmic.vico.hw.interface import CameraInfo, CameraLibrary

logger = logging.getLogger(__name__)

BUFFERS = 8


class HarvestersLibrary(CameraLibrary):
    """The GenTL producers of `producers`; any thread.

    Parameters
    ----------
    clock : Clock
        Stamps the frames: the platform's.
    producers : sequence of Path
        The vendors' ``.cti`` files.

    Raises
    ------
    NotConnectedError
        The package is not installed, or a file is not there.
    """

    def __init__(self, clock: Clock = WALL, *, producers: Sequence[Path | str]) -> None:
        self._clock = clock
        self._core = _harvesters()
        self._errors = (self._core.GenTL_GenericException, self._core.GenApi_GenericException)
        self._lock = threading.RLock()
        self._cameras: dict[str, HarvestersCamera] = {}
        self._listed: tuple[CameraInfo, ...] = ()
        self._closed = False
        self._producers = tuple(Path(each) for each in producers)
        for each in self._producers:
            if not each.is_file():
                raise NotConnectedError(
                    f"GenTL: there is no producer {each}; install the vendor's driver and give "
                    f"the path of its .cti file",
                    fault=DeviceFault.COMMUNICATION,
                )
        self._harvester: Any = self._core.Harvester()
        for each in self._producers:
            self._harvester.add_file(str(each))

    @property
    @override
    def name(self) -> str:
        names = ", ".join(each.name for each in self._producers)
        return f"GenTL ({names or 'no producer'})"

    @override
    def cameras(self) -> tuple[CameraInfo, ...]:
        with self._lock:
            self._check_open("list the cameras")
            # Looking for cameras anew makes harvesters drop the ones that are open.
            if not self._cameras:
                self._harvester.update()
                found = [each.property_dict for each in self._harvester.device_info_list]
                self._listed = tuple(_info(each) for each in found)
            return self._listed

    @override
    def open(self, key: str) -> HarvestersCamera:
        with self._lock:
            listed = {each.key: each for each in self.cameras()}
            if key not in listed:
                raise NotConnectedError(
                    f"GenTL: there is no camera {key!r}; the producers list: "
                    f"{', '.join(listed) or 'none'}",
                    fault=DeviceFault.COMMUNICATION,
                )
            acquirer = self._acquirer(key)
            camera = HarvestersCamera(
                listed[key], acquirer, self._clock, errors=self._errors, closed=self._forget
            )
            acquirer.add_callback(
                acquirer.Events.INCOMPLETE_BUFFER, _Incomplete(camera.tell_incomplete)
            )
            self._cameras[key] = camera
            return camera

    @override
    def close(self) -> None:
        with self._lock:
            if self._closed:
                return
            for camera in tuple(self._cameras.values()):
                camera.close()
            self._closed = True
            self._harvester.reset()

    def _acquirer(self, key: str) -> Any:
        keys = self._core.ParameterKey
        # The package waits in native code without letting other threads run: it must not wait.
        config = self._core.ParameterSet(
            {
                keys.TIMEOUT_PERIOD_ON_UPDATE_EVENT_DATA_CALL: 0,
                keys.NUM_BUFFERS_FOR_FETCH_CALL: BUFFERS,
                keys.ENABLE_AUTO_CHUNK_DATA_UPDATE: False,
            }
        )
        before = signal.getsignal(signal.SIGINT)
        try:
            return self._harvester.create({"id_": key}, config=config)
        except (*self._errors, ValueError) as exc:
            raise NotConnectedError(
                f"GenTL: the camera {key!r} does not open: {exc}; close other programs that use "
                f"it, and check its cable",
                fault=DeviceFault.COMMUNICATION,
            ) from exc
        finally:
            # It takes Ctrl-C for itself when called in the main thread.
            if threading.current_thread() is threading.main_thread():
                signal.signal(signal.SIGINT, before)

    def _forget(self, camera: HarvestersCamera) -> None:
        with self._lock:
            self._cameras.pop(camera.info.key, None)

    def _check_open(self, call: str) -> None:
        if self._closed:
            raise NotConnectedError(
                f"GenTL: {call}: the library was closed", fault=DeviceFault.STATE
            )


class _Incomplete:
    """Hands the package's word on to a camera."""

    def __init__(self, tell: Callable[[], None]) -> None:
        self._tell = tell

    def emit(self, context: object = None) -> None:  # noqa: ARG002 - the package's signature
        """Count a frame with parts missing."""
        self._tell()


def _harvesters() -> Any:
    try:
        from harvesters import core
    except ImportError as exc:
        raise NotConnectedError(
            "GenTL: the package harvesters is not installed; install CoSMic with its extra "
            "'gentl', such as: pip install cosmic[gentl]",
            fault=DeviceFault.UNSUPPORTED,
        ) from exc
    return core


def _info(found: dict[str, Any]) -> CameraInfo:
    def text(name: str) -> str:
        return str(found.get(name) or "")

    return CameraInfo(
        key=text("id_"),
        vendor=text("vendor"),
        model=text("model"),
        serial=text("serial_number"),
    )
